"""What is measured, and the numbers that are made of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

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


@pytest.mark.parametrize("given", [EVEN, UNEVEN], ids=["even", "uneven"])
def test_our_orbits_obey_the_equations_of_the_laboratory(given: dict[str, Any]) -> None:
    """As they are written down there; only the impulses, of which both have one law, are left."""
    units = cb.Units(**given)
    lattice, on = cb.OpenChain(SITES, **units.rows), {"k": K, "forcing": DRIVE, "site": 1}
    orbit = cb.symmetric(lattice=lattice, **on, **units.parameters)
    M, ground, C, A = (given[name] * np.ones(SITES) for name in
                       ("mass", "ground", "damping", "force"))  # fmt: skip
    t = np.linspace(0.0, 2 * math.pi, 50)[:, None]
    x, v, bend = (
        units.scale(name) * of(np.arange(SITES), t)
        for name, of in (
            ("length", orbit.displacement), ("velocity", orbit.velocity),
            ("acceleration", orbit.acceleration),
        )
    )  # fmt: skip
    force = A * (-np.cos(t) + 0.1 * np.cos(3 * t) + 0.3 * np.sin(t) + 0.05 * np.sin(5 * t))
    pull = np.diff(x, axis=1, prepend=x[:, :1], append=x[:, -1:])
    pull = given["stiffness"] * (pull[:, 1:] - pull[:, :-1])
    np.testing.assert_allclose(M * bend, force + pull - ground * x - C * v, rtol=0, atol=1e-12)
    reached = units.scale("length") * orbit.displacement(1, orbit.times[0])
    assert reached == pytest.approx(given["gap"], rel=1e-12)


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
