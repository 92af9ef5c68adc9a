"""What is written as loops to be compiled says the same as the arrays it stands in for."""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
import pytest

from contbreather.breathers import clearance, clearance_loops, pair_loops, rivals
from contbreather.kernels import Kernel
from contbreather.lattice import InfiniteChain, green, periodic, wave_loops
from contbreather.stability import aliases, arc, arc_loops, orbit, orbit_loops, propagators, zeros
from contbreather.stability.characteristic import D
from contbreather.stability.half_period import HalfMap
from contbreather.stability.orbit import OrbitMap
from contbreather.stability.propagators import constants

RANDOM = np.random.default_rng(3)
PLACES = [(0.24 * x + 1e-3, y) for x, y in RANDOM.random((12, 2))]
# a pair of roots just opened, or not yet, between two nodes of the grid
# where two roots have met, to seven digits of k, and opened: both between two nodes
PLACES += [(0.1, 0.781761944709733 + 1e-7), (0.1, 0.781761944709733 + 1e-5)]
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
            zeros: "TURN DEPTH MOST",
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
    # on its pitchfork: a real multiplier on the circle to within rounding
    OrbitMap(0.04, 0.8, [(0, t, 1.62 * InfiniteChain().psi(0.04)) for t in (0.0, math.pi)]),
]


def by_loops(map: OrbitMap) -> tuple[OrbitMap, np.ndarray]:
    """The map as if the loops had been asked, and what they tell."""
    n = map.periods
    kicks = [entry for kick in map.kicks for entry in (kick.time / n, n * kick.b)]
    data = (map.scaled, map.k, map._terms, len(map.kicks), 1.0, *kicks)
    told = asked(orbit_loops.orbit, data, constants(), orbit_loops.SIZE, 8)
    compiled = OrbitMap(map.gamma, map.k, map.kicks, n)
    vars(compiled)["_circle"] = told
    return compiled, told


@pytest.mark.parametrize("gamma", [0.01, 0.025, 0.03, 0.06])
def test_several_multipliers_at_1_are_not_outside(gamma: float) -> None:
    """Elastic impacts have them at the pitchfork, and rounding alone puts them on a side."""
    b = 2.0 * InfiniteChain().psi(gamma)
    map = OrbitMap(gamma, 1.0, [(0, 0.0, b), (0, math.pi, b)])
    for count in (map.count(), by_loops(map)[0].count()):
        assert (count.count, count.certain) == (0, False)


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
    compiled, told = by_loops(map)
    found = compiled.count()
    assert (found.count, found.certain, found.pairs) == (count.count, count.certain, count.pairs)
    assert found.distance == pytest.approx(count.distance, abs=1e-9)
    assert told[orbit_loops.MINUS] == pytest.approx(minus, rel=1e-11, abs=1e-13)
    # next to an edge of the band rounding of a place counts with its root
    assert told[orbit_loops.APPROACH] == pytest.approx(approach, abs=1e-6)
    # more impacts than fit are left to the arrays
    monkeypatch.setattr(orbit, "_ORBIT", Text())
    assert OrbitMap(map.gamma, map.k, map.kicks, map.periods).count() == count


def memory(address: int, size: int) -> np.ndarray:
    return np.ctypeslib.as_array((ctypes.c_double * size).from_address(address))


class Text:
    """A function as if it had been compiled: what it is given is addresses."""

    def __init__(self, function: Any, *sizes: int) -> None:
        self.function, self.sizes = function, sizes

    def code(self) -> Any:
        return lambda *at: self.function(*map(memory, at, self.sizes))


def test_once_compiled_code_is_at_hand_it_is_asked_and_told_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    size, table = arc_loops.SIZE, arc.arc_table().size
    for gamma, k in PLACES[:4]:
        wanted = arc.on_arc(gamma, 1.3 * math.sqrt(gamma), k, 0.3), arc.window(gamma, k)
        with monkeypatch.context() as patched:
            patched.setattr(arc, "_ON_ARC", Text(arc_loops.on_arc, 5, table, size, 12))
            patched.setattr(arc, "_WINDOW", Text(arc_loops.window, 3, table, size, 12))
            arc.window.cache_clear()
            found = arc.on_arc(gamma, 1.3 * math.sqrt(gamma), k, 0.3), arc.window(gamma, k)
        for one, other in zip(found[0], wanted[0], strict=True):
            assert one == pytest.approx(other, rel=1e-12, abs=1e-13)
        assert tuple(found[1]) == pytest.approx(tuple(wanted[1]), rel=1e-9, abs=1e-11)
        arc.window.cache_clear()
    for map in MAPS[:3]:
        wanted = map.count(), map.crosses(-1.0), map.approach(), map.pairs()
        sizes = 5 + 2 * len(map.kicks), constants().size, orbit_loops.SIZE, 8
        again = OrbitMap(map.gamma, map.k, map.kicks, map.periods)
        with monkeypatch.context() as patched:
            patched.setattr(orbit, "_ORBIT", Text(orbit_loops.orbit, *sizes))
            found = again.count(), again.crosses(-1.0), again.approach(), again.pairs()
            assert again._circle is not None
        assert found[0].count == wanted[0].count
        assert found[1:3] == pytest.approx(wanted[1:3], abs=1e-6)
        assert found[3] == pytest.approx(wanted[3], abs=1e-6)


def test_more_impacts_than_fit_are_not_taken() -> None:
    for many, status in ((8, 0), (9, 1)):
        kicks = [entry for i in range(many) for entry in (0.5 * i, 0.1)]
        data = [0.04, 0.8, 1.0, many, 0.0, *kicks]
        work, found = [0.0] * orbit_loops.SIZE, [math.nan] * 8
        assert orbit_loops.orbit(data, constants().tolist(), work, found) == status


@pytest.mark.parametrize("rows", [1, 2, 4, 7])
def test_the_determinant_by_elimination(rows: int) -> None:
    for lost in (False, True):
        matrix = RANDOM.normal(size=(rows, rows)) + 1j * RANDOM.normal(size=(rows, rows))
        if lost:
            matrix[:, rows // 2] = 0.0
        work = [0.0] * orbit_loops.SIZE
        parts = np.stack([matrix.real, matrix.imag], axis=-1).ravel().tolist()
        work[orbit_loops.MATRIX : orbit_loops.MATRIX + len(parts)] = parts
        orbit_loops.determinant(work, rows)
        found = complex(*work[orbit_loops.VALUE : orbit_loops.VALUE + 2])
        assert found == pytest.approx(np.linalg.det(matrix), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("b", [-0.4, 0.6])
def test_on_the_band_a_half_map_is_asked_by_its_equations(b: float) -> None:
    half = HalfMap(0.1, 0.8, b)
    for nu in (0.1, 0.4):
        real, imag = arc.on_arc(0.1, nu, 0.8, b).value
        assert half.on_circle(nu) == complex(real, imag)
        assert half.on_circle(nu) != half.on_circle(nu, 1.1)
        assert half.on_circle(nu, 1.1) == D(0.1, nu - 1j * math.log(1.1) / math.pi, 0.8, b)
