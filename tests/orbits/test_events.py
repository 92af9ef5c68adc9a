"""Events of the symmetric breather: found where they are, on any branch, at any step size."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.algebra.newton import Undefined
from contbreather.orbits.asymmetric_breather import symmetric_again
from contbreather.orbits.branch_switching import lift
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.grazing import shallow_impact
from contbreather.orbits.orbit import orbit_at
from contbreather.stability import ns_points
from tests.stability.by_hand import det_by_modes

CHAIN = cb.InfiniteChain()


def kinds(branch: cb.Branch) -> list[str]:
    return [point.kind for point in branch.special]


def only(branch: cb.Branch, *wanted: str) -> list[cb.continuation.Point]:
    return [point for point in branch.special if point.kind in wanted]


FORCINGS: dict[str, dict[str, Any]] = {
    "one": {},
    "two": {"forcing": cb.Symbolic("-cos(t)-c3*cos(3*t)", c3=0.1)},
    "held": {"spring": 0.05},
    "two, held": {"forcing": cb.Fourier(cos={1: 1.0, 3: 0.3}, sin={3: 0.2}), "spring": 0.05},
}
ALONG = {"a": (0.3, 0.8), "gamma": (0.0, 0.16), "omega": (0.85, 1.6)}


@pytest.mark.parametrize("free", ALONG)
@pytest.mark.parametrize("k", [0.6, 1.0])
@pytest.mark.parametrize("on", FORCINGS.values(), ids=FORCINGS)
def test_events_say_of_many_points_what_they_say_of_each(k, on, free) -> None:
    breather = cb.symmetric(0.5, 0.06, k, **on)
    given: dict[str, Any] = {"within": {free: ALONG[free]}, "inadmissible": True}
    branch = cb.trace(breather, free, steps=cb.Steps(largest=0.02), **given)
    points = branch[1:-1].points
    for event in breather.problem.events:
        assert event.many is not None
        tests, counts = event.many(points)
        wanted = [event.value(point) for point in points]
        np.testing.assert_allclose(tests, wanted, rtol=1e-11, atol=1e-13)
        if event.count is not None:
            assert counts is not None
            wanted = [event.count(point) for point in points]
            np.testing.assert_allclose(counts, wanted, rtol=0, atol=1e-13)
        else:
            assert counts is None
    column = branch["unstable"]
    assert column.dtype.kind == "i"
    assert column[1:-1].tolist() == [point["unstable"] for point in points]
    assert branch[3:40:7]["unstable"].tolist() == column[3:40:7].tolist()
    alone = [dataclasses.replace(event, many=None) for event in branch.problem.events]
    again = cb.trace(breather, free, steps=cb.Steps(largest=0.02), events=alone, **given)
    assert [p.label for p in again.special] == [p.label for p in branch.special]
    assert (again[free] == branch[free]).all()


def test_tests_of_many_points_that_do_not_fit_are_refused() -> None:
    branch = cb.trace(cb.symmetric(0.5, 0.06, 0.6), "a", within={"a": (0.3, 0.8)})
    short = cb.Event("UZ", lambda p: p["a"], many=lambda points: (points.z[1:, 2], None))
    with pytest.raises(cb.BadInput, match=r"many of UZ gave arrays of shapes \[\(\d+,\)\]"):
        short.values(branch.points)


def test_events_that_are_looked_for_change_no_point() -> None:
    plain, seen = (
        cb.trace(cb.symmetric(0.5, 0.08, 0.8), "a", within={"a": (0.06, 0.9)}, events=events,
                 inadmissible=True)
        for events in ((), [cb.user("p", 99.0)])
    )  # fmt: skip
    assert np.array_equal(plain["arclength"], seen["arclength"])
    assert np.array_equal(plain["a"], seen["a"])


@pytest.mark.parametrize(("gamma", "k"), [(0.0, 0.8), (0.1, 0.4), (0.2, 0.8)])
@pytest.mark.parametrize("lattice", [CHAIN, cb.Ring(6)])
def test_fold_is_the_closed_form_14(gamma: float, k: float, lattice: Any) -> None:
    q, chi = (1 - k) / (1 + k), lattice.chi(gamma)
    low = q / math.hypot(chi, q)
    start = cb.symmetric(1.2 * low, gamma, k, lattice=lattice)
    branch = cb.trace(start, "a", within={"a": (0, 1.5 * low)})
    fold = branch.first("LP")
    assert fold["a"] == pytest.approx(low, rel=1e-13)
    assert fold["p"] == pytest.approx(chi / (chi**2 + q**2), rel=1e-10)
    assert fold.residual < 1e-14


@pytest.mark.parametrize(("gamma", "k"), [(0.0, 0.8), (0.03, 0.4)])
@pytest.mark.parametrize("lattice", [CHAIN, cb.Ring(6)])
def test_pitchfork_is_the_closed_form(gamma: float, k: float, lattice: Any) -> None:
    q, sigma, chi = (1 - k) / (1 + k), lattice.sigma(gamma), lattice.chi(gamma)
    point = cb.trace(cb.symmetric(0.6, gamma, k, lattice=lattice), "a").first("PF")
    p = 1 / (chi - 2 * sigma)
    assert point["p"] == pytest.approx(p, rel=1e-12)
    assert point["a"] == pytest.approx(p * math.sqrt(q**2 + 4 * sigma**2), rel=1e-12)


@pytest.mark.parametrize(
    ("a", "k", "gamma", "tolerance"),
    [(0.2, 0.8, 0.0969709, 5e-8), (0.5, 0.8, 0.1144314, 5e-8), (0.2, 0.4, 0.1763913, 5e-8)],
)
def test_neimark_sacker_points_of_the_infinite_chain(a, k, gamma, tolerance):
    branch = cb.trace(cb.symmetric(a, gamma - 0.01, k), "gamma", towards="up")
    (point,) = only(branch, "NS")
    assert point["gamma"] == pytest.approx(gamma, abs=tolerance)
    # second way: D itself, as a mean over modes, extrapolated to the circle from outside
    breather, h = point.solution, np.array([0.5e-3, 1e-3, 1.5e-3, 2e-3, 3e-3, 4e-3])
    D = det_by_modes(breather.gamma, point.detail["nu"] - 1j * h, k, breather.b, 20000)
    assert abs(np.polynomial.polynomial.polyfit(h, D, 5)[0]) < 1e-6
    # third way: the angle equation of the arc, with b explicit, solved for this a
    roots = ns_points(breather.gamma, k)
    assert min(abs(root.b - breather.b) for root in roots) < 1e-9


@pytest.mark.parametrize("largest", [0.003, 0.02, 0.1, 0.7])
@pytest.mark.parametrize("first", [0.001, 0.05])
def test_one_neimark_sacker_and_no_other_event_whatever_the_step(largest: float, first: float):
    steps = cb.Steps(first=min(first, largest), largest=largest)
    branch = cb.trace(cb.symmetric(0.2, 0.05, 0.8), "gamma", steps=steps)
    assert kinds(branch) == ["EP", "NS", "GR"]
    assert branch.doubtful == ()
    assert branch.first("NS")["gamma"] == pytest.approx(0.09697094661, abs=1e-10)
    assert branch.first("GR")["gamma"] == pytest.approx(0.2419588395, abs=1e-9)


def test_branch_in_a_meets_both_sides_of_the_neimark_sacker_line() -> None:
    branch = cb.trace(cb.symmetric(0.5, 0.1, 0.8), "a")
    assert kinds(branch) == ["VI", "LP", "NS", "NS", "GR"]
    unstable = branch["unstable"]
    between = (branch["a"] > 0.163) & (branch["a"] < 0.370) & (branch["p"] > 0.52)
    assert (unstable[between] == 2).all()
    assert branch.special[-1]["a"] == pytest.approx(0.806417833236, abs=1e-12)
    assert branch.first("LP")["a"] == pytest.approx(0.057029037182, abs=1e-12)


def by_the_rule(sites: int, gamma: float, end: float, **more: Any) -> cb.Branch:
    """Up from a coupling, with the event of the paper's rule on a ring alone."""
    how = {"events": [cb.neimark_sacker(threshold=1.005)], "towards": "up"}
    start = cb.symmetric(0.2, gamma, 0.8, lattice=cb.Ring(sites))
    return cb.trace(start, "gamma", within={"gamma": (0, end)}, **how, **more)


def on_damped_ring(*, every: bool) -> cb.Branch:
    on: dict[str, Any] = {"lattice": cb.Ring(7), "damping": 0.01}
    event = cb.neimark_sacker(threshold=1.005, every=every)
    start, window = cb.symmetric(0.26, 0.19, 0.957, **on), {"gamma": (0.0, 0.24)}
    return cb.trace(start, "gamma", within=window, events=[event])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("branch", "points"),
    [
        (lambda: by_the_rule(200, 0.08, 0.23), 1),
        (lambda: on_damped_ring(every=False), 1),
        (lambda: on_damped_ring(every=True), 3),
    ],
)
def test_a_pair_that_turns_real_on_a_ring_is_no_neimark_sacker_point(branch, points) -> None:
    found = branch()
    assert kinds(found) == ["EP", *["NS"] * points, "EP"]
    assert not found.doubtful


@pytest.mark.parametrize(
    "asked",
    [
        lambda threshold: cb.symmetric(0.2, 0.08, 0.8).stability(threshold=threshold),
        lambda threshold: cb.zones(k=0.8, threshold=threshold),
        lambda threshold: cb.orbits.find_event("NS", ("gamma", "a"), k=0.8, threshold=threshold),
    ],
)
@pytest.mark.parametrize("threshold", [1.005, 1.01])
def test_the_infinite_chain_has_no_threshold(asked: Any, threshold: float) -> None:
    with pytest.raises(cb.BadInput, match=f"^threshold = {threshold}: the infinite chain has none"):
        asked(threshold)


def test_two_real_multipliers_that_become_a_pair_do_not_end_the_curve_of_another() -> None:
    start, window = cb.symmetric(0.127, 0.057, 0.7656, lattice=cb.Ring(49)), {"gamma": (0, 0.249)}
    event = [cb.neimark_sacker(threshold=1.005)]
    branch = cb.trace(start, "gamma", within=window, events=event)
    second = [point for point in branch.special if point.kind == "NS"][1]
    line = cb.boundary(second, ("gamma", "k"), within=window, towards="down")
    assert not line.doubtful
    ends = second, line.first("NS-NS")
    first, last = (np.sort(abs(end.solution.multipliers()))[::-1] for end in ends)
    assert first[0] > first[1] + 0.1 > 1.2  # real
    assert last[0] == pytest.approx(last[1], abs=1e-9)
    assert last[2:6] == pytest.approx(1.005, abs=1e-8)


def test_a_threshold_on_a_ring_must_exceed_one() -> None:
    start = cb.symmetric(0.5, 0.05, 0.8, lattice=cb.Ring(10))
    with pytest.raises(cb.BadInput, match="above 1"):
        cb.trace(start, "a", events=[cb.neimark_sacker(threshold=1.0)])


@pytest.mark.parametrize("pair", [("k", "a"), ("k", "gamma")])
def test_a_pitchfork_line_goes_to_elastic_impacts(pair: tuple[str, str]) -> None:
    """At k = 1 a pitchfork has f' = 0 there: q = 0 in (11), phi = -pi; the line ends nowhere else
    but where existence ends."""
    start = cb.trace(cb.symmetric(0.8, 0.05, 0.6), "a").first("PF")
    line = cb.boundary(start, pair)
    end = max(line.points, key=lambda point: point["k"])
    assert end["k"] == 1.0
    assert end["phi"] == pytest.approx(-math.pi, abs=1e-12)
    assert not line.stop.failed
    assert line.began is None or not line.began.failed
    sigma = np.array([CHAIN.sigma(gamma) for gamma in np.atleast_1d(line["gamma"])])
    q = (1 - line["k"]) / (1 + line["k"])
    assert np.allclose(line["p"] * np.hypot(q, 2 * sigma), line["a"], rtol=1e-10)


def test_curves_by_second_derivatives_reach_the_edges_of_the_restitution() -> None:
    """Of folds of two sites that move alike, k = 0; of branch points of a whole period, k = 1."""
    two = cb.multibreather([0, 1], a=0.5, gamma=0.01, k=0.3, lattice=cb.Ring(2))
    folds = cb.trace(two, "a", within={"a": (0.3, 0.6)}).first("LP")
    plastic = cb.boundary(folds, ("a", "k"), within={"k": (0, 0.4)}, towards="up")
    whole = cb.shooting(cb.symmetric(0.65, 0, 0.9, lattice=cb.Ring(1)), symmetric=False)
    forks = cb.trace(whole, "a", within={"a": (0.6, 0.7)}).first("BP")
    elastic = cb.boundary(forks, ("k", "a"), within={"k": (0.8, 1)}, towards="up")
    in_closed_form = 1 / math.hypot(1, math.pi / 2), 4 / (math.pi**2 - 4)
    for line, k, a in zip((plastic, elastic), (0.0, 1.0), in_closed_form, strict=True):
        assert (line[-1].kind, line[-1]["k"]) == ("EP", k), line.reason
        assert abs(line[-1]["a"] - a) < 1e-9


@pytest.mark.parametrize("pair", [("k", "a"), ("k", "gamma")])
def test_the_angle_tends_to_the_edge_of_the_band_as_impacts_become_elastic(pair: tuple[str, str]):
    start = cb.trace(cb.symmetric(0.3, 0.05, 0.8), "gamma").first("NS")
    line = cb.boundary(start, pair)
    assert not line.stop.failed
    assert line.began is None or not line.began.failed
    near = [point for point in line.points[1:-1] if 1 - point["k"] < 1e-2]
    gap = [2 * math.sqrt(point["gamma"]) - point["nu"] for point in near]
    law = [value / (1 - point["k"]) ** 2 for value, point in zip(gap, near, strict=True)]
    assert len(law) > 2
    assert np.ptp(law) < 0.02 * max(law)


def test_grazing_is_followed_up_to_the_rim_of_the_coupling() -> None:
    """The derivative of u_1 in gamma grows without limit there."""
    start = cb.trace(cb.symmetric(0.3, 0.1, 0.7), "gamma").first("GR")
    line = cb.boundary(start, ("gamma", "a"))
    assert line[-1]["gamma"] == 0.2499
    assert not line.stop.failed
    assert line[-1].solution.admissibility().max_neighbour == pytest.approx(1.0, abs=1e-10)


@pytest.mark.slow
def test_the_line_of_the_papers_rule_ends_where_another_wave_comes_first() -> None:
    """On the traced arc the largest complex multiplier over 2 pi has the modulus of the threshold;
    at its ends two pairs have."""
    ring, threshold = cb.Ring(60), 1.005

    def pairs(point: cb.continuation.Point) -> np.ndarray:
        mu = point.solution.stability(sites=60, threshold=1 + 1e-9).multipliers
        return np.sort(abs(mu[mu.imag > 1e-9]))[::-1]

    event = cb.neimark_sacker(threshold=threshold)
    start = cb.symmetric(0.2, 0.05, 0.8, lattice=ring)
    start = cb.trace(start, "gamma", events=[event]).first("NS")
    line = cb.boundary(start, ("gamma", "a"))
    assert len(line) > 10
    assert np.allclose([pairs(point)[0] for point in line], threshold, rtol=0, atol=1e-10)
    for end in (line[0], line[-1]):
        assert end.kind == "NS-NS"
        first, second, third = pairs(end)[:3]
        assert first == pytest.approx(second, abs=1e-9)
        assert third < threshold - 1e-5


def test_curves_of_two_pairs_of_a_damped_ring_meet_where_either_has_the_other_beside_it() -> None:
    """On either curve: from branches at two couplings, each of which begins with another pair."""
    circle, window = cb.neimark_sacker(threshold=1), {"gamma": (0.07, 0.13), "damping": (0.01, 0.1)}
    meetings = []
    for gamma in (0.08, 0.12):
        start = cb.symmetric(0.4, gamma, 0.9, damping=0.1, lattice=cb.Ring(15))
        branch = cb.trace(start, "damping", within=window, events=[circle], towards="down")
        curve = cb.boundary(branch.first("NS"), ("gamma", "damping"), within=window)
        assert [point.kind for point in curve.special] == ["EP", "NS-NS", "EP"]
        assert not curve.doubtful
        meetings.append(curve.first("NS-NS"))
        # the first outside is the pair whose side it is
        for point in curve:
            alone = abs(point.solution.multipliers()).max() < 1 + 1e-8
            there = (point["gamma"] < meetings[-1]["gamma"]) == (gamma == 0.08)
            assert alone == (there or point.kind == "NS-NS")
    one, other = ([point["gamma"], point["damping"]] for point in meetings)
    assert one == pytest.approx(other, abs=1e-10)
    mu = np.sort(abs(meetings[0].solution.multipliers()))[::-1]
    assert mu[:4] == pytest.approx(1, abs=1e-10)
    assert mu[4] < 0.99


@pytest.mark.parametrize("gamma", [0.01, 0.03, 0.1])
def test_elastic_impacts_lose_stability_where_the_count_jumps(gamma: float) -> None:
    branch = cb.trace(cb.symmetric(0.3, gamma, 1.0), "a", within={"a": (0.05, 1.0)})
    point = branch.first("NS")
    beside = [
        cb.symmetric(point["a"] + shift, gamma, 1.0).stability().unstable for shift in (-1e-8, 1e-8)
    ]
    assert beside == [0, 2]
    assert not branch.doubtful


# --- where there is nothing to follow -------------------------------------------------------------


def event_of(problem: Any, kind: str) -> Any:
    return next(event for event in problem.events if event.kind == kind)


def test_what_cannot_be_followed_from_a_point_says_why() -> None:
    near = {"a": (0.74, 0.76)}
    alike = cb.trace(cb.symmetric(0.75, 0.0, 0.8, lattice=cb.Ring(1)), "a", within=near)
    ring = event_of(alike.problem, "NS")
    shot = cb.trace(cb.shooting(cb.symmetric(0.75, 0.0, 0.8), sites=1), "a", within=near)
    near = {"a": (0.81, 0.83)}
    arm = cb.trace(asymmetric(0.82, 0.04, 0.8).problem, "a", within=near)
    alone = cb.trace(asymmetric(0.82, 0.0, 0.8).problem, "a", within=near)
    plastic = cb.trace(
        cb.shooting(cb.symmetric(0.55, 0.0, 0.0), sites=1), "a", within={"a": (0.55, 0.56)}
    )
    for what, words in (
        (lambda: ring.locus(alike[0]), "no complex multipliers on this"),
        (lambda: event_of(shot.problem, "NS").locus(shot[0]), "no complex multipliers on this"),
        (lambda: event_of(alone.problem, "NS").locus(alone[0]), "no band for a pair to come out"),
        (lambda: symmetric_again(arm[0]), "the flights are not equal here"),
        (lambda: shallow_impact(plastic[0].solution), "with k = 0 a site rests on its wall"),
    ):
        with pytest.raises(Undefined, match=words):
            what()
    assert event_of(arm.problem, "NS").locus(arm[0]).extra["nu"] > 0.0
    # an impact that is slow is another matter
    assert shallow_impact(shot[0].solution).extra == {}


def test_a_pair_without_an_angle_is_none_but_where_impacts_are_elastic() -> None:
    event = event_of(cb.symmetric(0.5, 0.05, 0.8).problem, "NS")
    for k, words in ((0.8, "no angle solves the locus"), (1.0, "")):
        (start, *_) = cb.trace(cb.symmetric(0.5, 0.05, k), "a", within={"a": (0.49, 0.51)})
        assert event.examine(start).endswith(words)
        assert (event.examine(start) == "") == (k == 1.0)


def test_only_orbits_with_impacts_have_longer_ones_beside_them() -> None:
    grown = cb.FixedPoint(lambda x, p: p["r"] * x * (1 - x), {"x": 0.6}, {"r": 2.9})
    branch = cb.trace(grown, "r", within={"r": (2.9, 3.1)}, events=[cb.period_doubling()])
    with pytest.raises(cb.BadInput, match=r"PD1.* is on no branch of orbits with impacts"):
        lift(branch.first("PD"))


def test_at_elastic_impacts_no_pair_leaves_along_the_curve_of_pitchforks() -> None:
    """There the window of a pair ends at the pitchfork: how far off it is rounding all along."""
    forcing = cb.Fourier(cos={1: -1.0, 3: 0.0306}, sin={3: 0.269})
    start = cb.symmetric(0.6, 0.0395, 1.0, forcing=forcing)
    fork = cb.trace(start, "a", within={"a": (0.5, 0.95)}).first("PF")
    line = cb.boundary(fork, ("gamma", "a"), within={"gamma": (0, 0.24)})
    assert [point.kind for point in line.special] == ["EP", "PF-GR"]
    assert line.doubtful == ()


# --- asked for by name ----------------------------------------------------------------------------


def on_ring(orbit: cb.Orbit) -> cb.Orbit:
    return orbit_at(cb.shooting(orbit, sites=20))


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (cb.pitchfork, "PF", "only a symmetric orbit, known by half its period, has a pitchfork"),
        (
            cb.period_doubling,
            "PD",
            "maps and orbits have one, symmetric orbits after they broke their symmetry (PF)",
        ),
        (cb.neimark_sacker, "NS", "a complex pair is looked for in the map of an orbit"),
        (cb.grazing, "GR", "only what moves between walls can graze them"),
    ],
)
def test_what_is_no_orbit_has_none_of_them(make: Any, kind: str, words: str) -> None:
    line = cb.Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0}, label="a line")
    with pytest.raises(cb.BadInput) as refused:
        cb.trace(line, "mu", events=[make()])
    assert str(refused.value) == f"no {kind} of this problem (a line, no events): {words}."


@pytest.mark.parametrize("arm", [False, True])
@pytest.mark.parametrize("shot", [False, True])
def test_another_threshold_has_its_own_point_and_column(arm: bool, shot: bool) -> None:
    orbit = asymmetric(0.8, 0.04, 0.8) if arm else cb.symmetric(0.66, 0.04, 0.8)
    orbit = on_ring(orbit) if shot else orbit.on(cb.Ring(20))
    event = cb.neimark_sacker(threshold=1.0048)
    branch = cb.trace(orbit, "a", events=[event], within={"a": (0.66, 0.9)})
    point = branch.first("NS")
    size = np.abs(point.solution.multipliers())
    assert np.abs(size - 1.0048).min() < 1e-9
    last = branch[-1]
    assert last["unstable"] == last.solution.stability(threshold=1.0048).unstable


def test_a_branch_says_what_ended_it(tmp_path: Path) -> None:
    """By the profile: the site that is named is on a wall at the time that is said, in a file too;
    the other end has p = 0."""
    found = cb.trace(cb.symmetric(a=0.5, gamma=0.1, k=0.01), "a", within={"a": (0.01, 2.0)})
    cb.save(tmp_path / "run.nc", found)
    for branch in (found, found.reversed(), cb.load(tmp_path / "run.nc")):
        reasons = {branch[0].kind: branch.began_reason, branch[-1].kind: branch.reason}
        assert reasons["VI"].startswith("the impact of site 0 itself vanishes")
        ((site, time),) = re.findall(r"site (\d) .* at t = (\S+?)\.?$", reasons["GR"])
        breather = branch.first("GR").solution
        assert abs(breather.displacement(int(site), float(time))) == pytest.approx(1.0, abs=1e-8)
        assert abs(branch.first("VI")["p"]) < 1e-9
