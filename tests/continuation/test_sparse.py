"""Large problems: sparse derivatives lead to the same points as dense ones, and to known ones."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import block_array, coo_array, csr_array, diags_array

import contbreather as cb
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.systems.spectrum import eigenvalues
from contbreather.errors import BadInput

from .large import (
    DX,
    DY,
    A,
    bratu,
    brusselator,
    brusselator_hopf,
    ignition,
    mode,
    plane,
    second,
    swift_hohenberg,
    swift_hohenberg_branches,
)
from .zoo import bratu_fold, knowing

FEW = [cb.fold(), cb.branch_point(), cb.hopf()]


def folded(road: str, n: int = 50) -> cb.Branch:
    steps, within = cb.Steps(most=20), {"lam": (3.2, 4)}
    problem = bratu(second(n), road, lam=3.3)
    return cb.trace(problem, "lam", within=within, towards="up", events=FEW, steps=steps)


@pytest.mark.slow
def test_dense_sparse_and_coloured_derivatives_give_the_same_points() -> None:
    dense, *others = (folded(road) for road in ("dense", "sparse", "pattern"))
    for other in others:
        assert [point.label for point in other.special] == ["EP1", "LP1", "EP2"]
        assert not other.doubtful
        np.testing.assert_allclose(other["lam"], dense["lam"], rtol=0, atol=1e-11)
        np.testing.assert_allclose(other["u"], dense["u"], rtol=0, atol=1e-10)
        assert other.first("LP")["lam"] == pytest.approx(dense.first("LP")["lam"], abs=1e-13)


def test_a_jacobian_may_come_back_in_the_same_arrays_in_any_order() -> None:
    plain = bratu(second(12), lam=1.0)
    matrix = second(12)
    for column in range(12):  # rows from below
        entries = slice(*matrix.indptr[column : column + 2])
        matrix.indices[entries] = matrix.indices[entries][::-1]
        matrix.data[entries] = matrix.data[entries][::-1]
    matrix.has_sorted_indices = matrix.has_canonical_format = False
    diagonal = np.flatnonzero(matrix.indices == np.repeat(np.arange(12), np.diff(matrix.indptr)))

    def again(u, p):
        matrix.data[diagonal] = p["lam"] * np.exp(u) - 2 * 13.0**2
        return matrix

    steps, within = cb.Steps(most=4), {"lam": (0, 4)}
    one, other = (
        cb.trace(problem, "lam", towards="up", within=within, steps=steps)
        for problem in (plain, replace(plain, jacobian=again))
    )
    np.testing.assert_allclose(other["u"], one["u"], rtol=0, atol=1e-13)


@pytest.mark.slow
def test_the_fold_of_bratu_s_problem_is_the_known_one_but_for_the_mesh() -> None:
    coarse, fine = (folded("sparse", n).first("LP")["lam"] for n in (99, 199))
    assert (4 * fine - coarse) / 3 == pytest.approx(bratu_fold(), abs=1e-8)


@pytest.mark.slow
def test_hopf_points_of_the_brusselator_are_those_in_closed_form_on_either_road() -> None:
    n, B, firsts = 20, 6.2, []
    for road in ("dense", "sparse"):
        branch = cb.trace(
            brusselator(n, road, B=B), "L", within={"L": (0.4, 1.4)}, towards="up", events=FEW
        )
        points = [point for point in branch.special if point.kind == "HB"]
        found = [(point["L"], point.detail["omega"]) for point in points]
        np.testing.assert_allclose(
            found, [brusselator_hopf(n, k, B) for k in (2, 3, 4)], atol=1e-10
        )
        assert not branch.doubtful
        firsts.append(points[0].detail)
    dense, few = firsts
    assert few["l1"] == pytest.approx(dense["l1"], rel=1e-8)
    assert few["reach"] == np.inf  # no pair can be further up than was looked


@pytest.mark.slow
@pytest.mark.parametrize("road", ["dense", "sparse"])
def test_pairs_that_turn_real_beyond_their_hopf_points_leave_no_doubt(road) -> None:
    branch = cb.trace(brusselator(20, road, L=1.0, B=4.5), "B", within={"B": (4.5, 12)}, events=FEW)
    found = [(p["B"], p.detail["omega"]) for p in branch.special if p.kind == "HB"]
    known = (
        [(1.0, omega) for _, omega in found],
        [brusselator_hopf(20, k, B) for k, (B, _) in enumerate(found, 1)],
    )
    np.testing.assert_allclose(*known, atol=1e-9)
    assert (len(found), branch.doubtful) == (8, ())


@pytest.mark.slow
@pytest.mark.parametrize("road", ["dense", "sparse"])
def test_branches_leave_the_trivial_state_where_the_discrete_symbol_vanishes(road) -> None:
    n, length, most = 60, 8 * np.pi, 0.2
    problem = swift_hohenberg(n, length, road)
    events = [cb.fold(), cb.branch_point()]
    branch = cb.trace(problem, "mu", within={"mu": (-0.1, most)}, towards="up", events=events)
    found = [point["mu"] for point in branch.special if point.kind == "BP"]
    np.testing.assert_allclose(found, swift_hohenberg_branches(n, length, most), atol=1e-12)
    assert not branch.doubtful


@pytest.mark.slow
def test_branches_that_leave_a_large_problem_are_those_of_the_dense_road() -> None:
    def arms(road):
        problem = swift_hohenberg(40, 6 * np.pi, road)
        line = cb.trace(problem, "mu", within={"mu": (-0.1, 0.1)}, events=[cb.branch_point()])
        return cb.switch(line.first("BP"), events=[], steps=cb.Steps(most=8))

    for dense, other in zip(arms("dense"), arms("sparse"), strict=True):
        assert abs(other[-1]["u"]).max() > 0.1
        np.testing.assert_allclose(other["u"], dense["u"], atol=1e-9)


@pytest.mark.slow
def test_two_branch_points_within_one_step_are_both_found() -> None:
    n, length = 60, 8 * np.pi
    problem = swift_hohenberg(n, length)
    steps, within = cb.Steps(first=0.1, largest=0.5), {"mu": (-0.1, 0.3)}
    branch = cb.trace(
        problem, "mu", within=within, towards="up", events=[cb.branch_point()], steps=steps
    )
    wanted = swift_hohenberg_branches(n, length, 0.3)
    assert len(branch) < len(wanted) + 8
    assert [point.kind for point in branch.special] == ["EP", *["BP"] * len(wanted), "EP"]


# --- what it takes ----------------------------------------------------------------------------


@pytest.mark.slow
def test_a_dense_derivative_that_is_nearly_all_zeros_gets_a_hint() -> None:
    """In what the branch says of itself; a full one gets none."""
    thin = cb.Problem(lambda u, p: p["mu"] - u, {"u": np.zeros(500)}, {"mu": 0.0})
    full = replace(thin, residual=lambda u, p: p["mu"] - u - 0.5 * u.mean())
    hint = "500 x 500 entries, nearly all of them 0: Problem(..., jacobian=pattern)"
    for problem, wanted in (
        (thin, True),
        (full, False),
        (replace(thin, jacobian=np.eye(500)), False),
    ):
        branch = cb.trace(problem, "mu", towards="up", events=(), steps=cb.Steps(most=1))
        assert (hint in repr(branch)) == wanted


@pytest.mark.slow
def test_memory_is_linear_in_the_entries_that_are_not_zero() -> None:
    def peak(n: int) -> int:
        problem = bratu(second(n))
        tracemalloc.start()
        cb.trace(problem, "lam", towards="up", events=FEW, steps=cb.Steps(most=6))
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    peak(500)  # what is imported and kept counts once
    small, large = peak(2000), peak(8000)
    assert large < 4.4 * small
    assert large < 600 * second(8000).nnz  # bytes


@pytest.mark.slow
def test_the_fold_on_a_square_is_the_known_one_but_for_the_mesh() -> None:
    def fold(m: int) -> float:
        problem, steps = bratu(plane(m), lam=6.7), cb.Steps(first=0.1)
        within = {"lam": (6.6, 7)}
        branch = cb.trace(problem, "lam", within=within, towards="up", events=FEW, steps=steps)
        return branch.first("LP")["lam"]

    assert (4 * fold(49) - fold(24)) / 3 == pytest.approx(6.808124, abs=1e-5)


# --- norms of arrays --------------------------------------------------------------------------


def test_the_norm_of_an_array_is_a_column_a_window_and_an_event() -> None:
    problem = bratu(second(20), lam=1.0)
    level = cb.user("norm(u)", 1.0)
    branch = cb.trace(problem, "lam", within={"norm(u)": (0.25, 2.0)}, events=[level])
    np.testing.assert_allclose(branch["norm(u)"], np.linalg.norm(branch["u"], axis=1), rtol=1e-15)
    assert branch[0]["norm(u)"] == pytest.approx(0.25, abs=1e-13)
    assert branch[-1]["norm(u)"] == pytest.approx(2.0, abs=1e-13)
    assert branch.first("UZ")["norm(u)"] == pytest.approx(1.0, abs=1e-12)
    with pytest.raises(BadInput, match=r"no column 'norm\(v\)'"):
        branch["norm(v)"]


# --- in two parameters ------------------------------------------------------------------------


@pytest.mark.slow
def test_a_curve_of_folds_meets_the_cusp_of_the_dense_road() -> None:
    """Its derivative is symmetric: no eigenvalue is looked for beside the axis."""
    branch = cb.trace(ignition(15), "lam", within={"lam": (4, 5.2)}, towards="up", events=FEW)
    line = cb.boundary(
        branch.first("LP"),
        ("eps", "lam"),
        within={"lam": (5.1, 6)},
        towards="up",
        events=FEW,
        steps=cb.Steps(first=0.1),
    )
    cusp = line.first("CP")
    assert cusp["eps"] == pytest.approx(0.245887853033, abs=1e-11)
    assert cusp["lam"] == pytest.approx(5.217285536164, abs=1e-11)
    assert not line.doubtful


def in_units(n: int) -> cb.Problem:
    """The same, in its left and its right half, in units that differ by a thousand."""
    plain, units = ignition(n), np.repeat([1e-2, 10.0], [n // 2, n - n // 2])
    start = {"left": np.full(n // 2, 1.5e2), "right": np.full(n - n // 2, 0.15)}
    return cb.Problem(
        lambda u, p: plain.residual(units * u, p),
        start,
        plain.params,
        jacobian=lambda u, p: plain.jacobian(units * u, p) * units,
        scales={"left": 1e2, "right": 0.1},
    )


@pytest.mark.slow
def test_a_cusp_of_a_large_problem_does_not_depend_on_its_units() -> None:
    events, within, steps = [cb.fold()], {"lam": (4, 5.2)}, cb.Steps(first=0.1)
    lines = []
    for problem in (in_units(7), ignition(7)):
        branch = cb.trace(problem, "lam", within=within, towards="up", events=events)
        fold, near = branch.first("LP"), {"lam": (5.13, 6)}
        line = cb.boundary(fold, ("eps", "lam"), within=near, towards="up", steps=steps)
        lines.append(line)
    one, other = (line.first("CP") for line in lines)
    assert one["eps"] == pytest.approx(other["eps"], abs=1e-10)
    assert one["lam"] == pytest.approx(other["lam"], abs=1e-10)


@pytest.mark.slow
def test_a_curve_of_hopf_points_is_the_one_in_closed_form() -> None:
    n, steps = 20, cb.Steps(most=6)
    branch = cb.trace(
        brusselator(n), "L", within={"L": (0.5, 0.7)}, towards="up", events=[cb.hopf()]
    )
    line = cb.boundary(branch.first("HB"), ("L", "B"), towards="up", events=[], steps=steps)
    wanted = [brusselator_hopf(n, 2, B) for B in line["B"]]
    np.testing.assert_allclose(np.stack([line["L"], line["omega2"] ** 0.5], 1), wanted, atol=1e-9)
    assert np.ptp(line["B"]) > 0.1


@pytest.mark.slow
def test_branch_points_that_a_subspace_keeps_are_followed() -> None:
    problem, steps = swift_hohenberg(40, 6 * np.pi), cb.Steps(most=4)
    branch = cb.trace(problem, "mu", within={"mu": (-0.1, 0.1)}, events=[cb.branch_point()])
    line = cb.boundary(branch.first("BP"), ("nu", "mu"), towards="up", events=[], steps=steps)
    np.testing.assert_allclose(line["mu"], branch.first("BP")["mu"], atol=1e-12)
    assert abs(line["split"]).max() < 1e-12


# --- what is refused --------------------------------------------------------------------------


def changed(i: int, j: int, value: float):
    """The Jacobian with another entry."""

    def altered(u, p):
        matrix = bratu(second(30)).jacobian(u, p).tolil()
        matrix[i, j] = value
        return matrix

    return altered


def pattern_without(i: int, j: int) -> np.ndarray:
    pattern = second(30).toarray() != 0
    pattern[i, j] = False
    return pattern


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"jacobian": changed(7, 8, 1000.0)}, r"its entry \(7, 8\) is 1000, differences give 961"),
        (
            {"jacobian": changed(3, 3, np.nan)},
            r"^entry \(3, 3\) of the sparse Jacobian is nan at the start$",
        ),
        (
            {"jacobian": lambda u, p: csr_array((30, 29))},
            r"^the Jacobian is sparse and has shape \(30, 29\); \(30, 30\) was expected$",
        ),
        ({"jacobian": np.eye(3)}, r"pattern has shape \(3, 3\); \(30, 30\) was expected"),
        (
            {"jacobian": pattern_without(11, 12)},
            r"^the sparsity pattern does not fit the residual: it misses entry \(11, 12\)",
        ),
        (
            {"jacobian": pattern_without(1, 0)},
            r"^the sparsity pattern does not fit the residual: it misses entry \(1, 0\)",
        ),
    ],
)
def test_what_does_not_fit_a_large_problem_is_named(given, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        cb.trace(replace(bratu(second(30)), **given), "lam", within={"lam": (0, 1)})


def test_a_sparse_derivative_in_a_parameter_is_refused() -> None:
    column = knowing(
        bratu(second(30)), sensitivity=lambda u, p, name: coo_array(np.exp(u)[:, None])
    )
    words = r"a dense array of shape \(30,\) was expected: return its toarray\(\)$"
    with pytest.raises(BadInput, match=words):
        cb.trace(column, "lam", within={"lam": (0, 1)})


@pytest.mark.slow
def test_a_hopf_point_far_up_the_axis_is_seen_among_two_hundred_sparse_unknowns() -> None:
    """Oscillators ``z' = (mu + i w) z`` of w = 1, 2, ..., 100; all but the last one are damped."""
    m = 100
    own = np.arange(m) == m - 1
    turn = np.arange(1.0, m + 1)

    def jacobian(u, p):
        growth = diags_array(np.where(own, p["mu"], -1.0))
        return block_array([[growth, -diags_array(turn)], [diags_array(turn), growth]])

    problem = cb.Problem(
        lambda u, p: jacobian(u, p) @ u, {"u": np.zeros(2 * m)}, {"mu": -1.0}, jacobian=jacobian
    )
    branch = cb.trace(problem, "mu", within={"mu": (-1, 1)}, towards="up", events=[cb.hopf()])
    point = branch.first("HB")
    assert abs(point["mu"]) < 1e-9
    assert point["omega"] == pytest.approx(m, abs=1e-9)


@pytest.mark.parametrize("k", [3, 5, 8])
def test_pairs_are_known_where_a_real_eigenvalue_is_zero(k: int) -> None:
    """Beside 0 the others were lost in the rounding of the inverse: of three modes one had a pair
    twice, 7e-4 off, and by such HB had labels at branch points."""
    n, B = 140, 20.0
    zero = np.roots([DX * DY, A**2 * DX - DY * (B - 1), A**2])[-1]
    length = np.sqrt(mode(n, k) / zero)
    curve = Curve(brusselator(n, L=length, B=B), ("L",))
    rates = mode(n, np.arange(1, n + 1)) / length**2
    blocks = [[[B - 1 - DX * m, A**2], [-B, -(A**2) - DY * m]] for m in rates]
    exact = np.linalg.eigvals(blocks).ravel()
    found = eigenvalues(curve, curve.start).upper
    assert found.size
    assert abs(found[:, None] - exact).min(axis=1).max() < 1e-8


def test_there_are_no_pairs_where_other_units_make_the_derivative_symmetric() -> None:
    """As of a diffusion around an axis, u'' + u'/r, with no flux where that is."""
    n = 300
    r, faces = np.arange(n) + 0.5, np.arange(1.0, n)
    both = np.append(0.0, faces) + np.arange(1, n + 1)
    laplacian = diags_array(
        [faces / r[1:], -both / r, faces / r[:-1]], offsets=[-1, 0, 1], format="csc"
    )
    curve = Curve(bratu(laplacian), ("lam",))
    near = eigenvalues(curve, curve.start)
    assert (near.reach, near.values.size) == (np.inf, 0)


@pytest.mark.parametrize("n", [20, 130])
def test_a_derivative_that_is_not_finite_is_the_edge_of_the_domain_of_many_unknowns_too(n) -> None:
    def jacobian(x, p):
        edge = p["mu"] > 0.5
        return np.where(edge, np.nan, 1.0) * np.diag(2 * x)

    problem = cb.Problem(
        lambda x, p: x**2 - 1 - p["mu"], {"x": np.ones(n)}, {"mu": 0.0}, jacobian=jacobian
    )
    branch = cb.trace(problem, "mu", within={"mu": (0.0, 1.0)}, events=[cb.fold()])
    assert "not finite" in branch.reason
    assert branch[-1]["mu"] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("dense", [False, True])
def test_a_curve_of_branch_points_of_stiff_equations_sets_out(dense: bool) -> None:
    """A beam of 150 points on a foundation: P = l + k / l for l, the second eigenvalue of -D."""
    n, h = 150, 1 / 151
    bend = diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(n, n)) / h**2
    fourth = (bend @ bend).tocsr()

    def beam(w, p):
        return 1e-3 * (fourth @ w + p["P"] * (bend @ w) + p["k"] * (w - w**3))

    def jacobian(w, p):
        matrix = 1e-3 * (fourth + p["P"] * bend + diags_array(p["k"] * (1 - 3 * w**2)))
        return matrix.toarray() if dense else matrix

    problem = cb.Problem(
        beam, {"w": np.zeros(n)}, {"P": 5.0, "k": 500.0}, jacobian=jacobian, scales={"P": 50.0}
    )
    point = cb.trace(problem, "P", within={"P": (5, 55)}, events=[cb.branch_point()]).first("BP")
    line = cb.boundary(point, ("k", "P"), within={"k": (490, 510)})
    second = 4 / h**2 * np.sin(np.pi * h) ** 2
    np.testing.assert_allclose(line["P"], second + line["k"] / second, rtol=1e-8)
