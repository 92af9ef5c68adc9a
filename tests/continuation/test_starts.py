"""What a walk is given: windows, directions, steps, events, residuals; and ends at their rims."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import diags_array

import contbreather as cb
from contbreather.continuation import Event, Problem, Steps, Stop, fold, trace, user
from contbreather.errors import BadInput, NotConverged

from .zoo import BRUSSELATOR, CUSP, LINE, PITCHFORK, events_of, trace_case


@pytest.mark.parametrize("largest", [0.1, 1e-2, 1e-3])
def test_an_event_at_the_rim_of_the_domain_is_met_at_any_step(largest: float) -> None:
    gone = Event("GR", lambda point: 0.3 * point["x"], ends="domain")
    problem = Problem(LINE.problem.residual, {"x": 0.4}, {"mu": 0.2}, domain={"x": (1e-14, 9.0)})
    branch = trace(
        problem, "mu", towards="down", events=[gone], steps=Steps(first=largest, largest=largest)
    )
    assert branch[-1].label == "GR1"
    assert branch.stop is Stop.EVENT
    assert branch[-1]["x"] == 1e-14


# --- directions -------------------------------------------------------------------------------


@pytest.mark.parametrize("along", [(0.6, 0.8), (0.6, -0.8), (1.0, 1.0)])
def test_at_a_pitchfork_no_curve_leaves_between_the_two_that_do(along) -> None:
    problem = PITCHFORK.problem.at(x=0.0, mu=0.0)
    branch = trace(problem, "mu", along=along, within={"mu": (-1.0, 1.0)})
    assert len(branch) == 1
    assert branch.stop is Stop.NO_CONVERGENCE
    assert branch.reason.startswith("no curve leaves the start in this direction: ")


# --- tests that are exactly zero --------------------------------------------------------------


@pytest.mark.parametrize("largest", [0.1, 0.5])
@pytest.mark.parametrize(
    "test",
    [
        lambda q: min(0.0, q["mu"] - 0.3),
        lambda q: 0.0 if abs(q["mu"] - 0.3) < 0.2 else q["mu"] - 0.3,
        lambda q: 0.0 if q["mu"] > 0.3 else -1.0,
    ],
)
def test_a_test_that_is_zero_along_a_piece_of_the_curve_has_no_place(test, largest: float) -> None:
    branch = trace(
        LINE.problem.at(x=-0.9, mu=-0.9),
        "mu",
        within={"mu": (-1.0, 1.0)},
        events=[Event("EX", test)],
        steps=Steps(first=largest, largest=largest),
    )
    assert events_of(branch) == []
    (point,) = branch.doubtful
    assert "zero along a piece of the curve" in point.detail["reason"]


def test_a_test_that_goes_through_zero_is_located_where_its_error_is_larger_next_to_it() -> None:
    branch = trace(
        LINE.problem.at(x=-0.9, mu=-0.9),
        "mu",
        within={"mu": (-1.0, 1.0)},
        events=[Event("EX", lambda q: 0.0 if abs(q["mu"] - 0.3) < 2e-4 else q["mu"] - 0.3)],
        steps=Steps(first=0.1, largest=0.1),
    )
    (point,) = events_of(branch)
    assert abs(point["mu"] - 0.3) < 2e-4
    assert branch.doubtful == ()


# --- starts far from a solution ---------------------------------------------------------------

COM = {"q1": 2.5, "q2": 2.0, "q3": 10.0, "q4": 0.0675, "q5": 1.0, "q6": 0.1, "k": 0.4}


def oxidation(u, p):
    """CO on platinum, the model COm of BifurcationKit and MatCont."""
    x, y, s = u
    z = 1 - x - y - s
    own = [2 * p["q1"] * z**2 - 2 * p["q5"] * x**2 - p["q3"] * x * y]
    return np.array([*own, p["q2"] * z - p["q6"] * y - p["q3"] * x * y, p["q4"] * (z - p["k"] * s)])


@pytest.mark.parametrize("s", [0.05, 5.0])
def test_a_start_from_which_plain_steps_lead_astray_is_moved_to_the_curve(s: float) -> None:
    """Newton's iteration without damping ends at a negative concentration, if at all."""
    problem = cb.Problem(oxidation, {"x": 0.07, "y": 0.2, "s": s}, COM)
    events = [cb.fold(), cb.hopf()]
    branch = cb.trace(problem, "q2", within={"q2": (0.5, 2.3)}, events=events)
    assert [point.kind for point in branch.special] == ["EP", "HB", "LP", "LP", "HB", "EP"]
    known = [1.04099, 1.05220, 1.04204, 1.05155]  # as BifurcationKit prints them
    assert [point["q2"] for point in branch.special[1:-1]] == pytest.approx(known, abs=1e-5)
    births = [point["l1"] * point["omega"] for point in branch.special if point.kind == "HB"]
    assert births == pytest.approx([4.332247, 10.70259], rel=5e-4)  # MatCont's, by differences
    assert min(branch["x"].min(), branch["y"].min()) > 0
    distance = min(np.hypot(p["s"] - s, np.hypot(p["x"] - 0.07, p["y"] - 0.2)) for p in branch)
    assert branch.start_correction >= distance - 0.1
    assert f"the start was moved by {branch.start_correction:.2g}" in repr(branch)


def stirred_tank(t: float, rate: float) -> cb.Problem:
    def residual(u, p):
        made = p["rate"] * p["t"] * (1 - u[0]) * np.exp(u[1])
        return np.array([made - u[0], 8 * made - (1 + p["t"]) * u[1]])

    return cb.Problem(residual, {"u": 0.75, "v": 4.0}, {"t": t, "rate": rate})


@pytest.mark.parametrize(("t", "rate"), [(0.5, 0.2), (1.0, 0.05)])
def test_how_far_a_start_was_moved_is_said(t: float, rate: float) -> None:
    branch = cb.trace(stirred_tank(t, rate), "t", within={"t": (0.1, 5)}, events=[])
    start = next(point for point in branch if "moved" in point.detail)
    gone = math.dist((start["u"], start["v"], start["t"]), (0.75, 4.0, t))
    assert branch.start_correction == pytest.approx(gone, rel=1e-12)
    assert branch.start_correction > 0.2
    if start["t"] != t:  # none was found at the same parameter: then the nearest
        near = np.hypot(np.hypot(branch["u"] - 0.75, branch["v"] - 4.0), branch["t"] - t).min()
        assert branch.start_correction < 1.3 * near


def test_a_start_that_is_a_solution_was_not_moved() -> None:
    line = cb.Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0})
    branch = cb.trace(line, "mu", within={"mu": (0, 1)})
    assert branch.start_correction == 0
    assert "moved" not in repr(branch)


def test_linear_equations_are_solved_at_the_same_parameter_from_any_distance() -> None:
    problem = cb.Problem(lambda x, p: x - 1000 * p["mu"], {"x": 0.0}, {"mu": 1.0})
    branch = cb.trace(problem, "mu", within={"mu": (0.5, 2)})
    start = next(point for point in branch if "moved" in point.detail)
    assert (start["x"], start["mu"], branch.start_correction) == (1000.0, 1.0, 1000.0)


def test_a_start_is_not_moved_out_of_the_domain() -> None:
    """The nearest solution of x^2 = -mu has a negative mu."""
    options = {"start": {"x": 0.1}, "params": {"mu": 0.01}}
    moved = cb.trace(
        cb.Problem(lambda x, p: x**2 + p["mu"], **options),
        "mu",
        towards="down",
        within={"mu": (-1, 1)},
    )
    assert moved[0]["mu"] < 0
    bounded = cb.Problem(lambda x, p: x**2 + p["mu"], **options, domain={"mu": (0.005, 1)})
    with pytest.raises(NotConverged, match="is not a solution"):
        cb.trace(bounded, "mu")


# --- steps where numbers are large ------------------------------------------------------------


def enzyme(u, p):
    """The demo enz of AUTO: a substrate in two cells."""
    one, other = (s / (1 + s + s * s) for s in u)
    return np.array(
        [p["s0"] - 2 * u[0] + u[1] - 100 * one, p["s0"] - 2 * u[1] + u[0] - 100 * other]
    )


def waves(u, p):
    """The demo wav of AUTO, where its parameter a0 goes up to 2000."""
    rate = p["rho"] * u[1] / (3.4 + u[1]) * u[0] / (1 + u[0] + 0.023 * u[0] ** 2)
    return np.array([145 - u[0] - rate, 0.2 * (p["a0"] - u[1]) - rate])


@pytest.mark.slow
def test_branches_through_large_numbers_reach_the_edge_of_their_window() -> None:
    events = [cb.fold(), cb.branch_point(), cb.hopf()]
    cells = cb.Problem(enzyme, {"u": 0.0, "v": 0.0}, {"s0": 0.0})
    branch = cb.trace(cells, "s0", within={"s0": (0, 300)}, events=events)
    assert branch.stop is cb.continuation.Stop.BOUND
    # symmetric: s0 = s + 100 s / (1 + s + s^2), with folds where its slope vanishes
    s = np.roots([1, 2, -97, 2, 101])
    s = np.sort(s[(abs(s.imag) < 1e-9) & (s.real > 0)].real)
    folds = [point for point in branch.special if point.kind == "LP"]
    assert [point["u"] for point in folds] == pytest.approx(list(s), abs=1e-9)
    assert [point.kind for point in branch.special] == ["EP", "LP", "BP", "BP", "LP", "EP"]
    start = {"s": 62.7662, "a": 88.8308}
    problem = cb.Problem(waves, start, {"a0": 500.0, "rho": 210.0})
    branch = cb.trace(problem, "a0", within={"a0": (0, 2000)}, events=events)
    assert [point.kind for point in branch.special] == ["EP", "LP", "LP", "HB", "EP"]
    assert len(branch) < 600


def test_a_longest_step_that_is_given_holds_everywhere() -> None:
    problem = cb.Problem(lambda x, p: x - p["mu"], {"x": 900.0}, {"mu": 900.0})
    options = {"towards": "up", "within": {"mu": (0, 1000)}}
    free, held = (
        cb.trace(problem, "mu", steps=steps, **options)
        for steps in (cb.Steps(), cb.Steps(largest=5.0))
    )
    assert np.diff(held["arclength"]).max() <= 5.001
    assert 12 < np.diff(free["arclength"]).max() < 15  # a hundredth of |z|


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("towards", ["up", "both"])
def test_a_fold_at_the_end_of_the_domain_is_left_to_the_inside(side, towards):
    """There the parameter does not change at first, and one of both sides is not in the domain."""
    inside = (0.0, 5.0) if side > 0.0 else (-5.0, 0.0)
    mine = Problem(
        lambda x, p: np.array([x[0] ** 2 - p["s"]]), {"x": 0.0}, {"s": 0.0}, domain={"x": inside}
    )
    branch = trace(mine, "s", towards=towards, within={"s": (0.0, 1.0)})
    assert branch["s"][[0, -1]].tolist() == [0.0, 1.0]
    assert branch["x"][-1] == pytest.approx(side)


@pytest.mark.parametrize("rounding", [-2.2e-16, 0.0, 2.2e-16])
def test_rounding_at_a_start_on_the_edge_of_its_domain_does_not_decide_how_a_curve_ends(rounding):
    """Its test changes so slowly that a unit in the last place of 1 is no place on the curve."""
    edge = Event("WL", lambda point: rounding - 1e-5 * point["mu"], ends="domain")
    line = Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0})
    branch = trace(line, "mu", within={"mu": (-1, 1)}, events=[edge])
    assert (branch.began, branch.stop) == (Stop.BOUND, Stop.EVENT)
    assert branch[-1]["mu"] == pytest.approx(0.0, abs=1e-10)


# --- windows of arrays, which are those of their norms --------------------------------------------


ROOTS = np.arange(1.0, 13.0)


def cubes(**more: object) -> cb.Problem:
    """``u_i = (i mu)^(1/3)``."""
    return cb.Problem(
        lambda u, p: u**3 - p["mu"] * ROOTS,
        {"u": np.cbrt(ROOTS)},
        {"mu": 1.0},
        **more,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("largest", [0.05, 0.5, 5.0])
def test_a_branch_ends_exactly_where_the_norm_does(largest: float) -> None:
    steps = cb.Steps(largest=largest)
    branch = cb.trace(cubes(), "mu", within={"u": (1, 10)}, steps=steps)
    norms = np.linalg.norm(branch["u"], axis=1)
    assert norms[[0, -1]] == pytest.approx([1, 10], rel=1e-15)
    assert norms[1:-1].min() > 1
    assert norms[1:-1].max() < 10
    unit = np.linalg.norm(np.cbrt(ROOTS))
    assert branch["mu"][[0, -1]] == pytest.approx([unit**-3, (10 / unit) ** 3], rel=1e-12)
    assert branch.stop is branch.began is cb.continuation.Stop.BOUND


def test_a_norm_that_is_rounding_is_within_a_window_from_0() -> None:
    """No norm falls below it: where it is 1e-26 no step led on."""
    rest = cb.Problem(lambda u, p: (p["mu"] - 1) * u - u**3, {"u": [1e-26, -1e-26]}, {"mu": 0.0})
    branch = cb.trace(rest, "mu", within={"mu": (-1, 0.5), "u": (0, 2)})
    assert branch["mu"][[0, -1]].tolist() == [-1, 0.5]


def test_a_norm_that_peaks_beyond_its_window_within_a_step_is_seen() -> None:
    arch = cb.Problem(
        lambda u, p: np.array([u[0] - 3 * np.cos(p["h"]), u[1]]),
        {"u": np.array([3 * np.cos(-1.0), 0.0])},
        {"h": -1.0},
    )
    branch = cb.trace(arch, "h", within={"u": (0, 2.9999)}, towards="up")
    assert branch[-1]["h"] == pytest.approx(-np.arccos(2.9999 / 3), abs=1e-12)


def test_the_domain_of_an_array_is_one_of_its_norm_too() -> None:
    branch = cb.trace(cubes(domain={"u": (0, 9)}), "mu", within={"mu": (0.5, 1e4)}, towards="up")
    assert branch.reason == "the domain of u ends at 9"
    assert np.linalg.norm(branch[-1]["u"]) == pytest.approx(9, rel=1e-15)


# --- how close is close -------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9, 1e-13])
def test_events_are_located_as_well_whatever_the_walk_tolerates(tolerance: float) -> None:
    steps = Steps(tolerance=tolerance)
    line = trace(
        CUSP.problem, "h", within={"x": (-2, 2)}, steps=steps, events=[fold(), user("x", 0.2)]
    )
    exact = 2 / math.sqrt(27)
    assert [p["h"] for p in line.special[1:-1]] == pytest.approx([exact, -0.192, -exact], abs=1e-13)
    point = trace_case(BRUSSELATOR, steps=steps).first("HB")
    assert point["B"] == pytest.approx(2.0, abs=1e-13)


@pytest.mark.parametrize(
    ("off", "tilt", "good"),
    [(0.9e-6, 0, True), (1.1e-6, 0, False), (0, 0.9e-3, True), (0, -0.9e-3, True),
     (0, 1.1e-3, False), (0, -1.1e-3, False)],
)  # fmt: skip
def test_a_direction_is_taken_where_it_is_one_of_the_curve(off, tilt, good) -> None:
    line = Problem(lambda x, p: x - p["m"], {"x": off}, {"m": 0.0})
    along = np.array([1.0, 1.0 + math.sqrt(2) * tilt])
    if good:
        assert trace(line, "m", within={"m": (-1, 1)}, along=along)[-1]["x"] == 1.0
        return
    with pytest.raises(BadInput, match="no curve leaves the start in this direction"):
        trace(line, "m", within={"m": (-1, 1)}, along=along)


def test_a_start_beyond_a_fold_is_moved_up_to_half_of_its_size_and_one() -> None:
    fold_at_0 = Problem(lambda x, p: x**2 - p["m"], {"x": 0.0}, {"m": -0.9})
    branch = trace(fold_at_0, "m", within={"x": (-1, 1)})
    assert branch.start_correction == pytest.approx(0.9, abs=1e-3)
    with pytest.raises(NotConverged):
        trace(fold_at_0.at(m=-1.1), "m", within={"x": (-1, 1)})


# --- surfaces of solutions --------------------------------------------------------------------


def reaction(x, p):
    rate = x[0] * (p["k"] - x[0] * x[1])
    return np.array([rate, p.get("total", x[0] + x[1]) - x[0] - x[1] - rate])


def two_totals(x, p):
    return np.append(reaction(x, p), 0.0 * x[0])


def turned(x, p):
    return (p["mu"] - x @ x) * x


def grid(x, p):
    """Machines in a ring; their angles count from anywhere."""
    angle, speed = np.split(x, 2)
    power = np.where(np.arange(angle.size) == 0, p["mu"], -p["mu"] / (angle.size - 1))
    flows = np.sin(np.roll(angle, 1) - angle) + np.sin(np.roll(angle, -1) - angle)
    return np.concatenate([speed, power - 0.5 * speed + flows])


@pytest.mark.parametrize(
    ("residual", "start", "params"),
    [(reaction, (2.0, 0.5), {"k": 1.0}), (reaction, (1.9, 0.6), {"k": 1.0}),
     (turned, (0.6, 0.8), {"mu": 1.0}), (turned, (0.6, 0.7), {"mu": 1.0}),
     (grid, (1.0, 1.1, 1.2, 1.3, 1.4) + (0.0,) * 5, {"mu": 0.5}),
     (lambda x, p: 0 * x, (0.6, 0.7), {"mu": 1.0}), (two_totals, (2.0, 0.5, 1.0), {"k": 1.0})],
)  # fmt: skip
def test_a_start_on_a_surface_of_solutions_is_refused_with_what_to_do(residual, start, params):
    problem = Problem(residual, dict(zip("xyzuvwabcd", start, strict=False)), params)
    with pytest.raises(BadInput, match=r"fill a surface.*add \(total - it\)"):
        trace(problem, min(params), within={"x": (0.1, 5.0)})


def test_what_is_conserved_is_held_by_its_total() -> None:
    """x (total - x) = k has a fold at x = total / 2 = 1."""
    problem = Problem(reaction, {"x": 2.0, "y": 0.5}, {"k": 1.0, "total": 2.5})
    branch = trace(problem, "total", within={"x": (0.5, 2.0)}, events=fold())
    assert [point.kind for point in branch.special] == ["EP", "LP", "EP"]
    assert branch.first("LP")["x"] == pytest.approx(1.0, abs=1e-9)


def test_a_curve_of_many_unknowns_that_is_nearly_a_surface_is_walked() -> None:
    """Each of 32 unknowns is twice the next one, the last of them 0: off by 2e-10, all are free."""
    above = np.where(np.arange(3999) < 32, -2.0, 0.0)
    matrix, last = (
        diags_array([np.ones(4000), above], offsets=[0, 1]).tocsc(),
        np.eye(1, 4000, 3999),
    )
    problem = Problem(
        lambda x, p: matrix @ x - p["mu"] * last[0],
        {"x": np.zeros(4000)}, {"mu": 0.0}, jacobian=lambda x, p: matrix,
    )  # fmt: skip
    assert trace(problem, "mu", within={"mu": (0, 1)})[-1]["x"][-1] == pytest.approx(1.0)
