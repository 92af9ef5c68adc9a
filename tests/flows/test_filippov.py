"""Sliding beside closed forms: dry friction on a belt, relays, and where nothing slides."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import contbreather as cb

from .zoo import STICK_SLIP, slips

BELT = {"F": 1.0, "V": 1.0, "d": 0.1}


def test_a_mass_on_a_belt_sticks_and_slips_as_long_as_the_closed_form_says() -> None:
    run = cb.integrate(STICK_SLIP, {"x": 0.0, "v": 0.0}, BELT, time=60)
    stick, slide = run.pieces[-3:-1] if run.pieces[-3].number > 1 else run.pieces[-4:-2]
    assert (stick.flow, slide.flow) == (STICK_SLIP.to_minus, STICK_SLIP.minus)
    slipping, landed = slips(BELT["d"])
    assert slide.t[-1] - slide.t[0] == pytest.approx(slipping, abs=1e-10)
    assert slide.x[0, -1] == pytest.approx(landed, abs=1e-10)
    # stuck, it goes with the belt from there to where the spring pulls with F
    assert stick.t[-1] - stick.t[0] == pytest.approx(BELT["F"] - landed, abs=1e-10)
    np.testing.assert_allclose(stick.x[1], BELT["V"], atol=1e-13)


def test_the_relay_of_a_second_order_lag_spirals_in_as_the_closed_form_says() -> None:
    """x' = -x + y, y' = -y - sign(x): no sliding, ever shorter pieces.

    From x = 0, y = y0 > 0: y = -1 + (y0 + 1) e^-t and x = -1 + (1 + (y0 + 1) t) e^-t, so that the
    piece lasts as long as 1 + (y0 + 1) T = e^T says.
    """
    relay = cb.Filippov(
        lambda t, x, p: [-x[0] + x[1], -x[1] - 1],
        lambda t, x, p: [-x[0] + x[1], -x[1] + 1],
        lambda t, x, p: x[0],
    )
    run = cb.integrate(relay, [1.0, 0.0], {}, events=12)
    assert {piece.number for piece in run.pieces} == {0, 1}
    lengths = [float(piece.t[-1] - piece.t[0]) for piece in run.pieces[1:]]
    assert sorted(lengths, reverse=True) == lengths
    for piece, following in zip(run.pieces[1:], run.pieces[2:], strict=False):
        y, length = abs(piece.x[1, 0]), float(piece.t[-1] - piece.t[0])
        assert 1 + (y + 1) * length == pytest.approx(math.exp(length), abs=1e-10)
        assert abs(following.x[1, 0]) == pytest.approx(1 - (y + 1) * math.exp(-length), abs=1e-10)


def test_sliding_down_a_line_is_an_exponential() -> None:
    """x'' = -sign(x + k x'): once on the line x + k x' = 0, x' = -x / k."""
    relay = cb.Filippov(
        lambda t, x, p: [x[1], -1.0], lambda t, x, p: [x[1], 1.0], lambda t, x, p: x[0] + x[1] / 2
    )
    run = cb.integrate(relay, [0.2, 0.0], {}, time=6)
    arrival, stick = run.events[-1], run.pieces[-1]
    assert stick.flow is relay.to_plus
    t = np.linspace(arrival.time, 6, 20)
    x = arrival.after[0] * np.exp(-2 * (t - arrival.time))
    np.testing.assert_allclose(run(t), [x, -2 * x], atol=1e-12)


def test_a_curved_moving_surface_is_followed() -> None:
    """Both fields push at the circle of radius r(t) = 2 + sin(t)/2, and one turns around it."""

    def pushing(sign: int) -> Any:
        def f(t: Any, x: Any, p: Any) -> Any:
            return [-x[1] - 3 * sign * x[0], x[0] - 3 * sign * x[1]]

        return f

    def h(t: Any, x: Any, p: Any) -> Any:
        return x[0] ** 2 + x[1] ** 2 - (2 + np.sin(t) / 2) ** 2

    run = cb.integrate(cb.Filippov(pushing(1), pushing(-1), h), [3.0, 0.0], {}, time=10)
    t = np.linspace(run.events[0].time, 10, 40)
    np.testing.assert_allclose(np.hypot(*run(t)), 2 + np.sin(t) / 2, atol=1e-9)
    angle = np.unwrap(np.arctan2(*run(t)[::-1]))
    np.testing.assert_allclose(angle - angle[0], t - t[0], atol=1e-9)


def test_nothing_slides_where_the_motion_passes_through() -> None:
    """A mass that is faster than the belt's friction can hold: crossings only."""
    on = {**BELT, "F": 0.05, "d": 0.0, "V": 0.1}
    run = cb.integrate(STICK_SLIP, {"x": 3.0, "v": 0.0}, on, time=8)
    assert [piece.number for piece in run.pieces] == [1, 0, 1]
    for event in run.events:
        assert abs(event.before[0]) > on["F"]


def test_a_grazed_surface_is_not_slid_on() -> None:
    """On the circle x = F + V sin t the velocity touches V without sticking, or just sticks."""
    on = {**BELT, "d": 0.0}
    run = cb.integrate(STICK_SLIP, {"x": 1.0, "v": 0.5}, on, time=30)
    assert not run.events


def test_a_start_on_the_surface_is_sorted_by_its_fields() -> None:
    begins = [
        cb.integrate(STICK_SLIP, {"x": x, "v": 1.0}, BELT, time=0.1).pieces[0].number
        for x in (0.5, 2.0, -2.0)
    ]
    assert begins == [2, 1, 0]


def test_a_start_that_slides_stays_so_where_rounding_has_moved_it_off_the_surface() -> None:
    """Along y = sin x / 4, which is curved, at 2e-10 above it: it does not fall onto it."""

    def side(sign: int) -> Any:
        return lambda t, x, p: [1.0 - x[0], -float(sign)]

    held = cb.Filippov(side(1), side(-1), lambda t, x, p: x[1] - np.sin(x[0]) / 4)
    run = cb.integrate(held, {"x": 0.0, "y": 2e-10}, {}, time=3.0, first=2)
    assert [piece.flow for piece in run.pieces] == [held.to_plus]
    assert run.final[0] == pytest.approx(1 - math.exp(-3), abs=1e-11)
    above = cb.integrate(held, {"x": 0.0, "y": 0.7}, {}, time=3.0, first=2)  # that does fall
    assert [piece.flow for piece in above.pieces] == [held.flows[0], held.to_plus]
    with pytest.raises(cb.BadInput, match="first = 4: there are 4 flows"):
        cb.integrate(held, {"x": 0.0, "y": 0.0}, {}, time=3.0, first=4)


def test_a_surface_that_both_fields_leave_is_refused() -> None:
    apart = cb.Filippov(lambda t, x, p: [1.0], lambda t, x, p: [-1.0], lambda t, x, p: x[0])
    with pytest.raises(cb.BadInput, match="both fields point away from the surface"):
        cb.integrate(apart, [0.0], {}, time=1)
    assert cb.integrate(apart, [0.5], {}, time=1).final == pytest.approx([1.5])


def rubbing(sign: int) -> Any:
    return lambda t, x, p: [p["A"] * np.cos(t) - sign * p["F"] + 0 * x[0]]


MASS = cb.Filippov(rubbing(1), rubbing(-1), lambda t, x, p: x[0])


def pushed(A: float) -> cb.Problem:
    params, mesh = {"A": A, "F": 1.0}, cb.Collocation(intervals=12)  # flows are sines
    return cb.cycle(MASS, {"v": 0.3}, params, period=2 * np.pi, settle=25, collocation=mesh)


@pytest.mark.slow
def test_a_pushed_mass_begins_to_stick_where_den_hartog_says() -> None:
    """``v' = A cos t - F sign v`` moves all the time for A above F sqrt(1 + pi^2/4)."""
    onset = np.sqrt(1 + np.pi**2 / 4)
    branch = cb.trace(pushed(2.0), "A", within={"A": (1.8, 2.05)})
    assert [point.kind for point in branch.special] == ["SL", "EP"]
    assert branch.first("SL")["A"] == pytest.approx(onset, abs=1e-9)
    line = cb.boundary(branch.first("SL"), ("F", "A"), within={"F": (0.95, 1.1)})
    np.testing.assert_allclose(line["A"] / line["F"], onset, rtol=1e-9)
    stuck = cb.flows.cycle_of(pushed(1.8))
    assert stuck.others == pytest.approx([0], abs=1e-12)  # what sticks forgets


@pytest.mark.slow
def test_an_orbit_that_sticks_at_one_place_has_a_mesh_there() -> None:
    """Landing and leaving: ``A (sin t - sin t0) = F (t - t0)``, ``A cos t0 = F``."""
    orbit = cb.flows.cycle_of(pushed(1.5))
    numbers = [MASS.flows.index(flow) for flow in orbit.equations.flows]
    slip = orbit.flights[numbers.index(0)]
    assert 1.5 * np.cos(slip.start) == pytest.approx(1.0, abs=1e-12)
    travelled = 1.5 * (np.sin(slip.last) - np.sin(slip.start))
    assert travelled == pytest.approx(slip.duration, abs=1e-12)
