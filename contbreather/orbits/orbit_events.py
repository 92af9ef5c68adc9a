"""What happens to orbits on their branches: LP, BP, PF, PD, NS, each with its defining system.

An event asks the map of small perturbations over a section of the orbit, whichever way its flights
are evaluated (`contbreather.stability.modal_map.Map`):

- the multiplier with which the section closes, its ``sign``, is a zero of the orbit's own
  equations, a fold (LP) or a branch point (BP);
- the other real one, ``-sign``, is PF on half a symmetric orbit, whose symmetry breaks, and PD on
  every other, whose period doubles: one test, one defining system;
- a complex pair that leaves the unit circle, or a larger one on a finite lattice, is NS;
- on the infinite chain a count that changes for none of these reasons is MX.

What touches a wall is `contbreather.orbits.grazing`. The events of the public interface, at the
end, are known by their kinds until there is a problem that has them.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind, flag, real, shown
from contbreather.continuation.branch_points import bordered_matrix
from contbreather.continuation.defining_systems import Singular
from contbreather.continuation.equilibria import branch_point
from contbreather.continuation.newton import Undefined
from contbreather.continuation.point import (
    CodimensionTwo,
    DefiningSystem,
    Event,
    EventWithRule,
    Examined,
    Many,
    Point,
)
from contbreather.continuation.points import Points
from contbreather.continuation.problem import Problem
from contbreather.errors import BadInput
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.orbits.branch_switching import from_arms
from contbreather.orbits.grazing import grazing as grazed
from contbreather.orbits.grazing import merging, solution_at
from contbreather.orbits.normal_form import bends
from contbreather.orbits.orbit import Orbit, orbit_at
from contbreather.orbits.orbit_problem import OnCircle, breathers_along, unstable_by
from contbreather.orbits.section import WEAK, Section
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.half_period import HalfMap
from contbreather.stability.modal_map import ModalMap
from contbreather.stability.verdict import THRESHOLD, check_threshold, threshold_on
from contbreather.stability.zeros import REAL, nearest_pair, passing, upper
from contbreather.storage.serialise import serialised

DOUBLE = 1e-3  # how far from each other multipliers are that are one, where it is located
BLURRED = 1e-4  # of rounding in a multiplier: neither a sign nor a count is to be had from it
_ZERO = 1e-8  # the scalar of a real multiplier where that is located, relative to its terms
_ON = 1e-8  # of a circle: what is closer is on it, as both pairs are where they meet
_ALL_BUT = 1.0 - 1e-15
_NEARLY = 1.0 - 1e-9  # what is on the circle at 1 is inside by more than rounding

# As k -> 1 the angle of a Neimark-Sacker point tends to the edge of the band like (1 - k)^2, on an
# arm to its pitchfork like sqrt(1 - k): within rounding of that the curve cannot be followed.
_ELASTIC = 1.0 - 1e-5


def events_of(section: Section, lattice: Any, threshold: float) -> tuple[Event, ...]:
    """The events of an orbit with these impacts, apart from the multiplier it closes with."""
    endless = lattice.sites is None
    breaking = real_multiplier("PF", 1.0) if section.symmetric else real_multiplier("PD", -1.0)
    mixed = (Event("MX", None, count=_certain_count),) if endless and not section.symmetric else ()
    return (breaking, pair_leaves(lattice, threshold), grazed(), *mixed, *merging(section))


def events_without_losses(section: Section, lattice: Any, threshold: float) -> tuple[Event, ...]:
    """The same on the infinite chain or a ring whose band is on the unit circle."""
    if isinstance(lattice, Ring):
        check_threshold(threshold)  # there NS is by the paper's rule
    return events_of(section, lattice, threshold)


def _certain_count(point: Point) -> float | int:
    count = solution_at(point).map.count()
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
    """Each impact brings a pole where its velocity vanishes, which is divided out."""
    orbit = solution_at(point)
    if _is_blurred(orbit.map):
        return math.nan
    # J points away from the wall: each is positive as long as the site comes to it from inside
    pushes = [-impact.wall * impact.impulse for impact in orbit.impacts]
    return float(orbit.map.crosses(mu) * math.prod(pushes))


def _crosses_of_many(mu: float, counted: bool, points: Points) -> Many | None:
    along = breathers_along(points)
    if along is None:
        return None
    # |J| = 2p, eq. (4)
    return along.map.crosses(mu) * 2.0 * along.p, along.map.beyond(mu) if counted else None


def _is_blurred(map: Any) -> bool:
    return isinstance(map, ModalMap) and map.rounding > BLURRED


def _beyond(mu: float, point: Point) -> float:
    """How many multipliers are beyond mu: two that pass within one step are seen by it."""
    map = solution_at(point).map
    return math.nan if _is_blurred(map) else int(map.beyond(mu))


def _real_locus(mu: float, point: Point) -> DefiningSystem:
    orbit = solution_at(point)
    # mu = exp(i pi nu): nu is 0 for 1 and 1 for -1
    locus = orbit.representation.locus(OnCircle(nu=0.5 * (1.0 - mu)), point)
    # idle sites held by their neighbours alone have this multiplier without coupling, wherever
    modal = mu > 0.0 and isinstance(orbit.map, ModalMap)
    drifts = modal and orbit.lattice.sites > 1 and orbit.spring < WEAK
    return replace(locus, domain={"gamma": (WEAK, math.inf)}) if drifts else locus


def _examine_real(mu: float, point: Point) -> Examined:
    orbit = solution_at(point)
    size = np.prod(1.0 + np.abs(orbit.entries))  # D is linear in each entry b of (19)
    value = orbit.map.on_circle(0.5 * (1.0 - mu))  # D(mu) = det(1 + (S - 1) G(mu))
    if not abs(value) < _ZERO * size:
        return f"D({mu:g}) = {value.real:.2g} is not zero"
    if not orbit.symmetric:
        return ""
    # at the fold (14) the half map QS has the multiplier -1
    if abs(orbit.map.crosses(-1.0)) < _ZERO * size:
        return "a fold of the closure, not a pitchfork"
    return bends(point)


def branching() -> Event:
    """BP: another curve of solutions of the shooting equations crosses; as the engine's own, but
    with a determinant for its test, which large rings can afford."""
    test = Singular(bordered_matrix, _branching_test)
    return from_arms(replace(branch_point(), test=test, count=_beyond_closing))


def _branching_test(point: Point) -> float:
    if point.tangent is None:
        return math.nan
    orbit = solution_at(point)
    whole = np.vstack([point.curve.jacobian(point.z), point.curve.metric * point.tangent])
    return float(orbit.map.in_units_of_flight(whole, orbit.section.sign))


def _beyond_closing(point: Point) -> float:
    return _beyond(solution_at(point).section.sign, point)


# --- a complex pair -------------------------------------------------------------------------------


def pair_leaves(
    lattice: Any, threshold: float, *, elsewhere: bool = False, every: bool = False
) -> Event:
    """NS: a complex pair leaves the unit circle of the infinite chain; on a finite lattice, whose
    band is on that circle, the first to pass a threshold over the whole period.

    With `elsewhere` of a symmetric breather as one of that lattice, whichever it lives on; with
    `every` of a motion by exact modes any pair, after the first one, too.
    """
    endless = lattice.sites is None
    if not (endless or 1.0 <= real(threshold) < math.inf):
        raise BadInput(
            f"threshold = {shown(threshold)}: a finite modulus of at least 1 is expected."
        )
    pair = _Pair(threshold, lattice if elsewhere else None, every)
    count = pair.passed if endless or every else None
    many = pair.many if endless and not every else None
    # where one outside turns real the test of a finite lattice goes on with the next
    return Event(
        "NS", pair.test, many=many, count=count, locus=pair.locus, examine=_examine_angle,
        may_jump=not endless,
    )  # fmt: skip


@dataclass(frozen=True)
class _Pair:
    """The complex multipliers that are nearest to leaving a circle.

    Parameters
    ----------
    threshold : float
        Their modulus over the whole period on a finite lattice.
    lattice : InfiniteChain or Ring, optional
        Whose they are, unless those of the orbit's own.
    every : bool
        Whether each one that passes it counts, not the first alone; of multipliers by modes.
    """

    threshold: float
    lattice: Any = None
    every: bool = False

    def circle(self, map: Any) -> OnCircle:
        """Over a section, which may be half the period."""
        if map.lattice.sites is None:
            return OnCircle(lattice=self.lattice)
        # multipliers over the period are the squares of those over half of it
        half = isinstance(map, HalfMap) or map.sign < 0
        radius = math.sqrt(self.threshold) if half else self.threshold
        return OnCircle(radius, lattice=self.lattice)

    def map(self, point: Point) -> Any:
        map = solution_at(point).map
        return map if self.lattice is None else map.on(self.lattice)

    def test(self, point: Point) -> float:
        map = self.map(point)
        if map.lattice.sites is None:
            return self._on_chain(map, point)[0]
        if self.every and not _is_blurred(map):
            return passing(map.coupled, self.circle(map).radius)[0]
        return float(map.pairs(self.circle(map).radius)[0])

    def many(self, points: Points) -> Many | None:
        along = breathers_along(points)
        return None if along is None else along.map.pairs()

    def passed(self, point: Point) -> int:
        map = self.map(point)
        if self.every:
            return passing(map.coupled, self.circle(map).radius)[1]
        return self._on_chain(map, point)[1]

    def _on_chain(self, map: Any, point: Point) -> tuple[float, int]:
        # along a curve in k elastic impacts are the limit of those before: what is neutral only
        # there is no event
        if map.k == 1.0 and isinstance(map, OrbitMap):
            map = replace(map, k=_NEARLY)  # on the circle itself a side is rounding
        elif "k" in point.curve.varied and _is_elastic(map):
            map = replace(map, k=_ALL_BUT)
        answer: tuple[float, int] = map.pairs()
        return answer

    def locus(self, point: Point) -> DefiningSystem:
        map = self.map(point)
        if map.lattice.sites is None and map.gamma == 0.0:
            raise Undefined("at gamma = 0 there is no band for a pair to come out of")
        if _is_elastic(map):
            # two neutral multipliers meet on the circle, beyond the band, and leave it together
            raise Undefined("elastic impacts: no angle in the band, bisection has to do")
        angle = nearest_pair(map.coupled, self.circle(map).radius) if self.every else map.nearest()
        if math.isnan(angle):
            raise Undefined("no complex multipliers on this ring")
        return self.following(point, angle)

    def following(self, point: Point, angle: float) -> DefiningSystem:
        map, representation = self.map(point), solution_at(point).representation
        circle = self.circle(map)
        if map.lattice.sites is None:
            return representation.locus(circle, point, angle, domain={"k": (0.0, _ELASTIC)})
        if isinstance(map, HalfMap):
            others, beyond = _others(map, circle.radius, angle), circle.radius * (1.0 + _ON)
            outside = passing(others, beyond)[1] + _real_pairs(others, beyond)
            ends: tuple[Event, ...] = (_Next(self, circle.radius, outside).event(),)
        else:
            ends = tuple(_turns_real(circle.radius, point))
        return representation.locus(circle, point, angle, events=ends)


def _is_elastic(map: Any) -> bool:
    """Where pairs meet beyond the band: over half a period."""
    return isinstance(map, HalfMap) and map.k == 1.0 and map.lattice.sites is None


@dataclass(frozen=True)
class _Next:
    """Where another pair of a ring reaches the circle as well: beyond, the one that was followed is
    not the first to be there any more, and the rule's line goes on with the other. Of other pairs
    so many were `outside` where it set out, two real multipliers alike in sign counting as one:
    where these become a complex pair nothing ends."""

    pair: _Pair
    radius: float
    outside: int

    def event(self) -> Event:
        base = Event("NS", self.pair.test, locus=self.locus, examine=_examine_angle)
        return CodimensionTwo("NS-NS", self.test, ends="domain", base=base, examine=self.examine)

    def others(self, point: Point) -> NDArray[np.complex128]:
        return _others(self.pair.map(point), self.radius, point["nu"])

    def test(self, point: Point) -> float:
        mu = self.others(point)
        pairs = np.sort(abs(upper(mu)))[::-1]
        known = max(self.outside - _real_pairs(mu, self.radius), 0)
        return self.radius - float(pairs[known:].max(initial=0.0))

    def examine(self, point: Point) -> Mapping[str, Any]:
        return {"next": nearest_pair(self.others(point), self.radius)}

    def locus(self, point: Point) -> DefiningSystem:
        return self.pair.following(point, point.detail["next"])


def _others(map: Any, radius: float, angle: float) -> NDArray[np.complex128]:
    """The multipliers but for a pair on a circle."""
    followed = radius * cmath.exp(1j * math.pi * angle)
    pair = [int(abs(map.coupled - mu).argmin()) for mu in (followed, followed.conjugate())]
    return np.asarray(np.delete(map.coupled, pair))


def _real_pairs(mu: NDArray[np.complex128], radius: float) -> int:
    """How many pairs the real multipliers outside a circle may become."""
    real = mu[abs(mu.imag) <= REAL].real
    return sum(int(np.count_nonzero(side * real > radius)) // 2 for side in (1, -1))


def _turns_real(radius: float, point: Point) -> Iterator[Event]:
    """R1, R2: the pair has become a double real multiplier; the curve would come back over itself.
    Of half a symmetric orbit both 1 and -1 are 1 over the whole period."""
    events, half = {e.kind: e for e in point.curve.problem.events}, solution_at(point).symmetric
    plus, minus = (("R1", "PF"), ("R1", "LP")) if half else (("R1", "LP"), ("R2", "PD"))
    for mu, (kind, meets) in ((1.0, plus), (-1.0, minus)):
        yield CodimensionTwo(
            kind,
            partial(_from_real, mu),
            examine=partial(_is_double, mu * radius),
            ends="branch",
            # on another circle than that of modulus 1 no LP, PF or PD meets it
            base=events[meets if radius == 1.0 else "NS"],
        )


def _from_real(mu: float, point: Point) -> float:
    return float(point["nu"] if mu > 0.0 else 1.0 - point["nu"])


def _is_double(mu: float, point: Point) -> str:
    map = point.base_point.solution.map
    if np.sort(abs(map.coupled - mu))[1] > DOUBLE:
        return f"{mu:.6g} is not a double multiplier"
    # a Jordan block has one null vector; two multipliers that only pass each other have two
    pair = np.linalg.svd(map.matrix - mu * np.eye(len(map.matrix)), compute_uv=False)[-2]
    return "" if pair > DOUBLE else f"two multipliers {mu:.6g} that pass each other and stay a pair"


def _examine_angle(point: Point) -> str:
    """A pair outside may also turn real, one of the two coming in through +1 or -1 later on."""
    nu = point.detail.get("nu")
    if nu is None:
        if _is_elastic(solution_at(point).map):
            return ""
        return "a pair was seen to leave or to turn real, but no angle solves the locus"
    # exp(i pi nu) is real at nu = 0 and 1
    if not 2e-6 < abs(float(nu)) < 1.0 - 2e-6:
        return "a real multiplier passes the circle, no pair"
    return ""


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


def neimark_sacker(
    *,
    on: InfiniteChain | Ring | None = None,
    threshold: float | None = None,
    every: bool = False,
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
    if on is None and threshold is None and not every:
        return _deferred("NS")
    modulus = THRESHOLD if threshold is None else threshold
    form = {"kind": "NS", "on": on, "threshold": threshold, **({"every": True} if every else {})}
    if isinstance(on, InfiniteChain):
        threshold_on(on, threshold)
    elif on is not None:
        check_kind(on, Ring, "InfiniteChain() or Ring(sites)")
        check_threshold(modulus)
    return DeferredEvent("NS", choose=partial(_pair_leaves, on, modulus, every, form), form=form)


serialised("NS")(neimark_sacker)


def _pair_leaves(
    on: InfiniteChain | Ring | None,
    threshold: float,
    every: bool,
    form: Mapping[str, Any],
    problem: Problem,
) -> Event:
    orbit: Any = orbit_at(problem)
    if not isinstance(orbit, Orbit):
        raise BadInput(f"a threshold, or a lattice to ask about, is for orbits; got {orbit!r}.")
    if every and (on is not None or not isinstance(orbit.map, ModalMap)):
        raise BadInput(
            "every=True counts the multipliers of exact modes, on the orbit's own lattice: "
            "leave it out, or give the breather of a ring spring=0.0"
        )
    closed = isinstance(orbit.map, HalfMap)
    if on is None and orbit.lattice.sites is None:
        raise BadInput(
            f"threshold = {shown(threshold)}: the infinite chain has none, its verdict is exact; "
            "name the ring it is about, on=Ring(N)."
        )
    if every:
        event = pair_leaves(orbit.lattice, threshold, every=True)
    elif on is None or on == orbit.lattice:
        event = _of_kind("NS", orbit.representation.problem(threshold))
    elif closed:
        event = pair_leaves(on, threshold, elsewhere=True)
    else:
        raise BadInput(
            f"on = {on!r}: another lattice goes with events of symmetric breathers of "
            f"chain and ring only; take the orbit there, orbit.on({on!r})."
        )
    # with the column of what is unstable on the same lattice, by the same threshold
    lattice: Any = on or orbit.lattice
    about = f"threshold {threshold:g}"
    if closed:
        endless = lattice.sites is None
        about = "" if endless else f"stability of a ring of {lattice.sites}, {about}"
    record = {"unstable": unstable_by(threshold, on if closed else None)}
    return EventWithRule.of_event(event, record=record, about=about, form=form)
