"""What a problem is called says which walls count and which chain its counts are about."""

from __future__ import annotations

import pytest

import contbreather as cb

HERE = {"a": 0.5, "gamma": 0.04, "k": 0.8}
WITHIN = {"a": (0.49, 0.51)}
RING = " (stability of a ring of 50, threshold 1.01)"
LIFTED = ", walls lifted"


@pytest.mark.parametrize(
    ("events", "inadmissible", "end", "columns"),
    [
        (None, False, "", []),
        (None, True, LIFTED, ["margin"]),
        ("LP", False, "", []),
        ("LP", True, LIFTED, ["margin"]),
        ("NS", False, RING, []),
        ("NS", True, RING + LIFTED, ["margin"]),
    ],
)
def test_the_label_names_what_differs_from_the_plain_problem(events, inadmissible, end, columns):
    asked = {"LP": [cb.fold()], "NS": [cb.neimark_sacker(threshold=1.01)]}.get(events)
    b = cb.symmetric(**HERE)
    b = b.on(cb.Ring(50)) if events == "NS" else b
    branch = cb.trace(b, "a", within=WITHIN, events=asked, inadmissible=inadmissible)
    assert branch.problem.label == f"symmetric breather{end}"
    assert list(branch.problem.record) == ["unstable", "t1", "t2", "c", "asymmetry", *columns]
    assert ("GR" in [event.kind for event in branch.problem.events]) != inadmissible
    again = cb.trace(branch[0], "a", within=WITHIN, events=asked, inadmissible=inadmissible)
    assert again.problem.label == branch.problem.label  # once, not once more each time


@pytest.mark.parametrize(
    ("lattice", "end"),
    [(cb.InfiniteChain(), ""), (cb.Ring(8), " (ring of 8, threshold 1.005)")],
    ids=str,
)
def test_arms_say_which_ring_they_are_on(lattice, end: str) -> None:
    branch = cb.trace(cb.symmetric(0.75, 0.04, 0.8, lattice=lattice), "a", towards="up")
    assert branch.problem.label == f"symmetric breather{end}"
    for arm in cb.switch(branch.first("PF")):
        assert arm.problem.label == f"asymmetric breather{end}"


def test_with_another_threshold_the_label_of_the_first_one_is_replaced() -> None:
    b = cb.symmetric(**HERE).on(cb.Ring(20))
    first = cb.trace(b, "a", within=WITHIN, events=[cb.neimark_sacker(threshold=1.02)])
    second = cb.trace(first[0], "a", within=WITHIN, events=[cb.neimark_sacker(threshold=1.01)])
    assert second.problem.label == first.problem.label.replace("1.02", "1.01")
