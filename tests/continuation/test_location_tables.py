"""Where nothing is looked for, and how close is close: both sides of what the engine allows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from contbreather.continuation import Branch, Problem, Steps, boundary, fold, trace, user
from contbreather.errors import BadInput, NotConverged

from .zoo import ALL, BRUSSELATOR, CUSP, PITCHFORK, TAKENS, TRANSCRITICAL, trace_case


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


# --- how close is close -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("off", "tilt", "good"),
    [(0.9e-6, 0, True), (1.1e-6, 0, False), (0, 0.9e-3, True), (0, -0.9e-3, True),
     (0, 1.1e-3, False), (0, -1.1e-3, False)],
)  # fmt: skip
def test_a_direction_is_taken_where_it_is_one_of_the_curve(off, tilt, good) -> None:
    line = Problem(lambda x, p: x - p["m"], {"x": off}, {"m": 0.0})
    along = np.array([1.0, 1.0 + math.sqrt(2) * tilt])
    if good:
        assert trace(line, "m", within={"m": (-1, 1)}, along=along)[-1]["x"] == 1.0
        return
    with pytest.raises(BadInput, match="no curve leaves the start in this direction"):
        trace(line, "m", within={"m": (-1, 1)}, along=along)


def test_a_start_beyond_a_fold_is_moved_up_to_half_of_its_size_and_one() -> None:
    fold_at_0 = Problem(lambda x, p: x**2 - p["m"], {"x": 0.0}, {"m": -0.9})
    branch = trace(fold_at_0, "m", within={"x": (-1, 1)})
    assert branch.start_correction == pytest.approx(0.9, abs=1e-3)
    with pytest.raises(NotConverged):
        trace(fold_at_0.at(m=-1.1), "m", within={"x": (-1, 1)})


# --- units --------------------------------------------------------------------------------------


def measured(own: Problem, unit: float) -> Problem:
    """The same equations with unknowns in another unit."""
    return Problem(
        lambda x, p: np.asarray(own.residual(x / unit, p)) * unit,
        {name: value * unit for name, value in own.start.items()},
        own.params,
        scales=dict.fromkeys(own.start, unit),
    )


def alike(one: Branch, other: Branch, unit: float) -> None:
    """Special points are the same but for the unit of the unknowns."""
    assert [p.label for p in other.special] == [p.label for p in one.special]
    for a, b in zip(one.special, other.special, strict=True):
        assert b.base_point.z[-1] == pytest.approx(a.base_point.z[-1], abs=1e-7)
        assert b.base_point.x / unit == pytest.approx(a.base_point.x, abs=1e-7)
        assert len(b.detail.get("tangents", ())) == len(a.detail.get("tangents", ()))


@pytest.mark.parametrize(
    ("case", "pair"),
    [(PITCHFORK, ()), (TRANSCRITICAL, ()), (CUSP, ("mu", "h")), (TAKENS, ("b2", "b1"))],
    ids=lambda case: getattr(case, "name", ""),
)
def test_special_points_do_not_depend_on_the_unit_of_unknowns(case, pair) -> None:
    found = []
    for unit in (1.0, 1e-4, 1e4):
        window = {
            name: (
                low * unit ** (name in case.problem.start),
                high * unit ** (name in case.problem.start),
            )
            for name, (low, high) in case.within.items()
        }
        line = trace(measured(case.problem, unit), case.free, within=window, events=ALL)
        found.append([line])
        for kind in ("LP", "HB") if pair else ():
            if any(point.kind == kind for point in line):
                within = {pair[0]: (-1.5, 1.5)}
                found[-1].append(boundary(line.first(kind), pair, within=within, events=ALL))
        for one, other in zip(found[0], found[-1], strict=True):
            alike(one, other, unit)
