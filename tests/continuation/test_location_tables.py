"""Where nothing is looked for, and how close an event is located."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.continuation import Event, Steps, fold, trace, user
from contbreather.continuation.location import calm

from .zoo import BRUSSELATOR, CUSP, LINE, trace_case


def test_a_test_is_calm_where_its_parabola_stays_far_from_zero() -> None:
    """By numpy's parabola through the last three values: middle and ends of the step."""
    ends = tuple(trace(LINE.problem, "mu", within={"mu": (-1, 1)}, events=())[2:4])
    event, rng, seen = Event("X", float), np.random.default_rng(3), set()
    for _ in range(600):
        pace = rng.uniform(0.3, 2.0)
        values = rng.choice([-1.0, 1.0]) * (1.0 + rng.normal(scale=0.5, size=3))
        curve = np.polynomial.Polynomial.fit([-pace, 0.0, 1.0], values, 2)
        middle = curve(0.5) * np.sign(values[1])
        low, high = sorted(abs(values[1:]))
        wanted = bool(
            (values > 0).all() | (values < 0).all()
            and middle > 0.6 * high and low > 0.35 * max(high, middle)
        )  # fmt: skip
        assert calm([event], pace, *values[:, None], ends) == ({0} if wanted else set())
        seen.add(wanted)
    assert seen == {True, False}
    tally = Event("N", None, count=lambda point: 0)
    counted = [Event("X", float, count=lambda p, by=by: by * (p is ends[1])) for by in (0, 1, 2)]
    nan = math.nan
    for one, start, end, quiet in (
        (tally, 3, 3, True), (tally, 3, 4, False), (event, 3, 3, False), (event, nan, nan, True),
        (event, nan, 1.0, False), (event, 1.0, 0.0, False), (event, 0.0, 1.0, False),
        (counted[0], 1.0, 1.0, True), (counted[1], 1.0, 1.0, True), (counted[2], 1.0, 1.0, False),
        (counted[2], nan, nan, False), (counted[1], nan, nan, True),
    ):  # fmt: skip
        assert calm([one], 1.0, [start], [start], [end], ends) == ({0} if quiet else set())


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_events_are_located_as_well_whatever_the_walk_tolerates(tolerance: float) -> None:
    steps = Steps(tolerance=tolerance)
    line = trace(
        CUSP.problem, "h", within={"x": (-2, 2)}, steps=steps, events=[fold(), user("x", 0.2)]
    )
    exact = 2 / math.sqrt(27)
    assert [p["h"] for p in line.special[1:-1]] == pytest.approx([exact, -0.192, -exact], abs=1e-13)
    point = trace_case(BRUSSELATOR, steps=steps).first("HB")
    assert point["B"] == pytest.approx(2.0, abs=1e-13)


# --- diagrams -----------------------------------------------------------------------------------


# --- maps ---------------------------------------------------------------------------------------
