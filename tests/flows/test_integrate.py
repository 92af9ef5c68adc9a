"""Runs from event to event beside closed forms, and the runs that are refused."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.algebra.newton import Undefined

BALL = cb.Flow(
    lambda t, x, p: [x[1], -1.0],
    until=lambda t, x, p: x[0],
    reset=lambda t, x, p: [x[0], -p["e"] * x[1]],
)


def test_an_oscillator_comes_back() -> None:
    run = cb.integrate(lambda t, x, p: [x[1], -x[0]], {"u": 1.0, "v": 0.0}, {}, periods=3)
    np.testing.assert_allclose(run.final, [1, 0], atol=1e-11)
    t = np.linspace(0, 6 * np.pi, 50)
    np.testing.assert_allclose(run(t), [np.cos(t), -np.sin(t)], atol=1e-10)
    assert run(1.0).shape == (2,)
    assert list(run.columns()) == ["t", "u", "v"]
    assert run.t.shape == run.x[0].shape


def test_a_falling_ball_rebounds_when_it_should() -> None:
    """From height 1/2: at 1, then after 2 e, 2 e^2, ..."""
    run = cb.integrate(BALL, [0.5, 0.0], {"e": 0.7}, events=8)
    times = 1 + 2 * np.cumsum([0, *0.7 ** np.arange(1.0, 8)])
    np.testing.assert_allclose([event.time for event in run.events], times, rtol=1e-13)
    np.testing.assert_allclose([event.rate for event in run.events], -(0.7 ** np.arange(8.0)))
    for event in run.events:
        np.testing.assert_allclose(event.after, [event.before[0], -0.7 * event.before[1]])
    assert len(run.pieces) == 8
    assert all(piece.ended for piece in run.pieces)
    np.testing.assert_array_equal(run(run.events[2].time), run.events[2].after)


def test_a_long_step_over_many_periods_of_a_condition_misses_no_crossing() -> None:
    """A constant speed needs one step only, the condition oscillates: 3 - t/10 - sin(40 t) > 0."""
    flow = cb.Flow(lambda t, x, p: [-0.1], until=lambda t, x, p: x[0] - np.sin(40 * t))
    run = cb.integrate(flow, [3.0], {}, events=1)
    t = np.linspace(0, 40, 4_000_001)
    g = 3 - 0.1 * t - np.sin(40 * t)
    assert run.events[0].time == pytest.approx(t[np.argmax(g <= 0)], abs=1e-4)


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9])
def test_a_shallow_dip_within_a_step_is_seen(depth: float) -> None:
    flow = cb.Flow(lambda t, x, p: [1.0], until=lambda t, x, p: (x[0] - 1) ** 2 - p["d"])
    run = cb.integrate(flow, [0.0], {"d": depth}, time=2.0, events=1)
    assert run.events[0].time == pytest.approx(1 - math.sqrt(depth), abs=1e-12)
    clear = cb.Flow(lambda t, x, p: [1.0], until=lambda t, x, p: (x[0] - 1) ** 2 + p["d"])
    assert not cb.integrate(clear, [0.0], {"d": depth}, time=2.0).events


@pytest.mark.parametrize("place", [0.97, 0.999, 1.0, 1.001, 1.003, 1.01])
def test_a_dip_beside_the_end_of_a_step_is_seen(place: float) -> None:
    """Steps of the integrator end wherever they do: the place of the dip is moved across."""
    flow = cb.Flow(lambda t, x, p: [1.0], until=lambda t, x, p: (x[0] - p["c"]) ** 2 - 1e-9)
    ends = cb.integrate(flow, [0.0], {"c": 1e3}, time=2.0).t
    for end in ends[1:-1]:
        run = cb.integrate(flow, [0.0], {"c": float(end) * place}, time=3.0, events=1)
        assert len(run.events) == 1


def test_flows_in_turn_may_differ_in_their_states() -> None:
    """A ball that becomes a clock for one unit of time, and falls again from where it was."""
    fall = cb.Flow(BALL.f, until=BALL.until, reset=lambda t, x, p: [1.0])
    wait = cb.Flow(
        lambda t, x, p: [-1.0], until=lambda t, x, p: x[0], reset=lambda t, x, p: [0.5, 0.0]
    )
    run = cb.integrate([fall, wait], [0.5, 0.0], {}, time=6.5)
    np.testing.assert_allclose([event.time for event in run.events], [1, 2, 3, 4, 5, 6], atol=1e-12)
    assert [piece.number for piece in run.pieces] == [0, 1, 0, 1, 0, 1, 0]
    assert run.flows[:2] == (fall, wait)
    with pytest.raises(cb.BadInput, match="differ in their number of states"):
        run.x  # noqa: B018


def test_the_start_may_lie_a_little_behind_if_it_is_on_its_way_inside() -> None:
    run = cb.integrate(BALL, [-0.01, 1.0], {"e": 0.5}, events=1)
    assert run.events[0].time == pytest.approx(1 + math.sqrt(1 - 0.02), abs=1e-12)


def test_a_period_may_depend_on_the_parameters() -> None:
    def f(t: Any, x: Any, p: Any) -> Any:
        return [np.cos(p["w"] * t)]

    run = cb.integrate(f, [0.0], {"w": 3.0}, periods=0.25, period=lambda p: 2 * np.pi / p["w"])
    assert run.pieces[-1].t[-1] == pytest.approx(np.pi / 6)
    assert run.final[0] == pytest.approx(1 / 3, abs=1e-12)


def test_late_a_ball_bounces_as_it_does_early() -> None:
    early, late = (cb.integrate(BALL, [0.5, 0.0], {"e": 0.9}, events=4, t0=t0) for t0 in (0, 1e6))
    assert late.final == pytest.approx(early.final, abs=1e-8)


def test_a_condition_is_as_exact_as_what_it_is_made_of() -> None:
    """A gap of a micrometre beside a pressure in pascal, which it does not know."""
    fall = cb.Flow(
        lambda t, x, p: [x[1], -1e-6, 0 * x[0]], until=lambda t, x, p: x[0],
        reset=lambda t, x, p: [x[0], -0.5 * x[1], x[2]],
    )  # fmt: skip
    run = cb.integrate(fall, {"x": 0.5e-6, "v": 0.0, "pressure": 1e7}, {}, time=2.3)
    assert [event.time for event in run.events] == pytest.approx([1.0, 2.0], abs=1e-12)


def test_a_condition_that_stays_zero_is_met_where_it_comes_to_it() -> None:
    empty = cb.Flow(lambda t, x, p: [-1.0], until=lambda t, x, p: np.maximum(x[0], 0.0))
    run = cb.integrate(empty, {"x": 100.0}, {}, events=1)
    assert run.events[0].time == pytest.approx(100.0, abs=1e-11)


@pytest.mark.parametrize("pace", [1e-12, 1e-5, 1e9])
def test_a_flight_is_waited_for_however_slow_it_is(pace: float) -> None:
    """From height 1/2 in 1 / pace."""
    fall = cb.Flow(lambda t, x, p: [pace * x[1], -pace], until=lambda t, x, p: x[0])
    run = cb.integrate(fall, [0.5, 0.0], {}, events=1)
    assert run.events[0].time * pace == pytest.approx(1, rel=1e-12)


def accumulating() -> Any:
    return cb.integrate(BALL, [0.5, 0.0], {"e": 0.5}, time=3.5)


def resetting_behind() -> Any:
    return cb.integrate(BALL, [0.5, 0.0], {"e": -0.5}, time=3.5)


def dropped(**other: Any) -> Any:
    return cb.integrate(replace(BALL, **other), [0.5, 0.0], {"e": 0.5}, time=3.5)


def moved(flow: Any) -> Any:
    return cb.integrate(flow, [1.0], {}, time=5)


def relayed(h: Any) -> Any:
    relay = cb.Filippov(lambda t, x, p: [-1.0], lambda t, x, p: [1.0], h)
    return cb.integrate(relay, [1.0], {}, time=2.0)


@pytest.mark.parametrize(
    ("run", "error", "sentence"),
    [
        (accumulating, cb.NotConverged, r"accumulate before t = 2\.99"),
        (resetting_behind, cb.BadInput, "at t = 1 lies behind until"),
        (lambda: cb.integrate(BALL, [-0.5, 0], {"e": 1}, time=1), cb.BadInput, "or the reset"),
        *(
            (partial(dropped, until=until), cb.BadInput, r"in jumps .* floor\(x\[0\]\) give x\[0\]")
            for until in (lambda t, x, p: np.sign(x[0]), lambda t, x, p: np.floor(x[0]),
                          lambda t, x, p: np.where(x[0] > 0, 1.0, -1.0))
        ),
        (lambda: cb.integrate(BALL, [0.5, 0], {"e": 1}, time=9, steps=9), cb.NotConverged, "time="),
        (lambda: cb.integrate(BALL, [0.5, 0], {"e": 1}, time=1, method="RK5"), cb.BadInput, "BDF"),
        (lambda: cb.integrate(BALL, [0.5, 0], {"e": 1}), cb.BadInput, "say how far to go"),
        (lambda: cb.integrate(BALL, [0.5, 0], {"e": 1}, time=1, periods=1), cb.BadInput, "how far"),
        (lambda: cb.integrate(BALL, [0.5], {"e": 1}, time=1), cb.BadInput, "IndexError"),
        (lambda: dropped(reset=lambda t, x, p: [x[0]]), cb.BadInput, "reset of flow 0 lands, f"),
        (lambda: dropped(walls=lambda t, x, p: x[0] - 1), cb.BadInput, r"behind walls\[0\], or"),
        (lambda: relayed(lambda x: x[0]), cb.BadInput, "h raises TypeError"),
        (lambda: moved([cb.Filippov(BALL.f, BALL.f, BALL.until)]), cb.BadInput, "not in a list"),
        (lambda: relayed(lambda t, x, p: [x[0], 1.0]), cb.BadInput, "h returns shape"),
        (lambda: cb.integrate(BALL, [0.5, 0.0], {}, time=1), cb.BadInput, "parameter 'e'"),
        (lambda: cb.integrate([], [0.5], {}, time=1), cb.BadInput, "list of Flow"),
        (lambda: cb.integrate(BALL, [0.5, 0], {"e": 1}, time=1, first=1), cb.BadInput, "1 flows"),
        (lambda: cb.integrate(lambda t, x, p: [1.0], [0], {}, events=2), cb.BadInput, "`until`"),
        (lambda: moved(lambda t, x, p: [x[0] ** 2]), cb.NotConverged, "the solution ends at t = 1"),
        (lambda: moved(lambda t, x, p: [-math.sqrt(x[0])]), Undefined, "raised ValueError: .*, at"),
        (lambda: moved(cb.Flow(lambda t, x, p: [-1.0], walls=(lambda t, x, p: x[0],))),
         cb.NotConverged, r"walls\[0\] of flow 0 is zero at t = 1"),
        (lambda: cb.integrate(cb.Flow(lambda t, x, p: [1.0], until=lambda t, x, p: x[0]), [1.0], {},
                              events=1),
         cb.NotConverged, r"was not met within \S+ from t = 0, x = \[1.0\], in \d\d steps: a"),
        (lambda: cb.integrate(cb.Flow(lambda t, x, p: 1 - x, until=lambda t, x, p: 2 - x[0]), [0.0],
                              {}, events=1, method="Radau"),
         cb.NotConverged, r"in \d+ steps: it has come to rest at x = \[\S+\]; start elsewhere"),
    ],
)  # fmt: skip
def test_what_cannot_be_followed_is_refused_with_a_sentence(run, error, sentence):
    with pytest.raises(error, match=sentence):
        run()


def test_times_outside_of_a_run_are_refused() -> None:
    run = cb.integrate(BALL, [0.5, 0.0], {"e": 0.7}, time=1.5)
    with pytest.raises(cb.BadInput, match=r"from t = 0 to 1\.5"):
        run(2.0)
    assert "1 events" in repr(run)
    assert dict(run.table().rows)["events"] == 1


@pytest.mark.slow
def test_a_block_that_topples_is_refused_as_what_grows_without_bound() -> None:
    topples = cb.Flow(
        lambda t, x, p: [x[1], x[0] - 1 + 4 * np.cos(4 * t)],
        until=lambda t, x, p: x[0],
        reset=lambda t, x, p: [x[0], -0.9 * x[1]],
    )
    with pytest.raises(cb.NotConverged, match="grows without bound"):
        cb.integrate(topples, {"tilt": 0.0, "v": 2.0}, {}, events=30)


@pytest.mark.slow
@pytest.mark.parametrize("times", [0.7, 3.0, 5.0])
def test_a_wall_that_is_zero_where_a_condition_is_does_not_end_a_run(times: float) -> None:
    """Rounding decides which of both is zero first."""

    def rises(t: Any, x: Any, p: Any) -> Any:
        return [2 - 0.2 * x[0], x[0] - x[1]]

    def falls(t: Any, x: Any, p: Any) -> Any:
        return [-0.2 * x[0] - x[1], x[0] - x[1]]

    def between(t: Any, x: Any, p: Any) -> Any:
        return times * (1.1 - x[0]) * (x[0] - 0.4)

    relay = [
        cb.Flow(rises, until=lambda t, x, p: 1.1 - x[0], walls=between),
        cb.Flow(falls, until=lambda t, x, p: x[0] - 0.4, walls=between),
    ]
    assert len(cb.integrate(relay, {"i": 0.5, "v": 0.3}, {}, time=50).events) > 50
