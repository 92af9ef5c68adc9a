"""What happens to orbits on their branches: LP, BP, PF, PD, NS, each with its defining system.

An event asks the map of small perturbations over a section of the orbit, whichever way its flights
are evaluated (`contbreather.stability.modal_map.Map`):

- the multiplier with which the section closes, its ``sign``, is a zero of the orbit's own
  equations, a fold (LP) or a branch point (BP);
- the other real one, ``-sign``, is PF on half a symmetric orbit, whose symmetry breaks, and PD on
  every other, whose period doubles: one test, one defining system;
- a complex pair that leaves the unit circle, or a larger one on a finite lattice, is NS
  (`contbreather.orbits.pair_events`);
- on the infinite chain a count that changes for none of these reasons is MX.

What touches a wall is `contbreather.orbits.grazing`. The events of the public interface, at the
end, are known by their kinds until there is a problem that has them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from contbreather.checks import brief, flag
from contbreather.continuation.curve.branch import Points
from contbreather.continuation.curve.point import (
    DefiningSystem,
    Detail,
    Event,
    EventWithRule,
    Examined,
    Many,
    Point,
)
from contbreather.continuation.curve.problem import Problem
from contbreather.errors import BadInput
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions
from contbreather.orbits.grazing import CATCHING, GRAZING, MERGING
from contbreather.orbits.normal_form import NAMES, detail_of_pitchfork
from contbreather.orbits.orbit import Orbit, orbit_at
from contbreather.orbits.orbit_problem import OnCircle, breathers_along, unstable_by
from contbreather.orbits.pair_events import (
    COUPLED,
    held_by_neighbours,
    is_blurred,
    pair_leaves,
)
from contbreather.orbits.section import WEAK, Section
from contbreather.stability.modal_map import ModalMap
from contbreather.stability.one_impact import RealScalars, RingHalfMap
from contbreather.stability.verdict import THRESHOLD, check_threshold
from contbreather.storage.serialise import serialised

_ZERO = 1e-8  # the scalar of a real multiplier where that is located, relative to its terms


def events_of(section: Section, on: Conditions, threshold: float) -> tuple[Event, ...]:
    """The events of an orbit with these impacts, apart from the multiplier it closes with."""
    lattice, endless = on.lattice, on.lattice.sites is None
    if isinstance(lattice, Ring) and not (on.damping or on.spring):
        check_threshold(threshold)  # its band is on the circle: there NS is by the paper's rule
    breaking = real_multiplier("PF", 1.0) if section.symmetric else real_multiplier("PD", -1.0)
    mixed = (Event("MX", None, count=_certain_count),) if endless and not section.symmetric else ()
    merging = (MERGING,) if section.repeats else ()
    catching = () if section.local else (CATCHING,)
    return (breaking, pair_leaves(lattice, threshold), GRAZING, *mixed, *merging, *catching)


def _certain_count(point: Point) -> float | int:
    if point.solution.vanishing is not None:
        return math.nan
    count = point.solution.map.count()
    return count.count if count.certain else math.nan


# --- a real multiplier ----------------------------------------------------------------------------


def saddle_node() -> Event:
    """LP of the symmetric breather: two of them meet, eq. (14), and the half map QS has the
    multiplier -1. The determinant of the closure's Jacobian vanishes, one scalar."""
    many = partial(_crosses_of_many, -1.0, False)
    return Event("LP", partial(_crosses, -1.0), many=many, locus=partial(_real_locus, -1.0))


def real_multiplier(kind: str, mu: float) -> Event:
    """PF or PD: a multiplier over the section is mu, 1 or -1."""
    return Event(
        kind,
        partial(_crosses, mu),
        many=partial(_crosses_of_many, mu, True),
        count=partial(_beyond, mu),
        locus=partial(_real_locus, mu),
        examine=partial(_examine_real, mu),
    )


def _crosses(mu: float, point: Point) -> float:
    orbit = point.solution
    if isinstance(orbit.map, RealScalars) and is_blurred(orbit):
        return math.nan
    return float(orbit.map.crosses(mu) * _slowness(orbit))


def _slowness(orbit: Orbit) -> float:
    """The factor without which scalars in closed form have a pole where their impact loses its
    speed; other maps have that in theirs."""
    return float(orbit.speeds[0]) if isinstance(orbit.map, RealScalars) else 1.0


def _crosses_of_many(mu: float, counted: bool, points: Points) -> Many | None:
    along = breathers_along(points)
    if along is None:
        return None
    speeds = 2.0 * along.p / (1.0 + along.first.k)  # eq. (4)
    return along.map.crosses(mu) * speeds, along.map.beyond(mu) if counted else None


def _beyond(mu: float, point: Point) -> float:
    """Number of multipliers beyond mu: two that pass within one step are seen by it."""
    orbit = point.solution
    return math.nan if is_blurred(orbit) else int(orbit.map.beyond(mu))


def _real_locus(mu: float, point: Point) -> DefiningSystem:
    orbit = point.solution
    # mu = exp(i pi nu): nu is 0 for 1 and 1 for -1
    domain = COUPLED if mu > 0.0 and held_by_neighbours(orbit) else {}
    return orbit.representation.locus(OnCircle(nu=0.5 * (1.0 - mu)), point, domain=domain)


def _examine_real(mu: float, point: Point) -> Examined:
    orbit = point.solution
    size = np.prod(abs(orbit.speeds) + abs(orbit.gains))  # D is linear in each entry b of (19)
    slowness = _slowness(orbit)
    value = orbit.map.on_circle(0.5 * (1.0 - mu)) * slowness  # D(mu) = det(1 + (S - 1) G(mu))
    if mu > 0.0 and orbit.gamma < WEAK and held_by_neighbours(orbit):  # idle sites have it anyway
        value = orbit.map.crosses(mu)
    if not abs(value) < _ZERO * size:
        return f"D({mu:g}) = {value.real:.2g} is not zero"
    if not orbit.section.symmetric:
        return ""
    # at the fold (14) the half map QS has the multiplier -1
    if abs(orbit.map.crosses(-1.0) * slowness) < _ZERO * size:
        return "a fold of the closure, not a pitchfork"
    if len(point.curve.varied) > 1:  # on a boundary it has no normal form
        return ""
    # most pitchforks are only passed through
    return Detail({}, NAMES, partial(detail_of_pitchfork, point))


def from_arms(event: Event) -> Event:
    """BP of the whole period, which is PF where an arm comes to the symmetric orbit it left."""
    return replace(event, examine=partial(_examine_crossing, event))


def _examine_crossing(event: Event, point: Point) -> Examined:
    why, orbit = event.examine(point) if event.examine else "", point.solution
    arm = orbit.section.mirrored and orbit.conditions.symmetric
    if why or point.tangent is None or not arm:
        return why
    # unknowns begin with the times; along symmetric orbits those of both halves move alike
    first, second = point.tangent[: orbit.section.count].reshape(2, -1)
    # flights that are equal there, and change along the arm: along symmetric orbits they do not
    leaves = abs(second - first).max() > 1e-3 and abs(orbit.asymmetry) < 1e-5
    return {"kind": "PF"} if leaves else ""


# --- of any problem, by their kinds ---------------------------------------------------------------

WHY: Mapping[str, str] = {
    "PF": "only a symmetric orbit, known by half its period, has a pitchfork",
    "PD": "a symmetric orbit breaks its symmetry (PF) before it can double its period",
    "NS": "a complex pair is looked for in the map of an orbit",
    "GR": "only what moves between walls can graze them",
}


@dataclass(frozen=True, repr=False)
class DeferredEvent(Event):
    """An event that is known by its kind; `choose` finds that of a problem."""

    test: Any = field(default=None, init=False)
    choose: Callable[[Problem], Event] = field(kw_only=True)
    form: Mapping[str, Any] | None = field(default=None, kw_only=True)  # what files make it of

    def __post_init__(self) -> None:
        object.__setattr__(self, "test", self._test)
        object.__setattr__(self, "locus", self._locus)

    def _test(self, point: Point) -> float | int:
        return self.of(point.base_point.curve.problem).value(point)

    def _locus(self, point: Point) -> DefiningSystem:
        locus = self.of(point.base_point.curve.problem).locus
        assert locus is not None  # each of these events has one
        return locus(point)

    def of(self, problem: Problem) -> Event:
        return self.choose(problem)

    @property
    def serialised(self) -> Mapping[str, Any] | None:
        return self.form


def _deferred(kind: str) -> Event:
    return DeferredEvent(kind, choose=partial(_of_kind, kind))


def _of_kind(kind: str, problem: Problem) -> Event:
    event = next((event for event in problem.events if event.kind == kind), None)
    if event is None:
        have = ", ".join(event.kind for event in problem.events) or "no events"
        raise BadInput(f"no {kind} of this problem ({problem.label}, {have}): {WHY[kind]}.")
    return event


def pitchfork() -> Event:
    """PF: the symmetry ``u(t + T/2) = -u(t)`` breaks; the map of half a period has the multiplier
    +1. On an arm: where it meets the symmetric branch.

    Of a symmetric breather ``a f''(phi) = 2 p sigma(gamma)``, exact on chain and ring for any
    forcing; a located point knows its normal form: ``criticality`` says which way the arms bend,
    ``coefficient`` how strongly, the limit of ``|t2 - t1 - pi|^power`` on them over the distance of
    the free parameter from the pitchfork. The ``power`` is 2; 1 where neighbours that hit their
    walls at once do so one after the other on the arms.

    Examples
    --------
    >>> import contbreather as cb
    >>> branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", events=[pitchfork()], towards="up",
    ...                   within={"a": (0, 0.9)})
    >>> round(branch.first("PF")["a"], 12)
    0.777632425944
    """
    return _deferred("PF")


def period_doubling() -> Event:
    """PD: a multiplier over the period of an orbit (or of a map) passes -1.

    Examples
    --------
    >>> import contbreather as cb
    >>> from contbreather.orbits.constructors import asymmetric
    >>> arm = asymmetric(0.9, 0.0, 0.8, lattice=cb.Ring(1))
    >>> branch = cb.trace(arm, "a", events=[period_doubling()], within={"a": (0.9, 0.95)})
    >>> round(branch.first("PD")["a"], 9)
    0.925512006
    """
    return _deferred("PD")


def grazing() -> Event:
    """GR: a site comes to touch a wall that it must not touch; the branch ends there.

    Where an impact itself loses its momentum, that end is labelled VI, a vanishing impact.
    """
    return _deferred("GR")


def neimark_sacker(*, threshold: float | None = None, every: bool = False) -> Event:
    """NS: a complex pair of multipliers leaves the unit circle.

    On the infinite chain it is the point where an isolated pair comes out of the continuous
    spectrum, exact and without a threshold. On a ring some multipliers are always at or outside the
    circle, so there the paper's rule is followed, of `orbit.on(Ring(N))`.

    Parameters
    ----------
    threshold : float, optional
        On finite lattices: the modulus over the whole period that a pair must pass, 1.005 in the
        paper. A boundary ends where another of a ring's waves gets there first (NS-NS);
        `contbreather.paper.threshold.neimark_sacker_line` puts the pieces together.
    every : bool
        Of motions by exact modes, with damping or springs for instance: each pair that passes the
        threshold, as in zones with damping, not the first alone.

    Examples
    --------
    >>> import contbreather as cb
    >>> branch = cb.trace(cb.symmetric(0.2, 0.08, 0.8), "gamma", events=[neimark_sacker()],
    ...                   towards="up", within={"gamma": (0, 0.1)})
    >>> round(branch.first("NS")["gamma"], 7)
    0.0969709
    """
    every = flag("every", every)
    if threshold is None and not every:
        return _deferred("NS")
    modulus = THRESHOLD if threshold is None else threshold
    form = {"kind": "NS", "threshold": threshold, **({"every": True} if every else {})}
    return DeferredEvent("NS", choose=partial(_pair_leaves, modulus, every, form), form=form)


serialised("NS")(neimark_sacker)


def _pair_leaves(threshold: float, every: bool, form: Mapping[str, Any], problem: Problem) -> Event:
    orbit: Any = orbit_at(problem)
    if not isinstance(orbit, Orbit):
        raise BadInput(f"a threshold is for orbits; got {orbit!r}.")
    map, lattice = orbit.map, orbit.lattice
    if every and type(map) is not ModalMap:
        raise BadInput(
            "every=True counts the multipliers of exact modes, as with damping: leave it out"
        )
    if lattice.sites is None:
        raise BadInput(
            f"threshold = {brief(threshold)}: the infinite chain has none, its verdict is exact; "
            "take the orbit to the ring it is about, orbit.on(Ring(N))."
        )
    if every:
        event = pair_leaves(lattice, threshold, every=True)
    else:
        event = _of_kind("NS", orbit.representation.problem(threshold))
    # with the column of what is unstable by the same threshold
    ring = f"stability of a ring of {lattice.sites}, " * isinstance(map, RingHalfMap)
    about, record = f"{ring}threshold {threshold:g}", {"unstable": unstable_by(threshold)}
    return EventWithRule.of_event(event, record=record, about=about, form=form)
