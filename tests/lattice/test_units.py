"""What is measured, and the numbers that are made of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import contbreather as cb

RNG = np.random.default_rng(7)
SITES, K = 4, 0.8
# kg, N/m, m, Hz, N s/m, N
EVEN: dict[str, Any] = {"mass": 0.025, "stiffness": 4.0, "gap": 1e-3, "frequency": 12.0,
                        "ground": 40.0, "damping": 0.02, "force": 0.06}  # fmt: skip
UNEVEN = EVEN | {
    name: EVEN[name] * (1 + 0.2 * RNG.uniform(-1, 1, SITES))
    for name in ("mass", "ground", "damping", "force")
}
DRIVE = cb.Fourier(cos={1: -1.0, 3: 0.1}, sin={1: 0.3, 5: 0.05})


def flown(given: dict[str, Any], x: Any, v: Any, seconds: float) -> tuple[Any, int]:
    """The equations as they are written down in the laboratory, an integrator of their own, and
    every impact by itself: the state at the end, and how many there were."""
    M, K_ground, C, A = (given[name] * np.ones(SITES) for name in
                         ("mass", "ground", "damping", "force"))  # fmt: skip
    S, d, w = given["stiffness"], given["gap"], 2 * math.pi * given["frequency"]

    def right(t: float, y: Any) -> Any:
        x, v = np.split(y, 2)
        bonds = np.append(np.diff(x), 0.0) - np.insert(np.diff(x), 0, 0.0)
        force = A * (-math.cos(w * t) + 0.1 * math.cos(3 * w * t)
                     + 0.3 * math.sin(w * t) + 0.05 * math.sin(5 * w * t))  # fmt: skip
        return np.append(v, (force + S * bonds - K_ground * x - C * v) / M)

    def stop(n: int, wall: int) -> Any:
        def distance(t: float, y: Any) -> Any:
            return wall * y[n] - d

        distance.terminal, distance.direction = True, 1.0  # type: ignore[attr-defined]
        return distance

    stops = [stop(n, wall) for n in range(SITES) for wall in (1, -1)]
    t, y, count = 0.0, np.append(x, v), 0
    while t < seconds:
        leg = solve_ivp(right, (t, seconds), y, "DOP853", events=stops, rtol=1e-12, atol=1e-16)
        t, y = leg.t[-1], leg.y[:, -1]
        for i, times in enumerate(leg.t_events):
            if len(times):
                y[i // 2] = (d if i % 2 == 0 else -d) * (1 - 1e-15)
                y[SITES + i // 2] *= -K
                count += 1
    return y, count


@pytest.mark.parametrize("given", [EVEN, UNEVEN], ids=["even", "uneven"])
def test_the_laboratory_s_equations_move_as_ours_do(given: dict[str, Any]) -> None:
    units, periods = cb.Units(**given), 3
    u, v = np.array([0.1, -0.3, 0.9, 0.0]), np.array([0.0, 1.5, -1.0, 0.2])
    run = cb.simulate(
        (u, v), periods=periods, k=K, forcing=DRIVE, lattice=cb.OpenChain(SITES, **units.rows),
        **units.parameters,
    )  # fmt: skip
    length, velocity = units.scale("length"), units.scale("velocity")
    y, count = flown(given, length * u, velocity * v, 2 * math.pi * periods * units.scale("time"))
    assert count == len(run.impacts) > 5
    np.testing.assert_allclose(y[:SITES], length * run.final.u, rtol=0, atol=1e-8 * length)
    np.testing.assert_allclose(y[SITES:], velocity * run.final.v, rtol=0, atol=1e-8 * velocity)


@pytest.mark.parametrize("given", [EVEN, UNEVEN], ids=["even", "uneven"])
def test_numbers_lead_back_to_what_was_measured(given: dict[str, Any]) -> None:
    units, w = cb.Units(**given), 2 * math.pi * given["frequency"]
    back = {"a": "force", "gamma": "stiffness", "spring": "ground", "damping": "damping"}
    for name, value in units.parameters.items():
        measured = np.mean(given[back[name]])
        assert value * units.scale(name) == pytest.approx(measured, rel=1e-14)
    parts = {"masses": "mass", "drive": "force", "springs": "ground", "dampings": "damping"}
    heavy = given["mass"] / np.mean(given["mass"])
    assert set(units.rows) == (set(parts) if given is UNEVEN else set())
    for row, values in units.rows.items():
        share = values * (1.0 if row == "masses" else heavy)
        measured = given[parts[row]] / np.mean(given[parts[row]])
        assert share == pytest.approx(measured, rel=1e-14)
    assert units.scale("t12") == units.scale("phi") == pytest.approx(1 / w, rel=1e-14)
    assert units.scale("c") == given["gap"]
    assert units.scale("p") == units.scale("J2") == pytest.approx(given["gap"] * w, rel=1e-14)
    assert units.scale("acceleration") == pytest.approx(given["gap"] * w**2, rel=1e-14)


def test_other_units_of_the_same_things_are_the_same_numbers() -> None:
    """Grams, millimetres and milliseconds."""
    small = cb.Units(
        mass=25.0, stiffness=4e-3, gap=1.0, frequency=0.012, ground=40e-3, damping=0.02, force=0.06
    )
    assert small.parameters == pytest.approx(cb.Units(**EVEN).parameters, rel=1e-13)


def test_what_was_not_measured_is_no_parameter() -> None:
    least = cb.Units(mass=1, stiffness=0, gap=2, frequency=3)
    assert least.parameters == {"gamma": 0.0}
    assert least.rows == {}


def test_parts_that_are_alike_have_no_rows() -> None:
    """A shaken base drives all tips alike, however heavy each is."""
    shaken = cb.Units(**(UNEVEN | {"force": UNEVEN["mass"] * 2.3}))
    assert set(shaken.rows) == {"masses", "springs", "dampings"}


def test_units_of_the_same_measurement_are_one_value() -> None:
    assert cb.Units(**UNEVEN) == cb.Units(**{n: np.copy(value) for n, value in UNEVEN.items()})
    assert hash(cb.Units(**UNEVEN)) == hash(cb.Units(**UNEVEN))
    assert cb.Units(**UNEVEN) != cb.Units(**EVEN)


def test_the_table_says_which_length_time_and_force_are_1() -> None:
    cells: dict[Any, Any] = {row[0]: row[1] for row in cb.Units(**EVEN).table().rows}
    assert cells["1 of length"] == 1e-3
    assert cells["1 of time"] == pytest.approx(1 / (2 * math.pi * 12))
    assert cells["a"] * cells["1 of force"] == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"mass": 0}, "mass = 0: a number above 0, or one for each site,"),
        ({"mass": [1.0, -1.0]}, "mass = "),
        ({"mass": None}, "mass = None: finite real numbers"),
        ({"mass": []}, "mass = "),
        ({"gap": [1e-3, 2e-3]}, "gap = .* a number above 0 and up to"),
        ({"gap": 1e-40}, "gap = 1e-40"),
        ({"frequency": -12}, "frequency = -12: a number above 0"),
        ({"frequency": "12 Hz"}, "frequency = '12 Hz'"),
        ({"stiffness": -1}, "stiffness = -1: a number at least 0"),
        ({"ground": [40.0, math.nan]}, r"ground\[1\] = nan"),
        ({"force": 0.0}, "force = 0.0: a number above 0"),
        ({"force": 1e31}, "force = 1e"),
        ({"damping": True}, "damping = True"),
        ({"mass": [1.0] * 3, "ground": [1.0] * 4}, "3 of mass, 4 of ground: as many as"),
    ],
)
def test_what_cannot_be_measured_is_refused(wrong: dict[str, Any], says: str) -> None:
    with pytest.raises(cb.BadInput, match=says):
        cb.Units(**(EVEN | wrong))


@pytest.mark.parametrize("name", ["k", "c3", "metre", "", None, 1])
def test_numbers_without_a_unit_are_refused(name: Any) -> None:
    with pytest.raises(cb.BadInput, match="name must be 'length'"):
        cb.Units(**EVEN).scale(name)
