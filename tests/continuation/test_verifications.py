"""A point is called by a name only if it is what the name says: every reason to refuse one.

Each test takes an event that is public, or one that a boundary looks for, and asks it about a point
of another kind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import (
    Branch,
    Event,
    Point,
    Problem,
    boundary,
    branch_point,
    fold,
    hopf,
    trace,
    user,
)
from contbreather.continuation.curve import Curve
from contbreather.continuation.maps import FixedPoint
from contbreather.continuation.newton import Undefined

from .zoo import CUSP, LINE, PITCHFORK, Array, cusp_surface, takens, trace_case

FLOW = (fold(), hopf())


def reason(event: Event, point: Point, **detail: Any) -> str:
    """Why the event does not accept a point, of which it was told more."""
    assert event.examine is not None
    found = event.examine(replace(point, detail={**point.detail, **detail}))
    return found if isinstance(found, str) else ""


def looked_for(curve: Branch, kind: str) -> Event:
    """The event that a boundary looks for under this name."""
    (event,) = (event for event in curve.problem.events if event.kind == kind)
    return event


def flow(
    residual: Callable[[Array, Mapping[str, float]], Any],
    start: Mapping[str, float],
    params: Mapping[str, float],
) -> Problem:
    return Problem(lambda u, p: np.array(residual(u, p)), start, params)


def middle(branch: Branch) -> Point:
    """A point where nothing happens."""
    return next(point for point in branch[len(branch) // 2 :] if not point.kind)


# --- in one parameter -----------------------------------------------------------------------------


def test_a_fold_is_refused_where_the_derivative_is_regular() -> None:
    point = middle(trace(LINE.problem, "mu", within={"mu": (-1, 1)}))
    assert "regular" in reason(fold(), point, null=np.ones(1))


def test_a_fold_is_refused_where_curves_cross() -> None:
    problem = PITCHFORK.problem.at(x=0.0, mu=-0.5)
    branch = trace(problem, "mu", within={"mu": (-1, 1)}, events=[branch_point()])
    assert "a branch point, not a fold" in reason(fold(), branch.first("BP"), null=np.ones(1))


def test_a_fold_is_refused_without_its_null_vector() -> None:
    branch = trace_case(CUSP)
    assert reason(fold(), branch.first("LP")) == ""
    bare = replace(branch.first("LP"), detail={})
    assert "no null vector" in fold().examine(bare)


def test_a_branch_point_is_refused_where_the_derivative_keeps_its_rank() -> None:
    branch = trace_case(CUSP)
    event = branch_point()
    for point in (middle(branch), branch.first("LP")):
        assert "no two curves" in reason(event, point)
        with pytest.raises(Undefined):
            event.locus.solve(point)


def test_a_branch_point_is_refused_where_two_ranks_are_lost() -> None:
    """``mu x = mu y = 0``: at mu = 0 the plane of all x, y is crossed."""
    mine = flow(lambda u, p: [p["mu"] * u[0], p["mu"] * u[1]], {"x": 0.0, "y": 0.0}, {"mu": -1.0})
    branch = trace(mine, "mu", within={"mu": (-1, 1)}, events=[user("mu", 0.0)])
    event = branch_point()
    _, detail = event.locus.solve(branch.first("UZ"))
    assert "loses more than one rank" in detail["reason"]
    found = trace(mine, "mu", within={"mu": (-1, 1)}, events=[event])
    assert [point.kind for point in found.special] == ["EP", "EP"]
    assert [point.kind for point in found.doubtful] == ["BP"]


def test_a_count_beside_the_test_finds_two_branch_points_in_one_step() -> None:
    """``x ((mu - 0.5)^2 - e^2 - x^2) = 0`` on x = 0: both within one step of 0.4, the sign of the
    determinant is the same before and after."""
    e = 0.003
    mine = flow(
        lambda u, p: [u[0] * ((p["mu"] - 0.5) ** 2 - e**2 - u[0] ** 2)], {"x": 0.0}, {"mu": 0.1}
    )
    steps = cb.Steps(first=0.4, largest=0.4)
    branch = trace(mine, "mu", within={"mu": (0, 1)}, events=[branch_point()], steps=steps)
    found = [p["mu"] for p in branch.special if p.kind == "BP"]
    assert found == pytest.approx([0.5 - e, 0.5 + e], abs=1e-9)


def test_the_count_beside_branch_points_is_that_of_unstable_directions() -> None:
    """It changes by one at each, so that a pair in one step leaves a difference of two or none."""
    mine = flow(
        lambda u, p: [u[0] * (p["mu"] - u[0] ** 2), u[1] * (p["mu"] - 0.2 - u[1] ** 2), -u[2]],
        {"x": 0.0, "y": 0.0, "z": 0.0},
        {"mu": -0.5},
    )
    event = branch_point()
    branch = trace(mine, "mu", within={"mu": (-0.5, 0.5)}, events=[event])
    assert event.count is not None
    for point in branch:
        if not point.kind:
            assert event.count(point) == int(point["mu"] > 0) + int(point["mu"] > 0.2)


def test_a_hopf_point_is_refused_where_both_eigenvalues_are_zero() -> None:
    curve = trace(takens(), "b1", within={"b1": (-1, 1)}, events=FLOW)
    bt = boundary(curve.first("LP"), ("b2", "b1"), within={"b2": (-2, 2)}, events=FLOW).first("BT")
    there = replace(bt.ground, tangent=middle(curve).tangent)
    assert "a double zero eigenvalue" in reason(hopf(), there)


def test_a_user_s_event_needs_no_verification() -> None:
    assert user("mu", 0.3).examine is None


# --- on curves of folds and Hopf points -----------------------------------------------------------


@cache
def takens_folds() -> Branch:
    first = trace(takens(), "b1", within={"b1": (-1, 1)}, events=FLOW).first("LP")
    return boundary(first, ("b2", "b1"), within={"b2": (-2, 2)}, events=FLOW)


@cache
def takens_hopf() -> Branch:
    first = trace(takens(), "b1", within={"b1": (-1, 1)}, events=FLOW).first("HB")
    return boundary(first, ("b2", "b1"), within={"b2": (-2, 2)}, events=FLOW)


def test_a_double_zero_is_no_zero_hopf() -> None:
    zero_hopf = looked_for(takens_folds(), "ZH")
    assert "BT, not ZH" in reason(zero_hopf, takens_folds().first("BT"))


def test_a_fold_without_a_pair_on_the_axis_is_no_zero_hopf() -> None:
    zero_hopf = looked_for(takens_folds(), "ZH")
    assert "no pair on the imaginary axis" in reason(zero_hopf, takens_folds()[0])


def test_a_hopf_point_with_no_zero_beside_it_is_no_zero_hopf() -> None:
    zero_hopf = looked_for(takens_hopf(), "ZH")
    point = next(p for p in takens_hopf() if not p.kind)
    assert "no eigenvalue is zero" in reason(zero_hopf, point)


def test_a_simple_zero_is_no_takens_bogdanov_point() -> None:
    bt = looked_for(takens_folds(), "BT")
    assert "no double zero eigenvalue" in reason(bt, takens_folds()[0])


def test_a_degenerate_takens_bogdanov_point_is_said_to_be() -> None:
    """``x' = y, y' = b1 + b2 y + x^2 + x^2 y``: there is no term ``x y``, b = 0."""
    mine = flow(
        lambda u, p: [u[1], p["b1"] + p["b2"] * u[1] + u[0] ** 2 * (1.0 + u[1])],
        {"x": 0.0, "y": 0.0},
        {"b1": 0.0, "b2": 0.0},
    )
    point = trace(mine, "b2", within={"b2": (-1, 1)}, events=[user("b2", 0.0)])
    at_zero = next(p for p in point if p["b2"] == 0.0)
    both = Curve(at_zero.problem, ("b2", "b1"))
    ground = Point(both, both.start)
    words = reason(looked_for(takens_folds(), "BT"), ground)
    assert words.startswith("degenerate: a = 1, b = ")


def test_a_fold_that_is_flat_to_fourth_order_is_no_cusp() -> None:
    """``h + mu x + x^5``: the quadratic coefficient changes sign, the cubic one is zero there."""
    mine = flow(
        lambda u, p: [p["h"] + p["mu"] * u[0] + u[0] ** 5], {"x": 0.9}, {"mu": -1.0, "h": 0.3}
    )
    first = trace(mine, "h", within={"x": (-1, 1)}, events=[fold()]).first("LP")
    curve = boundary(first, ("mu", "h"), within={"mu": (-1, 0.5), "x": (-0.6, 0.9)})
    assert [p for p in curve.special if p.kind == "CP"] == []
    cusp = looked_for(curve, "CP")
    surface = cusp_surface(-0.9, 1.0)
    ordinary = trace(surface, "h", within={"x": (-2, 2)}, events=[fold()]).first("LP")
    cusps = boundary(ordinary, ("mu", "h"), within={"mu": (-1, 2)}, events=[fold()])
    assert reason(cusp, cusps.first("CP")) == ""
    assert "the quadratic coefficient" in reason(cusp, cusps[0])
    flat = replace(curve[0], z=np.where(np.arange(curve[0].z.size) == 1, 1.0, 0.0))
    assert "the cubic coefficient vanishes as well" in reason(cusp, flat)


def bautin(beside: float) -> Problem:
    """l1 = 2 b2, beside a pair with real part ``b2 + beside``."""

    def residual(u: Array, p: Mapping[str, float]) -> Any:
        x, y, z, w = u
        r = x * x + y * y
        near = p["b2"] + beside
        return [
            p["b1"] * x - y + p["b2"] * x * r - x * r * r,
            x + p["b1"] * y + p["b2"] * y * r - y * r * r,
            near * z - 1.7 * w,
            1.7 * z + near * w,
        ]

    return flow(residual, dict.fromkeys("xyzw", 0.0), {"b1": -0.5, "b2": -0.3})


@cache
def bautin_curve(beside: float) -> Branch:
    first = trace(bautin(beside), "b1", within={"b1": (-1, 1)}, events=FLOW).first("HB")
    return boundary(first, ("b2", "b1"), within={"b2": (-0.5, 0.4)}, events=FLOW)


def test_generalised_and_double_hopf_points_are_told_from_ordinary_ones() -> None:
    curve = bautin_curve(-0.2)
    ordinary = curve[0]
    assert "the first Lyapunov coefficient -1 is not zero" in reason(
        looked_for(curve, "GH"), ordinary
    )
    assert "not two pairs on the imaginary axis" in reason(looked_for(curve, "HH"), ordinary)
    assert [p.kind for p in curve.special if p.kind != "EP"] == ["GH", "HH"]
    assert [p["b2"] for p in curve.special if p.kind != "EP"] == pytest.approx([0, 0.2], abs=1e-9)


def test_a_vanishing_lyapunov_coefficient_beside_another_pair_is_no_generalised_hopf() -> None:
    point = bautin_curve(-0.2).first("GH")
    wide = bautin_curve(0.0)
    there = replace(wide[0], z=np.where(abs(point.z) < 1e-9, 0.0, point.z))
    assert "more than one pair" in reason(looked_for(wide, "GH"), there)


# --- of maps --------------------------------------------------------------------------------------


def of_map(
    image: Callable[[Array, Mapping[str, float]], Any], start: Mapping[str, float], m: float
) -> Problem:
    return FixedPoint(lambda u, p: np.array(image(u, p)), start, {"m": m, "n": 0.0})


def event_of(problem: Problem, kind: str) -> Event:
    (event,) = (event for event in problem.events if event.kind == kind)
    return event


TWO = {"x": 0.0, "y": 0.0}


def linear(one: float, other: float, shear: float = 0.0) -> Point:
    """The fixed point 0 of a map with these multipliers."""
    return at_origin(
        lambda u, p: [(one + p["m"]) * u[0] + shear * u[1], other * u[1] + p["m"] * u[1]]
    )


def at_origin(image: Callable[[Array, Mapping[str, float]], Any]) -> Point:
    problem = of_map(image, TWO, 0.0)
    branch = trace(problem, "m", within={"m": (-0.01, 0.01)}, events=[user("m", 0.0)])
    return next(p for p in branch if p["m"] == 0.0 or p.kind == "UZ")


def test_a_period_doubling_needs_a_multiplier_minus_one() -> None:
    point = linear(-0.5, 0.3)
    doubling = event_of(point.problem, "PD")
    assert "no multiplier is -1: the nearest is 0.5 off" in reason(doubling, point)
    assert reason(doubling, linear(-1.0, 0.3)) == ""


def test_two_multipliers_minus_one_are_no_simple_period_doubling() -> None:
    point = linear(-1.0, -1.0)
    assert "two multipliers are -1, with two eigenvectors" in reason(
        event_of(point.problem, "PD"), point
    )


@pytest.mark.parametrize(("sign", "name"), [(1.0, "R1"), (-1.0, "R2")])
def test_a_double_real_multiplier_is_no_neimark_sacker_point(sign: float, name: str) -> None:
    point = linear(sign, sign, shear=1.0)
    words = reason(event_of(point.problem, "NS"), point)
    assert words == f"both multipliers are {sign:.0f}: the resonance {name}"


def henon(alpha: float, beta: float, y: float) -> Problem:
    return FixedPoint(
        lambda u, p: np.array([u[1], p["alpha"] - p["beta"] * u[0] - u[1] ** 2]),
        {"x": y, "y": y},
        {"alpha": alpha, "beta": beta},
    )


@cache
def henon_curve(kind: str) -> Branch:
    free = "beta" if kind == "NS" else "alpha"
    within = {"beta": (0.0, 2.0)} if kind == "NS" else {"alpha": (-3, 4), "y": (-3, 3)}
    first = trace(henon(1.0, 0.5, 0.5 if kind == "NS" else 0.6), free, within=within).first(kind)
    pair = ("alpha", "beta") if kind == "NS" else ("beta", "alpha")
    return boundary(first, pair, within={"alpha": (-3.0, 4.0), "beta": (-2.0, 3.0)})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("curve", "kind", "words"),
    [
        ("LP", "R1", "multipliers are 1; two were expected"),
        ("PD", "R2", "multipliers are -1; two were expected"),
        ("NS", "R1", "multipliers are 1; two were expected"),
        ("NS", "R2", "multipliers are -1; two were expected"),
        ("LP", "LPPD", "where +1 and -1 are expected"),
        ("PD", "LPPD", "where +1 and -1 are expected"),
        ("LP", "LPNS", "where +1 and pair are expected"),
        ("PD", "PDNS", "where -1 and pair are expected"),
        ("PD", "GPD", "the coefficient c = "),
    ],
)
def test_a_point_of_a_curve_of_maps_where_nothing_is_met_has_no_name(
    curve: str, kind: str, words: str
) -> None:
    line = henon_curve(curve)
    ordinary = next(p for p in line if not p.kind and (curve == "NS" or 0.2 < p["beta"] < 0.9))
    assert words in reason(looked_for(line, kind), ordinary)


def test_a_neimark_sacker_curve_is_chenciner_only_where_the_real_part_vanishes() -> None:
    def polar(u: Array, p: Mapping[str, float]) -> Array:
        square = u[0] ** 2 + u[1] ** 2
        factor = 1 + p["m"] + p["s"] * square - square**2
        c, s = np.cos(1.0), np.sin(1.0)
        return factor * np.array([c * u[0] - s * u[1], s * u[0] + c * u[1]])

    mine = FixedPoint(polar, {"x": 0.0, "y": 0.0}, {"m": -0.3, "s": -0.5})
    first = trace(mine, "m", within={"m": (-0.9, 0.5)}).first("NS")
    curve = boundary(first, ("s", "m"), within={"s": (-1, 1)})
    assert "Re d = " in reason(looked_for(curve, "CH"), curve[0])


@pytest.mark.parametrize("third", [1.0002, -0.9999, 0.99999])
def test_the_pair_is_followed_though_a_real_multiplier_is_nearer_to_the_circle(third) -> None:
    c, s = np.cos(1.1), np.sin(1.1)

    def image(u: Array, p: Mapping[str, float]) -> Any:
        x, y, z = u
        grow = 1 + p["m"] + 0.1 * z
        return [grow * (c * x - s * y), grow * (s * x + c * y), third * z + x * x]

    mine = of_map(image, {"x": 0.0, "y": 0.0, "z": 0.0}, -0.31)
    events = [event_of(mine, "NS")]
    branch = trace(mine, "m", within={"m": (-0.4, 0.35)}, events=events)
    (point,) = (p for p in branch.special if p.kind == "NS")
    assert point["m"] == pytest.approx(0.0, abs=1e-10)
    assert point.detail["angle"] == pytest.approx(1.1, abs=1e-9)
    located = event_of(mine, "NS").locus(middle(branch))
    assert located.extra["cosine"] == pytest.approx(c, abs=1e-9)


def test_two_multipliers_one_with_two_eigenvectors_are_no_resonance() -> None:
    point = linear(1.0, 1.0)
    words = reason(looked_for(henon_curve("LP"), "R1"), point)
    assert words == "two multipliers are 1, with two eigenvectors"


# --- of orbits with impacts ---------------------------------------------------------------------


@cache
def single_arm() -> Branch:
    """Unequal flights of a single oscillator, up to its period doubling at a = 0.925512006293."""
    from contbreather.breathers.arms import asymmetric

    arm = asymmetric(0.85, 0.0, 0.8, lattice=cb.Ring(1)).problem
    return trace(arm, "a", towards="up", within={"a": (0.8, 0.95)})


def test_a_period_doubling_of_an_orbit_is_one_and_no_other_point_is() -> None:
    point = single_arm().first("PD")
    assert point["a"] == pytest.approx(0.925512006293, abs=1e-11)
    assert reason(point.event, point) == ""
    ordinary = next(p for p in single_arm() if not p.kind)
    assert "D(-1) = " in reason(point.event, ordinary)


def test_a_pair_that_turns_real_is_no_neimark_sacker_point_of_an_orbit() -> None:
    from contbreather.breathers.arms import asymmetric

    arm = asymmetric(0.82, 0.04, 0.8).problem
    (event,) = (event for event in arm.events if event.kind == "NS")
    point = trace(arm, "a", within={"a": (0.819, 0.821)}, events=())[0]
    assert "no angle solves" in reason(event, point)
    for nu in (0.0, 1e-8, 1.0, 1.0 - 1e-9):
        assert "a real multiplier passes the circle" in reason(event, point, nu=nu)
    assert reason(event, point, nu=0.4) == ""


# --- the start ----------------------------------------------------------------------------------


def circle(u: Array, p: Mapping[str, float]) -> Any:
    return [3.0 * (u[0] ** 2 + p["mu"] ** 2 - 1.0)]


@pytest.mark.parametrize(("x", "tolerance"), [(0.7, 1e-3), (0.6 + 2e-15, 1e-12)])
def test_the_first_point_has_the_residual_of_the_equations_there(x, tolerance) -> None:
    """Of a start that is solved for, and of one that is a solution to rounding."""
    problem = flow(circle, {"x": x}, {"mu": 0.8})
    steps = cb.Steps(tolerance=tolerance)
    branch = trace(problem, "mu", towards="up", within={"mu": (0.7, 0.9)}, steps=steps)
    assert branch[0]["mu"] == 0.8
    assert branch[0].residual == float(abs(branch[0].curve.equations(branch[0].z)).max()) > 0


def test_a_start_in_a_given_direction_keeps_its_residual() -> None:
    problem = flow(circle, {"x": 0.6 + 1e-8}, {"mu": 0.8})
    branch = trace(problem, "mu", along=(-0.8, 0.6), within={"mu": (0.7, 0.9)})
    off = abs(circle([0.6 + 1e-8], {"mu": 0.8})[0])
    assert branch[0].residual == pytest.approx(off, rel=1e-6)


# --- two bounds in one step -----------------------------------------------------------------------


@pytest.mark.parametrize("largest", [0.05, 0.5, 2.0])
@pytest.mark.parametrize(("first", "rim"), [("x", (0.31, 0.6)), ("y", (0.6, 0.31))])
def test_of_two_bounds_in_one_step_the_nearer_one_ends_the_branch(largest, first, rim) -> None:
    """On ``x = y = mu`` from 0; both windows are left within a step of 0.5 or 2."""
    mine = flow(lambda u, p: [u[0] - p["mu"], u[1] - p["mu"]], {"x": 0.0, "y": 0.0}, {"mu": 0.0})
    branch = trace(
        mine,
        "mu",
        towards="up",
        within={"x": (-1, rim[0]), "y": (-1, rim[1]), "mu": (-1, 0.65)},
        steps=cb.Steps(first=largest, largest=largest),
    )
    end = branch[-1]
    assert end[first] == 0.31
    assert (end["x"], end["y"], end["mu"]) == pytest.approx((0.31,) * 3, abs=1e-12)
    assert branch.stop is cb.continuation.Stop.BOUND


@pytest.mark.parametrize("largest", [0.1, 1.0, 3.0])
def test_no_point_is_beyond_a_bound_that_only_the_bent_curve_crosses(largest: float) -> None:
    """On ``y = x^2/10`` the window of y ends a little before that of x; along the tangent at the
    start y does not change at all."""
    mine = flow(
        lambda u, p: [u[0] - p["mu"], u[1] - 0.1 * u[0] ** 2], {"x": 0.0, "y": 0.0}, {"mu": 0.0}
    )
    branch = trace(
        mine,
        "mu",
        towards="up",
        within={"x": (-1, 0.9), "y": (-1, 0.08), "mu": (-1, 2)},
        steps=cb.Steps(first=largest, largest=largest),
    )
    assert branch["y"].max() == branch[-1]["y"] == 0.08
    assert branch[-1]["x"] == pytest.approx(0.8**0.5, abs=1e-12)
