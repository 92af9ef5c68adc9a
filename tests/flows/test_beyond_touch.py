"""Cycles beyond GR: the flows that follow, what becomes of the orbit, and the way back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.branches.duplicates import Duplicate, ending_at

from .test_beyond_impact import misses
from .zoo import across, van_der_pol

pytestmark = pytest.mark.slow

TAU = 2 * np.pi
WITHIN = {"w": (0.5, 2.0)}


def free(t: Any, x: Any, p: Any) -> Any:
    return [x[1], -x[0] - 0.1 * x[1] + 0.5 * np.cos(p["w"] * t)]


def stopped(t: Any, x: Any, p: Any) -> Any:
    return [x[1], free(t, x, p)[1] - 20 * (x[0] - 1)]


@pytest.fixture(scope="module")
def resonance() -> cb.Branch:
    flows = [
        cb.Flow(free, until=lambda t, x, p: 1 - x[0]),
        cb.Flow(stopped, until=lambda t, x, p: x[0] - 1),
    ]
    orbit = cb.cycle(
        flows, {"x": 0.0, "v": 0.0}, {"w": 0.8}, period=lambda p: TAU / p["w"], settle=200
    )
    return cb.trace(orbit, "w", within=WITHIN, events=())  # GR ends it


def grazings(branch: cb.Branch) -> Iterator[cb.Point]:
    return (point for point in branch.special if point.kind == "GR" and point.parent is None)


@pytest.fixture(scope="module")
def touches(resonance: cb.Branch) -> list[tuple[cb.Point, cb.Branch]]:
    """Each place where contacts come to the curve, and the branch that sets out there."""
    return [(end, *cb.switch(end, within=WITHIN)) for end in grazings(resonance)]


def whole(branch: cb.Branch, touches: list[tuple[cb.Point, cb.Branch]]) -> list[cb.Branch]:
    """All branches that are reached through GR, each place taken once."""
    branches = [branch, *(arm for _, arm in touches)]
    places = [end["w"] for end, _ in touches]
    ends = [end for _, arm in touches for end in grazings(arm)]
    while ends:
        end = ends.pop()
        if any(abs(end["w"] - w) < 1e-8 for w in places):
            continue
        places.append(end["w"])
        (arm,) = cb.switch(end, within=WITHIN)
        branches.append(arm)
        ends += grazings(arm)
    return branches


def test_a_resonance_curve_goes_on_at_each_touch(resonance: cb.Branch, touches) -> None:
    branches = whole(resonance, touches)
    assert {len(branch[1].solution.flights) for branch in branches} == {2, 4}
    for branch in branches:
        assert branch.stop.name == "EVENT"
        # the integrator of the test sees contacts that last longer than one of its steps
        orbits = [at.solution for at in branch if at.solution.durations.min() > 0.04]
        assert orbits
        assert max(map(misses, orbits[::12])) < 1e-9


def test_contact_without_a_jump_of_the_force_leaves_the_orbit_where_it_was(touches) -> None:
    for end, arm in touches:
        assert (arm[0]["beyond"], arm[0].parent) == ("persists", end)
        # beyond the touch in the parameter, and the orbit changes by the cube of the contact
        assert (arm[1]["w"] - end["w"]) * (end["w"] - 0.8) > 0
        assert arm[0]["max(x)"] == pytest.approx(end["max(x)"], rel=1e-8)


def test_the_way_back_leads_to_the_same_orbits(resonance: cb.Branch, touches) -> None:
    for end, arm in touches:
        towards = "up" if end["w"] < 0.8 else "down"
        there = cb.trace(arm[3].problem, "w", towards=towards, within=WITHIN, events=())
        shrunk = there.special[-1]
        assert (shrunk.kind, shrunk["w"]) == ("GR", pytest.approx(end["w"], rel=1e-9))
        window = sorted((1.1 * end["w"] - 0.08, 0.8))
        (back,) = cb.switch(shrunk, within={"w": window})
        assert back[0]["beyond"] == "persists"
        assert back[0]["w"] == pytest.approx(end["w"], rel=1e-9)
        assert back[-1]["w"] == 0.8
        assert back[-1]["max(x)"] == pytest.approx(
            next(at["max(x)"] for at in resonance if at["w"] == 0.8), rel=1e-9
        )


@pytest.mark.parametrize(
    ("jump", "w", "beyond"), [(0.0, 1.0, "persists"), (0.05, 0.9, "persists"), (0.05, 1.1, "fold")]
)
def test_the_last_contact_leaves_the_linear_motion(jump: float, w: float, beyond: str) -> None:
    def sine(t: Any, x: Any, p: Any) -> Any:
        return [x[1], -0.1 * x[1] - x[0] + p["F"] * np.cos(p["w"] * t) + 0.2]

    def pressed(t: Any, x: Any, p: Any) -> Any:
        return [x[1], sine(t, x, p)[1] - 8 * (x[0] - 1) - jump]

    flows = [
        cb.Flow(sine, until=lambda t, x, p: 1 - x[0]),
        cb.Flow(pressed, until=lambda t, x, p: x[0] - 1),
    ]
    rest, params = {"x": 0.0, "v": 0.0}, {"F": 0.6, "w": w}
    orbit = cb.cycle(flows, rest, params, period=lambda p: TAU / p["w"], settle=150)
    contacts = cb.trace(orbit, "F", within={"F": (0.02, 3)}, towards="down")
    shrunk = contacts.special[-1]
    number = shrunk.detail["flow"]
    assert contacts.reason == f"flow {number} shrinks to nothing, it begins at a tangency"
    assert shrunk.solution.equations.flows[number].f is pressed
    (arm,) = cb.switch(shrunk, within={"F": (0.02, 1)})
    gain = 1 / abs(1 - w * w + 0.1j * w)
    assert arm[0]["F"] == pytest.approx(0.8 / gain, rel=1e-9)
    assert [at["max(x)"] for at in arm] == pytest.approx([0.2 + gain * at["F"] for at in arm])
    # which is on the side of the contacts where these have turned back before they vanish
    assert arm[0]["beyond"] == beyond
    assert (shrunk["F"] < contacts[-2]["F"]) == (beyond == "persists")
    assert arm[-1]["F"] == 0.02
    if not jump:  # and where it reaches the stop at other frequencies
        curve = cb.boundary(shrunk, ("w", "F"), within={"w": (0.95, 1.05)})
        assert (contacts.doubtful, curve.stop.name) == ((), "BOUND")
        reached = 0.8 * abs(1 - curve["w"] ** 2 + 0.1j * curve["w"])
        np.testing.assert_allclose(curve["F"], reached, atol=1e-9)


def test_a_branch_is_known_from_its_other_end(resonance: cb.Branch, touches) -> None:
    """Its first flow and its mesh may be others there: the orbits are the same."""
    _, arm = min(touches, key=lambda pair: pair[0]["w"])
    far = next(grazings(arm))
    (less,) = cb.switch(far, within=WITHIN)
    towards = "up" if far["w"] > less[2]["w"] else "down"
    end = cb.trace(less[2].problem, "w", within=WITHIN, towards=towards, events=()).special[-1]
    assert (end.kind, end["w"]) == ("GR", pytest.approx(far["w"], rel=1e-9))
    (again,) = cb.switch(end, within=WITHIN, steps=cb.Steps(most=1))
    assert ending_at(again[0], [resonance, less, arm]) == Duplicate(2)
    assert ending_at(again[0], [resonance]) is None


def test_a_wall_leads_to_no_flow() -> None:
    wall = cb.Flow(free, walls=(lambda t, x, p: 1 - x[0],))
    orbit = cb.cycle(
        wall, {"x": 0.0, "v": 0.0}, {"w": 2.0}, period=lambda p: TAU / p["w"], settle=200
    )
    branch = cb.trace(orbit, "w", within={"w": (0.5, 2.5)}, towards="down", events=())
    with pytest.raises(cb.BadInput, match="give the wall as the flow that ends there"):
        cb.switch(branch.first("GR"))


@pytest.mark.parametrize(("settle", "first"), [(150, "sine"), (151, "pressed")])
def test_contacts_come_and_go_where_the_phase_is_an_angle(settle: float, first: str) -> None:
    def sine(t: Any, x: Any, p: Any) -> Any:
        return [x[1], -0.1 * x[1] - x[0] + p["F"] * np.cos(x[2]), 1 + 0 * x[0]]

    def pressed(t: Any, x: Any, p: Any) -> Any:
        return [x[1], sine(t, x, p)[1] - 8 * (x[0] - 0.8), 1 + 0 * x[0]]

    flows = [
        cb.Flow(sine, until=lambda t, x, p: 0.8 - x[0]),
        cb.Flow(pressed, until=lambda t, x, p: x[0] - 0.8),
    ]
    start, window = {"x": 0.0, "v": 0.0, "angle": 0.0}, {"F": (0.02, 0.7)}
    orbit = cb.cycle(flows, start, {"F": 0.6}, wraps={"angle": TAU}, settle=settle)
    assert orbit.residual.flows[0].f.__name__ == first  # the turn is taken back after the other
    shrunk, apart = across(orbit, "F", "GR", window, towards="down")
    assert shrunk["F"] == pytest.approx(0.08, rel=1e-9)
    assert [at["max(x)"] for at in apart] == pytest.approx([10 * at["F"] for at in apart])
    _, again = across(apart[-1].problem, "F", "GR", {"F": (0.02, 0.6)}, towards="up")
    assert again[-1]["max(x)"] == pytest.approx(cb.flows.cycle_of(orbit).max["x"], rel=1e-9)


def test_a_rotation_meets_its_stop_and_leaves_it() -> None:
    def pendulum(t: Any, x: Any, p: Any) -> Any:
        return [x[1], p["torque"] - 0.3 * x[1] - np.sin(x[0])]

    def braked(t: Any, x: Any, p: Any) -> Any:
        return [x[1], pendulum(t, x, p)[1] - 2 * (x[1] - 3)]

    brakes = (
        cb.Flow(pendulum, until=lambda t, x, p: 3 - x[1]),
        cb.Flow(braked, until=lambda t, x, p: x[1] - 3),
    )
    start, window = {"theta": 0.0, "v": 2.0}, {"torque": (0.7, 1.0)}
    over = cb.Flow(pendulum, walls=(brakes,))
    orbit = cb.cycle(over, start, {"torque": 0.75}, wraps={"theta": TAU}, settle=80)
    touched, slower = across(orbit, "torque", "GR", window, towards="up")
    assert touched["max(v)"] == pytest.approx(3.0, rel=1e-9)
    assert slower[0]["beyond"] == "persists"
    last = slower[-1].solution
    assert last.flights[-1].end - last.flights[0].states[0] == pytest.approx([TAU, 0.0], abs=1e-9)
    found = cb.cycle(brakes, start, {"torque": 1.0}, wraps={"theta": TAU}, settle=80)
    assert last.period == pytest.approx(cb.flows.cycle_of(found).period, rel=1e-9)


def test_a_heater_that_comes_on_stays_on_so_that_no_orbit_goes_over() -> None:
    def room(heat: float) -> Any:
        return lambda t, x, p: [heat - x[0] + p["A"] * np.cos(20 * t)]

    flows = [
        cb.Flow(room(2.5), until=lambda t, x, p: 1.1 - x[0]),
        cb.Flow(room(0.0), until=lambda t, x, p: x[0] - 0.9),
    ]
    start, within = {"T": 1.0}, {"A": (0.1, 3.0)}
    orbit = cb.cycle(flows, start, {"A": 0.3}, period=TAU / 20, settle=60)
    touched = cb.trace(orbit, "A", within=within, events=()).first("GR")
    with pytest.raises(cb.BadInput, match="or the flow that follows goes on"):
        cb.switch(touched, within=within)


def test_an_orbit_clear_of_its_condition_is_one_of_a_flow_with_that_wall() -> None:
    """Van der Pol's oscillator between whose orbit and a stop there is room: GR is where the stop
    is at its amplitude."""
    stop = cb.Flow(
        van_der_pol, until=lambda t, x, p: p["w"] - x[0], reset=lambda t, x, p: [x[0], -0.8 * x[1]]
    )
    start, window = {"x": 0.1, "v": 0.0}, {"w": (1.9, 4)}
    clear = cb.cycle([stop], start, {"mu": 1.0, "w": 3.0})
    free = cb.flows.cycle_of(cb.cycle(van_der_pol, start, {"mu": 1.0}))
    touched, hits = across(clear, "w", "GR", window)
    assert touched["w"] == pytest.approx(free.max["x"], rel=1e-8)
    assert touched["period"] == pytest.approx(free.period, rel=1e-8)
    found = cb.cycle([stop], start, {"mu": 1.0, "w": hits[-1]["w"]}, settle=30)
    assert hits[-1]["period"] == pytest.approx(cb.flows.cycle_of(found).period, rel=1e-8)


def test_a_contact_begins_and_another_one_where_two_crests_are_alike() -> None:
    """What follows cos 2t + b cos t reaches r/sqrt(r^2 + 4) twice where b = 0: the curves on which
    one crest comes to the stop end there, whether the other one is in contact or not."""

    def follows(t: Any, x: Any, p: Any) -> Any:
        return [20 * (np.cos(2 * t) + p["b"] * np.cos(t) - x[0])]

    def pressed(t: Any, x: Any, p: Any) -> Any:
        return [follows(t, x, p)[0] - 5 * (x[0] - p["h"])]

    touches = cb.Flow(follows, until=lambda t, x, p: p["h"] - x[0])
    stop = [touches, cb.Flow(pressed, until=lambda t, x, p: x[0] - p["h"])]
    orbit = cb.cycle(stop, {"x": 0.0}, {"b": 0.3, "h": 1.0}, period=TAU, settle=30)
    window = {"b": (-1, 1), "h": (0, 3)}
    comes, goes = grazings(cb.trace(orbit, "h", within=window))
    for end in (comes, goes):
        met = cb.boundary(end, ("b", "h"), within=window).first("GR-GR")
        assert [met["b"], met["h"]] == pytest.approx([0.0, 20 / np.hypot(20, 2)], abs=1e-9)


@pytest.mark.parametrize("times", [None, 2.0])
def test_a_wall_that_ends_its_flow_anyway_is_no_touch_of_its_own(
    resonance: cb.Branch, times: float | None
) -> None:
    """All conditions are walls of each flow, the same functions or twice as large: contacts come
    where they do without, and what follows is known."""

    def gap(t: Any, x: Any, p: Any) -> Any:
        return 1 - x[0]

    def depth(t: Any, x: Any, p: Any) -> Any:
        return x[0] - 1

    walls = [
        condition if times is None else lambda t, x, p, of=condition: times * of(t, x, p)
        for condition in (gap, depth)
    ]
    flows = [cb.Flow(free, gap, walls=walls[:1]), cb.Flow(stopped, depth, walls=walls[1:])]
    orbit = cb.cycle(
        flows, {"x": 0.0, "v": 0.0}, {"w": 0.8}, period=lambda p: TAU / p["w"], settle=200
    )
    branch = cb.trace(orbit, "w", within=WITHIN)
    places = [end["w"] for end in grazings(branch)]
    assert places == pytest.approx([end["w"] for end in grazings(resonance)], abs=1e-9)
    (beyond,) = cb.switch(branch.first("GR"), within=WITHIN)
    assert beyond[0]["beyond"] == "persists"


def test_a_wall_that_is_zero_where_a_condition_of_small_numbers_is_does_not_end_a_branch() -> None:
    def falls(t: Any, x: Any, p: Any) -> Any:
        return [x[1], -0.1 * x[1] - 4 * (x[0] - 1.2) + p["F"] * np.cos(t)]

    def traced(*walls: Any) -> list[float]:
        flow = cb.Flow(
            falls,
            until=lambda t, x, p: 0.01 * x[0],
            reset=lambda t, x, p: [x[0], -0.7 * x[1]],
            walls=walls,
        )
        orbit = cb.cycle(flow, {"x": 0.5, "v": 0.0}, {"F": 4.5}, period=TAU, settle=150)
        return [point["F"] for point in cb.trace(orbit, "F", within={"F": (4.0, 8.0)}).special]

    assert traced(lambda t, x, p: x[0]) == pytest.approx(traced(), abs=1e-9)


def test_a_runner_whose_leg_lands_at_full_length_touches_nothing_there() -> None:
    """The reset forgets the state and lands on the condition of the flow that follows, whatever the
    parameters: derivatives cancel. PD is where the return map, integrated by scipy, has -1."""

    def leg(t: Any, x: Any, p: Any) -> Any:
        length = np.sqrt(x[0] ** 2 + x[1] ** 2)
        return [x[2], x[3], 20 * x[0] * (1 / length - 1), 20 * x[1] * (1 / length - 1) - 1]

    def lands(t: Any, x: Any, p: Any) -> Any:
        angle = p["angle"]
        faster = np.sqrt(2 * (2.3 - np.sin(angle)) / (x[2] ** 2 + x[3] ** 2))
        return [-np.cos(angle), np.sin(angle), faster * x[2], faster * x[3]]

    stance = cb.Flow(leg, until=lambda t, x, p: 1 - x[0] ** 2 - x[1] ** 2)
    flight = cb.Flow(
        lambda t, x, p: [x[2], x[3], 0.0, -1.0],
        until=lambda t, x, p: x[1] - np.sin(p["angle"]),
        reset=lands,
        ignore=0.1,
    )
    start = {"x": -0.4387, "y": 0.8986, "u": 1.6661, "v": -0.1672}
    runner = cb.cycle([stance, flight], start, {"angle": 1.117})
    branch = cb.trace(runner, "angle", within={"angle": (1.117, 1.16)})
    assert [point.kind for point in branch.special] == ["EP", "PD", "EP"]
    assert branch.first("PD")["angle"] == pytest.approx(1.14945514, abs=1e-8)


def test_a_curve_of_two_conditions_at_once_ends_where_one_of_them_is_only_just_reached() -> None:
    """Vocal folds of two masses, which close both (Steinecke and Herzel 1995): it ended 1.4e-3 of
    the pressure before, as CC-GR. Shot by scipy, without the flows that last no time."""

    def folds(push: Any, below: float = 0.0, above: float = 0.0) -> Any:
        def f(t: Any, x: Any, p: Any) -> Any:
            areas, pull = 0.05 / 2.8 + x[::2], 0.02 * x[1::2] + 0.025 * (x[::2] - x[2::-2])
            lower = 0.35 * p["Ps"] * push(areas) - 0.24 * below * areas[0] - 0.08 * x[0]
            upper = -0.024 * above * areas[1] - p["k"] * x[2]
            return [x[1], (lower - pull[0]) / 0.125, x[3], (upper - pull[1]) / 0.025]

        return f

    def area(i: int, sign: float = 1.0) -> Any:
        return lambda t, x, p: sign * (0.05 / 2.8 + x[i])

    flows = [
        cb.Flow(folds(lambda areas: 1.0 - (areas[1] / areas[0]) ** 2), lambda t, x, p: x[0] - x[2]),
        cb.Flow(folds(lambda areas: 0.0), area(0)),
        cb.Flow(folds(lambda areas: 0.0, 1.0), area(2)),
        cb.Flow(folds(lambda areas: 0.0, 1.0, 1.0), area(0, -1.0)),
        cb.Flow(folds(lambda areas: 1.0, 0.0, 1.0), area(2, -1.0)),
    ]
    start = {"x1": -0.01098846, "v1": 0.02085345, "x2": -0.01785714, "v2": 0.00721526}
    orbit = cb.cycle(flows, start, {"Ps": 0.0052, "k": 0.021}, settle=40)
    both = cb.trace(orbit, "Ps", within={"Ps": (0.0048, 0.0053)}).first("CC")
    curve = cb.boundary(both, ("Ps", "k"), within={"k": (0.0209, 0.05)})
    (end,) = (point for point in curve.special if point.kind != "EP")
    assert end.kind == "CC-CC"
    assert (end["Ps"], end["k"]) == pytest.approx((0.00493933, 0.02148068), rel=1e-6)
