"""A zone diagram as it is drawn: its curves, or until these are computed those of its neighbours
carried on to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.parse import as_typed
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.regions import Region, regions
from contbreather.orbits.zone_diagram import KINDS, Zones
from contbreather.parameters import OPTIONAL
from contbreather.plotting.labels import evenly
from contbreather.plotting.zones import names_of_meetings

Array = NDArray[np.float64]
Meeting = tuple[float, float, str]

STOPPED = ", stopped: curves may be missing"
FINE = 80  # points of a curve between two others
# Restitutions at which diagrams are computed ahead: halfway between two of them curves are
# off by 2e-3 at most, about as wide as a line.
LADDER = (0.02, 0.05, *(round(0.05 * i, 2) for i in range(2, 20)), 0.98)


@dataclass(frozen=True, eq=False)
class Preview:
    """What is drawn of a diagram."""

    fixed: tuple[str, float]
    about: str  # what its breathers are on, in words
    exact: bool  # False for what is between two neighbours
    curves: dict[str, tuple[Array, ...]]  # by kind, arrays of shape (n, 2)
    regions: tuple[Region, ...]  # with the verdicts of breathers in this plane in any case
    meetings: tuple[Meeting, ...]
    pair: tuple[str, str] = ("gamma", "a")


def preview_of(zones: Zones) -> Preview:
    """A diagram that is computed."""
    curves = {kind: tuple(_line(zones, branch) for branch in zones[kind]) for kind in KINDS}
    return Preview(
        zones.fixed,
        _about(zones),
        True,
        curves,
        () if zones.interrupted else zones.regions,  # curves that are missing would bound them
        tuple(names_of_meetings(zones)),
        zones.pair,
    )


def diagram_between(left: Zones, right: Zones, k: float) -> Preview | None:
    """The diagram at k by those at two values beside it; None where these have not the same curves
    and meetings, for then something happens between them.

    Examples
    --------
    >>> from contbreather.orbits import zones
    >>> left, right = zones(k=[0.75, 0.8])
    >>> between(left, right, 0.78).exact
    False
    """
    if _shape(left) != _shape(right):
        return None
    share = (k - left.fixed[1]) / (right.fixed[1] - left.fixed[1])
    curves = {
        kind: tuple(
            _mixed(_line(left, a), _line(right, b), share)
            for a, b in zip(left[kind], right[kind], strict=True)
        )
        for kind in KINDS
    }
    meetings = tuple(
        (x0 + share * (x1 - x0), y0 + share * (y1 - y0), name)
        for (x0, y0, name), (x1, y1, _) in zip(_sorted(left), _sorted(right), strict=True)
    )
    at_k = replace(left, fixed=("k", k))
    lines = [line for kind in KINDS for line in curves[kind]]
    places = np.vstack(lines)
    box: Any = tuple(zip(places.min(axis=0).tolist(), places.max(axis=0).tolist(), strict=True))
    judged = regions(lines, box, at_k.unstable, at_k.lower)
    return Preview(("k", k), _about(left), False, curves, judged, meetings)


def _about(zones: Zones) -> str:
    for _, branch in zones:
        return model_in_words(branch[0].solution) + STOPPED * zones.interrupted
    return "no curve"


def is_of(drawn: Preview, orbit: Orbit) -> bool:
    """Whether it is a diagram of such breathers."""
    return model_in_words(orbit) == drawn.about.removesuffix(STOPPED)


def model_in_words(orbit: Orbit) -> str:
    """What a breather is on, in words; zones are of one such."""
    on, site = orbit.conditions, orbit.section.hit[0]
    words = [on.lattice.describe(), f"site {site}" if site else ""]
    words += [f"{n} = {value:.10g}" for n in OPTIONAL if (value := getattr(on, n))]
    words += [f"walls {walls}" if (walls := as_typed(on.walls)) else ""]
    return ", ".join(filter(None, words))


def _line(zones: Zones, branch: Any) -> Array:
    return np.column_stack([branch[name] for name in zones.pair])


def _sorted(zones: Zones) -> list[Meeting]:
    return sorted(names_of_meetings(zones), key=lambda met: (met[2], met[0]))


def _shape(zones: Zones) -> Any:
    """Which curves and meetings there are."""
    return [len(zones[kind]) for kind in KINDS], [name for *_, name in _sorted(zones)]


def _mixed(line: Array, other: Array, share: float) -> Array:
    """Between two curves, point by point at the same part of their lengths."""
    ends = line[[0, -1]]
    straight, turned = (np.abs(ends - other[way]).sum() for way in ([0, -1], [-1, 0]))
    if turned < straight:  # they were walked in opposite directions
        other = other[::-1]
    first, last = evenly(line, FINE), evenly(other, FINE)
    return first + share * (last - first)
