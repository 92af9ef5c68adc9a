"""Events as curves in two parameters, what is met on them, and where one turns into another."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import DefiningSystem, Stop
from contbreather.errors import BadInput

from . import zoo
from .large import second
from .lines import kinds

WINDOW = {"b2": (-1.5, 1.5)}


@pytest.fixture(scope="module")
def planar() -> cb.Branch:
    return cb.trace(zoo.takens(), "b1", within={"b1": (-1.0, 1.0)}, events=[cb.fold(), cb.hopf()])


@pytest.fixture(scope="module")
def cusp() -> cb.Branch:
    return cb.trace(zoo.CUSP.problem, "h", within={"x": (-2, 2)}, events=[cb.fold()])


# --- the curves themselves --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("largest", [0.1, 1.0])
def test_cusp_curve_from_either_fold_in_either_direction(largest: float, cusp) -> None:
    steps = cb.Steps(first=0.1 * largest, largest=largest)
    for point in cusp.special[1:3]:
        for towards in ("up", "down", "both"):
            for pair in (("mu", "h"), ("h", "mu")):
                within = {"mu": (-1.0, 2.0), "h": (-2.0, 2.0)}
                line = cb.boundary(point, pair, within=within, towards=towards, steps=steps)
                assert abs(4 * line["mu"] ** 3 - 27 * line["h"] ** 2).max() < 1e-13
                assert line["mu"].max() == 2.0
                if towards == "both":
                    (met,) = zoo.events_of(line)
                    assert met.kind == "CP"
                    assert max(abs(met[name]) for name in ("mu", "h", "x")) < 1e-12


def test_a_boundary_has_the_columns_of_problem_locus_and_parameters(planar: cb.Branch) -> None:
    line = cb.boundary(planar.first("HB"), ("b2", "b1"), within=WINDOW)
    assert line.names == ("b1", "b2", "unstable", "arclength", "residual", "x", "y", "omega2")
    assert [name for name in line.columns() if name != "label"] == [*line.names]
    assert line.free == "b2"
    assert line[3].params == {"b1": line["b1"][3], "b2": line["b2"][3]}
    assert "HB boundary in (b2, b1)" in repr(line)


def test_recorded_numbers_and_solutions_are_those_of_the_original_problem(
    planar: cb.Branch,
) -> None:
    own = zoo.knowing(
        replace(
            zoo.takens(), record={"trace": lambda point: float(point.jacobian()[:, :2].trace())}
        ),
        interpret=lambda point: {name: point[name] for name in ("x", "b1", "b2")},
    )
    branch = cb.trace(own, "b1", within={"b1": (-1.0, 1.0)}, events=[cb.hopf()])
    line = cb.boundary(branch.first("HB"), ("b2", "b1"), within=WINDOW)
    assert abs(line["trace"]).max() < 1e-12
    assert line[3].solution == {name: line[3][name] for name in ("x", "b1", "b2")}


@pytest.mark.slow
def test_third_parameters_keep_their_value_and_can_be_moved() -> None:
    def residual(u, p):
        return np.array([p["h"] + p["mu"] * u[0] - p["c"] * u[0] ** 3])

    problem = cb.Problem(residual, {"x": -0.9}, {"mu": 1.0, "h": 0.1, "c": 2.0})
    first = cb.trace(problem, "h", within={"x": (-2, 2)}, events=[cb.fold()]).first("LP")
    line = cb.boundary(first, ("mu", "h"), within={"mu": (0.5, 2.0)})
    assert (line["c"] == 2.0).all()
    assert abs(4 * line["mu"] ** 3 - 27 * 2 * line["h"] ** 2).max() < 1e-12
    # the same boundary in another plane, and at another value of the third parameter
    other = cb.trace(line[3], "c", within={"c": (1.0, 3.0)})
    assert abs(4 * other["mu"] ** 3 - 27 * other["c"] * other["h"] ** 2).max() < 1e-12
    assert np.ptp(other["mu"]) == 0
    moved, _ = line[3].problem.at(c=2.1).solve()
    h, mu = moved.start["h"], line[3]["mu"]
    assert 4 * mu**3 == pytest.approx(27 * 2.1 * h**2, abs=1e-13)


# --- codimension two --------------------------------------------------------------------------


def test_events_of_the_problem_are_met_on_a_boundary_and_carry_both_names(cusp) -> None:
    events = [cb.fold(), cb.user("x", 0.5), cb.user("mu", 0.3, terminal=True)]
    within = {"mu": (0.0, 2.0), "x": (-1.0, 1.0)}
    line = cb.boundary(cusp.first("LP"), ("mu", "h"), within=within, events=events)
    assert line.began is Stop.EVENT or line.stop is Stop.EVENT
    met = line.first("LP-UZ")
    assert met["mu"] == pytest.approx(0.3, abs=1e-14)
    assert met.event.base is events[2]


@pytest.mark.parametrize("may_jump", [False, True])
def test_a_jump_that_means_nothing_on_branches_means_nothing_on_boundaries(may_jump, cusp) -> None:
    jumps = cb.Event("PO", lambda q: math.copysign(1.0, q["mu"] - 0.5), may_jump=may_jump)
    line = cb.boundary(cusp.first("LP"), ("mu", "h"), within={"mu": (0.1, 2.0)}, events=[jumps])
    assert [point.kind for point in line.doubtful] == ([] if may_jump else ["LP-PO"])


def test_a_meeting_located_by_both_loci_is_sharp(cusp) -> None:
    """A fold, where x^2 = mu/3, meets an event with a locus of its own, x = mu^2."""

    def conditions(curve, z, extra):
        x, mu = z[0], curve.params(z)["mu"]
        return np.array([x - mu**2])

    event = cb.Event(
        "GR",
        lambda point: point["x"] - point["mu"] ** 2,
        locus=lambda point: DefiningSystem({}, conditions),
    )
    line = cb.boundary(cusp.special[2], ("mu", "h"), within={"mu": (0.1, 2.0)}, events=[event])
    point = line.first("LP-GR")
    assert point["mu"] == pytest.approx(3 ** (-1 / 3), abs=1e-14)  # mu/3 = mu^4
    other = cb.boundary(point, ("mu", "h"), within={"mu": (0.3, 1.2)}, events=[cb.fold()])
    assert abs(other["x"] - other["mu"] ** 2).max() < 1e-13
    assert "GR-LP" in kinds(other)
    assert other.first("GR-LP")["mu"] == pytest.approx(point["mu"], abs=1e-12)


# --- size and derivatives ---------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("derivative", "rows", "unit"),
    [
        (second(20).toarray(), np.logspace(-3, 3, 20), 1.0),
        (second(100).toarray(), 1.0, 1e-3),
        (zoo.chebyshev(30), 1.0, 1.0),
    ],
    ids=["rows", "fine mesh", "Chebyshev"],
)
def test_a_cusp_is_one_in_any_units_and_on_any_mesh(derivative, rows, unit) -> None:
    """The same equation: on the mesh the cubic coefficient falls as 1/n, and rows grow as n^2."""
    weights = np.resize(rows, len(derivative))
    problem = zoo.ignition(derivative, weights, unit, u=1.5, lam=5.0, eps=0.24)
    ahead = {
        "towards": "up",
        "events": [cb.fold()],
        "steps": cb.Steps(first=0.3, largest=3.0, most=6),
    }
    line = cb.boundary(cb.trace(problem, "lam", **ahead).first("LP"), ("eps", "lam"), **ahead)
    assert line.first("CP")["eps"] == pytest.approx(0.24578, abs=1e-4)
    assert not line.doubtful


@pytest.mark.parametrize(
    ("conditions", "derivative", "sentence"),
    [
        (
            lambda curve, z, extra: np.array([z[0] - 0.5]),
            lambda curve, z, extra: np.full((1, z.size), 0.25),
            r"derivative of the locus does not fit its conditions: its entry \(1, ",
        ),
        (
            lambda curve, z, extra: np.zeros(2),
            None,
            "a locus with 0 extra unknowns needs 1 conditions",
        ),
    ],
)
def test_a_locus_that_does_not_fit_is_refused(conditions, derivative, sentence) -> None:
    locus = DefiningSystem({}, conditions, derivative)
    event = cb.Event("GR", lambda point: point["x"] - 0.5, locus=lambda point: locus)
    branch = cb.trace(zoo.CUSP.problem, "h", within={"x": (-1, 1)}, events=[event])
    with pytest.raises(BadInput, match=sentence):
        cb.boundary(branch.first("GR"), ("mu", "h"))


# --- what cannot be traced --------------------------------------------------------------------


@pytest.mark.slow
def test_a_user_value_traced_in_two_parameters_is_a_contour_line() -> None:
    """Contours of x, and of x^2 as recorded, on h + mu x - x^3 = 0: straight lines."""
    square = replace(zoo.CUSP.problem, record={"square": lambda point: point["x"] ** 2})
    events = [cb.user("x", 0.5), cb.user("square", 0.25)]
    branch = cb.trace(square, "h", events=events, within={"x": (-1, 1)})
    assert [point.label for point in branch.special if point.kind == "UZ"] == ["UZ1", "UZ2", "UZ3"]
    at_minus_half, *others = (point for point in branch.special if point.kind == "UZ")
    for point, x in ((at_minus_half, -0.5), (others[0], 0.5), (others[1], 0.5)):
        line = cb.boundary(point, ("mu", "h"), within={"mu": (-1, 2)}, events=())
        assert len(line) > 5
        assert np.allclose(line["h"], x**3 - x * line["mu"], rtol=0, atol=1e-10)


def test_a_contour_line_of_many_unknowns_asks_for_its_number_along_few_of_their_ways() -> None:
    """It was asked for along each of them."""
    asked, n = [], 60

    def height(point: cb.Point) -> float:
        asked.append(point)
        return float(point["x"] @ point["x"])

    rests = cb.Problem(
        lambda x, p: x**3 + p["a"] * x - p["b"] * np.arange(n), {"x": np.zeros(n)},
        {"a": 1.0, "b": 0.0}, record={"height": height},
    )  # fmt: skip
    branch = cb.trace(rests, "b", within={"b": (0, 1)}, events=[cb.user("height", 300.0)])
    line = cb.boundary(branch.first("UZ"), ("a", "b"), within={"a": (0.5, 1.0)}, events=())
    assert line["height"] == pytest.approx(300, abs=1e-7)
    assert len(asked) < 4 * n * len(line)  # what one derivative a point takes by each unknown


def test_what_cannot_be_traced_is_refused_with_a_sentence(planar: cb.Branch) -> None:
    mine = cb.Event("XY", lambda point: point["x"])
    crossing = cb.trace(zoo.takens(), "b1", events=[mine], within={"b1": (-1, 1)}).first("XY")
    bp = zoo.trace_case(zoo.PITCHFORK).first("BP")
    point, both = planar.first("LP"), ("b2", "b1")
    for given, pair, sentence in (
        (planar[3], both, "is no bifurcation: nothing to trace as a boundary; give"),
        (planar.first("EP"), both, "is no bifurcation"),
        (crossing, both, "XY has no locus to trace in two parameters"),
        (bp, ("mu", "mu"), "needs two different parameters"),
        (point, ("b2", "b2"), r"needs two different parameters, .*got \('b2', 'b2'\)"),
        (point, ("b2",), "needs two different parameters"),
        (point, ("b2", "x"), r"'x' is not a parameter here; it has \['b1', 'b2'\]"),
        (point, ("nu", "b1"), "'nu' is not a parameter here"),
    ):
        with pytest.raises(BadInput, match=sentence):
            cb.boundary(given, pair)


def test_names_of_the_locus_that_the_problem_has_already_are_refused_when_it_is_traced() -> None:
    problem = cb.Problem(
        lambda u, p: np.array([p["h"] + p["null"] * u[0] - u[0] ** 3]),
        {"x": -0.9},
        {"null": 1.0, "h": 0.9 - 0.9**3},
    )
    branch = cb.trace(problem, "h", within={"x": (-2, 2)}, events=[cb.fold()])
    assert kinds(branch) == ["LP", "LP"]  # to find them takes no name
    with pytest.raises(BadInput, match=r"rename \['null'\] in the problem"):
        cb.boundary(branch.first("LP"), ("null", "h"))


@pytest.mark.slow
def test_an_iteration_that_goes_astray_on_a_curve_of_hopf_points_prints_nothing(capfd) -> None:
    def circuit(u, p):  # HB crosses BP, nu = -be, at be = 0.6
        x, y, z = u
        cubic = 0.93 * (y - x) ** 3
        slow = (p["be"] + p["nu"]) * x - p["be"] * y + 0.33 * x**3 - cubic
        return [-slow / 0.6, p["be"] * x - (p["be"] - 0.6) * y - z - cubic, y]

    events = [cb.branch_point(), cb.hopf()]
    start, window = {"x": 0.0, "y": 0.0, "z": 0.0}, {"nu": (-2, 1), "be": (0.05, 1.5)}
    problem = cb.Problem(circuit, start, {"nu": -0.9, "be": 0.5}, events=events)
    curve = cb.boundary(
        cb.trace(problem, "nu", within=window).first("HB"), ("nu", "be"), within=window
    )
    assert curve.first("HB-BP")["be"] == pytest.approx(0.6, abs=1e-9)
    assert capfd.readouterr().err == ""  # LAPACK wrote there that its callback failed


def test_a_neutral_saddle_cannot_be_traced_as_a_hopf_point() -> None:
    def residual(u, p):
        return np.array([(1 + p["m"]) * u[0], (2 * p["m"] - 1) * u[1] + p["c"]])

    problem = cb.Problem(residual, {"x": 0.0, "y": 0.0}, {"m": -0.3, "c": 0.0})
    branch = cb.trace(problem, "m", within={"m": (-0.4, 0.4)}, events=[cb.user("m", 0.0)])
    taken = replace(branch.first("UZ"), kind="HB", event=cb.hopf())
    with pytest.raises(BadInput, match="HB cannot be traced from here: no complex pair"):
        cb.boundary(taken, ("c", "m"))


def test_walls_hold_on_boundaries_and_on_what_continues_them_from_a_file(tmp_path) -> None:
    wall = cb.Event("GR", lambda point: 1.2 - point["mu"], ends="domain")
    problem = replace(zoo.CUSP.problem, events=(cb.fold(), wall))
    first = cb.trace(problem, "h", within={"x": (-2, 2)}).first("LP")
    within = {"mu": (0.1, 2.0)}
    line = cb.boundary(first, ("mu", "h"), within=within)
    assert line.first("LP-GR")["mu"] == pytest.approx(1.2, abs=1e-14)
    assert line["mu"].max() == pytest.approx(1.2, abs=1e-14)
    assert math.isclose(abs(line.first("LP-GR")["h"]), math.sqrt(4 * 1.2**3 / 27), abs_tol=1e-14)
    cb.save(tmp_path / "line.nc", line)
    again = cb.load(tmp_path / "line.nc", problem=problem)
    assert list(again[2].curve.problem.record) == list(line[2].curve.problem.record)
    longer = cb.boundary(again[2], ("mu", "h"), within=within)
    assert longer["mu"].max() == pytest.approx(1.2, abs=1e-14)


@pytest.mark.parametrize("apart", [0.02, 0.1, 0.3])
def test_two_verified_events_within_one_step_of_a_boundary_are_both_kept(apart, cusp) -> None:
    places = {"A": 0.8, "B": 0.8 + apart}
    events = [
        cb.Event(kind, lambda point, at=at: point["mu"] - at, examine=lambda point: "")
        for kind, at in places.items()
    ]
    steps = cb.Steps(first=1.0, largest=1.0)
    how = {"within": {"mu": (0.5, 2.0)}, "events": events, "steps": steps}
    line = cb.boundary(cusp.first("LP"), ("mu", "h"), **how)
    for kind, at in places.items():
        assert line.first(f"LP-{kind}")["mu"] == pytest.approx(at, abs=1e-10)


def test_a_curve_of_branch_points_sets_out_where_a_row_of_the_derivative_vanishes() -> None:
    """As of a predator that dies out: what is left of its row is rounding, and complex steps that
    were held to differences of that gave way to these, too coarse for the locus in these units."""

    def chemostat(u, p):
        food, y = 50 * u[0], 10 * u[1]
        eaten = food / (0.3 + food)
        return [
            (p["D"] * (p["S"] - food) - eaten * y) / 50,
            (0.9 * eaten - p["D"]) * y / 10,
        ]

    params, events = {"S": 0.1, "D": 0.3}, [cb.branch_point()]
    base = cb.Problem(chemostat, {"x": 0.002, "y": 0.0}, params, events=events)
    point = cb.trace(base, "S", within={"S": (0.01, 3.0)}).first("BP")
    line = cb.boundary(point, ("S", "D"), within={"S": (0.01, 3.0), "D": (0.1, 0.8)})
    assert line.stop is Stop.BOUND
    assert abs(line["D"] - 0.9 * line["S"] / (0.3 + line["S"])).max() < 1e-14


def test_a_locus_without_derivative_is_followed_to_the_rim_of_its_parameters() -> None:
    """Differences have no room at the edge, and one side of it is enough."""

    def height(point):
        if point["g"] < 0:
            raise BadInput("only g >= 0")
        return point["x"] + point["g"] ** 2 + math.sin(3 * point["g"])

    base = zoo.scalar(
        lambda x, p: x - p["m"],
        0.2,
        {"m": 0.2, "g": 0.5},
        record={"height": height},
        domain={"g": (0.0, 1.0)},
    )
    point = cb.trace(base, "m", within={"m": (-2, 2)}, events=[cb.user("height", 1.0)]).first("UZ")
    line = cb.boundary(point, ("g", "m"), towards="down", events=())
    assert line.stop is Stop.BOUND
    assert line.reason == "the domain of g ends at 0"
    assert line[-1]["g"] == 0.0
    assert line[-1]["m"] == pytest.approx(1.0, abs=1e-13)
