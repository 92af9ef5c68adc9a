"""Neimark-Sacker points and contacts as loops are the equations and slopes that boundaries have."""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Point
from contbreather.continuation.boundary import boundary_problem
from contbreather.continuation.curve import Curve

TWO = "cos(t) + 0.2*cos(3*t)"


def lost(forcing: str | None) -> Point:
    start = cb.symmetric(a=0.2, gamma=0.05, k=0.8, forcing=forcing)
    return cb.trace(start, "gamma", within={"gamma": (0, 0.2)}).first("NS")


def touching(forcing: str | None) -> Point:
    start = cb.symmetric(a=0.5, gamma=0.1, k=0.8, forcing=forcing)
    return cb.trace(start, "a", within={"a": (0.3, 1)}).first("GR")


def folding(forcing: str | None) -> Point:
    start = cb.symmetric(a=0.3, gamma=0.1, k=0.8, forcing=forcing)
    return cb.trace(start, "a", within={"a": (0.01, 0.4)}, towards="down").first("LP")


def breaking(forcing: str | None) -> Point:
    start = cb.symmetric(a=0.7, gamma=0.04, k=0.8, forcing=forcing)
    asked = {"events": [cb.pitchfork()], "inadmissible": True}  # beyond the walls in one case
    return cb.trace(start, "a", within={"a": (0.1, 3.0)}, **asked).first("PF")


@pytest.mark.parametrize("forcing", [None, TWO])
@pytest.mark.parametrize("of", [lost, touching, folding, breaking])
@pytest.mark.parametrize("pair", [("gamma", "a"), ("k", "gamma"), ("a", "k")])
def test_loops_are_the_equations_of_the_boundary(of, forcing, pair) -> None:
    point = of(forcing)
    problem = boundary_problem(point.ground, point.event, pair)
    curve = Curve(problem, (pair[0],))
    z = curve.start * (1.0 + 1e-3 * np.arange(curve.start.size))
    assert problem.loops is not None
    loops = problem.loops((pair[0],), problem.params)
    data, given, out = list(loops.data), z.tolist(), [math.nan] * 100
    assert loops.evaluate(given, data, out) == 0
    n = z.size
    assert out[: n - 1] == pytest.approx(curve.equations(z), abs=1e-14)
    assert loops.derive(given, data, out) == 0
    assert out[: n * (n - 1)] == pytest.approx(curve.jacobian(z).ravel(), abs=1e-13)
    assert given == z.tolist()


def test_off_the_band_there_is_no_pair() -> None:
    point = lost(None)
    problem = boundary_problem(point.ground, point.event, ("gamma", "a"))
    loops = problem.loops(("gamma",), problem.params)
    z = Curve(problem, ("gamma",)).start.tolist()
    z[2] = 2.0 * math.sqrt(point["gamma"]) + 0.01
    assert loops.evaluate(z, list(loops.data), [math.nan] * 100) != 0


def test_a_contact_on_a_ring_is_followed_without_loops() -> None:
    start = cb.symmetric(a=0.5, gamma=0.1, k=0.8, lattice=cb.Ring(30))
    point = cb.trace(start, "a", within={"a": (0.3, 1)}).first("GR")
    problem = boundary_problem(point.ground, point.event, ("k", "a"))
    assert problem.loops(("k",), problem.params) is None
