"""What rounding must not decide: equations mixed at random round otherwise each time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Branch, Problem
from contbreather.continuation.algebra import walk_kernel
from contbreather.continuation.algebra.newton import newton
from contbreather.continuation.curve.curve import Curve

from .zoo import TRANSCRITICAL

SEEDS = range(6)
Equations = Callable[[Any, Mapping[str, float]], list[Any]]


def mixed(equations: Equations, start: Mapping[str, float], seed: int, **domain: Any) -> Problem:
    """The same solutions, of combinations of the equations: nothing but rounding differs."""
    weights = np.random.default_rng(seed).normal(size=(len(start), len(start)))
    return Problem(
        lambda x, p: weights @ np.array(equations(x, p)),
        start,
        {"mu": 0.0, "nu": 0.0},
        domain=domain,
    )


def parabola(x: Any, p: Mapping[str, float]) -> list[Any]:
    """mu = x^2, and two unknowns that follow."""
    return [x[0] ** 2 - p["mu"], x[1] - 0.3 * x[0] - p["nu"], x[2] + 0.7 * x[0] * x[1]]


def first_step(problem: Problem, towards: str, **more: Any) -> Branch:
    return cb.trace(problem, "mu", towards=towards, events=(), steps=cb.Steps(most=2), **more)


START = {"x": 0.0, "y": 0.0, "z": 0.0}


@pytest.mark.parametrize(
    ("domain", "window", "towards", "side"),
    [
        ({}, {}, "up", 1.0),  # the leading unknown grows
        ({}, {}, "down", -1.0),
        ({"x": (0.0, 9.0)}, {}, "up", 1.0),
        ({"x": (-9.0, 0.0)}, {}, "up", -1.0),
        ({"mu": (0.0, 9.0)}, {}, "up", 1.0),  # the curve touches the end of this domain
        ({}, {"x": (-0.5, 0.0)}, "up", -1.0),
    ],
)
def test_where_a_walk_sets_out_at_a_fold(domain, window, towards: str, side: float) -> None:
    for seed in SEEDS:
        branch = first_step(mixed(parabola, START, seed, **domain), towards, within=window)
        assert len(branch) == 3, (seed, branch.stop, branch.reason)
        assert side * branch[1]["x"] > 0, seed
        assert branch[1]["mu"] == pytest.approx(branch[1]["x"] ** 2)


@pytest.mark.slow
def test_a_step_that_rounding_leaves_to_the_edge_of_a_window_is_made() -> None:
    """Of a map of angles: sin(pi) is 1e-16, and steps of 0.01 end 1e-13 short of K = 6."""

    def rotors(u: Any, p: Any) -> Any:
        q, w = u[:2], u[2:] + p["K"] * np.array([0.65, 0.36]) * np.sin(u[:2])
        w = w + 0.85 * np.sin(u[0] + u[1])
        return np.concatenate([q + w, w])

    fixed = cb.FixedPoint(rotors, {"q": np.pi, "r": 0.0, "v": 0.0, "w": 0.0}, {"K": 4.5})
    for largest in (0.01, 0.1 * 0.1):
        branch = cb.trace(fixed, "K", within={"K": (4, 6)}, steps=cb.Steps(largest=largest))
        assert [branch[0].kind, branch[-1].kind] == ["EP", "EP"]


def test_a_step_that_ends_next_to_the_edge_of_a_window_ends_on_it() -> None:
    """What would be left is so short that rounding, of large terms here, decides where it leads."""

    def rounded(x: Any, p: Any) -> Any:
        return np.array([x[0] - 0.3 * p["mu"] + 1e-12 * np.sin(1e15 * x[0]), x[1] - x[0] ** 2])

    line = Problem(rounded, {"x": 0.0, "y": 0.0}, {"mu": 0.0})
    edge = cb.trace(line, "mu", towards="up", steps=cb.Steps(most=3))[2]["mu"] + 1e-11
    assert cb.trace(line, "mu", towards="up", within={"mu": (0, edge)})[-1].kind == "EP"


@pytest.mark.parametrize("edge", [0.0, 1.0])
def test_a_curve_along_the_edge_of_a_domain_stays_on_it(edge: float) -> None:
    """y = edge all along, but for rounding, which must end nothing and leave nothing outside."""

    def along(x: Any, p: Mapping[str, float]) -> list[Any]:
        return [
            x[0] - 0.3 * p["mu"],
            x[1] - edge + 0.1 * (x[0] - 0.3 * p["mu"]),
            x[2] - x[0] * x[1],
        ]

    for seed in SEEDS:
        problem = mixed(along, {"x": 0.0, "y": edge, "z": 0.0}, seed, y=(edge, 9.0))
        branch = cb.trace(problem, "mu", within={"mu": (0.0, 2.0)}, events=())
        assert branch[-1]["mu"] == 2.0, (seed, branch.stop, branch.reason)
        assert (branch["y"] >= edge).all()


def crossed(x: Any, p: Mapping[str, float]) -> list[Any]:
    """Two branches, x = mu and x = -mu, as steep as each other."""
    return [(x[0] - p["mu"]) * (x[0] + p["mu"]) + p["nu"], x[1] - 0.3 * x[0], x[2] + x[0] - x[1]]


@pytest.mark.parametrize("towards", ["up", "down"])
def test_which_of_two_branches_is_followed_from_where_they_cross(towards: str) -> None:
    ways = [first_step(mixed(crossed, START, seed), towards)[1]["x"] for seed in SEEDS]
    assert len(set(np.sign(ways))) == 1


@pytest.mark.slow
def test_in_which_order_branches_leave_a_branch_point() -> None:
    orders = set()
    for seed in SEEDS:
        problem = mixed(crossed, {"x": -0.4, "y": -0.12, "z": 0.28}, seed).at(mu=-0.4)
        events = [cb.branch_point(), cb.fold()]
        branch = cb.trace(problem, "mu", within={"mu": (-0.4, 0.4)}, events=events)
        assert [point.kind for point in branch.special] == ["EP", "BP", "EP"]
        arms = cb.switch(branch.first("BP"), within={"mu": (-0.4, 0.4)})
        orders.add(tuple(tuple(np.sign([arm[-1]["x"], arm[-1]["mu"]])) for arm in arms))
    assert len(orders) == 1


@pytest.mark.slow
def test_null_vectors_on_a_curve_of_folds_have_one_sign() -> None:
    signs = set()
    for seed in SEEDS:
        problem = mixed(parabola, START | {"x": 0.5, "y": 0.15, "z": -0.0525}, seed).at(mu=0.25)
        fold = cb.trace(problem, "mu", within={"x": (-1, 1)}, events=[cb.fold()]).first("LP")
        line = cb.boundary(fold, ("nu", "mu"), within={"nu": (-1, 1)}, events=())
        assert [point.kind for point in line.special] == ["EP", "EP"]
        signs.add(tuple(np.sign(line[len(line) // 2]["null"][:2])))
    assert len(signs) == 1


@pytest.mark.parametrize("off", [9.62964972e-35, -3e-35, 1e-30, 1e-20])
def test_a_branch_point_at_the_start_is_not_doubtful_as_well(off: float) -> None:
    """As it was where Newton's method had left the start beside it, by no more than rounding."""
    for largest in (0.04, 0.06, 0.08, 0.1):
        start = TRANSCRITICAL.problem.at(x=off, mu=0.0)
        within, steps = TRANSCRITICAL.within, cb.Steps(largest=largest)
        branch = cb.trace(start, "mu", within=within, events=TRANSCRITICAL.events, steps=steps)
        assert [point.kind for point in branch.special].count("BP") == 1
        assert branch.doubtful == ()


# --- stiff equations and fine meshes --------------------------------------------------------------


def mixture(seed: int, condition: float) -> tuple[cb.Problem, np.ndarray]:
    """``A (y (mu - m) - y^3) = 0`` for y = B x, with rotations B and A of a given condition: branch
    points at every m on x = 0, and on the arm of one of them at all the higher ones."""
    rng = np.random.default_rng(seed)
    n = 12
    one, other, B = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(3))
    A = one @ np.diag(np.logspace(0, math.log10(condition), n)) @ other
    m = np.sort(rng.uniform(0.1, 1.4, n))

    def residual(x, p):
        y = B @ x
        return A @ (y * (p["mu"] - m) - y**3)

    def jacobian(x, p):
        return A @ np.diag(p["mu"] - m - 3 * (B @ x) ** 2) @ B

    return cb.Problem(residual, {"x": np.zeros(n)}, {"mu": 0.0}, jacobian=jacobian), m


def places(branch: cb.Branch) -> np.ndarray:
    assert not branch.doubtful
    return np.sort([point["mu"] for point in branch.special if point.kind == "BP"])


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "condition"), [(0, 1e6), (1, 1.0), (1, 1e6)])
def test_all_branch_points_of_a_mixture_are_found(seed: int, condition: float) -> None:
    """The closest two are 0.0038 and 0.00073 apart, far less than a step."""
    problem, m = mixture(seed, condition)
    options = {"within": {"mu": (0.0, 1.5)}, "events": [cb.branch_point()]}
    branch = cb.trace(problem, "mu", **options)
    np.testing.assert_allclose(places(branch), m, rtol=0, atol=1e-9)
    for arm in cb.switch(branch.first("BP6"), **options):
        assert arm.stop is cb.continuation.Stop.BOUND
        np.testing.assert_allclose(places(arm), m[6:], rtol=0, atol=1e-9)


def swift_hohenberg(n: int, nu: float = 2.0) -> tuple[cb.Problem, np.ndarray]:
    """``mu u + nu u^2 - u^3 - (1 + d^2/dx^2)^2 u`` on n places of (0, 3 pi) with free ends, and
    where u = 0 bifurcates, from the modes of the mesh."""
    h = 3 * math.pi / (n - 1)
    D = (np.diag(np.full(n, -2.0)) + np.eye(n, k=1) + np.eye(n, k=-1)) / h**2
    D[0, 1] = D[-1, -2] = 2 / h**2
    K = (np.eye(n) + D) @ (np.eye(n) + D)

    def residual(u, p):
        return p["mu"] * u + nu * u**2 - u**3 - K @ u

    def jacobian(u, p):
        return np.diag(p["mu"] + 2 * nu * u - 3 * u**2) - K

    laplacian = -((2 / h * np.sin(np.arange(n) * math.pi / (2 * n - 2))) ** 2)
    problem = cb.Problem(residual, {"u": np.zeros(n)}, {"mu": -0.1}, jacobian=jacobian)
    return problem, np.sort((1 + laplacian) ** 2)


@pytest.mark.slow
def test_a_fine_mesh_finds_what_a_coarse_one_does_and_walks_back_through_the_pitchfork() -> None:
    found = []
    events = [cb.fold(), cb.branch_point()]
    for n in (50, 120):
        problem, modes = swift_hohenberg(n)
        axis = cb.trace(problem, "mu", within={"mu": (-0.1, 0.1)}, events=[cb.branch_point()])
        arm = cb.switch(axis.first("BP"), within={"mu": (-0.6, 0.1)}, events=events)[0]
        assert arm.stop is cb.continuation.Stop.BOUND
        found.append([(point.kind, point["mu"]) for point in arm.special])
        back = cb.trace(arm[12], "mu", within={"mu": (-0.3, 0.1)}, events=events)
        assert {back.began, back.stop} == {cb.continuation.Stop.BOUND}
        nearest = min(back.special, key=lambda point: np.abs(point["u"]).max())
        assert nearest.kind == "BP"
        assert abs(nearest["mu"] - modes[0]) < 1e-8
    (kinds, values), (fine_kinds, fine_values) = (zip(*one, strict=True) for one in found)
    assert kinds == fine_kinds == ("EP", "BP", "BP", "LP", "EP")
    np.testing.assert_allclose(values, fine_values, rtol=0, atol=3e-3)  # of the meshes


def test_corrections_that_repeat_themselves_divide_by_nothing() -> None:
    """Where a quarter of the last digit is left of an equation, no correction moves it, and each is
    the one before: by Broyden's update the next is without bound."""
    far = Problem(lambda x, p: [x[0] - 1e8 - math.sin(p["p"])], {"x": 1e8}, {"p": 0.0})
    curve, at_p = Curve(far, ("p",)), np.array([0.0, 1.0])
    tangent, _ = curve.tangent_at(curve.start, at_p)
    for size in np.linspace(0.1, 0.5, 40):
        guess = curve.start + size * tangent
        with np.errstate(all="raise"):
            solved = curve.solved_near(curve.start, guess, at_p, 1e-25)
        assert solved.residual <= np.spacing(1e8)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e6, 1e9, 1e12])
def test_a_large_parameter_without_scales_makes_no_points_that_are_no_solutions(
    size: float,
) -> None:
    """x^2 = E / size - 1: corrections of x are short beside E wherever they end."""
    problem = cb.Problem(lambda x, p: x**2 - p["E"] / size + 1, {"x": 1.0}, {"E": 2 * size})
    branch = cb.trace(problem, "E", within={"E": (0, 5 * size)}, events=[cb.fold()])
    assert abs(branch["x"] ** 2 - branch["E"] / size + 1).max() < 1e-11
    assert branch["E"].min() == pytest.approx(size, rel=1e-11)  # up to the fold


def test_steps_in_machine_code_leave_such_corrections_to_be_looked_at(monkeypatch) -> None:
    """x^2 = 0.97 - 1 across E, which is a billion."""

    def residual(z, data, out):
        out[0] = z[0] ** 2 - z[1] / 1e9 + 1.0
        return 0

    def jacobian(z, data, out):
        out[:2] = 2.0 * z[0], -1e-9
        return 0

    monkeypatch.setattr(walk_kernel, "residual", residual)
    monkeypatch.setattr(walk_kernel, "jacobian", jacobian)
    pieces = walk_kernel.Pieces(None, None, walk_kernel.at_a_place(1e-9, np.ones(2)))
    pieces.room.end[:], pieces.room.tangent[:] = (0.3, 0.97e9), (0.0, 1.0)
    status, _, _ = walk_kernel.newton_steps(None, pieces.rules, pieces.room)
    assert status == walk_kernel.LOOK


def test_corrections_that_are_slow_beside_a_large_parameter_go_on() -> None:
    """x^3 = 8 from 40: at first each correction is 2/3 of the one before."""
    curve = Curve(cb.Problem(lambda x, p: x**3 - p["E"] / 1e9, {"x": 40.0}, {"E": 8e9}), ("E",))
    solution = newton(curve, curve.start, np.array([0.0, 1.0]))
    assert solution.converged
    assert solution.z[0] == pytest.approx(2.0, rel=1e-14)
