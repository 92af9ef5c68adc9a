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


def agree(problem: cb.Problem, free: tuple[str, ...], later: float = 0.0) -> None:
    """Equations and slopes by loops are those of the curve, next to where that starts."""
    curve = Curve(problem, free)
    z = curve.start * (1.0 + 1e-3 * np.arange(curve.start.size))
    z[2] += later
    assert problem.loops is not None
    loops = problem.loops(free, problem.params)
    data, given, out = loops.data, z.tolist(), [math.nan] * 100
    assert loops.evaluate(given, data, out) == 0
    n = z.size
    assert out[: n - 1] == pytest.approx(curve.equations(z), abs=1e-14)
    assert loops.derive(given, data, out) == 0
    assert out[: n * (n - 1)] == pytest.approx(curve.jacobian(z).ravel(), abs=1e-13)
    assert given == z.tolist()


SEVERAL = cb.Fourier(cos={1: -1.0, 3: -0.2}, sin={3: 0.1, 5: 0.05})
PAIRS = [("gamma", "a"), ("k", "gamma"), ("a", "k")]
CASES = [(forcing, pair) for forcing in (None, TWO) for pair in PAIRS]
CASES += [(SEVERAL, pair) for pair in (("c1", "s3"), ("s5", "a"), ("gamma", "c3"), ("k", "s3"))]


@pytest.mark.parametrize(("forcing", "pair"), CASES)
@pytest.mark.parametrize("of", [lost, touching, folding, breaking])
def test_loops_are_the_equations_of_the_boundary(of, forcing, pair) -> None:
    point = of(forcing)
    problem = boundary_problem(point.base_point, point.event, pair)
    for halves in (0, 1, 2, -3) if of is touching else (0,):  # a contact recurs, on either wall
        agree(problem, (pair[0],), halves * math.pi)
    loops, z = problem.loops((pair[0],), problem.params), Curve(problem, (pair[0],)).start
    for name, beyond in {"gamma": (-1e-9, 0.25), "k": (-1e-9, 1.0 + 1e-9)}.items():
        for value in beyond if name in pair else ():
            there = z.tolist()
            there[z.size - 2 + ((pair[1], pair[0]).index(name))] = value
            assert loops.evaluate(there, loops.data, [math.nan] * 100) == 1
            assert loops.derive(there, loops.data, [math.nan] * 100) == 1


@pytest.mark.parametrize("free", ["a", "gamma", "k", "c1", "c3", "s3", "s5"])
def test_loops_are_the_closure_in_any_parameter_inside_its_domain(free: str) -> None:
    problem = cb.symmetric(a=0.5, gamma=0.1, k=0.8, forcing=SEVERAL).problem
    agree(problem, (free,))
    loops = problem.loops((free,), problem.params)
    taken = {"gamma": ((0.0, 0.2499), (-1e-12, 0.25)), "k": ((0.0, 1.0), (-1e-12, 1.0 + 1e-12))}
    inside, beyond = taken.get(free, ((-3.0, 3.0), ()))
    for value in (*inside, *beyond):
        z, out = [0.4, -2.5, value], [math.nan] * 9
        status = int(value in beyond)
        assert loops.evaluate(z, loops.data, out) == status
        assert loops.derive(z, loops.data, out) == status


def test_off_the_band_there_is_no_pair() -> None:
    point = lost(None)
    problem = boundary_problem(point.base_point, point.event, ("gamma", "a"))
    loops = problem.loops(("gamma",), problem.params)
    z = Curve(problem, ("gamma",)).start.tolist()
    z[2] = 2.0 * math.sqrt(point["gamma"]) + 0.01
    assert loops.evaluate(z, loops.data, [math.nan] * 100) != 0


def test_a_contact_on_a_ring_is_followed_without_loops() -> None:
    start = cb.symmetric(a=0.5, gamma=0.1, k=0.8, lattice=cb.Ring(30))
    point = cb.trace(start, "a", within={"a": (0.3, 1)}).first("GR")
    problem = boundary_problem(point.base_point, point.event, ("k", "a"))
    assert problem.loops(("k",), problem.params) is None
