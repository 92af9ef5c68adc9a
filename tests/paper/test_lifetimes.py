"""What figures 5 to 8 say of their breathers: lives, growth, what would keep them."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.constructors import asymmetric
from contbreather.paper import lifetimes
from contbreather.simulation import Sample, periodic, simulate, simulate_smooth
from contbreather.simulation.integrator import IMPACT

SET = {"gamma": 0.104, "k": 0.8}


def breather(a):
    return cb.symmetric(a, 0.104, 0.8)


def test_life_ends_where_a_wall_is_missed_or_a_neighbour_hits():
    state = breather(0.2).state(20)
    run = simulate(state, a=0.2, damping=0.005, periods=200, **SET)
    lost = lifetimes.life(run)
    before = run.impacts[run.impacts["period"] < lost]
    assert set(before["site"]) == {0}
    assert np.all(np.diff(before["wall"]) != 0)
    there = run.impacts[run.impacts["period"] == lost]
    own = np.append(before["wall"][-1:], there["wall"][there["site"] == 0])
    assert len(own) < 2 or np.any(np.diff(own) == 0) or set(there["site"]) != {0}


@pytest.mark.slow
def test_life_on_smooth_walls_is_that_on_rigid_ones_where_the_walls_are_hard():
    state, sample = breather(0.2).state(20), Sample((-2, -1, 0, 1, 2), 24)
    shared = {"a": 0.2, "damping": 0.005, "periods": 100, **SET}
    hard = lifetimes.life(simulate_smooth(state, m=200, sample=sample, **shared))
    assert 20 < hard < 90
    assert 20 < lifetimes.life(simulate(state, **shared)) < 90


# --- Fig. 7 between m = 15 and 17 -----------------------------------------------------------------

SOFT = {"gamma": 0.04, "k": 0.8, "damping": 0.005}


@pytest.fixture(scope="module")
def along_m():
    """The asymmetric breather from m = 15 up to 15.3, over both doublings."""
    on = {"a": 0.82, "m": 15, **SOFT}
    other = periodic(asymmetric(0.82, 0.04, 0.8, lattice=cb.Ring(20)).state(20), **on)
    half_later = simulate_smooth(other.state, periods=0.5, **on).final
    motion = periodic(-np.array(half_later), **on)  # the mirror image, which the figure comes to
    assert motion.largest == pytest.approx(0.97984, abs=5e-6)  # as the figure says of it
    return cb.trace(motion, "m", towards="up", within={"m": (15, 15.3)}, events=())


@pytest.mark.slow
def test_breather_of_figure_7_repels_between_its_period_doublings(along_m):
    """Two real multipliers pass -1, at m = 15.17939 and 15.18487: 0, 1, 2 of them are beyond."""
    assert along_m[-1]["m"] == pytest.approx(15.3)
    for point in along_m:
        beyond = int(point["m"] > 15.17939) + int(point["m"] > 15.18487)
        mu = point.solution.multipliers
        assert np.sum(mu[np.abs(mu.imag) < 1e-9].real < -1.0) == beyond
        assert point["unstable"] == beyond


@pytest.mark.slow
def test_ring_let_go_beside_the_breather_of_figure_7_stays_or_leaves_as_its_multipliers_say(
    along_m,
):
    for point, kept in ((along_m[0], True), (along_m[-1], False)):
        u, v = point.solution.state
        run = simulate_smooth((u + 1e-6, v), a=0.82, m=point["m"], periods=80, **SOFT)
        away = np.hypot(run.strobe.u - u, run.strobe.v - v).max(axis=1)
        assert (away[-1] < away[0]) if kept else (away[-1] > 5e-3)


# --- lives by impacts alone -----------------------------------------------------------------------


def table(*rows: tuple[int, int, int]) -> np.ndarray:
    """Impacts as (period, site, wall)."""
    found = np.zeros(len(rows), IMPACT)
    for one, (period, site, wall) in zip(found, rows, strict=True):
        one["period"], one["site"], one["wall"] = period, site, wall
    return found


KEPT = [(i, 0, wall) for i in range(4) for wall in (1, -1)]
BOTH = {i: [(i, 0, 1), (i, 0, -1)] for i in range(8)}


@pytest.mark.parametrize(
    ("rows", "more", "ends"),
    [
        (KEPT, {}, []),
        ([(i, n, -wall) for i, n, wall in KEPT], {}, []),  # whichever wall comes first
        # one slips over the end of a period
        ([*BOTH[0], (0, 0, 1), (1, 0, -1), *BOTH[2], *BOTH[3]], {}, []),
        ([*BOTH[0], (1, 0, 1), *BOTH[2], *BOTH[3]], {}, [2]),  # a wall that is missed
        ([*BOTH[0], *BOTH[2]], {}, [1, 3]),  # periods without an impact
        ([*KEPT[:4], (1, 3, 1), *KEPT[4:]], {}, [1]),  # an impact of another site
        # a stretch of a recording knows the wall before it
        ([row for i in range(4, 8) for row in BOTH[i]], {"first": 4, "wall": -1}, []),
        ([row for i in range(4, 8) for row in BOTH[i]], {"first": 4, "wall": 1}, [0]),
    ],
)
def test_a_breather_alternates_between_its_walls_alone(rows, more, ends) -> None:
    found = lifetimes.unlike_a_breather(table(*rows), 4, **more)
    assert np.flatnonzero(found).tolist() == ends
