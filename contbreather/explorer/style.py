"""How a page looks: beside each other where there is room, below each other where not; colours."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

from contbreather.plotting.canvas import BLACK, BLUE, CYCLE, VERMILLION
from contbreather.plotting.zones import SHADES

T = TypeVar("T")
GRID = """
:host { display: grid !important; gap: 10px; padding: 8px !important; align-items: stretch;
  grid-template-columns: 300px minmax(0, 1fr) minmax(0, 1fr);
  grid-template-rows: repeat(4, auto) 1fr;
  grid-template-areas: "status status status" "forms zones branches" "forms profile motion"
    "forms multipliers words" "forms run run"; }
.status { grid-area: status; } .forms { grid-area: forms; } .zones { grid-area: zones; }
.branches { grid-area: branches; } .profile { grid-area: profile; }
.motion { grid-area: motion; } .multipliers { grid-area: multipliers; }
.words { grid-area: words; } .run { grid-area: run; }
.card { align-self: stretch !important; height: auto !important; min-width: 0; }
@container (max-width: 1000px) {
  :host { grid-template-columns: minmax(0, 1fr);
  grid-template-rows: none;
  grid-template-areas: "status" "zones" "branches" "words" "forms" "profile" "motion"
    "multipliers" "run"; }
}
"""
FORMS = """
:host { display: grid !important; gap: 10px; align-content: start;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 280px), 1fr)); }
"""
OUTER = ":host { container-type: inline-size; }"  # what the query above looks at
CARD = """
:host { border: 1px solid color-mix(in srgb, currentColor 18%, transparent); border-radius: 6px;
  padding: 6px !important; }
"""
STUCK = """
:host { position: sticky; top: 0; z-index: 5; background: var(--bs-body-bg, white);
  box-shadow: 0 -16px 0 8px var(--bs-body-bg, white); }
"""  # by its shadow what scrolls is not seen above it, either
WORDS = """
.trouble { color: #c92a2a; font-size: 13px; margin: 2px 0 4px; }
:host-context([data-bs-theme=dark]) .trouble { color: #ff8787; }
h2 { font-size: 15px; margin: 2px 0; font-weight: 600; }
dl { margin: 0; font-size: 13px; line-height: 1.4; } dt { font-weight: 600; }
dd { margin: 0 0 5px 0; overflow-wrap: anywhere; }
table { font-size: 13px; border-collapse: collapse; margin-bottom: 6px; }
th, td { padding: 0 12px 0 0; } td { font-variant-numeric: tabular-nums; }
pre { font-size: 12px; white-space: pre-wrap; overflow-wrap: anywhere; margin: 4px 0; }
"""
WRAPPED = ".bk-input-group { flex-wrap: wrap; }"  # many boxes in more than one line
FOCUSED = ":focus-visible { outline: 3px solid #3d8bfd !important; }"  # of all buttons alike
# the first time a page follows what the system of its reader prefers
FOLLOW = """
if (!location.search.includes("theme=") && matchMedia("(prefers-color-scheme: dark)").matches)
  location.replace("?theme=dark")
"""
# Sliders have no name for those who read by ear; they are drawn anew now and then.
NAMES = """
const name = root => {
  for (const one of root.querySelectorAll("*")) if (one.shadowRoot) {
    const handle = one.shadowRoot.querySelector(".noUi-handle")
    const title = one.shadowRoot.querySelector(".bk-slider-title")
    if (handle && title) handle.ariaLabel = title.textContent.split(":")[0]
    name(one.shadowRoot)
  }
}
setInterval(() => name(document), 1000)
"""
LINK = """
a { color: inherit; font-size: 14px; }
"""


@dataclass(frozen=True)
class Theme:
    """Colours by what they are for, `black` and others by the names that kinds have for them; the
    hues are Okabe and Ito's, lighter on dark paper."""

    text: str
    grid: str
    faint: str
    black: str
    blue: str
    vermillion: str
    cycle: tuple[str, ...]
    stable: str
    unstable: str
    band: str
    paper: str

    def colours(self, names: Iterable[T]) -> dict[T, str]:
        """One for each, again from the first where there are more."""
        return dict(zip(names, itertools.cycle(self.cycle), strict=False))


LIGHT = Theme(
    text="#212529", grid="#e9ecef", faint="#8a9097", black=BLACK, blue=BLUE, vermillion=VERMILLION,
    cycle=CYCLE, stable=SHADES["S"], unstable=SHADES["US"], band="#BFDDF2", paper="#ffffff",
)  # fmt: skip
DARK = Theme(
    text="#dee2e6", grid="#343a40", faint="#868e96", black="#f1f3f5", blue="#56B4E9",
    vermillion="#F5853F",
    cycle=("#56B4E9", "#F5853F", "#2CC295", "#E29DC3", "#F2B84B", "#A8D8F5", "#f1f3f5"),
    stable="#17405a", unstable="#4d3320", band="#274B63", paper="#212529",
)  # fmt: skip
