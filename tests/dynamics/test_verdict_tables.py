"""Verdicts, multipliers and ranges at their thresholds: both sides of each, by given numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contbreather.dynamics import Kind, State, simulate, simulate_smooth, verdicts
from contbreather.dynamics.returning import PeriodicMotion
from contbreather.dynamics.verdicts import Rotation

ON = {"a": 0.2, "gamma": 0.05, "k": 0.8, "damping": 0.1}
REST = np.zeros(3), np.zeros(3)
RIGID = simulate(REST, periods=60, **ON)
SMOOTH = simulate_smooth(REST, periods=60, m=2, **ON)
RUNS = {"rigid": RIGID, "smooth": SMOOTH}


def motion(run: Any, matrix: Any, **given: Any) -> PeriodicMotion:
    own = {"t0": 0.0, "periods": 1, "symmetric": False, "residual": 1e-12, **given}
    return PeriodicMotion(State(*REST), matrix=np.diag(matrix), conditions=run.conditions, **own)


@pytest.mark.parametrize(("walls", "slack"), [("rigid", 1e-9), ("smooth", 1e-7)])
def test_a_multiplier_is_outside_by_more_than_rounding_or_integration_leaves(walls, slack) -> None:
    own = motion(RUNS[walls], [0.5, -(1 + 0.8 * slack), 1 + 1.2 * slack, -2.0, 0.0, 1.0])
    assert own.unstable == 2
    assert abs(own.multipliers).tolist() == sorted(abs(own.multipliers), reverse=True)
    assert (own.largest, own.half) == (2.0, None)
    assert own.growth == math.log(2.0) / (2 * math.pi)
    assert replace(own, periods=3).growth == math.log(2.0) / (6 * math.pi)
    half = replace(own, symmetric=True)
    assert half.half[0] == 2.0  # of -2: the sign of the half map
    assert half.multipliers[0] == half.largest == 4.0


# --- verdicts -----------------------------------------------------------------------------------

STEADY = Rotation(0.2345678, 1e-8, 0.5, 1e-6)


def opened(
    monkeypatch: Any, walls: str, turn: Rotation, values: Any, errors: Any, repelling: Any = None
) -> tuple[Kind, str, dict[str, float]]:
    run, evidence = RUNS[walls], dict[str, float]()
    monkeypatch.setattr(verdicts, "rotation", lambda *_: turn)
    monkeypatch.setattr(verdicts, "_exponents", lambda _: (np.array(values), np.array(errors)))
    return *verdicts._open(run, evidence, repelling), evidence


TORUS, CHAOS, OPEN = Kind.QUASI_PERIODIC, Kind.CHAOTIC, Kind.UNDECIDED


@pytest.mark.parametrize(
    ("turn", "value", "error", "rigid", "smooth"),
    [
        ({}, 0.0, 1e-8, TORUS, TORUS), ({}, -1e-2, 1e-5, OPEN, OPEN),
        ({"error": 1e-6}, 0.0, 1e-8, TORUS, TORUS), ({"error": 1.1e-6}, 0.0, 1e-8, OPEN, OPEN),
        ({"hole": 1e-3}, 0.0, 1e-8, TORUS, TORUS), ({"hole": 0.9e-3}, 0.0, 1e-8, OPEN, OPEN),
        ({"drift": 1e-4}, 0.0, 1e-8, TORUS, TORUS), ({"drift": 1.1e-4}, 0.0, 1e-8, OPEN, OPEN),
        ({}, 1.1e-3, 1e-5, CHAOS, CHAOS), ({}, 0.9e-3, 1e-5, OPEN, OPEN),
        ({}, 1e-2, 1.9e-3, CHAOS, CHAOS), ({}, 1e-2, 2.1e-3, OPEN, OPEN),
        ({}, 0.9e-6, 1e-9, TORUS, TORUS), ({}, -1.1e-6, 1e-9, OPEN, TORUS),
        ({}, 0.9e-5, 1e-9, OPEN, TORUS), ({}, 1.1e-5, 1e-9, OPEN, OPEN),
        ({}, 4.9e-5, 1e-5, TORUS, TORUS), ({}, 5.1e-5, 1e-5, OPEN, OPEN),
        ({}, 0.0, 1e-3, TORUS, TORUS), ({}, 0.0, 1.1e-3, OPEN, OPEN),
        ({"number": 0.25}, 0.0, 1e-6, TORUS, TORUS), ({"number": 0.25}, 0.0, 1.1e-6, OPEN, TORUS),
        ({"number": 0.25}, 0.0, 1.1e-5, OPEN, OPEN),
    ],
)  # fmt: skip
def test_an_open_motion_is_what_turns_and_exponents_say(
    monkeypatch, turn, value, error, rigid, smooth
) -> None:
    own = replace(STEADY, **turn)
    for walls, kind in (("rigid", rigid), ("smooth", smooth)):
        found, words, evidence = opened(monkeypatch, walls, own, [value, -1, -2], [error] * 3)
        assert found is kind, walls
        assert f"largest exponent {value:.2g} ({error:.0e})" in words
        assert ("rotation number" in words) is (kind is not CHAOS)
        unsteady = own.error > 1e-6 or own.hole < 1e-3 or own.drift > 1e-4
        assert ("the section's size changes by" in words) is unsteady
        alone = abs(value) < max(5 * error, 1e-6 if walls == "rigid" else 1e-5)
        alone = alone and error < (1e-6 if walls == "rigid" else 1e-5)
        assert evidence == {
            "rotation": own.number,
            "rotation_error": own.error,
            "exponent": value,
            "exponent_error": error,
            "frequencies": float(alone),
        }


# --- ranges -------------------------------------------------------------------------------------
