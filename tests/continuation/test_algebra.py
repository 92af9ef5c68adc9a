"""The linear algebra below, on random matrices: by determinants, minors, differences, and numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csc_array

from contbreather.continuation.algebra import linear_algebra as algebra
from contbreather.continuation.algebra import sparse
from contbreather.continuation.algebra.newton import Dense
from contbreather.continuation.systems import defining_systems as systems

Array = NDArray[np.float64]
SEEDS = range(8)


def matrices(seed: int, n: int = 5, count: int = 3) -> Array:
    return np.random.default_rng(seed).normal(size=(count, n, n))


def scattered(seed: int, n: int, width: int, lead: float = 0.0) -> Array:
    """A matrix with few entries; with a diagonal that leads, or without."""
    rng = np.random.default_rng(seed)
    whole = rng.normal(size=(n, width)) * (rng.random((n, width)) < 4 / n)
    whole[:, :n] += np.diag(lead + rng.random(n))
    return whole


# --- matrices that lose rank ------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("degree", [1, 2])
def test_a_matrix_is_singular_where_its_determinant_changes_sign(seed: int, degree: int) -> None:
    """Of matrices that are linear, or quadratic, between those at 0 and 1."""
    parts = matrices(seed, count=degree + 1)
    u = np.linspace(0.0, 1.0, 2001)
    dets = np.linalg.det(np.einsum("ui,ijk->ujk", u[:, None] ** np.arange(degree + 1), parts))
    at = np.flatnonzero(dets[1:] * dets[:-1] < 0)
    exact = u[at] - dets[at] * u[1] / (dets[at + 1] - dets[at])
    ends = [sum(v**i * part for i, part in enumerate(parts)) for v in (0.0, 0.5, 1.0)][
        :: 3 - degree
    ]
    assert systems.singular_between(*ends) == pytest.approx(exact, abs=2e-6)
    assert systems.singular_between(*ends[::-1]) == pytest.approx(1 - exact[::-1], abs=2e-6)


def test_where_the_first_matrix_is_singular_the_others_still_tell() -> None:
    first, last = np.diag([0.0, 1.0]), np.diag([1.0, -1.0])
    assert systems.singular_between(first, last) == pytest.approx([0.0, 0.5], abs=1e-12)
    assert systems.singular_between(first, first).size == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_the_least_singular_value_has_the_sign_of_the_determinant(seed: int) -> None:
    for matrix in matrices(seed):
        exact = np.linalg.svd(matrix)[1][-1] * np.sign(np.linalg.det(matrix))
        assert systems.signed_smallest(matrix) == pytest.approx(exact)
        assert systems.signed_smallest(csc_array(matrix)) == pytest.approx(exact)
        sign = Dense(matrix[:-1], matrix[-1]).sign()
        assert sign == np.sign(exact)


# --- large matrices -----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("lead", [0.0, 3.0])
@pytest.mark.parametrize(("more", "weak"), [(0, 1.0), (1, 1.0), (1, 1e-5), (2, 1.0), (2, 1e-5)])
def test_factors_answer_what_numpy_does(seed: int, lead: float, more: int, weak: float) -> None:
    """Also where the square part is closer to singular than the whole, as beside a fold."""
    n = 14
    dense = scattered(seed, n, n + more, lead)
    dense[:, n:] += 0.1
    left, sizes, other = np.linalg.svd(dense[:, :n])
    dense[:, :n] -= (1 - weak) * sizes[-1] * np.outer(left[:, -1], other[-1])
    rng = np.random.default_rng(seed)
    rows, right = rng.normal(size=(more, n + more)), rng.normal(size=n + more)
    factors, square = sparse.Factors(csc_array(dense)), np.vstack([dense, rows])
    size = np.linalg.cond(square) * 1e-13
    assert factors.solve(right, rows) == pytest.approx(np.linalg.solve(square, right), abs=size)
    assert factors.transposed(right, rows) == pytest.approx(
        np.linalg.solve(square.T, right), abs=size
    )
    assert factors.sign(rows) == np.sign(np.linalg.det(square))
    least = np.linalg.lstsq(dense, right[:n])[0]
    assert factors.least(right[:n]) == pytest.approx(least, abs=size)
    assert abs(dense @ factors.null).max(initial=0.0) < size
    assert factors.basis.T @ factors.basis == pytest.approx(np.eye(more), abs=1e-12)


def weakened(seed: int, more: int, left_over: float) -> tuple[Array, Array]:
    """A matrix with so much left of its least singular value, and those that it had."""
    whole = scattered(seed, 14, 14 + more, 2.0)
    left, sizes, right = np.linalg.svd(whole)
    return whole - (1 - left_over) * sizes[-1] * np.outer(left[:, -1], right[13]), sizes


@pytest.mark.parametrize("seed", SEEDS)
def test_beside_a_core_that_is_singular_to_the_last_digit_the_other_null_vector_is_known(
    seed: int,
) -> None:
    """One null vector has nothing but the first unknowns, the other none of them."""
    one, other, here = matrices(seed, n=6)
    left, right = np.linalg.qr(one)[0], np.linalg.qr(other)[0]
    matrix = np.zeros((12, 14))
    matrix[:6, :6], matrix[6:, 6:12] = left[:, 1:] @ right[1:], np.eye(6) + 0.1 * here
    matrix[:6, 12:], matrix[6:, 13] = left[:, :1], 1.0
    rows, x = np.random.default_rng(seed).normal(size=(2, 14)), np.arange(14.0)
    found = sparse.Factors(matrix).solve(np.append(matrix @ x, rows @ x), rows)
    np.testing.assert_allclose(found, x, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("more", [0, 1])
def test_one_that_is_singular_to_the_last_digit_loses_one_rank(seed: int, more: int) -> None:
    """Its inverse is rounding in all directions but one: nothing else may be read off it."""
    dense, sizes = weakened(seed, more, 0.0)
    found = algebra.least_singular(csc_array(dense))
    assert found.size < 1e-14
    assert found.second == pytest.approx(sizes[-2], rel=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("more", [0, 1])
def test_the_weak_end_of_a_large_matrix_is_that_of_a_dense_one(seed: int, more: int) -> None:
    dense, _ = weakened(seed, more, 0.02)
    exact, found = algebra.least_singular(dense), algebra.least_singular(csc_array(dense))
    assert found.size == pytest.approx(exact.size, rel=1e-6)
    assert found.second == pytest.approx(exact.second, rel=1e-2)
    assert exact.largest <= found.largest <= 4 * exact.largest
    for one, other in ((found.left, exact.left), (found.right, exact.right)):
        assert abs(one @ other) == pytest.approx(1.0)
    assert abs(found.null @ exact.null.T) == pytest.approx(np.eye(more), abs=1e-9)
    assert dense @ found.right == pytest.approx(found.size * found.left, abs=1e-9)
    value = np.random.default_rng(seed).normal(size=14)
    assert found.rest(value) == pytest.approx(exact.rest(value), abs=1e-6)
    if not more:
        assert found.sign * found.left @ found.right == pytest.approx(
            exact.sign * exact.left @ exact.right
        )
        assert exact.sign == np.sign(np.linalg.det(dense))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("degree", [1, 2])
def test_bordered_matrices_are_singular_where_dense_ones_are(seed: int, degree: int) -> None:
    n, rng = 15, np.random.default_rng(seed)
    row, scales = rng.normal(size=n + 1), rng.uniform(0.5, 2.0, size=n + 1)
    base, turned = scattered(seed, n, n + 1, 3.0), 0.1 * scattered(seed + 50, n, n + 1)
    base[:, n] = 0.1
    for i, place in enumerate(rng.uniform(0.1, 0.9, size=1 + seed % 3)):
        turned[i, i] = -base[i, i] / place  # so many unknowns turn round on the way
    places = (0.0, 1.0) if degree == 1 else (0.0, 0.5, 1.0)
    across = [base + (v + 0.2 * (degree - 1) * v * v) * turned for v in places]
    dense = [np.vstack([one, row]) * scales for one in across]
    made = [algebra.Bordered(sparse.Factors(csc_array(one)), row, scales) for one in across]
    exact = systems.singular_between(*dense)
    assert systems.singular_between(*made) == pytest.approx(exact, abs=2e-3)
    x = rng.normal(size=n + 1)
    assert made[0] @ x == pytest.approx(dense[0] @ x)
    assert dense[0] @ made[0].solve(x) == pytest.approx(x, abs=1e-9)
    assert dense[0].T @ made[0].transposed(x) == pytest.approx(x, abs=1e-9)
    near = np.linalg.svd(dense[0])
    close = dense[0] - 0.999 * near[1][-1] * np.outer(near[0][:, -1], near[2][-1])
    bordered = algebra.Bordered(sparse.Factors(csc_array(close[:-1])), close[-1], np.ones(n + 1))
    assert systems.signed_smallest(bordered) == pytest.approx(
        np.linalg.svd(close)[1][-1] * np.sign(np.linalg.det(close)), rel=1e-3
    )
