"""Derivatives that a vector field was given with."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array

import contbreather as cb
from contbreather.flows.functions import slopes

from .zoo import van_der_pol as field

P = {"mu": 1.3}
X = np.random.default_rng(0).normal(size=(2, 7))
PATTERN = [[0, 1], [1, 1]]
MASS = [[2.0, 1.0], [0.0, 1.0]]


def kinked(t: Any, x: Any, p: Any) -> Any:  # what no complex step suits
    return [x[1], p["mu"] * (1 - x[0] * abs(x[0])) * x[1] - x[0]]


def written(t: Any, x: Any, p: Any) -> Any:
    return [[0.0, 1.0], [-2 * p["mu"] * x[0] * x[1] - 1, p["mu"] * (1 - x[0] ** 2)]]


def array(t: Any, x: Any, p: Any) -> Any:
    matrix = np.zeros((2, 2, *x.shape[1:]))
    for i, row in enumerate(written(t, x, p)):
        for j, entry in enumerate(row):
            matrix[i, j] = entry
    return matrix


def sparse(t: Any, x: Any, p: Any) -> Any:
    return csr_array(np.array(written(t, x, p)))


GIVEN = {"rows": written, "array": array, "sparse": sparse, "pattern": PATTERN,
         "sparse pattern": csr_array(np.array(PATTERN))}  # fmt: skip


@pytest.mark.parametrize("jacobian", GIVEN.values(), ids=GIVEN)
@pytest.mark.parametrize("mass", [None, MASS])
def test_slopes_are_those_without_it(jacobian: Any, mass: Any) -> None:
    flow, plain = (cb.Flow(field, mass=mass, jacobian=given) for given in (jacobian, None))
    flow.check(0.0, X[:, 0], P)
    for found, wanted in zip(*(slopes(of.f, 0.3, X, P, ("mu",)) for of in (flow, plain)),
                             strict=True):  # fmt: skip
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-14)


def test_a_pattern_is_differentiated_by_differences_where_no_complex_step_suits() -> None:
    found = slopes(cb.Flow(kinked, jacobian=PATTERN).f, 0.0, X, P, ("mu",))[1]
    wanted = slopes(kinked, 0.0, X, P, ("mu",))[1]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8)


def test_a_large_pattern_takes_as_many_steps_as_it_has_colours() -> None:
    """Of a chain of 300 states, three; the orbit and time are the other columns."""
    asked, n = list[int](), 300

    def chain(t: Any, x: Any, p: Any) -> Any:
        asked.append(x.shape[-1])
        return np.roll(x, 1, axis=0) - 2 * x + np.roll(x, -1, axis=0) + x**2

    ring = sum(np.roll(np.eye(n), k, axis=1) for k in (-1, 0, 1))
    flow, x = cb.Flow(chain, jacobian=ring), np.random.default_rng(1).normal(size=(n, 4))
    slopes(flow.f, 0.0, x, {})  # decides how
    asked.clear()
    slope = slopes(flow.f, 0.0, x, {})[1]
    wanted = ring - 3 * np.eye(n)
    for k in range(4):
        np.testing.assert_allclose(slope[:, :n, k], wanted + np.diag(2 * x[:, k]), atol=1e-12)
    assert sum(asked) == 4 * (3 + 1) + 8  # and 8 to see that they are borne out


@pytest.mark.slow
@pytest.mark.parametrize("jacobian", GIVEN.values(), ids=GIVEN)
def test_cycles_and_equilibria_are_those_without_it(jacobian: Any) -> None:
    start: dict[str, Any] = {"start": {"x": 2.0, "v": 0.0}, "params": {"mu": 1.0}, "settle": 20}
    orbit, plain = (cb.cycle(field, **start, jacobian=of) for of in (jacobian, None))
    assert orbit.start["period"] == pytest.approx(plain.start["period"], rel=1e-12)
    rest = cb.equilibrium(field, {"x": 0.0, "v": 0.0}, {"mu": -1.0}, jacobian=jacobian)
    born = cb.trace(rest, "mu", within={"mu": (-1, 1)}).first("HB")
    assert born["mu"] == pytest.approx(0.0, abs=1e-12)
    (seed,) = born.problem.lift("HB")(born).seeds()
    assert seed.problem.start["period"] == pytest.approx(2 * np.pi, rel=1e-4)


WRONG = {
    "its entry (1, 0) is -1": lambda t, x, p: [[0, 1], [-1, p["mu"] * (1 - x[0] ** 2)]],
    "it misses entry (1, 0)": [[0, 1], [0, 1]],
    "returns shape (2,)": lambda t, x, p: [0, 1],
    "has shape (1, 3); (2, 2) was expected": [[1, 1, 1]],
    "has shape (2,)": [1, 1],
    "or a pattern of its entries; got 3.0": 3.0,
    "jacobian raises KeyError": lambda t, x, p: p["k"],
}


@pytest.mark.parametrize(("sentence", "wrong"), WRONG.items(), ids=WRONG)
def test_a_false_one_is_refused(sentence: str, wrong: Any) -> None:
    with pytest.raises(cb.BadInput) as refused:
        cb.cycle(field, {"x": 0.0, "v": 0.0}, {"mu": 1.0}, jacobian=wrong)
    assert sentence in str(refused.value)


def test_it_is_given_flow_by_flow() -> None:
    with pytest.raises(cb.BadInput, match="give each flow its own"):
        cb.cycle([cb.Flow(field)], {"x": 2.0, "v": 0.0}, {"mu": 1.0}, jacobian=PATTERN)
