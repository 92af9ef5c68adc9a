"""Where a curve runs to infinity it ends with a sentence, unless a window says how far to go."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from contbreather.continuation import Branch, Problem, Steps, Stop, boundary, fold, trace, user

from .zoo import chebyshev, ignition

FALLS = {"exponential": lambda x: np.exp(-x), "power": lambda x: (1 + x * x) ** -3}


def far(values: Callable[[Any], Any], unit: float = 1.0, **more: Any) -> Branch:
    """mu = f(x) from x = 0 on, for some hundred steps."""
    problem = Problem(
        lambda x, p: p["mu"] - unit * values(x / unit), {"x": 0.0}, {"mu": unit * values(0.0)}
    )
    along = np.array([1.0, (values(1e-6) - values(-1e-6)) / 2e-6])
    return trace(problem, "mu", along=along, **{"events": (), "steps": Steps(most=600), **more})


@pytest.mark.slow
def test_a_curve_of_folds_ends_where_a_parameter_vanishes() -> None:
    """u grows as eps^-2 and lam falls as exp(-1/eps): eps alone would go on for ever."""
    bratu = ignition(chebyshev(7))
    branch = trace(bratu, "lam", towards="up", within={"u": (0.0, 4.0)}, events=[fold()])
    line = boundary(branch.first("LP"), ("eps", "lam"), towards="up", events=())
    assert line.stop is Stop.INFINITY
    assert line.reason.startswith("u grows without bound while lam vanishes, ")
    assert 0 < line[-1]["lam"] < 1e-6 * line["lam"].max()
    assert line[-1]["eps"] > 0.03


@pytest.mark.parametrize("unit", [1.0, 1e6])
@pytest.mark.parametrize("fall", FALLS)
def test_a_curve_ends_where_its_parameter_vanishes_in_any_unit(fall: str, unit: float) -> None:
    branch = far(FALLS[fall], unit)
    assert branch.stop is Stop.INFINITY
    assert branch.reason.startswith("x grows without bound while mu vanishes, ")
    assert branch[-1]["mu"] < 1e-6 * unit


@pytest.mark.parametrize("unit", [1e-6, 1e6])
@pytest.mark.parametrize(
    "values",
    [
        lambda x: 1 - x / 20,
        lambda x: (1 - x / 20) ** 2,  # touches zero
        lambda x: np.exp(-x * x) + 1e-4 * (1 - x / 20),  # is small for long before
    ],
)
def test_what_passes_zero_does_not_end_a_curve(values: Callable[[Any], Any], unit: float) -> None:
    branch = far(values, unit, within={"mu": (-0.5 * unit, 2 * unit)})
    assert branch[-1]["x"] > 25 * unit


def test_what_tends_to_another_limit_than_zero_is_not_said_to_vanish() -> None:
    branch = far(lambda x: 1e-4 + np.exp(-x))
    assert branch.stop is Stop.INFINITY
    assert branch.reason == "x grows without bound while mu tends to 0.0001"


@pytest.mark.slow
def test_a_window_says_how_far_to_go_instead() -> None:
    assert far(FALLS["exponential"], within={"x": (0.0, 60.0)})[-1]["x"] == 60.0
    for fall in FALLS.values():
        assert far(fall, within={"mu": (1e-12, 2.0)})[-1]["mu"] == 1e-12
    for window in ({"x": (0.0, np.inf)}, {"mu": (0.0, 2.0)}):  # neither does
        assert far(FALLS["exponential"], within=window).stop is Stop.INFINITY
    square = Problem(lambda x, p: x - p["mu"] ** 2, {"x": 0.0}, {"mu": 0.0})
    assert trace(square, "mu", within={"mu": (0, 300)})[-1]["x"] == pytest.approx(9e4)


@pytest.mark.parametrize("limit", [0.0, 1.0])
def test_a_window_of_what_grows_less_than_something_else_ends_a_curve_too(limit: float) -> None:
    def residual(x: Any, p: Any) -> Any:
        return np.array([p["mu"] - limit - np.exp(-x[0]), x[1] - 2 * x[0]])

    both = Problem(residual, {"x": 0.0, "y": 0.0}, {"mu": limit + 1.0})
    go: dict[str, Any] = {"free": "mu", "towards": "down", "events": ()}
    assert trace(both, **go, within={"x": (0, 60)})[-1]["x"] == 60.0
    assert trace(both, **go, within={"x": (-60, np.inf)}).stop is Stop.INFINITY


def test_where_it_ends_does_not_depend_on_how_many_steps_are_looked_at_at_once() -> None:
    plain = far(FALLS["exponential"])
    seen = far(FALLS["exponential"], events=[user("x", 1e3)])
    assert (plain.stop, plain.reason, len(plain)) == (seen.stop, seen.reason, len(seen))


class Long(Problem):
    """A sum of unknowns that no user knows, as the period of several flows."""

    internals = property(lambda self: frozenset({"durations"}))
    totals = property(lambda self: {"period": "durations"})


def test_where_the_parameter_has_its_window_a_period_that_grows_is_given_one() -> None:
    """No window was named."""
    long = Long(lambda x, p: x * p["mu"] - 1, {"durations": np.ones(2)}, {"mu": 1.0})
    go: dict[str, Any] = {"towards": "down", "steps": Steps(most=60, largest=100.0)}
    wanted = "period grows, and no window ends it; give one, within={'period': (low, high)}"
    assert trace(long, "mu", within={"mu": (1e-9, 2)}, **go).reason == wanted
    assert trace(long, "mu", within={"mu": (1e-9, 2), "period": (0, 10)}, **go).reason == ""


def test_a_curve_along_which_a_parameter_grows_says_what_would_end_it() -> None:
    line = Problem(lambda x, p: x - 1 / (1 + p["mu"] ** 2), {"x": 1.0}, {"mu": 0.0})
    branch = trace(line, "mu", towards="up", steps=Steps(most=150))
    assert branch.stop is Stop.MOST
    assert branch.reason == "mu grows, and no window ends it; give one, within={'mu': (low, high)}"
    for more in ({"steps": Steps(most=20)}, {"within": {"mu": (-1, 30)}, "steps": Steps(most=150)}):
        assert trace(line, "mu", towards="up", **more).reason == ""
