"""Parameters as functions of others: the same curves as of equations written out by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array

import contbreather as cb
from contbreather.continuation.algebra.derivatives import differences
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.problem import Problem
from contbreather.errors import BadInput

from . import zoo

brusselator = zoo.brusselator().residual
START = {"x": 1.0, "y": 1.5}
# A by its square, B relative to the Hopf point 1 + A^2: a name that is tied, and a new one
TIES = {"A": lambda p: p["A"] ** 0.5, "B": lambda p: p["ratio"] * (1 + p["A"])}


def by_hand(u, p):
    return brusselator(u, {name: tie(p) for name, tie in TIES.items()})


def tied_brusselator(**more):
    return Problem(brusselator, START, {"A": 1.0, "B": 1.5}, **more).tied(TIES, A=1.0, ratio=0.75)


@pytest.mark.parametrize("free", ["A", "ratio"])
def test_a_tied_problem_has_the_branch_of_the_one_written_out(free):
    events = [cb.fold(), cb.hopf()]
    written = Problem(by_hand, START, {"A": 1.0, "ratio": 0.75})
    how = {"within": {"A": (0.5, 2), "ratio": (0.5, 1.5)}, "events": events}
    mine, other = (cb.trace(problem, free, **how) for problem in (tied_brusselator(), written))
    assert [point.kind for point in mine.special] == [point.kind for point in other.special]
    for one, two in zip(mine.special, other.special, strict=True):
        assert abs(one.z - two.z).max() < 1e-11
    if free == "ratio":
        assert mine.first("HB")["ratio"] == pytest.approx(1.0, abs=1e-11)
    assert mine["B"] == pytest.approx(mine["ratio"] * (1 + mine["A"]))  # still a column


@pytest.mark.slow
def test_the_boundary_of_a_tied_problem_is_that_of_the_base_in_other_coordinates():
    branch = cb.trace(tied_brusselator(), "ratio", within={"ratio": (0.5, 1.5)}, events=[cb.hopf()])
    line = cb.boundary(branch.first("HB"), ("A", "ratio"), within={"A": (0.25, 4)})
    assert line["ratio"] == pytest.approx(1.0, abs=1e-10)
    assert np.ptp(line["A"]) == pytest.approx(3.75)
    cusp = Problem(
        lambda x, p: np.array([p["h"] + p["mu"] * x[0] - x[0] ** 3]),
        {"x": 1.0},
        {"mu": 1.0, "h": 0.0},
    )
    ties = {"mu": lambda p: p["nu"] ** 3, "h": lambda p: p["h"] * p["nu"]}
    fold = cb.trace(
        cusp.tied(ties, nu=1.0, h=0.0), "h", within={"x": (-2, 2)}, events=[cb.fold()]
    ).first("LP")
    line = cb.boundary(fold, ("nu", "h"), within={"nu": (0.2, 2)})
    mu, h = line["nu"] ** 3, line["h"] * line["nu"]
    assert 4 * mu**3 == pytest.approx(27 * h**2, rel=1e-9)


class _Knowing(Problem):
    tested = True

    def sensitivity(self, x, params, name):
        return {"A": np.array([1.0, 0.0]), "B": np.array([-x[0], x[0]])}[name]


def _jacobian(u, p):
    x, y = u
    return np.array([[2 * x * y - p["B"] - 1, x * x], [p["B"] - 2 * x * y, -x * x]])


@pytest.mark.parametrize(
    "problem",
    [
        tied_brusselator(),
        tied_brusselator(jacobian=_jacobian),
        tied_brusselator(jacobian=np.ones((2, 2))),
        tied_brusselator(jacobian=lambda u, p: csc_array(_jacobian(u, p))),
        _Knowing(brusselator, START, {"A": 1.0, "B": 1.5}, jacobian=_jacobian).tied(
            TIES, A=1.0, ratio=0.75
        ),
        # one tie behind the other
        Problem(brusselator, START, {"A": 1.0, "B": 1.5})
        .tied({"A": lambda p: p["A"] ** 0.5}, A=1.0)
        .tied({"B": lambda p: p["ratio"] * (1 + p["A"])}, ratio=0.75),
        # what no complex number may be put into
        Problem(brusselator, START, {"A": 1.0, "B": 1.5}).tied(
            {"A": lambda p: math.sqrt(p["A"]), "B": TIES["B"]}, A=1.0, ratio=0.75
        ),
    ],
)
def test_derivatives_of_a_tied_problem_are_those_of_differences(problem):
    for free in (("A",), ("ratio",), ("ratio", "A")):
        curve = Curve(problem, free)
        z = curve.start + 0.1 * np.cos(np.arange(curve.start.size))
        matrix = curve.jacobian(z)
        matrix = matrix.toarray() if hasattr(matrix, "toarray") else matrix
        wanted = differences(partial(_residual_by_hand, curve), z)
        assert abs(matrix - wanted).max() < 1e-9


def _residual_by_hand(curve, z):
    return by_hand(z[:2], curve.params(z))


def test_a_parameter_that_is_not_tied_stays_and_one_that_does_not_matter_moves_nothing():
    plain = Problem(
        lambda x, p: np.array([x[0] - p["r"] - p["s"]]), {"x": 3.0}, {"r": 1.0, "s": 2.0}
    )
    tied = plain.tied({"r": lambda p: p["q"] ** 2}, q=1.0, idle=5.0)
    assert list(tied.params) == ["s", "q", "idle"]
    assert Curve(tied, ("s", "idle", "q")).jacobian(
        np.array([3.0, 2.0, 5.0, 1.0])
    ) == pytest.approx(np.array([[1.0, -1.0, 0.0, -2.0]]))


@dataclass(frozen=True, eq=False, repr=False)
class _Named(Problem):
    shown = ("r",)
    parting = ("r", "x")

    def interpret(self, point):
        return f"x = {point['x']:.3g} at r = {point['r']:.3g}"

    def images(self, x, params):
        return (-x * params["r"],)


def test_a_class_is_asked_of_points_of_its_own_problem():
    ring = _Named(lambda x, p: x**2 - p["r"] ** 2, {"x": 2.0}, {"r": 2.0})
    tied = ring.tied({"r": lambda p: p["area"] ** 0.5}, area=4.0)
    branch = cb.trace(tied, "area", within={"area": (4, 9)})
    assert branch[-1].solution == "x = 3 at r = 3"
    assert cb.plot(branch).axes.get_ylabel() == cb.plot(branch, y="r").axes.get_ylabel()
    assert tied.parting == ring.parting
    assert tied.images(np.array([1.0]), {"area": 9.0})[0] == pytest.approx(-3.0)


def test_the_domain_of_the_base_ends_the_branch():
    root = Problem(
        lambda x, p: x - np.exp(p["r"]), {"x": 1.0}, {"r": 0.0}, domain={"r": (-1.0, 1.0)}
    ).tied({"r": lambda p: p["s"] / 2}, s=0.0)
    branch = cb.trace(root, "s", within={"s": (-5, 5)})
    assert sorted(branch["s"])[:: len(branch) - 1] == pytest.approx([-2, 2], abs=1e-5)
    assert "leaves its domain, -1 to 1" in branch.reason


@pytest.mark.parametrize("slopes", [None, lambda x, p: np.array([[p["r"] * (1 - 2 * x[0])]])])
def test_cycles_of_a_tied_map_double_and_double_again(slopes):
    tied = zoo.logistic(jacobian=slopes).tied({"r": lambda p: 4 * p["s"]}, s=0.625)
    first = cb.trace(tied, "s", within={"s": (0.5, 1)}).first("PD")
    arm = cb.switch(first, within={"s": (0.5, 1)})[0]
    # r = 3 and 1 + sqrt(6)
    assert first["s"] == pytest.approx(0.75, abs=1e-11)
    assert arm.first("PD")["s"] == pytest.approx((1 + math.sqrt(6)) / 4, abs=1e-10)


@pytest.mark.parametrize(
    ("functions", "values", "sentence"),
    [
        ({"C": lambda p: 1.0}, {}, r"'C' is no parameter to tie; it has \['A', 'B'\]"),
        (
            {"A": lambda p: p["D"]},
            {},
            r"the functions have no value at \{'B': 1.5\}: KeyError\('D'\)",
        ),
        ({"A": lambda p: "much"}, {}, "A = 'much': a number from its function"),
        (
            {"A": lambda p: 1.0 / (p["B"] - 1.5)},
            {},
            r"the functions have no value at \{'B': 1.5\}: .*zero",
        ),
        ({"A": 1.0}, {}, "functions of parameters by name were expected"),
        ({"B": lambda p: 1.0}, {"q": math.nan}, "q"),
        ({"A": lambda p: p["x"]}, {"x": 1.0}, "named both as unknowns and as parameters"),
    ],
)
def test_what_cannot_be_tied_is_told(functions, values, sentence):
    with pytest.raises(BadInput, match=sentence):
        Problem(brusselator, START, {"A": 1.0, "B": 1.5}).tied(functions, **values)


def test_a_large_problem_stays_sparse():
    n = 300
    chain = diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsc()
    rows = Problem(
        lambda x, p: chain @ x + p["r"] * np.exp(x) / n**2,
        {"u": np.zeros(n)},
        {"r": 1.0},
        jacobian=lambda x, p: chain + diags_array(p["r"] * np.exp(x) / n**2),
    ).tied({"r": lambda p: p["s"] ** 2}, s=1.0)
    curve = Curve(rows, ("s",))
    matrix = curve.jacobian(curve.start)
    assert hasattr(matrix, "nnz")
    assert matrix.nnz < 5 * n
    assert matrix[:, [n]].toarray() == pytest.approx(2 / n**2)


def test_the_parameters_of_a_cycle_are_tied_in_its_flow():
    cycle = cb.cycle(
        lambda t, x, p: [x[1], p["mu"] * (1 - x[0] ** 2) * x[1] - x[0]],
        start={"x": 2.0, "y": 0.0},
        params={"mu": 1.0},
        settle=50,
    )
    with pytest.raises(
        BadInput, match=r"mu: the .* write the functions into f\(t, x, p\) of the flow"
    ):
        cycle.tied({"mu": lambda p: p["m"]}, m=1.0)
