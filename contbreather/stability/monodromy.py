"""The monodromy matrix of an orbit with impacts on a ring: flights and saltations, mode by mode.

``M = Q(T_m) S_m ... Q(T_1) S_1``. In the modes a flight turns each for itself (18) and an impact is
a change of rank two (19), so the product is built without a matrix product. Modes with a node at
every impacting site are left out: their multipliers are ``exp(+-i w T)`` exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.modes import Ring
from contbreather.stability.saltation import saltation

Array = NDArray[Any]


class Kick(NamedTuple):
    """One impact as a perturbation feels it: where, when, and the entry b of (19)."""

    site: int
    time: float
    b: float


def monodromy(ring: Ring, gamma: float, k: float, kicks: Sequence[Kick], periods: int = 1) -> Array:
    """M over 2 pi n on the modes that some impact sees, from just before the first impact.

    Parameters
    ----------
    ring : Ring
    gamma, k : float
        Coupling and restitution coefficient.
    kicks : sequence of Kick
        The impacts of one period in order of time.
    periods : int
        n.

    Returns
    -------
    ndarray, shape (2h, 2h)
        For one impacting site h = N//2 + 1, for several h = N. Amplitudes first, then velocities.

    Examples
    --------
    >>> M = monodromy(Ring(1), 0.0, 0.8, [Kick(0, 0.0, 0.5), Kick(0, 3.0, 0.5)])
    >>> round(float(np.linalg.det(M)), 12)  # k^4
    0.4096
    """
    w, rows = _modes(ring, gamma, {kick.site for kick in kicks})
    size = w.size
    M = np.eye(2 * size)
    u, v = M[:size], M[size:]
    times = [kick.time for kick in kicks]
    times.append(times[0] + 2.0 * math.pi * periods)
    for i, kick in enumerate(kicks):
        row = rows[kick.site]
        (loss, _), (b, _) = saltation(k, kick.b) - np.eye(2)
        place, speed = row @ u, row @ v
        u += np.multiply.outer(row, loss * place)
        v += np.multiply.outer(row, b * place + loss * speed)
        s = times[i + 1] - times[i]
        cosine, drift = np.cos(w * s)[:, None], (s * np.sinc(w * s / math.pi))[:, None]
        pull = (-w * np.sin(w * s))[:, None]
        u[:], v[:] = cosine * u + drift * v, pull * u + cosine * v
    return M


def _modes(ring: Ring, gamma: float, sites: set[int]) -> tuple[Array, dict[int, Array]]:
    """Frequencies of the modes that take part, and what each is at every impacting site."""
    theta, weight, w = ring.nodes(gamma)
    first = min(sites)
    even = {site: np.sqrt(weight) * np.cos((site - first) * theta) for site in sites}
    if len(sites) == 1:
        return w, even  # a mode and its mirror image: the odd one has a node there
    inner = slice(1, (ring.sites + 1) // 2)
    odd = {site: np.sqrt(weight[inner]) * np.sin((site - first) * theta[inner]) for site in sites}
    rows = {site: np.concatenate([even[site], odd[site]]) for site in sites}
    return np.concatenate([w, w[inner]]), rows
