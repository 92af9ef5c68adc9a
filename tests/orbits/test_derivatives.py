"""The derivative of every boundary, column by column, against differences of its own equations.

Newton's iteration forgives a wrong column: it only takes longer, or ends where the step is small.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Point
from contbreather.continuation.branches.boundary import boundary_problem
from contbreather.continuation.curve.curve import Curve
from contbreather.orbits import neighbour_peak
from contbreather.orbits.by_impacts import impact_problem
from contbreather.orbits.constructors import asymmetric, shooting
from contbreather.orbits.grazing import other_contacts
from contbreather.orbits.orbit import orbit_of
from contbreather.orbits.section import Section
from tests.stability.by_hand import slope

LETTERS = cb.Symbolic("-cos(t) - c*cos(3*t)", c=0.2)


def two_sites() -> cb.Branch:
    """Sites 0 and 3 hit alike, each off centre by an offset of its own."""
    b = cb.symmetric(0.5, 0.03, 0.8)
    problem = orbit_of(
        b.conditions,
        Section(((0, 1), (3, 1), (0, -1), (3, -1))),
        [b.phi - 1e-6, b.phi + 1e-6, b.phi + math.pi - 1e-6, b.phi + math.pi + 1e-6],
        [-2 * b.p, -2 * b.p, 2 * b.p, 2 * b.p],
    ).problem
    grazing = [event for event in problem.events if event.kind == "GR"]
    return cb.trace(problem, "a", towards="up", within={"a": (0.4, 1.2)}, events=grazing)


def three_impacts() -> cb.Branch:
    """PD2 where one flight is 0.7 of the longest, within 3e-4: from there on, next to it, a section
    of its map would be counted from another flight."""
    problem = shooting(
        {"t1": -2.73, "t2": -1.91, "t3": 0.34},
        lattice=cb.Lattice([[0.6, -0.6], [-0.6, 0.6]], masses=[1.15, 0.85]),
        sequence=[(1, 1), (0, 1), (1, -1)],
        walls=[(None, 0.93), (-1.04, 0.93)],
        forcing=cb.Fourier({0: 0.04, 1: -1.0, 2: 0.06, 3: -0.11}, {2: -0.08, 3: -0.05}),
        **{"a": 0.23, "gamma": 0.0258, "k": 0.89, "spring": 0.29, "damping": 0.02081},
    )
    return branch(problem, "a", 0.21, 0.3)


def branch(start: Any, free: str, low: float, high: float, **more: Any) -> cb.Branch:
    return cb.trace(start, free, within={free: (low, high)}, **more)


ON_RING = cb.symmetric(0.2, 0.08, 0.8, lattice=cb.Ring(30))
LATER = cb.Fourier({1: -1.0, 3: -0.02})
BRANCHES: dict[str, Callable[[], cb.Branch]] = {
    "orbits": lambda: branch(cb.symmetric(0.5, 0.08, 0.8), "a", 0.0, 0.99),
    "with letters": lambda: branch(cb.symmetric(0.5, 0.04, 0.8, forcing=LETTERS), "a", 0.05, 0.99),
    "in gamma": lambda: branch(cb.symmetric(0.2, 0.08, 0.8), "gamma", 0.0, 0.12),
    "on ring": lambda: branch(ON_RING, "gamma", 0.0, 0.12),
    # ends where site 0 grazes between its impacts, and where its impact vanishes
    "at small k": lambda: branch(cb.symmetric(0.6, 0.1, 0.01), "a", 0.0, 1.0),
    "arm": lambda: branch(asymmetric(0.82, 0.04, 0.8).problem, "a", 0.7, 0.95),
    "arm of one": lambda: branch(
        asymmetric(0.85, 0.0, 0.8, lattice=cb.Ring(1)).problem, "a", 0.8, 0.95, towards="up"
    ),
    "general": lambda: branch(
        impact_problem(cb.symmetric(0.5, 0.05, 0.8).unfolded()), "a", 0.4, 0.95, towards="up"
    ),
    "two sites": two_sites,
    "shot": lambda: branch(shooting(cb.symmetric(0.5, 0.04, 0.8), sites=8), "a", 0.05, 0.99),
    # by springs to the ground
    "held": lambda: branch(cb.symmetric(0.5, 0.03, 0.8, spring=0.1), "a", 0.05, 2.0),
    # two sites, and four amplitudes of modes among the unknowns
    "in resonance": lambda: branch(
        cb.multibreather([0, 3], a=0.6, gamma=0.15, k=0.7, damping=0.02, lattice=cb.OpenChain(4)),
        "a",
        0.6,
        0.7,
        towards="up",
    ),
    "three impacts": three_impacts,
    "arm of two": lambda: branch(
        asymmetric(0.82, 0.04, 0.8, forcing=LATER).problem, "a", 0.7, 0.95, towards="up"
    ),
}


@cache
def traced(name: str) -> cb.Branch:
    return BRANCHES[name]()


Place = tuple[str, str, tuple[str, str]]
PLACES: list[Place] = [
    ("orbits", "LP", ("gamma", "a")),
    ("orbits", "GR", ("k", "a")),
    ("with letters", "PF", ("gamma", "a")),
    ("with letters", "PF", ("k", "a")),
    ("with letters", "PF", ("c", "a")),
    ("with letters", "LP", ("c", "k")),
    ("with letters", "GR", ("c", "gamma")),
    ("in gamma", "NS", ("a", "gamma")),
    ("in gamma", "NS", ("k", "gamma")),
    ("on ring", "NS", ("a", "gamma")),
    ("on ring", "NS", ("k", "gamma")),
    ("at small k", "GR", ("gamma", "a")),
    ("arm", "PF", ("gamma", "a")),
    ("arm", "GR", ("gamma", "a")),
    ("arm", "GR", ("k", "a")),
    ("arm of one", "PD", ("k", "a")),
    ("general", "GR", ("gamma", "a")),
    ("two sites", "GR", ("gamma", "a")),
    ("two sites", "GR", ("k", "a")),
    ("held", "LP", ("k", "spring")),
    ("held", "PF", ("k", "a")),
    ("held", "PF", ("spring", "gamma")),
    ("held", "GR", ("spring", "a")),
    ("in resonance", "NS", ("gamma", "a")),
    ("in resonance", "NS", ("k", "damping")),
    ("three impacts", "PD", ("damping", "a")),
    ("arm of two", "GR", ("c3", "a")),
    ("shot", "PF", ("gamma", "a")),
    ("shot", "LP", ("k", "a")),
    ("shot", "GR", ("gamma", "a")),
]


def named(place: Place) -> str:
    source, kind, pair = place
    return f"{source} {kind} in {' '.join(pair)}"


def special(place: Place) -> Point:
    source, kind, _ = place
    return next(
        p for p in traced(source).special[::-1] if p.kind == kind and p.event.locus is not None
    )


def differences(of: Callable[[np.ndarray], np.ndarray], z: np.ndarray, h: float) -> np.ndarray:
    return np.stack([slope(lambda e, x=x: of(z + e * x), h) for x in np.eye(z.size)], axis=1)


@pytest.mark.parametrize("place", PLACES, ids=named)
def test_the_derivative_of_a_boundary_is_that_of_its_equations(place: Place) -> None:
    point = special(place)
    longer = boundary_problem(point.base_point, point.event, place[2], events=())
    curve = Curve(longer, place[2][:1])
    z = curve.start
    wanted = differences(curve.equations, z, 2e-5)
    found = curve.jacobian(z)
    assert found.shape == wanted.shape
    off = np.abs(found - wanted).max(axis=0)
    assert off.max() < 2e-6 * np.abs(wanted).max(), dict(zip(longer.names, off, strict=False))


# --- what ends the grazing of a crest -------------------------------------------------------------


def test_neighbours_told_apart_by_a_high_power_of_the_coupling_do_not_seem_to_touch() -> None:
    """On a grid both neighbours of the corner climb alike but for gamma^4: towards gamma = 0 that
    goes below rounding, and was a doubtful GR-GR on some processors."""
    breather = cb.symmetric(0.64, 0.1, 0.8, lattice=cb.Grid(3, 4), damping=0.01, spring=0.1)
    grazing = cb.trace(breather, "a", within={"a": (0.6, 0.7)}).first("GR")
    line = cb.boundary(grazing, ("a", "gamma"), within={"gamma": (0.0, 0.12)})
    (event,) = (event for event in line.problem.events if event.kind == "GR-GR")
    assert line[-1]["gamma"] == 0.0 or line[0]["gamma"] == 0.0
    assert min(event.test(point) for point in line) > 0.1
    assert "GR-GR" not in [point.kind for point in line]
    assert not line.doubtful


@pytest.mark.parametrize("spring", [0.0, 0.02])
@pytest.mark.parametrize("k", [0.5, 0.8])
def test_of_sites_alike_without_coupling_the_nearest_is_followed(k: float, spring: float) -> None:
    """All touch their walls at once there, at a = |1 - spring|."""
    breather = cb.symmetric(0.7, 0.0, k, spring=spring)
    grazing = cb.trace(breather, "a", within={"a": (0.05, 1.2)}).first("GR")
    assert grazing["a"] == pytest.approx(1.0 - spring, abs=1e-12)
    for other in ("a", "k"):
        line = cb.boundary(grazing, (other, "gamma"), within={"a": (0.5, 1.2), "k": (0.4, 1.0)})
        assert not line.stop.failed
        assert not line.doubtful
        assert max(abs(1.0 - neighbour_peak(p.solution, 1)[1]) for p in line) < 1e-9


def test_what_is_left_beside_the_crest_that_grazes_on_an_arm_is_told_per_asymmetry() -> None:
    """As it vanishes where the arm begins, whatever else touches."""
    first = next(p for p in traced("arm").special[::-1] if p.kind == "GR")
    line = cb.boundary(first, ("gamma", "a"), within={"gamma": (0.035, 0.045)})
    (event,) = (event for event in line.problem.events if event.kind == "GR-GR")
    for point in [p for p in line if not p.kind][::4]:
        orbit = point.solution
        least = min(gap.margin for gap in other_contacts(orbit.motion, 1, point["t"]))
        assert event.test(point) == pytest.approx(least / abs(orbit.asymmetry), rel=1e-12)
