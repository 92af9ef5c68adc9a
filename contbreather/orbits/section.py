"""Which site hits which wall, in what order, and how that closes: what an orbit is asked to be; and
what follows from its impacts alone, momenta, velocities, entries of the saltation.

An orbit of period 2 pi n is a list of impacts ``(site, wall)``. A symmetric one, ``u(t + pi n) =
-u(t)``, is known from half of it: its section is half a period long and closes with the sign -1.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import is_whole, one_of
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import check_gamma
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.forcing import Forcing, check_symmetric, even_harmonics
from contbreather.lattice.response import mean_displacement

FloatArray = NDArray[np.float64]
Sequenced = tuple[tuple[int, int], ...]

AT_ONCE = 1e-6  # impacts less apart than this are at once: mirror images of each other
SHORT = 1e-2  # a flight this short, from a wall back to it, is a cubic: rounding would be all else
VANISHED = 1e-8  # an impact at a smaller velocity is none
SAME = 1e-7  # times and impulses that differ by less are equal, equations off by less right
WEAK = 1e-6  # below this coupling sites hardly feel each other: rounding decides where they rest


class ImpossibleSequence(BadInput):
    """No orbit has these impacts: `sequence` is what was asked for, `met` what was seen instead."""

    def __init__(self, message: str, *, sequence: Any = None, met: Any = None) -> None:
        super().__init__(message)
        self.sequence = sequence
        self.met = met


class Impact(NamedTuple):
    """One impact: which site hits which wall (+1 or -1), when, and the impulse it receives."""

    site: int
    wall: int
    time: float
    impulse: float


@dataclass(frozen=True)
class Section:
    """Impacts in order, and how the flight through them closes.

    Parameters
    ----------
    impacts : sequence of (site, wall)
        Of one period; of half a period if the sign is -1. Walls are +1 and -1. Impacts of one site
        come in this order; those of different sites may overtake each other.
    turns : int
        n, for the period 2 pi n.
    sign : {1, -1}
        The state after a section is this many times that before. With -1 the second half of the
        period repeats the first upside down; n must be odd.

    Raises
    ------
    BadInput
        No impact, a site that is not a whole number, a wall that is neither +1 nor -1.

    Examples
    --------
    >>> Section(((0, 1), (0, -1))).length == 2 * math.pi
    True
    >>> half = Section(((0, 1),), sign=-1)
    >>> half.length == math.pi, half.unfolded().impacts
    (True, ((0, 1), (0, -1)))
    """

    impacts: Sequenced
    turns: int = 1
    sign: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "impacts", checked_impacts(self.impacts))
        if not is_whole(self.turns) or self.turns < 1:
            raise BadInput(f"turns = {self.turns!r}: periods are 2 pi n with a whole n >= 1.")
        one_of("sign", self.sign, (1, -1))
        if self.symmetric and self.turns % 2 == 0:
            raise BadInput(
                f"a symmetric orbit of period {2 * self.turns} pi: u(t + pi n) = -u(t) needs an "
                f"odd n, because the forcing changes sign after pi; n = {self.turns} was given."
            )

    @cached_property
    def symmetric(self) -> bool:
        return self.sign < 0

    @cached_property
    def count(self) -> int:
        return len(self.impacts)

    @cached_property
    def period(self) -> float:
        return 2.0 * math.pi * self.turns

    @cached_property
    def length(self) -> float:
        return 0.5 * self.period if self.symmetric else self.period

    @cached_property
    def hit(self) -> tuple[int, ...]:
        return tuple(sorted({n for n, _ in self.impacts}))

    @property
    def local(self) -> bool:
        """True where one site alone hits its walls."""
        return len(self.hit) == 1

    @property
    def two_impacts(self) -> bool:
        """True where one site hits the wall +1 and then the wall -1, once each in 2 pi."""
        walls = [wall for _, wall in self.impacts]
        return self.sign > 0 and self.turns == 1 and walls == [1, -1] and self.local

    @property
    def mirrored(self) -> bool:
        """True if the second half hits the opposite walls: half a symmetric orbit may do for it."""
        half = self.impacts[: self.count // 2]
        # the forcing of the second half is the opposite one, F(t + pi n) = -F(t), for odd n only
        opposite = tuple((n, -wall) for n, wall in half)
        return self.sign > 0 and self.turns % 2 == 1 and self.impacts == half + opposite

    @cached_property
    def repeats(self) -> tuple[tuple[int, int], ...]:
        """Impacts of one site at one wall that follow each other, by index."""
        follow = (pair for site in self.hit for pair in pairwise(self.of_site(site)))
        return tuple((i, j) for i, j in follow if self.impacts[i] == self.impacts[j])

    def of_site(self, site: int) -> list[int]:
        """Indices of the impacts of one site."""
        return [j for j, (n, _) in enumerate(self.impacts) if n == site]

    def offset_names(self, taken: Collection[str] = ()) -> tuple[str, ...]:
        """Names of the offsets of its sites, c or c1, c2, ...; others where parameters have some of
        these, as those of a Fourier sum do."""
        names = ["c"] if self.local else [f"c{i + 1}" for i in range(len(self.hit))]
        stem = "c" if {*names}.isdisjoint(taken) else "offset"
        return tuple(stem + name[1:] for name in names)

    def unfolded(self) -> Section:
        """The impacts of the full period, without use of the symmetry."""
        if not self.symmetric:
            return self
        # u(t + T/2) = -u(t): the opposite wall half a period later
        mirrored = tuple((n, -wall) for n, wall in self.impacts)
        return Section(self.impacts + mirrored, self.turns)

    def doubled(self) -> Section:
        """Repeat the impacts, over twice the period."""
        if self.symmetric:
            raise BadInput(
                "a symmetric orbit does not double its period; break its symmetry first, unfolded()"
            )
        return Section(self.impacts * 2, 2 * self.turns)

    def course(self, impacts: Sequence[Impact], sections: int = 0) -> tuple[Impact, ...]:
        """The impacts of so many sections, of a period unless given, from those of one."""
        T, sign = self.length, self.sign  # u(t + T) = sign u(t)
        sections = sections or (2 if sign < 0 else 1)
        return tuple(
            Impact(n, sign**i * wall, t + i * T, sign**i * J)
            for i in range(sections)
            for n, wall, t, J in impacts
        )

    def placed(self, lattice: Any) -> Section:
        """Look its sites up on a lattice, negative ones counted from its end."""
        sites = lattice.sites
        if sites is None:
            return self
        for site, wall in self.impacts:
            if not -sites < site < sites:
                raise ImpossibleSequence(
                    f"impact ({site!r}, {wall!r}): no such site on the {lattice.describe()}; sites "
                    f"are whole numbers from 0 to {sites - 1}.",
                    sequence=self.impacts,
                )
        return self.around(sites)

    def around(self, sites: int) -> Section:
        """Count its sites modulo the size of a lattice."""
        impacts = tuple((site % sites, wall) for site, wall in self.impacts)
        if len({site for site, _ in impacts}) < len(self.hit):
            raise BadInput(
                f"the impacting sites {list(self.hit)} fall together on a lattice of {sites} "
                "sites: take a larger one."
            )
        return self if impacts == self.impacts else replace(self, impacts=impacts)

    def on(self, lattice: Any) -> Section:
        """On another lattice: modulo a ring, a single site 0 on the infinite chain."""
        if lattice.sites is None and len(self.hit) == 1:
            return replace(self, impacts=tuple((0, wall) for _, wall in self.impacts))
        return self.around(lattice.sites) if isinstance(lattice, Ring) else self.placed(lattice)

    def to_dict(self) -> dict[str, Any]:
        """By numbers, for files."""
        return {"impacts": [*map(list, self.impacts)], "turns": self.turns, "sign": self.sign}

    def describe(self) -> str:
        impacts = " ".join(f"{n}{'+' if wall > 0 else '-'}" for n, wall in self.impacts)
        half = ", half of a symmetric orbit" if self.symmetric else ""
        return f"period {2 * self.turns} pi, impacts {impacts}{half}"


def checked_impacts(impacts: Sequence[Any]) -> Sequenced:
    """The impacts as pairs of whole numbers, or what is wrong with them."""

    def refuse(why: str) -> ImpossibleSequence:
        return ImpossibleSequence(why, sequence=impacts)

    try:
        pairs = [(site, wall) for site, wall in impacts]
    except (TypeError, ValueError) as error:
        raise refuse(
            f"sequence = {impacts!r}: impacts are pairs (site, wall), for instance "
            f"((0, 1), (0, -1)); {error}."
        ) from error
    if not pairs:
        raise refuse(
            "the sequence of impacts is empty: without impacts a lattice only follows its "
            "forcing; give pairs (site, wall), for instance ((0, 1), (0, -1))."
        )
    for site, wall in pairs:
        if not is_whole(site):
            raise refuse(
                f"site {site!r}: sites are whole numbers; site (i, j) of a grid has the number "
                "i columns + j, a node of a graph its place among the nodes."
            )
        if isinstance(wall, bool) or wall not in (1, -1):
            raise refuse(f"impact ({site!r}, {wall!r}): walls are +1 and -1.")
    return tuple((int(site), int(wall)) for site, wall in pairs)


# --- which sections can be under which conditions ------------------------------------------------


def check_possible(section: Section, on: Conditions) -> None:
    """`BadInput` where walls or drive have no half section, a wall is not there, waves leave, or
    nothing brings the sites back."""
    if section.symmetric:
        check_symmetric(on.forcing)
    if section.symmetric and (pair := on.walls.askew):
        raise BadInput(
            f"the walls are not symmetric, low = {pair[0]:g} and high = {pair[1]:g}: no orbit is "
            "its own mirror image half a period later, there is no half section and no pitchfork; "
            "shoot the whole period in Python, shooting(..., symmetric=False)."
        )
    for site, wall in section.impacts:
        if math.isinf(on.walls.position(site, wall)):
            raise ImpossibleSequence(
                f"impact ({site}, {wall:+d}): site {site} has no wall on that side.",
                sequence=section.impacts,
            )
    if on.lattice.highest_gamma <= on.gamma:
        check_gamma(on.gamma)  # says why
    check_both_walls(section, on)
    if 0 in even_harmonics(on.forcing):
        mean_displacement(on.lattice, section.hit, on.gamma, on.spring)  # or a sentence


def check_both_walls(section: Section, on: Conditions) -> None:
    """`ImpossibleSequence` where all impulses push the same way and nothing holds the lattice."""
    walls = {wall for _, wall in section.impacts}
    # a mean of the drive may push the other way
    if section.symmetric or len(walls) == 2 or on.spring >= WEAK or 0 in even_harmonics(on.forcing):
        return
    # the lowest mode that impacts excite has w = 0 where nothing ties the lattice to the ground
    if on.lattice.sites is not None and on.lattice.basis(section.hit).lam.min() >= WEAK:
        return
    raise ImpossibleSequence(
        f"the sequence {section.impacts} hits the wall at {walls.pop():+d} only: every impact "
        "pushes a lattice that nothing holds the same way and it never comes back; let it hit "
        "both, or give it a spring.",
        sequence=section.impacts,
    )


def check_order(section: Section, times: Any) -> None:
    """`BadInput` unless the impacts of each site come in order, within one section."""
    for site in section.hit:
        indices = section.of_site(site)
        # after the last impact of a section comes the first, a section later
        for j, later in zip(indices, [*indices[1:], indices[0]], strict=True):
            length = times[later] - times[j] + (section.length if later <= j else 0.0)
            if length <= 0.0:
                after = f"t{later + 1}" + (" + a section" if later <= j else "")
                raise BadInput(
                    f"impacts of site {site} out of order: t{j + 1} = {times[j]:.9g} does not come "
                    f"before {after} = {times[j] + length:.9g}; times of a site rise within one "
                    f"section of length {section.length:.6g}."
                )
    if np.ptp(times) > section.length + AT_ONCE:
        early, late = int(np.argmin(times)) + 1, int(np.argmax(times)) + 1
        raise BadInput(
            f"impact times {np.asarray(times).tolist()}: t{late} is more than a section of length "
            f"{section.length:.6g} after t{early}, so it has been overtaken by the next one of "
            f"those; list the impacts from t{late} on."
        )


# --- what follows from impacts alone --------------------------------------------------------------


class Hit(NamedTuple):
    """An impact: velocities of the site before and after it, and its acceleration just after."""

    site: int
    wall: int
    time: float
    before: float
    after: float
    acceleration: float


def _of(path: str) -> Any:
    return property(attrgetter(path))


class ImpactSequence:
    """Impacts with the conditions they happen under, read off a representation."""

    representation: Any

    conditions: Conditions = _of("representation.conditions")
    section: Section = _of("representation.section")
    impacts: tuple[Impact, ...] = _of("representation.impacts")
    offsets: tuple[float, ...] = _of("representation.offsets")
    accelerations: FloatArray = _of("representation.accelerations")  # before each impact
    residual: float = _of("representation.error")  # rounding, unless it was put together by hand
    map: Any = _of("representation.map")  # of small perturbations over a section
    c: float = _of("representation.c")  # by how much the lattice as a whole sits off centre
    a: float = _of("conditions.a")
    gamma: float = _of("conditions.gamma")
    k: float = _of("conditions.k")
    damping: float = _of("conditions.damping")
    spring: float = _of("conditions.spring")
    forcing: Forcing = _of("conditions.forcing")
    walls: Walls = _of("conditions.walls")
    lattice: Any = _of("conditions.lattice")
    period: float = _of("section.period")
    symmetric: bool = _of("section.symmetric")  # whether ``u(t + period/2) = -u(t)`` is used

    # ---------------------------------------------------------------------------- its impacts

    @cached_property
    def times(self) -> FloatArray:
        return np.array([impact.time for impact in self.impacts])

    @cached_property
    def impulses(self) -> FloatArray:
        """By how much the velocity of the site changes at each of them."""
        return np.array([impact.impulse for impact in self.impacts])

    @property
    def sides(self) -> NDArray[np.int64]:
        """Walls that are hit, +1 or -1."""
        return np.array([wall for _, wall in self.section.impacts])

    @property
    def vanishing(self) -> int | None:
        """Number of an impact that has lost its velocity: there the saltation (19) has a pole."""
        speeds = np.abs(self.incoming)
        return int(speeds.argmin()) if speeds.size and speeds.min() < VANISHED else None

    @property
    def incoming(self) -> FloatArray:
        """Velocity of the site just before each impact, ``-J/(1 + k)``."""
        # u' -> -k u'
        return np.asarray(-self.impulses / (1.0 + self.at_impacts("k")))

    def at_impacts(self, name: str) -> Any:
        """Values of k or damping at the site of each impact."""
        on: Conditions = self.representation.conditions
        return on.at_sites(name, [site for site, _ in self.section.impacts])

    @cached_property
    def entries(self) -> FloatArray:
        """The entries b of the saltation matrices (19), one for each impact of a section."""
        b: FloatArray = self.gains / self.speeds
        b.setflags(write=False)
        return b

    @property
    def speeds(self) -> FloatArray:
        """Speed towards its wall just before each impact, negative where it comes from behind."""
        return self.sides * self.incoming

    @property
    def gains(self) -> FloatArray:
        """Entries b times these speeds, which stay finite where an impact vanishes: how much faster
        a site leaves its wall per unit of time that it comes sooner."""
        # b = (1 + k) u''/u' of (19), with losses; braked less after the impact than before, a site
        # turns round faster by damping (1 + k) v
        braked = self.accelerations + self.at_impacts("damping") * self.incoming
        return np.asarray((1.0 + self.at_impacts("k")) * self.sides * braked)

    @cached_property
    def hits(self) -> tuple[Hit, ...]:
        """Impacts of a period in order of time."""
        k, before = self.at_impacts("k"), self.incoming
        # just after the impact a damped site is braked the other way
        turned = self.accelerations + self.at_impacts("damping") * (1.0 + k) * before
        moved = np.column_stack([before, -k * before, turned])
        if self.section.symmetric:  # u(t + T/2) = -u(t)
            moved = np.concatenate([moved, -moved])
        course = self.section.course(self.impacts)
        hits = (Hit(*hit[:3], *row) for hit, row in zip(course, moved.tolist(), strict=True))
        return tuple(sorted(hits, key=lambda hit: hit.time))

    @property
    def p(self) -> float:
        """Half the momentum of each impact, where all are the same."""
        sizes = 0.5 * np.abs(self.impulses)  # |J| = 2p, eq. (4)
        # momenta that differ by less are equal
        if np.ptp(sizes) > 1e-9 * sizes.max():
            raise BadInput(f"the impacts have different momenta: half of them are {sizes}.")
        return float(sizes[0])

    @property
    def phi(self) -> float:
        """Time of the impact on the wall +1 of a symmetric orbit of one site."""
        self._need_one("phi")
        # (3): the wall +1 at phi, the wall -1 half a period later
        late = 0.0 if self.impacts[0].wall > 0 else self.section.length
        return math.remainder(self.impacts[0].time + late, self.period)

    @property
    def chi(self) -> float:
        """Mean place of a site per unit p by its impacts, eq. (10): ``p chi = wall - a f(phi)``."""
        self._need_one("chi")
        return float(self.representation.chi)

    @property
    def b(self) -> float:
        """The entry of the saltation matrix (19), the same at every impact."""
        self._need_one("b")
        return float(self.entries[0])

    @property
    def asymmetry(self) -> float:
        """``t2 - t1 - pi`` of an orbit with two impacts: 0 where both flights are equal. Of more
        that of the impact and its mirror image, half the impacts later, that are farthest off."""
        if not self.section.mirrored:
            raise self._lacks("asymmetry", "orbits whose second half hits the opposite walls")
        first, second = self.times.reshape(2, -1)
        # equal flights: the mirror image of an impact comes half a period after it
        late = (second - first) % self.section.period - 0.5 * self.section.period
        return float(late[abs(late).argmax()])

    def _need_one(self, name: str) -> None:
        if not self.symmetric or self.section.count > 1:
            raise self._lacks(name, "symmetric orbits with one impact in half a period")

    def _lacks(self, name: str, which: str) -> BadInput:
        return BadInput(f"{name} belongs to {which}; this one has the {self.describe()}.")

    # ------------------------------------------------------------------------------- its parts

    @property
    def repeats(self) -> bool:
        """True where the second half of a section is the first again, or its mirror image."""
        halves = (part for part in self.parts() if 2 * part.count == self.section.count)
        return any(map(self.first_of, halves))

    def parts(self) -> Iterator[Section]:
        """Sections of which the orbit may consist, going by its walls."""
        impacts, turns = self.section.impacts, self.section.turns
        if self.symmetric:
            return
        for number in (2, 3, 5, 7):
            m = len(impacts) // number
            if m and turns % number == 0 and impacts == impacts[:m] * number:
                yield Section(impacts[:m], turns // number)
        if self.section.mirrored and self.conditions.symmetric:
            yield Section(impacts[: len(impacts) // 2], turns, -1)

    def first_of(self, section: Section) -> tuple[Impact, ...]:
        """The impacts of one of several equal parts, their mean; empty if these are not equal."""
        m = section.count
        part = np.arange(self.section.count // m)[:, None]
        times = self.times.reshape(-1, m) - section.length * part
        impulses = self.impulses.reshape(-1, m) * float(section.sign) ** part
        if max(np.ptp(times, axis=0).max(), np.ptp(impulses, axis=0).max()) > SAME:
            return ()
        means = zip(section.impacts, times.mean(axis=0), impulses.mean(axis=0), strict=True)
        return tuple(Impact(*impact, float(t), float(J)) for impact, t, J in means)

    def describe(self) -> str:
        return f"{self.section.describe()} on the {self.lattice.describe()}"
