"""Normal form of the pitchfork: against the closed form of the arms at 40 digits."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from contbreather.breathers import pitchfork, symmetric
from contbreather.breathers.arms import beside
from contbreather.breathers.lifts import lift
from contbreather.breathers.orbit import orbit_at
from contbreather.breathers.symmetric_events import form_at
from contbreather.continuation import trace
from contbreather.errors import BadInput
from contbreather.lattice import Fourier, Harmonic, InfiniteChain, Ring
from contbreather.stability.normal_form import pitchfork_form


def amplitude(gamma, q, d):
    """The closed form of asymmetric breathers: a at flights pi -+ 2d."""

    def A(w):
        if w == 0:
            return (mp.pi**2 - 4 * d * d) / (2 * mp.pi)
        return (mp.cos(2 * w * d) - mp.cos(mp.pi * w)) / (w * mp.sin(mp.pi * w))

    def B(w):
        return 2 * d / mp.pi if w == 0 else mp.sin(2 * w * d) / mp.sin(mp.pi * w)

    def mean(f):
        if gamma == 0:
            return f(mp.mpf(0))
        return mp.quad(lambda x: f(2 * mp.sqrt(gamma) * mp.sin(x / 2)), [0, mp.pi]) / mp.pi

    b = mean(B)
    p = 1 / (mean(A) - b * mp.cot(d))
    return mp.hypot(p * q / mp.cos(d), p * b / mp.sin(d))


@pytest.mark.parametrize(
    ("gamma", "k", "known"), [(0.04, 0.8, 8.76146290), (0.0, 0.8, 9.16589298), (0.03, 0.6, None)]
)
def test_coefficient_is_the_curvature_of_the_closed_form(gamma, k, known):
    start = symmetric(0.6, gamma, k)
    point = trace(start, "a", within={"a": (0.3, 0.95)}).first("PF")
    form = form_at(point.solution.flight)
    with mp.workdps(40):
        q = (1 - mp.mpf(k)) / (1 + mp.mpf(k))
        one, two = (amplitude(mp.mpf(gamma), q, mp.mpf(d)) for d in ("1e-6", "2e-6"))
        exact = 4 * 3 * mp.mpf("1e-12") / (two - one)
    assert form.coefficient == pytest.approx(float(exact), rel=1e-9)
    assert known is None or form.coefficient == pytest.approx(known, abs=1e-6)
    assert form.criticality == "supercritical"


@pytest.mark.parametrize("lattice", [InfiniteChain(), Ring(6)])
@pytest.mark.parametrize("free", ["a", "gamma", "k", "c1", "c3", "s5"])
def test_coefficient_is_what_the_arms_do_in_any_parameter(lattice, free):
    forcing = Fourier(cos={1: -1.0, 3: -0.1}, sin={5: 0.3})
    start = symmetric(0.7, 0.04, 0.8, forcing=forcing, lattice=lattice)
    point = trace(start, "a", within={"a": (0.5, 0.95)}).first("PF")
    at = point.problem
    if free == "a":
        branch_point = point
    else:
        window = {free: (at.params[free] - 0.02, at.params[free] + 0.02)}
        branch_point = trace(at, free, within=window).first("PF")
    lifted = lift(branch_point)
    gaps = []
    for asymmetry in (0.005, 0.01):
        there = beside(lifted, asymmetry)
        off = there.params[free] - lifted.problem.params[free]
        gaps.append(orbit_at(there).asymmetry ** 2 / off)
    limit = gaps[0] + (gaps[0] - gaps[1]) / 3
    assert form_at(branch_point.solution.flight, free).coefficient == pytest.approx(limit, rel=1e-5)


@pytest.mark.parametrize(("c3", "word"), [(-1.0, "supercritical"), (0.3, "subcritical")])
@pytest.mark.parametrize("gamma", [0.0, 0.02])
def test_the_word_says_whether_the_arms_take_over_stability(c3, word, gamma):
    forcing = Fourier(cos={1: -1.0, 3: c3})
    start = symmetric(0.9, gamma, 0.8, forcing=forcing)
    branch = trace(start, "a", within={"a": (0.05, 3)}, events=[pitchfork()], inadmissible=True)
    point = branch.first("PF")
    assert form_at(point.solution.flight).criticality == word
    arm = orbit_at(beside(lift(point), 0.01)).map.count().count
    near = [point["a"] - 1e-4, point["a"] + 1e-4]
    near_by = trace(point, "a", events=(), within={"a": near}, inadmissible=True)
    counts = [near_by[i].solution.stability().unstable for i in (0, -1)]
    assert abs(counts[0] - counts[1]) == 1
    assert arm == (min(counts) if word == "supercritical" else max(counts))


@pytest.mark.parametrize(("c3", "word"), [(-1.0, "supercritical"), (0.3, "subcritical")])
def test_the_word_does_not_depend_on_the_parameter_that_is_varied(c3, word):
    """Stability is lost towards larger a and smaller gamma: one pitchfork all the same."""
    forcing = Fourier(cos={1: -1.0, 3: c3})
    start = symmetric(0.9, 0.02, 0.8, forcing=forcing)
    branch = trace(start, "a", within={"a": (0.05, 3)}, events=[pitchfork()], inadmissible=True)
    point = branch.first("PF")
    forms = {free: form_at(point.solution.flight, free) for free in ("a", "gamma", "k", "c1", "c3")}
    assert {form.criticality for form in forms.values()} == {word}
    assert {form.coefficient > 0 for form in forms.values()} == {True, False}


@pytest.mark.parametrize("off", [1e-4, -1e-3])
def test_a_breather_next_to_a_pitchfork_is_none(off):
    b = symmetric(0.777632425944 * (1 + off), 0.04, 0.8)
    with pytest.raises(BadInput, match="is no pitchfork"):
        pitchfork_form(b.a, b.gamma, b.k, b.p, b.phi, Harmonic(), InfiniteChain())


def test_no_pitchfork_no_normal_form():
    b = symmetric(0.5, 0.04, 0.8)
    numbers = (b.a, b.gamma, b.k, b.p, b.phi, Harmonic(), InfiniteChain())
    with pytest.raises(BadInput, match="is no pitchfork"):
        pitchfork_form(*numbers)
    q, c = 1 / 9, math.pi**2 - 4
    a, p = 2 * math.sqrt(4 + (math.pi * q) ** 2) / c, 2 * math.pi / c
    at = (a, 0.0, 0.8, p, -math.pi + math.atan(math.pi * q / 2))
    with pytest.raises(BadInput, match="unknown parameter 'c3': this breather has a, gamma, k"):
        pitchfork_form(*at, Harmonic(), InfiniteChain(), free="c3")
    assert np.isfinite(pitchfork_form(*at, Harmonic(), InfiniteChain(), free="k").coefficient)
