"""The stage equations on their own: what their factors solve, compiled or not."""

from __future__ import annotations

import numpy as np
import pytest

from contbreather.flows import Collocation, stages


@pytest.mark.parametrize("steep", [0.1, 300.0])  # in the second case rows change places
def test_sensitivities_solve_the_stage_equations_with_the_same_bits_compiled_or_not(steep) -> None:
    scheme, lengths, random = Collocation(points=3), np.array([0.5, 0.2]), np.random.default_rng(1)
    f, df = random.standard_normal((2, 2, 3)), steep * random.standard_normal((2, 4, 6))
    inside, ends = np.empty((2, 5, 6)), np.empty((2, 2, 5))
    factors, pivots, answer = np.empty((2, 6, 6)), np.empty((2, 6), np.int64), np.empty(1)
    found = []
    for kernel in (lambda one: one, lambda one: one.as_it_is):
        kernel(stages.FACTORISE)(df, lengths, scheme.matrix, factors, pivots, answer)
        kernel(stages.SENSITIVITIES)(
            factors, pivots, lengths, scheme.nodes, scheme.weights, f, df, inside, ends
        )
        found.append((inside.tobytes(), ends.tobytes()))
    assert found[0] == found[1]
    assert answer[0] == 1
    assert (pivots != np.arange(6)).any() == (steep > 1)
    # the slopes in the state where the first interval begins: K = h J (1 + A K), at each point
    rises = inside[0, :2].reshape(2, 3, 2).transpose(1, 2, 0)
    states = np.eye(2) + np.einsum("ab,bij->aij", scheme.matrix, rises)
    right = lengths[0] * df[:, :2, :3].transpose(2, 0, 1) @ states
    np.testing.assert_allclose(rises, right, rtol=0, atol=1e-11 * abs(right).max())


def test_derivatives_that_are_not_finite_and_singular_matrices_are_told() -> None:
    lengths, matrix = np.ones(1), np.ones((1, 1))
    factors, pivots, answer = np.empty((1, 1, 1)), np.empty((1, 1), np.int64), np.empty(1)
    for slope in (np.nan, np.inf, 1.0):
        df = np.full((1, 2, 1), slope)
        stages.FACTORISE(df, lengths, matrix, factors, pivots, answer)
        assert answer[0] == 0 if slope == 1 else not np.isfinite(answer[0])
