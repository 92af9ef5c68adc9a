"""What is written as loops to be compiled says the same as the arrays it stands in for."""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
import pytest

from contbreather.breathers import clearance, clearance_loops, pair_loops, rivals
from contbreather.kernels import Kernel
from contbreather.lattice import green, periodic, wave_loops
from contbreather.stability import aliases, arc, arc_loops
from contbreather.stability.characteristic import D
from contbreather.stability.half_period import HalfMap

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
        clearance_loops: {clearance: "CLOSE", rivals: "BESIDE ALIKE TELLING MIRRORED"},
        pair_loops: {green: "POWERS"},
    }
    for loops, others in shared.items():
        for other, names in others.items():
            for name in names.split():
                assert getattr(loops, name) == getattr(other, name), (loops.__name__, name)
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


@pytest.mark.parametrize("b", [-0.4, 0.6])
def test_on_the_band_a_half_map_is_asked_by_its_equations(b: float) -> None:
    half = HalfMap(0.1, 0.8, b)
    for nu in (0.1, 0.4):
        real, imag = arc.on_arc(0.1, nu, 0.8, b).value
        assert half.on_circle(nu) == complex(real, imag)
        assert half.on_circle(nu) != half.on_circle(nu, 1.1)
        assert half.on_circle(nu, 1.1) == D(0.1, nu - 1j * math.log(1.1) / math.pi, 0.8, b)
