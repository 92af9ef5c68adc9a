"""How localised a state is: energy per site, participation ratio, decay away from its centre.

The forced motion ``a g_n(t)`` carries energy however localised the rest is. So energies are those
of the motion ``x_n = u_n - a g_n`` relative to it; on a ring

    ``e_n = x_n'^2/2 + gamma/4 [(x_n - x_n-1)^2 + (x_n - x_n+1)^2]``,

the second term half the energy of each bond. Springs and ties to the ground belong to their site.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse import csgraph

from contbreather.checks import numbers
from contbreather.errors import BadInput
from contbreather.lattice.finite import Finite, stiffness_of
from contbreather.lattice.modal_flow import driven
from contbreather.simulation.states import LatticeParameters, Moved, conditions_of

Array = NDArray[Any]

NOISE = 1e-26  # energies below this, relative to the largest, are rounding: of amplitudes, 1e-13


@dataclass(frozen=True, eq=False, repr=False)
class Localisation:
    """Where the energy of a state is.

    Attributes
    ----------
    energy : ndarray, shape (..., N)
        Per site, relative to the common forced motion.
    participation : ndarray, shape (...)
        ``(sum e)^2/sum e^2``: 1 if one site has all, N if all have the same.
    centre : ndarray of int, shape (...)
        The site with the largest energy.
    """

    energy: Array
    participation: Array
    centre: Array
    lattice: Finite

    def __repr__(self) -> str:
        low, high = np.min(self.participation), np.max(self.participation)
        states = np.size(self.centre)
        return f"<Localisation of {states} states, participation ratio {low:.4g} to {high:.4g}>"

    def decay(self) -> float:
        """By how much the amplitude falls from one site to the next: exp of half the slope of the
        mean logarithm of the energies against the number of bonds from the centre.

        Of several states the mean energies count. 1 if nothing decays, NaN where no site is two
        bonds away.
        """
        energy = self.energy.reshape(-1, self.energy.shape[-1])
        count = 1 + int(max(_shells(self.lattice, n).max() for n in set(self.centre.flat)))
        if count < 3:
            return float("nan")
        shells = [
            _by_shell(self.lattice, *sample, count)
            for sample in zip(energy, self.centre.flat, strict=True)
        ]
        folded, distance = np.nanmean(shells, axis=0), np.arange(count)
        # the far side of a ring feels both ends of its motion: the outer part is left out
        use = (distance <= max(2, (2 * (count - 1)) // 3)) & (folded > NOISE * folded.max())
        if np.count_nonzero(use) < 2:
            return 0.0
        # energies go as the square of amplitudes
        slope = np.polyfit(distance[use], np.log(folded[use]), 1)[0]
        return float(np.exp(0.5 * slope))


@lru_cache(maxsize=64)
def _shells(lattice: Finite, centre: int) -> NDArray[np.float64]:
    """Bonds from the centre to each site, -1 where there is no way."""
    apart = csgraph.shortest_path(abs(stiffness_of(lattice)), unweighted=True, indices=centre)
    return np.where(np.isfinite(apart), apart, -1.0)


def _by_shell(lattice: Finite, energy: Array, centre: int, count: int) -> Array:
    """Mean energies of all sites at each distance; NaN where there are none."""
    shells = _shells(lattice, int(centre))
    there = shells >= 0.0
    number = np.bincount(shells[there].astype(int), minlength=count)
    total = np.bincount(shells[there].astype(int), energy[there], minlength=count)
    with np.errstate(invalid="ignore"):
        return np.asarray(total / number)


def localisation(
    u: ArrayLike, v: ArrayLike, t: ArrayLike = 0.0, **on: Unpack[LatticeParameters]
) -> Localisation:
    """Energies and participation ratio of one state, or of many at once.

    Parameters
    ----------
    u, v : array_like, shape (..., N)
        Displacements and velocities, for instance ``*run.strobe``.
    t : array_like, shape (...)
        Their times.
    on
        ``a, gamma, damping, spring, forcing, lattice`` as in `simulate`.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> b = symmetric(a=0.5, gamma=0.02, k=0.8)
    >>> found = localisation(*b.state(20), a=0.5, gamma=0.02)
    >>> round(float(found.participation), 1), int(found.centre)
    (1.1, 0)
    """
    x, y = numbers("u", u), numbers("v", v)
    if x.shape != y.shape or x.ndim == 0 or not x.size:
        raise BadInput(
            f"u and v must have one shape (..., sites); {x.shape} and {y.shape} were given."
        )
    times = numbers("t", t)
    if times.shape not in ((), x.shape[:-1]):
        raise BadInput(f"t has the shape {times.shape}: a time for each of {x.shape[:-1]} states.")
    return localised(x, y, times, conditions_of(x.shape[-1], k=1.0, **on))


def localised(u: Array, v: Array, t: ArrayLike, on: Moved) -> Localisation:
    """`localisation`, under conditions that have been checked."""
    x, y = u - forced(on, t, 0), v - forced(on, t, 1)
    table = stiffness_of(on.lattice)
    # what ties a site to the ground: its spring, and what its row of the stiffness has over
    ground = 0.5 * on.lattice.masses * on.spring + 0.5 * on.gamma * _loose(table)
    energy = 0.5 * on.lattice.masses * y**2 + ground * x**2
    if on.gamma > 0.0:
        energy += on.gamma * _of_bonds(table, x)
    total, square = energy.sum(axis=-1), (energy**2).sum(axis=-1)
    # where nothing moves, no site has more of it than another: all N of them
    with np.errstate(invalid="ignore", divide="ignore"):
        participation = np.where(square > 0.0, total**2 / square, x.shape[-1])
    return Localisation(energy, participation, energy.argmax(axis=-1), on.lattice)


def _loose(table: Any) -> Array:
    """Stiffness of what ties each site to the ground, without what rounding leaves."""
    rows, size = table.sum(axis=1), abs(table).sum(axis=1)
    return np.where(abs(rows) > 1e-14 * size, rows, 0.0)


def _of_bonds(table: Any, x: Array) -> Array:
    """Half the energy of the bonds of each site, at unit coupling."""
    bonds = table.tocoo()
    site, neighbour, weight = bonds.row, bonds.col, -0.25 * bonds.data
    # k (x_i - x_j)^2/2 is that of a bond: half of it, at each of its two entries K_ij = -k
    apart = weight * (x[..., site] - x[..., neighbour]) ** 2  # nothing on the diagonal
    ends = sparse.csr_array(
        (np.ones(site.size), (np.arange(site.size), site)), (site.size, x.shape[-1])
    )
    return np.asarray((apart.reshape(-1, site.size) @ ends).reshape(x.shape))


def forced(on: Moved, t: ArrayLike, order: int) -> Array:
    """The forced motion of every site at many times, or its derivative: shape (..., N or 1)."""
    motion = driven(on.lattice, on.forcing, on.gamma, on.spring, on.damping)
    return on.a * motion.everywhere(np.asarray(t, dtype=float), order)
