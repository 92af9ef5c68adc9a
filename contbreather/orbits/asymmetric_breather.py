"""Asymmetric breathers: one site hits both walls once in 2 pi, after flights of unequal length.

Their equations, two impacts of `OrbitEquations` in sums and differences, and the problem to trace:
what leaves the pitchfork of symmetric breathers, which is a regular point of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.bifurcations.equilibria import fold
from contbreather.continuation.branches.switching import SwitchingProblem
from contbreather.continuation.curve.point import DefiningSystem, Event, Point
from contbreather.continuation.curve.problem import Problem
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.chain import InfiniteChain
from contbreather.lattice.conditions import restitution_ratio
from contbreather.lattice.forcing import Forcing, Harmonic, Harmonics, TrigonometricSeries
from contbreather.lattice.periodic_green import periodic_green, sinc, slope_ratio
from contbreather.orbits.closure import forcing_at
from contbreather.orbits.grazing import so_far_apart
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.orbit_events import events_of
from contbreather.orbits.orbit_problem import OrbitProblem, ring_label, unstable_by
from contbreather.orbits.symmetries import simpler_than
from contbreather.parameters import NEEDED, NUMBERS
from contbreather.stability.verdict import THRESHOLD

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]

NAMES = ("p", "t1", "t2", "c")
EQUAL = 1e-9  # flights that differ by less are equal
_unequal = attrgetter("solution.asymmetry")


@dataclass(frozen=True)
class AsymmetricEquations:
    """Asymmetric breathers: one site hits both walls once in 2 pi, after flights of unequal length.

    Two impacts of the general problem, on the wall +1 at t1 with the impulse -2p and on -1 at t2
    with +2p, ``x = (p, t1, t2, c)``. With ``s2 = t2 - pi``, ``delta = s2 - t1`` (0 for a symmetric
    breather) and h the periodic Green's function as a function of the time ``delta`` off mid
    period, sums and differences of its equations are

        ``a [f(t1) + f(s2)]/2 + 2p [h(delta) - h(pi)] = 1``,
        ``a [f'(t1) + f'(s2)]/2 = p q``,
        ``a [f'(s2) - f'(t1)] + 4p h'(delta) = 0``,
        ``c = a [f(s2) - f(t1)]/2``.

    The third holds for every symmetric breather. We divide it by delta, exactly at delta = 0 too:
    what is left has asymmetric breathers for solutions and no others, and their pitchfork is an
    ordinary point of their branch, where the branch turns back in its parameter and both arms meet.
    """

    forcing: Forcing = field(default_factory=Harmonic)
    lattice: UniformLattice = field(default_factory=InfiniteChain)

    def residual(self, x: FloatArray, params: Params) -> FloatArray:
        """The equations, shape (4,)."""
        at = self._at(x, params)
        return np.array(
            (
                # h is h(delta) - h(pi); ratio and pull are f'(s2) - f'(t1) and h'(delta), per delta
                0.5 * at.a * (at.f1 + at.f2) + 2.0 * at.p * at.h - 1.0,
                0.5 * at.a * (at.df1 + at.df2) - at.p * at.q,
                at.a * at.ratio + 4.0 * at.p * at.pull,
                at.c - 0.5 * at.a * (at.f2 - at.f1),
            )
        )

    def jacobian(self, x: FloatArray, params: Params) -> FloatArray:
        """Derivatives with respect to (p, t1, t2, c), shape (4, 4)."""
        at = self._at(x, params)
        a = at.a
        # delta = s2 - t1: t1 moves it by -1, t2 by 1, and either the middle of both by 1/2
        h, pull = 2.0 * at.p * at.h_slope, 4.0 * at.p * at.pull_slope
        middle, across = 0.5 * a * at.ratio_middle, a * at.ratio_across
        return np.array(
            (
                (2.0 * at.h, 0.5 * a * at.df1 - h, 0.5 * a * at.df2 + h, 0.0),
                (-at.q, 0.5 * a * at.d2f1, 0.5 * a * at.d2f2, 0.0),
                (4.0 * at.pull, middle - across - pull, middle + across + pull, 0.0),
                (0.0, 0.5 * a * at.df1, -0.5 * a * at.df2, 1.0),
            )
        )

    def sensitivity(self, x: FloatArray, params: Params, name: str) -> FloatArray:
        """Derivatives with respect to the parameter ``name``, shape (4,)."""
        at = self._at(x, params)
        if name == "a":
            means = 0.5 * (at.f1 + at.f2), 0.5 * (at.df1 + at.df2)
            return np.array((*means, at.ratio, -0.5 * (at.f2 - at.f1)))
        if name == "gamma":
            answer = periodic_green(self.lattice, at.gamma, (0,), by="gamma")
            h, own = answer.at([math.pi - at.delta, 0.0])[0]
            pull, _ = slope_ratio(answer, at.delta)
            return np.array((2.0 * at.p * (h - own), 0.0, 4.0 * at.p * pull, 0.0))
        if name == "k":
            return np.array((0.0, 2.0 * at.p / (1.0 + at.k) ** 2, 0.0, 0.0))
        slope = TrigonometricSeries(at.forcing.slope_harmonics(name))
        (f1, df1, *_), (f2, df2, *_) = slope.motion(at.t1), slope.motion(at.s2)
        ratio, *_ = divided(slope.harmonics, at.t1, at.s2)
        return at.a * np.array((0.5 * (f1 + f2), 0.5 * (df1 + df2), ratio, -0.5 * (f2 - f1)))

    def along(self, x: FloatArray, params: Params, way: Params) -> FloatArray:
        """Derivatives along a direction of the parameters, rates by name."""
        return sum((r * self.sensitivity(x, params, name) for name, r in way.items()), np.zeros(4))

    def _at(self, x: FloatArray, params: Params) -> Any:
        return _place(self, np.asarray(x, dtype=float).tobytes(), tuple(params.items()))


class _Place:
    """Terms of the equations at one point."""

    def __init__(
        self, of: AsymmetricEquations, unknowns: bytes, given: tuple[tuple[str, float], ...]
    ) -> None:
        x, params = np.frombuffer(unknowns), dict(given)
        self.p, self.t1, t2, self.c = (float(value) for value in x)
        self.s2 = t2 - math.pi
        self.delta = self.s2 - self.t1
        self.a, self.gamma, self.k = (float(params[name]) for name in ("a", "gamma", "k"))
        if not math.isfinite(self.a + self.p + self.delta + self.t1 + self.c):
            raise BadInput(f"a = {self.a}, x = {x}: the breather needs finite numbers.")
        self.q = restitution_ratio(self.k)
        if not -math.pi < self.delta < math.pi:
            raise BadInput(
                f"t1 = {self.t1:.6g}, t2 = {t2:.6g}: the impact on -1 must follow the one on +1 "
                "within a period, t1 < t2 < t1 + 2 pi."
            )
        f = self.forcing = forcing_at(of.forcing, params)
        self.f1, self.df1, self.d2f1 = f.motion(self.t1)
        self.f2, self.df2, self.d2f2 = f.motion(self.s2)
        # times off mid period: delta since the impact on the other wall, pi since the site's own
        answer = periodic_green(of.lattice, self.gamma, (0,))
        (value, own), (slope, _) = answer.at([math.pi - self.delta, 0.0])[:2].tolist()
        self.h, self.h_slope = value - own, -slope
        self.pull, self.pull_slope = slope_ratio(answer, self.delta)
        self.ratio, self.ratio_middle, self.ratio_across = divided(f.harmonics, self.t1, self.s2)


# kept by the unknowns' bits: Newton's method asks for equations and slopes at the same place
_place = lru_cache(maxsize=16)(_Place)


def divided(harmonics: Harmonics, t1: float, t2: float) -> tuple[float, float, float]:
    """``[f'(t2) - f'(t1)]/(t2 - t1)``; and its slopes in their middle and in their distance."""
    middle, half = 0.5 * (t1 + t2), 0.5 * (t2 - t1)
    value = slope = across = 0.0
    for m, A, B in harmonics:
        # f'(t2) - f'(t1) = -2 m sin(m half) (A c + B s): the sinc is its quotient, at half = 0 too
        c, s = math.cos(m * middle), math.sin(m * middle)
        share, change = sinc(m * half)
        even, odd = A * c + B * s, B * c - A * s
        value -= m * m * share * even
        slope -= m**3 * share * odd
        across -= 0.5 * m**3 * change * even
    return value, slope, across


# --- as a problem to trace ------------------------------------------------------------------------


def asymmetric_problem(orbit: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The four equations with an orbit of two impacts as their start, and all its events.

    Columns: p, t1, t2, c; a, gamma, k and the parameters of the forcing; ``asymmetry`` is
    t2 - t1 - pi, ``unstable`` the number of multipliers outside.
    """
    on, first = orbit.conditions, orbit.impacts[0].time
    times = first, first + math.pi + orbit.asymmetry  # times count modulo the period
    equations = AsymmetricEquations(on.forcing, on.lattice)
    return _Asymmetric.of(
        "asymmetric breather",
        partial(type(orbit.representation).arm, on, orbit.section),
        orbit,
        threshold,
        equations,
        start=dict(zip(NAMES, (orbit.p, *times, orbit.c), strict=True)),
        params={"a": on.a, "gamma": on.gamma, "k": on.k, **on.forcing.params},
        events=(
            pitchfork_of_arms(),
            # where flights become equal the branch turns back as well, but that is its pitchfork
            replace(_off_pitchfork(fold()), locus=_fold_locus),
            *events_of(orbit.section, on, threshold),
        ),
        record={"asymmetry": _unequal, "unstable": unstable_by(threshold)},
        # a smaller impulse is none
        domain={**{name: NUMBERS[name].domain for name in NEEDED}, "p": (1e-12, math.inf)},
        label=f"asymmetric breather{ring_label(on.lattice, threshold)}",
    )


@dataclass(frozen=True, eq=False, repr=False)
class _Asymmetric(OrbitProblem):
    def images(self, x: FloatArray, params: Params) -> tuple[FloatArray, ...]:
        p, t1, t2, c = x
        # u(t) -> -u(t + pi): the impacts change places, the offset its sign
        return (np.array((p, t2 - math.pi, t1 + math.pi, -c)),)

    def lift(self, kind: str) -> Callable[[Point], SwitchingProblem] | None:
        return symmetric_again if kind == "PF" else super().lift(kind)


def pitchfork_of_arms() -> Event:
    """PF of an orbit with two impacts: both flights become equal, ``t2 - t1 = pi``.

    Nothing changes sign there but the asymmetry itself: both arms are mirror images.
    """
    return Event("PF", _unequal, locus=partial(so_far_apart, math.pi, "t1", "t2"))


def symmetric_again(point: Point) -> SwitchingProblem:
    """The branch of symmetric breathers, in its own problem."""
    breather = simpler_than(point.solution)
    if breather is None:
        raise Undefined("the flights are not equal here")
    return SwitchingProblem(breather.problem, point.curve.free[-1])


def _off_pitchfork(event: Event) -> Event:
    """At a pitchfork the test of a fold and the asymmetry vanish together: their ratio does not."""
    return replace(event, test=partial(_per_asymmetry, event))


def _per_asymmetry(event: Event, point: Point) -> float:
    asymmetry = _unequal(point.base_point)
    # 0/0 at the pitchfork itself
    return math.nan if asymmetry == 0.0 else event.value(point) / asymmetry


def _fold_locus(point: Point) -> DefiningSystem:
    # on its curve, so does the test of a cusp where both folds of mirror images meet
    locus_of = fold().locus
    assert locus_of is not None
    locus = locus_of(point)
    return replace(locus, events=tuple(map(_off_pitchfork, locus.events)))
