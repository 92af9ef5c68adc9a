"""Formulas multiplied out by hand: each is the Fourier series that trigonometry makes of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.errors import BadInput
from contbreather.lattice import Fourier, Harmonic, Symbolic

T = np.linspace(0.0, 2.0 * math.pi, 41)

SERIES = [
    ("cos(t)**0*cos(t)", {1: 1.0}, {}),
    ("cos(t)**1", {1: 1.0}, {}),
    ("cos(t)**3", {1: 0.75, 3: 0.25}, {}),
    ("cos(t)^5", {1: 10 / 16, 3: 5 / 16, 5: 1 / 16}, {}),
    ("sin(t)**3", {}, {1: 0.75, 3: -0.25}),
    ("cos(t)*cos(2*t)", {1: 0.5, 3: 0.5}, {}),
    ("cos(t)*sin(2*t)", {}, {1: 0.5, 3: 0.5}),
    ("sin(t)*cos(2*t)**0", {}, {1: 1.0}),
    ("(cos(t) + 2*sin(t))**3", {1: 3.75, 3: -2.75}, {1: 7.5, 3: -0.5}),
    ("cos(t)*(1 - cos(2*t))/2", {1: 0.25, 3: -0.25}, {}),
    ("-(-cos(t))", {1: 1.0}, {}),
    ("+cos(t) - 3", None, None),
    ("(cos(t) - 3) + 3", {1: 1.0}, {}),
    ("3 - (3 - sin(3*t))", {}, {3: 1.0}),
    ("cos(t + pi/2)", {}, {1: -1.0}),
    ("cos(pi/3 - t)", {1: 0.5}, {1: math.sqrt(0.75)}),
    ("sin(5*t)/4", {}, {5: 0.25}),
    ("cos(3*(t + pi))", {3: -1.0}, {}),
    ("2*cos(t)*cos(t)*cos(t) - cos(t)", {1: 0.5, 3: 0.5}, {}),
    ("cos(t)/(2 - 1)", {1: 1.0}, {}),
    ("cos(t)*2**-1", {1: 0.5}, {}),
    ("cos(t)*exp(0)*sqrt(4)*Abs(-3)", {1: 6.0}, {}),
]  # fmt: skip


@pytest.mark.parametrize(("text", "cos", "sin"), SERIES, ids=[text for text, *_ in SERIES])
def test_a_product_of_waves_is_the_series_that_trigonometry_makes_of_it(text, cos, sin) -> None:
    if cos is None:
        with pytest.raises(BadInput, match="antisymmetr"):
            Symbolic(text)
        return
    own, wanted = Symbolic(text), Fourier(cos=cos, sin=sin)
    for name in ("f", "df", "d2f", "d3f"):
        assert getattr(own, name)(T) == pytest.approx(getattr(wanted, name)(T), abs=1e-12)
    here = {m: (c, s) for m, c, s in own.harmonics if abs(c) + abs(s) > 1e-13}
    there = {m: (c, s) for m, c, s in wanted.harmonics if abs(c) + abs(s) > 1e-13}
    assert sorted(here) == sorted(there)
    assert own.highest == max(there)
    assert own.peak() == pytest.approx(np.abs(wanted.f(np.linspace(0, 7, 20001))).max(), rel=1e-6)


@pytest.mark.parametrize(
    ("text", "slope"),
    [
        ("c*cos(t)", {1: 1.0}),
        ("c**2*cos(t)", {1: 1.4}),
        ("cos(t)/c", {1: -1 / 0.49}),
        ("c**0*cos(t)", {1: 0.0}),
        ("cos(t)*sqrt(c)", {1: 0.5 / math.sqrt(0.7)}),
        ("cos(t) + (1 - c)*cos(3*t)", {3: -1.0}),
        ("cos(t)*2**c", {1: 2**0.7 * math.log(2)}),
    ],
)
def test_slopes_in_a_parameter_are_series_too(text: str, slope) -> None:
    own = Symbolic(text, c=0.7)
    wanted = Fourier(cos=slope) if any(slope.values()) else None
    for t in (0.0, 0.4, 2.0):
        for order, name in ((0, "f"), (1, "df"), (2, "d2f")):
            there = 0.0 if wanted is None else float(getattr(wanted, name)(t))
            assert own.f_param("c", t, order) == pytest.approx(there, abs=1e-11)
        assert own.f_param("c", t) == own.f_param("c", t, 0)
    moved = own.at(c=0.9)
    assert moved.params == {"c": 0.9}
    assert own.params == {"c": 0.7}


def test_a_formula_of_very_many_parameters_is_too_large() -> None:
    names = [f"c{i}" for i in range(500)]
    text = "+".join(f"{name}*cos(t)" for name in names)
    with pytest.raises(BadInput, match=r"too (large|long)"):
        Symbolic(text, **dict.fromkeys(names, 1.0))


# --- forcings of other kinds ----------------------------------------------------------------------


def test_a_forcing_says_what_it_is() -> None:
    assert Harmonic().describe() == "F = -a cos t"
    both = Fourier(cos={1: -1.0, 3: 0.25}, sin={1: 0.5, 5: -2.0})
    assert both.describe() == "F = a (-1 cos t +0.25 cos 3t +0.5 sin t -2 sin 5t)"
    assert repr(both) == "Fourier(cos={1: -1.0, 3: 0.25}, sin={1: 0.5, 5: -2.0})"
    assert both.highest == 5
    assert both.params == {"c1": -1.0, "c3": 0.25, "s1": 0.5, "s5": -2.0}
    assert Symbolic("-c*cos(t)", c=1.5).describe().startswith("F = a (-c * cos(t)), c = 1.5; anti")
    assert Harmonic().highest == 1
    assert Harmonic().params == {}
    assert Harmonic().peak() == 1.0
