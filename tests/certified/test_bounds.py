"""Enclosures hold the exact values, above all where much is cut off: 30 digits of mpmath say so."""

from __future__ import annotations

import random
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import mpmath
import numpy as np
import pytest
from flint import arb, arb_poly

from contbreather.certified import averages, balls, inside_walls, proofs, winding
from contbreather.stability.one_impact import alias_sums
from tests.lattice.by_hand import MEANS, ring_mean
from tests.stability.half import D

COUPLINGS = (0.0, 0.03, 0.2, 0.2499)


@pytest.fixture(params=[2, 6, 40], ids="J={}".format)
def kept(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """So many powers of w^2: with few, what is cut off is seen."""
    caches = (averages._coefficients, averages._weights, winding._weights)
    monkeypatch.setattr(averages, "J", request.param)
    monkeypatch.setattr(winding, "ALIASES", request.param)
    monkeypatch.setattr(winding, "_POWERS", range(request.param + 1))
    monkeypatch.setattr(winding, "CUT", 2.0 ** (1 - 2 * request.param) + 5 * 9.0**-request.param)
    for cache in caches:
        cache.cache_clear()
    with balls.working(), mpmath.workdps(30):
        yield request.param
    for cache in caches:
        cache.cache_clear()


def holds(ball: Any, exact: Any) -> bool:
    """Whether an enclosure holds a number that is known to 30 digits."""
    near = arb(mpmath.nstr(exact, 28), mpmath.nstr(abs(exact) * mpmath.mpf(10) ** -25 + 1e-28, 5))
    return bool(ball.overlaps(near))


def mean(h: Any, gamma: Any, n: int = 0) -> Any:
    """Over the modes, by the periodic trapezoid rule, which converges exponentially."""
    return ring_mean(h, gamma, 60 if gamma < 0.1 else 240 if gamma < 0.24 else 4000, n)


@pytest.mark.parametrize("name", MEANS)
def test_means_hold_their_exact_values(name: str, kept: int) -> None:
    for gamma in COUPLINGS[:3]:
        assert holds(getattr(averages, name)(arb(gamma)), mean(MEANS[name], mpmath.mpf(gamma)))


@pytest.mark.parametrize("name", ["chi", "sigma"])
def test_slopes_of_means_hold_their_exact_values(name: str, kept: int) -> None:
    gamma, step = 0.1, mpmath.mpf(2) ** -40
    found = getattr(averages, name)(balls.Jet([arb(gamma), 1], prec=2))[1]
    ends = [mean(MEANS[name], mpmath.mpf(gamma) + side * step) for side in (1, -1)]
    assert found.overlaps(arb(mpmath.nstr((ends[0] - ends[1]) / (2 * step), 25), 1e-18))
    assert found.rad() < 1e-25 or kept < 40


def unit_motion(gamma: float, n: int, y: float, order: int) -> Any:
    """Derivatives of (T1) in time, per unit p."""
    y = mpmath.mpf(y)

    def mode(w: Any) -> Any:
        below = mpmath.cos(mpmath.pi * w / 2)
        return (
            -mpmath.sin(w * y) / (w * below) if w else -y,
            -mpmath.cos(w * y) / below,
            w * mpmath.sin(w * y) / below,
        )[order]

    return mean(mode, mpmath.mpf(gamma), n)


@pytest.mark.parametrize("n", [0, 1, 4])
def test_motions_hold_their_exact_values(n: int, kept: int) -> None:
    values = {name: arb(x) for name, x in {"p": 1, "phi": 0, "a": 0, "gamma": 0.2, "k": 1}.items()}
    path = inside_walls.motion_enclosure(values, n)
    for y in (-1.5, 0.4, 1.57):
        for order in range(3):
            assert holds(path.at(arb(y), order), unit_motion(0.2, n, y, order))


def test_no_site_beyond_moves_farther_than_the_reach_says() -> None:
    y = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 60)
    with balls.working():
        for gamma in (0.01, 0.2, 0.249):
            for n in (1, 3, 9):
                reach = float(averages.reach(arb(gamma), n))
                tops = []
                for site in (n, n + 1, n + 4):
                    s, P, _ = averages.free_flight_enclosure(arb(gamma), site)
                    tops.append(max(abs(float(-s * arb(x).sin() + P(arb(x)))) for x in y))
                assert max(tops) <= reach < 1.5 * tops[0]


def test_sums_over_aliases_hold_those_of_the_closed_form(kept: int) -> None:
    for gamma, nu in ((0.05, 0.3), (0.2, 0.95), (0.249, 1.0)):
        circle = winding.Circle(arb(gamma), arb(0.5), arb(0.1))
        exact = alias_sums(gamma, np.array([nu]))[:3]
        for ball, one in zip(circle.lattice_sums(arb(nu)), exact, strict=True):
            assert ball.overlaps(arb(float(one[0]), 1e-13))


def test_the_curve_that_winds_is_D_without_its_poles() -> None:
    gamma, k, b = 0.15, 0.6, 0.3
    edge = 2 * gamma**0.5
    with balls.working():
        circle = winding.Circle(arb(gamma), arb(k), arb(b))
        for x in (0.2, 0.7):
            nu = edge * np.sin(0.5 * np.pi * x)
            own, h = circle.on_band(x, x), -1j * nu * np.sqrt(4 * gamma - nu**2)
            assert abs(complex(float(own.real), float(own.imag)) / h - D(gamma, nu, k, b)) < 1e-13
            nu = edge + x * (1 - edge)
            own, h = circle.beyond(x, x), nu * np.sqrt(nu**2 - 4 * gamma)
            assert abs(complex(float(own.real), float(own.imag)) / h - D(gamma, nu, k, b)) < 1e-13


def test_a_ball_of_times_or_angles_holds_all_that_happens_in_it() -> None:
    """The remainders of Taylor's theorem, and rectangles over wide arcs."""
    rng = random.Random(5)
    values = {"p": 0.8, "phi": -2.9, "a": 0.5, "gamma": 0.15, "k": 0.7, "c1": -1.0, "s3": 2.0}
    with balls.working():
        own = {name: arb(x) for name, x in values.items()}
        path, circle = (
            inside_walls.motion_enclosure(own, 1),
            winding.Circle(arb(0.15), arb(0.7), arb(0.2)),
        )
        for _ in range(20):
            middle, radius = rng.uniform(-1, 1), rng.uniform(0.01, 0.4)
            wide = path.over(middle, radius)
            low = rng.uniform(0, 0.9)
            arcs = [(curve, curve(low, low + 0.1)) for curve in (circle.on_band, circle.beyond)]
            for share in (-1.0, -0.4, 0.2, 1.0):
                assert wide.contains(path.at(arb(middle + share * radius), 0))
                x = low + 0.05 * (1 + share)
                for curve, rectangle in arcs:
                    inner = curve(x, x)
                    assert rectangle.real.overlaps(inner.real)
                    assert rectangle.imag.overlaps(inner.imag)


def test_balls_cover_all_times() -> None:
    seen: list[tuple[float, float]] = []

    def settled(middle: float, radius: float) -> bool | None:
        if radius > 0.05:
            return None
        seen.append((middle - radius, middle + radius))
        return True

    assert inside_walls.everywhere(settled, 3) == (True, 0.0)
    ends = sorted(seen)
    assert ends[0][0] <= -0.5 * np.pi
    assert max(high for _, high in ends) >= 0.5 * np.pi
    assert all(one[1] >= other[0] for one, other in pairwise(ends))


@pytest.mark.parametrize(
    ("square", "middle", "radius", "proved"),
    [
        (2, 1.4, 0.1, True),
        (2, 1.4, 0.01, False),
        (2, 1.3, 0.05, False),
        (2, 0.0, 2.0, False),
        *((0, 1e-3 * radius, radius, False) for radius in (1e-12, 1e-3, 1.0)),  # a double root
    ],
)
def test_krawczyk_proves_a_root_where_there_is_one(square, middle, radius, proved) -> None:
    found = balls.krawczyk(lambda x: [x[0] * x[0] - square], [arb(middle, radius)])
    assert (found is not None) == proved
    assert found is None or found[0].contains(arb(square).sqrt())


def test_krawczyk_wants_all_unknowns_inside() -> None:
    def both(z: Any) -> Any:
        return [z[0] * z[0] - 2, z[1] * z[1] - 3]

    near, far = arb(1.4, 0.1), arb(1.5, 0.1)
    assert balls.krawczyk(both, [near, arb(1.7, 0.1)])
    assert balls.krawczyk(both, [near, far]) is None


def test_krawczyk_with_a_parameter_is_about_each_of_its_values() -> None:
    box = [arb(1.45, 0.1), balls.hull(2.0, 2.2)]
    found = balls.krawczyk(lambda z: [z[0] * z[0] - z[1]], box, along=1)
    assert found is not None
    assert found[0].contains(arb(2).sqrt())
    assert found[0].contains(arb(2.2).sqrt())
    wide = [arb(1.45, 0.1), balls.hull(2.0, 2.9)]
    assert balls.krawczyk(lambda z: [z[0] * z[0] - z[1]], wide, along=1) is None


def test_floats_are_rounded_outwards() -> None:
    with balls.working():
        third = arb(1) / 3
        low, high = balls.interval(third)
    assert arb(low) < third < arb(high)
    assert high == np.nextafter(low, 1.0)


# --- what is cut off, and what is rounded: no less than it is, and hardly more --------------------


def square(z: Any) -> Any:
    return [z[0] * z[0] - arb(1e-13) ** 2]


def test_a_zero_is_alone_up_to_the_next_one() -> None:
    """Zeros at +-1e-13: no box of half width 1e-13 around one of them is said to hold it alone."""
    with balls.working():
        zero = proofs.zero_near(square, [1.1e-13], 1e-12)
        assert zero is not None
        assert zero[0].contains(arb(1e-13))
        assert 2e-14 < proofs.alone_within(square, zero) < 2e-13
        assert proofs.alone_within(lambda z: [z[0] * z[0]], [arb(0)]) == 0.0
        line = [arb(0.2, 1e-20)]
        assert proofs.alone_within(lambda z: [z[0] - arb(0.2)], line) == 0.3


def test_a_zero_is_looked_for_up_to_the_rim_of_the_box_and_no_farther() -> None:
    with balls.working():
        for within, there in ((1.5e-9, True), (0.9e-9, False)):
            found = proofs.zero_near(lambda z: [z[0] - arb(1e-9)], [0.0], within)
            assert (found is not None) is there
        assert proofs.zero_near(lambda z: [z[0] * z[0]], [0.0], 1e-3) is None


def test_a_site_that_rises_through_a_wall_late_in_its_flight_is_not_inside() -> None:
    """A parabola: that it bends down settles the first half alone, where the site leaves +1."""
    with balls.working():
        end = arb.pi() / 2 - 0.5
        path = arb_poly([-0.5, 1]) ** 2 * (-2.5 / end**2) + 1.5
        assert abs(path(arb.pi() / 2) + 1) < 1e-12
        polynomials = path, path.derivative(), path.derivative().derivative()
        motion = inside_walls.ProvenMotion(((1, arb(0), arb(0)),), polynomials, 3 * (arb(0),))
        assert inside_walls.inside(motion, 2)[0] is False
        assert [inside_walls.below(motion, arb(high), 8)[0] for high in (8, 7.5)] == [True, False]
