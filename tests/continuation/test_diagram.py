"""Diagrams: everything that can be reached, nothing twice, an end in all cases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contbreather.continuation import Branch, Event, Problem, Steps, Stop, branch_point, load, save
from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.bifurcations.maps import FixedPoint
from contbreather.continuation.branches.diagram import Diagram, diagram
from contbreather.continuation.branches.switching import Seed, SwitchingProblem
from contbreather.errors import BadInput, Interrupted

from .zoo import (
    LORENZ,
    PITCHFORK,
    STATIC,
    Array,
    Counted,
    circle_on_axis,
    imperfect,
    knowing,
    logistic,
    printed,
    scalar,
)

MU = {"mu": (-1.0, 1.0)}
WIDE = {"mu": (-2.0, 2.0)}


def grown(problem: Problem, **given: object) -> Diagram:
    return diagram(problem, "mu", **{"within": MU, "events": STATIC, **given})


def relations(tree: Diagram) -> list[tuple[object, object, str]]:
    return sorted(tree.graph.edges(data="relation"), key=str)


def ends(branch: Branch) -> set[tuple[float, float]]:
    return {(round(p["x"], 9), round(p["mu"], 9)) for p in (branch[0], branch[-1])}


# --- what grows -------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [(0.0, -0.7), (0.0, 0.6), (0.8, 0.64), (-0.5, 0.25)])
def test_a_pitchfork_is_found_whole_from_anywhere_on_it(start: tuple[float, float]) -> None:
    tree = grown(PITCHFORK.problem.at(x=start[0], mu=start[1]))
    on_axis = [p for branch in tree for p in branch if abs(p["x"]) < 1e-9]
    on_arms = [p for branch in tree for p in branch if abs(p["mu"] - p["x"] ** 2) < 1e-9]
    assert {round(p["mu"], 9) for p in on_axis} >= {-1, 1}
    assert {round(p["x"], 9) for p in on_arms} >= {-1, 1}
    assert len(on_axis) + len(on_arms) >= sum(map(len, tree))
    assert len(tree) == 3
    assert len([p for p in tree.special if p.kind == "BP"]) == 1
    assert (tree.failed, tree.left, tree.interrupted) == ((), (), False)


def test_a_label_is_asked_of_a_branch_which_the_diagram_says() -> None:
    with pytest.raises(BadInput, match=r"diagram\[0\]\.first\('BP1'\) for instance"):
        grown(PITCHFORK.problem)["BP1"]


def test_the_first_point_of_a_kind_is_that_of_the_first_branch_that_has_one() -> None:
    found = grown(PITCHFORK.problem)
    assert found.first("BP") is found.first("BP1")
    assert found.first("BP").label in [point.label for point in found[0].special]
    with pytest.raises(BadInput, match=r"no 'HB1' on these branches; they have \['BP', 'EP'\]"):
        found.first("HB1")


def test_what_was_born_where() -> None:
    tree = grown(PITCHFORK.problem)
    assert [birth.depth for birth in tree.births] == [0, 1, 1]
    assert list(tree.graph.successors("branch 0: BP1")) == [1, 2]
    assert tree.graph.nodes[1]["branch"] is tree[1]
    assert tree.graph.nodes["branch 0: BP1"]["point"]["mu"] == pytest.approx(0, abs=1e-12)
    assert relations(tree) == [
        ("branch 0: BP1", 1, "born"),
        ("branch 0: BP1", 2, "born"),
        (0, "branch 0: BP1", "on"),
        (0, "branch 0: EP1", "on"),
        (0, "branch 0: EP2", "on"),
        (1, "branch 1: EP2", "on"),
        (2, "branch 2: EP2", "on"),
    ]


def two_levels(x: Array, p: Mapping[str, float]) -> Array:
    """``x (mu - x^2) = 0``, and from both its arms ``y (x^2 - 1/2 - y^2) = 0``."""
    return np.array([x[0] * (p["mu"] - x[0] ** 2), x[1] * (x[0] ** 2 - 0.5 - x[1] ** 2)])


def test_a_tree_of_two_levels() -> None:
    tree = grown(Problem(two_levels, {"x": 0.0, "y": 0.0}, {"mu": -0.7}))
    assert [birth.depth for birth in tree.births] == [0, 1, 1, 2, 2, 2, 2]
    for branch in tree.branches[3:]:
        assert abs(branch["mu"] - branch["x"] ** 2).max() < 1e-12
        assert abs(branch["x"] ** 2 - 0.5 - branch["y"] ** 2).max() < 1e-9
        assert branch[-1]["mu"] == 1
    corners = {(np.sign(b[-1]["x"]), np.sign(b[-1]["y"])) for b in tree.branches[3:]}
    assert len(corners) == 4


@pytest.mark.parametrize(
    ("depth", "branches", "left"), [(0, 1, 1), (1, 3, 2), (2, 7, 0), (5, 7, 0)]
)
def test_depth_says_how_often_to_switch_and_what_is_left_is_told(depth, branches, left):
    tree = grown(Problem(two_levels, {"x": 0.0, "y": 0.0}, {"mu": -0.7}), depth=depth)
    assert len(tree) == branches
    assert len(tree.left) == left


def test_images_are_followed_but_not_switched_on() -> None:
    def images(x: Array, p: Mapping[str, float]) -> tuple[Array, ...]:
        return tuple(x * sign for sign in ([-1, 1], [1, -1], [-1, -1]))

    mine = Problem(two_levels, {"x": 0.0, "y": 0.0}, {"mu": -0.7})
    tree = grown(knowing(mine, images=images))
    assert [birth.image_of for birth in tree.births] == [None, None, 1, None, 3]
    assert [branch.image_of for branch in tree] == [None, None, 1, None, 3]
    assert tree.left == ()


# --- nothing twice ----------------------------------------------------------------------------


def test_a_closed_loop_through_two_branch_points_is_there_once() -> None:
    tree = grown(scalar(circle_on_axis, 0.0, {"mu": -1.5}), within=WIDE, depth=5)
    assert len(tree) == 2
    assert tree[1].stop is Stop.CLOSED
    assert ("branch 0: BP2", 1, "known") in relations(tree)
    assert (1, "branch 0: BP2", "on") in relations(tree)
    assert len([p for p in tree.special if p.kind == "BP"]) == 2


def test_a_curve_that_crosses_itself_is_one_branch_and_one_crossing() -> None:
    """``x^2 = mu^2 - mu^4``, a figure of eight."""
    mine = scalar(lambda x, p: x**2 - p["mu"] ** 2 + p["mu"] ** 4, np.sqrt(0.1875), {"mu": 0.5})
    tree = grown(mine, depth=3)
    assert len(tree) == 1
    assert [place.name for place in tree.places[0]].count("branch 0: BP1") == 2
    assert len([p for p in tree.special if p.kind == "BP"]) == 1
    assert [str(meeting) for meeting in tree.meetings] == ["branch 0: BP1 leads to branch 0"]


def test_the_same_from_a_start_on_the_loop() -> None:
    tree = grown(scalar(circle_on_axis, 1.0, {"mu": 0.0}), within=WIDE, depth=5)
    assert tree[0].stop is Stop.CLOSED
    covered = np.concatenate([branch["mu"] for branch in tree.branches[1:]])
    assert (covered.min(), covered.max()) == (-2, 2)
    assert np.sum([abs(np.diff(branch["mu"])).sum() for branch in tree.branches[1:]]) == (
        pytest.approx(4, abs=1e-9)
    )


def test_a_net_of_crossing_lines_is_found_whole_and_ends() -> None:
    """Nine lines, each crossed by others: 24 crossings, no line twice."""

    def net(x: float, p: Mapping[str, float]) -> float:
        value = 1.0
        for i in range(3):
            value = value * (x - 0.4 * (i - 1) - 0.05) * (p["mu"] + 0.7 * x - 0.5 * (i - 1))
        return value

    within = {"mu": (-1.0, 1.0), "x": (-0.8, 0.8)}
    tree = grown(scalar(net, 0.05, {"mu": -0.9}), within=within, depth=50)
    length = sum(branch[-1].arclength - branch[0].arclength for branch in tree)
    wanted = 3 * 2.0
    for i in range(3):  # mu = 0.5 (i - 1) - 0.7 x within the window
        x = np.linspace(-0.8, 0.8, 200001)
        inside = abs(0.5 * (i - 1) - 0.7 * x) <= 1
        wanted += np.ptp(x[inside]) * np.hypot(1, 0.7)
    assert length == pytest.approx(wanted, rel=1e-4)
    assert len([p for p in tree.special if p.kind == "BP"]) == 9
    assert tree.failed == ()


@pytest.mark.parametrize("h", [1e-2, 1e-4])
def test_an_imperfect_pitchfork_has_one_curve_and_no_false_switch(h: float) -> None:
    for case in imperfect(h):
        tree = diagram(case.problem, case.free, within=case.within, events=STATIC, depth=3)
        assert len(tree) == 1
        assert (tree.meetings, tree.failed, tree.left) == ((), (), ())


def test_lorenz_from_one_side_finds_the_origin_and_knows_the_other_side() -> None:
    with pytest.raises(BadInput, match="this problem looks for none"):
        diagram(LORENZ.problem, "r", within={"r": (0.1, 30.0)}, steps=Steps(largest=0.5))
    tree = diagram(
        LORENZ.problem, "r", within={"r": (0.1, 30.0)}, events=STATIC, steps=Steps(largest=0.5)
    )
    assert len(tree) == 3
    assert all(abs(branch["z"]).max() < 1e-9 for branch in tree.branches[1:])


# --- maps: arms in larger problems ------------------------------------------------------------


def test_what_leaves_at_the_edge_of_the_window_and_lies_beyond_is_not_there() -> None:
    """Neither a meeting, with the branch itself, nor an arm that failed."""
    cubic = Problem(lambda x, p: x * (p["r"] - x**2), {"x": 0.0}, {"r": -1.0})
    for problem, edge, events in ((logistic(), 3.0, None), (cubic, 0.0, STATIC)):
        tree = diagram(problem, "r", within={"r": (edge - 1.0, edge)}, events=events)
        assert (len(tree), tree.meetings, tree.failed, tree.left) == (1, (), (), ())
        assert tree[0].special[-1]["r"] == pytest.approx(edge)


@pytest.mark.slow
def test_the_cascade_goes_on_where_cycles_are_all_but_their_parents() -> None:
    """A cycle of period 32 is born 1e-5 beside its parent: told apart by the way from the place."""
    tree = diagram(logistic(), "r", within={"r": (1.5, 3.5698)}, depth=6)
    labels = [branch.problem.label for branch in tree]
    assert labels == ["fixed point", *(f"cycle of period {2**i}" for i in range(1, 7))]
    assert (tree.meetings, tree.failed, tree.left) == ((), (), ())


def test_an_arm_that_is_its_own_parent_is_a_failure_and_no_meeting() -> None:
    def lift(point: object) -> SwitchingProblem:
        own = point.problem
        twice = Problem(
            lambda x, p: np.concatenate([own.residual(x[:1], p), own.residual(x[1:], p)]),
            {"x": point["x"], "y": point["x"]},
            {"mu": point["mu"]},
        )
        simpler = knowing(twice, simpler=lambda there: own.at(x=there["x"], mu=there["mu"]))
        return SwitchingProblem(simpler, "mu", both=False)

    mine = knowing(scalar(lambda x, p: x - p["mu"], -0.5, {"mu": -0.5}), lift={"ODD": lift}.get)
    tree = diagram(mine, "mu", within=MU, events=[Event("ODD", lambda p: p["mu"])])
    assert (len(tree), tree.meetings, len(tree.failed)) == (1, (), 1)
    assert "cannot be distinguished from the branch it was to leave" in str(tree.failed[0])


def test_a_bubble_of_doubled_cycles_reaches_from_one_doubling_to_the_other() -> None:
    """``1 - (1 - e^2) x^2``: a cycle of period 2 between e = -1/2 and 1/2 and nowhere else. Beyond
    the second doubling the same cycles come back, in their other phase."""
    mine = FixedPoint(lambda x, p: 1 - (1 - p["e"] ** 2) * x * x, {"x": 0.6}, {"e": -0.9})
    tree = diagram(mine, "e", within={"e": (-1, 1), "x": (-3, 3)}, depth=4)
    assert len(tree) == 2
    assert tree[1].stop is Stop.EVENT
    assert "its own image" in tree[1].reason
    assert abs(tree[1]["e"][[0, -1]]) == pytest.approx([0.5, 0.5], abs=1e-12)
    assert [point.kind for point in tree[1].special] == ["EP", "BP"]
    assert (1, "branch 0: PD2", "on") in relations(tree)
    assert ("branch 0: PD2", 1, "known") in relations(tree)


def test_two_kinds_of_points_at_one_place_are_both_switched_at() -> None:
    """A multiplier 1 and another one -1, of two states that are all but independent."""

    def both(x: Array, p: Mapping[str, float]) -> Array:
        u, v, m = *x, 1.0 + p["mu"]
        return np.array([m * u - u**3 - 0.3 * u * v**2, -m * v + v**3 + 0.2 * v * u**2])

    tree = diagram(FixedPoint(both, {"u": 0.0, "v": 0.0}, {"mu": -0.5}), "mu",
                   within={"mu": (-0.6, 0.4)}, depth=1)  # fmt: skip
    assert [point.label for point in tree[0].special] == ["EP1", "BP1", "PD1", "EP2"]
    assert sorted(birth.place.point.kind for birth in tree.births[1:]) == ["BP", "BP", "PD"]


@pytest.mark.slow
def test_a_crossing_where_an_arm_of_another_kind_fails_is_followed() -> None:
    """Hosts and parasitoids at r = 2, where without parasitoids a multiplier is -1 everywhere."""

    def hosts(x: Array, p: Mapping[str, float]) -> Array:
        return np.array([x[0] * np.exp(2 * (1 - x[0] / p["K"]) - x[1]), x[0] * (1 - np.exp(-x[1]))])

    tree = diagram(FixedPoint(hosts, {"n": 1.0, "q": 0.5}, {"K": 1.5}), "K",
                   within={"K": (0.5, 4)}, depth=1)  # fmt: skip
    alone = [branch for branch in tree if abs(branch["q"]).max() < 1e-9 and len(branch) > 2]
    assert {branch[-1]["K"] for branch in alone} == {0.5, 4.0}


def test_from_a_cycle_back_to_the_fixed_point_in_its_own_problem() -> None:
    doubled = logistic(0.799455, 3.2, period=2)
    tree = diagram(doubled, "r", within={"r": (2.0, 3.4)}, depth=1)
    labels = [branch.problem.label for branch in tree]
    assert labels == ["cycle of period 2", "fixed point"]
    assert (tree[1]["r"].min(), tree[1]["r"].max()) == (2.0, 3.4)
    assert tree.left == ()


# --- bounds, failures, interruption -----------------------------------------------------------


def test_work_is_bounded_by_the_number_of_branches() -> None:
    tree = grown(Problem(two_levels, {"x": 0.0, "y": 0.0}, {"mu": -0.7}), most=4)
    assert len(tree) == 4
    assert tree.left
    assert "points not switched at" in tree.describe()


class Astray(SwitchingProblem):
    """Two arms, of which the first sets out beside the curve."""

    def seeds(self) -> tuple[Seed, ...]:
        z, along = np.append(self.problem.x, self.problem.params["mu"]), np.array([1.0, 0.0])
        return Seed(self.problem, z + 0.3, along), Seed(self.problem, z, along)


def test_arms_that_fail_are_kept_with_the_reason_and_the_rest_goes_on() -> None:
    mine = knowing(PITCHFORK.problem, lift={"BP": lambda point: Astray(point.problem, "mu")}.get)
    tree = diagram(mine, "mu", within=MU, events=[branch_point()])
    assert len(tree) == 2
    assert "no curve leaves the start" in str(tree.failed[0])
    assert "1 arm not followed" in tree.describe()


@pytest.mark.slow
def test_an_interruption_at_any_moment_hands_over_what_there_is() -> None:
    whole = Counted(two_levels)
    grown(Problem(whole, {"x": 0.0, "y": 0.0}, {"mu": -0.7}))
    kept = []
    for at in np.linspace(200, whole.calls - 1, 11).astype(int):
        mine = Counted(two_levels, interrupted=at)
        with pytest.raises(Interrupted) as stop:
            grown(Problem(mine, {"x": 0.0, "y": 0.0}, {"mu": -0.7}))
        tree = stop.value.partial
        assert tree.interrupted
        assert tree.graph.number_of_nodes() > 0
        assert "interrupted" in tree.describe()
        kept.append(len(tree))
    assert kept == sorted(kept)
    assert kept[0] <= 1
    assert kept[-1] == 7


# --- what is shown ----------------------------------------------------------------------------


def test_the_tree_is_shown_as_it_grew() -> None:
    text = printed(grown(ODD, within=WIDE), 120)
    assert "2 branches, 4 special points" in text
    assert text.index("BP1: mu = -1") < text.index("branch 1") < text.index("BP2: mu = 1, x")
    assert "meets branch 0: BP2" in text


# --- in files -----------------------------------------------------------------------------------


def nothing(point: object) -> SwitchingProblem:
    raise Undefined("nothing leaves here")


SLOPE = knowing(scalar(lambda x, p: x - p["mu"], -0.5, {"mu": -0.5}), lift={"ODD": nothing}.get)
ODD = knowing(scalar(circle_on_axis, 0.0, {"mu": -1.5}), images=lambda x, p: (-x,))
KEPT = {
    "images": lambda: grown(ODD, within=WIDE),
    "closed": lambda: grown(scalar(circle_on_axis, 1.0, {"mu": 0.0}), within=WIDE, depth=5),
    "left": lambda: grown(Problem(two_levels, {"x": 0.0, "y": 0.0}, {"mu": -0.7}), most=3),
    "failed": lambda: grown(SLOPE, events=[Event("ODD", lambda point: point["mu"])]),
}


def told(tree: Diagram) -> list[object]:
    """All that a diagram tells but for the numbers along its branches."""
    several = tree.meetings, tree.failed, [place.name for place in tree.left]
    births = [(b.depth, b.place and b.place.name, b.image_of) for b in tree.births]
    parents = [b[0].parent and (b[0].parent.label, b[0].parent.z.tobytes()) for b in tree]
    labels = [[p.label for p in branch.special] for branch in tree]
    words = [[str(one) for one in some] for some in several]
    return [relations(tree), tree.interrupted, births, parents, labels, words, printed(tree)]


@pytest.mark.parametrize("name", KEPT)
def test_a_diagram_comes_back_from_a_file_with_all_that_it_tells(name: str, tmp_path: Path) -> None:
    tree = replace(KEPT[name](), interrupted=name == "left")
    save(tmp_path / "tree.nc", tree)
    again = load(tmp_path / "tree.nc")
    assert told(again) == told(tree)
    assert [branch.origin for branch in again] == [branch[0].parent for branch in again]
    assert any([tree.left, tree.failed, tree.meetings, tree.births[-1].image_of])
