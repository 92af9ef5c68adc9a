"""A point is called by a name only if it is what the name says: every reason to refuse one.

Each test takes an event that is public, or one that a boundary looks for, and asks it about a point
of another kind.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Point
from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.curve.curve import Curve

from . import lines
from .zoo import CUSP, LINE, PITCHFORK, TAKENS, Array, rotated, trace_case


def reason(event: cb.Event, point: Point, **detail: Any) -> str:
    """Why the event does not accept a point, of which it was told more."""
    assert event.examine is not None
    found = event.examine(replace(point, detail={**point.detail, **detail}))
    return found if isinstance(found, str) else ""


def looked_for(on: cb.Problem, kind: str) -> cb.Event:
    """The event that is looked for under this name on a branch, or on a boundary."""
    (event,) = (event for event in on.events if event.kind == kind)
    return event


def middle(branch: cb.Branch) -> Point:
    """A point where nothing happens."""
    return next(point for point in branch[len(branch) // 2 :] if not point.kind)


# --- in one parameter -----------------------------------------------------------------------------


def test_a_fold_is_refused_where_it_is_none() -> None:
    regular = middle(cb.trace(LINE.problem, "mu", within={"mu": (-1, 1)}))
    assert "regular" in reason(cb.fold(), regular, null=np.ones(1))
    branch = cb.trace(PITCHFORK.problem, "mu", within={"mu": (-1, 1)}, events=[cb.branch_point()])
    assert "a branch point, not a fold" in reason(cb.fold(), branch.first("BP"), null=np.ones(1))
    assert reason(cb.fold(), trace_case(CUSP).first("LP")) == ""


def test_no_fold_is_on_a_line_of_solutions_at_one_parameter() -> None:
    """Two species that compete and are alike at r = 1 live beside each other in any shares."""

    def shares(u: Array, p: lines.Params) -> Array:
        x, y = u
        return np.array([x * np.exp(0.3 * y) * (1 - x - y), y * (1 + x**2) * (p["r"] - x - y)])

    events, within = [cb.fold(), cb.branch_point()], {"x": (0, 2), "y": (0, 2), "r": (0.2, 2)}
    alone = cb.trace(cb.Problem(shares, {"x": 1.0, "y": 0.0}, {"r": 0.5}), "r", within=within,
                     events=events)  # fmt: skip
    arms = cb.switch(alone.first("BP"), within=within)
    kinds = [point.kind for arm in arms for point in (*arm.special, *arm.doubtful)]
    assert max(np.ptp(arm["x"]) for arm in arms) == pytest.approx(1.0)
    assert max(np.ptp(arm["r"]) for arm in arms) < 1e-14
    assert "LP" not in kinds


def test_a_branch_point_is_refused_where_the_derivative_keeps_its_rank() -> None:
    branch = trace_case(CUSP)
    event = cb.branch_point()
    for point in (middle(branch), branch.first("LP")):
        assert "no two curves" in reason(event, point)
        with pytest.raises(Undefined):
            event.locus.solve(point)


def test_a_branch_point_is_refused_where_two_ranks_are_lost() -> None:
    """``mu x = mu y = 0``: at mu = 0 the plane of all x, y is crossed."""
    mine = lines.flow(lambda u, p: [p["mu"] * u[0], p["mu"] * u[1]], lines.XY, mu=-1.0)
    branch = cb.trace(mine, "mu", within={"mu": (-1, 1)}, events=[cb.user("mu", 0.0)])
    event = cb.branch_point()
    _, detail = event.locus.solve(branch.first("UZ"))
    assert "loses more than one rank" in detail["reason"]
    found = cb.trace(mine, "mu", within={"mu": (-1, 1)}, events=[event])
    assert [point.kind for point in found.special] == ["EP", "EP"]
    assert [point.kind for point in found.doubtful] == ["BP"]


def test_the_count_beside_branch_points_is_that_of_unstable_directions() -> None:
    """It changes by one at each, so that a pair in one step leaves a difference of two or none."""
    mine = lines.flow(
        lambda u, p: [u[0] * (p["mu"] - u[0] ** 2), u[1] * (p["mu"] - 0.2 - u[1] ** 2), -u[2]],
        lines.XYZ,
        mu=-0.5,
    )
    event = cb.branch_point()
    branch = cb.trace(mine, "mu", within={"mu": (-0.5, 0.5)}, events=[event])
    assert event.count is not None
    for point in branch:
        if not point.kind:
            assert event.count(point) == int(point["mu"] > 0) + int(point["mu"] > 0.2)


def test_a_hopf_point_is_refused_where_both_eigenvalues_are_zero() -> None:
    there = replace(
        lines.walked(lines.TAKENS_LP).first("BT").base_point,
        tangent=middle(trace_case(TAKENS)).tangent,
    )
    assert "a double 0: BT" in reason(cb.hopf(), there)


# --- on boundaries --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "kind", "words"),
    [
        (lines.TAKENS_LP, "ZH", "where only 0 and a pair should be"),
        (lines.TAKENS_LP, "BT", "no double zero eigenvalue"),
        (lines.TAKENS_HB, "ZH", "where only 0 and a pair should be"),
        (lines.BAUTIN, "GH", "the first Lyapunov coefficient -1 is not zero"),
        (lines.BAUTIN, "HH", "where only a pair and a pair should be"),
        (lines.HENON["LP"], "R1", "multipliers are 1; two were expected"),
        (lines.HENON["PD"], "R2", "multipliers are -1; two were expected"),
        (lines.HENON["NS"], "R1", "multipliers are 1; two were expected"),
        (lines.HENON["NS"], "R2", "multipliers are -1; two were expected"),
        (lines.HENON["LP"], "LPPD", "where only +1 and -1 should be"),
        (lines.HENON["PD"], "LPPD", "where only +1 and -1 should be"),
        (lines.HENON["LP"], "LPNS", "where only +1 and a pair should be"),
        (lines.HENON["PD"], "PDNS", "where only -1 and a pair should be"),
        (lines.HENON["PD"], "GPD", "the coefficient c = "),
        (lines.CHENCINER, "CH", "Re d = "),
    ],
    ids=lambda given: given.name if isinstance(given, lines.Line) else None,
)
def test_a_point_of_a_boundary_where_nothing_is_met_has_no_name(line, kind, words):
    curve, away = lines.walked(line), line in (lines.HENON["LP"], lines.HENON["PD"])
    ordinary = (
        curve[0]
        if line is lines.BAUTIN
        else next(p for p in curve if not p.kind and (not away or 0.2 < p["beta"] < 0.9))
    )
    assert words in reason(looked_for(curve.problem, kind), ordinary)


def test_a_double_zero_is_no_zero_hopf() -> None:
    curve = lines.walked(lines.TAKENS_LP)
    assert "where only 0 and a pair should be" in reason(
        looked_for(curve.problem, "ZH"), curve.first("BT")
    )


def test_a_degenerate_takens_bogdanov_point_is_said_to_be() -> None:
    """``x' = y, y' = b1 + b2 y + x^2 + x^2 y``: there is no term ``x y``, b = 0."""
    mine = lines.flow(
        lambda u, p: [u[1], p["b1"] + p["b2"] * u[1] + u[0] ** 2 * (1.0 + u[1])],
        lines.XY, b1=0.0, b2=0.0,
    )  # fmt: skip
    both = Curve(mine, ("b2", "b1"))
    words = reason(looked_for(lines.walked(lines.TAKENS_LP).problem, "BT"), Point(both, both.start))
    assert words.startswith("degenerate: a = 1, b = ")


@pytest.mark.slow
def test_a_fold_that_is_flat_to_fourth_order_is_no_cusp() -> None:
    """``h + mu x + x^5``: the quadratic coefficient changes sign, the cubic one is zero there."""
    mine = lines.flow(lambda u, p: p["h"] + p["mu"] * u + u**5, {"x": 0.9}, mu=-1.0, h=0.3)
    first = cb.trace(mine, "h", within={"x": (-1, 1)}, events=[cb.fold()]).first("LP")
    curve = cb.boundary(first, ("mu", "h"), within={"mu": (-1, 0.5), "x": (-0.6, 0.9)})
    assert [p for p in curve.special if p.kind == "CP"] == []
    cusp, cusps = looked_for(curve.problem, "CP"), lines.walked(lines.LINES["cusp"])
    assert reason(cusp, cusps.first("CP")) == ""
    assert "the quadratic coefficient" in reason(cusp, cusps[0])
    flat = replace(curve[0], z=np.where(np.arange(curve[0].z.size) == 1, 1.0, 0.0))
    assert "the cubic coefficient vanishes as well" in reason(cusp, flat)


@pytest.mark.slow
def test_parameters_of_a_cusp_are_measured_in_their_scales() -> None:
    """As fluxes of a catalytic reaction, of 1e-5 beside coverages of order one."""
    surface = cb.Problem(
        lambda x, p: 1e6 * (p["h"] + (p["mu"] - 2e-5) * x) - x**3,
        {"x": 1.0},
        {"mu": 3e-5, "h": -9e-6},
        scales={"mu": 1e-5, "h": 1e-5},
    )
    within = {"x": (-3, 4), "mu": (1e-5, 4e-5)}
    fold = cb.trace(surface, "h", within=within, events=[cb.fold()]).first("LP")
    line = cb.boundary(fold, ("mu", "h"), within=within)
    assert line.first("CP")["mu"] == pytest.approx(2e-5, abs=1e-12)
    assert not line.doubtful


@pytest.mark.slow
def test_a_fold_at_which_another_mode_buckles_is_no_cusp() -> None:
    def arch(u, p):  # two modes of a shallow arch: the second buckles on the fold at h^2 = 22
        strain = (u[0] ** 2 - p["h"] ** 2) / 4 + u[1] ** 2
        return np.array([p["h"] - p["load"] - u[0] * (1 + strain), -4 * u[1] * (4 + strain)])

    problem = cb.Problem(arch, {"u": 6.0, "v": 0.0}, {"h": 6.0, "load": 0.0})
    fold = cb.trace(problem, "load", within={"load": (-60, 60)}, events=[cb.fold()]).first("LP")
    line = cb.boundary(fold, ("load", "h"), within={"load": (-100, 100), "h": (1, 12)})
    (only,) = (point for point in line.special if point.kind == "CP")
    assert (only["h"], only["load"]) == pytest.approx((2.0, 2.0), abs=1e-9)
    assert line.doubtful[0]["h"] ** 2 == pytest.approx(22.0, abs=1e-6)


def test_a_vanishing_lyapunov_coefficient_beside_another_pair_is_no_generalised_hopf() -> None:
    point, wide = lines.walked(lines.BAUTIN).first("GH"), lines.walked(lines.BAUTIN_AT_ONCE)
    there = replace(wide[0], z=np.where(abs(point.z) < 1e-9, 0.0, point.z))
    assert "where only a pair should be" in reason(looked_for(wide.problem, "GH"), there)


# --- of maps --------------------------------------------------------------------------------------


def linear(one: float, other: float, shear: float = 0.0) -> Point:
    """The fixed point 0 of a map with these multipliers."""
    problem = lines.of_map(
        lambda u, p: [(one + p["m"]) * u[0] + shear * u[1], other * u[1] + p["m"] * u[1]],
        lines.XY, m=0.0, n=0.0,
    )  # fmt: skip
    branch = cb.trace(problem, "m", within={"m": (-0.01, 0.01)}, events=[cb.user("m", 0.0)])
    return next(p for p in branch if p["m"] == 0.0 or p.kind == "UZ")


@pytest.mark.parametrize(
    ("kind", "multipliers", "words"),
    [
        ("PD", (-1.0, 0.3), ""),
        ("PD", (-0.5, 0.3), "no multiplier is -1: the nearest is 0.5 off"),
        ("PD", (-1.0, -1.0), "two multipliers are -1, with two eigenvectors: not a simple perio"),
        ("NS", (1.0, 1.0, 1.0), "a double +1: R1, no pair on the unit circle"),
        ("NS", (-1.0, -1.0, 1.0), "a double -1: R2, no pair on the unit circle"),
    ],
)
def test_fixed_points_of_maps_are_told_from_others(kind, multipliers, words):
    point = linear(*multipliers)
    found = reason(looked_for(point.problem, kind), point)
    assert found.startswith(words)
    assert bool(found) == bool(words)


def test_two_multipliers_one_with_two_eigenvectors_are_no_resonance() -> None:
    words = reason(looked_for(lines.walked(lines.HENON["LP"]).problem, "R1"), linear(1.0, 1.0))
    assert words == "two multipliers are 1, with two eigenvectors"


@pytest.mark.parametrize("third", [1.0002, -0.9999, 0.99999])
def test_the_pair_is_followed_though_a_real_multiplier_is_nearer_to_the_circle(third) -> None:
    def image(u: Array, p: lines.Params) -> Any:
        x, y, z = u
        grow = 1 + p["m"] + 0.1 * z
        return [*(grow * part for part in rotated((x, y), 1.1)), third * z + x * x]

    mine = lines.of_map(image, lines.XYZ, m=-0.31)
    events = [looked_for(mine, "NS")]
    branch = cb.trace(mine, "m", within={"m": (-0.4, 0.35)}, events=events)
    (point,) = (p for p in branch.special if p.kind == "NS")
    assert point["m"] == pytest.approx(0.0, abs=1e-10)
    assert point.detail["angle"] == pytest.approx(1.1, abs=1e-9)
    located = events[0].locus(middle(branch))
    assert located.extra["angle"] == pytest.approx(1.1, abs=1e-9)


# --- of orbits with impacts ---------------------------------------------------------------------


@cache
def single_arm() -> cb.Branch:
    """Unequal flights of a single oscillator, up to its period doubling at a = 0.925512006293."""
    from contbreather.orbits.constructors import asymmetric

    arm = asymmetric(0.85, 0.0, 0.8, lattice=cb.Ring(1)).problem
    return cb.trace(arm, "a", towards="up", within={"a": (0.8, 0.95)})


def test_a_period_doubling_of_an_orbit_is_one_and_no_other_point_is() -> None:
    point = single_arm().first("PD")
    assert point["a"] == pytest.approx(0.925512006293, abs=1e-11)
    assert reason(point.event, point) == ""
    ordinary = next(p for p in single_arm() if not p.kind)
    assert "D(-1) = " in reason(point.event, ordinary)


def test_a_pair_that_turns_real_is_no_neimark_sacker_point_of_an_orbit() -> None:
    from contbreather.orbits.constructors import asymmetric

    arm = asymmetric(0.82, 0.04, 0.8).problem
    (event,) = (event for event in arm.events if event.kind == "NS")
    point = cb.trace(arm, "a", within={"a": (0.819, 0.821)}, events=())[0]
    assert "no angle solves" in reason(event, point)
    for nu in (0.0, 1e-8, 1.0, 1.0 - 1e-9):
        assert "a real multiplier passes the circle" in reason(event, point, nu=nu)
    assert reason(event, point, nu=0.4) == ""


# --- the start ----------------------------------------------------------------------------------


def circle(u: Array, p: lines.Params) -> Any:
    return [3.0 * (u[0] ** 2 + p["mu"] ** 2 - 1.0)]


@pytest.mark.parametrize(("x", "tolerance"), [(0.7, 1e-3), (0.6 + 2e-15, 1e-12)])
def test_the_first_point_has_the_residual_of_the_equations_there(x, tolerance) -> None:
    """Of a start that is solved for, and of one that is a solution to rounding."""
    problem = lines.flow(circle, {"x": x}, mu=0.8)
    steps = cb.Steps(tolerance=tolerance)
    branch = cb.trace(problem, "mu", towards="up", within={"mu": (0.7, 0.9)}, steps=steps)
    assert branch[0]["mu"] == 0.8
    assert branch[0].residual == float(abs(branch[0].curve.equations(branch[0].z)).max()) > 0


def test_a_start_in_a_given_direction_keeps_its_residual() -> None:
    problem = lines.flow(circle, {"x": 0.6 + 1e-8}, mu=0.8)
    branch = cb.trace(problem, "mu", along=(-0.8, 0.6), within={"mu": (0.7, 0.9)})
    off = abs(circle([0.6 + 1e-8], {"mu": 0.8})[0])
    assert branch[0].residual == pytest.approx(off, rel=1e-6)


# --- two bounds in one step -----------------------------------------------------------------------


@pytest.mark.parametrize("largest", [0.05, 0.5, 2.0])
@pytest.mark.parametrize(("first", "edge"), [("x", (0.31, 0.6)), ("y", (0.6, 0.31))])
def test_of_two_bounds_in_one_step_the_nearer_one_ends_the_branch(largest, first, edge) -> None:
    """On ``x = y = mu`` from 0; both windows are left within a step of 0.5 or 2."""
    mine = lines.flow(lambda u, p: [u[0] - p["mu"], u[1] - p["mu"]], lines.XY, mu=0.0)
    branch = cb.trace(
        mine,
        "mu",
        towards="up",
        within={"x": (-1, edge[0]), "y": (-1, edge[1]), "mu": (-1, 0.65)},
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
    mine = lines.flow(lambda u, p: [u[0] - p["mu"], u[1] - 0.1 * u[0] ** 2], lines.XY, mu=0.0)
    branch = cb.trace(
        mine,
        "mu",
        towards="up",
        within={"x": (-1, 0.9), "y": (-1, 0.08), "mu": (-1, 2)},
        steps=cb.Steps(first=largest, largest=largest),
    )
    assert branch["y"].max() == branch[-1]["y"] == 0.08
    assert branch[-1]["x"] == pytest.approx(0.8**0.5, abs=1e-12)


@pytest.mark.parametrize(
    ("unit", "size", "offset", "scales"),
    [
        (1e-6, 1.0, 0.0, {}),
        (1e-6, 1.0, 0.0, {"scales": {"x": 1e-6, "mu": 1e-6}}),
        (1.0, 1e9, 0.0, {}),
        *((1.0, 1.0, offset, {}) for offset in (1e3, 1e6, -1e8)),
    ],
)
def test_a_fold_is_found_whatever_the_units_and_sizes(unit, size, offset, scales) -> None:
    """``unit^2 mu = (x - offset)^2`` for mu in units, times a size."""

    def residual(x: Array, p: lines.Params) -> Array:
        return np.array([size * ((x[0] - offset) ** 2 / unit - p["mu"])])

    mine = cb.Problem(residual, {"x": offset + 0.7 * unit}, {"mu": 0.49 * unit}, **scales)
    events, within = [cb.fold(), cb.branch_point()], {"mu": (-unit, unit)}
    branch = cb.trace(mine, "mu", within=within, events=events)
    assert branch.first("LP")["mu"] == pytest.approx(0.0, abs=1e-9 * unit)
    assert [point.kind for point in (*branch.special, *branch.doubtful)] == ["EP", "LP", "EP"]


def on_a_square(b: float, fast: float, mixed: Array) -> cb.Problem:
    """Two modes that a square makes alike, on an arm of one, with a fast variable beside."""

    def residual(w: Array, p: lines.Params) -> Array:
        x, y, z = w
        own = [x * (p["mu"] - x**2 - b * y**2), y * (p["mu"] - y**2 - b * x**2)]
        return mixed @ np.array([*own, -fast * (z - x**2 / 2 - y**2)])

    return cb.Problem(residual, {"x": 1.3, "y": 0.0, "z": 0.845}, {"mu": 1.69})


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_where_two_ranks_are_lost_the_turn_of_an_arm_is_no_fold(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = on_a_square(rng.uniform(1.5, 6), 10 ** rng.uniform(0, 4), rng.normal(size=(3, 3)))
    events = [cb.fold(), cb.branch_point()]
    branch = cb.trace(problem, "mu", within={"mu": (-1, 2)}, events=events)
    assert branch["x"].min() < -1  # it goes through the origin, where mu turns
    assert "LP" not in {point.kind for point in branch.special}
    assert "BP" in {point.kind for point in (*branch.special, *branch.doubtful)}


def test_where_the_whole_derivative_vanishes_no_pair_is_on_the_axis() -> None:
    def residual(w: Array, p: lines.Params) -> Array:
        x, y = w
        return np.array([x * (p["mu"] - x**2 - 1.5 * y**2), y * (p["mu"] - y**2 - 1.5 * x**2)])

    problem = cb.Problem(residual, {"x": 1.3, "y": 0.0}, {"mu": 1.69})
    branch = cb.trace(problem, "mu", within={"mu": (-1, 5)}, events=[cb.branch_point(), cb.hopf()])
    assert "HB" not in {point.kind for point in branch.special}
