"""What is written as loops to be compiled says the same as the arrays it stands in for."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from contbreather.breathers import clearance, clearance_loops, pair_loops, rivals
from contbreather.kernel import Kernel
from contbreather.lattice import green, periodic, wave_loops
from contbreather.stability import aliases, arc, arc_loops, orbit, orbit_loops, propagators, refined
from contbreather.stability.orbit import OrbitMap
from contbreather.stability.propagators import constants

RANDOM = np.random.default_rng(3)
PLACES = [(0.24 * x + 1e-3, y) for x, y in RANDOM.random((12, 2))]
# a pair of roots just opened, or not yet, between two nodes of the grid
PLACES += [(0.0969, 0.8), (0.09514, 0.8), (0.0951, 0.8), (1e-6, 0.9), (0.2499, 0.5)]


@pytest.fixture(autouse=True)
def arrays_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the loops are held against is not compiled from them."""
    monkeypatch.setattr(Kernel, "code", lambda kernel: None)
    arc.window.cache_clear()


def asked(function: Any, data: Any, table: np.ndarray, scratch: int, found: int) -> np.ndarray:
    """The text as it is, without compiling it."""
    work, out = [math.nan] * scratch, [math.nan] * found
    assert function(list(map(float, data)), table.tolist(), work, out) == 0
    return np.array(out)


def test_both_forms_share_their_constants() -> None:
    shared = {
        arc_loops: {arc: "GRID", aliases: "EXACT ORDERS POWERS"},
        orbit_loops: {
            orbit: "GRID CERTAIN FLAT",
            propagators: "NEAR ORDERS POWERS FAR CLOSED",
            refined: "TURN DEPTH MOST",
        },
        clearance_loops: {clearance: "CLOSE", rivals: "BESIDE ALIKE TELLING MIRRORED"},
        pair_loops: {green: "POWERS"},
    }
    for loops, others in shared.items():
        for other, names in others.items():
            for name in names.split():
                assert getattr(loops, name) == getattr(other, name), (loops.__name__, name)
    assert orbit_loops.FARTHEST == orbit.FAR
    assert pair_loops.TERMS == green.TERMS + 1
    assert clearance_loops.EVEN == wave_loops.EVEN == periodic.POWERS


@pytest.mark.parametrize(("gamma", "k"), PLACES)
def test_both_equations_of_a_pair_on_the_arc_and_their_slopes(gamma: float, k: float) -> None:
    b, nu = 0.7 - 3.0 * gamma, 1.3 * math.sqrt(gamma)
    data = gamma, k, 0.0, b, nu
    found = asked(arc_loops.on_arc, data, arc.arc_table(), arc_loops.SIZE, 12).reshape(6, 2)
    for own, wanted in zip(found, arc.on_arc(gamma, nu, k, b), strict=True):
        assert own == pytest.approx(wanted, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(("gamma", "k"), PLACES)
def test_the_window_of_b_in_which_a_pair_is_outside_and_its_angles(gamma: float, k: float) -> None:
    data = gamma, k, (1.0 - k) / (1.0 + k)
    found = asked(arc_loops.window, data, arc.arc_table(), arc_loops.SIZE, 12)[:4]
    assert found == pytest.approx(np.array(arc.window(gamma, k)), rel=1e-9, abs=1e-11)


MAPS = [
    OrbitMap(0.04, 0.8, [(0, 0.0, 0.9), (0, math.pi, 0.9)]),
    OrbitMap(0.2, 0.7, [(0, -0.03, 1.4), (0, 0.5, 1.75), (0, 3.15, -1.9)]),
    OrbitMap(0.13, 0.8, [(0, 0.4, 0.3), (0, 3.3, 0.1)]),
    OrbitMap(0.05, 0.3, [(0, 0.8, -1.4), (0, 7.1, 1.6)], 2),
    OrbitMap(0.01, 0.5, [(0, 0.1, -1.9)]),
    OrbitMap(0.03, 0.9, [(0, 1.0, 0.2), (0, 1.0, 0.4)]),
]


@pytest.mark.parametrize("map", MAPS, ids=repr)
def test_what_an_orbit_tells_of_its_multipliers(
    map: OrbitMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = OrbitMap(map.gamma, map.k, map.kicks, map.periods)
    count, minus, approach = wanted.count(), wanted.crosses(-1.0), wanted.approach()

    class Text:
        def code(self) -> Any:
            return lambda *_: 1

    assert "_circle" not in vars(map) or map._circle is None
    n = map.periods
    kicks = [entry for kick in map.kicks for entry in (kick.time / n, n * kick.b)]
    data = (map.scaled, map.k, map._terms, len(map.kicks), 1.0, *kicks)
    told = asked(orbit_loops.orbit, data, constants(), orbit_loops.SIZE, 8)
    compiled = OrbitMap(map.gamma, map.k, map.kicks, n)
    vars(compiled)["_circle"] = told  # as if the loops had been asked
    found = compiled.count()
    assert (found.count, found.certain, found.pairs) == (count.count, count.certain, count.pairs)
    assert found.distance == pytest.approx(count.distance, abs=1e-9)
    assert told[orbit_loops.MINUS] == pytest.approx(minus, rel=1e-11, abs=1e-13)
    # next to an edge of the band rounding of a place counts with its root
    assert told[orbit_loops.APPROACH] == pytest.approx(approach, abs=1e-6)
    # more impacts than fit are left to the arrays
    monkeypatch.setattr(orbit, "_ORBIT", Text())
    assert OrbitMap(map.gamma, map.k, map.kicks, n).count() == count
