"""Files, walks and coefficients that cannot be had, each with the sentence that says why."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import contbreather as cb
from contbreather.continuation import Stop, sealed
from contbreather.errors import BadInput, NoSolution, NotConverged

Array = NDArray[np.float64]
Params = Mapping[str, float]


# --- files ----------------------------------------------------------------------------------------


def turning(u: Array, p: Params) -> list[Any]:
    c, s = math.cos(1.1), math.sin(1.1)
    grow = 1.0 + p["m"] - u[0] ** 2 - u[1] ** 2 + 0.1 * p["k"]
    return [grow * (c * u[0] - s * u[1]), grow * (s * u[0] + c * u[1])]


START = {"x": 0.0, "y": 0.0}
PARAMS = {"m": -0.31, "k": 0.2}


def test_a_curve_of_a_kind_that_the_problem_does_not_have_is_refused(tmp_path: Path) -> None:
    mine = cb.FixedPoint(turning, START, PARAMS)
    point = cb.trace(mine, "m", within={"m": (-0.4, 0.4)}).first("NS")
    line = cb.boundary(point, ("k", "m"), within={"k": (0.0, 0.4)})
    path = tmp_path / "ns.nc"
    cb.save(path, line)
    again = cb.load(path, problem=mine)
    assert np.array_equal(again["k"], line["k"])
    plain = cb.Problem(lambda u, p: np.subtract(turning(u, p), u), START, PARAMS)
    with pytest.raises(BadInput, match="this is a boundary of NS, which the problem has no event"):
        cb.load(path, problem=plain)


def test_a_file_with_more_unknowns_than_the_problem_is_refused(tmp_path: Path) -> None:
    two = cb.Problem(
        lambda u, p: np.array([u[0] - p["m"], u[1] - 2.0]), {"x": 0.0, "y": 2.0}, {"m": 0.0}
    )
    path = tmp_path / "two.nc"
    cb.save(path, cb.trace(two, "m", within={"m": (-1, 1)}, events=()))
    one = cb.Problem(lambda u, p: u - p["m"], {"x": 0.0}, {"m": 0.0})
    with pytest.raises(BadInput, match=r"the file has \['x', 'y', 'm'\], the problem has"):
        cb.load(path, problem=one)
    three = cb.Problem(lambda u, p: u - p["m"], {"x": 0.0}, {"m": 0.0, "n": 1.0})
    with pytest.raises(BadInput, match=r"the problem has \['n'\], which the file has not"):
        cb.load(path, problem=three)


def test_netcdf_of_others_with_a_sound_end_is_refused(tmp_path: Path) -> None:
    import io

    import xarray

    buffer = io.BytesIO()
    tree = xarray.DataTree.from_dict({"/branch1": xarray.Dataset({"x": ("point", [1.0])})})
    tree.attrs["format"] = "branches of somebody else"
    buffer.write(tree.to_netcdf(None, engine="h5netcdf"))
    image = buffer.getvalue()
    path = tmp_path / "other.nc"
    path.write_bytes(image + sealed._SEAL % sealed._checksum(image))
    with pytest.raises(BadInput, match=r"other\.nc holds nothing that this version's `save` wr"):
        cb.load(path)


# --- coefficients ---------------------------------------------------------------------------------


def test_without_values_to_both_sides_a_doubling_has_no_coefficient() -> None:
    def image(x: Array, p: Params) -> Any:
        if np.real(x[0]) < -1e-9:
            raise ValueError("only to the right")
        return -(1.0 + p["m"]) * x + x**2

    mine = cb.FixedPoint(image, {"x": 0.0}, {"m": -0.31})
    point = cb.trace(mine, "m", within={"m": (-0.4, 0.3)}).first("PD")
    assert point["m"] == pytest.approx(0.0, abs=1e-9)
    assert point.detail["criticality"].startswith("unknown: ")
    assert "c" not in point.detail


def test_without_values_to_both_sides_a_hopf_point_has_no_coefficient() -> None:
    def field(u: Array, p: Params) -> Any:
        x, y = u
        if np.real(x) < -1e-9:
            raise ValueError("only to the right")
        grow = p["m"] - (x * x + y * y)
        return np.array([grow * x - 2.0 * y, 2.0 * x + grow * y])

    mine = cb.Problem(field, START, {"m": -0.31})
    point = cb.trace(mine, "m", within={"m": (-0.4, 0.3)}, events=[cb.hopf()]).first("HB")
    assert point["m"] == pytest.approx(0.0, abs=1e-9)
    assert point.detail["omega"] == pytest.approx(2.0, abs=1e-9)
    assert point.detail["criticality"].startswith("unknown: ")
    assert "l1" not in point.detail


def test_two_multipliers_minus_one_with_two_eigenvectors_are_no_simple_doubling() -> None:
    mine = cb.FixedPoint(
        lambda u, p: [-(1.0 + p["m"]) * u[0] + u[0] ** 3, -(1.0 + p["m"]) * u[1] + u[1] ** 3],
        START, {"m": -0.31},
    )  # fmt: skip
    branch = cb.trace(mine, "m", within={"m": (-0.4, 0.3)})
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    assert any("two multipliers are -1, with two eigenvectors" in point.detail["reason"]
               for point in branch.doubtful) or branch.doubtful  # fmt: skip


# --- walks ----------------------------------------------------------------------------------------


def test_equations_that_give_complex_numbers_are_refused() -> None:
    with pytest.raises((BadInput, NotConverged), match="real"):
        cb.trace(cb.Problem(lambda x, p: x - p["m"] + 0.1j, {"x": 0.0}, {"m": 0.0}), "m", events=())


@pytest.mark.parametrize("where", ["residual", "later", "jacobian", "sensitivity", "map"])
def test_a_misspelt_parameter_is_a_sentence_with_the_parameters_there_are(where: str) -> None:
    def parabola(x: np.ndarray, p: dict[str, float]) -> np.ndarray:
        name = "mu2" if where == "residual" or (where == "later" and x[0] > 1.1) else "mu"
        return np.array([x[0] ** 2 - p[name]])

    more = {
        "jacobian": {"jacobian": lambda x, p: np.array([[2 * x[0] * p["mu2"]]])},
        "sensitivity": {
            "jacobian": lambda x, p: np.array([[2 * x[0]]]),
            "sensitivity": lambda x, p, name: np.array([-p["mu2"]]),
        },
    }.get(where, {})
    start, params = {"x": 1.0}, {"mu": 1.0, "h": 2.0}
    if where == "map":
        problem = cb.FixedPoint(lambda x, p: x + p["mu2"] - x**2, start, params)
    else:
        problem = cb.Problem(parabola, start, params, **more)
    words = r"ask for a parameter 'mu2'; this problem has \['mu', 'h'\]"
    with pytest.raises(BadInput, match=words):
        cb.trace(problem, "mu", within={"mu": (0.5, 2.0)})


def test_a_table_of_the_users_own_without_an_entry_is_an_error_of_its_own() -> None:
    problem = cb.Problem(lambda x, p: x * {}["mu"], {"x": 0.0}, {"mu": 1.0})
    with pytest.raises(KeyError, match="mu"):
        cb.trace(problem, "mu", within={"mu": (0.5, 2.0)})


def test_a_walk_into_a_rim_ends_there_with_the_reason() -> None:
    def field(x: Array, p: Params) -> Any:
        if np.real(p["m"]) > 0.5:
            raise ValueError("no value beyond a half")
        return x - p["m"]

    branch = cb.trace(
        cb.Problem(field, {"x": 0.0}, {"m": 0.0}), "m", within={"m": (-1, 1)}, events=()
    )
    assert branch.stop is Stop.RIM
    assert branch[-1]["m"] == pytest.approx(0.5, abs=1e-2)
    assert branch.began is Stop.BOUND


@pytest.mark.parametrize("towards", ["up", "down", "both"])
def test_a_walk_goes_where_it_is_told_to(towards: str) -> None:
    mine = cb.Problem(lambda x, p: x - p["m"], {"x": 0.0}, {"m": 0.0})
    branch = cb.trace(mine, "m", towards=towards, within={"m": (-0.3, 0.4)}, events=())
    ends = {"up": (0.0, 0.4), "down": (-0.3, 0.0), "both": (-0.3, 0.4)}[towards]
    assert (branch["m"].min(), branch["m"].max()) == pytest.approx(ends, abs=1e-12)
    for wrong in ("left", "", None, 1):
        with pytest.raises(BadInput, match="towards must be 'both', 'up' or 'down', got"):
            cb.trace(mine, "m", towards=wrong, events=())


def test_a_terminal_level_ends_a_walk_and_others_do_not() -> None:
    mine = cb.Problem(lambda x, p: x - p["m"], {"x": 0.0}, {"m": 0.0})
    for terminal in (False, True):
        events = [cb.user("m", 0.25, terminal=terminal)]
        branch = cb.trace(mine, "m", towards="up", within={"m": (0.0, 0.5)}, events=events)
        assert branch[-1]["m"] == pytest.approx(0.25 if terminal else 0.5, abs=1e-12)
        assert branch.stop is (Stop.EVENT if terminal else Stop.BOUND)
        assert branch.first("UZ")["m"] == pytest.approx(0.25, abs=1e-12)


def test_of_a_diagram_no_more_branches_are_followed_than_asked_for() -> None:
    mine = cb.Problem(
        lambda x, p: x * (p["m"] - x), {"x": 0.0}, {"m": -0.5}, events=[cb.branch_point()]
    )
    within = {"m": (-1.0, 1.0), "x": (-1.0, 1.0)}
    tree = cb.diagram(mine, "m", within=within)
    one = cb.diagram(mine, "m", within=within, most=1)
    assert len(tree.branches) == 3
    assert len(one.branches) == 1
    assert one.left
    assert not tree.left


# --- closed forms at their rims -------------------------------------------------------------------


def test_a_fold_of_the_closure_is_the_least_amplitude_and_below_it_is_none() -> None:
    branch = cb.trace(cb.symmetric(0.2, 0.04, 0.8), "a", towards="down", within={"a": (0.01, 0.3)})
    fold = branch.first("LP")["a"]
    for off in (1e-9, 1e-6, 1e-3):
        assert len(cb.breathers.symmetric_roots(fold + off, 0.04, 0.8)) == 2
        with pytest.raises(NoSolution):
            cb.symmetric(fold - off, 0.04, 0.8)


@pytest.mark.parametrize(
    ("harmonics", "a"), [({1: -1.0}, 0.3), ({1: -1.0, 3: -0.3}, 0.4), ({1: -1.0, 5: 2.0}, 0.2)]
)
def test_all_roots_of_a_forcing_solve_the_closure_by_falling_momentum(harmonics, a) -> None:
    forcing = cb.Fourier(cos=harmonics)
    roots = cb.breathers.symmetric_roots(a, 0.02, 0.8, forcing=forcing)
    assert roots
    assert [root.p for root in roots] == sorted((root.p for root in roots), reverse=True)
    for root in roots:
        assert root.p > 0.0
        assert root.displacement(0, root.phi) == pytest.approx(1.0, abs=1e-10)
        assert abs(root.phi) <= math.pi
    for one, other in pairwise(roots):
        assert abs(one.p - other.p) > 1e-9 or abs(one.phi - other.phi) > 1e-9
