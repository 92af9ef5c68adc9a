"""Breathers and special points that are found without a start."""

from __future__ import annotations

import math

import pytest

import contbreather as cb
from contbreather import progress
from contbreather.orbits import find_event, find_symmetric, smallest_amplitude

WHERE = {"gamma": (0.0, 0.24), "a": (0.86, 0.95)}


def test_search_goes_on_where_there_is_no_breather() -> None:
    # at the coupling in the middle of the window, where it looks first, there is none
    with pytest.raises(
        cb.NoSolution, match=r"no breather with gamma = 0\.12, k = 0\.8 for a between 0\.86 and"
    ):
        find_symmetric("a", WHERE["a"], gamma=0.12, k=0.8, root=1)
    point = find_event("GR", ("gamma", "a"), within=WHERE, k=0.8)
    assert point.solution.admissibility().margin == pytest.approx(0.0, abs=1e-12)
    assert WHERE["a"][0] < point["a"] < WHERE["a"][1]


def test_a_lower_breather_is_found_where_no_upper_one_is_in_the_window() -> None:
    found = find_symmetric("a", WHERE["a"], gamma=0.12, k=0.8)
    assert found.admissibility().ok
    assert found.representation.family == "lower"
    # the upper one comes first, wherever in the window it is
    upper = find_symmetric("gamma", (0.0, 0.2), a=0.9, k=0.8)
    assert upper.representation.family == "upper"
    assert upper == find_symmetric("gamma", (0.0, 0.2), a=0.9, k=0.8, root=1)


def test_nothing_is_printed_while_searching(capsys, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    assert find_event("LP", ("gamma", "a"), gamma=0.04, k=0.8).kind == "LP"
    # on an arm, which leaves the branch at its pitchfork
    double = find_event("PD", ("gamma", "a"), within={"a": (0.5, 0.999)}, gamma=0.002, k=0.95)
    assert (double.kind, double["a"]) == ("PD", pytest.approx(0.912097259017, abs=1e-11))
    assert capsys.readouterr() == ("", "")


# --- where is looked ------------------------------------------------------------------------------


NEAR, RING = {"gamma": 0.1, "k": 0.8}, {"lattice": cb.Ring(5), "gamma": 0.02, "k": 0.8}


@pytest.mark.parametrize(
    ("free", "within", "given", "found"),
    [
        ("k", (0.0, 1.0), {"a": 0.5, "gamma": 0.1, "k": 0.3}, 0.3),
        ("k", (0.4, 1.0), {"a": 0.5, "gamma": 0.1, "k": 0.3}, 0.415),
        ("gamma", (0.0, 0.2), {"a": 0.3, "k": 0.5, "gamma": 0.15}, 0.15),
        ("gamma", (0.0, 0.2), {"a": 0.3, "k": 0.5}, 0.005),
        ("damping", (0.0, math.inf), {"a": 0.5, **RING}, 0.0),
        ("spring", (0.0, math.inf), {"a": 0.5, **RING}, 0.0),
        ("a", (0.0, 5.0), {"a": 0.5, **NEAR}, 0.5),
        # above its fold, also where there is none at what is given
        ("a", (0.0, 5.0), NEAR, 1.5 * smallest_amplitude(0.1, 0.8)),
        ("a", (0.0, 5.0), {"a": 0.85, **NEAR}, 1.5 * smallest_amplitude(0.1, 0.8)),
        ("a", (0.3, 0.7), NEAR, 0.31),
        ("a", (0.79, 5.0), NEAR, 0.79),
        # up to the wall, and where no closed form of the fold is known
        ("a", (2.2, 5.0), {"walls": (-3.0, 3.0), **RING}, 2.255),
        ("a", (0.2, 5.0), {**RING, "lattice": cb.OpenChain(3)}, 0.22),
    ],
)
def test_what_is_given_is_tried_first_then_the_window_all_over(free, within, given, found) -> None:
    assert getattr(find_symmetric(free, within, **given), free) == pytest.approx(found)


def test_a_first_point_is_looked_for_in_the_middle_or_where_that_is_said() -> None:
    plane = {"pair": ("gamma", "a"), "within": {"gamma": (0.0, 0.2)}, "k": 0.8}
    assert find_event("LP", **plane)["gamma"] == 0.1
    for end in (0.0, 0.07, 0.2):
        assert find_event("LP", **plane, gamma=end)["gamma"] == end
    for beyond in (-1e-9, 0.2 + 1e-9):
        with pytest.raises(cb.BadInput, match=r"outside of the window 0 to 0\.2"):
            find_event("LP", **plane, gamma=beyond)


def test_beside_omega_couplings_are_looked_at_up_to_the_band_of_its_highest_value() -> None:
    """At omega = 1.55, the first value looked at, GR is at gamma = 0.56."""
    found = find_event("GR", ("omega", "gamma"), a=0.7, k=0.8)
    unit = found["omega"] ** 2
    own = find_event("GR", ("gamma", "a"), gamma=found["gamma"] / unit, k=0.8)
    assert found["gamma"] > 0.25
    assert own["a"] * unit == pytest.approx(0.7, abs=1e-10)


def test_solutions_are_chosen_by_number_from_one() -> None:
    both = cb.orbits.symmetric_roots(0.5, 0.1, 0.8)
    assert find_symmetric("a", (0.5, 0.5), gamma=0.1, k=0.8, root=2).p == both[1].p
    assert find_symmetric("a", (0.5, 0.5), gamma=0.1, k=0.8).p == both[0].p


@pytest.mark.parametrize(
    ("kind", "given", "words"),
    [
        # the pitchforks of k = 0.8 end at a = 0.8687, on the grazing curve
        (
            "PF",
            {"within": WHERE},
            r"no PF found for gamma between 0 and 0\.24 \(9 values were looked at\)",
        ),
        (
            "LP",
            {"within": {"a": (0.5, 0.6)}, "gamma": 0.1},
            r"no LP found for gamma = 0\.1; the branch in a at gamma = 0\.1 has",
        ),
        (
            "NS",
            {"within": {"a": (0.5, 0.6)}, "gamma": 0.1},
            r"the branch in a at gamma = 0\.1 has EP1, EP2$",
        ),
    ],
)
def test_what_is_found_of_a_kind_that_is_not_there_is_named(kind, given, words) -> None:
    with pytest.raises(cb.NoSolution, match=words):
        find_event(kind, ("gamma", "a"), k=0.8, **given)


def test_out_of_range_everywhere_or_in_a_part_of_the_window_are_two_things() -> None:
    with pytest.raises(cb.BadInput, match=r"gamma = 0\.3: the coupling"):
        find_symmetric("k", (0.0, 1.0), a=0.5, gamma=0.3)
    found = find_symmetric("k", (-1.0, 0.9), a=0.5, gamma=0.1)
    assert 0.0 <= found.k <= 0.9


def test_arms_are_judged_by_the_threshold_of_the_paper_alone() -> None:
    with pytest.raises(cb.BadInput, match=r"threshold = 1\.01: PD is found on arms"):
        find_event("PD", ("gamma", "a"), gamma=0.1, k=0.8, threshold=1.01)


@pytest.mark.parametrize(("kind", "other"), [("PF", "spring"), ("NS", "damping")])
def test_what_need_not_be_there_is_left_out_first(kind: str, other: str) -> None:
    """With a spring of half the window, 5, a mode of the ring is in resonance."""
    found = find_event(kind, (other, "a"), gamma=0.05, k=0.8, lattice=cb.Ring(12))
    assert found[other] == 0.0
    ring = cb.symmetric(0.5, 0.05, 0.8, lattice=cb.Ring(12))
    wanted = cb.trace(ring, "a", towards="both").first(kind)
    assert found["a"] == pytest.approx(wanted["a"], abs=1e-10)


def test_where_nothing_can_be_the_first_refusal_says_why() -> None:
    with pytest.raises(cb.BadInput, match=r"k = 2.0: the restitution coefficient"):
        find_event("PF", ("gamma", "a"), k=2.0)
