"""The equations of any periodic orbit with impacts, on any lattice.

Between impacts the lattice is linear. With impacts j = 1..m in a period T = 2 pi n, at sites n_j,
times t_j, walls +-1 and with impulses J_j,

    ``u_n(t) = a f(t) + c_n + sum over j of J_j h_{n n_j}(t - t_j)``,

h the periodic Green's function without its static part (`contbreather.lattice.periodic_green`) and
c the static part: it balances the mean impulses N_s of the impacting sites, straight from one such
site to the next and level beyond. With one impacting site c is the same everywhere, the free offset
of a lattice without springs to the ground, and sum J = 0. The equations:

    ``u_{n_j}(t_j) = wall_j``,  ``J_j = -(1 + k) u'_{n_j}(t_j-)``,  ``N_s + T gamma (L c)_s = 0``.

Unknowns: t_1..t_m, J_1..J_m and one offset for each impacting site. Symmetric, asymmetric,
multi-site and period-n breathers, on rings and on the infinite chain, are all this.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.chain import InfiniteChain
from contbreather.lattice.conditions import Conditions, restitution_ratio
from contbreather.lattice.forcing import Forcing, Harmonic
from contbreather.lattice.periodic_green import INTERACTIONS, Responses, periodic_green
from contbreather.orbits.closure import forcing_at
from contbreather.orbits.section import Section, check_both_walls, told_apart, told_apart_slopes

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]


@dataclass(frozen=True)
class OrbitEquations:
    """The equations of the module's docstring for one sequence of impacts.

    ``x = (t_1..t_m, J_1..J_m, c...)``; ``params`` names a, gamma, k and those of the forcing.

    Parameters
    ----------
    section : Section
        The impacts of one period, in order.
    forcing : Forcing
    lattice : InfiniteChain or Ring

    Examples
    --------
    >>> from contbreather.orbits.constructors import symmetric
    >>> b = symmetric(0.5, 0.12, 0.4)
    >>> x = np.array([b.phi, b.phi + math.pi, -2 * b.p, 2 * b.p, 0.0])
    >>> same = OrbitEquations(Section(((0, 1), (0, -1))))
    >>> bool(abs(same.residual(x, {"a": 0.5, "gamma": 0.12, "k": 0.4})).max() < 1e-14)
    True
    """

    section: Section
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: UniformLattice = field(default_factory=InfiniteChain)

    def __post_init__(self) -> None:
        check_both_walls(self.section, Conditions(1.0, 0.0, 0.0, lattice=self.lattice))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, in order."""
        impacts = range(1, self.section.count + 1)
        sites = [""] if self.section.local else range(1, len(self.section.hit) + 1)
        numbered = ("t", impacts), ("J", impacts), ("c", sites)
        return tuple(f"{letter}{i}" for letter, numbers in numbered for i in numbers)

    @cached_property
    def walls(self) -> FloatArray:
        return np.array([float(wall) for _, wall in self.section.impacts])

    @cached_property
    def own(self) -> NDArray[np.int64]:
        """Which of the sites that hit each impact belongs to."""
        return np.array([self.section.hit.index(site) for site, _ in self.section.impacts])

    @cached_property
    def links(self) -> FloatArray:
        """Stiffness between the offsets, per gamma: symmetric, its rows add up to zero."""
        hit = self.section.hit
        r = len(hit)
        stiffness = np.zeros((r, r))
        pairs = [(i, i + 1, hit[i + 1] - hit[i]) for i in range(r - 1)]
        if self.lattice.sites is not None and r > 1:  # and on around the ring
            pairs.append((r - 1, 0, self.lattice.sites - hit[-1] + hit[0]))
        for i, j, bonds in pairs:
            stiffness[i, i] -= 1.0 / bonds  # bonds in a row: their stiffness is 1/bonds
            stiffness[j, j] -= 1.0 / bonds
            stiffness[i, j] += 1.0 / bonds
            stiffness[j, i] += 1.0 / bonds
        return stiffness

    def interactions(self, gamma: float, times: FloatArray, by: str = "") -> FloatArray:
        """``h_ij`` and its first three derivatives at t_i - t_j, shape (4, m, m).

        On the diagonal the first derivative is left out: its jump is in the reset law.
        """
        out = np.empty((4, times.size, times.size))
        INTERACTIONS(self._responses(gamma, by), np.ascontiguousarray(times, dtype=float), out)
        return out

    def _responses(self, gamma: float, by: str = "") -> Responses:
        """Responses of the sites of all impacts to each of them."""
        sites = tuple(site for site, _ in self.section.impacts)
        return periodic_green(self.lattice, gamma, sites, sites, self.section.turns, by)

    def _in_turn(self, h: FloatArray, times: FloatArray) -> FloatArray:
        """As if impacts of one site at one wall kept their order: smooth where they become one."""
        for i, j in self.section.repeats:
            late = times[j] - times[i]
            if late < 0.0:
                # the branches of h at an impact differ by <sin(w t)/w> = t + O(t^3)
                h[:2, j, i] += late, 1.0
                h[:2, i, j] += late, -1.0
        return h

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times, impulses, offsets."""
        m = self.section.count
        return x[:m], x[m : 2 * m], x[2 * m :]

    def residual(self, x: FloatArray, params: Params) -> FloatArray:
        """All equations, shape (2m + sites,): walls, reset laws, balance of mean impulses."""
        a, gamma, k, f = self._unpack(x, params)
        times, impulses, offsets = self.split(x)
        h = self._in_turn(self.interactions(gamma, times), times)
        q = (1.0 - k) / (1.0 + k)  # the mean velocity at an impact is -q J/2
        return np.concatenate(
            [
                self._beyond_walls(x, params, h),
                a * f.df(times) + h[1] @ impulses + 0.5 * q * impulses,
                self._balance(impulses, offsets, gamma),
            ]
        )

    def _beyond_walls(self, x: FloatArray, params: Params, h: FloatArray) -> FloatArray:
        """How far sites are beyond their walls at their impacts."""
        a, gamma, _, f = self._unpack(x, params)
        times, impulses, offsets = self.split(x)

        def speed(i: int, j: int, since: FloatArray) -> FloatArray:
            h = self._responses(gamma)
            at = times[i] + since
            velocity = a * f.df(at) + h.at(at[:, None] - times, h.which[i])[1] @ impulses
            late = times[j] < times[i]
            return np.asarray(velocity + (impulses[i] - impulses[j] if late else 0.0))

        walls = a * f.f(times) + offsets[self.own] + h[0] @ impulses - self.walls
        return told_apart(self.section, times, walls, speed)

    def _balance(self, impulses: FloatArray, offsets: FloatArray, gamma: float) -> FloatArray:
        mean = np.zeros(len(self.section.hit))
        np.add.at(mean, self.own, impulses)
        return mean + (self.section.period * gamma) * (self.links @ offsets)

    def jacobian(self, x: FloatArray, params: Params) -> FloatArray:
        """Derivatives with respect to x."""
        a, gamma, k, f = self._unpack(x, params)
        times, impulses, _ = self.split(x)
        h = self._in_turn(self.interactions(gamma, times), times)
        m, r = self.section.count, len(self.section.hit)
        diagonal = np.arange(m)
        out = np.zeros((2 * m + r, 2 * m + r))
        walls, resets, balance = slice(0, m), slice(m, 2 * m), slice(2 * m, None)
        bent = h[2].copy()
        bent.flat[:: m + 1] = 0.0  # an impact does not move against itself
        # h_ij is a function of t_i - t_j: a later t_j takes it back
        out[walls, walls] = -h[1] * impulses
        out[resets, walls] = -bent * impulses
        out[diagonal, diagonal] = a * f.df(times) + h[1] @ impulses  # the site itself moves on
        out[m + diagonal, diagonal] = a * f.d2f(times) + bent @ impulses
        out[walls, resets], out[resets, resets] = h[0], h[1]  # both are linear in J
        out[m + diagonal, m + diagonal] += 0.5 * (1.0 - k) / (1.0 + k)
        out[diagonal, 2 * m + self.own] = 1.0  # u moves with the offset of its site
        out[2 * m + self.own, m + diagonal] = 1.0  # mean impulses add up
        out[balance, balance] = (self.section.period * gamma) * self.links
        if self.section.repeats:
            beyond = self._beyond_walls(x, params, h)
            out[walls] = told_apart_slopes(self.section, times, beyond, out[walls])
        return out

    def sensitivity(self, x: FloatArray, params: Params, name: str) -> FloatArray:
        """Derivatives with respect to the parameter ``name``."""
        a, gamma, k, f = self._unpack(x, params)
        times, impulses, offsets = self.split(x)
        balance = np.zeros(len(self.section.hit))
        if name == "a":
            walls, resets = f.f(times), f.df(times)
        elif name == "gamma":
            h = self.interactions(gamma, times, name)
            walls, resets = h[0] @ impulses, h[1] @ impulses
            balance = self.section.period * (self.links @ offsets)
        elif name == "k":
            walls, resets = np.zeros(times.size), -impulses / (1.0 + k) ** 2  # d(q/2)/dk
        else:  # a parameter of the forcing
            moved = ([f.f_param(name, float(t), order) for t in times] for order in (0, 1))
            walls, resets = (a * np.array(row) for row in moved)
        return np.concatenate([told_apart(self.section, times, walls), resets, balance])

    def _unpack(self, x: FloatArray, params: Params) -> tuple[float, float, float, Forcing]:
        a, gamma, k = float(params["a"]), float(params["gamma"]), float(params["k"])
        restitution_ratio(k)
        if not (math.isfinite(a) and np.isfinite(x).all()):
            raise BadInput(f"a = {a}, x = {x}: the orbit needs finite numbers.")
        return a, gamma, k, forcing_at(self.forcing, params)


@lru_cache(maxsize=256)
def green_equations_of(
    section: Section, forcing: Forcing, lattice: UniformLattice
) -> OrbitEquations:
    """`OrbitEquations`, kept: what they derive from the sequence serves a whole branch."""
    return OrbitEquations(section, forcing, lattice)
