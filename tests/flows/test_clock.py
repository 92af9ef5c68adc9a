"""Flows that a clock ends: a converter, switched on by a clock and off by its current."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import contbreather as cb
from contbreather.continuation.branches.switching import NothingToSwitch
from contbreather.errors import BadInput

from .zoo import CASES

pytestmark = pytest.mark.slow

PERIOD, TURN = 0.5, 2 * np.pi
ON = cb.Flow(lambda t, x, p: [1.0 + 0 * x[0]], until=lambda t, x, p: 1 - x[0])
OFF = cb.Flow(lambda t, x, p: [-p["b"] * x[0] ** 3], at=0)


def converter(b: float) -> cb.Problem:
    return cb.cycle([ON, OFF], {"i": 0.7}, {"b": b}, period=PERIOD, settle=30)


def stroke(i: float, b: float) -> float:
    """The current when the clock strikes, from that when it struck: on for 1 - i, off then."""
    return (1 + 2 * b * (PERIOD - 1 + i)) ** -0.5


def test_a_converter_doubles_its_period_where_its_map_does() -> None:
    """Its slope -b i^3 is -1 where i + i^3 = 2 (1 - PERIOD)."""
    branch = cb.trace(converter(1.2), "b", within={"b": (1, 5)})
    assert [point.kind for point in branch.special] == ["EP", "PD", "EP"]
    (i,) = (root.real for root in np.roots([1, 0, 1, -1]) if abs(root.imag) < 1e-9)
    assert branch.first("PD")["b"] == pytest.approx(i**-3, abs=1e-9)
    (arm,) = cb.switch(branch.first("PD"), within={"b": (3.01, 4)}, events=())
    orbit = arm[-1].solution
    assert orbit.period == pytest.approx(2 * PERIOD, abs=1e-12)
    low, high = sorted(flight.end[0] for flight in orbit.flights)[:2]
    assert high - low > 0.3
    assert stroke(low, arm[-1]["b"]) == pytest.approx(high, abs=1e-10)
    assert stroke(high, arm[-1]["b"]) == pytest.approx(low, abs=1e-10)


def test_a_clock_strikes_at_a_part_of_each_period_that_may_depend_on_parameters() -> None:
    wait = cb.Flow(lambda t, x, p: [1.0 + 0 * x[0]], at=lambda p: p["d"])
    rest = cb.Flow(lambda t, x, p: [-x[0]], at=0)
    run = cb.integrate([wait, rest], {"x": 0.0}, {"d": 0.25}, period=2.0, time=5.0)
    assert [event.time for event in run.events] == [0.5, 2.0, 2.5, 4.0, 4.5]
    problem = cb.cycle([wait, rest], {"x": 0.0}, {"d": 0.25}, period=2.0, settle=20)
    for point in cb.trace(problem, "d", within={"d": (0.1, 0.6)}, events=()):
        on, fade = 2 * point["d"], np.exp(2 * point["d"] - 2)
        assert point["max(x)"] == pytest.approx(on / (1 - fade), abs=1e-9)
        assert point.solution.multipliers == pytest.approx([fade], abs=1e-9)


def test_a_clock_without_a_period_and_beside_a_condition_is_refused() -> None:
    with pytest.raises(BadInput, match="period= was not given"):
        cb.cycle([ON, OFF], {"i": 0.7}, {"b": 1.0})
    with pytest.raises(BadInput, match="not by both"):
        cb.Flow(lambda t, x, p: [-x[0]], until=lambda t, x, p: x[0], at=0.5)
    with pytest.raises(BadInput, match="at"):
        cb.Flow(lambda t, x, p: [-x[0]], at="noon")
    kick = cb.Flow(lambda t, x, p: [-x[0]], at=0, reset=lambda t, x, p: x + 1)
    with pytest.raises(BadInput, match="a clock is no wall"):
        cb.Flow(ON.f, until=ON.until, walls=(kick,))


def test_what_only_the_period_ends_has_doubled_orbits() -> None:
    """The kicked rotor: (x, v) -> -(x, v) from one period to the next, with x = v (1 - exp(-d))/d
    of free motion, is -K sin x = 2 d coth(d/2) x."""
    flip = CASES["kicked rotor"].branch.first("PD")
    (arm,) = cb.switch(flip, within={"K": (-6, 0)}, events=())
    x = arm["max(x)"][1:]
    assert arm[-1]["K"] == -6
    assert -arm["K"][1:] * np.sin(x) == pytest.approx(0.6 / np.tanh(0.15) * x, rel=1e-8)


def test_a_map_at_each_stroke_has_its_double_multiplier() -> None:
    """Where its trace is -2 and its determinant 1: a companion matrix has one eigenvector there.
    The orbit rests in between, so that its mesh is all but free."""

    def turned(t, x, p):
        return [x[1], -p["D"] * x[0] + p["T"] * x[1] + 0.3 * x[0] ** 2]

    rest = cb.Flow(lambda t, x, p: [0 * x[0], 0 * x[0]], at=0, reset=turned)
    orbit = cb.cycle([rest], {"x": 0.0, "y": 0.0}, {"T": -1.0, "D": 0.5}, period=1.0, t0=0.5)
    flip = cb.trace(orbit, "T", within={"T": (-1.8, 0)}).first("PD")
    assert flip["T"] == pytest.approx(-1.5, abs=1e-9)
    line = cb.boundary(flip, ("D", "T"), within={"D": (0.4, 1.2)})
    assert [point.kind for point in line.special] == ["EP", "R2", "EP"]
    assert (line.first("R2")["D"], line.first("R2")["T"]) == pytest.approx((1, -2), abs=1e-9)
    assert not line.doubtful


def test_a_stroke_is_skipped_where_the_current_is_up_as_the_clock_strikes() -> None:
    """With i from 1/2 to 1 and back, each in one period: b = 3, met from both sides."""
    flip = cb.trace(converter(1.2), "b", within={"b": (1, 5)}).first("PD")
    (below,) = cb.switch(flip, within={"b": (1, 5)})
    skips = cb.cycle([ON, OFF], {"i": 0.7}, {"b": 5.0}, period=PERIOD, settle=300)
    above = cb.trace(skips, "b", within={"b": (1, 6)}, towards="both")
    # below, the current is also up again as it is
    for end, kinds in (below[-1], {"CC", "GR"}), (above[0], {"CC"}):
        assert end.kind in kinds
        assert end["b"] == pytest.approx(3, abs=1e-12)
    assert above["b"].max() == 6
    with pytest.raises(NothingToSwitch, match="in another order"):
        cb.switch(above[0])


def test_a_flow_that_ends_as_it_begins_is_met_and_followed_in_two_parameters() -> None:
    """A current that rises for d, falls at the rate c and rests at 0 until 1, for 1 - d - d/c; the
    curve ends where it rises up to 0.7."""
    full = (lambda t, x, p: 0.7 - x[0],)
    rise = cb.Flow(lambda t, x, p: [1.0 + 0 * x[0]], at=lambda p: p["d"], walls=full)
    fall = cb.Flow(lambda t, x, p: [-p["c"] + 0 * x[0]], until=lambda t, x, p: x[0])
    rest = cb.Flow(lambda t, x, p: [0 * x[0]], at=0)
    problem = cb.cycle([rise, fall, rest], {"i": 0.0}, {"c": 2.0, "d": 0.3}, period=1.0, settle=5)
    collides = cb.trace(problem, "d", within={"d": (0.1, 0.9)}).first("CC")
    assert collides["d"] == pytest.approx(2 / 3, abs=1e-12)
    curve = cb.boundary(collides, ("c", "d"), within={"c": (0.5, 4)})
    assert curve["d"] == pytest.approx(curve["c"] / (1 + curve["c"]), abs=1e-11)
    assert [point.kind for point in curve.special] == ["EP", "CC-GR"]
    assert [curve[0]["c"], curve[-1]["c"]] == pytest.approx([0.5, 7 / 3], abs=1e-9)


def test_beyond_a_border_collision_a_current_does_not_rest_or_does() -> None:
    """A smoothed voltage and a current that falls to 0 as the clock strikes: both ways lead on."""

    def field(on: float) -> Any:
        return lambda t, x, p: [on - x[1], x[0] - x[1] / p["R"]]

    fall = cb.Flow(field(0), until=lambda t, x, p: x[0])
    rest = cb.Flow(lambda t, x, p: [0 * x[0], -x[1] / p["R"]], at=0)
    start, span = {"i": 0.2, "v": 0.5}, {"R": (1, 8)}
    flows = cb.Flow(field(1), at=0.4), cb.Flow(field(0), at=0, walls=([fall, rest],))
    falls = cb.cycle(flows, start, {"R": 2.0}, period=1.0, settle=99)
    rests = cb.cycle([flows[0], fall, rest], start, {"R": 6.0}, period=1.0, settle=99)
    branches = [cb.trace(of, "R", within=span, towards="both") for of in (falls, rests)]
    ends = [branch.first(kind) for branch, kind in zip(branches, ("GR", "CC"), strict=True)]
    assert ends[0]["R"] == pytest.approx(ends[1]["R"], abs=1e-11)
    arms = [cb.switch(end, within=span)[0] for end in ends]
    for arm, branch, pieces in zip(arms, branches[::-1], (3, 2), strict=True):
        assert arm[0]["beyond"] == "persists"
        assert len(arm[-1].solution.flights) == pieces
        (same,) = (point for point in branch if point["R"] == arm[-1]["R"])
        assert arm[-1]["max(i)"] == pytest.approx(same["max(i)"], abs=1e-10)


def test_beyond_a_flow_that_a_reset_begins_is_not_known() -> None:
    """Half of an inverter's orbit: on for d, off up to 1/2, and the mirror image of that."""
    on = cb.Flow(lambda t, x, p: [1 - x[0]], at=lambda p: 2 * p["d"])
    off = cb.Flow(lambda t, x, p: [-x[0]], at=0, reset=lambda t, x, p: [-x[0]])
    inverter = cb.cycle([on, off], {"i": 0.0}, {"d": 0.3}, period=0.5, settle=30)
    never, always = cb.trace(inverter, "d", within={"d": (-0.2, 0.8)}, towards="both").special
    assert [never["d"], always["d"]] == pytest.approx([0, 0.5], abs=1e-12)
    with pytest.raises(NothingToSwitch, match="in another order"):
        cb.switch(never)
    (arm,) = cb.switch(always, within={"d": (-0.2, 0.8)})
    assert arm[-1]["max(i)"] == pytest.approx(np.tanh(0.25), abs=1e-9)


def test_a_tongue_of_a_kicked_rotor_is_walked_round_once() -> None:
    """Two kicks a turn, of the circle map: its folds are the extreme speeds over the angle."""

    def gained(speed: float, angle: float) -> float:
        for _ in range(2):
            angle += speed
            angle -= 0.9 * np.sin(angle)
        return angle

    def locked(angle: float) -> float:
        return brentq(lambda speed: gained(speed, angle) - angle - TURN, 2, 4, xtol=1e-14)

    def extreme(sign: int) -> float:
        near = min(np.linspace(0, TURN, 13), key=lambda angle: sign * locked(angle))
        within = near - 0.6, near + 0.6
        found = minimize_scalar(lambda of: sign * locked(of), bounds=within, method="bounded")
        return sign * found.fun

    free = cb.Flow(lambda t, x, p: [p["v"]], at=0, reset=lambda t, x, p: x - 0.9 * np.sin(x))
    rotor = cb.cycle(
        [free], {"angle": 0.1}, {"v": 3.1}, period=1.0, wraps={"angle": TURN}, settle=200
    )
    branch = cb.trace(rotor, "v", within={"v": (2, 4)})
    assert len(branch[0].solution.flights) == 2
    assert branch.stop.name == "CLOSED"
    assert [point.kind for point in branch.special] == ["LP", "LP"]
    folds = sorted(point["v"] for point in branch.special)
    assert folds == pytest.approx([extreme(1), extreme(-1)], abs=1e-9)


def test_a_map_of_straight_pieces_has_no_degenerate_doubling_of_its_own() -> None:
    """A current that rises to a ramp: its slope is -1 where fall and rise are as fast against that,
    and c is 0 all along but for what differences leave, as a remainder is not analytic."""
    up = lambda t, x, p: 1 - p["ramp"] * (t % 1.0) - x[0]  # noqa: E731
    rises = cb.Flow(lambda t, x, p: [1 - p["v"] + 0 * x[0]], until=up)
    falls = cb.Flow(lambda t, x, p: [-p["v"] + 0 * x[0]], at=0)
    flows, params = [rises, falls], {"v": 0.4, "ramp": 0.2}
    converter = cb.cycle(flows, {"i": 0.6}, params, period=1.0, settle=99)
    flip = cb.trace(converter, "v", within={"v": (0.3, 0.9)}).first("PD")
    line = cb.boundary(flip, ("ramp", "v"), within={"ramp": (0, 1), "v": (0.1, 0.9)})
    assert line["v"] == pytest.approx(0.5 + line["ramp"], abs=1e-11)
    assert {point.kind for point in line.special} == {"EP"}


def test_a_spike_that_is_forgotten_until_the_clock_strikes_has_no_fold_that_is_nan_off() -> None:
    fires = cb.Flow(lambda t, x, p: [p["I"] - x[0] + p["A"] * np.cos(2 * np.pi * t)],
                    until=lambda t, x, p: 1 - x[0], reset=lambda t, x, p: [0 * x[0]])  # fmt: skip
    waits = cb.Flow(lambda t, x, p: [0 * x[0]], at=0.5)
    neuron = cb.cycle([fires, waits], {"x": 0.2}, {"I": 1.9, "A": 0.6}, period=1.0, settle=50)
    late = cb.trace(neuron, "I", within={"I": (1.1, 2)}, towards="down").first("VI")
    line = cb.boundary(late, ("A", "I"), within={"A": (0, 2)})
    assert line.first("VI-GR")["I"] == pytest.approx(1 + line.first("VI-GR")["A"])  # x' = x'' = 0
    assert not any("nan" in point.detail["reason"] for point in line.doubtful)


def test_two_cells_that_fire_at_once_and_inhibit_each_other_go_on_in_no_order() -> None:
    """The second alone comes from 0 to 1 in ln 3, from 0.9 in ln 6/5: S1 = (31/30) (18/13)."""

    def both(t: Any, x: Any, p: Any) -> Any:
        return [p["S1"] - x[0], 1.5 - x[1]]

    one = cb.Flow(both, lambda t, x, p: 1 - x[0], lambda t, x, p: [0 * x[0], x[1] - 0.1])
    two = cb.Flow(both, lambda t, x, p: 1 - x[1], lambda t, x, p: [x[0] - 0.1, 0 * x[1]])
    flows = [one.walled([(two,)]), two.walled([(one,)])]
    mesh = cb.Collocation(intervals=3, points=4)
    cells = cb.cycle(flows, {"x": 0.7, "y": 0.0}, {"S1": 1.44}, settle=9, collocation=mesh)
    end = cb.trace(cells, "S1", within={"S1": (1.42, 1.45)}, towards="down").first("GR")
    assert end["S1"] == pytest.approx(93 / 65, rel=1e-9)
    with pytest.raises(NothingToSwitch, match="its reset moves the state as another flow ends"):
        cb.switch(end)
