"""The events of orbits, the same for all: each asks the problem that is traced for its own.

How an event is tested and where it is depends on the road of an orbit: one scalar of a closed
form, the periodic Green's function, a null vector of modes. Maps and motions that a flow brings
back have some of the same events. So these are known by their kinds until a problem is there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from contbreather.breathers import symmetric_events
from contbreather.breathers.closed_form import SymmetricFlight
from contbreather.breathers.orbit import Orbit, orbit_at
from contbreather.breathers.problem import unstable_by
from contbreather.checks import shown
from contbreather.continuation import Event, Locus, Point, Problem
from contbreather.continuation.point import Judged
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability.verdict import THRESHOLD
from contbreather.storage.serialise import serialised

WHY: Mapping[str, str] = {
    "PF": "only a symmetric orbit, known by half its period, has a pitchfork",
    "PD": "a symmetric orbit breaks its symmetry (PF) before it can double its period",
    "NS": "a complex pair is looked for in the map of an orbit",
    "GR": "only what moves between walls can graze them",
}


@dataclass(frozen=True, repr=False)
class OfProblem(Event):
    """An event that is known by its kind; `choose` finds that of a problem."""

    test: Any = field(default=None, init=False)
    choose: Callable[[Problem], Event] = field(kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "test", self._test)
        object.__setattr__(self, "locus", self._locus)

    def _test(self, point: Point) -> float | int:
        return self.of(point.ground.curve.problem).value(point)

    def _locus(self, point: Point) -> Locus:
        own = self.of(point.ground.curve.problem).locus
        assert own is not None  # each of these events has one
        return own(point)

    def of(self, problem: Problem) -> Event:
        found = self.choose(problem)
        return replace(found, serialised=self.serialised) if self.serialised else found


def _own(kind: str) -> Event:
    return OfProblem(kind, choose=partial(_of_kind, kind))


def _of_kind(kind: str, problem: Problem) -> Event:
    found = next((event for event in problem.events if event.kind == kind), None)
    if found is None:
        have = ", ".join(event.kind for event in problem.events) or "no events"
        raise BadInput(f"no {kind} of this problem ({problem.label}, {have}): {WHY[kind]}.")
    return found


def pitchfork() -> Event:
    """PF: the symmetry ``u(t + T/2) = -u(t)`` breaks; the map of half a period has the multiplier
    +1. On an arm: where it meets the symmetric branch.

    Of a symmetric breather ``a f''(phi) = 2 p sigma(gamma)``, exact on chain and ring for any
    forcing; a located point knows its normal form: ``criticality`` says which way the arms bend,
    ``coefficient`` how strongly, the limit of ``(t2 - t1 - pi)^2`` on them over the distance of
    the free parameter from the pitchfork.

    Examples
    --------
    >>> import contbreather as cb
    >>> branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", events=[pitchfork()], towards="up",
    ...                   within={"a": (0, 0.9)})
    >>> round(branch.first("PF")["a"], 12)
    0.777632425944
    """
    return _own("PF")


def period_doubling() -> Event:
    """PD: a multiplier over the period of an orbit (or of a map) passes -1.

    Examples
    --------
    >>> import contbreather as cb
    >>> from contbreather.breathers.arms import asymmetric
    >>> arm = asymmetric(0.9, 0.0, 0.8, lattice=cb.Ring(1))
    >>> branch = cb.trace(arm, "a", events=[period_doubling()], within={"a": (0.9, 0.95)})
    >>> round(branch.first("PD")["a"], 9)
    0.925512006
    """
    return _own("PD")


def grazing() -> Event:
    """GR: a site comes to touch a wall that it must not touch; the branch ends there.

    Where an impact itself loses its momentum, that end is labelled VI, a vanishing impact.
    """
    return _own("GR")


def neimark_sacker(
    *, on: InfiniteChain | Ring | None = None, threshold: float | None = None
) -> Event:
    """NS: a complex pair of multipliers leaves the unit circle.

    Parameters
    ----------
    on : InfiniteChain or Ring, optional
        Of a symmetric breather: ask about another lattice than its own. On the infinite chain it
        is the point where an isolated pair comes out of the continuous spectrum, exact and without
        a threshold. On a ring some multipliers are always at or outside the circle, so there the
        paper's rule is followed.
    threshold : float, optional
        On finite lattices: the modulus over the whole period that a pair must pass, 1.005 in the
        paper. A boundary ends where another of a ring's waves gets there first (NS-NS);
        `contbreather.paper.threshold.neimark_sacker_line` puts the pieces together.

    Examples
    --------
    >>> import contbreather as cb
    >>> branch = cb.trace(cb.symmetric(0.2, 0.08, 0.8), "gamma", events=[neimark_sacker()],
    ...                   towards="up", within={"gamma": (0, 0.1)})
    >>> round(branch.first("NS")["gamma"], 7)
    0.0969709
    """
    if on is None and threshold is None:
        return _own("NS")
    modulus = THRESHOLD if threshold is None else threshold
    form = {"kind": "NS", "on": on, "threshold": threshold}
    elsewhere = symmetric_events.neimark_sacker(on=on, threshold=modulus)  # or a sentence
    return OfProblem("NS", choose=partial(_pair_leaves, on, modulus, elsewhere), serialised=form)


serialised("NS")(neimark_sacker)


def _pair_leaves(
    on: InfiniteChain | Ring | None, threshold: float, elsewhere: Event, problem: Problem
) -> Event:
    orbit = _orbit_of(problem)
    if on is None and orbit.lattice.sites is None:
        raise BadInput(
            f"threshold = {shown(threshold)}: the infinite chain has none, its verdict is exact; "
            "name the ring it is about, on=Ring(N)."
        )
    if on is not None and on != orbit.lattice:
        if not isinstance(orbit.road, SymmetricFlight):
            raise BadInput(
                f"on = {on!r}: another lattice goes with events of symmetric breathers of "
                f"chain and ring only; take the orbit there, orbit.on({on!r})."
            )
        return elsewhere
    found = _of_kind("NS", orbit.road.problem(threshold))
    return found if isinstance(found, Judged) else _judged(found, threshold)


def _orbit_of(problem: Problem) -> Orbit:
    found: Any = orbit_at(problem)
    if not isinstance(found, Orbit):
        raise BadInput(f"a threshold, or a lattice to ask about, is for orbits; got {found!r}.")
    return found


def _judged(event: Event, threshold: float) -> Event:
    """With the column of what is unstable by the same threshold."""
    record = {"unstable": unstable_by(threshold)}
    return Judged.judging(event, record, f"threshold {threshold:g}")
