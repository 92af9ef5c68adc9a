"""Curves of critical points and what they meet, on the imaginary axis and on the unit circle.

===================  =====================  ========================
critical values      flows, lambda          maps and cycles, mu
===================  =====================  ========================
one real             LP, BP: 0              LP, BP: +1, PD: -1
a pair               HB                     NS
one real and a pair  ZH, BP-HB              LPNS, PDNS, BP-NS
two different reals                         LPPD, BP-PD
one real twice       BT                     R1, R2
two pairs            HH
===================  =====================  ========================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from .boundary import codim_two
from .branch_points import branches_cross
from .point import CodimensionTwo, Event, Examined, Point
from .spectrum import Spectrum


@dataclass(frozen=True, eq=False)
class Border:
    """Border of stability, and the events where eigenvalues or multipliers are on it.

    Attributes
    ----------
    name : str
    real : dict
        Critical value of each kind that has one, the largest first: they are named in this order.
    pair : str
        Kind of a complex pair.
    spectrum : callable
        ``spectrum(point)``: all values, as far as they are known.
    followed : callable
        ``followed(point)``: the upper value of the pair that a curve of `pair` has everywhere; None
        beyond the end of such a curve.
    frequency : tuple
        Name and function of the number that tells the upper value of a pair.
    names : dict
        Names of meetings that are not made of both kinds.
    events : dict
        Those of the kinds, each of which speaks of the others.
    double : dict
        On the curves of kinds of one real value: where another one joins it.
    """

    name: str
    real: Mapping[str, float]
    pair: str
    spectrum: Callable[[Point], Spectrum]
    followed: Callable[[Point], complex | None]
    frequency: tuple[str, Callable[[complex], float]]
    names: Mapping[tuple[str, str], str] = field(default_factory=dict)
    events: dict[str, Event] = field(default_factory=dict)
    double: dict[str, CodimensionTwo] = field(default_factory=dict)

    def others(self, on: str, point: Point) -> Spectrum:
        """All values but those that the curve of a kind has everywhere: where one more of these
        joins them the meeting has another name. None beyond the end of a curve of pairs."""
        values = self.spectrum(point)
        if on != self.pair:
            return values.without(self.real[on]) if on else values
        upper = self.followed(point)
        if upper is None:
            return replace(values, values=values.values[:0])
        return values.without(upper, upper.conjugate())

    def least_of_pairs(self, on: str, point: Point) -> float:
        """The test of a pair."""
        return self.others(on, point).least_of_pairs()

    def least_beside(self, on: str, place: float, point: Point) -> float:
        """The test of a real value."""
        others = self.others(on, point)
        if self.real.get(on) == place and others.values.size:
            # rounding splits a double one by its root, but does not move the sum of both
            values, every = others.values.copy(), self.spectrum(point).values - place
            values[abs(values - place).argmin()] += every[abs(every).argmin()]
            others = replace(others, values=values)
        return others.least_beside(place)

    def meetings(self, on: str) -> dict[str, tuple[Event, ...]]:
        """Events to look for on the curve of a kind in place of each other kind."""
        met: dict[str, tuple[Event, ...]] = {
            kind: (self._meeting(on, kind),)
            for kind in (*self.real, self.pair)
            if kind not in (on, "BP") and (on, kind) != ("BP", "LP")
        }
        if on in self.double:
            met[self.pair] = (self.double[on], *met[self.pair])
        return met

    def _meeting(self, on: str, kind: str) -> Event:
        order = [*self.real, self.pair]
        first, second = sorted((on, kind), key=order.index)
        made_of_both = f"{first}{'-' if first == 'BP' else ''}{second}"
        place = self.real.get(kind)
        test = (
            partial(self.least_of_pairs, on)
            if place is None
            else partial(self.least_beside, on, place)
        )
        return replace(
            codim_two(on, self.events[kind]),
            kind=self.names.get((first, second), made_of_both),
            test=test,
            examine=partial(self.examine, (first, second)),
        )

    def examine(self, kinds: tuple[str, ...], point: Point) -> Examined:
        """Refuse a point unless the values on the border are those of all these kinds."""
        if "LP" in kinds and branches_cross(point.base_point):
            return "a branch point, not a fold"
        every, left, found = self.spectrum(point), self.spectrum(point).critical, list[str]()
        for place in {*self.real.values()}:
            here = abs(left - place) < every.beside
            found += [_word(place)] * int(here.sum())
            left = left[~here]
        upper = left[left.imag > 0]
        found += ["pair"] * upper.size
        wanted = [_word(self.real[kind]) if kind in self.real else "pair" for kind in kinds]
        if sorted(found) != sorted(wanted):
            shown, these = np.array2string(every.critical, precision=6), " and ".join(wanted)
            saddle = ": a neutral saddle" if wanted.count("pair") > found.count("pair") else ""
            return f"on the {self.name} are {shown}, where {these} are expected{saddle}"
        name, measure = self.frequency
        return {name: float(measure(upper[0]))} if upper.size == 1 else ""


def _word(place: float) -> str:
    return f"{place:+g}" if place else "0"
