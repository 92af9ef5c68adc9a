"""Integrators of the smooth chain on an equation with a known solution, whatever they are given."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.errors import NotConverged
from contbreather.simulation import Explicit, Implicit, Switching

TIMES = np.array([0.6, 1.0, 7.0])


class Oscillator:
    """``u'' + r u' + w^2 u = 0``, and how often its right-hand side and Jacobian were asked for."""

    def __init__(self, r: float, w: float) -> None:
        self.r, self.w = r, w
        self.calls = {"rhs": 0, "jac": 0}

    def rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        self.calls["rhs"] += 1
        return np.array([y[1], -self.r * y[1] - self.w**2 * y[0]])

    def jac(self, t: float, y: np.ndarray) -> np.ndarray:
        self.calls["jac"] += 1
        return np.array([[0.0, 1.0], [-(self.w**2), -self.r]])


def exact(t: np.ndarray, r: float, w: float) -> np.ndarray:
    """From u = 1, u' = 0 at t = 0.4."""
    s, v = t - 0.4, math.sqrt(w * w - 0.25 * r * r)
    fade = np.exp(-0.5 * r * s)
    u = fade * (np.cos(v * s) + 0.5 * r / v * np.sin(v * s))
    return np.stack([u, -fade * w * w / v * np.sin(v * s)], axis=1)


@pytest.mark.parametrize(
    ("solver", "off"), [(Explicit(), 1e-9), (Switching(), 1e-7), (Implicit(), 1e-6)]
)
def test_states_are_at_the_times_that_were_asked_for(solver, off: float) -> None:
    one = Oscillator(0.3, 1.7)
    found = solver.states(one.rhs, one.jac, 0.4, np.array([1.0, 0.0]), TIMES)
    assert found.shape == (3, 2)
    assert np.abs(found - exact(TIMES, 0.3, 1.7)).max() < off


@pytest.mark.parametrize("solver", [Implicit(), Switching()])
def test_a_jacobian_that_is_given_is_used_and_saves_differences(solver) -> None:
    given, none = Oscillator(2e4, 50.0), Oscillator(2e4, 50.0)
    start = np.array([1.0, 0.0])
    solver.states(given.rhs, given.jac, 0.4, start, TIMES)
    solver.states(none.rhs, None, 0.4, start, TIMES)
    assert given.calls["jac"] > 0
    assert given.calls["rhs"] < none.calls["rhs"]


def test_a_finer_tolerance_is_a_finer_solution() -> None:
    for kind in (Switching, Implicit):  # steps of `Explicit` are short by their cap
        off = []
        for tolerance in (1e-5, 1e-9):
            one = Oscillator(0.3, 1.7)
            found = kind(tolerance).states(one.rhs, one.jac, 0.4, np.array([1.0, 0.0]), TIMES)
            off.append(np.abs(found - exact(TIMES, 0.3, 1.7)).max())
        assert off[1] < 0.1 * off[0]


def test_a_solver_that_cannot_go_on_names_itself_and_what_else_there_is() -> None:
    """``y' = y^2`` from 1 at t = 0 has a pole at t = 1."""
    for solver, name in ((Explicit(), "dop853"), (Implicit(), "Radau")):
        with pytest.raises(NotConverged, match=rf"{name} cannot go on at t = .*Switching"):
            solver.states(lambda t, y: y * y, None, 0.0, np.array([1.0]), np.array([2.0]))
