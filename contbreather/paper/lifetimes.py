"""Lives of breathers on the paper's ring: periods until they are lost, and how fast they go."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind
from contbreather.errors import NotConverged
from contbreather.orbits.orbit import Orbit
from contbreather.simulation.periodic import PeriodicMotion, periodic
from contbreather.simulation.simulate import SimulationRun, States, completed, simulate

SITES, LONG = 20, 120  # of the paper's ring, and of one on which a wave is damped away going round
DAMPING = 0.005


def life(run: States, site: int = 0) -> int | None:
    """Periods until a site misses a wall or another one comes to one; None if it never happens.

    Of smooth rings it needs a record of that site and its neighbours.
    """
    check_kind(run, States, "a run of simulate")
    if isinstance(run, SimulationRun):
        broken = unlike_a_breather(run.impacts, run.periods, site=site)
    else:
        assert run.record is not None
        u = run.record.u.reshape(run.periods, -1, len(run.record.sites))
        here = run.record.sites.index(site)
        centre, others = u[:, :, here], np.delete(u, here, 2)
        # a breather's site exceeds 0.6 on both sides in every period, and no other comes to 0.93
        missed = (centre.max(axis=1) < 0.6) | (centre.min(axis=1) > -0.6)
        broken = missed | (np.abs(others).max(axis=(1, 2)) > 0.93)
    return int(broken.argmax()) if broken.any() else None


def unlike_a_breather(
    impacts: NDArray[np.void], periods: int, first: int = 0, wall: int = 0, site: int = 0
) -> NDArray[np.bool_]:
    """Find the whole periods in which `site` rests or misses a wall, or any other hits one.

    `wall` is the one of the last impact before, if there was any. Impacts are not counted: where
    their phases move, as on a torus, one may slip over the end of a period.
    """
    period, at_site = impacts["period"] - first, impacts["site"] == site
    walls = np.concatenate([[wall], impacts["wall"][at_site]])
    missed = period[at_site][walls[1:] == walls[:-1]]
    own, twice, others = (
        np.bincount(hits, minlength=periods)[:periods] > 0
        for hits in (period[at_site], missed, period[~at_site])
    )
    return np.asarray(~own | twice | others)


def keywords_of(breather: Orbit, damping: float = DAMPING) -> dict[str, Any]:
    return {"a": breather.a, "gamma": breather.gamma, "k": breather.k, "damping": damping}


def on_ring(breather: Orbit, m: int | None = None, sites: int = SITES) -> PeriodicMotion:
    """Breather of a damped ring, between walls of hardness `m` or rigid ones."""
    on = keywords_of(breather) | ({} if m is None else {"m": m})
    return periodic(breather.state(sites), symmetric=True, **on)


def lives(breather: Orbit, m: int, lost: int | None) -> dict[str, float]:
    """Lives (NaN: kept), and the largest multipliers: between walls of hardness m (NaN where the
    ring has no such breather), between rigid ones, there also on a long ring."""
    run = simulate(breather.state(SITES), periods=600, **keywords_of(breather))
    rigid_lost = life(completed(run))
    try:
        multiplier = on_ring(breather, m).largest
    except NotConverged:
        multiplier = math.nan
    return {
        "lost": math.nan if lost is None else float(lost),
        "multiplier": multiplier,
        "rigid_lost": math.nan if rigid_lost is None else float(rigid_lost),
        "rigid_multiplier": on_ring(breather).largest,
        "long_multiplier": on_ring(breather, sites=LONG).largest,
    }


def lives_in_words(stats: dict[str, float], m: int) -> str:
    why = f"multiplier {stats['multiplier']:.4f}"
    if math.isnan(stats["multiplier"]):
        why = f"there is no breather at m = {m}"
    return (
        f"{gone(stats['lost'])} ({why}); rigid walls: {gone(stats['rigid_lost'])} (multiplier "
        f"{stats['rigid_multiplier']:.4f}; on a ring of {LONG} {stats['long_multiplier']:.4f})."
    )


def gone(periods: float) -> str:
    """When it was lost, in words."""
    if math.isnan(periods):
        return "kept"
    return f"lost after {periods:.0f} periods" if periods else "lost at once"
