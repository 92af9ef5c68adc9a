"""Families of conservative flows: elliptic functions, symmetries, an independent integration."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipk

import contbreather as cb
from contbreather.flows import cycle_of


def duffing(t, x, p):
    return [x[1], -x[0] - p["b"] * x[0] ** 3]


def of_duffing(x, p):
    return x[1] ** 2 / 2 + x[0] ** 2 / 2 + p["b"] * x[0] ** 4 / 4


def duffing_period(size, b=1.0):
    """4 K(m) / w with w^2 = 1 + b A^2 and m = b A^2 / (2 w^2)."""
    square = 1 + b * size**2
    return 4 * ellipk(b * size**2 / (2 * square)) / np.sqrt(square)


def backbone(**how):
    how = {"conserves": of_duffing} | how
    return cb.cycle(duffing, {"u": 1.0, "v": 0.0}, {"b": 1.0}, **how)


# --- families -----------------------------------------------------------------------------------


def test_the_backbone_of_duffing_is_that_of_elliptic_functions() -> None:
    """In its period, in its energy, and in a parameter at a given period or energy."""
    walks = {
        "period": (backbone(period=4.74555), (4.0, 6.1)),
        "energy": (backbone(), (1e-4, 5.0)),
        "b": (backbone(fixed="energy"), (-0.2, 2.0)),
    }
    for free, (start, window) in walks.items():
        branch = cb.trace(start, free, within={free: window})
        b = branch["b"] if free == "b" else 1.0
        size = branch["max(u)"]
        np.testing.assert_allclose(branch["period"], duffing_period(size, b), atol=1e-9)
        if free != "b":
            energy = size**2 / 2 + b * size**4 / 4
            np.testing.assert_allclose(branch["energy"], energy, rtol=1e-9, atol=1e-12)
        assert abs(branch["lambda"]).max() < 1e-10
        assert not branch["unstable"].any()
        assert not branch.doubtful
    assert np.ptp(branch["energy"]) == 0
    at_period = cb.trace(walks["period"][0], "b", within={"b": (0.5, 1.5)})
    assert np.ptp(at_period["period"]) == 0
    np.testing.assert_allclose(
        duffing_period(at_period["max(u)"], at_period["b"]), 4.74555, atol=1e-9
    )


def test_the_pendulum_is_that_of_elliptic_functions_up_to_its_separatrix() -> None:
    """T = 4 K(sin^2(A / 2)), E = 1 - cos A."""
    swing = cb.cycle(
        lambda t, x, p: [x[1], -np.sin(x[0])], {"u": 2.0, "v": 0.0}, {},
        conserves=lambda x, p: x[1] ** 2 / 2 + 1 - np.cos(x[0]),
    )  # fmt: skip
    branch = cb.trace(swing, "period", within={"period": (6.4, 20.0)})
    wanted = 4 * ellipk(np.sin(branch["max(u)"] / 2) ** 2)
    np.testing.assert_allclose(branch["period"], wanted, atol=2e-8)  # 1e-9 of the amplitude
    np.testing.assert_allclose(4 * ellipk(branch["energy"] / 2), branch["period"], atol=1e-9)


def test_an_orbit_of_a_given_period_is_found_from_another_one() -> None:
    """That at T = 4.74555 from a start at T = 4.768; none is shorter than what is asked for."""
    orbit = cycle_of(backbone(period=4.74555))
    assert orbit.period == pytest.approx(4.74555, abs=1e-12)
    assert duffing_period(orbit.max["u"]) == pytest.approx(4.74555, abs=1e-9)
    with pytest.raises(cb.NotConverged, match=r'none of period 9 was found: .* in "period"'):
        backbone(period=9.0)


# --- several quantities -------------------------------------------------------------------------


def test_a_straight_orbit_of_an_isotropic_oscillator_is_isolated_among_its_rotations() -> None:
    def f(t, x, p):
        square = 1 + p["b"] * (x[0] ** 2 + x[1] ** 2)
        return [x[2], x[3], -x[0] * square, -x[1] * square]

    def energy(x, p):
        square = x[0] ** 2 + x[1] ** 2
        return (x[2] ** 2 + x[3] ** 2 + square) / 2 + p["b"] * square**2 / 4

    start = {"x": 0.6, "y": 0.8, "vx": 0.0, "vy": 0.0}
    both = {"energy": energy, "spin": lambda x, p: x[0] * x[3] - x[1] * x[2]}
    branch = cb.trace(cb.cycle(f, start, {"b": 1.0}, conserves=both),
                      "period", within={"period": (4.5, 5.5)})  # fmt: skip
    size = np.hypot(branch["max(x)"], branch["max(y)"])
    np.testing.assert_allclose(branch["period"], duffing_period(size), atol=1e-8)
    assert abs(branch["spin"]).max() < 1e-12
    np.testing.assert_allclose(branch["max(y)"] / branch["max(x)"], 4 / 3, rtol=1e-9)
    np.testing.assert_allclose(branch[-1].solution.multipliers, np.ones(4), atol=1e-9)


# --- refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "how"),
    [
        (r"energy is not conserved: it changes at the rate -?\d",
         {"conserves": lambda x, p: x[0] ** 2 + x[1] ** 2}),
        ("returns shape", {"conserves": lambda x, p: x}),
        (r"conserves must be functions of .x, p., got {'energy': 3}", {"conserves": {"energy": 3}}),
        ("fixed", {"fixed": "spin"}),
        ("positive time", {"period": lambda p: 6.0}),
    ],
)  # fmt: skip
def test_what_is_not_conserved_is_refused_with_a_sentence(words, how) -> None:
    with pytest.raises(cb.BadInput, match=words):
        backbone(**how)


def test_a_parameter_that_damps_is_not_traced() -> None:
    damped = cb.cycle(
        lambda t, x, p: [x[1], -x[0] - x[0] ** 3 - p["d"] * x[1]],
        {"u": 1.0, "v": 0.0}, {"d": 0.0, "b": 1.0}, conserves=of_duffing,
    )  # fmt: skip
    with pytest.raises(cb.BadInput, match="energy is not conserved where d moves"):
        cb.trace(damped, "d")
    with pytest.raises(cb.BadInput, match=r"rename .'lambda'"):
        cb.cycle(duffing, {"u": 1.0, "v": 0.0}, {"b": 1.0, "lambda": 1.0}, conserves=of_duffing)


def test_what_is_conserved_is_said_where_it_is_missing() -> None:
    with pytest.raises(cb.NotConverged, match=r"where energy is conserved .say so by conserves=."):
        cb.cycle(duffing, {"u": 1.0, "v": 0.0}, {"b": 1.0})
