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

from contbreather.checks import brief, flag
from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.curve.branch import Points
from contbreather.continuation.curve.point import (
    CodimensionTwo,
    DefiningSystem,
    Detail,
    Event,
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
from contbreather.orbits.section import WEAK, Section
from contbreather.stability.modal_map import ModalMap
from contbreather.stability.one_impact import RealScalars, RingHalfMap
from contbreather.stability.verdict import THRESHOLD, check_threshold
from contbreather.stability.zeros import REAL, nearest_pair, passing, upper
from contbreather.storage.serialise import serialised

_ZERO = 1e-8  # the scalar of a real multiplier where that is located, relative to its terms
DOUBLE = 1e-3  # how far from each other multipliers are that are one, where it is located

# As k -> 1 the angle of a Neimark-Sacker point tends to the edge of the band like (1 - k)^2, on an
# arm to its pitchfork like sqrt(1 - k): within rounding of that the curve cannot be followed.
_ELASTIC = 1.0 - 1e-5
COUPLED = {"gamma": (WEAK, math.inf)}  # domain of curves of multipliers where coupling alone holds


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


def held_by_neighbours(orbit: Orbit) -> bool:
    """Tell whether idle sites have the multiplier 1 without coupling, wherever they rest."""
    return type(orbit.map) is ModalMap and orbit.lattice.sites > 1 and orbit.spring < WEAK


def is_blurred(orbit: Any) -> bool:
    """Test whether multipliers mean nothing: they have a pole where an impact vanishes."""
    if orbit.vanishing is not None:
        return True
    # of a multiplier with such rounding neither a sign nor a count is to be had
    return isinstance(orbit.map, ModalMap) and orbit.map.rounding > 1e-4


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


# --- a pair of multipliers ------------------------------------------------------------------------


def pair_leaves(lattice: Any, threshold: float, *, every: bool = False) -> Event:
    """NS: a complex pair leaves the unit circle of the infinite chain; on a finite lattice, whose
    band is on that circle, the first to pass a threshold over the whole period; with `every` any
    pair, after the first one, too."""
    endless = lattice.sites is None
    if not endless:
        check_threshold(threshold, neutral=False)
    pair = _Pair(threshold, every)
    count = pair.passed if endless or every else None
    many = pair.many if endless and not every else None
    # where one outside turns real the test of a finite lattice goes on with the next
    return Event(
        "NS", pair.test, many=many, count=count, locus=pair.locus, examine=_examine_angle,
        may_jump=not endless,
    )  # fmt: skip


@dataclass(frozen=True)
class _Pair:
    """The complex multipliers that are nearest to leaving a circle."""

    threshold: float  # their modulus over the whole period on a finite lattice
    every: bool = False  # whether each one that passes it counts, not the first; of those by modes

    def radius(self, map: Any) -> float:
        """Radius of the circle over a section, which may be half the period."""
        if map.lattice.sites is None:
            return 1.0
        # multipliers over the period are the squares of those over half of it
        return math.sqrt(self.threshold) if map.sign < 0 else self.threshold

    def test(self, point: Point) -> float:
        if point.solution.vanishing is not None:
            return math.nan
        map = point.solution.map
        if map.lattice.sites is None:
            return self._on_chain(map, point)[0]
        if self.every and not is_blurred(point.solution):
            return passing(map.coupled, self.radius(map))[0]
        return float(map.pairs(self.radius(map))[0])

    def many(self, points: Points) -> Many | None:
        along = breathers_along(points)
        return None if along is None else along.map.pairs()

    def passed(self, point: Point) -> float:
        if point.solution.vanishing is not None:
            return math.nan
        map = point.solution.map
        if self.every:
            return passing(map.coupled, self.radius(map))[1]
        return self._on_chain(map, point)[1]

    def _on_chain(self, map: Any, point: Point) -> tuple[float, int]:
        # along a curve in k elastic impacts are the limit of those before: what is neutral only
        # there is no event
        if map.k == 1.0 and map.sign > 0:
            # what is on the circle at k = 1 is inside by more than rounding
            map = replace(map, k=1.0 - 1e-9)
        elif "k" in point.curve.varied and _is_elastic(map):
            map = replace(map, k=1.0 - 1e-15)
        answer: tuple[float, int] = map.pairs()
        return answer

    def locus(self, point: Point) -> DefiningSystem:
        map = point.solution.map
        if map.lattice.sites is None and map.gamma == 0.0:
            raise Undefined("at gamma = 0 there is no band for a pair to come out of")
        if _is_elastic(map):
            # two neutral multipliers meet on the circle, beyond the band, and leave it together
            raise Undefined("elastic impacts: no angle in the band, bisection has to do")
        angle = nearest_pair(map.coupled, self.radius(map)) if self.every else map.nearest()
        if math.isnan(angle):
            raise Undefined("no complex multipliers on this ring")
        return self.following(point, angle)

    def following(self, point: Point, angle: float) -> DefiningSystem:
        map, representation = point.solution.map, point.solution.representation
        circle = OnCircle(self.radius(map))
        if map.lattice.sites is None:
            return representation.locus(circle, point, angle, domain={"k": (0.0, _ELASTIC)})
        if isinstance(map, RingHalfMap):
            # what is closer is on the circle, as both pairs are where they meet
            others, beyond = _others(map, circle.radius, angle), circle.radius * (1.0 + 1e-8)
            outside = passing(others, beyond)[1] + _real_pairs(others, beyond)
            events = [_Next(self, circle.radius, outside).event()]
        else:
            events = [*_turns_real(circle.radius, point), _Another(self, circle.radius).event()]
        domain = COUPLED if held_by_neighbours(point.solution) else {}
        return representation.locus(circle, point, angle, events=tuple(events), domain=domain)


def _is_elastic(map: Any) -> bool:
    """Test whether pairs meet beyond the band, over half a period."""
    return map.lattice.sites is None and map.sign < 0 and map.k == 1.0


@dataclass(frozen=True)
class _Another:
    """Point at which another pair passes the circle as well."""

    pair: _Pair
    radius: float

    def event(self) -> Event:
        base = Event("NS", self.pair.test, locus=self.locus, examine=_examine_angle)
        # where one outside turns real the test goes on with the next
        return CodimensionTwo(
            "NS-NS", self.test, count=self.count, base=base, examine=self.examine, may_jump=True
        )

    def others(self, point: Point) -> NDArray[np.complex128]:
        return _others(point.solution.map, self.radius, point["nu"])

    def test(self, point: Point) -> float:
        return passing(self.others(point), self.radius)[0]

    def count(self, point: Point) -> int:
        return passing(self.others(point), self.radius)[1]

    def examine(self, point: Point) -> Mapping[str, Any]:
        return {"next": nearest_pair(self.others(point), self.radius)}

    def locus(self, point: Point) -> DefiningSystem:
        return self.pair.following(point, point.detail["next"])


@dataclass(frozen=True)
class _Next(_Another):
    """Point at which another pair of a ring reaches the circle: beyond, the one that was followed
    is not the first to be there any more, and the rule's line goes on with the other. Of other
    pairs so many were `outside` where it set out, two real multipliers alike in sign counting as
    one: where these become a complex pair nothing ends."""

    outside: int

    def event(self) -> Event:
        return replace(super().event(), count=None, may_jump=False, ends="domain")

    def test(self, point: Point) -> float:
        mu = self.others(point)
        pairs = np.sort(abs(upper(mu)))[::-1]
        known = max(self.outside - _real_pairs(mu, self.radius), 0)
        return self.radius - float(pairs[known:].max(initial=0.0))


def _others(map: Any, radius: float, angle: float) -> NDArray[np.complex128]:
    """The multipliers but for a pair on a circle."""
    followed = radius * cmath.exp(1j * math.pi * angle)
    pair = [int(abs(map.coupled - mu).argmin()) for mu in (followed, followed.conjugate())]
    return np.asarray(np.delete(map.coupled, pair))


def _real_pairs(mu: NDArray[np.complex128], radius: float) -> int:
    """Count the pairs that the real multipliers outside a circle may become."""
    real = mu[abs(mu.imag) <= REAL].real
    return sum(int(np.count_nonzero(side * real > radius)) // 2 for side in (1, -1))


def _turns_real(radius: float, point: Point) -> Iterator[Event]:
    """R1, R2: the pair has become a double real multiplier; the curve would come back over itself.
    Of half a symmetric orbit both 1 and -1 are 1 over the whole period."""
    events, half = {e.kind: e for e in point.curve.problem.events}, point.solution.symmetric
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
    map = point.solution.map
    apart = np.sort(abs(map.coupled - mu))[1]
    if apart > DOUBLE:
        return f"{mu:.6g} is not a double multiplier"
    # a Jordan block has one null vector, however weak it is; two that only pass each other have two
    pair = np.linalg.svd(map.matrix - mu * np.eye(len(map.matrix)), compute_uv=False)[-2]
    if pair > min(DOUBLE, apart / DOUBLE):
        return ""
    return f"two multipliers {mu:.6g} that pass each other and stay a pair"


def _examine_angle(point: Point) -> str:
    """A pair outside may also turn real, one of the two coming in through +1 or -1 later on."""
    nu = point.detail.get("nu")
    if nu is None:
        if _is_elastic(point.solution.map):
            return ""
        return "a pair was seen to leave or to turn real, but no angle solves the locus"
    # exp(i pi nu) is real at nu = 0 and 1
    if not 2e-6 < abs(float(nu)) < 1.0 - 2e-6:
        return "a real multiplier passes the circle, no pair"
    return ""


# --- of any problem, by their kinds ---------------------------------------------------------------

WHY: Mapping[str, str] = {
    "PF": "only a symmetric orbit, known by half its period, has a pitchfork",
    "PD": "maps and orbits have one, symmetric orbits after they broke their symmetry (PF)",
    "NS": "a complex pair is looked for in the map of an orbit",
    "GR": "only what moves between walls can graze them",
}


@dataclass(frozen=True, repr=False)
class DeferredEvent(Event):
    """An event that is known by its kind; `choose` finds that of a problem."""

    test: Any = field(default=None, init=False)
    choose: Callable[[Problem], Event] = field(kw_only=True)

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


def _deferred(kind: str) -> Event:
    return DeferredEvent(kind, choose=partial(_of_kind, kind))


def _of_kind(kind: str, problem: Problem) -> Event:
    event = next((event for event in problem.events if event.kind == kind), None)
    if event is None:
        raise BadInput(f"no {kind} of this problem ({problem.kinds}): {WHY[kind]}.")
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
        paper. On its boundary NS-NS is where another pair gets there, too: that of a ring without
        damping and springs ends there, as the first pair is the rule
        (`contbreather.paper.threshold.neimark_sacker_line` puts the pieces together), others follow
        theirs beyond.
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
    return replace(event, record=record, about=about, form=form)
