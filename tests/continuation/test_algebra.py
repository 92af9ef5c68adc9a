"""The linear algebra below, on random matrices: by determinants, minors, differences, and numpy."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csc_array

import contbreather as cb
from contbreather.continuation.algebra import linear_algebra as algebra
from contbreather.continuation.algebra import sparse
from contbreather.continuation.algebra.newton import Dense, Undefined
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.systems import defining_systems as systems
from contbreather.continuation.systems import spectrum

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


# --- pairs of eigenvalues ---------------------------------------------------------------------


def test_the_least_factor_has_the_sign_of_their_product() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        pair = rng.normal() + 1j * rng.normal()
        factors = np.array([*rng.normal(size=3), pair, pair.conjugate()])
        found = spectrum.least_with_sign(factors, 1e-14)
        assert abs(found) == abs(factors).min()
        assert math.copysign(1.0, found) == np.sign(np.prod(factors).real)
    assert spectrum.least_with_sign(np.array([2.0, -1e-20 + 0j, 3.0]), 1e-14) == 0.0
    for one in (3.0, -3.0):  # zeros of an even order have no size, and change no sign
        doubled = spectrum.least_with_sign(np.array([1e-20, one, -1e-20]).astype(complex), 1e-14)
        assert 0.0 < doubled * np.sign(one) < 1e-50


def spectrum_of(matrix: Array) -> spectrum.Eigenvalues:
    problem = cb.Problem(lambda x, p: matrix @ x, {"x": np.zeros(len(matrix))}, {"m": 0.0})
    return spectrum.eigenvalues(Curve(problem, ("m",)), np.zeros(len(matrix) + 1))


def test_every_pair_of_eigenvalues_is_looked_at_once() -> None:
    """Beside those that are there everywhere."""
    values = spectrum_of(np.diag([1.0, 2.0, 3.0, 4.0]))
    found = np.sort(values.factors()[0].real)
    assert found == pytest.approx([3.0, 4.0, 5.0, 5.0, 6.0, 7.0])
    assert np.sort(values.without(2.1, 3.9).values.real) == pytest.approx([1.0, 3.0])


@pytest.mark.parametrize("seed", SEEDS)
def test_the_critical_pair_is_the_one_that_is_least_off(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = np.zeros((7, 7))
    pairs = rng.normal(size=(3, 2)) + np.array([0.0, 3.0])
    for i, (re, im) in enumerate(pairs):
        blocks[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[re, im], [-im, re]]
    blocks[6, 6] = 5.0
    turn = rng.normal(size=(7, 7))
    values = spectrum_of(turn @ blocks @ np.linalg.inv(turn))
    re, im = pairs[abs(pairs[:, 0]).argmin()]
    assert values.square_of_pair() == pytest.approx(re**2 + im**2)
    plane = values.plane(im**2 - re**2)
    assert np.linalg.eigvals(plane.within) == pytest.approx([re + 1j * abs(im), re - 1j * abs(im)])
    assert plane.left.T @ plane.right == pytest.approx(np.eye(2))
    assert values.matrix @ plane.right == pytest.approx(plane.right @ plane.within, abs=1e-9)


def test_a_double_zero_gives_its_chain_and_real_ones_are_no_pair() -> None:
    turn = matrices(3, n=3)[0]
    chain = turn @ np.array([[0, 1, 0], [0, 0, 0], [0, 0, 2.0]]) @ np.linalg.inv(turn)
    values = spectrum_of(chain)
    assert values.square_of_pair() == pytest.approx(0.0, abs=1e-12)
    plane = values.plane(0.0)
    assert chain @ plane.right == pytest.approx(plane.right @ plane.within, abs=1e-7)
    assert plane.within @ plane.within == pytest.approx(np.zeros((2, 2)), abs=1e-7)
    with pytest.raises(Undefined, match="neutral saddle"):
        spectrum_of(np.diag([1.0, -1.0, 3.0])).square_of_pair()


# --- large matrices -----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("lead", [0.0, 3.0])
@pytest.mark.parametrize("more", [0, 1, 2])
def test_factors_answer_what_numpy_does(seed: int, lead: float, more: int) -> None:
    n = 14
    dense = scattered(seed, n, n + more, lead)
    dense[:, n:] += 0.1
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


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("more", [0, 1])
def test_one_that_is_singular_to_the_last_digit_loses_one_rank(seed: int, more: int) -> None:
    """Its inverse is rounding in all directions but one: nothing else may be read off it."""
    n = 14
    dense = scattered(seed, n, n + more, 2.0)
    left, sizes, right = np.linalg.svd(dense)
    dense = dense - sizes[-1] * np.outer(left[:, -1], right[n - 1])
    found = algebra.least_singular(csc_array(dense))
    assert found.size < 1e-14
    assert found.second == pytest.approx(sizes[-2], rel=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("more", [0, 1])
def test_the_weak_end_of_a_large_matrix_is_that_of_a_dense_one(seed: int, more: int) -> None:
    n = 14
    dense = scattered(seed, n, n + more, 2.0)
    left, sizes, right = np.linalg.svd(dense)
    dense = dense - 0.98 * sizes[-1] * np.outer(left[:, -1], right[n - 1])  # nearly singular
    exact, found = algebra.least_singular(dense), algebra.least_singular(csc_array(dense))
    assert found.size == pytest.approx(exact.size, rel=1e-6)
    assert found.second == pytest.approx(exact.second, rel=1e-2)
    assert exact.largest <= found.largest <= 4 * exact.largest
    for one, other in ((found.left, exact.left), (found.right, exact.right)):
        assert abs(one @ other) == pytest.approx(1.0)
    assert abs(found.null @ exact.null.T) == pytest.approx(np.eye(more), abs=1e-9)
    assert dense @ found.right == pytest.approx(found.size * found.left, abs=1e-9)
    value = np.random.default_rng(seed).normal(size=n)
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


def test_parts_of_sparse_matrices_are_those_of_dense_ones() -> None:
    dense, more = scattered(2, 9, 9), matrices(2, n=9)[0]
    one = csc_array(dense)
    rows, columns = more[0], more[1]
    pairs = [
        (sparse.beside(one, more[:, :2]), np.hstack([dense, more[:, :2]])),
        (sparse.above(one, more[:2]), np.vstack([dense, more[:2]])),
        (sparse.scaled(one, rows, columns), dense * columns * rows[:, None]),
        (sparse.plus_diagonal(one, 0.5), dense + 0.5 * np.eye(9)),
    ]
    for found, exact in pairs:
        assert found.toarray() == pytest.approx(exact)
    assert sparse.entry_columns(one).tolist() == np.sort(np.nonzero(dense)[1]).tolist()
    sizes = (abs(dense) * abs(columns)).max(axis=1)
    assert sparse.row_sizes(one, abs(columns)) == pytest.approx(sizes)
    assert sparse.row_sizes(dense, abs(columns)) == pytest.approx(sizes)
    assert np.linalg.norm(sparse.any_vector(9)) == pytest.approx(1.0)
    complex_right = rows + 1j * columns
    shifted = sparse.plus_diagonal(one, 2j)
    assert shifted @ algebra.solved(shifted, complex_right, "why") == pytest.approx(complex_right)


@pytest.mark.parametrize("shift", [0.0, 0.7j])
def test_null_vectors_of_a_large_matrix_are_null_on_both_sides(shift: complex) -> None:
    dense = scattered(4, 12, 12, 2.0) + shift * np.eye(12)
    near = np.linalg.eigvals(dense)
    singular = csc_array(dense - near[abs(near).argmin()] * np.eye(12))
    q, p = sparse.null_vectors(singular)
    assert np.linalg.norm(q) == pytest.approx(1.0)
    assert np.linalg.norm(p) == pytest.approx(1.0)
    assert abs(singular @ q).max() < 1e-9
    assert abs(p.conj() @ singular).max() < 1e-9
    exactly = csc_array(np.diag(np.arange(10.0)))
    q, p = sparse.null_vectors(exactly)
    assert (abs(q[0]), abs(p[0])) == pytest.approx((1.0, 1.0))


def test_a_singular_matrix_still_gives_a_correction_that_says_so() -> None:
    dense = np.diag(np.arange(10.0))[:, :]
    right = dense @ np.ones(10)
    x, singular = sparse.sparse_correction(sparse.Factors(csc_array(dense)), right, None)
    assert singular
    assert dense @ x == pytest.approx(right, abs=1e-9)
    assert sparse.Factors(csc_array(dense)).sign() == 0
    regular = dense + np.eye(10)
    x, singular = sparse.sparse_correction(sparse.Factors(csc_array(regular)), right, None)
    assert not singular
    assert regular @ x == pytest.approx(right)
    row = np.arange(11.0)
    for whole, blind in ((regular, False), (dense, True)):
        wide = np.hstack([whole, whole[:, 1:2]])
        x, singular = sparse.sparse_correction(sparse.Factors(csc_array(wide)), right, row)
        assert singular == blind
        assert wide @ x == pytest.approx(right, abs=1e-9)
        assert row @ x == pytest.approx(0.0, abs=1e-9)


def test_unknowns_of_a_pattern_share_a_step_only_where_no_equation_does() -> None:
    dense = scattered(5, 11, 12)
    pattern = sparse.Pattern(csc_array(dense != 0))
    for i, j in combinations(range(12), 2):
        if (dense[:, i] * dense[:, j]).any():
            assert pattern.colours[i] != pattern.colours[j]
    assert pattern.colours.max() < 10
    steps = np.linspace(0.5, 1.5, 12)
    found = pattern.derivative(lambda direction: dense @ direction, steps)
    assert found.toarray() == pytest.approx(dense)
