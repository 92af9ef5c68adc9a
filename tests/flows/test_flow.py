"""What a user writes as a vector field: values at many states, slopes, and sentences."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.algebra.newton import Undefined
from contbreather.flows.functions import slopes, values

from .zoo import lorenz, van_der_pol

RNG = np.random.default_rng(7)
X = RNG.normal(size=(3, 11))
T = RNG.uniform(0, 5, size=11)
P = {"k": 2.0, "w": 1.3}


def smooth(t: Any, x: Any, p: Any) -> Any:
    return [x[1], -p["k"] * np.sin(x[0]) * x[2] + np.cos(p["w"] * t), -1.0]


def written_for_one(t: Any, x: Any, p: Any) -> Any:
    return [x[1], -p["k"] * math.sin(x[0]) * x[2] + math.cos(p["w"] * t), -1.0]


def as_array(t: Any, x: Any, p: Any) -> Any:
    found = np.zeros(x.shape, dtype=np.result_type(x, t, p["k"], p["w"]))
    found[0], found[1], found[2] = smooth(t, x, p)
    return found


def like_its_state(t: Any, x: Any, p: Any) -> Any:
    found = np.empty_like(x)
    found[0], found[1], found[2] = smooth(t, x, p)
    return found


def kinked(t: Any, x: Any, p: Any) -> Any:
    """The same where x[0] > 0, but no complex step holds."""
    return [x[1], -p["k"] * np.sin(abs(x[0])) * x[2] + np.cos(p["w"] * t), -1.0]


def branching(t: Any, x: Any, p: Any) -> Any:
    return [x[1], -(p["k"] if x[0].real > -9.0 else 0.0) * np.sin(x[0]) * x[2]
            + np.cos(p["w"] * t), -1.0]  # fmt: skip


EVERY = [smooth, written_for_one, as_array, like_its_state, branching]


def by_hand(x: Any, t: Any) -> Any:
    slope = np.zeros((3, 6, t.size))
    slope[0, 1] = 1.0
    slope[1, 0] = -P["k"] * np.cos(x[0]) * x[2]
    slope[1, 2] = -P["k"] * np.sin(x[0])
    slope[1, 3] = -P["w"] * np.sin(P["w"] * t)
    slope[1, 4] = -np.sin(x[0]) * x[2]
    slope[1, 5] = -t * np.sin(P["w"] * t)
    return slope


@pytest.mark.parametrize("f", EVERY)
def test_many_states_are_what_each_is_alone(f: Any) -> None:
    alone = [np.asarray(f(t, x, P), dtype=float) for t, x in zip(T, X.T, strict=True)]
    np.testing.assert_allclose(values(f, T, X, P), np.stack(alone, axis=-1), rtol=1e-14)


@pytest.mark.parametrize("f", EVERY)
def test_slopes_in_state_time_and_parameters_are_those_by_hand(f: Any) -> None:
    value, slope = slopes(f, T, X, P, ("k", "w"))
    np.testing.assert_allclose(value, values(smooth, T, X, P), rtol=1e-14)
    exact = f is not written_for_one  # `math` knows no complex numbers
    np.testing.assert_allclose(slope, by_hand(X, T), rtol=0, atol=1e-14 if exact else 1e-10)


def test_slopes_beside_a_kink_are_one_sided_differences_apart() -> None:
    x = X + np.array([[4.0], [0.0], [0.0]])  # off the kink, to the right of it
    _, slope = slopes(kinked, T, x, P, ("k", "w"))
    np.testing.assert_allclose(slope, by_hand(x, T), rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("f", "way"),
    [
        (smooth, "differentiated by complex steps"),
        (kinked, "differentiated by differences"),
        (written_for_one, "differentiated by diff"),
        (branching, "takes one state at a time"),
    ],
)
def test_how_a_function_is_called_and_differentiated_is_logged(f, way, caplog):
    def fresh(t: Any, x: Any, p: Any) -> Any:
        return f(t, x, p)

    with caplog.at_level(logging.DEBUG, "contbreather.flows.functions"):
        slopes(fresh, T, X, P)
    assert way in caplog.text


def test_a_matrix_whose_rows_sum_to_zero_takes_many_states_where_all_are_equal() -> None:
    """As it differentiates: its product is rounding there, which depends on the order of sums."""
    matrix, shapes = RNG.normal(size=(30, 30)), []
    matrix -= np.diag(matrix.sum(axis=1))

    def transport(t: Any, x: Any, p: Any) -> Any:
        shapes.append(x.shape)
        return matrix @ x

    for _ in range(2):
        values(transport, 0.0, np.ones((30, 7)), {})
    assert shapes[-2:] == [(30, 7)] * 2


def test_a_sum_over_all_states_is_not_taken_for_one_of_each() -> None:
    found = values(lambda t, x, p: [np.sum(x), np.max(x), x[0]], 0.0, X, {})
    np.testing.assert_allclose(found, [X.sum(axis=0), X.max(axis=0), X[0]], rtol=1e-14)


def test_small_and_large_units_are_differentiated_alike() -> None:
    """A converter in microseconds, with a function that no complex step suits."""

    def f(t: Any, x: Any, p: Any) -> Any:
        return [abs(np.sin(2e6 * np.pi * t) + 2) * x[0]]

    t, x = np.linspace(0, 1e-6, 9), 1e-5 * (1 + RNG.uniform(size=(1, 9)))
    _, slope = slopes(f, t, x, {})
    wanted = 2e6 * np.pi * np.cos(2e6 * np.pi * t) * x[0]
    np.testing.assert_allclose(slope[0, 1], wanted, rtol=0, atol=1e-8 * abs(wanted).max())
    np.testing.assert_allclose(slope[0, 0], np.sin(2e6 * np.pi * t) + 2, rtol=1e-8)
    rest = np.vstack([np.ones(9), 1e-16 * RNG.normal(size=9)])  # but for rounding
    _, slope = slopes(lambda t, x, p: [abs(x[0]) + x[1]], t, rest, {})
    np.testing.assert_allclose(slope[0, :2], 1.0, rtol=1e-9)


@pytest.mark.slow
def test_a_cycle_and_a_sliding_orbit_of_decorated_functions() -> None:
    numba = pytest.importorskip("numba")

    begin: dict[str, Any] = {"start": {"x": 2.0, "v": 0.0}, "params": {"mu": 1.0}, "settle": 30}
    plain, compiled = (cb.cycle(f, **begin) for f in (van_der_pol, numba.njit(van_der_pol)))
    assert compiled.start["period"] == pytest.approx(plain.start["period"], rel=1e-12)
    heavy = cb.Flow(numba.njit(van_der_pol), mass=[[1.0, 0.0], [0.0, 1.0]])
    assert cb.cycle(heavy, **begin).start["period"] == pytest.approx(plain.start["period"])
    relay = cb.Filippov(
        *(numba.njit(f) for f in (lambda t, x, p: [-p["u"]], lambda t, x, p: [p["u"]])),
        lambda t, x, p: x[0],
    )
    assert cb.integrate(relay, {"y": 1.0}, {"u": 0.5}, time=3.0).final == [0.0]


def test_a_mass_matrix_is_divided_out() -> None:
    mass = [[2.0, 1.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 1.0]]
    heavy = cb.Flow(smooth, mass=mass)
    np.testing.assert_allclose(mass @ values(heavy.f, T, X, P), values(smooth, T, X, P), atol=1e-14)
    _, slope = slopes(heavy.f, T, X, P, ("k", "w"))
    np.testing.assert_allclose(np.einsum("ij,jkl", mass, slope), by_hand(X, T), atol=1e-14)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda: cb.Flow(3), "f must be a function"),
        (lambda: cb.Flow(smooth, until=1.0), "until must be a function"),
        (lambda: cb.Filippov(smooth, smooth, 0.0), "h must be a function"),
        (lambda: cb.Flow(smooth, walls=(2,)), r"walls\[0\] must be a function"),
        (lambda: cb.Flow(smooth, walls=2), "walls must be a tuple"),
        (lambda: cb.Flow(smooth, mass=np.diag([1.0, 1.0, 0.0])), "differential-algebraic"),
        (lambda: cb.Flow(smooth, mass=[1.0]), "a mass matrix is square"),
        (lambda: cb.Flow(smooth).check(0, [1.0, 2.0], P), "raises IndexError"),
        (lambda: cb.Flow(smooth).check(0, [[1.0]], P), "a state is a row of numbers"),
        (lambda: cb.Flow(smooth).check(0, [1, 2, 3], {"w": 1}), "'k'; params has 'w'"),
        (lambda: cb.Flow(lambda t, x, p: [math.nan]).check(0, [1], P), "finite numbers"),
        (lambda: cb.Flow(lambda t, x, p: 1 / 0).check(0, [1], P), "raises ZeroDivisionError"),
        (lambda: cb.Flow(lambda t, x, p: x.__imul__(2)).check(0, [1], P), "f writes to its x or p"),
        (lambda: cb.Flow(lambda t, x, p: [p.setdefault("q", 1.0)]).check(0, [1], P), "writes to"),
        (
            lambda: cb.Flow(smooth, until=lambda t, x, p: x).check(0, [1, 2, 3], P),
            "a number was expected",
        ),
        (
            lambda: cb.Flow(smooth, reset=lambda t, x, p: 1.0).check(0, [1, 2, 3], P),
            "a row of numbers was expected",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_a_sentence(wrong: Callable[[], Any], sentence: str):
    with pytest.raises(cb.BadInput, match=sentence):
        wrong()


def test_a_field_that_raises_midway_says_where() -> None:
    with pytest.raises(Undefined, match=r"raised ValueError: .*, at t = 1, x = \[-1.0\], p = "):
        values(lambda t, x, p: [math.sqrt(x[0])], np.array([0, 1]), np.array([[1.0, -1.0]]), {})


def test_a_bug_midway_surfaces_with_a_note() -> None:
    def f(t: Any, x: Any, p: Any) -> Any:
        return [{}[float(x[0])]] if x[0] > 2 else [x[0]]

    values(f, 0.0, np.array([[1.0]]), {})
    with pytest.raises(KeyError) as raised:
        values(f, 0.5, np.array([[1.0, 3.0]]), {})
    assert "at t = 0.5, x = [3.0]" in raised.value.__notes__[0]


@pytest.mark.parametrize("written", ["for many states", "for one state"])
def test_equilibria_ask_for_no_more_values_than_the_same_equations_as_a_problem(written) -> None:
    calls = 0

    def counted(t: Any, u: Any, p: Any) -> Any:
        nonlocal calls
        calls += 1
        if written == "for one state" and not u[0].imag and u[0] < -100:
            return [0.0, 0.0, 0.0]
        return lorenz(t, u, p)

    start, params = {"x": 6.0, "y": 6.0, "z": 13.5}, {"s": 10.0, "r": 14.5, "b": 8 / 3}
    rest = cb.equilibrium(counted, start, params)
    plain = cb.Problem(lambda u, p: counted(0.0, u, p), start, params, events=rest.events)
    each = []
    for problem in (rest, plain):
        calls = 0
        branch = cb.trace(problem, "r", within={"r": (2.0, 30.0)})
        each.append(calls / len(branch))
        hopf = branch.first("HB")
        assert hopf["r"] == pytest.approx(10 * (10 + 8 / 3 + 3) / (10 - 8 / 3 - 1), rel=1e-12)
    assert each[0] <= 1.1 * each[1]
    assert each[0] <= 24
