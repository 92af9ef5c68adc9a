"""Curves of critical points and what they meet, on the imaginary axis and on the unit circle.

===================  =====================  ========================
critical values      flows, lambda          maps and cycles, mu
===================  =====================  ========================
one real             LP, BP: 0              LP, BP: +1, PD: -1
a pair               HB                     NS
one real and a pair  ZH, BP-HB              LPNS, PDNS, BP-NS
two different reals                         LPPD, BP-PD
one real twice       BT                     R1, R2
two pairs            HH                     NSNS
no cubic term        GH                     GPD, CH
===================  =====================  ========================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ..algebra.newton import OUT_OF_DOMAIN
from ..branches.boundary import codim_two
from ..curve.point import NOTHING, CodimensionTwo, Event, Examined, Point
from ..systems import normal_forms
from ..systems.spectrum import Eigenvalues, Multipliers, NearAxis

Cubic = Callable[[Point, float], normal_forms.Coefficient]  # to an error that is asked for


@dataclass(frozen=True, eq=False)
class Border:
    """Border of stability, and the events where eigenvalues or multipliers are on it."""

    values: str  # its values, and
    name: str  # itself, in words
    real: Mapping[str, float]  # critical value of each kind that has one: in the order of names
    pair: str  # kind of a complex pair
    spectrum: Callable[[Point], Eigenvalues | Multipliers]  # all values, as far as they are known
    # the upper value of the pair that a curve of `pair` has everywhere; None beyond its end
    followed: Callable[[Point], complex | None]
    frequency: tuple[str, Callable[[complex], float]]  # name and function of what tells that value
    names: Mapping[tuple[str, str], str] = field(default_factory=dict)  # not made of both kinds
    events: dict[str, Event] = field(default_factory=dict)  # of the kinds, each speaks of others
    # on the curves of kinds of one real value: where another one joins it
    double: dict[str, CodimensionTwo] = field(default_factory=dict)
    met: dict[str, dict[str, tuple[Event, ...]]] = field(default_factory=dict, init=False)

    def others(self, on: str, point: Point) -> Eigenvalues | Multipliers:
        """Values next to those that the curve of a kind has everywhere; none beyond its end."""
        values = self.spectrum(point)
        if on != self.pair:
            return values.without(self.real[on]) if on else values
        upper = self.followed(point)
        if upper is None:
            return replace(values, values=values.values[:0])
        return values.without(upper, upper.conjugate())

    def unstable_pairs(self, point: Point) -> complex:
        """Count them beyond the border: pairs that are alike pass it without a change of sign."""
        return self.spectrum(point).unstable_pairs

    def may_jump(self, point: Point) -> bool:
        """Say whether the test of pairs goes on with the next where one turns real: real ones of
        a sparse matrix are not all known."""
        return isinstance(self.spectrum(point), NearAxis)

    def least_of_pairs(self, on: str, point: Point) -> float:
        return self.others(on, point).least_of_pairs()

    def least_beside(self, on: str, place: float, point: Point) -> float:
        """The test of a real value."""
        if self.real.get(on) == place:
            # a double one is a pair with that of the curve: rounding splits both by its root, but
            # does not move their sum or product
            return self.spectrum(point).least_of_pairs_at(place)
        return self.others(on, point).least_beside(place)

    def meetings(self, on: str) -> dict[str, tuple[Event, ...]]:
        """Events to look for on the curve of a kind in place of each other kind, made once."""
        if on not in self.met:
            met: dict[str, tuple[Event, ...]] = {
                kind: (self._meeting(on, kind),)
                for kind in (*self.real, self.pair)
                if kind not in (on, "BP") and (on, kind) != ("BP", "LP")
            }
            if on in self.double:
                met[self.pair] = (self.double[on], *met[self.pair])
            self.met[on] = met
        return self.met[on]

    def _meeting(self, on: str, kind: str) -> Event:
        order = [*self.real, self.pair]
        first, second = sorted((on, kind), key=order.index)
        made_of_both = f"{first}{'-' if first == 'BP' else ''}{second}"
        test = partial(self.least_of_pairs, on)
        if kind in self.real:
            test = partial(self.least_beside, on, self.real[kind])
        return replace(
            codim_two(on, self.events[kind]),
            kind=self.names.get((first, second), made_of_both),
            test=test,
            examine=partial(self.examine, (first, second)),
        )

    def examine(self, kinds: tuple[str, ...], point: Point) -> Examined:
        """Refuse a point unless the values on the border are those of all these kinds."""
        every, left, found = self.spectrum(point), self.spectrum(point).critical, list[str]()
        for place in {*self.real.values()}:
            here = abs(left - place) < every.beside
            found += [_word(place)] * int(here.sum())
            left = left[~here]
        upper = left[left.imag > 0]
        found += ["a pair"] * upper.size
        wanted = [_word(self.real[kind]) if kind in self.real else "a pair" for kind in kinds]
        if sorted(found) != sorted(wanted):
            if _has_saddle(every):
                return NOTHING
            shown, these = np.array2string(every.critical, precision=6), " and ".join(wanted)
            return f"on the {self.name} are {shown}, where only {these} should be"
        judge = self.events["LP"].examine if "LP" in kinds else None
        said = judge and judge(point.base_point)  # by how far off the place may be
        if said and isinstance(said, str):
            return said
        name, measure = self.frequency
        if upper.size == 2:  # that of the other curve: it can set out here
            other = self.others(self.pair, point).critical
            upper = other[other.imag > 0]
        return {name: float(measure(upper[0]))} if upper.size == 1 else ""

    def pair_at(self, point: Point) -> complex | Examined:
        """The upper value of the pair that is on the border, or what is there in its place."""
        every = self.spectrum(point)
        if every.values.size < 2:
            return f"no two {self.values} are known beside the {self.name}"
        pair = every.nearest_pair()
        for on, event in self.double.items():
            if abs(pair - self.real[on]).max() <= every.beside:
                return f"a double {_word(self.real[on])}: {event.kind}, no pair on the {self.name}"
        # a neutral saddle, of foci as well; or two real values, where all of them vanish
        if abs(pair[0] - pair[1].conjugate()) > every.beside or pair[0].imag == 0:
            return NOTHING
        return complex(pair[0] if pair[0].imag > 0 else pair[1])

    def two_pairs(self, kind: str) -> Event:
        """Make the event of a second pair on the border, on the curve of one."""
        test = partial(self.least_of_pairs, self.pair)
        examine = partial(self.examine, (self.pair, self.pair))
        return Event(kind, test, examine=examine, may_jump=self.may_jump)

    def degenerate(
        self, kind: str, on: str, poles: tuple[float, ...], name: str, coefficient: Cubic
    ) -> Event:
        """The event of a vanishing cubic coefficient, whose poles are at these places."""
        return Event(
            kind,
            partial(self._without_poles, on, poles, coefficient),
            examine=partial(self._examine_zero, on, poles, name, coefficient),
        )

    def _without_poles(
        self, on: str, poles: tuple[float, ...], coefficient: Cubic, point: Point
    ) -> float:
        # eigenvalues first: the orbit at hand is the one that was solved for last
        others = self.others(on, point).values.size
        factors = [self.least_beside(on, place, point) for place in poles if others]
        dear = point.base_point.curve.problem.closing is not None  # each derivative
        try:
            known = coefficient(point, normal_forms.ROUGHLY if dear else normal_forms.AGREED)
        except OUT_OF_DOMAIN:  # there is no such normal form
            return math.nan
        return math.prod(factors) * known.signed

    def _examine_zero(
        self, on: str, poles: tuple[float, ...], name: str, coefficient: Cubic, point: Point
    ) -> Examined:
        known, others = coefficient(point, normal_forms.AGREED), self.others(on, point)
        zero = abs(known.value.real) <= 1e-6 * (known.size + normal_forms.Forms(point).cubic)
        here = [place for place in poles if (abs(others.values - place) < others.beside).any()]
        # a pole, or where symmetry leaves none the zero that was to meet it: of a value that is
        # there twice the vector is any of a plane, and so is the coefficient
        if self.real.get(on) in here or (here and not zero):
            return NOTHING
        if not zero:
            return f"{name} {known.value.real:.2g} is not zero"
        return "" if on in self.real else self.examine((on,), point)


def _has_saddle(every: Eigenvalues | Multipliers) -> bool:
    """Tell whether two real values off the border pass for a pair: a neutral saddle."""
    others = replace(every, values=np.setdiff1d(every.values, every.critical))
    if others.values.size < 2 or others.nearest_pair().imag.any():
        return False
    return bool(abs(others.factors()[0]).min(initial=math.inf) < every.beside)


def _word(place: float) -> str:
    return f"{place:+g}" if place else "0"
