"""How localised a state is: energy per site, participation ratio, decay away from its centre.

All sites share the forced motion ``a g(t)``, which carries energy however localised the rest is.
So energies are those of the motion relative to it:

    ``e_n = (u_n' - a g')^2/2 + gamma/4 [(u_n - u_n-1)^2 + (u_n - u_n+1)^2]``,

the second term half the energy of each bond.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import numbers
from contbreather.dynamics.conditions import Conditions
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, forcing_of

Array = NDArray[Any]

NOISE = 1e-26  # energies below this, relative to the largest, are rounding


@dataclass(frozen=True, eq=False)
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

    def decay(self) -> float:
        """By how much the amplitude falls from one site to the next: exp of half the slope of the
        mean logarithm of the energies against the distance from the centre.

        Of several states the mean energies count. 1 if nothing decays, NaN on fewer than 4 sites.
        """
        sites = self.energy.shape[-1]
        energy = self.energy.reshape(-1, sites)
        rolled = [np.roll(e, -n) for e, n in zip(energy, self.centre.ravel(), strict=True)]
        mean = np.mean(rolled, axis=0)
        half = sites // 2
        if half < 2:
            return float("nan")
        distance = np.arange(half + 1)
        folded = 0.5 * (mean[distance] + mean[-distance])
        # the far side of a ring feels both ends of its motion: the outer half is left out
        use = (distance <= max(2, (2 * half) // 3)) & (folded > NOISE * folded.max())
        if np.count_nonzero(use) < 2:
            return 0.0
        slope = np.polyfit(distance[use], np.log(folded[use]), 1)[0]
        return float(np.exp(0.5 * slope))


def localisation(
    u: ArrayLike,
    v: ArrayLike,
    t: ArrayLike = 0.0,
    *,
    a: float,
    gamma: float,
    damping: float = 0.0,
    forcing: Forcing | str | None = None,
) -> Localisation:
    """Energies and participation ratio of one state, or of many at once.

    Parameters
    ----------
    u, v : array_like, shape (..., N)
        Displacements and velocities, for instance ``*run.strobe``.
    t : array_like, shape (...)
        Their times.
    a, gamma, damping, forcing
        As in `simulate`.

    Examples
    --------
    >>> from contbreather.breathers import symmetric
    >>> b = symmetric(a=0.5, gamma=0.02, k=0.8)
    >>> found = localisation(*b.state(20), a=0.5, gamma=0.02)
    >>> round(float(found.participation), 1), int(found.centre)
    (1.1, 0)
    """
    x, y = numbers("u", u), numbers("v", v)
    if x.shape != y.shape or x.ndim == 0:
        raise BadInput(
            f"u and v must have one shape (..., sites); {x.shape} and {y.shape} were given."
        )
    shared = forced_velocity(
        Conditions(a, gamma, 1.0, damping, forcing_of(forcing)), numbers("t", t)
    )
    bond = (x - np.roll(x, 1, axis=-1)) ** 2 if x.shape[-1] > 1 else np.zeros_like(x)
    energy = 0.5 * (y - shared[..., None]) ** 2
    energy += 0.25 * gamma * (bond + np.roll(bond, -1, axis=-1))
    total, square = energy.sum(axis=-1), (energy**2).sum(axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        participation = np.where(square > 0.0, total**2 / square, x.shape[-1])
    return Localisation(energy, participation, energy.argmax(axis=-1))


def forced_velocity(conditions: Conditions, t: ArrayLike) -> Array:
    """a g'(t), at many times."""
    m, c, s = conditions.motion
    angle = np.multiply.outer(np.asarray(t, dtype=float), m)
    return np.asarray(np.cos(angle) @ (m * s) - np.sin(angle) @ (m * c))


def forced_displacement(conditions: Conditions, t: ArrayLike) -> Array:
    """a g(t), at many times."""
    m, c, s = conditions.motion
    angle = np.multiply.outer(np.asarray(t, dtype=float), m)
    return np.asarray(np.cos(angle) @ c + np.sin(angle) @ s)
