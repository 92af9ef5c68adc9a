"""Kinds of special points: name, marker, colour, and what can start from one.

An event carries its entry as `Event.look`; `look_of` finds it for a point of a file, of which the
kind alone is known. A kind without an entry, as codimension-two points, has the marker of all such.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Look:
    """Entry of one kind."""

    name: str = ""  # in words, "fold"
    marker: str = "d"  # letter of matplotlib
    # of its curve in two parameters: a name of `plotting.canvas`, and how it is drawn
    colour: Literal["black", "vermillion", "blue"] = "black"
    line: Literal["solid", "dashed", "dashdot"] = "solid"
    # whether other branches leave the point ("arms"), and whether it is followed ("boundary")
    starts: tuple[str, ...] = ()
    nothing_leaves: str = ""  # reason why no branch can be followed from it
    constructor: str = ""  # call that makes the event for anybody's equations


MEETING = Look("meeting of two kinds", "p")  # as PF-GR
_BOTH, _BOUNDARY = ("arms", "boundary"), ("boundary",)
LOOKS = {
    "LP": Look("fold", "s", starts=_BOUNDARY, constructor="cb.fold()"),
    "BP": Look("branch point", "D", starts=_BOTH, constructor="cb.branch_point()"),
    "PF": Look("pitchfork", "^", "vermillion", "dashdot", starts=_BOTH),
    "PD": Look("period doubling", "v", starts=_BOTH),
    "NS": Look(
        "Neimark\N{EN DASH}Sacker", "o", "blue", starts=_BOUNDARY,
        nothing_leaves="a torus does, which no fixed number of equations describes",
    ),
    "KC": Look(
        "Krein collision", "8", "blue", starts=_BOUNDARY,
        nothing_leaves="two pairs of multipliers leave the circle there, and no other orbits",
    ),
    "GR": Look("grazing", "X", line="dashed", starts=_BOTH),
    "HB": Look(
        "Hopf point", "*", starts=_BOUNDARY, constructor="cb.hopf()",
        nothing_leaves="the cycles that leave it need the flow: begin with cb.equilibrium",
    ),
    "UZ": Look("level", "P", starts=_BOUNDARY),
    "EP": Look("end", "."),
    "MX": Look("failure", "x"),
    "CP": Look("cusp", "h"),
    "VI": Look("vanishing impact", "<", starts=_BOTH),
    "CC": Look("corner collision", starts=_BOTH),
    "SL": Look("sliding", ">"),
}  # fmt: skip


def look_of(kind: str) -> Look:
    """Entry of a kind, by its label."""
    return MEETING if "-" in kind else LOOKS.get(kind, Look())
