"""On every curve of the zoo everything there is to find is found, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from contbreather.continuation import Problem, Steps, fold, trace

from . import zoo

every = pytest.mark.parametrize("case", zoo.ZOO, ids=lambda case: case.name)
small = pytest.mark.parametrize("case", zoo.SMALL, ids=lambda case: case.name)


@every
def test_all_events_are_found_and_no_false_one(case: zoo.Case) -> None:
    assert zoo.wrong(case, case.branch) == ""


@pytest.mark.slow
@every
@pytest.mark.parametrize("scale", [0.3, 10.0])
def test_neither_short_nor_long_steps_change_that_and_the_work_per_point_is_bounded(case, scale):
    problem, counter = zoo.counted(case.problem)
    branch = zoo.trace_case(case, scale, start=problem)
    assert zoo.wrong(case, branch) == ""
    assert counter.calls < (30 + 14 * (problem.x.size + 1)) * len(branch) + 400
    assert len(branch.doubtful) <= 4


@pytest.mark.slow
@settings(max_examples=12, derandomize=True)
@given(st.sampled_from(zoo.SMALL), st.floats(0.25, 40.0), st.floats(1e-4, 1.0))
@example(zoo.crowded(1e-6), 10.0, 0.1)
@example(zoo.crowded(1e-8), 3.0, 0.1)
@example(zoo.imperfect(1e-8)[0], 10.0, 0.1)
@example(zoo.imperfect(1e-8)[1], 0.5, 0.1)
@example(zoo.imperfect(1e-8)[1], 3.0, 0.1)
@example(zoo.ARMS, 0.3, 0.1)
def test_first_and_largest_step_do_not_matter(case: zoo.Case, scale: float, first: float) -> None:
    assert zoo.wrong(case, zoo.trace_case(case, scale, first)) == ""


@small
def test_every_point_solves_the_equations(case: zoo.Case) -> None:
    for point in case.branch:
        value = case.problem.residual(point.x, point.params)
        assert abs(value).max() <= 1e-12
        assert abs(value).max() <= point.residual + 1e-15  # that of an event has its locus in it


@pytest.mark.slow
@small
def test_a_walk_that_starts_at_an_event_finds_it_and_all_others(case: zoo.Case) -> None:
    for point in zoo.events_of(case.branch):
        if point.kind == "BP" and case is not zoo.PITCHFORK:
            continue  # several curves leave a branch point: see the tests of walks
        again = zoo.trace_case(case, start=point)
        assert zoo.wrong(case, again) == "", point


@pytest.mark.slow
@small
def test_both_directions_together_are_what_both_gives(case: zoo.Case) -> None:
    whole = case.branch
    up, down = (zoo.trace_case(case, towards=side) for side in ("up", "down"))
    if case.known and whole.began is None:  # closed
        assert len(zoo.events_of(up)) == len(zoo.events_of(down)) == len(zoo.events_of(whole))
        return
    assert len(up) + len(down) == len(whole) + 1
    assert len(zoo.events_of(up)) + len(zoo.events_of(down)) == len(zoo.events_of(whole))
    joined = down.reversed().join(up)
    assert [p.label for p in joined.special] == [p.label for p in whole.special]
    assert np.array_equal(joined["arclength"], whole["arclength"])


@every
def test_arclength_grows_and_tangents_are_of_unit_length(case: zoo.Case) -> None:
    branch = case.branch
    assert (np.diff(branch["arclength"]) > 0).all()
    lengths = [branch.curve.length(point.tangent) for point in branch]
    assert np.allclose(lengths, 1, rtol=0, atol=1e-12)
    chords = np.diff(np.stack([point.z for point in branch]), axis=0)
    along = [
        (branch.curve.metric * point.tangent).dot(chord)
        for point, chord in zip(branch, chords, strict=False)
    ]
    assert (np.array(along) > 0).all()


@every
def test_special_points_say_where_they_were_seen_and_how_well_they_are_known(case: zoo.Case):
    for point in zoo.events_of(case.branch):
        assert point.located
        low, high = point.bracket
        assert low <= point.arclength <= high
        assert high - low < 1e-6
        assert point.residual < 1e-12
        assert point.label == f"{point.kind}{point.label.removeprefix(point.kind)}"


# --- what each animal is in the zoo for -------------------------------------------------------


@pytest.mark.slow
def test_imperfection_is_followed_however_small_and_never_jumped() -> None:
    for h in (1e-3, 1e-6, 1e-9):
        above, below = zoo.imperfect(h)
        for case in (above, below):
            branch = zoo.trace_case(case, 10.0)
            assert zoo.wrong(case, branch) == ""
            assert abs(branch["x"] * (branch["mu"] - branch["x"] ** 2) + h).max() < 1e-14
            assert (branch["x"] > 0).all() if case is above else (branch["x"] < 0).all()


def test_stiff_scales_change_nothing_but_the_units() -> None:
    plain, stiff = (zoo.trace_case(case) for case in (zoo.CUSP, zoo.STIFF))
    assert len(plain) == len(stiff)
    assert np.allclose(stiff["x"], 1e6 * plain["x"], rtol=1e-9)
    assert np.allclose(stiff["arclength"], plain["arclength"], rtol=1e-9)


def test_without_scales_stiff_events_are_still_told_apart() -> None:
    bare = replace(zoo.STIFF.problem, scales={})
    branch = trace(
        bare,
        "h",
        within=zoo.STIFF.within,
        events=zoo.STIFF.events,
        steps=Steps(first=1e4, largest=1e5),
    )
    assert zoo.wrong(zoo.STIFF, branch) == ""


def test_array_and_numbers_may_be_unknown_together() -> None:
    second = zoo.chebyshev(12)

    def residual(y, p):
        u, top = y[:-1], y[-1]
        return np.append(second @ u + p["lam"] * np.exp(u), top - u[5])

    problem = Problem(residual, {"u": np.zeros(11), "top": 0.0}, {"lam": 1.0})
    branch = trace(problem, "lam", within={"top": (0.0, 2.0)}, events=[fold()])
    assert branch["top"][-1] == 2.0 or branch["top"][0] == 2.0
    assert branch.first("LP")["lam"] == pytest.approx(zoo.bratu_fold(), abs=1e-6)
