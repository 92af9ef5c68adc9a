"""Lives of breathers on the paper's ring: periods until they are lost, what would keep them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind
from contbreather.continuation.bifurcations.equilibria import fold
from contbreather.continuation.walk.trace import trace
from contbreather.errors import NotConverged, partial_result
from contbreather.orbits.orbit import Orbit
from contbreather.simulation.classify import BROAD
from contbreather.simulation.measures import localised
from contbreather.simulation.periodic import PeriodicMotion, periodic
from contbreather.simulation.simulate import SimulationRun, SmoothRun, completed, simulate

SITES, LONG = 20, 120  # of the paper's ring, and of one on which a wave is damped away going round
DAMPING = 0.005


def life(run: SimulationRun | SmoothRun, site: int = 0) -> int | None:
    """Periods until a site misses a wall or another one comes to one; None if it never happens.

    Of smooth rings it needs a record of that site and its neighbours.
    """
    check_kind(run, (SimulationRun, SmoothRun), "a run of simulate")
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


def delocalised(run: SmoothRun) -> bool:
    """Tell whether the energy is all over the ring at the end."""
    end = localised(run.strobe.u[-1], run.strobe.v[-1], run.times[-1], run.conditions)
    return float(end.participation) > BROAD


def keywords_of(breather: Orbit, damping: float = DAMPING) -> dict[str, Any]:
    return {"a": breather.a, "gamma": breather.gamma, "k": breather.k, "damping": damping}


def on_ring(
    breather: Orbit, m: int | None = None, damping: float = DAMPING, sites: int = SITES
) -> PeriodicMotion:
    """Breather of a damped ring, between walls of hardness `m` or rigid ones."""
    on = keywords_of(breather, damping) | ({} if m is None else {"m": m})
    return periodic(breather.state(sites), symmetric=True, **on)


@partial_result()
def softest(breather: Orbit, damping: float = DAMPING, sites: int = SITES) -> float:
    """Hardness m at which the smooth ring's breather, followed from hard walls, ends in a fold; NaN
    if it reaches m = 5."""
    check_kind(breather, Orbit, "a breather")
    hard = 30  # walls close to the impacting ones
    branch = trace(
        on_ring(breather, hard, damping, sites), "m", within={"m": (5.0, hard + 1.0)},
        towards="down", events=(replace(fold(), ends="branch"),), progress=False,
    )  # fmt: skip
    return float(branch.first("LP")["m"]) if "LP" in {p.kind for p in branch.special} else math.nan


def enough_damping(breather: Orbit, sites: int = SITES) -> float:
    """Damping at which the breather of the ring with rigid walls becomes an attractor."""
    from scipy.optimize import brentq

    check_kind(breather, Orbit, "a breather")

    def excess(damping: float) -> float:
        return on_ring(breather, damping=damping, sites=sites).largest - 1.0

    high = 0.01
    while high < 0.06 and excess(high) > 0.0:  # enough for every breather of the figures
        high += 0.01
    return float(brentq(excess, high - 0.01, high, xtol=1e-10))


def lives(breather: Orbit, m: int, lost: int | None) -> dict[str, float]:
    """Lives (NaN: kept), the largest multipliers, and what would keep the breather.

    ``softest`` is the m at which the breather of the smooth ring ends, where it does not reach m.
    """
    run = simulate(breather.state(SITES), periods=600, **keywords_of(breather))
    rigid_lost = life(completed(run))
    multiplier = fold_at = math.nan
    try:
        multiplier = on_ring(breather, m).largest
    except NotConverged:
        fold_at = softest(breather)
    return {
        "lost": math.nan if lost is None else float(lost),
        "multiplier": multiplier,
        "softest": fold_at,
        "rigid_lost": math.nan if rigid_lost is None else float(rigid_lost),
        "rigid_multiplier": on_ring(breather).largest,
        "enough_damping": enough_damping(breather),
        "long_multiplier": on_ring(breather, sites=LONG).largest,
    }


def lives_in_words(stats: dict[str, float], m: int) -> str:
    why = f"multiplier {stats['multiplier']:.4f}"
    if math.isnan(stats["multiplier"]):
        why = f"there is no breather at m = {m}, it ends in a fold at m = {stats['softest']:.2f}"
    return (
        f"{gone(stats['lost'])} ({why}); rigid walls: {gone(stats['rigid_lost'])} (multiplier "
        f"{stats['rigid_multiplier']:.4f}), an attractor from damping "
        f"{stats['enough_damping']:.4f} on; on a ring of {LONG} the multiplier is "
        f"{stats['long_multiplier']:.4f}."
    )


def gone(periods: float) -> str:
    """When it was lost, in words."""
    if math.isnan(periods):
        return "kept"
    return f"lost after {periods:.0f} periods" if periods else "lost at once"
