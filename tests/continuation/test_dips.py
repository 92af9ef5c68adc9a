"""Several events of one kind within a step, which leave no change of sign."""

from __future__ import annotations

import numpy as np
import pytest

from contbreather.continuation import Branch, Event, Problem, Steps, branch_point, fold, hopf, trace
from contbreather.continuation.bifurcations.maps import EVENTS, FixedPoint

from .zoo import events_of, rotated, scalar

_, _, DOUBLING, ROTATION = EVENTS
UNIT = {"m": (-1.0, 1.0)}
GAPS = [0.05, 3e-3, 1e-5]
RATES = [1.0, -0.3]  # at which the second crosses, the first at 1


def rings(gap: float, rate: float) -> Problem:
    """Two Hopf points on one equilibrium, at m = 0 and m = gap."""

    def residual(u, p):
        one, other = p["m"], rate * (p["m"] - gap)
        return np.array(
            [one * u[0] - u[1], u[0] + one * u[1], other * u[2] - 2 * u[3], 2 * u[2] + other * u[3]]
        )

    return Problem(residual, dict.fromkeys("abcd", 0.0), {"m": -0.8})


def forks(gap: float, rate: float) -> Problem:
    """Two pitchforks on one equilibrium, at m = 0 and m = gap."""

    def residual(u, p):
        one, other = p["m"], rate * (p["m"] - gap)
        return np.array([u[0] * (one - u[0] ** 2), u[1] * (other - u[1] ** 2)])

    return Problem(residual, {"x": 0.0, "y": 0.0}, {"m": -0.8})


def kinds_and_places(branch: Branch) -> tuple[list[str], list[float]]:
    found = events_of(branch)
    return [point.kind for point in found], [point["m"] for point in found]


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("make", [rings, forks])
def test_two_close_bifurcations_are_both_found(make, gap: float, rate: float) -> None:
    for events in ([hopf(), branch_point()], [fold(), branch_point(), hopf()]):
        kinds, places = kinds_and_places(trace(make(gap, rate), "m", within=UNIT, events=events))
        assert kinds == ["HB" if make is rings else "BP"] * 2
        assert places == pytest.approx([0.0, gap], abs=1e-12)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(("make", "gap"), [(rings, 0.0), (forks, 0.0), (forks, 1e-9)])
def test_two_bifurcations_at_once_are_doubtful_with_the_reason(make, gap, rate: float) -> None:
    kind, event = ("HB", hopf()) if make is rings else ("BP", branch_point())
    branch = trace(make(gap, rate), "m", within=UNIT, events=[event])
    assert events_of(branch) == []
    (point,) = branch.doubtful
    assert point.kind == kind
    assert point["m"] == pytest.approx(0.0, abs=1e-6)
    assert "two" in point.detail["reason"]
    assert "at once" in point.detail["reason"]


def test_eigenvalues_that_cross_far_from_each_other_are_told_apart_by_their_count() -> None:
    """A Hopf point and two branch points in one step: each kind looks for its own."""

    def residual(u, p):
        m, x, y = p["m"], *u[2:]
        own = [m * u[0] - u[1], u[0] + m * u[1]]
        return np.array([*own, x * (m - 0.01 - x * x), y * (m - 0.02 - y * y)])

    problem = Problem(residual, dict.fromkeys("abxy", 0.0), {"m": -0.8})
    branch = trace(problem, "m", within=UNIT, events=[hopf(), branch_point()])
    kinds, places = kinds_and_places(branch)
    assert kinds == ["HB", "BP", "BP"]
    assert places == pytest.approx([0.0, 0.01, 0.02], abs=1e-12)
    assert not branch.doubtful


@pytest.mark.parametrize("gap", [1e-2, 1e-4])
def test_two_close_bifurcations_of_a_map_are_both_found(gap: float) -> None:
    def wheels(u, p):
        first, second = (1 + p["m"]) * u[:2], (1 + 3 * (p["m"] - gap)) * u[2:]
        return np.array([*rotated(first, 1.0), *rotated(second, 2.2)])

    def flips(u, p):
        return -np.array([(1 + p["m"]) * u[0], (1 + 3 * (p["m"] - gap)) * u[1]]) - u**3

    within = {"m": (-0.3, 0.3)}
    for map_, names, event in ((wheels, "abcd", ROTATION), (flips, "ab", DOUBLING)):
        start = dict.fromkeys(names, 0.0)
        problem = FixedPoint(map_, start, {"m": -0.21}, events=[event])
        branch = trace(problem, "m", within=within, steps=Steps(first=0.1))
        kinds, places = kinds_and_places(branch)
        assert kinds == [event.kind] * 2
        assert places == pytest.approx([0.0, gap], abs=1e-12)


def test_four_zeros_of_one_test_in_two_pairs_are_found() -> None:
    def test(point):
        return np.prod(point["m"] - np.array([0.5, 0.501, 0.54, 0.541]))

    line = scalar(lambda x, p: x - p["m"], 0.0, {"m": 0.0})
    branch = trace(line, "m", within=UNIT, events=[Event("ZZ", test)])
    _, places = kinds_and_places(branch)
    assert places == pytest.approx([0.5, 0.501, 0.54, 0.541], abs=1e-10)


@pytest.mark.parametrize(
    ("test", "low", "touches"),
    [
        # with a kink as sharp as that of the least of several values
        *((lambda m, lift=lift: abs(m - 0.3) + lift, -1.0, not lift) for lift in (0.0, 1e-4, 1e-2)),
        (lambda m: max(m - 0.3, 0.0) or 0.4, -1.0, False),  # jumps away from zero
        (lambda m: m or 1.0, 0.0, False),  # approaches it at the edge, where it has no meaning
    ],
)
def test_a_test_that_only_comes_close_to_zero_is_no_event(test, low, touches) -> None:
    line = scalar(lambda x, p: x - p["m"], 0.73, {"m": 0.73}, domain={"m": (low, 1.0)})
    branch = trace(line, "m", events=[Event("VV", lambda point: test(point["m"]))])
    assert branch[0]["m"] == low
    assert events_of(branch) == []
    reasons = [point.detail["reason"] for point in branch.doubtful]
    assert reasons == (["the test of VV touches zero: none, or two at once"] if touches else [])


def crossings(gap: float, kind: str) -> tuple[Problem, dict[str, tuple[float, float]]]:
    """Two branch points, `gap` apart: on an axis, mixed, and on an arm where one equation all but
    touches zero."""

    def residual(u, p):
        one = u[0] * (p["mu"] - 0.3 - u[0] ** 2)
        if kind == "arm":
            return np.array([one, u[1] * (u[0] - 0.4) * (u[0] - 0.4 - gap) - u[1] ** 3])
        other = u[1] * (p["mu"] - 0.3 - gap - u[1] ** 2)
        return np.array([one + 0.4 * other, other - 0.7 * one])

    if kind == "arm":
        return Problem(residual, {"u": np.sqrt(0.7), "v": 0.0}, {"mu": 1.0}), {"u": (0.01, 1.1)}
    return Problem(residual, {"u": 0.0, "v": 0.0}, {"mu": 0.0}), {"mu": (-0.2, 1.3)}


@pytest.mark.parametrize("gap", [1e-2, 2e-4, 1e-5])
@pytest.mark.parametrize("kind", ["axis", "arm"])
def test_two_close_branch_points_are_there_with_any_steps(kind: str, gap: float) -> None:
    """Steps that end exactly at the first of them are among these, and some of length 0.3."""
    problem, within = crossings(gap, kind)
    name = "u" if kind == "arm" else "mu"
    first = 0.4 if kind == "arm" else 0.3
    for size, largest in ((0.001, 0.05), (0.1, 0.1), (0.01, 0.37), (0.1, 0.37)):
        steps = Steps(first=size, largest=largest)
        events = [fold(), branch_point()]
        branch = trace(problem, "mu", within=within, events=events, steps=steps)
        assert [point.label for point in branch.special] == ["EP1", "BP1", "BP2", "EP2"]
        places = [branch.first(label)[name] for label in ("BP1", "BP2")]
        np.testing.assert_allclose(places, [first, first + gap], rtol=0, atol=1e-9)
        assert not branch.doubtful


def test_foci_that_are_neutral_together_are_no_hopf_point() -> None:
    """Two Brusselators that exchange both alike: what moves against each other decays faster by
    2 d, so that half-way between the Hopf points 2 and 2 + 4 d the one focus grows as the other
    decays: a sum of two eigenvalues vanishes, of no pair."""

    def two(x, p):
        (u, v), B = x.reshape(2, 2).T, p["B"]
        rates = [1 - (B + 1) * u + u * u * v, B * u - u * u * v]
        return np.array(
            [r + 0.1 * (w[::-1] - w) for r, w in zip(rates, (u, v), strict=True)]
        ).T.ravel()

    start = {"u1": 1.0, "v1": 1.5, "u2": 1.0, "v2": 1.5}
    problem = Problem(two, start=start, params={"B": 1.5})
    branch = trace(problem, "B", within={"B": (1.2, 3.5)}, events=[hopf()])
    assert np.allclose([at["B"] for at in branch.special if at.kind == "HB"], [2.0, 2.4])
    assert not branch.doubtful


@pytest.mark.parametrize(
    "saddles",
    [
        {-0.036: 0.5, 0.019: -1.0, -0.032: 1.0},
        {0.034: 1.0, -0.06: -1.0, 0.088: 1.0, -0.027: -1.0},
        {0.064: 1.0, -0.004: 0.5, -0.054: 0.5, 0.06: 1.0},
        {0.0047: 1.0, -0.0822: -1.0, 0.0964: -1.0},  # that at -0.08 is seen, and is no event
    ],
)
def test_a_hopf_point_is_found_once_among_neutral_saddles_of_the_same_step(saddles) -> None:
    """Where the sum of two real eigenvalues vanishes the test changes its sign, too."""
    places, rates = (np.array([*of]) for of in (saddles.keys(), saddles.values()))

    def flow(u, p):
        x, y, w = u[:3]
        pair = p["a"] * x - y, x + p["a"] * y
        return np.array([*pair, -w, *((1 + rates * (p["a"] - places)) * u[3:])])

    problem = Problem(flow, {"u": np.zeros(3 + places.size)}, {"a": -0.9})
    branch = trace(problem, "a", within={"a": (-0.9, 0.9)}, events=[hopf()])
    (point,) = (point for point in branch.special if point.kind == "HB")
    assert abs(point["a"]) < 1e-9
    assert not branch.doubtful


def test_a_zero_at_the_very_start_makes_no_dip_of_a_test_that_is_rounded_there() -> None:
    rounded = Event("LV", lambda point: point["m"] - 1e-15 if point["m"] > 0 else -1e-8)
    line = Problem(lambda x, p: x - p["m"], {"x": 0.0}, {"m": 0.0})
    branch = trace(line, "m", towards="up", within=UNIT, events=[rounded])
    assert ([point.kind for point in events_of(branch)], branch.doubtful) == (["LV"], ())


@pytest.mark.parametrize("start", np.linspace(0.02, 0.09, 8))
def test_two_folds_in_a_dip_that_the_cubic_of_a_step_does_not_show(start: float) -> None:
    """mu' = x ((x - 1/2)^2 - 0.003^2) on steps of 0.1, whose cubic is off by five times the dip."""

    def mu(x):
        return x**4 / 4 - x**3 / 3 + (0.25 - 9e-6) * x**2 / 2

    problem = Problem(lambda x, p: mu(x) - p["mu"], {"x": start}, {"mu": mu(start)})
    branch = trace(problem, "mu", within={"x": (0.01, 2.0)}, events=[fold()])
    folds = [point["x"] for point in branch.special if point.kind == "LP"]
    assert folds == pytest.approx([0.497, 0.503], abs=1e-6)


@pytest.mark.parametrize("start", -1 - np.arange(0.0, 0.1, 0.005))
def test_two_folds_next_to_the_end_of_a_step_are_found(start: float) -> None:
    """The vertex of a parabola through three places of the step is beyond that end."""

    def mu(x):
        return x**3 / 3 - 0.3 * np.sin(x) ** 4 + x**5 - 0.001**2 * x

    def residual(u, p):
        aside = u[1] - np.exp(2 * u[0])
        return np.array([p["mu"] - mu(u[0]) - 0.2 * aside, aside])

    problem = Problem(residual, {"x": start, "y": np.exp(2 * start)}, {"mu": mu(start)})
    branch = trace(problem, "mu", within={"x": (-2.0, 0.1)}, events=[fold()])
    folds = [point["x"] for point in branch.special if point.kind == "LP"]
    assert folds == pytest.approx([-0.001, 0.001], abs=1e-5)


@pytest.mark.parametrize("unit", [1e-200, 1.0, 1e200])
def test_two_close_zeros_of_a_test_are_found_in_any_unit_of_it(unit: float) -> None:
    """The square of a test may be beyond the largest float, its value not."""
    event = Event("DP", lambda point: unit * (point["m"] - 0.1) * (point["m"] - 0.103))
    line = Problem(lambda u, p: u - p["m"], {"x": -0.8}, {"m": -0.8})
    kinds, places = kinds_and_places(trace(line, "m", within=UNIT, events=[event]))
    assert kinds == ["DP", "DP"]
    assert places == pytest.approx([0.1, 0.103], abs=1e-12)
