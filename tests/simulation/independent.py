"""The same motion by a general solver: small steps, one event for each site and wall."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from contbreather.lattice import Ring


def with_events(state, on, span, t0=0.0):
    """Displacements and velocities after a time, and (time, site, velocity before) of impacts."""
    lattice, sites = on.lattice, on.lattice.sites
    stiffness, drive = dense(lattice), getattr(lattice, "drive", np.ones(sites))
    pull = on.gamma * stiffness / lattice.masses[:, None] + on.spring * np.eye(sites)

    def slope(t, x):
        push = on.a * on.forcing.d2f(t) * drive - pull @ x[:sites] - on.damping * x[sites:]
        return np.concatenate([x[sites:], push])

    def gap(n, wall):
        place = on.walls.position(n, wall)

        def event(t, x):
            return wall * (place - x[n])

        event.terminal, event.direction = True, -1.0
        return event

    there = [(n, w) for n in range(sites) for w in (1, -1)]
    there = [one for one in there if math.isfinite(on.walls.position(*one))]
    events = [gap(*one) for one in there]
    t, x, hits = t0, np.concatenate(state), []
    while t < t0 + span:
        flown = solve_ivp(
            slope, (t, t0 + span), x, "DOP853", rtol=1e-13, atol=1e-14, max_step=0.01, events=events
        )
        t, x = flown.t[-1], flown.y[:, -1].copy()
        for (n, _), times in zip(there, flown.t_events, strict=True):
            if times.size:
                hits.append((t, n, x[sites + n]))
                x[sites + n] *= -on.k
    return x[:sites], x[sites:], hits


def dense(lattice):
    """The stiffness matrix, that of a ring written out bond by bond."""
    if not isinstance(lattice, Ring):
        return np.asarray(lattice.stiffness)
    matrix = np.zeros((lattice.sites, lattice.sites))
    for n in range(lattice.sites):
        for other in ((n + 1) % lattice.sites, (n - 1) % lattice.sites):
            matrix[n, n] += 1.0
            matrix[n, other] -= 1.0
    return matrix
