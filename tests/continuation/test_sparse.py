"""Large problems: sparse derivatives lead to the same points as dense ones, and to known ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array, csr_array

import contbreather as cb
from contbreather.errors import BadInput

from .large import bratu, brusselator, brusselator_hopf, second

FEW = [cb.fold(), cb.branch_point(), cb.hopf()]


def folded(road: str, n: int = 50) -> cb.Branch:
    steps, within = cb.Steps(most=45), {"lam": (0.05, 4)}
    problem = bratu(second(n), road)
    return cb.trace(problem, "lam", within=within, towards="up", events=FEW, steps=steps)


def test_dense_sparse_and_coloured_derivatives_give_the_same_points() -> None:
    dense, *others = (folded(road) for road in ("dense", "sparse", "pattern"))
    for other in others:
        assert [point.label for point in other.special] == ["EP1", "LP1", "EP2"]
        assert not other.doubtful
        np.testing.assert_allclose(other["lam"], dense["lam"], rtol=0, atol=1e-11)
        np.testing.assert_allclose(other["u"], dense["u"], rtol=0, atol=1e-10)
        assert other.first("LP")["lam"] == pytest.approx(dense.first("LP")["lam"], abs=1e-13)


def test_the_fold_of_bratu_s_problem_is_the_known_one_but_for_the_mesh() -> None:
    coarse, fine = (folded("sparse", n).first("LP")["lam"] for n in (49, 99))
    assert (4 * fine - coarse) / 3 == pytest.approx(3.513830719, abs=2e-7)


@pytest.mark.parametrize("road", ["dense", "sparse"])
def test_hopf_points_of_the_brusselator_are_those_in_closed_form(road) -> None:
    n, B = 20, 6.2
    branch = cb.trace(
        brusselator(n, road, B=B), "L", within={"L": (0.4, 1.4)}, towards="up", events=FEW
    )
    found = [(point["L"], point.detail["omega"]) for point in branch.special if point.kind == "HB"]
    np.testing.assert_allclose(found, [brusselator_hopf(n, k, B) for k in (2, 3, 4)], atol=1e-10)
    assert not branch.doubtful


def test_first_lyapunov_coefficients_are_those_of_the_dense_road() -> None:
    def first(road):
        problem = brusselator(20, road)
        branch = cb.trace(problem, "L", within={"L": (0.5, 0.7)}, towards="up", events=FEW)
        return branch.first("HB").detail

    dense, sparse = first("dense"), first("sparse")
    assert sparse["l1"] == pytest.approx(dense["l1"], rel=1e-8)
    assert sparse["reach"] == np.inf  # no pair can be further up than was looked


# --- what is refused --------------------------------------------------------------------------


def refused(**given) -> str:
    problem = replace(bratu(second(30)), **given)
    with pytest.raises(BadInput) as caught:
        cb.trace(problem, "lam", within={"lam": (0, 1)})
    return str(caught.value)


def changed(change):
    jacobian = bratu(second(30)).jacobian

    def altered(u, p):
        matrix = jacobian(u, p).tolil()
        change(matrix)
        return matrix

    return altered


def test_a_wrong_entry_of_a_sparse_jacobian_is_named() -> None:
    def change(matrix):
        matrix[7, 8] = 1000.0

    said = refused(jacobian=changed(change))
    assert "its entry (7, 8) is 1000, differences give 961" in said


def test_a_nan_in_a_sparse_jacobian_is_named() -> None:
    def change(matrix):
        matrix[3, 3] = np.nan

    assert (
        refused(jacobian=changed(change))
        == "entry (3, 3) of the sparse Jacobian is nan at the start"
    )


def test_a_sparse_jacobian_of_the_wrong_shape_is_refused() -> None:
    said = refused(jacobian=lambda u, p: csr_array((30, 29)))
    assert said == "the Jacobian is sparse and has shape (30, 29); (30, 30) was wanted"


def test_a_sparse_sensitivity_is_refused_with_what_to_do() -> None:
    said = refused(sensitivity=lambda u, p, name: coo_array(np.exp(u)[:, None]))
    assert said.endswith("a dense array of shape (30,) was wanted: return its toarray()")


def test_an_entry_that_the_pattern_misses_is_named() -> None:
    pattern = second(30).toarray() != 0
    pattern[11, 12] = False
    said = refused(jacobian=None, sparsity=pattern)
    assert said.startswith(
        "the sparsity pattern does not fit the residual: it misses entry (11, 12)"
    )


def test_a_pattern_of_the_wrong_shape_or_beside_a_jacobian_is_refused() -> None:
    with pytest.raises(BadInput, match=r"pattern has shape \(3, 3\); \(30, 30\) was wanted"):
        replace(bratu(second(30)), jacobian=None, sparsity=np.eye(3))
    with pytest.raises(BadInput, match="either a jacobian or a sparsity pattern"):
        replace(bratu(second(30)), sparsity=second(30))
