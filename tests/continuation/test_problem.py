"""What a user brings: names, shapes, derivatives, scales; what is refused, and in which words."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.optimize import brentq

import contbreather as cb
from contbreather.continuation import Problem, Stop, fold, trace
from contbreather.continuation.curve.curve import Curve
from contbreather.errors import BadInput, NotConverged

from .zoo import CUSP, ISOLA, LORENZ, STIFF, Case, counted, knowing, scalar, trace_case

PAIR = {"x": 0.3, "y": -0.2}


def coupled(u, p):
    x, y = u
    return np.array([np.sin(x) + p["mu"] * y**3, x * y - np.exp(p["mu"])])


def coupled_jacobian(u, p):
    x, y = u
    return np.array([[np.cos(x), 3 * p["mu"] * y**2], [y, x]])


def coupled_sensitivity(u, p, name):
    assert name == "mu"
    return np.array([u[1] ** 3, -np.exp(p["mu"])])


# --- names and shapes -------------------------------------------------------------------------


def test_a_user_is_asked_for_ten_things_at_most() -> None:
    """What else there is to know of equations are methods of the classes that know it."""
    assert len(fields(Problem)) <= 10


def test_solve_moves_the_start_onto_a_solution() -> None:
    problem, found = scalar(lambda x, p: x**2 - p["mu"], 1.0, {"mu": 2.0}).solve()
    assert problem.start["x"] == pytest.approx(math.sqrt(2), abs=1e-15)
    assert found.converged
    assert isinstance(problem.start["x"], float)
    with pytest.raises(NotConverged, match=r"leaves the domain: (math|expected)"):
        scalar(lambda x, p: math.sqrt(x) + 1, 1.0, {"mu": 2.0}).solve()


# --- derivatives ------------------------------------------------------------------------------


def test_every_way_to_derivatives_gives_the_same() -> None:
    z = np.array([0.3, -0.2, 0.4])
    exact = np.column_stack(
        [coupled_jacobian(z[:2], {"mu": 0.4}), coupled_sensitivity(z[:2], {"mu": 0.4}, "mu")]
    )
    given = {
        "by hand": (coupled_jacobian, {"sensitivity": coupled_sensitivity}),
        "half by hand": (coupled_jacobian, {}),
        "other half": (None, {"sensitivity": coupled_sensitivity}),
        "automatic": (None, {}),
    }
    for jacobian, methods in given.values():
        plain = Problem(coupled, PAIR, {"mu": 0.4}, jacobian=jacobian)
        curve = Curve(knowing(plain, **methods), ("mu",))
        assert np.allclose(curve.jacobian(z), exact, rtol=0, atol=1e-15)
    real = Curve(Problem(lambda u, p: coupled(u.astype(float), p), PAIR, {"mu": 0.4}), ("mu",))
    assert np.allclose(real.jacobian(z), exact, rtol=0, atol=1e-11)


def takes_complex_steps(problem: Problem) -> bool:
    """Whether its derivative is asked of complex numbers, once it has been chosen how."""
    asked = []

    def residual(x, p):
        asked.append(any(map(np.iscomplexobj, (x, *p.values()))))
        return problem.residual(x, p)

    curve = Curve(replace(problem, residual=residual), ("mu",))
    curve.jacobian(curve.start)
    asked.clear()
    curve.jacobian(curve.start + 1e-3)
    return any(asked)


@pytest.mark.parametrize(
    ("equation", "analytic"),
    [
        (lambda x, p: np.sin(x) - p["mu"], True),
        (lambda x, p: abs(x - 2) - p["mu"], False),
        (lambda x, p: (x * np.conj(x)).real - p["mu"], False),
        (lambda x, p: math.sin(x) - p["mu"], False),  # takes no complex number
        (lambda x, p: float(x) - p["mu"], False),
        (lambda x, p: max(x, 0.0) - p["mu"], True),  # on either side
        (lambda x, p: np.where(x > 0, x, -x) - p["mu"], True),
        (lambda x, p: 1 / (x - 0.7 - 1e-7) - p["mu"], True),  # beside a pole differences are none
    ],
)
def test_complex_steps_where_they_hold_and_differences_elsewhere(equation, analytic) -> None:
    assert takes_complex_steps(scalar(equation, 0.7, {"mu": 0.1})) is analytic


def test_a_scheme_that_no_longer_holds_is_replaced_on_the_way() -> None:
    # analytic where it starts; further on |x - 1/2| is not
    def equation(x, p):
        return x + 0.1 * (abs(x - 0.5) if p["mu"].real > 0.4 else 0.5 - x) - p["mu"]

    problem = scalar(equation, 0.0, {"mu": 0.05})
    assert takes_complex_steps(problem)
    branch = trace(problem, "mu", within={"mu": (0.0, 0.46)}, events=())
    assert branch.stop is Stop.BOUND
    assert branch[-1]["x"] == pytest.approx((0.46 - 0.05) / 0.9, abs=1e-14)


@pytest.mark.parametrize("row", [0, 1])
@pytest.mark.parametrize("column", [0, 1, 2])
def test_a_wrong_entry_of_a_derivative_is_named(row: int, column: int) -> None:
    off = np.zeros((2, 3))
    off[row, column] = 1e-3
    problem = knowing(
        Problem(
            coupled, PAIR, {"mu": 0.4}, jacobian=lambda u, p: coupled_jacobian(u, p) + off[:, :2]
        ),
        sensitivity=lambda u, p, name: coupled_sensitivity(u, p, name) + off[:, 2],
    )
    with pytest.raises(BadInput, match=rf"its entry \({row}, {column}\) is .+, differences give"):
        trace(problem, "mu")


def test_derivatives_that_a_class_knows_are_compared_with_differences() -> None:
    def derivatives(u, p, names):
        columns = [coupled_sensitivity(u, p, name)[:, None] for name in names]
        return np.hstack([coupled_jacobian(u, p), *columns])

    def wrong(u, p, names):
        return derivatives(u, p, names) * np.where(np.arange(2 + len(names)) == 1, 1.001, 1.0)

    plain = Problem(coupled, {"x": 0.6, "y": 1.12}, {"mu": -0.4})
    right = trace(knowing(plain, derivatives=derivatives), "mu", within={"mu": (-0.5, -0.3)})
    assert right.stop is Stop.BOUND
    with pytest.raises(BadInput, match=r"does not fit the residual: its entry \([01], 1\) is"):
        trace(knowing(plain, derivatives=wrong), "mu")


def test_a_jacobian_that_is_wrong_only_further_on_is_named_in_the_reason() -> None:
    def jacobian(u, p):
        return np.array([[1 + 3 * u[0] ** 2 if p["mu"] < 0.5 else -1.0]])

    plain = Problem(lambda u, p: u + u**3 - p["mu"], {"x": 0.0}, {"mu": 0.0}, jacobian=jacobian)
    problem = knowing(plain, sensitivity=lambda u, p, name: np.array([-1.0]))
    branch = trace(problem, "mu", towards="up", within={"mu": (0.0, 1.0)})
    assert branch.stop is Stop.NO_CONVERGENCE
    assert "its entry (0, 0) is -1, differences give" in branch.reason
    assert branch[-1]["mu"] == pytest.approx(0.5, abs=1e-6)


def test_a_small_error_is_found_and_rounding_is_forgiven() -> None:
    def off(factor: float) -> Problem:
        return Problem(
            coupled, {"x": 0.6, "y": 1.12}, {"mu": -0.4},
            jacobian=lambda u, p: factor * coupled_jacobian(u, p),
        )  # fmt: skip

    assert trace(off(1 + 1e-9), "mu", within={"mu": (-0.5, -0.3)}).stop is Stop.BOUND
    for factor in (1 + 1e-4, math.nan):
        with pytest.raises(BadInput, match="Jacobian that was given does not fit the residual"):
            trace(off(factor), "mu")


@pytest.mark.slow
@pytest.mark.parametrize("case", [CUSP, ISOLA, LORENZ, STIFF], ids=lambda case: case.name)
def test_differences_and_complex_steps_walk_the_same_curve(case: Case) -> None:
    def real(u, p):
        return case.problem.residual(
            np.asarray(u, dtype=float), {k: float(v) for k, v in p.items()}
        )

    exact, coarse = (
        trace_case(case, start=problem, events=[fold()])
        for problem in (case.problem, replace(case.problem, residual=real))
    )
    assert [p.kind for p in coarse.special] == [p.kind for p in exact.special]
    for one, other in zip(exact.special, coarse.special, strict=True):
        for name in case.problem.start:
            size = case.problem.scales.get(name, 1.0)
            assert abs(one[name] - other[name]) < 1e-9 * size


def test_one_equation_may_be_a_number() -> None:
    """A residual without brackets gives the same branch to the last bit."""

    def bare(x, p):
        return x[0] ** 3 - x[0] - p["mu"]

    def row(x, p):
        return np.array([bare(x, p)])

    branches = [
        trace(Problem(f, {"x": 1.5}, {"mu": 1.875}), "mu", within={"x": (-2, 2)}, events=[fold()])
        for f in (bare, row)
    ]
    for name in ("x", "mu"):
        assert branches[0][name].tolist() == branches[1][name].tolist()
    assert [p.label for p in branches[0].special] == ["EP1", "LP1", "LP2", "EP2"]


# --- functions written by others ------------------------------------------------------------------


WITHIN = {"mu": (0.5, 2.0)}


def traced(residual, x=1.0, **given) -> cb.Branch:
    problem = cb.Problem(residual, {"x": x}, {"mu": 1.0}, **given)
    return cb.trace(problem, "mu", within=WITHIN, events=[cb.fold()])


def inner_root(x, p):
    """x^3 + x = 2 mu, solved inside: brentq raises RuntimeError where it is given a complex mu."""
    root = brentq(lambda y: y**3 + y - 2 * p["mu"], -5, 5, xtol=1e-14, disp=True)
    return np.array([x[0] - root])


class OwnError(Exception):
    pass


def refusing(error):
    """The same root, by a function that refuses complex numbers with an error of its own."""

    def residual(x, p):
        if np.iscomplexobj(x) or isinstance(p["mu"], complex):
            raise error
        return x**3 + x - 2 * p["mu"]

    return residual


def late(x, p):
    """Takes complex numbers at the start, and not where mu is above 1.2."""
    if np.real(p["mu"]) > 1.2:
        refusing(AssertionError)(x, p)
    return x**3 + x - 2 * p["mu"]


@pytest.mark.parametrize(
    "residual", [inner_root, late, *map(refusing, (AssertionError, OwnError, RuntimeError))]
)
def test_functions_that_refuse_complex_numbers_in_their_own_way_are_traced(residual) -> None:
    branch = traced(residual)
    assert branch.stop is cb.continuation.Stop.BOUND
    np.testing.assert_allclose(branch["x"] ** 3 + branch["x"], 2 * branch["mu"], atol=1e-9)


def test_what_is_raised_for_real_numbers_is_a_mistake_and_surfaces() -> None:
    def broken(x, p):
        raise RuntimeError("a bug of the caller")

    with pytest.raises(RuntimeError, match="a bug of the caller"):
        traced(broken)


def scribbling(x, p):
    """Writes to what it is given, which it returns."""
    x **= 3
    x -= p["mu"]
    p["mu"] = 17.0
    return x


def scribbled_jacobian(x, p):
    x *= x
    return 3 * x[:, None]


@pytest.mark.parametrize("jacobian", [None, scribbled_jacobian])
def test_functions_may_write_to_what_they_are_given(jacobian) -> None:
    branch = traced(scribbling, jacobian=jacobian)
    np.testing.assert_allclose(branch["x"] ** 3, branch["mu"], rtol=1e-12)
    assert branch["mu"].max() == 2


def test_maps_may_write_to_what_they_are_given() -> None:
    def henon(z, p):
        x, y = z.copy()
        z[:] = 1 - p["a"] * x**2 + y, 0.3 * x
        return z

    cycle = cb.FixedPoint(henon, {"x": 0.6, "y": 0.2}, {"a": 1.0}, period=1)
    branch = cb.trace(cycle, "a", within={"a": (0.1, 1.2)})
    np.testing.assert_allclose(branch["a"] * branch["x"] ** 2, 1 - 0.7 * branch["x"], atol=1e-12)
    assert branch.first("PD")["a"] == pytest.approx(0.3675, abs=1e-12)  # 3 (1 - b)^2 / 4
    arm = cb.switch(branch.first("PD"), within={"a": (0.1, 1.0)})[0]
    assert arm.first("PD")["a"] == pytest.approx(0.9125, abs=1e-12)  # (5 - 6 b + 5 b^2) / 4


# --- what counts as a solution --------------------------------------------------------------------


def test_equations_without_slope_that_do_not_vanish_end_a_branch_where_they_begin() -> None:
    def residual(u, p):
        if np.real(p["mu"]) > 1.5:
            return np.full(2, 1e6)
        return np.array([u[0] - p["mu"], u[1] - u[0] ** 2])

    problem, counter = counted(Problem(residual, {"x": 1.0, "y": 1.0}, {"mu": 1.0}))
    branch = trace(problem, "mu", within={"mu": (0.0, 3.0)})
    assert branch[-1]["mu"] == pytest.approx(1.5, abs=1e-6)
    assert branch.stop is Stop.NO_CONVERGENCE
    assert branch.reason == "residual 1e+06"
    assert abs(branch["residual"]).max() < 1e-15
    assert counter.calls < 3000


@pytest.mark.parametrize(
    ("equation", "x", "residual"),
    [
        *((lambda x, p, mu=mu: x**2 + mu, 0.0, f"{mu:g}, ") for mu in (9e-7, 1e-9)),
        *((lambda x, p: 1e-7 * (1 + x**2), x, "") for x in (0.0, 1e-9, 0.3, 1.0)),
    ],
)
def test_equations_are_not_solved_for_being_small(equation, x: float, residual: str) -> None:
    """Just beyond a fold, and all of them everywhere."""
    with pytest.raises(NotConverged, match=f"is not a solution: residual {residual}"):
        scalar(equation, x, {"mu": 0.0}).solve()


def square(x, p):
    return x**2 - 2


SOLVED = [
    *(scalar(lambda x, p, size=size: size * square(x, p), 1.0, {}) for size in (1e-12, 1.0, 1e12)),
    *(scalar(square, 1.0, {}, scales={"x": scale}) for scale in (1e-3, 1e6)),
    *(
        Problem(lambda u, p, y=y: [square(u[0], p), u[1] / y - 1], {"x": 1.6, "y": y}, {})
        for y in (1e6, 1e10)
    ),
]


@pytest.mark.parametrize("problem", SOLVED)
def test_an_unknown_is_solved_for_to_the_last_digits(problem: Problem) -> None:
    """Whatever the size of its equation, its scale, and the size of another."""
    assert problem.solve()[0].start["x"] == pytest.approx(2**0.5, rel=1e-15)


def test_entries_of_an_array_have_scales_of_their_own() -> None:
    """The branch is that of as many unknowns of size 1, step by step."""

    def walked(units):
        def f(u, p):
            x, y = u / units
            return [x**2 + y - p["mu"], y - 0.5 * x]

        return trace(
            Problem(f, {"u": units}, {"mu": 1.5}, scales={"u": units}),
            "mu",
            within={"mu": (1.0, 2.0)},
        )

    plain, scaled = walked(np.ones(2)), walked(np.array([1e6, 1e-6]))
    assert scaled["mu"] == pytest.approx(plain["mu"], rel=1e-9)
    with pytest.raises(BadInput, match="one scale was expected, or one for each: got 3 for 2"):
        Problem(lambda u, p: u, {"u": np.ones(2)}, {}, scales={"u": np.ones(3)})


def test_maps_may_return_one_array_each_time() -> None:
    room = np.empty(2)

    def henon(u, p):
        room[:] = 1 - p["a"] * u[0] ** 2 + u[1], 0.3 * u[0]
        return room

    cycle = cb.FixedPoint(henon, {"x": 0.97, "y": -0.13}, {"a": 1.0}, period=2)
    branch = trace(cycle, "a", within={"a": (0.5, 1.2)}, events=())
    assert branch.began is branch.stop is Stop.BOUND
    x, y = branch["x"], branch["y"]
    images = 1 - branch["a"] * x**2 + y, 0.3 * x
    assert np.allclose(1 - branch["a"] * images[0] ** 2 + images[1], x, atol=1e-12)
    assert not np.allclose(*branch[-1].solution.points)
