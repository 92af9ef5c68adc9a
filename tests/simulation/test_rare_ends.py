"""Ends that hardly ever come: of runs, of files under way, of workers; each a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import NotConverged
from contbreather.simulation import (
    RunStop,
    State,
    periodic,
    simulate,
    simulate_smooth,
)
from contbreather.simulation.integrator import EventDriven, in_chunks

HERE: dict[str, Any] = {"a": 0.2, "gamma": 0.04, "k": 0.8}
STATE = cb.symmetric(**HERE).state(4)


# --- runs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("status", "sentence"),
    [
        ("WILD", r"the motion blows up in period 0 \(a = 0\.2, k = 0\.8"),
        ("ASTRAY", r"in period 0 the search .* please report it"),
    ],
)
def test_a_run_that_the_loops_give_up_is_an_error(monkeypatch, status, sentence) -> None:
    from contbreather.simulation import event_loop, integrator

    def give_up(*given: Any) -> None:
        given[-1][:] = 0, getattr(event_loop, status), 0

    monkeypatch.setattr(integrator, "EVENT_LOOP", give_up)
    with pytest.raises(NotConverged, match=sentence):
        simulate(STATE, **HERE, periods=2)


def test_a_run_that_ends_in_its_first_chunk_ends_where_it_began(monkeypatch) -> None:
    monkeypatch.setattr("contbreather.simulation.integrator.MOST", 500)
    fast = {"a": 0.5, "gamma": 0.0, "k": 1.0}
    for periods in (3, 0.5, 1.5):
        run = simulate(([0.1], [1e3]), periods=periods, t0=0.3, **fast)
        assert run.stop is RunStop.CHATTER
        assert (run.periods, run.end) == (0, 0.3)
        assert (run.final.u[0], run.final.v[0]) == (0.1, 1e3)
        assert repr(run).startswith("<Run of 1 sites over 0 periods: ")
        assert run.reason in repr(run)


@pytest.mark.parametrize(("room", "most"), [(1, 1), (16, 2), (17, 2), (32, 4), (7, 1)])
def test_a_chunk_holds_what_has_room_and_a_period_at_least(monkeypatch, room, most) -> None:
    """Of four sites a period has eight numbers."""
    monkeypatch.setattr("contbreather.simulation.integrator.CHUNK", room)
    conditions = simulate(STATE, **HERE, periods=0).conditions
    start = State(*(np.array(x) for x in STATE))
    ahead = in_chunks(EventDriven(start, conditions, 0.0), periods=13, progress=False)
    first, *lengths = [one.periods for one in ahead]  # how long a period takes is seen on the first
    assert first + sum(lengths) == 13
    assert max(lengths) == most


def test_where_the_ring_does_not_go_on_a_branch_of_its_motions_ends(monkeypatch) -> None:
    shared = {**HERE, "damping": 0.05}
    own = periodic(simulate(STATE, **shared, periods=60).final, **shared)
    problem = own.problem
    monkeypatch.setattr("contbreather.simulation.integrator.MOST", 0)  # half a period has one
    with pytest.raises(ArithmeticError, match="has more than 0 impacts in period 0"):
        problem.residual(np.concatenate(own.state) + 1e-9, problem.params)
    monkeypatch.undo()
    off = problem.residual(np.concatenate(own.state), problem.params)
    assert np.abs(off).max() < 1e-9


# --- smooth runs ----------------------------------------------------------------------------------


def test_a_smooth_motion_that_blows_up_is_no_equation_to_the_engine() -> None:
    state = simulate_smooth(STATE, **HERE, m=6, damping=0.1, periods=100).final
    problem = periodic(state, **HERE, m=6, damping=0.1).problem

    backwards = {**problem.params, "damping": -1e4}  # amplifies by exp(1e4) in a unit of time
    with pytest.raises(ArithmeticError, match="dop853 cannot go on at t = "):
        problem.residual(np.concatenate(state), backwards)
