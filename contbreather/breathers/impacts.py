"""The equations of any periodic orbit with impacts, on any lattice.

Between impacts the lattice is linear. With impacts j = 1..m in a period T = 2 pi n, at sites n_j,
times t_j, walls +-1 and with impulses J_j,

    ``u_n(t) = a f(t) + c_n + sum over j of J_j h_{n n_j}(t - t_j)``,

h the periodic Green's function without its static part (`contbreather.lattice.periodic`) and c the
static part: it balances the mean impulses N_s of the impacting sites, straight from one such site
to the next and level beyond. With one impacting site c is the same everywhere, the free offset of
a lattice without springs to the ground, and sum J = 0. The equations:

    ``u_{n_j}(t_j) = wall_j``,  ``J_j = -(1 + k) u'_{n_j}(t_j-)``,  ``N_s + T gamma (L c)_s = 0``.

Unknowns: t_1..t_m, J_1..J_m and one offset for each impacting site. Symmetric, asymmetric,
multi-site and period-n breathers, on rings and on the infinite chain, are all this.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.refusals import ImpossibleSequence
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, Harmonic, InfiniteChain, Lattice
from contbreather.lattice.conditions import restitution_ratio
from contbreather.lattice.periodic import wave, wave_slope

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]

FEW = 8  # up to so many pairs of impacts a loop over floats beats numpy
_EVEN_ODD = np.array([1.0, -1.0, 1.0, -1.0])[:, None]


class Impact(NamedTuple):
    """One impact: which site hits which wall (+1 or -1), when, and the impulse it receives."""

    site: int
    wall: int
    time: float
    impulse: float


# --- which sequences of impacts can be -------------------------------------------------------


@lru_cache(maxsize=256)
def check_sequence(sequence: tuple[tuple[int, int], ...], lattice: Lattice) -> None:
    """Refuse a sequence of (site, wall) that no orbit can have.

    Raises
    ------
    ImpossibleSequence
        No impacts; a site that is no whole number or, on a ring, one that is not there; a wall
        other than +1 and -1; a wall that is never hit (all impulses would push the same way, and
        nothing holds the lattice back).
    """

    def refuse(why: str) -> ImpossibleSequence:
        return ImpossibleSequence(why, sequence=sequence)

    if not sequence:
        raise refuse("the sequence of impacts is empty: give (site, wall) of each, in order.")
    for i, impact in enumerate(sequence):
        site, wall = impact
        if isinstance(site, bool) or not isinstance(site, int | np.integer):
            raise refuse(f"impact {i + 1}: site {site!r} is no whole number.")
        if lattice.sites is not None and not 0 <= site < lattice.sites:
            raise refuse(
                f"impact {i + 1}: site {site} is not on a ring of {lattice.sites} sites, "
                f"0 to {lattice.sites - 1}."
            )
        if wall not in (1, -1):
            raise refuse(f"impact {i + 1}: wall {wall!r}; the walls are +1 and -1.")
    missing = {1, -1} - {wall for _, wall in sequence}
    if missing:
        raise refuse(
            f"no impact hits the wall {missing.pop():+d}: over a period the impulses of a chain "
            "without springs to the ground add up to nothing, so both walls must be hit."
        )


def check_times(times: Sequence[float], periods: int) -> None:
    """Refuse times of impact that are out of order or not within one period."""
    end = times[0] + 2.0 * math.pi * periods
    for i, (before, after) in enumerate(zip(times, [*times[1:], end], strict=True)):
        if not before < after:
            last = i + 1 == len(times)
            what = f"the end of the period, {end:.9g}" if last else f"impact {i + 2} at {after:.9g}"
            raise BadInput(
                f"impact {i + 1} at t = {before:.9g} is not before {what}: give the impacts of "
                f"one period 2 pi {periods} in order of time."
            )


# --- the equations ----------------------------------------------------------------------------


@dataclass(frozen=True)
class OrbitEquations:
    """The equations of the module's docstring for one sequence of impacts.

    ``x = (t_1..t_m, J_1..J_m, c...)``; ``params`` names a, gamma, k and those of the forcing.

    Parameters
    ----------
    sequence : tuple of (site, wall)
        The impacts of one period, in order.
    periods : int
        n of the period 2 pi n.
    forcing : Forcing
    lattice : InfiniteChain or Ring

    Examples
    --------
    >>> from contbreather.breathers.symmetric import symmetric
    >>> b = symmetric(0.5, 0.12, 0.4)
    >>> x = np.array([b.phi, b.phi + math.pi, -2 * b.p, 2 * b.p, 0.0])
    >>> same = OrbitEquations(((0, 1), (0, -1)))
    >>> bool(abs(same.residual(x, {"a": 0.5, "gamma": 0.12, "k": 0.4})).max() < 1e-14)
    True
    """

    sequence: tuple[tuple[int, int], ...]
    periods: int = 1
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: Lattice = field(default_factory=InfiniteChain)

    def __post_init__(self) -> None:
        check_sequence(self.sequence, self.lattice)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, in order."""
        m = range(1, len(self.sequence) + 1)
        offsets = ["c"] if len(self.sites) == 1 else [f"c{i + 1}" for i in range(len(self.sites))]
        return (*(f"t{i}" for i in m), *(f"J{i}" for i in m), *offsets)

    @cached_property
    def sites(self) -> tuple[int, ...]:
        """The sites that take impacts, from left to right: each has an offset."""
        return tuple(sorted({site for site, _ in self.sequence}))

    @cached_property
    def walls(self) -> FloatArray:
        return np.array([float(wall) for _, wall in self.sequence])

    @cached_property
    def own(self) -> NDArray[np.int64]:
        """Which of `sites` each impact belongs to."""
        return np.array([self.sites.index(site) for site, _ in self.sequence])

    @cached_property
    def links(self) -> FloatArray:
        """Stiffness between the offsets, per gamma: symmetric, its rows add up to zero."""
        r = len(self.sites)
        stiffness = np.zeros((r, r))
        pairs = [(i, i + 1, self.sites[i + 1] - self.sites[i]) for i in range(r - 1)]
        if self.lattice.sites is not None and r > 1:  # and on around the ring
            pairs.append((r - 1, 0, self.lattice.sites - self.sites[-1] + self.sites[0]))
        for i, j, bonds in pairs:
            stiffness[i, i] -= 1.0 / bonds
            stiffness[j, j] -= 1.0 / bonds
            stiffness[i, j] += 1.0 / bonds
            stiffness[j, i] += 1.0 / bonds
        return stiffness

    @cached_property
    def _pairs(self) -> dict[int, list[tuple[int, int]]]:
        """Pairs i > j of impacts, and (0, 0) for an impact with itself, by distance."""
        pairs: dict[int, list[tuple[int, int]]] = {0: []}
        for i, (site, _) in enumerate(self.sequence):
            for j, (other, _) in enumerate(self.sequence[:i]):
                pairs.setdefault(self.lattice.distance(site - other), []).append((i, j))
        return pairs

    def meetings(self, gamma: float, times: FloatArray, *, slope: bool = False) -> FloatArray:
        """``h_ij`` and its first three derivatives at t_i - t_j, shape (4, m, m).

        On the diagonal the first derivative is left out: its jump is in the reset law.
        """
        m = len(self.sequence)
        out = np.zeros((4, m, m))
        make = wave_slope if slope else wave
        for distance, pairs in self._pairs.items():
            answer = make(self.lattice, gamma, distance, self.periods)
            if distance == 0:
                value, _, curvature, _ = answer.at(0.0)
                out[0].flat[:: m + 1], out[2].flat[:: m + 1] = value, curvature
            if not pairs:
                continue
            i, j = (list(index) for index in zip(*pairs, strict=True))
            if len(pairs) <= FEW:
                apart = [float(times[a]) - float(times[b]) for a, b in pairs]
                four = np.array([answer.at(s) for s in apart]).T
            else:
                four = np.array(answer.at(times[i] - times[j]))
            out[:, i, j] = four
            out[:, j, i] = four * _EVEN_ODD  # h is even
        return out

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times, impulses, offsets."""
        m = len(self.sequence)
        return x[:m], x[m : 2 * m], x[2 * m :]

    def residual(self, x: FloatArray, params: Params) -> FloatArray:
        """All equations, shape (2m + sites,): walls, reset laws, balance of mean impulses."""
        a, gamma, k, f = self._unpack(x, params)
        times, impulses, offsets = self.split(x)
        h = self.meetings(gamma, times)
        q = (1.0 - k) / (1.0 + k)
        return np.concatenate(
            [
                a * f.f(times) + offsets[self.own] + h[0] @ impulses - self.walls,
                a * f.df(times) + h[1] @ impulses + 0.5 * q * impulses,
                self._balance(impulses, offsets, gamma),
            ]
        )

    def _balance(self, impulses: FloatArray, offsets: FloatArray, gamma: float) -> FloatArray:
        mean = np.zeros(len(self.sites))
        np.add.at(mean, self.own, impulses)
        return mean + (2.0 * math.pi * self.periods * gamma) * (self.links @ offsets)

    def jacobian(self, x: FloatArray, params: Params) -> FloatArray:
        """Derivatives with respect to x."""
        a, gamma, k, f = self._unpack(x, params)
        times, impulses, _ = self.split(x)
        h = self.meetings(gamma, times)
        m, r = len(self.sequence), len(self.sites)
        own = np.arange(m)
        out = np.zeros((2 * m + r, 2 * m + r))
        walls, resets, balance = slice(0, m), slice(m, 2 * m), slice(2 * m, None)
        bent = h[2].copy()
        bent.flat[:: m + 1] = 0.0  # an impact does not move against itself
        out[walls, walls] = -h[1] * impulses
        out[resets, walls] = -bent * impulses
        out[own, own] = a * f.df(times) + h[1] @ impulses
        out[m + own, own] = a * f.d2f(times) + bent @ impulses
        out[walls, resets], out[resets, resets] = h[0], h[1]
        out[m + own, m + own] += 0.5 * (1.0 - k) / (1.0 + k)
        out[own, 2 * m + self.own] = 1.0
        out[2 * m + self.own, m + own] = 1.0
        out[balance, balance] = (2.0 * math.pi * self.periods * gamma) * self.links
        return out

    def sensitivity(self, x: FloatArray, params: Params, name: str) -> FloatArray:
        """Derivatives with respect to the parameter ``name``."""
        a, gamma, k, f = self._unpack(x, params)
        times, impulses, offsets = self.split(x)
        balance = np.zeros(len(self.sites))
        if name == "a":
            walls, resets = f.f(times), f.df(times)
        elif name == "gamma":
            h = self.meetings(gamma, times, slope=True)
            walls, resets = h[0] @ impulses, h[1] @ impulses
            balance = (2.0 * math.pi * self.periods) * (self.links @ offsets)
        elif name == "k":
            walls, resets = np.zeros(times.size), -impulses / (1.0 + k) ** 2
        elif name in self.forcing.params:
            walls = a * np.array([f.f_param(name, float(t), 0) for t in times])
            resets = a * np.array([f.f_param(name, float(t), 1) for t in times])
        else:
            have = ", ".join(("a", "gamma", "k", *self.forcing.params))
            raise BadInput(f"unknown parameter {name!r}: this orbit has {have}.")
        return np.concatenate([walls, resets, balance])

    def _unpack(self, x: FloatArray, params: Params) -> tuple[float, float, float, Forcing]:
        a, gamma, k = float(params["a"]), float(params["gamma"]), float(params["k"])
        restitution_ratio(k)
        if not (math.isfinite(a) and np.isfinite(x).all()):
            raise BadInput(f"a = {a}, x = {x}: the orbit needs finite numbers.")
        return a, gamma, k, forcing_at(self.forcing, params)


def forcing_at(forcing: Forcing, params: Params) -> Forcing:
    """The forcing with its own parameters taken from ``params`` where they are named there."""
    own = forcing.params
    if not own:
        return forcing
    values = tuple((name, float(params.get(name, value))) for name, value in own.items())
    return forcing if values == tuple(own.items()) else _moved_forcing(forcing, values)


@lru_cache(maxsize=256)
def _moved_forcing(forcing: Forcing, values: tuple[tuple[str, float], ...]) -> Forcing:
    return forcing.at(**dict(values))


@lru_cache(maxsize=256)
def equations_of(
    sequence: tuple[tuple[int, int], ...], periods: int, forcing: Forcing, lattice: Lattice
) -> OrbitEquations:
    """`OrbitEquations`, kept: what they derive from the sequence serves a whole branch."""
    return OrbitEquations(sequence, periods, forcing, lattice)
