"""What is looked at how often: nothing twice, and nothing that no answer needs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import contbreather as cb

Array = NDArray[np.float64]
WITHIN = {"m": (-1.0, 1.0)}


def counted(calls: Counter[str], *, jacobian: bool = False) -> cb.Problem:
    """A gently bent curve on which nothing happens."""

    def field(x: Array, p: Mapping[str, float]) -> Any:
        calls["residual"] += 1
        return [x[0] - p["m"], x[1] ** 3 - x[1] + 0.3 * p["m"] - 0.1 * x[0] ** 2]

    def slope(x: Array, p: Mapping[str, float]) -> Any:
        calls["jacobian"] += 1
        return [[1.0, 0.0], [-0.2 * x[0], 3 * x[1] ** 2 - 1.0]]

    more = {"jacobian": slope} if jacobian else {}
    return cb.Problem(field, {"x": 0.0, "y": 1.0}, {"m": 0.0}, **more)


def watched(calls: Counter[str], event: cb.Event) -> cb.Event:
    def test(point: cb.continuation.Point) -> Any:
        calls[event.kind] += 1
        return event.test(point)

    return replace(event, test=test)


@pytest.mark.parametrize("jacobian", [False, True])
def test_each_test_is_asked_at_the_ends_and_in_the_middle_of_a_step(jacobian: bool) -> None:
    calls: Counter[str] = Counter()
    events = [watched(calls, one) for one in (cb.fold(), cb.branch_point(), cb.hopf())]
    branch = cb.trace(counted(calls, jacobian=jacobian), "m", within=WITHIN, events=events)
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    steps = len(branch) - 1
    for kind in ("LP", "BP", "HB"):
        assert calls[kind] <= 2 * steps + 4, kind


def test_a_test_that_is_far_from_zero_is_asked_once_a_step() -> None:
    calls: Counter[str] = Counter()
    events = [watched(calls, cb.user("m", 5.0))]
    branch = cb.trace(counted(calls), "m", within=WITHIN, events=events)
    assert calls["UZ"] <= len(branch) + 8  # more at both ends of each side


def test_an_event_that_is_found_costs_a_few_looks_more() -> None:
    calls: Counter[str] = Counter()
    events = [watched(calls, cb.user("m", 0.31))]
    branch = cb.trace(counted(calls), "m", within=WITHIN, events=events)
    assert branch.first("UZ")["m"] == pytest.approx(0.31, abs=1e-12)
    assert calls["UZ"] <= 2 * (len(branch) - 1) + 5


def test_a_start_on_an_event_costs_a_look_beside_it() -> None:
    calls: Counter[str] = Counter()
    events = [watched(calls, cb.user("m", 0.0))]
    branch = cb.trace(counted(calls), "m", within=WITHIN, events=events, towards="up")
    assert calls["UZ"] <= 2 * (len(branch) - 1) + 6
    assert [point.kind for point in branch.special] in (["UZ", "EP"], ["EP", "EP"])


def test_residuals_and_derivatives_of_a_walk_are_a_few_for_each_point() -> None:
    calls: Counter[str] = Counter()
    branch = cb.trace(counted(calls), "m", within=WITHIN, events=())
    plain = calls["residual"] / len(branch)
    assert plain <= 18.5
    given: Counter[str] = Counter()
    again = cb.trace(counted(given, jacobian=True), "m", within=WITHIN, events=())
    assert abs(len(again) - len(branch)) <= 2
    assert given["jacobian"] / len(again) <= 4.2
    assert given["residual"] / len(again) <= 10.5
    with_events: Counter[str] = Counter()
    events = (cb.fold(), cb.branch_point(), cb.hopf())
    cb.trace(counted(with_events), "m", within=WITHIN, events=events)
    assert with_events["residual"] / len(branch) <= plain + 9.5


def test_a_gentle_curve_takes_few_steps() -> None:
    calls: Counter[str] = Counter()
    for largest in (0.05, 0.2):
        branch = cb.trace(
            counted(calls), "m", within=WITHIN, events=(), steps=cb.Steps(largest=largest)
        )
        assert np.max(np.diff(branch["arclength"])) <= largest * (1 + 1e-4)
        assert len(branch) <= 3.0 / largest + 14
    assert len(cb.trace(counted(calls), "m", within=WITHIN, events=())) <= 45


def test_a_breather_costs_a_few_closures_for_each_point(monkeypatch) -> None:
    chi, calls = cb.InfiniteChain.chi, Counter[str]()

    def asked(chain: cb.InfiniteChain, gamma: float) -> float:
        calls["chi"] += 1
        return chi(chain, gamma)

    monkeypatch.setattr(cb.InfiniteChain, "chi", asked)
    b = cb.symmetric(0.3, 0.04, 0.8)
    assert calls["chi"] <= 6
    calls.clear()
    branch = cb.trace(b, "a", within={"a": (0.2, 0.4)})
    assert calls["chi"] / len(branch) <= 14
