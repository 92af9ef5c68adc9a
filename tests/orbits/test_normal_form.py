"""Normal form of the pitchfork: against the closed form of the arms at 40 digits, and against arms
that are followed, by every representation."""

from __future__ import annotations

import math
import pickle

import mpmath as mp
import numpy as np
import pytest

from contbreather.continuation import boundary, trace
from contbreather.continuation.algebra.newton import Undefined
from contbreather.continuation.branches.switching import switch
from contbreather.errors import BadInput
from contbreather.lattice import Fourier, InfiniteChain, Ring
from contbreather.lattice.finite import OpenChain
from contbreather.orbits import pitchfork, symmetric
from contbreather.orbits.branch_switching import lift
from contbreather.orbits.multibreathers import multibreather
from contbreather.orbits.normal_form import pitchfork_form
from contbreather.orbits.orbit import orbit_at

from .by_hand import started_on_arm, two_impacts


@pytest.mark.parametrize(
    ("gamma", "k", "known"), [(0.04, 0.8, 8.76146290), (0.0, 0.8, 9.16589298), (0.03, 0.6, None)]
)
def test_coefficient_is_the_curvature_of_the_closed_form(gamma, k, known):
    start = symmetric(0.6, gamma, k)
    point = trace(start, "a", within={"a": (0.3, 0.95)}).first("PF")
    form = pitchfork_form(point.solution)
    with mp.workdps(40):
        one, two = (two_impacts(d, gamma, k).a for d in ("1e-6", "2e-6"))
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
        there = started_on_arm(lifted, asymmetry)
        off = there.params[free] - lifted.problem.params[free]
        gaps.append(orbit_at(there).asymmetry ** 2 / off)
    limit = gaps[0] + (gaps[0] - gaps[1]) / 3
    assert pitchfork_form(branch_point.solution, free).coefficient == pytest.approx(limit, rel=1e-5)


TWO = {"a": 0.6, "gamma": 0.03, "k": 0.8, "damping": 0.05, "lattice": Ring(8)}


@pytest.mark.parametrize(
    "orbit",
    [
        symmetric(0.7, 0.04, 0.8),
        symmetric(1.008, 0.0576, 0.8, omega=1.2),
        multibreather([0, 1], **TWO),
    ],
)
def test_of_tied_parameters_it_is_that_of_the_new_one(orbit):
    window = (orbit.a, 1.2 * orbit.a)
    plain = trace(orbit, "a", within={"a": window}).first("PF")
    tied = orbit.problem.tied({"a": lambda p: 2 - 2 * p["x"]}, x=1 - orbit.a / 2)
    fork = trace(tied, "x", within={"x": (1 - window[1] / 2, 1 - window[0] / 2)}).first("PF")
    assert fork["coefficient"] == pytest.approx(-2 * plain["coefficient"], rel=1e-9)
    assert fork["criticality"] == plain["criticality"]


@pytest.mark.parametrize(("c3", "word"), [(-1.0, "supercritical"), (0.3, "subcritical")])
@pytest.mark.parametrize(
    ("gamma", "on"), [(0.0, {}), (0.02, {}), (0.02, {"lattice": Ring(3), "damping": 0.01})]
)
def test_the_word_says_whether_the_arms_take_over_stability(c3, word, gamma, on):
    forcing, told = Fourier(cos={1: -1.0, 3: c3}), {"threshold": 1.00001} if on else {}
    start = symmetric(0.9, gamma, 0.8, forcing=forcing, **on)
    branch = trace(start, "a", within={"a": (0.05, 3)}, events=[pitchfork()], inadmissible=True)
    point = branch.first("PF")
    assert pitchfork_form(point.solution).criticality == word
    arm = orbit_at(started_on_arm(lift(point), 0.02)).stability(**told).unstable
    near = [point["a"] - 1e-4, point["a"] + 1e-4]
    near_by = trace(point, "a", events=(), within={"a": near}, inadmissible=True)
    counts = [near_by[i].solution.stability(**told).unstable for i in (0, -1)]
    assert abs(counts[0] - counts[1]) == 1
    assert arm == (min(counts) if word == "supercritical" else max(counts))


@pytest.mark.parametrize(("c3", "word"), [(-1.0, "supercritical"), (0.3, "subcritical")])
def test_the_word_does_not_depend_on_the_parameter_that_is_varied(c3, word):
    """Stability is lost towards larger a and smaller gamma: one pitchfork all the same."""
    forcing = Fourier(cos={1: -1.0, 3: c3})
    start = symmetric(0.9, 0.02, 0.8, forcing=forcing)
    branch = trace(start, "a", within={"a": (0.05, 3)}, events=[pitchfork()], inadmissible=True)
    point = branch.first("PF")
    forms = {free: pitchfork_form(point.solution, free) for free in ("a", "gamma", "k", "c1", "c3")}
    assert {form.criticality for form in forms.values()} == {word}
    assert {form.coefficient > 0 for form in forms.values()} == {True, False}


@pytest.mark.parametrize("off", [1e-4, -1e-3, -0.4])
def test_a_breather_next_to_a_pitchfork_is_none(off):
    b = symmetric(0.777632425944 * (1 + off), 0.04, 0.8)
    with pytest.raises(BadInput, match="is no pitchfork"):
        pitchfork_form(b)


def test_no_pitchfork_no_normal_form():
    q, c = 1 / 9, math.pi**2 - 4
    b = symmetric(2 * math.sqrt(4 + (math.pi * q) ** 2) / c, 0.0, 0.8)
    with pytest.raises(BadInput, match=r"'c3' is not a parameter of this problem; it has .*'k'"):
        pitchfork_form(b, "c3")
    with pytest.raises(BadInput, match="only half a symmetric orbit has a pitchfork"):
        pitchfork_form(b.unfolded())


def test_the_end_of_a_domain_has_one_side():
    """At gamma = 0 and at k = 0 a parameter goes one way only: the same word as in a."""
    for gamma, k, free in ((0.0, 0.8, "gamma"), (0.02, 0.0, "k")):
        window = {"a": (1.2 - k, 1.6)}
        branch = trace(symmetric(1.3 - k, gamma, k), "a", within=window, inadmissible=True)
        b = branch.first("PF").solution
        assert pitchfork_form(b, free).criticality == pitchfork_form(b).criticality
        assert np.isfinite(pitchfork_form(b, free).coefficient)


def test_where_the_multiplier_only_touches_1_there_is_none():
    """At given a the pitchfork depends on ((1 - k)/(1 + k))^2: along k it turns back at k = 1."""
    branch = trace(symmetric(0.6, 0.02, 1.0), "a", within={"a": (0.3, 0.95)})
    with pytest.raises(Undefined, match="touches 1"):
        pitchfork_form(branch.first("PF").solution, "k")


LATTICES = {
    "ring with losses": {"lattice": Ring(20), "damping": 0.02},
    "ring with springs": {"lattice": Ring(20), "spring": 0.05},
    "end of an open chain": {"lattice": OpenChain(5), "damping": 0.01, "spring": 0.02},
}


@pytest.mark.parametrize("on", LATTICES)
def test_coefficient_is_that_of_the_arms_that_switch_follows(on):
    branch = trace(symmetric(0.7, 0.04, 0.8, **LATTICES[on]), "a", within={"a": (0.6, 0.95)})
    point = branch.first("PF")
    arm = switch(point, within={"a": (0.6, point["a"] + 0.01)})[0][1:5]
    rise = arm["a"] - point["a"]
    # the ratio is smooth in the distance
    limit = np.polyfit(rise, arm["asymmetry"] ** 2 / rise, 3)[-1]
    assert point["coefficient"] == pytest.approx(limit, rel=1e-6)
    assert point["criticality"] == "supercritical"


def test_a_pitchfork_on_a_boundary_has_no_coefficient_of_one_parameter():
    start = symmetric(0.7, 0.04, 0.8, lattice=Ring(4), damping=0.02)
    point = trace(start, "a", within={"a": (0.6, 0.95)}).first("PF")
    line = boundary(point, ("gamma", "a"), within={"gamma": (0.035, 0.045)})
    assert not any("coefficient" in one.detail for one in line.special)


def test_the_detail_of_a_pitchfork_is_found_when_it_is_asked_for_and_shown_as_a_dict():
    point = trace(symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.5, 0.9)}).first("PF")
    assert "whole" not in vars(point.detail)  # which holds all of it
    assert "reason" not in point.detail
    assert "whole" not in vars(point.detail)
    assert repr(point.detail) == repr(dict(point.detail))
    assert point.detail["coefficient"] == point["coefficient"] > 0
    assert dict(pickle.loads(pickle.dumps(point)).detail) == dict(point.detail)


def test_two_sites_have_two_pitchforks_with_their_normal_forms():
    start = multibreather([0, 4], a=0.7, gamma=0.03, k=0.8, lattice=Ring(9))
    branch = trace(start, "a", within={"a": (0.65, 0.76)})
    forks = [point for point in branch.special if point.kind == "PF"]
    assert len(forks) == 2
    for point in forks:
        # both impacts of an arm are shifted: the one that is shifted most
        arm = switch(point, within={"a": (0.6, point["a"] + 0.005)})[0][1:5]
        gap = [arm[f"t{j + 3}"] - arm[f"t{j + 1}"] - math.pi for j in range(2)]
        rise = arm["a"] - point["a"]
        limit = max(np.polyfit(rise, one**2 / rise, 3)[-1] for one in gap)
        assert point["coefficient"] == pytest.approx(limit, rel=1e-5)
