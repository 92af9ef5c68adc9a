"""Where boundaries meet other curves: one label a place, the right one, where it is known to be."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import contbreather as cb

Array = NDArray[np.float64]
Params = Mapping[str, float]
Field = Callable[[Array, Params], Sequence[Any]]
FLOW = (cb.fold(), cb.branch_point(), cb.hopf())
WINDOW = {"b1": (-1.0, 1.0), "b2": (-1.0, 1.0)}


def kinds(branch: cb.Branch) -> list[str]:
    return [point.kind for point in branch.special if point.kind != "EP"]


def flow(field: Field, start: Any, **params: float) -> cb.Problem:
    return cb.Problem(lambda u, p: np.array(field(u, p)), start, params, events=FLOW)


# --- Hopf curves that end where branches cross ------------------------------------------------


def symmetric_takens(u: Array, p: Params) -> list[Any]:
    x, y = u
    return [y, p["b1"] * x + p["b2"] * y - x**3 - x**2 * y]


def transcritical_takens(u: Array, p: Params) -> list[Any]:
    x, y = u
    return [y, p["b1"] * x + p["b2"] * y - x**2 - x * y]


@pytest.mark.parametrize("field", [symmetric_takens, transcritical_takens])
@pytest.mark.parametrize("events", [FLOW, FLOW[2:], ()], ids=["all", "HB", "none"])
@pytest.mark.parametrize("pair", [("b1", "b2"), ("b2", "b1")])
def test_a_hopf_curve_reaches_a_bt_where_branches_cross_and_ends_there(
    field: Field, events: tuple[cb.Event, ...], pair: tuple[str, str]
) -> None:
    mine = flow(field, {"x": 0.0, "y": 0.0}, b1=-0.5, b2=-0.5)
    point = cb.trace(mine, "b2", within=WINDOW, events=[cb.hopf()]).first("HB")
    curve = cb.boundary(point, pair, within=WINDOW, events=events)
    assert kinds(curve) == ["BT"]
    assert curve.doubtful == ()
    end = curve.first("BT")
    assert abs(end["b1"]) < 1e-9
    assert abs(end["b2"]) < 1e-9
    assert "branches cross here" in end.detail["degenerate"]
    assert curve["b1"].max() < 1e-9  # beyond are neutral saddles
    assert cb.continuation.Stop.EVENT in (curve.stop, curve.began)


def test_the_other_hopf_curve_of_a_symmetric_bt_ends_there_as_well() -> None:
    """On ``x^2 = b1`` it is ``b2 = b1``, with omega^2 = 2 b1: that only touches zero."""
    mine = flow(symmetric_takens, {"x": math.sqrt(0.5), "y": 0.0}, b1=0.5, b2=0.2)
    point = cb.trace(mine, "b2", within=WINDOW).first("HB")
    curve = cb.boundary(point, ("b1", "b2"), within=WINDOW)
    assert kinds(curve) == ["BT"]
    assert abs(curve["b1"] - curve["b2"]).max() < 1e-12
    assert curve["x"].min() > -1e-8  # not on to the mirror image
    assert curve.first("BT").detail["degenerate"]


def test_an_ordinary_bt_is_not_called_degenerate() -> None:
    mine = flow(
        lambda u, p: [u[1], p["b1"] + p["b2"] * u[0] + u[0] ** 2 + u[0] * u[1]],
        {"x": -0.5, "y": 0.0},
        b1=-0.05,
        b2=0.4,
    )
    point = cb.trace(mine, "b1", within=WINDOW).first("LP")
    end = cb.boundary(point, ("b2", "b1"), within=WINDOW).first("BT")
    hopf = cb.boundary(end, ("b2", "b1"), within=WINDOW)
    assert "BT" in kinds(hopf)
    for one in (end, hopf.first("BT")):
        assert "degenerate" not in one.detail
        assert (one.detail["a"], one.detail["b"]) == pytest.approx((1, 1), rel=1e-9)


def brusselator(N: int) -> cb.Problem:
    """A Brusselator between fixed ends on N + 1 grid points, as in COCO's tutorial: its first mode
    has a double zero eigenvalue at be = 4, de = 1/(4 N^2 sin^2(pi/2N))."""
    second = N**2 * (np.eye(N + 1, k=1) - 2 * np.eye(N + 1) + np.eye(N + 1, k=-1))
    ends = np.zeros(N + 1)
    ends[[0, -1]] = 1.0
    inside = 1 - ends

    def residual(u: Array, p: Params) -> Array:
        x, y = np.split(u, 2)
        first = p["de"] * second @ x + 1 - (p["be"] + 1) * x + x**2 * y
        other = p["de"] * second @ y + p["be"] * x - x**2 * y
        return np.concatenate(
            [inside * first + ends * (1 - x), inside * other + ends * (p["be"] - y)]
        )

    def jacobian(u: Array, p: Params) -> Array:
        x, y = np.split(u, 2)
        column = inside[:, None]
        diffusion = p["de"] * second
        return np.block(
            [
                [
                    column * (diffusion + np.diag(2 * x * y - p["be"] - 1)) - np.diag(ends),
                    column * np.diag(x**2),
                ],
                [
                    column * np.diag(p["be"] - 2 * x * y),
                    column * (diffusion - np.diag(x**2)) - np.diag(ends),
                ],
            ]
        )

    start = {"u": np.repeat([1.0, 3.0], N + 1)}
    return cb.Problem(residual, start, {"be": 3.0, "de": 0.075}, jacobian=jacobian, events=FLOW)


def test_the_hopf_curve_of_a_brusselator_ends_at_its_bt() -> None:
    N = 20
    branch = cb.trace(brusselator(N), "be", within={"be": (2.5, 4.5)}, events=FLOW[1:])
    window = {"de": (0.05, 0.2), "be": (2.0, 7.0)}
    curve = cb.boundary(branch.first("HB"), ("de", "be"), within=window)
    de = 1 / (4 * N**2 * math.sin(math.pi / 2 / N) ** 2)
    end = curve.first("BT")
    assert kinds(curve) == ["BT"]
    assert (end["de"], end["be"]) == pytest.approx((de, 4.0), abs=1e-9)
    assert end.detail["degenerate"]


def test_a_curve_of_neimark_sacker_points_ends_at_a_degenerate_r1() -> None:
    mine = cb.FixedPoint(
        lambda u, p: np.array(
            [u[0] + u[1], u[1] + p["b1"] * u[0] + p["b2"] * u[1] - u[0] ** 3 - u[0] ** 2 * u[1]]
        ),
        {"x": 0.0, "y": 0.0},
        {"b1": -0.5, "b2": -0.7},
    )
    point = cb.trace(mine, "b2", within={"b2": (-0.9, 0.3)}).first("NS")
    curve = cb.boundary(point, ("b1", "b2"), within=WINDOW)
    assert kinds(curve) == ["R1"]
    end = curve.first("R1")
    assert max(abs(end["b1"]), abs(end["b2"])) < 1e-9
    assert "branches cross here" in end.detail["degenerate"]
    assert abs(curve["b1"] - curve["b2"]).max() < 1e-12  # the determinant 1 + b2 - b1 is 1


def test_a_pair_that_only_touches_zero_is_no_end() -> None:
    """``+-i w`` with w through 0: a double zero with two eigenvectors is no BT."""
    mine = flow(
        lambda u, p: [
            p["m"] * u[0] - p["w"] * u[1] - u[0] * (u @ u),
            p["w"] * u[0] + p["m"] * u[1] - u[1] * (u @ u),
        ],
        {"x": 0.0, "y": 0.0},
        m=-0.5,
        w=-0.9,
    )
    point = cb.trace(mine, "m", within={"m": (-1, 1)}).first("HB")
    curve = cb.boundary(point, ("w", "m"), within={"w": (-1, 1)})
    assert kinds(curve) == []
    assert (curve["w"][0], curve["w"][-1]) == (-1.0, 1.0)


# --- boundaries that cross --------------------------------------------------------------------


def eaten(p2: float, *, coexisting: bool = False) -> cb.Problem:
    """Prey u and predators v; these die out where p2 (1 - 1/p1) = p3 = 0.1."""
    x = 0.1 / p2
    start = {"u": x, "v": (3 * (1 - x) - 1) / p2} if coexisting else {"u": 0.6, "v": 0.0}
    return cb.FixedPoint(
        lambda u, p: np.array(
            [
                p["p1"] * u[0] * (1 - u[0]) - p["p2"] * u[0] * u[1],
                (1 - p["p3"]) * u[1] + p["p2"] * u[0] * u[1],
            ]
        ),
        start,
        {"p1": 3.0 if coexisting else 2.5, "p2": p2, "p3": 0.1},
    )


PREY = {"p1": (0.5, 6.0), "p2": (0.06, 0.3)}


@pytest.mark.parametrize("p2", [0.1, 0.2])
@pytest.mark.parametrize("largest", [0.02, 0.1, 1.0])
def test_doublings_that_cross_have_one_label_that_names_both(p2: float, largest: float) -> None:
    point = cb.trace(eaten(p2), "p1", within={"p1": (1.5, 5)}).first("PD")
    curve = cb.boundary(point, ("p2", "p1"), within=PREY, steps=cb.Steps(largest=largest))
    assert kinds(curve) == ["PD-BP"]
    assert curve.doubtful == ()
    there = curve.first("PD-BP")
    assert (there["p2"], there["p1"]) == pytest.approx((0.15, 3.0), abs=1e-9)


def test_the_place_is_the_same_on_the_other_doubling_and_one_leads_to_the_other() -> None:
    point = cb.trace(eaten(0.2, coexisting=True), "p1", within={"p1": (2.1, 5)}).first("PD")
    curve = cb.boundary(point, ("p2", "p1"), within={"p1": (1.0, 6.0), "p2": (0.1, 0.3)})
    assert kinds(curve) == ["PD-BP"]
    assert abs(curve["u"] * curve["p2"] - 0.1).max() < 1e-12
    there = curve.first("PD-BP")
    assert (there["p2"], there["p1"]) == pytest.approx((0.15, 3.0), abs=1e-9)
    for arm in cb.switch(there, within=PREY):
        assert abs(arm["p1"] - 3).max() < 1e-9  # without predators
        assert abs(arm["v"]).max() < 1e-9


def turning_beside_a_pitchfork(u: Array, p: Params) -> list[Any]:
    """HB at m = 0 where x = 0, at m = -l where x^2 = l."""
    x, y, z = u
    growth = p["m"] + x**2 - y**2 - z**2
    return [x * (p["l"] - x**2), growth * y - z, y + growth * z]


@pytest.mark.parametrize("secondary", [False, True])
def test_hopf_curves_that_cross_at_a_pitchfork(secondary: bool) -> None:
    x = math.sqrt(0.5) if secondary else 0.0
    start = {"x": x, "y": 0.0, "z": 0.0}
    mine = flow(turning_beside_a_pitchfork, start, l=0.5 if secondary else -0.5, m=-0.9)
    point = cb.trace(mine, "m", within={"m": (-1, 1)}).first("HB")
    curve = cb.boundary(point, ("l", "m"), within={"l": (-1, 1), "m": (-1, 1)})
    assert kinds(curve) == ["HB-BP"]  # no ZH: the zero is no fold
    assert curve.doubtful == ()
    assert max(abs(curve.first("HB-BP")[name]) for name in "lm") < 1e-9


def test_a_fold_curve_that_meets_a_curve_of_branch_points() -> None:
    """``x (l + m x^2 - x^4)``: folds at l = -m^2/4 end at the quintic pitchfork l = m = 0."""
    mine = flow(lambda u, p: u * (p["l"] + p["m"] * u**2 - u**4), {"x": 1.1}, l=0.2541, m=1.0)
    point = cb.trace(mine, "l", within={"l": (-1, 1), "x": (0.2, 2)}).first("LP")
    curve = cb.boundary(point, ("m", "l"), within={"m": (-1, 1.5), "l": (-1, 1)})
    assert kinds(curve) == ["LP-BP"]
    assert abs(4 * curve["l"] + curve["m"] ** 2).max() < 1e-12


def test_two_doublings_of_one_cycle_are_no_branch_point() -> None:
    mine = cb.FixedPoint(
        lambda u, p: np.array(
            [-(1 + p["m"]) * u[0] + u[0] ** 3, -(1 + p["m"] + p["k"]) * u[1] + u[1] ** 3]
        ),
        {"x": 0.0, "y": 0.0},
        {"m": -0.5, "k": -0.3},
    )
    point = cb.trace(mine, "m", within={"m": (-0.9, 1)}).first("PD")
    curve = cb.boundary(point, ("k", "m"), within={"k": (-1, 1), "m": (-1, 1)})
    assert kinds(curve) == []
    assert any("do not cross" in point.detail["reason"] for point in curve.doubtful)


# --- branch points as curves ------------------------------------------------------------------


@pytest.mark.parametrize("pair", [("m", "l"), ("l", "m")])
def test_branch_points_that_persist_are_followed_in_either_plane(pair: tuple[str, str]) -> None:
    """``x = m^2`` meets ``x^2 = l - m^3 + y`` at ``l = m^3 + m^4 - y`` with y = m/(1 + x)."""

    def field(u: Array, p: Params) -> list[Any]:
        x, y = u
        m = p["m"]
        return [(x - m**2) * (p["l"] - m**3 - x**2 + y), y * (1 + x) - m]

    mine = flow(field, {"x": 0.04, "y": 0.2 / 1.04}, l=-1.5, m=0.2)
    point = cb.trace(mine, "l", within={"l": (-1.9, 1)}).first("BP")
    curve = cb.boundary(point, pair, within={"m": (-1, 1), "l": (-3, 3)})
    m = curve["m"]
    assert abs(curve["x"] - m**2).max() < 1e-11
    assert abs(curve["l"] - (m**3 + m**4 - m / (1 + m**2))).max() < 1e-11
    assert {m.min(), m.max()} == {-1.0, 1.0}
    assert abs(curve["split"]).max() < 1e-12


def test_a_line_of_transcritical_points_that_does_not_feel_one_parameter() -> None:
    mine = flow(lambda u, p: u * (p["l"] - u) + 0 * p["m"], {"x": 0.0}, l=-0.5, m=0.2)
    point = cb.trace(mine, "l", within={"l": (-1, 1)}).first("BP")
    for pair in (("m", "l"), ("l", "m")):
        curve = cb.boundary(point, pair, within={"m": (-1, 1), "l": (-1, 1)})
        assert abs(curve["l"]).max() < 1e-12
        assert np.ptp(curve["m"]) == 2.0


def test_where_predators_die_out_is_a_curve_that_meets_the_doubling() -> None:
    point = cb.trace(eaten(0.1), "p2", within={"p2": (0.06, 0.5)}).first("BP")
    curve = cb.boundary(point, ("p1", "p2"), within={"p1": (1.2, 6), "p2": (0.01, 1)})
    assert abs(curve["p2"] * (1 - 1 / curve["p1"]) - 0.1).max() < 1e-12
    assert kinds(curve) == ["BP-PD"]
    assert curve.first("BP-PD")["p1"] == pytest.approx(3.0, abs=1e-9)
    doubling = cb.boundary(curve.first("BP-PD"), ("p2", "p1"), within=PREY, events=())
    assert doubling.problem.label == "PD boundary"


def test_from_crossing_boundaries_the_curve_of_branch_points_is_followed() -> None:
    point = cb.trace(eaten(0.2), "p1", within={"p1": (1.5, 5)}).first("PD")
    crossing = cb.boundary(point, ("p2", "p1"), within=PREY).first("PD-BP")
    curve = cb.boundary(crossing, ("p2", "p1"), within=PREY, events=())
    assert curve.problem.label == "BP boundary"
    assert abs(curve["p2"] * (1 - 1 / curve["p1"]) - 0.1).max() < 1e-12


@pytest.mark.parametrize(
    ("field", "start", "kind"),
    [
        (symmetric_takens, {"x": 0.0, "y": 0.0}, "BT"),
        (turning_beside_a_pitchfork, {"x": 0.0, "y": 0.0, "z": 0.0}, "BP-HB"),
    ],
)
def test_what_a_curve_of_branch_points_meets_of_a_flow(field: Field, start: Any, kind: str) -> None:
    free, other = ("b1", "b2") if kind == "BT" else ("l", "m")
    mine = flow(field, start, **{free: -0.5, other: -0.5})
    point = cb.trace(mine, free, within={free: (-1, 1)}).first("BP")
    curve = cb.boundary(point, (other, free), within={other: (-1, 1)})
    assert kinds(curve) == [kind]
    assert max(abs(curve.first(kind)[name]) for name in (free, other)) < 1e-9
    assert abs(curve[free]).max() < 1e-12


@pytest.mark.parametrize(
    ("broken", "start"),
    [
        (lambda x, p: x * (p["l"] - x**2) + p["h"], 0.0),  # unfolded to first order
        (lambda x, p: x**2 - p["l"] ** 2 + p["h"] ** 2, 0.5),  # a cone, to second order
    ],
)
@pytest.mark.parametrize("pair", [("l", "h"), ("h", "l")])
def test_branch_points_that_another_parameter_breaks_are_refused(
    broken: Callable[[Array, Params], Array], start: float, pair: tuple[str, str]
) -> None:
    mine = cb.Problem(broken, {"x": start}, {"l": -0.5, "h": 0.0}, events=FLOW)
    point = cb.trace(mine, "l", within={"l": (-1, 1)}).first("BP")
    with pytest.raises(cb.BadInput, match="needs a third parameter"):
        cb.boundary(point, pair)


def test_branches_that_come_apart_slowly_are_no_curve_of_branch_points_either() -> None:
    mine = cb.Problem(
        lambda x, p: x * (p["l"] - x**2) + p["h"] ** 3, {"x": 0.0}, {"l": -0.5, "h": 0.0}
    )
    point = cb.trace(mine, "l", within={"l": (-1, 1)}, events=[cb.branch_point()]).first("BP")
    with pytest.raises(cb.NotConverged, match=r"come apart .* needs a third parameter"):
        cb.boundary(point, ("h", "l"))


def test_crossing_boundaries_and_curves_of_branch_points_go_on_from_a_file(tmp_path: Any) -> None:
    problem = eaten(0.2)
    point = cb.trace(problem, "p1", within={"p1": (1.5, 5)}).first("PD")
    curve = cb.boundary(point, ("p2", "p1"), within=PREY)
    cb.save(tmp_path / "pd.nc", curve)
    kept = cb.load(tmp_path / "pd.nc", problem=problem)
    assert kinds(kept) == ["PD-BP"]
    line = cb.boundary(kept.first("PD-BP"), ("p2", "p1"), within=PREY)
    cb.save(tmp_path / "bp.nc", line)
    again = cb.load(tmp_path / "bp.nc", problem=problem)
    assert kinds(again) == kinds(line) == ["BP-PD"]
    assert np.array_equal(again["p2"], line["p2"])


@pytest.mark.parametrize("c", [0.3, 0.5, 0.5001, 2.0])
def test_a_curve_of_branch_points_of_one_equation(c: float) -> None:
    """``m x + c x^2 - x^3``: at m = 0 for every c, where all of its derivative vanishes."""
    problem = cb.Problem(
        lambda x, p: np.array([p["m"] * x[0] + p["c"] * x[0] ** 2 - x[0] ** 3]),
        {"x": 0.0}, {"m": -1.0, "c": c},
    )  # fmt: skip
    branch = cb.trace(problem, "m", within={"m": (-2, 2)}, events=[cb.branch_point()])
    line = cb.boundary(branch.first("BP"), ("c", "m"), within={"c": (-3, 3)})
    assert abs(line["m"]).max() < 1e-12
    assert [line[0]["c"], line[-1]["c"]] == [-3.0, 3.0]
