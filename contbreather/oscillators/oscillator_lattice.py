"""Lattices of oscillators: potentials at the sites and along the bonds of any finite lattice.

    m_n u_n'' + d_n d u_n' + s_n V'(u_n) + d/du_n (sum over bonds of w W(r)) = a_n F(t)

with r = u_j - u_i of a bond from site i to site j. A ring and a chain are gone around, or along, in
the order of their sites, a grid along its rows and columns; other bonds lead from the lower number
to the higher one. Ends that are fixed have bonds to the ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..checks import brief, numbers, real
from ..errors import BadInput
from ..flows.functions import slopes_along
from ..lattice.finite import finite, stiffness_of
from .potentials import Params, SmoothFunction

Array = NDArray[np.float64]

_NUMBERS = ("damping", "walls", "k")  # or formulas in parameters
SHARE = "share of the coupling"  # no name that a formula may have: 1 where it is not given


class Bonds(NamedTuple):
    """Bonds of a lattice: ``r = ends @ u``, one row with +1 and -1 for each, or one of both for a
    bond to the ground; and their stiffness."""

    ends: Any  # sparse, (bonds, N)
    weights: Array


@dataclass(frozen=True, eq=False)
class Oscillators:
    """A lattice of oscillators, conservative or driven and damped: ``f(t, x, p)`` of its states
    ``x = (u, v)``, positions of all sites and then velocities.

    Parameters
    ----------
    V : str or callable, optional
        Potential of each site, a formula in ``u``, or ``V(u, p)``; none unless given. Other names
        in a formula are parameters. Nothing is executed; derivatives are those of SymPy, those of a
        callable complex steps: it has to be analytic.
    W : str or callable
        Potential of each bond, a formula in the difference ``r`` of its ends, or ``W(r, p)``.
    lattice : Ring or Lattice
        `Ring`, `OpenChain`, `Grid`, `Lattice.from_graph`: its bonds, and its rows of numbers for
        each site (masses, springs for the shares of V, dampings, drive).
    damping : float or str, optional
        The force ``-damping * v``: a number, or a formula in parameters.
    drive : str or callable, optional
        The force on each site, a formula in ``t`` of the period ``2*pi/omega``, or ``F(t, p)``.
    walls, k : float or str, optional
        Where the walls of each site are, at -walls and +walls, and the restitution of impacts,
        ``v -> -k v``: numbers, or formulas in parameters.
    masses, onsite : array_like, shape (N,), optional
        Mass, and share of V, of each site, in place of those of the lattice.
    couplings : array_like, optional
        Share of W of each bond, in the order of `bonds`, in place of the stiffness of the lattice.

    Raises
    ------
    BadInput
        For formulas that are none, rows that do not fit, the infinite chain.

    Examples
    --------
    >>> from contbreather.lattice import Ring
    >>> chain = Oscillators(V="u**2/2 + b*u**4/4", W="c*r**2/2", lattice=Ring(3))
    >>> chain.names
    ('b', 'c')
    >>> chain(0.0, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), {"b": 1.0, "c": 0.1}).round(12)
    array([ 0. ,  0. ,  0. , -2.2,  0.1,  0.1])
    """

    V: Any = None
    W: Any = None
    lattice: Any = None
    damping: Any = None
    drive: Any = None
    walls: Any = None
    k: Any = None
    masses: Any = None
    onsite: Any = None
    couplings: Any = None

    def __post_init__(self) -> None:
        lattice = finite(self.lattice)
        own = {"masses": lattice.masses, "onsite": lattice.springs, "couplings": self.bonds.weights}
        for name, values in own.items():
            given = getattr(self, name)
            row = np.asarray(values if given is None else numbers(name, given), dtype=float)
            if row.shape != np.shape(values):
                raise BadInput(f"{name} has shape {row.shape}; {np.shape(values)} was expected.")
            object.__setattr__(self, name, row)
        if not self.masses.min() > 0:
            raise BadInput(f"masses = {brief(self.masses.tolist())}: every mass must be positive.")
        if (self.walls is None) != (self.k is None):
            raise BadInput("walls= and k= go together: where the walls are, and their restitution")
        variables = {"V": "u", "W": "r", "drive": "t"} | dict.fromkeys(_NUMBERS, "_")
        for name, variable in variables.items():
            given = getattr(self, name)
            if name in _NUMBERS and np.isfinite(real(given)):
                given = repr(real(given)) if real(given) or name == "k" else None
            if given is None and name in ("V", "W"):
                given = "0"
            if not (given is None or isinstance(given, str) or callable(given)):
                given = str(given)  # an expression of SymPy
            value = None if given is None else SmoothFunction(given, variable)
            object.__setattr__(self, name, value)

    # --- what it is ---------------------------------------------------------------------------

    @property
    def sites(self) -> int:
        sites: int = self.lattice.sites
        return sites

    @property
    def dissipative(self) -> bool:
        """Tell whether it is driven or damped, and conserves nothing."""
        return not (self.drive is None and self.damping is None and self.walls is None)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parameters of its formulas."""
        parts = (self.V, self.W, self.damping, self.drive, self.walls, self.k)
        return tuple(dict.fromkeys(name for part in parts if part for name in part.names))

    @cached_property
    def bonds(self) -> Bonds:
        """Its bonds in order, those to the ground last."""
        first, second, weights, ground = _oriented(self.lattice)
        sites, count = np.flatnonzero(ground), first.size
        signs = np.ones(sites.size)
        if sites.size > 1 and (abs(first - second) == 1).all():  # a chain: to its other end
            signs[-1] = -1.0
        rows = [np.arange(count), np.arange(count), count + np.arange(sites.size)]
        ends = np.concatenate([np.ones(count), -np.ones(count), signs])
        place = np.concatenate(rows), np.concatenate([second, first, sites])
        shape = count + sites.size, ground.size
        return Bonds(sparse.csr_array((ends, place), shape), np.append(weights, ground[sites]))

    # --- forces -------------------------------------------------------------------------------

    def __call__(self, t: Any, x: Any, p: Params) -> NDArray[Any]:
        u, v = x[: self.sites], x[self.sites :]
        force = -self.gradient(u, p)
        if self.damping is not None:
            force = force - _beside(self.lattice.dampings, v) * self.damping(0.0, p) * v
        if self.drive is not None:
            force = force + _beside(self.lattice.drive, v) * self.drive(t, p)
        return np.concatenate([v, force / _beside(self.masses, v)])

    def gradient(self, u: Any, p: Params) -> NDArray[Any]:
        """Differentiate the potential energy in the positions, shape (N,) or (N, m)."""
        total = _beside(self.onsite, u) * self.V.slope(u, p)
        for (ends, back), weights in self.parts(p):
            r = ends @ u
            total = total + back @ (_beside(weights, r) * self.W.slope(r, p))
        return total

    def curvatures(self, u: Any, p: Params) -> tuple[Any, Any, NDArray[Any]]:
        """Differentiate that once more at positions (N, m): rows, columns and values (entries, m)
        of what is not zero."""
        rows, columns, spread = self._second
        values = spread[0] @ (_beside(self.onsite, u) * self.V.curvature(u, p))
        for entries, ((ends, _), weights) in zip(spread[1:], self.parts(p), strict=False):
            r = ends @ u
            values = values + entries @ (_beside(weights, r) * self.W.curvature(r, p))
        return rows, columns, values

    @cached_property
    def _second(self) -> tuple[Any, Any, list[Any]]:
        """Places in the second derivative of the energy, and where the curvature of each site and
        of each bond goes there, of those that hold one end as well."""
        sites, ends = sparse.eye_array(self.sites, format="csc"), abs(self.bonds.ends)
        rows, columns = (ends.T @ ends + sites).nonzero()
        parts = [sites, *(part.tocsc() for part, _ in self._ends)]
        return rows, columns, [(e[:, rows].multiply(e[:, columns])).T.tocsr() for e in parts]

    @property
    def jacobian(self) -> LatticeJacobian:
        """Its derivative in the states, as flows ask for it."""
        return LatticeJacobian(self)

    def parts(self, p: Params) -> list[tuple[tuple[Any, Any], Any]]:
        """Bonds and their weights. Of a share s of the coupling s of each; where there is no V to
        be left at 0, the rest holds each of both ends as if the other one were at rest."""
        share = p.get(SHARE, 1.0)
        if isinstance(share, float) and share == 0.0 and not self.bare:
            return []
        if not self.bare or self.walls or (isinstance(share, float) and share == 1.0):
            return [(self._ends[0], share * self.couplings)]
        two = np.diff(self.bonds.ends.indptr) == 2  # those to the ground stay
        rest = np.where(two, 1.0 - share, 0.0) * self.couplings
        weights = np.where(two, share, 1.0) * self.couplings, rest, rest
        return list(zip(self._ends, weights, strict=True))

    @cached_property
    def _ends(self) -> list[tuple[Any, Any]]:
        """Ends of bonds, and of each the one and the other alone, each with its transpose."""
        ends = self.bonds.ends
        return [(e, e.T.tocsr()) for e in (ends, ends.maximum(0), ends.minimum(0))]

    @property
    def least_share(self) -> float:
        """Share of the coupling from which it is walked: without any, sites between walls that no
        potential and no damping holds would be free."""
        return 0.02 if self.bare and self.walls and self.damping is None else 0.0

    @cached_property
    def bare(self) -> bool:
        """Tell whether it has no potential at the sites: bonds alone hold them."""
        return not callable(self.V.given) and self.V.given == "0"

    # --- energies -----------------------------------------------------------------------------

    def site_energies(self, x: Array, p: Params) -> Array:
        """Energy of each site at states (2N,) or (2N, m): half of a bond belongs to each end."""
        u, v = x[: self.sites], x[self.sites :]
        total = 0.5 * _beside(self.masses, v) * v * v + _beside(self.onsite, u) * self.V(u, p)
        for (ends, _), weights in self.parts(p):
            r, count = ends @ u, np.maximum(np.diff(ends.indptr), 1)
            halves = sparse.diags_array(1 / count) @ abs(ends)
            total = total + halves.T @ (_beside(weights, r) * self.W(r, p))
        return np.asarray(total)

    def energy(self, x: Array, p: Params) -> Any:
        """Energy of all of it at a state, or at states."""
        return self.site_energies(x, p).sum(axis=0)

    def frequencies(self, p: Params) -> Array:
        """Frequencies of small oscillations about rest, ascending; NaN of those that grow."""
        root = np.sqrt(self.masses)
        rows, columns, values = self.curvatures(np.zeros((self.sites, 1)), p)
        matrix = np.zeros((self.sites, self.sites))
        matrix[rows, columns] = values[:, 0] / (root[rows] * root[columns])
        squares = np.linalg.eigvalsh(matrix)
        squares[abs(squares) < 1e-13 * max(1.0, abs(squares).max())] = 0.0
        return np.sqrt(np.where(squares < 0, np.nan, squares))

    def __repr__(self) -> str:
        return f"<Oscillators: V = {self.V}, W = {self.W}, {self.lattice.describe()}>"


@dataclass(frozen=True)
class LatticeJacobian:
    """The derivative of the field of a lattice in its states, of many states at once."""

    chain: Oscillators

    def slopes(
        self, f: Any, t: Any, x: Array, p: Params, names: tuple[str, ...]
    ) -> tuple[Array, Array, Array]:
        """Evaluate the field at K states, and its derivatives in states, (n, n, K), and in time
        and named parameters."""
        value, other = slopes_along(f, t, x, p, names, np.empty((len(x), 0)))
        matrix = np.zeros((len(x), *x.shape))
        rows, columns, entries = self._entries(x, p)
        matrix[rows, columns] = entries
        return value, matrix, other

    def entries(
        self, f: Any, t: Any, x: Array, p: Params, names: tuple[str, ...]
    ) -> tuple[Array, Any, Array]:
        """The same as rows, columns and values of one matrix with K blocks on its diagonal."""
        value, other = slopes_along(f, t, x, p, names, np.empty((len(x), 0)))
        rows, columns, entries = self._entries(x, p)
        first = len(x) * np.arange(x.shape[1])[:, None]
        return value, ((first + rows).ravel(), (first + columns).ravel(), entries.T.ravel()), other

    def matrix(self, t: float, x: Array, p: Params) -> Any:
        rows, columns, entries = self._entries(x[:, None], p)
        return sparse.csc_array((entries[:, 0], (rows, columns)), (x.size, x.size))

    def is_sparse(self, t: float, x: Array, p: Params) -> bool:
        return True

    def _entries(self, x: Array, p: Params) -> tuple[Any, Any, Array]:
        chain, n, count = self.chain, self.chain.sites, x.shape[1]
        rows, columns, stiff = chain.curvatures(x[:n], p)
        sites, one = np.arange(n), np.ones((n, count))
        places = [(sites, n + sites, one), (n + rows, columns, -stiff / chain.masses[rows, None])]
        if chain.damping is not None:
            lost = chain.lattice.dampings * chain.damping(0.0, p) / chain.masses
            places.append((n + sites, n + sites, -lost[:, None] * one))
        first, second, entries = (np.concatenate(part) for part in zip(*places, strict=True))
        return first, second, entries


def _beside(row: Any, x: Any) -> Any:
    """A number for each row of x, however many columns that has."""
    return row if np.ndim(x) == 1 else row[:, None]


def _oriented(lattice: Any) -> tuple[Any, Any, Any, Any]:
    """From where each bond leads, and where to; its stiffness; and that to the ground by site."""
    n = np.arange(lattice.sites)
    if hasattr(lattice, "with_spring") or not hasattr(lattice, "stiffness"):  # a ring
        return (
            n[n.size < 2 :],
            np.roll(n, -1)[n.size < 2 :],
            np.ones(n.size - (n.size < 2)),
            0.0 * n,
        )
    matrix = stiffness_of(lattice)
    upper = sparse.triu(matrix, 1).tocoo()
    first, second = upper.coords
    ground = np.asarray(matrix.sum(axis=1)).ravel()
    ground[abs(ground) <= 1e-12 * abs(matrix).max()] = 0.0
    closing = np.zeros(first.size, dtype=bool)
    if lattice.shape:
        columns = lattice.shape[1]
        (r, c), (below, right) = np.divmod(first, columns), np.divmod(second, columns)
        closing = (right - c > 1) | (below - r > 1)
    elif ((second - first == 1) | (second - first == n.size - 1)).all():
        closing = (second - first) > 1
    first, second = np.where(closing, second, first), np.where(closing, first, second)
    return first, second, -upper.data, ground
