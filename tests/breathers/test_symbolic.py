"""What sympy derives by itself is what is written by hand."""

from __future__ import annotations

import numpy as np
import pytest

from contbreather.breathers.closure import Closure
from contbreather.lattice import Fourier, Harmonic, InfiniteChain, Ring, Symbolic

from .derived import derive_closure, flight_identities

CLOSURES = {
    "harmonic": (Closure(), {}),
    "two harmonics on a ring": (
        Closure(Fourier(cos={3: -2.7, 1: -1.0}), Ring(5)),
        {"c1": -1.1, "c3": -2.0},
    ),
    "formula": (Closure(Symbolic("-cos(t)/(1 + e*cos(2*t))", e=0.3), InfiniteChain()), {"e": 0.2}),
}
POINTS = [(0.68, -2.5, 0.5, 0.12, 0.4), (0.3, 0.7, 0.06, 0.2499, 0.99), (1.1, 2.0, 1.3, 0.0, 0.05)]


@pytest.fixture(scope="module")
def derived():
    return derive_closure()


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("which", CLOSURES)
def test_hand_written_closure_derivatives_are_those_sympy_derives(derived, which, point):
    closure, own = CLOSURES[which]
    p, phi, a, gamma, k = point
    x, params = np.array([p, phi]), {"a": a, "gamma": gamma, "k": k, **own}

    def expected(matrix):
        return derived.evaluate(matrix, closure, x, params)

    close = {"rtol": 1e-14, "atol": 1e-14}
    np.testing.assert_allclose(
        closure.residual(x, params), expected(derived.residual)[:, 0], **close
    )
    np.testing.assert_allclose(closure.jacobian(x, params), expected(derived.jacobian), **close)
    names = {"a": "a", "gamma": "gamma", "k": "k"}
    if own:
        names["c"] = next(iter(closure.forcing.params))
    for symbol, name in names.items():
        np.testing.assert_allclose(
            closure.sensitivity(x, params, name),
            expected(derived.sensitivity[symbol])[:, 0],
            **close,
        )


def test_the_mode_between_impacts_is_free_antisymmetric_and_loses_two_p():
    identities = flight_identities()
    assert len(identities) == 6
    assert {name: expr for name, expr in identities.items() if expr != 0} == {}


def test_every_parameter_of_a_closure_has_a_sensitivity_that_finite_differences_confirm():
    for closure, own in CLOSURES.values():
        x = np.array([0.6, -2.0])
        params = {"a": 0.4, "gamma": 0.11, "k": 0.3, **own}
        for name in closure.params:
            h = 1e-6
            up = closure.residual(x, {**params, name: params[name] + h})
            down = closure.residual(x, {**params, name: params[name] - h})
            got = closure.sensitivity(x, params, name)
            np.testing.assert_allclose(got, (up - down) / (2 * h), atol=1e-8)


def test_a_harmonic_closure_has_no_parameter_of_its_own():
    assert Closure(Harmonic()).params == ("a", "gamma", "k")
