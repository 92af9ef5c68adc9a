"""How much work a point of a branch of cycles is: functions of Python, and calls of the field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.flows import Collocation, collocation
from contbreather.flows.multipliers import multipliers

from ..effort import functions_called

TEN_BY_EIGHT = Collocation(intervals=10, points=8)


class Lorenz:
    def __init__(self) -> None:
        self.asked = 0

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        self.asked += 1
        return [p["s"] * (x[1] - x[0]), x[0] * (p["r"] - x[2]) - x[1], x[0] * x[1] - p["b"] * x[2]]


@pytest.fixture(scope="module")
def field() -> Lorenz:
    return Lorenz()


@pytest.fixture(scope="module")
def ring(field) -> cb.Problem:
    start, params = {"x": 0.0, "y": 10.0, "z": 280.0}, {"r": 280.0, "s": 10.0, "b": 8 / 3}
    ring = cb.cycle(field, start, params, settle=20.0, collocation=TEN_BY_EIGHT)
    cb.trace(ring, "r", steps=cb.Steps(most=3))  # what is imported and made once is not counted
    return ring


def a_point(field: Lorenz, walk: Callable[[], cb.Branch]) -> tuple[float, float]:
    """Functions of Python and calls of the field for each point of a branch."""
    branches: list[cb.Branch] = []
    before = field.asked
    functions = functions_called(lambda: branches.append(walk()))
    count = len(branches[0])
    return functions / count, (field.asked - before) / count


def test_a_point_of_a_branch_takes_few_calls(field, ring) -> None:
    """All of them: of the start, of five events, and of locating and judging a period doubling."""
    walk = lambda: cb.trace(ring, "r", within={"r": (200.0, 281.0)}, towards="down")  # noqa: E731
    assert [point.kind for point in walk().special] == ["EP", "PD", "EP"]
    functions, asked = a_point(field, walk)
    assert functions < 600
    assert asked < 8


@pytest.mark.slow
def test_short_steps_take_fewer(field, ring) -> None:
    """Where nothing happens: two residuals, one of them exact, the check between, and a derivative
    by one call of the field each; and a look at what the mesh may leave."""
    short = cb.Steps(largest=0.01)
    functions, asked = a_point(
        field,
        lambda: cb.trace(ring, "r", within={"r": (276.0, 281.0)}, towards="down", steps=short),
    )
    assert functions < 475
    assert asked < 4.1


@pytest.mark.slow
def test_a_point_of_a_curve_of_period_doublings_takes_few_calls(field, ring) -> None:
    doubling = cb.trace(ring, "r", within={"r": (225.0, 281.0)}, towards="down").first("PD")
    functions, asked = a_point(
        field, lambda: cb.boundary(doubling, ("r", "s"), within={"s": (9.0, 11.0)})
    )
    assert functions < 2000
    assert asked < 25


def test_columns_of_a_branch_are_there_when_it_is(field, ring) -> None:
    """A picture asks the field for nothing; what it shows is what the orbits have when they are
    solved for anew."""
    branch = cb.trace(ring, "r", within={"r": (270.0, 281.0)}, towards="down")
    before = field.asked
    columns = {name: branch[name] for name in ("unstable", "trivial", "max(x)", "min(z)")}
    assert field.asked == before
    for i in (0, len(branch) // 2, -1):
        problem = branch[i].problem  # on a curve of its own, by equations that know no orbit yet
        orbit = cb.flows.cycle_of(replace(problem, residual=replace(problem.residual)))
        assert field.asked > before
        assert columns["unstable"][i] == orbit.unstable
        assert columns["max(x)"][i] == pytest.approx(orbit.max["x"], rel=1e-12)
        assert columns["min(z)"][i] == pytest.approx(orbit.min["z"], rel=1e-12)
        assert columns["trivial"][i] == pytest.approx(abs(orbit.trivial - 1), abs=1e-10)


def test_many_multipliers_far_apart_settle_in_a_few_rounds(monkeypatch) -> None:
    """Those of 40 factors Q D Q* around an orbit are D^40, in groups of ten, down to e^-120.
    Directions of 90 states are told apart to less than those of three, by rounding."""
    random, states = np.random.default_rng(1), 90
    turns = np.linalg.qr(random.normal(size=(40, states, states)))[0]
    decay = -np.maximum(np.arange(states) // 10 - 2, 0) / 2
    factors = np.roll(turns, -1, axis=0) * np.exp(decay) @ turns.transpose(0, 2, 1)
    rounds, qr = [], np.linalg.qr
    monkeypatch.setattr(np.linalg, "qr", lambda matrix: rounds.append(matrix) or qr(matrix))
    assert np.log(multipliers([factors]).real) == pytest.approx(40 * decay, abs=1e-9)
    assert len(rounds) <= 2 * len(factors)


def test_equations_of_many_states_are_not_copied_between_layouts(monkeypatch) -> None:
    """Whatever the order in which derivatives come: of 100 states a copy takes 40 ms for 10."""
    layouts = []
    equations = collocation._equations
    monkeypatch.setattr(
        collocation, "_equations",
        lambda *given: layouts.append((made := equations(*given)).flags.c_contiguous) or made,
    )  # fmt: skip
    flow, w = cb.Flow(lambda t, x, p: np.roll(x, 1, axis=0) - x**3), np.arange(6.0)[:, None]
    flight = collocation.fitted(Collocation(intervals=4), 0.0, 1.0, lambda t: np.sin(t + w))
    collocation.derivatives(flow, flight, flight.slopes, {})
    assert layouts == [True]
