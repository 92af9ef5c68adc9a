"""Boundaries run where they should, and meet what they should: one label a place, the right one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import block_diag, diags_array

import contbreather as cb
from contbreather.continuation import Point, Stop
from tests.stability.by_hand import slope

from . import lines
from .lines import eaten
from .zoo import ALL, Array, events_of, rotated


@pytest.mark.slow
@pytest.mark.parametrize("name", lines.LINES)
def test_a_boundary_runs_where_it_should_and_meets_what_it_should(name: str) -> None:
    line, curve = lines.LINES[name], lines.walked(lines.LINES[name])
    found = sorted(events_of(curve), key=lambda point: point[line.pair[0]])
    assert [point.kind for point in found] == [kind for kind, _ in line.known]
    for point, (_, values) in zip(found, line.known, strict=True):
        lines.at(point, **values)
    if line.course is not None:
        assert np.max(np.abs(line.course(curve))) < line.accuracy
    reasons = " ".join(point.detail["reason"] for point in curve.doubtful)
    assert line.doubtful in reasons if line.doubtful else not curve.doubtful


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "kind", "other", "accuracy"),
    [
        (lines.TAKENS_LP, "BT", lines.TAKENS_HB, 1e-12),
        (lines.TAKENS_HB, "BT", lines.TAKENS_LP, 1e-12),
        (lines.FOLD_HOPF["LP"], "ZH", lines.FOLD_HOPF["HB"], 0),
        (lines.FOLD_HOPF["HB"], "ZH", lines.FOLD_HOPF["LP"], 0),
        (lines.HENON["LP"], "R1", lines.HENON["NS"], 1e-9),
        (lines.HENON["PD"], "R2", lines.HENON["NS"], 1e-9),
        (lines.HENON["NS"], "R1", lines.HENON["LP"], 1e-9),
        (lines.HENON["NS"], "R2", lines.HENON["PD"], 1e-9),
        (lines.DOUBLED_PREY, "PD-BP", lines.DYING, 1e-12),
        (lines.DYING, "BP-PD", lines.DOUBLED_PREY, 0),
        (lines.LINES["LP beside a pair"], "LPNS", lines.LINES["pair beside a LP"], 0),
        (lines.LINES["pair beside a PD"], "PDNS", lines.LINES["PD beside a pair"], 0),
    ],
    ids=lambda given: given.name if isinstance(given, lines.Line) else None,
)
def test_from_a_meeting_the_other_curve_is_followed(line, kind, other, accuracy):
    curve = line.from_(lines.walked(line).first(kind), events=())
    assert curve.problem.label == f"{other.kind} boundary"
    if other.course is not None:
        assert abs(other.course(curve)).max() < accuracy
    if line is lines.TAKENS_LP:
        assert curve["b2"].min() == -2


@pytest.mark.slow
@pytest.mark.parametrize("line", [lines.LINES["two pairs"], lines.TWO_ROTATIONS])
@pytest.mark.parametrize(("first", "other"), ["mk", "km"])
def test_from_two_pairs_the_curve_of_the_other_pair_is_followed(line, first, other) -> None:
    problem, inside = line.problem.at(m=-0.25, k=-0.2), {"m": (-0.5, 0.5), "k": (-0.5, 0.5)}
    point = cb.trace(problem, first, within=inside).first(line.kind)
    both = cb.boundary(point, (other, first), within=inside).first(line.known[0][0])
    curve = cb.boundary(both, (first, other), within=inside)
    assert np.ptp(curve[first]) == 1.0
    assert abs(curve[other]).max() < 1e-12


# --- flows ------------------------------------------------------------------------------------


def test_hopf_curve_ends_at_takens_bogdanov_as_neutral_saddles_are_no_hopf_points() -> None:
    for curve in (
        lines.walked(lines.TAKENS_HB),
        lines.TAKENS_HB.from_(lines.TAKENS_HB.first, events=()),
    ):
        assert Stop.EVENT in (curve.stop, curve.began)
        assert curve["b2"].max() < 1e-12
        assert abs(curve["omega2"] + curve["b2"]).max() < 1e-12


def test_without_hopf_among_the_events_a_fold_curve_knows_no_flow() -> None:
    line = replace(lines.TAKENS_LP, problem=replace(lines.TAKENS, events=(cb.fold(),)))
    assert lines.kinds(line.from_(line.first)) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "shuffle"),
    [
        (lines.TAKENS_LP, lambda u: u[::-1]),
        (lines.TAKENS_HB, lambda u: -u),
        (lines.TAKENS_LP, lambda u: 3.0 * u),
    ],
    ids=["turned round", "mirrored", "three times as large"],
)
def test_names_do_not_depend_on_the_coordinates(line, shuffle):
    """The same flow in other coordinates; ``3 u`` slows nothing down."""
    factor = 3.0 if abs(shuffle(np.ones(2))[0]) == 3.0 else 1.0

    def residual(u: Array, p: lines.Params) -> Array:
        return shuffle(lines.TAKENS.residual(shuffle(u) / factor**2, p))

    start = {"u": shuffle(np.array([0.5 + math.sqrt(0.3), 0.0]))}
    other = replace(line, problem=cb.Problem(residual, start, lines.TAKENS.params, events=ALL))
    curve = lines.walked(other)
    assert lines.kinds(curve) == ["BT"]
    lines.at(curve.first("BT"), b1=0, b2=0)


# --- Hopf curves that end where branches cross ------------------------------------------------


def transcritical_takens(u: Array, p: lines.Params) -> list[Any]:
    x, y = u
    return [y, p["b1"] * x + p["b2"] * y - x**2 - x * y]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("field", "events", "pair"),
    [
        (lines.symmetric_takens, ALL, ("b1", "b2")),
        (lines.symmetric_takens, (), ("b2", "b1")),
        (transcritical_takens, ALL[2:], ("b1", "b2")),
        (transcritical_takens, ALL, ("b2", "b1")),
    ],
    ids=["all", "none", "HB", "all of a transcritical one"],
)
def test_a_hopf_curve_reaches_a_bt_where_branches_cross_and_ends_there(field, events, pair):
    mine = lines.flow(field, lines.XY, b1=-0.5, b2=-0.5)
    point = cb.trace(mine, "b2", within=lines.UNIT, events=[cb.hopf()]).first("HB")
    curve = cb.boundary(point, pair, within=lines.UNIT, events=events)
    assert lines.kinds(curve) == ["BT"]
    assert curve.doubtful == ()
    end = curve.first("BT")
    lines.at(end, b1=0, b2=0)
    assert "branches cross here" in end.detail["degenerate"]
    assert curve["b1"].max() < 1e-9  # beyond are neutral saddles
    assert Stop.EVENT in (curve.stop, curve.began)


def test_the_other_hopf_curve_of_a_symmetric_bt_ends_there_as_well() -> None:
    curve = lines.walked(lines.LINES["other HB of a symmetric BT"])
    assert curve["x"].min() > -1e-8  # not on to the mirror image
    assert curve.first("BT").detail["degenerate"]


@pytest.mark.parametrize(
    ("name", "kind", "degenerate"),
    [
        ("LP of takens", "BT", False),
        ("HB of takens", "BT", False),
        ("NS that ends at a degenerate R1", "R1", True),
        ("NS that ends at the R1 of an odd map", "R1", True),
    ],
)
def test_a_meeting_is_called_degenerate_where_branches_cross(name, kind, degenerate) -> None:
    detail = lines.walked(lines.LINES[name]).first(kind).detail
    assert ("degenerate" in detail) == degenerate
    assert ("branches cross here" in detail.get("degenerate", "")) == degenerate


# --- maps -------------------------------------------------------------------------------------


def test_neimark_sacker_curve_of_henon_ends_at_both_double_multipliers() -> None:
    curve = lines.walked(lines.HENON["NS"])
    assert [point.label for point in curve.special] == ["R1.1", "R4.1", "R3.1", "R2.1"]
    assert (curve.began, curve.stop) == (Stop.EVENT, Stop.EVENT)
    assert curve["angle"].min() >= -1e-9
    assert curve["angle"].max() <= math.pi + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(("p2", "largest"), [(0.1, 0.02), (0.2, 0.1), (0.1, 1.0)])
def test_doublings_that_cross_have_one_label_that_names_both(p2: float, largest: float) -> None:
    line = replace(lines.DOUBLED_PREY, problem=eaten(p2))
    curve = line.from_(line.first, steps=cb.Steps(largest=largest))
    assert lines.kinds(curve) == ["PD-BP"]
    assert curve.doubtful == ()
    lines.at(curve.first("PD-BP"), p2=0.15, p1=3.0)


def test_where_doublings_cross_one_leads_to_the_other() -> None:
    for arm in cb.switch(lines.walked(lines.COEXISTING).first("PD-BP"), within=lines.PREY):
        assert abs(arm["p1"] - 3).max() < 1e-9  # without predators
        assert abs(arm["v"]).max() < 1e-9


# --- branch points as curves ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("broken", "start"),
    [
        (lambda x, p: x * (p["l"] - x**2) + p["h"], 0.0),  # unfolded to first order
        (lambda x, p: x**2 - p["l"] ** 2 + p["h"] ** 2, 0.5),  # a cone, to second order
    ],
)
@pytest.mark.parametrize("pair", [("l", "h"), ("h", "l")])
def test_branch_points_that_another_parameter_breaks_are_refused(broken, start, pair):
    mine = cb.Problem(broken, {"x": start}, {"l": -0.5, "h": 0.0}, events=ALL)
    point = cb.trace(mine, "l", within={"l": (-1, 1)}).first("BP")
    with pytest.raises(cb.BadInput, match="needs a third parameter"):
        cb.boundary(point, pair)


def test_branches_that_come_apart_slowly_are_no_curve_of_branch_points_either() -> None:
    mine = cb.Problem(
        lambda x, p: x * (p["l"] - x**2) + p["h"] ** 3, {"x": 0.0}, {"l": -0.5, "h": 0.0}
    )
    point = cb.trace(mine, "l", within={"l": (-1, 1)}, events=[cb.branch_point()]).first("BP")
    with pytest.raises(cb.NotConverged, match=r"come apart .* needs a third parameter"):
        cb.boundary(point, ("h", "l"))


def test_a_curve_of_branch_points_ends_at_the_wall_behind_which_branches_come_apart() -> None:
    mine = cb.Problem(
        lambda x, p: x * (p["l"] - x**2) + max(p["h"] - 0.5, 0.0) ** 2,
        {"x": 0.0}, {"l": -0.5, "h": 0.0},
        events=[cb.branch_point(), cb.Event("GR", lambda point: 0.5 - point["h"], ends="domain")],
    )  # fmt: skip
    point = cb.trace(mine, "l", within={"l": (-1, 1)}).first("BP")
    line = cb.boundary(point, ("h", "l"), within={"h": (0, 1)})
    assert (line[-1].kind, line[-1]["h"]) == ("BP-GR", pytest.approx(0.5, abs=1e-12))
    assert abs(line["split"]).max() < 1e-12


@pytest.mark.slow
def test_curves_of_branch_points_go_on_where_null_vectors_turn_by_more_than_a_right_angle() -> None:
    def pitchfork(x, p):  # at m = 0, the left null vector at the angle a and the right one at -2 a
        u, v = rotated(x, 2 * p["a"])
        return rotated([p["m"] * u - u**3, -v], p["a"])

    mine = cb.Problem(pitchfork, {"x": 0.0, "y": 0.0}, {"m": -0.5, "a": 0.1}, events=ALL)
    point = cb.trace(mine, "m", within={"m": (-1, 1)}).first("BP")
    line = cb.boundary(point, ("a", "m"), within={"a": (-4, 4)})
    assert [line["a"].min(), line["a"].max()] == [-4.0, 4.0]
    assert abs(line["m"]).max() < 1e-12
    assert line.doubtful == ()
    assert len(line) < 120  # 255 where the steps are short beside poles


@pytest.mark.slow
def test_crossing_boundaries_and_curves_of_branch_points_go_on_from_a_file(tmp_path: Path) -> None:
    problem = lines.DOUBLED_PREY.problem
    cb.save(tmp_path / "pd.nc", lines.walked(lines.DOUBLED_PREY))
    kept = cb.load(tmp_path / "pd.nc", problem=problem)
    assert lines.kinds(kept) == ["PD-BP"]
    line = cb.boundary(kept.first("PD-BP"), ("p2", "p1"), within=lines.PREY)
    cb.save(tmp_path / "bp.nc", line)
    again = cb.load(tmp_path / "bp.nc", problem=problem)
    assert lines.kinds(again) == lines.kinds(line) == ["BP-PD"]
    assert np.array_equal(again["p2"], line["p2"])


# --- Bazykin's predators and prey: everything at once -----------------------------------------


def bazykin(u: Sequence[Any], alpha: Any, delta: Any) -> list[Any]:
    x, y = u
    eaten = x * y / (1 + alpha * x)
    return [x - eaten - x * x / 100, -y + eaten - delta * y * y]


def defining(point: Point) -> tuple[float, float]:
    """Trace and determinant at BT, determinant and its slope along the null vector at CP."""
    x, y, alpha, delta = (point[name] for name in ("x", "y", "alpha", "delta"))

    def jacobian(x: float, y: float) -> Array:
        rate = 1 / (1 + alpha * x)
        own = 1 - y * rate**2 - x / 50, -1 + x * rate - 2 * delta * y
        return np.array([[own[0], -x * rate], [y * rate**2, own[1]]])

    A = jacobian(x, y)
    if point.kind == "BT":
        return np.trace(A), np.linalg.det(A)
    u, v = -A[0, 1], A[0, 0]
    along = slope(lambda h: np.linalg.det(jacobian(x + h * u, y + h * v)), 1e-3)
    return np.linalg.det(A), along


BAZYKIN = cb.Problem(
    lambda u, p: np.array(bazykin(u, p["alpha"], p["delta"])),
    {"x": 3.0, "y": 1.843},
    {"alpha": 0.3, "delta": 0.314},
    events=ALL,
)
LONG = cb.Steps(largest=2.0)
BAZYKIN_WINDOW = {"alpha": (0.01, 2.0), "delta": (0.0, 5.0), "x": (0.01, 200.0)}


@cache
def bazykin_folds() -> cb.Branch:
    within = {"delta": (0.0, 5.0), "x": (0.01, 150.0)}
    branch = cb.trace(BAZYKIN, "delta", within=within, steps=LONG)
    return cb.boundary(branch.first("LP"), ("alpha", "delta"), within=BAZYKIN_WINDOW, steps=LONG)


@pytest.mark.slow
def test_all_points_on_the_closed_fold_curve_of_bazykin() -> None:
    curve = bazykin_folds()
    assert curve.stop is Stop.CLOSED
    assert lines.kinds(curve) == ["CP", "BT", "CP", "BT"]
    for point in curve.special:
        assert defining(point) == pytest.approx((0.0, 0.0), abs=1e-9), point


@pytest.mark.slow
def test_generalised_hopf_of_bazykin_on_the_curve_that_starts_at_takens_bogdanov() -> None:
    """There the criticality changes."""
    far = max((p for p in bazykin_folds().special if p.kind == "BT"), key=lambda p: p["x"])
    curve = cb.boundary(far, ("alpha", "delta"), within=BAZYKIN_WINDOW, steps=LONG)
    assert lines.kinds(curve) == ["BT", "GH"]
    place = list(curve).index(curve.first("GH"))
    test = next(event.test for event in curve.problem.events if event.kind == "GH")
    assert test(curve[place - 1]) * test(curve[place + 1]) < 0


def takens(u, p):
    """The normal form of a double zero, with parameters named as its coefficients are."""
    x, y = u
    return np.array([y, p["a"] + p["b"] * y + x * x + 2 * x * y])


def test_a_coefficient_is_told_from_a_parameter_of_its_name() -> None:
    problem = cb.Problem(takens, {"x": 1.0, "y": 0.0}, {"a": -1.0, "b": 0.3})
    events = [cb.fold(), cb.hopf()]
    fold = cb.trace(problem, "a", within={"x": (-1, 2), "a": (-2, 1)}, events=events).first("LP")
    line = cb.boundary(fold, ("b", "a"), within={"b": (-1, 1)}, events=events)
    point = line.first("BT")
    assert (point["a"], point["b"]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert (point["a of BT"], point["b of BT"]) == pytest.approx((1.0, 2.0), abs=1e-7)
    assert point.detail["a"] == point["a of BT"]
    with pytest.raises(cb.BadInput, match="no 'c of BT' at this point"):
        point["c of BT"]


@pytest.mark.slow
def test_a_hopf_curve_on_which_a_real_eigenvalue_passes_zero_has_no_gh_there() -> None:
    """Beside ``w' = (a + i) w - |w|^2 w``, whose l1 is the same for all b: ``z' = b z - z^3``."""

    def flow(u, p):
        x, y, z = u
        square = x * x + y * y
        return np.array(
            [p["a"] * x - y - square * x, x + p["a"] * y - square * y, p["b"] * z - z**3]
        )

    problem = cb.Problem(flow, {"u": np.zeros(3)}, {"a": -0.5, "b": 0.5})
    point = cb.trace(problem, "a", within={"a": (-1, 1)}, events=[cb.hopf()]).first("HB")
    curve = cb.boundary(point, ("b", "a"), within={"b": (-1, 1)})
    assert (lines.kinds(curve), curve.doubtful) == ([], ())


@pytest.mark.slow
@pytest.mark.parametrize("sparse", [False, True])
def test_where_two_curves_of_branch_points_cross_there_is_no_takens_bogdanov_point(sparse) -> None:
    """A double zero, but with a null vector for each."""
    slow = np.array([1.0, 1.0, -1.0, -2.0, -3.0, -4.0, -5.0, -6.0, -7.0, -8.0])
    own = np.array([0.0, 1.0] + 8 * [0.0])

    def rates(p):
        return np.where(slow > 0, p["a"] + own * p["b"], slow)

    problem = cb.Problem(
        lambda u, p: rates(p) * u - u**3,
        {"u": np.zeros(10)},
        {"a": -0.5, "b": 0.3},
        jacobian=lambda u, p: (diags_array if sparse else np.diag)(rates(p) - 3 * u**2),
    )
    events = [cb.branch_point(), cb.hopf()]
    branch = cb.trace(problem, "a", within={"a": (-1, 1)}, events=events)
    curve = cb.boundary(branch.first("BP"), ("b", "a"), within={"b": (-1, 1)}, events=events)
    assert (lines.kinds(curve), curve.doubtful) == ([], ())
    assert np.ptp(curve["b"]) > 1.5


@pytest.mark.slow
def test_a_place_beside_a_branch_point_on_a_hopf_curve_of_a_sparse_problem_is_no_fold() -> None:
    """As far off as the location of a test leaves it, on a mesh, where the others are small, too:
    beside an oscillation a diffusion whose first mode begins to grow at b = 0."""
    n, first = 30, 4 * math.sin(math.pi / 62) ** 2
    diffusion = diags_array([1.0, first - 2.0, 1.0], offsets=[-1, 0, 1], shape=(n, n))

    def jacobian(u, p):
        pair = np.array([[p["a"], -1.0], [1.0, p["a"]]])
        return block_diag([pair, diffusion + diags_array(p["b"] - 2 * u[2:])], format="csc")

    def flow(u, p):
        pair = p["a"] * u[0] - u[1], u[0] + p["a"] * u[1]
        return np.array([*pair, *(diffusion @ u[2:] + p["b"] * u[2:] - u[2:] ** 2)])

    problem = cb.Problem(flow, {"u": np.zeros(n + 2)}, {"a": -0.5, "b": 0.02}, jacobian=jacobian)
    events = [cb.fold(), cb.branch_point(), cb.hopf()]
    point = cb.trace(problem, "a", within={"a": (-1, 1)}, events=events).first("HB")
    curve = cb.boundary(point, ("b", "a"), within={"b": (-0.02, 0.025)}, events=events)
    met = curve.first("HB-BP")
    beside = replace(met, z=met.z + 6e-9 * met.tangent / np.linalg.norm(met.tangent))
    (event,) = (event for event in curve.problem.events if event.kind == "ZH")
    assert "branch point, not a fold" in event.examine(beside)
