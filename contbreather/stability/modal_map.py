"""Small perturbations of an orbit over a section: what every such map answers, and the map of a
finite lattice, mode by mode.

``M = Q(T_m) S_m ... S_1 Q(T_0)``: in the modes a flight turns each for itself (18) and an impact is
a change of rank two (19), so the product is built without a matrix product. Modes with a node at
every impacting site are left out: their multipliers are those of a free flight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.modal_flow import free_multipliers, propagator
from contbreather.lattice.uneven import Medium
from contbreather.one_thread import one_thread
from contbreather.stability.saltation import Saltation, saltation
from contbreather.stability.zeros import (
    REAL,
    beyond,
    distinct,
    nearest_pair,
    newton_from_all,
    outermost,
    refined_samples,
)

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Array = NDArray[Any]

EPS = float(np.finfo(float).eps)
MOST = 5_000  # modes of which there is a matrix, two rows each: 10^8 numbers
LARGE = 90  # multipliers: of more, those next to a circle are found without all others
DRIFTS = 1e-10  # squared frequency below which a mode only drifts over a section


class Map(Protocol):
    """The map of small perturbations over a section of an orbit.

    No matrix is promised: on the infinite chain +1 is the end of the band, and a pair leaves the
    unit circle in a limit from outside. On finite lattices ``over_period`` has the multipliers over
    the period of the modes that impacts see, ``idle`` the largest modulus of all others.
    """

    @property
    def lattice(self) -> Any: ...
    @property
    def gamma(self) -> float: ...
    @property
    def sign(self) -> int:
        """-1 where the section is half the period of a symmetric orbit, whose multipliers are the
        squares of those over the section; 1 where it is the whole."""

    @property
    def period(self) -> float:
        """Period of the orbit."""

    def crosses(self, mu: float) -> float:
        """A smooth scalar that changes sign where a multiplier over the section is mu, 1 or -1."""

    def unstable(self, threshold: float) -> float:
        """Count the multipliers outside: on the infinite chain of the unit circle, on a finite
        lattice of that of a threshold over the period."""

    def beyond(self, place: float) -> int:
        """A count that changes where a real multiplier passes 1 or -1."""

    def pairs(self, radius: float = 1.0) -> tuple[float, int]:
        """Two numbers of complex pairs: a float that changes sign where one leaves a circle,
        negative outside, and on the infinite chain a number that changes wherever one does."""

    def nearest(self) -> float:
        """Angle, over pi, of the pair that is closest to leaving; NaN where there is none."""

    def on_circle(self, angle: float, radius: float = 1.0) -> complex:
        """Vanishes where ``radius exp(i pi angle)`` is a multiplier over the section; real where
        that is."""

    def beside(self, angle: float, radius: float = 1.0) -> Callable[[Any, float], complex]:
        """Linearise `on_circle` for maps and angles next to this one, exact to first order where it
        vanishes."""


class ModalSaltation(NamedTuple):
    """An impact as a perturbation of the modes feels it."""

    shape: FloatArray  # the modes at its site
    kick: FloatArray  # what a change of that site does to them
    k: float
    b: float  # of a `Saltation`, with its speed
    speed: float = 1.0
    number: int = 0  # among the impacts as they were given

    @property
    def saltation(self) -> FloatArray:
        """The 2x2 block of (19)."""
        return saltation(self.k, self.b / self.speed)


@dataclass(frozen=True, eq=False)
class ModalMap:
    """The map of a finite lattice over a section."""

    lattice: Any
    gamma: float
    damping: float
    z: FloatArray  # squared frequencies of the modes that some impact sees
    unseen: FloatArray  # those of all others
    turns: tuple[Any, ...]  # flights before the first impact, between them and after the last
    blows: tuple[ModalSaltation, ...]  # the impacts in order of time
    length: float  # of the section, in time
    sign: int = 1  # -1 for half the period of a symmetric orbit

    @property
    def period(self) -> float:
        return self.length if self.sign > 0 else 2.0 * self.length

    def applied(self, x: Array) -> Array:
        """`matrix` times a perturbation of the modes, or columns of them, without the matrix.

        What is perturbed by u comes sooner to its wall, by u over its speed. Below the modes there
        may be these times, one for each impact; then by how much they make up for more than u is
        below the result, and nothing is divided by speeds, which may vanish.
        """
        n = self.z.size
        y, v, sooner = x[:n], x[n : 2 * n], x[2 * n :]
        left = np.empty_like(sooner)
        for fly, blow in zip(self.turns, (*self.blows, None), strict=True):
            y, v = fly(y, v)
            if blow is not None:
                c, u, w = 1.0 + blow.k, blow.shape @ y, blow.shape @ v
                early = sooner[blow.number] if sooner.size else u / blow.speed
                if sooner.size:
                    left[blow.number] = blow.speed * early - u
                # S - 1 = [[-(1 + k), 0], [b/speed, -(1 + k)]] at one site
                y = y - np.multiply.outer(blow.kick, c * blow.speed * early)
                v = v + np.multiply.outer(blow.kick, blow.b * early - c * w)
        return np.concatenate([y, v, left])

    def less(self, mu: complex, x: Array) -> Array:
        """``M - mu`` times a perturbation, bordered by the times of impacts as in `applied`."""
        n = 2 * self.z.size
        out = self.applied(x).astype(complex if isinstance(mu, complex) else float)
        out[:n] -= mu * x[:n]
        return out

    @cached_property
    def matrix(self) -> FloatArray:
        """The map of the modes that impacts see, (2K, 2K)."""
        if self.z.size > MOST:
            raise BadInput(
                f"{self.lattice.describe()}: its impacts move {self.z.size} modes, and how an "
                f"orbit changes is told by a matrix, of up to {MOST}; take fewer sites: with "
                "damping waves do not come back."
            )
        return np.asarray(self.applied(np.eye(2 * self.z.size)))

    @property
    def _few(self) -> bool:
        """Say if nothing is shorter than all multipliers: they are few, or known, or of sites."""
        known = "coupled" in self.__dict__ or not self.lattice.even
        return known or 2 * self.z.size <= LARGE

    @cached_property
    @one_thread
    def coupled(self) -> ComplexArray:
        """Eigenvalues of `matrix`; kept, because events and columns ask for them in turn."""
        return np.linalg.eigvals(self.matrix).astype(complex)

    @cached_property
    def over_period(self) -> ComplexArray:
        return self.coupled if self.sign > 0 else self.coupled**2

    @cached_property
    def _others(self) -> ComplexArray:
        return np.concatenate(free_multipliers(self.unseen, self.damping, self.length))

    @property
    def idle(self) -> float:
        """Largest modulus over the period of all other modes, 0 if there are none."""
        if not self.damping:
            return float(self.unseen.size > 0)
        return float(abs(self._others).max(initial=0.0)) ** (1 if self.sign > 0 else 2)

    def multipliers(self) -> ComplexArray:
        """Multipliers over a section: first those of the modes that impacts see."""
        return np.concatenate([self.coupled, self._others])

    def crosses(self, mu: float) -> float:
        """``det(M - mu)`` times all speeds, in units of what it is without impacts; NaN where sites
        whose springs differ rest wherever they are, as with no coupling: there it is 0/0."""
        if mu > 0.0 and not (self.lattice.even or self.gamma) and self.z.min() <= DRIFTS:
            return math.nan
        base = self._tied if mu > 0.0 else self
        bordered = base.less(mu, np.eye(2 * self.z.size + len(self.blows)))
        return base.in_units_of_flight(bordered, mu)

    @cached_property
    def _tied(self) -> ModalMap:
        """Add springs next to none where several modes only drift, as they do without coupling: all
        but one have a double multiplier 1 there, and the determinant is 0/0."""
        drifts = self.z < DRIFTS
        if np.count_nonzero(drifts) < 2:
            return self
        turns = [t._replace(pull=t.pull + DRIFTS * drifts * t.reach) for t in self.turns]
        return replace(self, z=np.where(drifts, DRIFTS, self.z), turns=tuple(turns))

    def in_units_of_flight(self, matrix: FloatArray, mu: float) -> float:
        """A determinant over that of all flights less mu."""
        sign, size = np.linalg.slogdet(matrix)
        first, second = free_multipliers(self.z, self.damping, self.length)
        # in units of |mu - exp(i w T)|^2, rounding where that is zero
        unit = np.sort(np.maximum(abs(((first - mu) * (second - mu)).real), 1e-15))
        # of modes alike a site that is hit holds one, and where that has the multiplier mu itself
        # nothing diverges: it no longer scales the determinant
        held = len({blow.shape.tobytes() for blow in self.blows})
        unit[:held] = np.maximum(unit[:held], 0.01)
        return float(sign * math.exp(min(size - np.log(unit).sum(), 700.0)))

    def outermost(self, radius: float) -> float:
        """By how much the first pair has left a circle, -1 where there is none."""
        margin = None
        if not self._few and radius > 1.0:
            margin = self.reduced.outermost(radius)
        return outermost(self.coupled, radius) if margin is None else margin

    def pairs(self, radius: float) -> tuple[float, int]:
        """Distance of the first pair inside a circle, NaN next to two real ones; nothing counts."""
        return (math.nan if self.rounding > REAL else -float(self.outermost(radius))), 0

    @cached_property
    def rounding(self) -> float:
        """Rounding of all multipliers: one grows beyond bounds as an impact vanishes."""
        return float(EPS * np.linalg.norm(self.matrix))

    def nearest(self) -> float:
        """Angle, over pi, of the pair with the largest modulus; NaN where there is none."""
        return nearest_pair(self.coupled)

    def beyond(self, place: float) -> int:
        """Count the real multipliers farther out than 1 or -1, on its side."""
        farther = place * (1.0 + 1e-6)  # off the poles of free modes on the circle
        if self._few:
            return beyond(self.coupled, farther)
        return self.reduced.beyond(farther)

    def unstable(self, threshold: float) -> float:
        """Count the multipliers beyond a threshold; NaN where free modes are on it."""
        if threshold == 1.0 and self.idle == 1.0:
            return math.nan
        if not self._few and threshold > 1.0:
            nearest = self.reduced.around(threshold if self.sign > 0 else math.sqrt(threshold))
            if nearest is not None:
                return nearest.outside
        return int(np.count_nonzero(abs(self.over_period) > threshold))

    @cached_property
    def reduced(self) -> ReducedDeterminant:
        return ReducedDeterminant(self)

    def on_circle(self, angle: float, radius: float = 1.0) -> complex:
        """The least singular value of ``M - mu``, bordered by the times of impacts and smooth by
        the phase of the determinant."""
        return _smallest_singular(self, _multiplier(angle, radius))[0]

    def beside(self, angle: float, radius: float = 1.0) -> Callable[[Any, float], complex]:
        """One perturbation flown, with no matrix, between the singular vectors."""
        _, left, right = _smallest_singular(self, _multiplier(angle, radius))
        return lambda map, angle: left @ map.less(_multiplier(angle, radius), right)


def _by_sites(flight: FloatArray, q: Array, r: Array) -> tuple[Array, Array]:
    """A flight of sites whose springs or dampings differ, by its matrix."""
    q, r = np.split(flight @ np.concatenate([q, r]), 2)
    return q, r


def _multiplier(angle: float, radius: float) -> complex:
    """``radius exp(i pi angle)``, real for whole angles."""
    return radius * (1.0 - 2.0 * angle if angle in (0.0, 1.0) else np.exp(1j * math.pi * angle))


@lru_cache(maxsize=16)
def _smallest_singular(map: ModalMap, mu: complex) -> tuple[complex, Array, Array]:
    """`on_circle`, and the vectors it is between, with its phase in the left one."""
    rows = 2 * map.z.size + len(map.blows)
    left, sizes, right = np.linalg.svd(map.less(mu, np.eye(rows)))
    phase = np.linalg.det(left) * np.linalg.det(right)
    return phase * sizes[-1], phase * left[:, -1].conj(), right[-1].conj()


def middle_of_longest(times: Sequence[float], length: float) -> float:
    """A time within a flight that is not short, of impacts in order: next to an impact, others at
    the same time would move from one end of the section to the other.
    """
    free = np.diff([*times, times[0] + length])
    # the longest flight; of several nearly as long the one that comes first
    last = int(np.argmax(free > 0.7 * free.max()))  # before it
    return times[last] + 0.5 * float(free[last])


def section_map(
    lattice: Any,
    held: tuple[float, float, float],
    k: float,
    kicks: tuple[Saltation, ...],
    length: float = 2.0 * math.pi,
    sign: int = 1,
    of: type[ModalMap] = ModalMap,
    start: float | None = None,
) -> ModalMap:
    """The map of a finite lattice, held by gamma, spring and damping, over a section of an orbit
    from a time between its impacts on, `middle_of_longest` unless given. Maps from the same time on
    are alike to their vectors, times of impacts in the order in which these are given.

    Examples
    --------
    The multipliers of m impacts multiply to ``k^(2m)``:

    >>> kicks = Saltation(0, 0.0, 0.3), Saltation(0, 2.0, 0.5)
    >>> from contbreather.lattice import Ring
    >>> mu = section_map(Ring(9), (0.1, 0.0, 0.0), 0.8, kicks).multipliers()
    >>> mu.size, round(float(np.prod(mu).real), 12)  # 0.8^4
    (18, 0.4096)
    """
    gamma, spring, damping = held
    if start is None:
        start = middle_of_longest(sorted(kick.time for kick in kicks), length)
    late = [kick.time + length * (kick.time <= start) for kick in kicks]
    numbers = np.argsort(late, kind="stable").tolist()
    times = [start, *(late[i] for i in numbers), start + length]
    flights = [later - time for time, later in pairwise(times)]
    sites, _, b, speeds = (list(of) for of in zip(*(kicks[i] for i in numbers), strict=True))
    kept = [k * float(lattice.restitutions[n]) for n in sites]
    if not lattice.even:
        medium, own = Medium(lattice, gamma, spring, damping), np.eye(lattice.sites)[sites]
        z = np.maximum(medium.pull.diagonal(), DRIFTS)  # of the sites alone: units of determinants
        moved = tuple(partial(_by_sites, medium.flight(time)) for time in flights)
        struck = tuple(map(ModalSaltation, own, own, kept, b, speeds, numbers))
        return of(lattice, gamma, damping, z, z[:0], moved, struck, length, sign)
    basis = lattice.basis(tuple(sorted({*sites})))
    z, unseen = gamma * basis.lam + spring, gamma * basis.unseen + spring
    turns = tuple(propagator(z, time, damping) for time in flights)
    shapes = basis.at(np.array(sites))
    masses = lattice.masses[sites][:, None]
    blows = tuple(map(ModalSaltation, shapes, masses * shapes, kept, b, speeds, numbers))
    return of(lattice, gamma, damping, z, unseen, turns, blows, length, sign)


# --- the multipliers of a large lattice next to a circle ------------------------------------------


class NearestMultipliers(NamedTuple):
    """Multipliers next to a circle."""

    zeros: Array  # in the upper half plane, as many as were found
    outside: int  # how many are outside, pairs and real ones


class ReducedDeterminant:
    """D of a map: the multipliers of a large lattice next to a circle, without an eigenproblem.

    A perturbation that grows by mu over a section is known from what it is at the impacts,
    ``x_i = sum over j of G_ij(mu) (S_j - 1) x_j``, where G sums over all modes what a kick at
    impact j still is at impact i after this section and all before it. With ``P_ij`` the flight of
    a mode from the one to the other, Q that of the whole section, ``t`` its trace and ``e`` its
    determinant,

        ``G_ij = sum over modes of P_ij (mu - Q)^-1 (mu for i after j, else 1)``,
        ``(mu - Q)^-1 = (mu - adj Q)/(mu^2 - t mu + e)``,

    so that ``D(mu) = det(1 - G(mu) (S - 1))``, 2m x 2m for m impacts, has the multipliers for its
    zeros and those without impacts, on the unit circle or inside it, for its poles. As D -> 1 far
    away, the number outside a circle is its winding number there; those next to it are where
    Newton's method leads from the places on it at which D is least. Each mode costs two numbers a
    place: of 400 sites the first pair to pass a circle is known after a fiftieth of what all
    multipliers take.
    """

    def __init__(self, map: ModalMap) -> None:
        self.loss = math.exp(-map.damping * map.length)
        self.poles = free_multipliers(map.z, map.damping, map.length)[0]
        blows, m = map.blows, len(map.blows)
        flights = [np.array([[t.cosine, t.reach], [-t.pull, t.swing]]) for t in map.turns]
        whole = _after(flights)
        back = np.array([[whole[1, 1], -whole[0, 1]], [-whole[1, 0], whole[0, 0]]])
        weights = np.empty((2, m, 2, m, 2, map.z.size))
        for i in range(m):
            for j in range(m):
                passed = flights[j + 1 : i + 1] if i > j else flights[j + 1 :] + flights[: i + 1]
                P = _after(passed) * (blows[i].shape * blows[j].kick)
                kicked = np.eye(2) - blows[j].saltation
                for which, flight in enumerate((P, _after([back, P]))):
                    weights[which, i, :, j] = np.einsum("abk,bc->ack", flight, kicked)
        later = np.zeros((m, 2, m, 2), dtype=bool)
        later[:] = np.tri(m, k=-1, dtype=bool)[:, None, :, None]
        self.later, self.one = np.flatnonzero(later), np.eye(2 * m)
        self.trace = whole[0, 0] + whole[1, 1]
        self.weights = weights.reshape(-1, map.z.size).T

    def D(self, mu: Array) -> Array:
        """At some mu, shape (n,)."""
        s = mu + self.loss / mu
        x, y = s.real[:, None] - self.trace, s.imag[:, None]
        size = x * x + y * y
        sums = (x / size) @ self.weights - 1j * ((y / size) @ self.weights)
        half = sums.shape[1] // 2
        matrix = sums[:, :half] - sums[:, half:] / mu[:, None]
        matrix[:, self.later] *= mu[:, None]
        matrix = matrix.reshape(-1, *self.one.shape) + self.one
        if len(self.one) == 2:
            (a, b), (c, d) = matrix.transpose(1, 2, 0)
            return np.asarray(a * d - b * c)
        return np.asarray(np.linalg.det(matrix))

    def beyond(self, place: float) -> int:
        """Count the real multipliers farther out than a place off all poles."""
        # poles are next to the place; beyond 1e6 an impact has all but lost its velocity
        beside = np.append(0.0, np.geomspace(1e-7, 1e6, 199))
        x = place * (1.0 + beside)
        D = self.D(x + 0j).real
        for _ in range(12):  # each time with a quarter of the distance about a dip
            # where D comes so close to zero, of one sign, that two zeros may be between two places
            size, sign = abs(D), D > 0.0
            low, high = np.minimum(size[:-2], size[2:]), np.maximum(size[:-2], size[2:])
            alike = (sign[1:-1] == sign[:-2]) & (sign[1:-1] == sign[2:])
            # a dip to more than half of what is beside it has been seen to the bottom
            dips = alike & (size[1:-1] <= low) & (high > 2.0 * size[1:-1])
            minima = np.flatnonzero(dips) + 1
            if not minima.size:
                break
            cells = np.concatenate([minima - 1, minima])
            width = x[cells + 1] - x[cells]
            more = np.concatenate([x[cells] + part * width for part in (0.25, 0.5, 0.75)])
            x, first = np.unique(np.append(x, more), return_index=True)
            D = np.append(D, self.D(more + 0j).real)[first]
        signs = D > 0.0
        return int(np.count_nonzero(signs[1:] != signs[:-1]))

    def outermost(self, radius: float) -> float | None:
        """By how much the first pair has left a circle around all poles, negative where none has;
        if they are far inside, where the poles are. None where that cannot be told."""
        floor = float(abs(self.poles).max()) / radius - 1.0
        gap = low = radius - 1.0
        high, beyond = 0.0, 0  # nothing is beyond the one, so many pairs are beyond the other
        for _ in range(12):  # circles farther out, where too many are beyond the first
            nearest = self.around(1.0 + gap)
            if nearest is None:
                return None
            moduli = abs(nearest.zeros)
            pairs = (nearest.outside - self.beyond(1.0 + gap)) // 2 if nearest.outside else 0
            wanted, place = (pairs, gap) if pairs or not beyond else (beyond, low)
            if np.count_nonzero(moduli > 1.0 + place) == wanted:
                return max(float(moduli.max(initial=0.0)) / radius - 1.0, floor)
            if pairs:  # so many that not all were found
                low, beyond = gap, pairs
            else:
                high = gap
            gap = math.sqrt(low * high) if high else 2.0 * gap
        return None

    def around(self, radius: float) -> NearestMultipliers | None:
        """Find the multipliers next to a circle around all poles, None if it cannot be resolved."""
        # one that asks for more places than that has a zero on it
        x, D, enough = refined_samples(
            self.places, lambda x: radius * np.exp(1j * x), self.D, 0.0, most=2**13
        )
        if not (enough and math.isfinite(abs(D).sum())):
            return None
        turning = float(np.angle(D[1:] * D[:-1].conj()).sum())
        mu = radius * np.exp(1j * x)
        with np.errstate(divide="ignore", invalid="ignore"):  # the pole at an angle of 0 is twice
            step = abs(0.5 * (D[1:] + D[:-1]) * np.diff(mu) / np.diff(D))
        minima = np.flatnonzero((step[1:-1] <= step[:-2]) & (step[1:-1] <= step[2:])) + 1
        # a dozen places at which a zero looks nearest
        starts = mu[minima[np.argsort(step[minima])[:12]]]
        return NearestMultipliers(self._zeros(starts), round(-turning / math.pi))

    @cached_property
    def places(self) -> Array:
        """Angles of a circle to look at first: next to the poles, and evenly."""
        x = np.concatenate([abs(np.angle(self.poles)), np.linspace(0.0, math.pi, 33)])
        x.sort()
        return np.sort(np.concatenate([x, 0.5 * (x[1:] + x[:-1])]))

    def _zeros(self, mu: Array) -> Array:
        """Zeros that Newton's method finds in the upper half plane, each once."""

        def step(mu: Array) -> Array:
            h = 1e-6  # half the step of a difference
            at, after, before = self.D(np.concatenate([mu, mu + h, mu - h])).reshape(3, -1)
            move = 2.0 * h * at / (after - before)
            return np.where(abs(move) < 1.0, move, math.nan)

        # six steps at most, the last one of 1e-10: closer than 1e-8 two zeros are one
        zeros = newton_from_all(step, mu, 6, 1e-10)
        return distinct(zeros[zeros.imag > REAL], 1e-8)


def _after(flights: list[Array]) -> Array:
    """One flight of every mode after the other, shape (2, 2, K)."""
    whole = flights[0]
    for flight in flights[1:]:
        whole = np.einsum("abk,bck->ack", flight, whole)
    return np.asarray(whole)
