"""Onto other branches: all that leave, each once, from the right point, or a clear refusal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import contbreather as cb
from contbreather.continuation import Stop, hopf
from contbreather.continuation.branches.duplicates import lies_on
from contbreather.continuation.branches.switching import (
    ArmsCoincide,
    NothingToSwitch,
    Seed,
    SwitchingProblem,
    follow,
    switch,
)
from contbreather.continuation.curve.settings import Settings
from contbreather.errors import BadInput, Interrupted, NotConverged

from . import zoo

MU = {"mu": (-1.0, 1.0)}


CROSSED_CIRCLE = zoo.scalar(zoo.circle_on_axis, 0.0, {"mu": -1.5})


def arms_of(
    problem: cb.Problem, within: Mapping[str, tuple[float, float]] = MU
) -> tuple[cb.Branch, ...]:
    branch = cb.trace(problem, "mu", events=zoo.STATIC, within=within)
    return switch(branch.first("BP"), within=within, events=zoo.STATIC)


# --- what is found ----------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1, -1])
def test_both_arms_of_a_pitchfork_super_or_subcritical(sign: int) -> None:
    arms = arms_of(zoo.scalar(lambda x, p: x * (p["mu"] - sign * x**2), 0.0, {"mu": -0.7}))
    assert len(arms) == 2
    assert sorted(round(arm[-1]["x"], 12) for arm in arms) == [-1, 1]
    for arm in arms:
        assert abs(arm["mu"] - sign * arm["x"] ** 2).max() < 1e-14
        assert abs(arm["x"][1:]).min() > 0
        assert arm.doubtful == ()
        assert arm.stop is Stop.BOUND


def test_an_arm_that_comes_back_has_no_doubt_where_it_left() -> None:
    """A loop between two pitchforks: it turns at both, where curves cross."""
    (loop,) = arms_of(zoo.scalar(lambda x, p: x * (0.25 - p["mu"] ** 2 - x**2), 0.0, {"mu": -0.7}))
    assert loop.stop is Stop.CLOSED
    assert [point.label for point in loop.special] == ["EP1", "BP1"]
    assert loop.doubtful == ()


def test_arms_leave_where_folds_crowd_the_branch_point() -> None:
    branch = zoo.trace_case(zoo.crowded(1e-4))
    arms = switch(branch.first("BP"), within={"l": (-1.0, 1.0)})
    assert sorted(arm[-1]["l"] for arm in arms) == [-1, 1]
    assert all(abs(arm["x"]).max() < 1e-12 for arm in arms)


@pytest.mark.slow
@given(st.integers(2, 5), st.integers(0, 10**6), st.sampled_from(["transcritical", "pitchfork"]))
@settings(max_examples=8)
def test_crossings_are_found_in_any_dimension_and_position(n: int, seed: int, shape: str) -> None:
    """A known crossing hidden by a rotation, a shift and well-behaved other directions."""
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.normal(size=(n, n))).Q
    shift, rates = rng.normal(size=n), rng.uniform(0.5, 2.0, n - 1) * rng.choice([-1, 1], n - 1)

    def residual(x: zoo.Array, p: Mapping[str, float]) -> zoo.Array:
        y = rotation.T @ (x - shift)
        head = y[0] * (p["mu"] - (y[0] if shape == "transcritical" else y[0] ** 2))
        return rotation @ np.append(head, rates * y[1:] + y[0] ** 2)

    def height(arm: cb.Branch) -> zoo.Array:
        return (arm["x"] - shift) @ rotation[:, 0]

    mine = cb.Problem(residual, {"x": shift.copy()}, {"mu": -0.6})
    arms = arms_of(mine)
    assert len(arms) == 2
    for arm in arms:
        wanted = height(arm) if shape == "transcritical" else height(arm) ** 2
        assert abs(arm["mu"] - wanted).max() < 1e-9
        assert abs(height(arm)[-1]) == pytest.approx(1.0, abs=1e-9)
    assert height(arms[0])[-1] * height(arms[1])[-1] < 0


def test_the_first_point_of_an_arm_is_the_branch_point_itself() -> None:
    point = zoo.trace_case(zoo.PITCHFORK).first("BP")
    for arm in switch(point, within=MU):
        assert np.array_equal(arm[0].z, point.z)
        assert arm[0].parent is point
        assert arm.began is Stop.EVENT
        assert [one.label for one in arm.special] == ["EP1", "EP2"]
        assert arm[0].arclength == 0 < arm[1].arclength


def test_events_of_arms_are_found_and_can_be_switched_at_again() -> None:
    branch = cb.trace(CROSSED_CIRCLE, "mu", events=zoo.STATIC, within={"mu": (-2.0, 2.0)})
    (arm,) = switch(branch.first("BP1"), within={"mu": (-2.0, 2.0)}, events=zoo.STATIC)
    second = arm.first("BP")
    assert second["mu"] == pytest.approx(1.0, abs=1e-12)
    back = switch(second, within={"mu": (-2.0, 2.0)})
    assert sorted(one[-1]["mu"] for one in back) == [-2, 2]
    assert all(abs(one["x"]).max() < 1e-12 for one in back)


@pytest.mark.slow
def test_arms_look_for_what_their_branch_did(tmp_path: Path) -> None:
    """LP of ``x (mu + x^2 - x^4)`` and HB of Lorenz's equations on arms, PD of a map on its."""
    quintic = zoo.scalar(lambda x, p: x * (p["mu"] + x**2 - x**4), 0.0, {"mu": -0.7})
    at_bp = cb.trace(quintic, "mu", events=zoo.STATIC, within=MU).first("BP")
    for arm in switch(at_bp, within=MU):
        assert arm.first("LP")["mu"] == pytest.approx(-0.25, abs=1e-9)
    for arm in switch(at_bp, within=MU, events=()):
        assert {point.kind for point in arm.special} == {"EP"}

    origin = zoo.LORENZ.problem.at(x=0.0, y=0.0, z=0.0, r=0.5)
    window = {"r": (0.5, 30.0)}
    axis = cb.trace(origin, "r", events=[cb.branch_point(), hopf()], within=window)
    cb.save(tmp_path / "axis.nc", axis)
    loaded = cb.load(tmp_path / "axis.nc", problem=origin)
    for branch in (axis, loaded):
        for arm in switch(branch.first("BP"), within=window):
            assert arm.first("HB")["r"] == pytest.approx(470 / 19, abs=1e-9)

    cubic = cb.FixedPoint(lambda x, p: p["mu"] * x - x**3, {"x": 0.0}, {"mu": 0.5})
    events = [cb.branch_point(), cb.period_doubling()]
    line = cb.trace(cubic, "mu", events=events, within={"mu": (0.5, 2.5)})
    for arm in switch(line.first("BP"), within={"mu": (0.5, 2.5)}):
        assert arm.first("PD")["mu"] == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("largest", [0.01, 0.037, 0.1, 0.3, 1.0])
def test_a_curve_that_comes_back_to_the_branch_point_is_there_once(largest: float) -> None:
    branch = cb.trace(CROSSED_CIRCLE, "mu", events=zoo.STATIC, within={"mu": (-2.0, 2.0)})
    steps = cb.Steps(largest=largest)
    arms = switch(branch.first("BP1"), within={"mu": (-2.0, 2.0)}, events=zoo.STATIC, steps=steps)
    assert [point.kind for point in arms[0].special] == ["EP", "BP"]
    assert [arm.stop for arm in arms] == [Stop.CLOSED]
    assert abs(arms[0]["x"] ** 2 + arms[0]["mu"] ** 2 - 1).max() < 1e-12


def test_mirror_images_are_marked_where_the_problem_knows_its_symmetry() -> None:
    plain = zoo.scalar(lambda x, p: x * (p["mu"] - x**2), 0.0, {"mu": -0.7})
    odd = zoo.knowing(plain, images=lambda x, p: (-x,))
    assert [arm.image_of for arm in arms_of(plain)] == [None, None]
    assert [arm.image_of for arm in arms_of(odd)] == [None, 0]


def test_any_event_can_have_its_own_arms_in_a_larger_problem() -> None:
    """The engine asks the problem, never for a kind: here two oscillators split apart."""

    def apart(x: zoo.Array, p: Mapping[str, float]) -> zoo.Array:
        mean, half = 0.5 * (x[0] + x[1]), 0.5 * (x[0] - x[1])
        return np.array([mean - p["mu"], half * (p["mu"] - 0.5 - half**2)])

    larger = cb.Problem(apart, {"left": 0.0, "right": 0.0}, {"mu": 0.0})

    def lift(point: object) -> SwitchingProblem:
        there = larger.at(left=point["x"], right=point["x"], mu=point["mu"])
        return SwitchingProblem(there, "mu", by=("right",))

    event = cb.Event("ODD", lambda point: point["mu"] - 0.5)
    mine = zoo.scalar(lambda x, p: x - p["mu"], 0.0, {"mu": 0.0}, events=(event,))
    mine = zoo.knowing(mine, lift={"ODD": lift}.get)
    found = switch(cb.trace(mine, "mu", within=MU).first("ODD"), within=MU)
    for side, arm in zip((1, -1), found, strict=True):
        half = 0.5 * (arm["left"] - arm["right"])
        assert side * half[-1] > 0
        assert abs(arm["mu"] - 0.5 - half**2).max() < 1e-12
    assert found[0]["left"][-1] == pytest.approx(found[1]["right"][-1], abs=1e-12)


def test_an_interruption_keeps_the_arms_there_are() -> None:
    mine, counter = zoo.counted(zoo.PITCHFORK.problem)
    point = cb.trace(mine, "mu", events=[cb.branch_point()], within=MU).first("BP")
    counter.interrupted = counter.calls + 121
    with pytest.raises(Interrupted) as stop:
        switch(point, within=MU, events=())
    arms = stop.value.partial
    assert [arm.stop for arm in arms] == [Stop.INTERRUPTED]
    assert len(arms[0]) > 1
    assert arms[0][0].parent is point


# --- what is refused --------------------------------------------------------------------------


def refused(point: object) -> NothingToSwitch:
    with pytest.raises(NothingToSwitch) as caught:
        switch(point)
    assert caught.value.point is point
    assert isinstance(caught.value, BadInput)
    return caught.value


def test_points_that_no_branch_leaves_are_refused_with_the_point() -> None:
    branch = zoo.trace_case(zoo.LORENZ)
    assert "is not a special point; switch at a BP, PF, PD, GR or VI" in str(refused(branch[3]))
    assert "is where a branch ends" in str(refused(branch.special[0]))
    hopf = str(refused(branch.first("HB")))
    assert "known to leave points of kind HB; " in hopf
    assert "begin with cb.equilibrium" in hopf
    assert str(refused(zoo.trace_case(zoo.CIRCLE).first("LP"))).endswith("leave points of kind LP")
    arm = arms_of(CROSSED_CIRCLE, {"mu": (-2.0, 2.0)})[0]
    assert "its `parent`" in str(refused(arm[0]))
    point = zoo.trace_case(zoo.PITCHFORK).first("BP")
    doubt = replace(point, located=False, detail={"reason": "for a test"})
    assert "seen, not located (for a test)" in str(refused(doubt))


def test_a_lift_to_equations_that_fold_there_is_refused() -> None:
    """Along no direction in which these equations could be left does the parameter change."""

    def lift(point: object) -> SwitchingProblem:
        fold = cb.Problem(
            lambda x, p: np.array([x[0] ** 2 - p["mu"], x[1] ** 2]), {"x": 0, "y": 0}, {"mu": 0}
        )
        return SwitchingProblem(fold, "mu")

    event = cb.Event("ODD", lambda point: point["mu"])
    mine = zoo.knowing(zoo.PITCHFORK.problem, lift={"ODD": lift}.get)
    point = cb.trace(mine, "mu", events=[event], within=MU).first("ODD")
    assert "they fold there" in str(refused(point))


@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_arms_of_a_lift_set_out_whatever_the_size_of_their_unknowns(size: float) -> None:
    """x / size = +- sqrt(mu)."""
    pitchfork = cb.Problem(
        lambda x, p: x * (p["mu"] - (x / size) ** 2), {"x": 0.0}, {"mu": 0.0}, scales={"x": size}
    )
    assert SwitchingProblem(pitchfork, "mu").arm(0.1 * size).params["mu"] == pytest.approx(0.01)


def test_arms_leave_a_branch_along_which_the_parameter_hardly_moves() -> None:
    """y = 1e8 mu, as of a neuron whose bursts explode: "they fold there"."""
    steep = cb.Problem(
        lambda x, p: np.array([x[0] * (x[1] - x[0] ** 2), x[1] - 1e8 * p["mu"]]),
        {"x": 0.0, "y": 0.0}, {"mu": 0.0},
    )  # fmt: skip
    assert SwitchingProblem(steep, "mu").arm(0.1).params["mu"] == pytest.approx(1e-10)


def test_the_arms_of_a_branch_point_are_refused_where_none_is() -> None:
    event = replace(cb.branch_point(), test=lambda point: point["mu"] - 0.3)
    point = cb.trace(zoo.PITCHFORK.problem, "mu", within=MU, events=[cb.user("mu", 0.3)]).first(
        "UZ"
    )
    with pytest.raises(NothingToSwitch, match="no directions are known here"):
        switch(replace(point, event=event))


def test_an_arm_that_follows_its_parent_is_refused_with_the_arm() -> None:
    point = zoo.trace_case(zoo.PITCHFORK).first("BP")
    seed = Seed(point.problem, np.zeros(2), np.array([1e-3, 1.0]), parent=np.array([0.0, 1.0]))
    with pytest.raises(ArmsCoincide, match="follows the branch it was to leave") as caught:
        follow(point, seed, Settings(MU))
    assert caught.value.distance < 1e-4
    assert len(caught.value.arm) > 2
    assert isinstance(caught.value, NotConverged)


def test_arms_leave_a_branch_that_bends_by_more_than_they_come_apart() -> None:
    """Next to its fold, at y = 0: z = p on the branch, z = 1.1 p on the other one."""
    mine = cb.Problem(
        lambda x, p: np.array([x[0] ** 2 - p["p"] - 9e-4, (x[1] - p["p"]) * (1.1 * p["p"] - x[1])]),
        {"y": 0.5, "z": 0.2491},
        {"p": 0.2491},
    )
    window = {"p": (-1, 1)}
    branch = cb.trace(mine, "p", within=window, events=zoo.STATIC)
    for label in ("BP1", "BP2"):
        arms = switch(branch.first(label), within=window)
        assert [arm["z"] == pytest.approx(1.1 * arm["p"], abs=1e-9) for arm in arms] == [True] * 2


class Twice(SwitchingProblem):
    """One arm, given twice."""

    def seeds(self) -> tuple[Seed, ...]:
        return (Seed(self.problem, np.zeros(2), np.array([1.0, 0.0])),) * 2


def test_arms_that_coincide_are_refused_with_both() -> None:
    mine = zoo.knowing(
        zoo.PITCHFORK.problem, lift={"BP": lambda point: Twice(point.problem, "mu")}.get
    )
    point = cb.trace(mine, "mu", within=MU, events=zoo.STATIC).first("BP")
    with pytest.raises(ArmsCoincide, match=r"two arms of .* coincide") as caught:
        switch(point, within=MU)
    assert caught.value.distance < 1e-12
    assert np.allclose(caught.value.arm[1].z, caught.value.other[1].z)


def test_no_first_step_is_an_error_not_a_branch_of_one_point() -> None:
    def residual(x: zoo.Array, p: Mapping[str, float]) -> zoo.Array:
        if x[0] > 1e-4:
            raise ValueError("beyond the edge")
        return np.array([x[0] * (p["mu"] - x[0] ** 2)])

    point = zoo.trace_case(zoo.PITCHFORK).first("BP")
    seed = Seed(cb.Problem(residual, {"x": 0.0}, {"mu": 0.0}), np.zeros(2), np.array([1.0, 0.0]))
    with pytest.raises(NotConverged, match="no step can be made along an arm"):
        follow(point, seed, Settings(MU, steps=cb.Steps(smallest=1e-3)))


# --- the door to the walk ---------------------------------------------------------------------


def test_a_given_direction_at_a_regular_point_is_the_ordinary_walk() -> None:
    usual = cb.trace(zoo.CIRCLE.problem, "mu", towards="up", within={"x": (0.0, 2.0)})
    given = cb.trace(zoo.CIRCLE.problem, "mu", along=[0.0, 3.0], within={"x": (0.0, 2.0)})
    assert np.allclose(given[-1].z, usual[-1].z, atol=1e-12)
    assert len(given) == len(usual)


# --- recognising what is known ----------------------------------------------------------------


def test_a_large_scale_does_not_blur_what_is_known() -> None:
    mine = zoo.scalar(
        lambda x, p: 1e-6 * x - 1e6 * p["mu"], 0.0, {"mu": 0.0}, scales={"x": 1e6, "mu": 1e-6}
    )
    branch = cb.trace(mine, "mu", within={"mu": (-1e-6, 1e-6)}, steps=cb.Steps(largest=0.3))
    for mu, known in ((0.5e-6, True), (0.5001e-6, False)):
        assert lies_on(replace(branch[0], z=np.array([0.5e6, mu])), branch) == known
