"""Colours of the figures on light and on dark paper."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Theme:
    """Colours by what they are for; the hues are Okabe and Ito's, lighter on dark paper."""

    text: str
    grid: str
    faint: str
    line: str
    blue: str
    vermillion: str
    cycle: tuple[str, ...]
    stable: str
    unstable: str
    band: str
    paper: str


LIGHT = Theme(
    text="#212529", grid="#e9ecef", faint="#8a9097", line="#000000", blue="#0072B2",
    vermillion="#D55E00",
    cycle=("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"),
    stable="#D9EAF5", unstable="#FBE6D5", band="#BFDDF2", paper="#ffffff",
)  # fmt: skip
DARK = Theme(
    text="#dee2e6", grid="#343a40", faint="#868e96", line="#f1f3f5", blue="#56B4E9",
    vermillion="#F5853F",
    cycle=("#56B4E9", "#F5853F", "#2CC295", "#E29DC3", "#F2B84B", "#A8D8F5", "#f1f3f5"),
    stable="#17405a", unstable="#4d3320", band="#274B63", paper="#212529",
)  # fmt: skip
