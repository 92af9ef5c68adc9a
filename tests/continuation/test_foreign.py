"""Functions written by others: what they raise, write to, and return."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.sparse import csr_array

import contbreather as cb
from contbreather.errors import BadInput

WITHIN = {"mu": (0.5, 2.0)}


def traced(residual, x=1.0, **given) -> cb.Branch:
    problem = cb.Problem(residual, {"x": x}, {"mu": 1.0}, **given)
    return cb.trace(problem, "mu", within=WITHIN, events=[cb.fold()])


def inner_root(x, p):
    """x^3 + x = 2 mu, solved inside: brentq raises RuntimeError where it is given a complex mu."""
    root = brentq(lambda y: y**3 + y - 2 * p["mu"], -5, 5, xtol=1e-14, disp=True)
    return np.array([x[0] - root])


def asserting(x, p):
    assert not np.iscomplexobj(x), "real numbers only"
    assert not isinstance(p["mu"], complex), "real numbers only"
    return x**3 + x - 2 * p["mu"]


class OwnError(Exception):
    pass


def choosy(x, p):
    if np.iscomplexobj(x) or isinstance(p["mu"], complex):
        raise OwnError
    return x**3 + x - 2 * p["mu"]


def runtime(x, p):
    if np.iscomplexobj(x) or isinstance(p["mu"], complex):
        raise RuntimeError("Failed to converge after 100 iterations, value is nan")
    return x**3 + x - 2 * p["mu"]


def late(x, p):
    """Takes complex numbers at the start, and not where mu is above 1.2."""
    if np.real(p["mu"]) > 1.2:
        asserting(x, p)
    return x**3 + x - 2 * p["mu"]


@pytest.mark.parametrize("residual", [inner_root, asserting, choosy, runtime, late])
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


@pytest.mark.parametrize("given", [None, "matrix", [[1.0, 2.0], [3.0]], np.eye(2)])
def test_a_jacobian_that_is_no_matrix_of_the_right_shape_is_refused(given) -> None:
    problem = cb.Problem(
        lambda x, p: x - p["mu"], {"x": np.ones(3)}, {"mu": 1.0}, jacobian=lambda x, p: given
    )
    with pytest.raises(BadInput, match=r"the Jacobian (is|has)"):
        cb.trace(problem, "mu")


def test_a_residual_that_changes_its_shape_on_the_way_is_told() -> None:
    def residual(x, p):
        value = x - p["mu"]
        return value if p["mu"] < 1.3 else np.array([*value, 0.0])

    with pytest.raises(BadInput, match=r"the residual has shape \(2,\) for 1 unknowns"):
        traced(residual, jacobian=lambda x, p: np.eye(1))


def test_a_sparse_residual_is_refused() -> None:
    with pytest.raises(BadInput, match="an array of numbers was expected"):
        traced(lambda x, p: csr_array([[x[0] - p["mu"]]]))
