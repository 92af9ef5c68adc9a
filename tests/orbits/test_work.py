"""What branches and boundaries of breathers ask for, counted: nothing twice, and nothing for which
no answer has a use."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather import kernels
from contbreather.continuation import Steps
from contbreather.continuation.curve import derivative_checks
from contbreather.continuation.events.step_interpolant import StepInterpolant
from contbreather.continuation.walk import ends
from contbreather.orbits import margins
from contbreather.orbits.closed_form import ClosedForm
from contbreather.orbits.grazing import other_contacts
from contbreather.stability import ns_points
from contbreather.stability.one_impact import window

FINE = Steps(first=0.005, largest=0.01)


def branch(**more: Any) -> cb.Branch:
    return cb.trace(cb.symmetric(a=0.7, gamma=0.04, k=0.8), "a", within={"a": (0.6, 0.9)}, **more)


def test_both_sides_of_a_branch_set_out_from_one_start(counted) -> None:
    checks = counted(ends, "check_start")
    assert len(branch().special) == 3
    assert checks["calls"] == 1


def test_derivatives_of_the_package_are_not_compared_with_differences(counted) -> None:
    compared = counted(derivative_checks, "wrong_entry")
    found = branch().first("PF")
    cb.boundary(found, ("gamma", "a"), within={"gamma": (0.03, 0.05), "a": (0, 1)})
    assert compared["calls"] == 0


def test_a_point_of_a_boundary_is_made_into_a_breather_once_for_all_its_tests(counted) -> None:
    found = branch().first("PF")
    made = counted(ClosedForm, "__post_init__")
    window_of = {"gamma": (0.0, 0.2), "a": (0.0, 1.0)}
    line = cb.boundary(found, ("gamma", "a"), within=window_of, steps=FINE)
    assert [point.kind for point in line.special] == ["EP", "PF-GR"]
    assert made["calls"] <= 8 * len(line)  # not once for each test


def test_the_angle_of_a_pair_is_known_from_its_window(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*given: Any) -> Any:
        raise AssertionError(given)

    start = cb.symmetric(a=0.2, gamma=0.05, k=0.8)
    found = cb.trace(start, "gamma", within={"gamma": (0.0, 0.2)}).first("NS")
    ends = sorted(ns_points(found["gamma"], 0.8), key=lambda point: point.b)
    own = window(found["gamma"], 0.8)
    assert abs(own.miss(found.solution.representation.b)) < 1e-10
    assert [own.low, own.high] == pytest.approx([point.nu for point in ends], abs=1e-12)


@pytest.mark.parametrize(("free", "most"), [("a", 5), ("gamma", 8)])
def test_where_there_is_no_window_of_a_pair_none_is_looked_for(counted, free, most) -> None:
    placed = counted(StepInterpolant, "at")
    start, windows = cb.symmetric(0.3, 0.08, 0.8), {"a": (0.05, 0.95), "gamma": (0, 0.15)}
    cb.trace(start, free, within=windows, events=[cb.neimark_sacker()])
    assert placed["calls"] <= most  # 28 and 50 to bisect the place where b passes its centre


@pytest.mark.parametrize(("floor", "most"), [(0.3, 18), (1e-2, 25)])
def test_a_kink_that_stays_clear_of_zero_is_left_early(floor: float, most: int) -> None:
    looks = list[float]()

    def kink(point: cb.continuation.Point) -> float:
        looks.append(point["m"])
        return floor + 10.0 * abs(point["m"] - 0.6151)

    line = cb.Problem(lambda x, p: np.array([x[0] - p["m"]]), {"x": 0.0}, {"m": 0.0})
    steps, event = Steps(first=2.0, largest=2.0), cb.Event("KK", kink)
    found = cb.trace(line, "m", within={"m": (0.0, 1.0)}, towards="up", events=event, steps=steps)
    assert not found.doubtful
    assert len(looks) <= most  # 36 to find out where it is least to six digits


def test_sites_that_cannot_be_the_next_to_graze_are_passed_by(counted, monkeypatch) -> None:
    found = cb.trace(cb.symmetric(0.5, 0.1, 0.8), "a", within={"a": (0.3, 1)}).first("GR")
    orbit, filled = found.solution, counted(margins, "idle_margin")
    monkeypatch.setattr(kernels.Kernel, "code", lambda kernel: None)
    other_contacts(orbit.motion, 1, found.detail["t"])
    assert filled["calls"] <= 4  # of thirteen
