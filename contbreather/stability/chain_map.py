"""Stability of periodic orbits with impacts on the infinite chain, reduced to the impacts.

Over n forcing periods ``M = Q(T_m) S_m ... Q(T_1) S_1``: free flights Q and one 2x2 block ``S_j``
at the impacting site for each of the m impacts (19). A perturbation that grows by mu a period is
known from what it is at the impacts, ``x_i = sum over j of X_ij(mu) (S_j - 1) x_j`` with the mean
propagators X: a kick at one impact that recurs every period, mu times as large, moves the state at
another by

    ``X(s) = <cos(d theta) [[G', G], [G'', G']](s)>``,   s the time between, d the distance,

G the Green's function with ``G(s + 2 pi) = mu G(s)``, time in units of n forcing periods. So, with
as many sites as there are,

    ``D(mu) = det(1 - X(mu) (S - 1))``,   2m x 2m,   D -> 1 as mu -> infinity,

vanishes at the multipliers the impacts make. With mu = exp(2 pi i kappa) the aliases kappa and
kappa - 1 may lie in the band, and kappa + 1 comes next to it. Each enters X as a matrix of rank one
times its resolvent g, infinite at mu = 1 and at the band's edges, and, with several sites, one that
stays bounded there: sites answer each other as on a chain that is held at the first of them, plus
what the motion of that one brings. We border the determinant by the vectors of rank one, with 1/g
in the corner. ``F = -D/(g(kappa) g(kappa - 1) g(kappa + 1))`` is that bordered determinant but for
its sign, continuous and bounded along the whole unit circle, arcs and their ends included (there:
the limit from outside). Its turning along the upper half of the circle is a whole number of half
turns and counts the multipliers outside: ``count = 1 - turning/pi``; the 1 is what the resolvents
themselves turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.band_averages import bernoulli, binomial, check_gamma
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.periodic_green import check_coupling
from contbreather.parameters import parameter
from contbreather.stability.bordered import (
    CLOSED,
    EVERYWHERE,
    EXPANDED,
    FAR,
    HIGHEST,
    NEAR,
    ORDERS,
    POWERS,
    CountWorkspace,
    Impacts,
    PairSeries,
)
from contbreather.stability.modal_map import ModalMap, section_map
from contbreather.stability.saltation import Saltation
from contbreather.stability.zeros import (
    Count,
    as_counted,
    distinct,
    multipliers_of,
    newton_from_all,
    refined_samples,
)

Array = NDArray[Any]

CERTAIN = 1e-12  # of F's own terms: closer to zero than that, a count is not certain
FLAT = 1e-14  # of the same: below that F is rounding, and samples of it tell nothing
ON_CIRCLE = 1e-14  # how far off in kappa a multiplier is on the circle to within rounding
FARTHEST = 0.25  # of a pair from the circle: beyond that it is all the same
RINGS = (40, 80, 160, 320)  # sites of rings whose multipliers are where Newton's method begins
DEEP = 1.0  # |Im kappa|, |mu| = 535, beyond which a ring is the infinite chain, and F loses digits


@dataclass(frozen=True)
class OrbitMap:
    """The map of small perturbations over one period of an orbit with impacts, `kicks` in order of
    time, each (site, time, b) with b as in `saltation_entry`.

    The symmetric breather hits both walls half a period apart; it is stable below its pitchfork:

    >>> [OrbitMap(0.04, 0.8, [(0, 0.0, b), (0, math.pi, b)]).count().count for b in (0.9, 1.1)]
    [0, 1]
    """

    gamma: float
    k: float
    kicks: tuple[Saltation, ...]
    periods: float = 1  # n, of 2 pi n; or 1/2, of a section that is half a forcing period
    spring: float = 0.0  # of every site, for such a section
    sign: ClassVar[int] = 1

    def __post_init__(self) -> None:
        kicks = tuple(Saltation(int(site), *map(float, rest)) for site, *rest in self.kicks)
        object.__setattr__(self, "kicks", kicks)
        if not kicks:
            raise BadInput("an orbit without impacts is neutral: give at least one impact.")
        if not all(math.isfinite(sum(kick)) for kick in kicks):
            raise BadInput("the times of impact and the entries b must be finite numbers.")
        parameter("k", self.k)
        times = [kick.time for kick in kicks]
        late = times[-1] - times[0] - self.period
        if late > 0.0 or any(b < a for a, b in pairwise(times)):
            raise BadInput(
                f"impacts at {times}: give them in order of time, all within one period "
                f"2 pi {self.periods}."
            )
        if self.periods == 0.5:
            check_gamma(self.gamma, self.spring)
        else:
            check_coupling(self.lattice, self.gamma, int(self.periods))

    @cached_property
    def lattice(self) -> InfiniteChain:
        return InfiniteChain().with_spring(self.spring)

    @property
    def period(self) -> float:
        return 2.0 * math.pi * self.periods

    @property
    def scaled(self) -> float:
        """The coupling in units of n forcing periods."""
        return self.periods**2 * self.gamma

    @property
    def floor(self) -> float:
        return self.periods * math.sqrt(self.spring)

    @property
    def edge(self) -> float:
        return math.sqrt(self.floor**2 + 4.0 * self.scaled)

    # --- the reduced matrix ---

    @cached_property
    def _sites(self) -> Array:
        """Sites of the impacts, from the first one on."""
        sites = np.array([kick.site for kick in self.kicks])
        return sites - sites.min()

    @cached_property
    def _impacts(self) -> Impacts:
        """Arguments of the kernels, with the expansions of their propagators."""
        m, n, sites = len(self.kicks), self.periods, self._sites
        impacts = Impacts(
            self.scaled,
            self.floor,
            -(1.0 + self.k),
            np.array([kick.time / n for kick in self.kicks]),
            np.array([n * kick.b for kick in self.kicks]),
            np.array([kick.speed for kick in self.kicks]),
            sites,
            moments(self.scaled, int(sites.max()), self.floor**2),
            np.empty((m * m, 3 * POWERS), complex),
            np.empty((m * m, 2 * NEAR + 1), complex),
        )
        EXPANDED(impacts, series(), np.empty(HIGHEST))
        return impacts

    def F(self, kappa: Array) -> Array:
        """D times all speeds over the resolvents of three aliases, one negative: bounded for kappa
        in [0, 1/2]. For Im kappa <= 0; on the band the limit from |mu| > 1."""
        places = np.ascontiguousarray(kappa, dtype=complex)
        values = np.empty(places.shape, dtype=complex)
        rows, distances = 2 * len(self.kicks) + 3, len(self._impacts.moments)
        room = np.empty((2 * NEAR + 1, distances), complex), np.empty((rows, rows), complex)
        EVERYWHERE(self._impacts, CountWorkspace(*room), places, values)
        return values

    # --- real multipliers as scalars ---

    def crosses(self, mu: float) -> float:
        """Changes sign where a multiplier is mu, 1 or -1.

        At 1 it is D without the poles of the band's ends: the determinant of the orbit's own
        equations, offsets included, for folds, pitchforks and branch points alike. At -1, a period
        doubling, it is ``D/(1 + |g|^2)``, real and bounded also where the band's edge passes there.
        """
        if mu > 0.0:
            if len({kick.site for kick in self.kicks}) > 1:
                raise BadInput("several sites: a multiplier +1 shows in the orbit's own equations.")
            return -float(self.F(np.zeros(1))[0].real)
        size = abs(1.0 - 16.0 * self.scaled) / 16.0  # 1/|g|^2 at kappa = 1/2, and 1/g at 3/2
        third = 1.5 * math.sqrt(2.25 - 4.0 * self.scaled)
        return float(self.F(np.array([0.5]))[0].real / third / (1.0 + size))

    # --- counting ---

    def count(self) -> Count:
        """Number of multipliers over the period outside the unit circle, a complex pair counting
        two: the exact question of stability, answered on the circle itself, where ``nu`` is 2
        kappa."""
        if self.gamma == 0.0:
            mu = self._uncoupled()
            size = np.abs(mu)
            place = int(np.argmin(np.abs(size - 1.0)))
            least, outside = float(abs(size[place] - 1.0)), mu[size > 1.0 + CERTAIN]
            # as beside gamma = 0, where the signs of D tell an odd number of real ones alone
            real = outside[outside.imag == 0.0].real
            pairs = (outside.size - np.sum(real > 0.0) % 2 - np.sum(real < 0.0) % 2) // 2
            nu = abs(float(np.angle(mu[place]))) / math.pi
            return Count(outside.size, least > CERTAIN, least, nu, int(pairs))
        circle = _around(self)
        half_turns, nearest = round(circle.turning / math.pi), int(abs(circle.F).argmin())
        least = float(abs(circle.F[nearest])) / circle.terms
        certain = circle.resolved and least > CERTAIN
        certain = certain and abs(circle.turning / math.pi - half_turns) < 0.01
        zeros, places, _ = self._near
        certain = certain and abs(zeros - places).min() > ON_CIRCLE
        # D -> 1 far out: D < 0 at 1, where it has the sign of -F, or at -1 means one real beyond
        pairs = (1 - half_turns - int(circle.start > 0.0) - int(circle.end < 0.0)) // 2
        return Count(
            1 - half_turns, bool(certain), least, 2.0 * float(circle.kappa[nearest]), pairs
        )

    def unstable(self, threshold: float) -> int:
        """Count the multipliers outside the unit circle: exact, without a threshold."""
        return self.count().count

    def beyond(self, place: float) -> int:
        """Count all outside, those beyond 1 or -1 among them: it changes where one passes there."""
        return self.count().count

    def pairs(self, radius: float = 1.0) -> tuple[float, int]:
        """Distance of the next pair from the circle, signed by parity; number of those outside."""
        outside = self.count().pairs
        return (-self.approach() if outside % 2 else self.approach()), outside

    def on_circle(self, angle: float, radius: float = 1.0) -> complex:
        """Vanishes where ``exp(i pi angle)`` is a multiplier; of real ones the scalar."""
        if angle in (0.0, 1.0):
            return self.crosses(1.0 - 2.0 * angle)
        return complex(self.F(np.array([0.5 * angle + 0j]))[0])

    def beside(self, angle: float, radius: float = 1.0) -> Callable[[Any, float], complex]:
        """Return `on_circle`: it is smooth wherever it is evaluated."""
        return OrbitMap.on_circle

    def nearest(self) -> float:
        """Angle, over pi, at which a multiplier is closest to passing the circle."""
        zero, place, _ = self._near
        inner = (place > 0.0) & (place < 0.5)
        return 2.0 * float(place[inner][abs(zero - place)[inner].argmin()])

    def approach(self) -> float:
        """Closest approach of a complex pair to the circle: 0 on it, at most `FARTHEST`. The
        distance of a zero of F from the circle over that from +1 and -1, which are not meant."""
        if self.gamma == 0.0:
            return FARTHEST
        zero, place, _ = self._near
        inner = (place > 0.0) & (place < 0.5)
        off, place = abs(zero - place)[inner], place[inner]
        return float((off * (1.0 / place + 1.0 / (0.5 - place))).min(initial=FARTHEST))

    @cached_property
    def _near(self) -> tuple[Array, Array, Array]:
        """kappa of zeros of F on straight lines between its samples, and of the places on the
        circle next to them; and how far off these are, in units of the samples' distance."""
        kappa, F, *_ = _around(self)
        step, rise = np.diff(kappa), np.diff(F)
        apart = (step > 1e-14 * kappa[1:]) & (rise != 0.0)  # pieces of the circle share their ends
        low, step, share = kappa[:-1][apart], step[apart], -F[:-1][apart] / rise[apart]
        part = np.clip(share.real, 0.0, 1.0)
        return low + share * step, low + part * step, abs(share - part)

    # --- sites without coupling ---

    def _uncoupled(self) -> Array:
        """gamma = 0: every impacting site for itself."""
        mu = []
        for site in sorted({kick.site for kick in self.kicks}):
            kicks = tuple(kick._replace(site=0) for kick in self.kicks if kick.site == site)
            held = 0.0, self.spring, 0.0
            mu.append(_pair(section_map(Ring(1), held, self.k, kicks, self.period).matrix))
        return np.concatenate(mu)

    def unstable_multipliers(self) -> Array:
        """The multipliers outside the unit circle on the infinite chain, largest first: by Newton's
        method from many starts, held to the winding number."""
        if self.gamma == 0.0:
            mu = self._uncoupled()
            mu = mu[np.abs(mu) > 1.0]
            return mu[np.argsort(-np.abs(mu), kind="stable")]
        return as_counted(self.count(), self.zeros, RINGS)

    def zeros(self, sites: int, rim: float = -ON_CIRCLE) -> Array:
        """Multipliers by Newton's method from those of a ring, down to a rim of Im kappa."""
        mu = self.on_ring(sites).coupled
        # most of a ring's band is on the circle, to within rounding
        kappa = np.log(mu[(abs(mu) > 1.0 + 1e-9) & (mu.imag >= 0.0)]) / (2j * math.pi)
        deep, (near, _, off) = kappa.imag < -DEEP, self._near
        starts = np.concatenate([kappa[~deep], near[(near.imag < 0.0) & (off < 4.0)]])
        zeros = newton_from_all(self._step, starts, 40, 1e-11, 0.3, _outside, self._unit)
        zeros = np.concatenate([kappa[deep], zeros[zeros.imag < rim]])
        return multipliers_of(2.0 * distinct(zeros, 1e-7 * self._unit(zeros)))

    def on_ring(self, sites: int) -> ModalMap:
        """The map of a ring with so many sites besides those between impacts."""
        ring = Ring(sites + 2 * int(self._sites.max()))
        return section_map(ring, (self.gamma, self.spring, 0.0), self.k, self.kicks, self.period)

    def _unit(self, kappa: Array) -> Array:
        # what is next to a narrow band changes as fast as that does
        return np.asarray(np.maximum(np.abs(kappa), self.edge))

    def _step(self, kappa: Array) -> Array:
        """Newton's. From the outside F goes on smoothly through the band, but for its ends."""
        ends = np.array([0.0, self.floor, self.edge])
        ends = np.abs(ends - np.round(ends))[:, None]
        h = np.minimum(1e-5, 0.03 * np.abs(kappa - ends).min(axis=0))
        F, after, before = self.F(np.concatenate([kappa, kappa + h, kappa - h])).reshape(3, -1)
        return np.asarray(F * 2.0 * h / (after - before))


class CircleSamples(NamedTuple):
    """F along half the circle: its turning, and real parts at both ends."""

    kappa: Array
    F: Array
    turning: float
    start: float
    end: float
    resolved: bool
    terms: float  # the size of F's own terms


@lru_cache(maxsize=512)
def _around(map: OrbitMap) -> CircleSamples:
    """Samples of F along half the circle, and what they tell: events and columns ask in turn.

    F has square roots at the edges of the band: it is cut there, and a square root at either end of
    a piece is smooth in the samples' place x.
    """
    terms = float(np.prod([abs(kick.speed) + abs(map.periods * kick.b) for kick in map.kicks]))
    side = math.prod(math.copysign(1.0, kick.speed) for kick in map.kicks)
    cuts = [0.0, 0.5, *(max(min(edge, 1.0 - edge), 0.0) for edge in (map.floor, map.edge))]
    pieces, turning, resolved, ends = [], 0.0, True, []

    def values(kappa: Array) -> Array:
        return np.asarray(side * map.F(kappa))

    for low, high in pairwise(sorted({*cuts})):

        def place(x: Array, low: float = low, high: float = high) -> Array:
            return 0.5 * (low + high) - 0.5 * (high - low) * np.cos(math.pi * x)

        # few between two singular places of the circle: refinement does the rest
        x, F, enough = refined_samples(np.arange(25) / 24.0, place, values, FLAT * terms)
        pieces.append((place(x), F))
        resolved = resolved and enough
        # D has the sign of -F next to mu = 1, where g(kappa) > 0 > g(kappa +- 1), and of F at -1;
        # a real multiplier on the circle to within rounding is not outside
        size = np.abs(F)
        if low == 0.0:
            inside = np.logical_and.accumulate(size <= CERTAIN * terms)
            F = np.where(inside, -np.maximum(size, 1e-300), F)
        if high == 0.5:
            inside = np.logical_and.accumulate(size[::-1] <= CERTAIN * terms)[::-1]
            F = np.where(inside, np.maximum(size, 1e-300), F)
        turn = np.angle(F[1:] * F[:-1].conj())
        # half a turn in one step is past a multiplier on the circle, which is not outside
        turning += float(np.where(turn < -3.1, -turn, turn).sum())
        ends += [float(F[0].real), float(F[-1].real)]
    kappa, F = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    return CircleSamples(kappa, F, turning, ends[0], ends[-1], resolved, terms)


def _pair(M: Array) -> Array:
    """Eigenvalues of a 2x2 matrix, a double one where rounding cannot tell two apart: elastic
    impacts have it at +1 and -1, and neither is outside."""
    half, product = 0.5 * float(np.trace(M)), float(np.linalg.det(M))
    apart = half * half - product
    # mu^2 - tr M mu + det M = 0; of two that meet rounding eps makes sqrt(eps)
    root = np.sqrt(complex(apart if abs(apart) > FLAT * np.sum(M * M) else 0.0))
    return np.array([half + root, half - root])


def _outside(kappa: Array) -> Array:
    """The mirror images with 0 <= Re kappa <= 1/2 of those outside the circle."""
    kappa = kappa[(kappa.imag < ON_CIRCLE) & (kappa.imag > -1.1 * DEEP)]
    return np.abs(kappa.real - np.round(kappa.real)) + 1j * np.minimum(kappa.imag, 0.0)


# --- series of the mean propagators ---------------------------------------------------------------


@lru_cache(maxsize=1)
def series() -> PairSeries:
    """Tables of all orbits: of turn, reach, pull the coefficients of kappa^a <w^2l cos>."""
    order, a = np.arange(ORDERS)[:, None], np.arange(POWERS)
    which, number = [], []
    # i kappa_j g, g and -kappa_j^2 g - 1 have -kappa_j^-q <w^2l> (but for i), each with its q
    for q, factor in ((2 * order + 1, -1.0), (2 * order + 2, -1.0), (2 * order, 1.0)):
        # a term without sum, q = 0, is put at the far end where none other is
        which.append(np.where(q > 0, q + a - 1, -1.0))
        number.append(np.where(q > 0, factor * (-1.0) ** a * binomial(q - 1 + a, a), 0.0))
    polynomials = np.zeros((CLOSED, CLOSED + 1))
    for p in range(1, CLOSED + 1):
        polynomials[p - 1, : p + 1] = bernoulli(p)
    j = np.arange(NEAR + 1.0, FAR + 1.0)[:, None]
    powers = j ** -np.arange(CLOSED + 1.0, HIGHEST + 1.0)
    return PairSeries(np.stack(number), np.stack(which), polynomials, powers)


@lru_cache(maxsize=64)
def moments(gamma: float, farthest: int, spring: float = 0.0) -> Array:
    """``<w^2l cos(d theta)>`` of the chain for distances d up to the farthest, (d, ORDERS)."""
    rows = InfiniteChain().with_spring(spring).powers(gamma, (*range(farthest + 1),))
    return np.ascontiguousarray(rows[:, :ORDERS])
