"""Both arms of the pitchfork: figures known from elsewhere, ends, events, boundaries, refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from contbreather.continuation import Steps, Stop, boundary, trace
from contbreather.continuation.branches.switching import switch
from contbreather.errors import BadInput, NoSolution, NotConverged
from contbreather.lattice import Fourier, InfiniteChain, Ring
from contbreather.orbits import neimark_sacker, pitchfork, symmetric
from contbreather.orbits.asymmetric_breather import AsymmetricEquations
from contbreather.orbits.branch_switching import lift
from contbreather.orbits.clearance import Inadmissible
from contbreather.orbits.constructors import asymmetric, shooting
from contbreather.orbits.orbit import Orbit, orbit_at
from contbreather.orbits.symmetries import simpler_than

from .by_hand import derivatives, started_on_arm

RICH = Fourier(cos={1: -1.0, 3: 0.1}, sin={1: 0.1, 5: -0.3})


@cache
def pitchfork_point(gamma, k, lattice=InfiniteChain(), **options):
    start, window = symmetric(0.6, gamma, k, lattice=lattice), {"a": (0, 0.99)}
    branch = trace(start, "a", towards="up", within=window, events=[pitchfork()], **options)
    return branch.first("PF")


@cache
def arms(gamma, k, lattice=InfiniteChain(), top=0.999):
    return switch(pitchfork_point(gamma, k, lattice), within={"a": (0, top)})


# --- the equations --------------------------------------------------------------------------------


@pytest.mark.parametrize("lattice", [InfiniteChain(), Ring(3)])
@pytest.mark.parametrize("delta", [-0.7, 1e-3, 0.0, 0.3])
def test_derivatives_are_those_of_the_residual_also_where_flights_are_equal(lattice, delta):
    equations = AsymmetricEquations(RICH, lattice)
    params = {"a": 0.8, "gamma": 0.1, "k": 0.7, **RICH.params}
    x = np.array([1.1, -2.9, -2.9 + math.pi + delta, 0.05])
    for name, found, wanted in derivatives(equations, x, params, 2e-4):
        assert np.abs(found - wanted).max() < (1e-9 if name else 2e-10)


# --- figures --------------------------------------------------------------------------------------


def test_with_coupling_the_neighbour_ends_the_arm_before_that():
    for arm in (*arms(0.04, 0.8), shot_arm(0.04, 0.8)):
        assert [point.kind for point in arm.special if point.kind != "NS"] == ["EP", "GR"]
        assert arm.stop.name == "EVENT"
        end = arm[-1].solution
        assert end.a == pytest.approx(0.877387, abs=5e-7)
        margins = end.admissibility()
        assert abs(margins.margin) < 1e-13
        assert margins.site == 1
        assert abs(end.velocity(1, margins.time)) < 1e-12
        assert abs(end.displacement(1, margins.time)) == pytest.approx(1, abs=1e-13)
        assert "site 1 reaches |u| = 1" in margins.reason
        n, t = np.arange(1, 20)[:, None], np.linspace(0, 2 * math.pi, 4001)
        assert np.abs(end.displacement(n, t)).max() < 1 + 1e-9


@cache
def shot_arm(gamma, k, sites=20):
    """An arm of the infinite chain, shot on a ring."""
    start = shooting(arms(gamma, k)[0][3], sites=sites)
    return trace(start, "a", towards="up", within={"a": (0.5, 1.2)})


@pytest.mark.slow
@pytest.mark.parametrize("sites", [None, 20])
def test_doubling_and_grazing_meet_in_the_same_point_from_both_sides(sites):
    """At k = 0.95 PD comes before grazing for gamma < 0.0130085, where both meet."""
    arm = shot_arm(0.005, 0.95, sites) if sites else arms(0.005, 0.95)[0]
    assert [point.kind for point in arm.special if point.kind != "NS"] == ["EP", "PD", "GR"]
    within = {"gamma": (0.001 if sites else 0.0, 0.02), "a": (0, 1.2)}
    doubling, grazing = (
        boundary(arm.first(kind), ("gamma", "a"), within=within) for kind in ("PD", "GR")
    )
    one, other = doubling.first("PD-GR"), grazing.first("GR-PD")
    assert one["gamma"] == pytest.approx(0.0130085246308, abs=1e-11)
    assert one["a"] == pytest.approx(0.9545786040, abs=1e-9)
    assert (one["gamma"], one["a"]) == pytest.approx((other["gamma"], other["a"]), abs=1e-10)
    assert doubling["gamma"].min() == within["gamma"][0]
    for point in doubling:
        orbit = orbit_at(point.base_point.problem)
        off = np.abs(orbit.multipliers() + 1).min() if sites else orbit.map.crosses(-1.0)
        assert abs(off) < (1e-8 if sites else 1e-10)
    for point in grazing[1:-1]:
        t = np.linspace(point["t"] - 1e-3, point["t"] + 1e-3, 2001)
        height = np.abs(point.base_point.solution.displacement(1, t)).max()
        assert height == pytest.approx(1.0, abs=1e-10)
    assert abs(orbit_at(one.base_point.problem).admissibility().margin) < 1e-9
    assert orbit_at(doubling[len(doubling) // 2].base_point.problem).admissibility().ok


# --- arms and their pitchfork ---------------------------------------------------------------------


@cache
def arm_back():
    return trace(asymmetric(0.8, 0.04, 0.8), "a", towards="down", within={"a": (0.7, 0.81)})


def test_following_an_arm_back_finds_the_pitchfork_and_goes_through():
    there_and_beyond = arm_back()
    points = [point for point in there_and_beyond.special if point.kind == "PF"]
    assert len(points) == 1
    assert points[0].located
    assert points[0]["a"] == pytest.approx(0.777632425944, abs=1e-12)
    # the branch turns back there, but that is no fold of its own
    assert [point.kind for point in there_and_beyond.special] == ["EP", "PF", "EP"]
    assert not there_and_beyond.doubtful
    asymmetry = there_and_beyond["asymmetry"]
    assert asymmetry[0] * asymmetry[-1] < 0
    breathers = switch(points[0], events=(), within={"a": (0.75, 0.79)})
    assert sorted(branch[-1]["a"] for branch in breathers) == [0.75, 0.79]
    for branch in breathers:
        b = branch[-1].solution
        assert b.p == pytest.approx(symmetric(b.a, 0.04, 0.8).p, abs=1e-12)
    # from there both arms start again
    known = simpler_than(points[0].solution)
    symmetric_branch = trace(known, "a", within={"a": (0.77, 0.79)}, events=[pitchfork()])
    one, other = switch(symmetric_branch.first("PF"), within={"a": (0, 0.999)})
    assert other.image_of == 0
    assert one[-1]["a"] == pytest.approx(arms(0.04, 0.8)[0][-1]["a"], abs=1e-12)


@pytest.mark.parametrize("gamma", [0.0, 0.025])
@pytest.mark.parametrize("k", [0.4, 0.8, 1.0])
def test_at_a_pitchfork_breather_and_arm_count_alike(gamma, k):
    """The multiplier on the circle is not outside, either way, and neither is certain."""
    point = pitchfork_point(gamma, k)
    verdicts = [one.stability() for one in (point.solution, point.solution.unfolded())]
    assert [one.unstable for one in verdicts] == [0, 0]
    assert not any(one.certain for one in verdicts)
    assert point["unstable"] == switch(point, events=(), steps=Steps(most=1))[0][0]["unstable"] == 0


def test_only_a_located_pitchfork_or_doubling_is_lifted():
    start = symmetric(0.7, 0.04, 0.8)
    branch = trace(start, "a", towards="up", within={"a": (0, 0.9)})
    fork, arm = branch.first("PF"), shot_arm(0.04, 0.8)[2]
    near = trace(start, "a", within={"a": (0.7, fork["a"] - 1e-4)})[-1]
    for point, refusal, sentence in (
        (branch[0], BadInput, r"a EP: a located PF or PD of a branch of orbits was expected"),
        (branch[1], BadInput, "not a special point"),
        (replace(fork, located=False), BadInput, "not located"),
        (replace(near, kind="PF"), NotConverged, "is not a PF"),
        (replace(fork, kind="PD"), BadInput, "break its symmetry first"),
        (replace(arm, kind="PD"), NotConverged, "is not a PD"),
        (replace(arm, kind="PF"), BadInput, "other orbits have period doublings"),
    ):
        with pytest.raises(refusal, match=sentence):
            lift(point)


def test_asymmetric_breathers_are_found_or_the_sentence_says_where_they_are():
    for arm in (1, -1):
        orbit = asymmetric(0.85, 0.02, 0.8, arm=arm)
        assert orbit.a == 0.85
        assert orbit.asymmetry * arm > 0
        assert orbit.residual < 1e-14
    near = asymmetric(0.777632425944 + 1e-8, 0.04, 0.8)
    assert near.asymmetry**2 / 1e-8 == pytest.approx(8.7615, rel=1e-3)
    with pytest.raises(NoSolution, match=r"pitchforks at a = 0\.777632 \(upwards\)"):
        asymmetric(0.7, 0.04, 0.8)
    with pytest.raises(Inadmissible, match=r"a = 0\.95 .*no breather.* inadmissible=True") as found:
        asymmetric(0.95, 0.04, 0.8)
    beyond, error = asymmetric(0.95, 0.04, 0.8, inadmissible=True), found.value
    assert (error.orbit, error.site, beyond.admissibility().ok) == (beyond, 1, False)
    assert abs(beyond.displacement(1, error.time)) > 1.09
    with pytest.raises(BadInput, match="arm must be 1 or -1, got 2"):
        asymmetric(0.82, 0.04, 0.8, arm=2)
    with pytest.raises(BadInput, match="unknown forcing parameter 'c3'"):
        AsymmetricEquations().sensitivity(
            np.array([1.0, 0.0, 3.0, 0.0]), {"a": 1, "gamma": 0, "k": 0.8}, "c3"
        )
    with pytest.raises(BadInput, match=r"t1 < t2 < t1 \+ 2 pi"):
        AsymmetricEquations().residual(
            np.array([1.0, 0.0, 7.0, 0.0]), {"a": 1, "gamma": 0, "k": 0.8}
        )


# --- events and boundaries ------------------------------------------------------------------------


def test_pitchfork_line_of_the_arms_is_that_of_symmetric_breathers():
    line = boundary(arm_back().first("PF"), ("gamma", "a"), within={"gamma": (0, 0.2)})
    sigma = [InfiniteChain().sigma(gamma) for gamma in line["gamma"]]
    chi = [InfiniteChain().chi(gamma) for gamma in line["gamma"]]
    p = 1 / (np.array(chi) - 2 * np.array(sigma))
    assert np.abs(line["p"] - p).max() < 1e-9
    assert np.abs(line["a"] - p * np.sqrt(1 / 81 + 4 * np.array(sigma) ** 2)).max() < 1e-9
    assert line["gamma"].min() == 0.0
    # it ends where the symmetric breather itself grazes: on both boundaries the same point
    assert line.first("PF-GR")["gamma"] == pytest.approx(0.071775, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("shot", [False, True])
def test_grazing_line_ends_where_pitchfork_and_grazing_of_the_symmetric_breather_meet(shot):
    """Beyond it only the traced crest would touch its wall and the other one be inside it."""
    arm = shot_arm(0.04, 0.8) if shot else arms(0.04, 0.8)[0]
    within = {"gamma": (0.02 if shot else 0.0, 0.2), "a": (0, 1)}
    line = boundary(arm.first("GR"), ("gamma", "a"), within=within)
    assert (line.special[-1].label, line.stop) == ("GR-PF1", Stop.EVENT)
    assert line["gamma"].min() == within["gamma"][0]
    end, forks = line[-1], boundary(pitchfork_point(0.04, 0.8), ("gamma", "a"))
    meeting = forks.first("PF-GR")
    assert meeting["gamma"] == pytest.approx(0.0717745352, abs=1e-9)
    assert (end["gamma"], end["a"]) == pytest.approx((meeting["gamma"], meeting["a"]), abs=1e-11)
    for point in line[1:-1]:
        margins = orbit_at(point.base_point.problem).admissibility()
        assert margins.margin > -1e-9
        assert abs(margins.neighbours) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("largest", [0.1, 0.02])
def test_grazing_lines_of_both_arms_end_at_their_pitchfork_by_one_name(largest):
    """Nothing but rounding is left there of the asymmetry and of the margin of the mirrored crest;
    neither arm nor step may decide what the end is called."""
    ends = []
    for arm in arms(0.005, 0.95):
        line = boundary(
            arm.first("GR"),
            ("gamma", "a"),
            within={"gamma": (0.0, 0.2), "a": (0.05, 1.2)},
            towards="up",
            steps=Steps(largest=largest),
        )
        assert [point.kind for point in line.special[-2:]] == ["GR-NS", "GR-PF"]
        ends.append(line[-1])
        assert line[-1].residual < 1e-12
        assert abs(line[-1].base_point.solution.asymmetry) < 1e-12
    assert ends[0]["gamma"] == pytest.approx(ends[1]["gamma"], abs=1e-11)


@cache
def pair_of_an_arm_in_k():
    """Where a pair leaves the circle on the way to elastic impacts."""
    branch = trace(symmetric(0.82, 0.04, 0.57), "k", within={"k": (0.5, 0.99)})
    return switch(branch.first("PF"), within={"k": (0.5, 0.99)})[0].first("NS")


@pytest.mark.slow
def test_neimark_sacker_line_of_an_arm_ends_beside_elastic_impacts_at_the_pitchfork():
    """Angle and asymmetry shrink like the root of 1 - k: the line ends at a bound, not in rounding,
    and there it is as close to the pitchfork of elastic impacts as it has to be."""
    line = boundary(pair_of_an_arm_in_k(), ("k", "a"), within={"k": (0.97, 1.0)}, events=())
    assert line.stop is Stop.BOUND
    assert line[-1]["k"] == 1.0 - 1e-5
    assert "domain of k" in line.reason
    elastic = trace(symmetric(0.7, 0.04, 1.0), "a", within={"a": (0.7, 0.8)}).first("PF")
    assert line[-1]["a"] == pytest.approx(elastic["a"], abs=5e-5)
    roots = [abs(p["asymmetry"]) / math.sqrt(1 - p["k"]) for p in line.points[-3:]]
    assert roots == pytest.approx([roots[-1]] * 3, rel=0.01)


@pytest.mark.slow
def test_neimark_sacker_line_in_k_and_gamma_follows_the_edge_of_the_band_to_elastic_impacts():
    """One of its ends is the pitchfork; at the other the angle comes as close to the edge of the
    band as (1 - k)^2, nearer than any fixed step of a difference could stay off it."""
    line = boundary(pair_of_an_arm_in_k(), ("k", "gamma"), within={"k": (0.95, 1.0)}, events=())
    assert (line.began, line.stop) == (Stop.BOUND, Stop.BOUND)
    assert line[0]["k"] == line[-1]["k"] == 1.0 - 1e-5
    near = [
        (4.0 * math.sqrt(point["gamma"]) - point["nu"]) / (1.0 - point["k"]) ** 2
        for point in line.points[: len(line) // 2]
        if 3e-5 < 1.0 - point["k"] < 2e-3
    ]
    assert len(near) > 2
    assert near == pytest.approx([near[0]] * len(near), rel=0.01)


def test_a_pair_leaves_the_circle_where_its_locus_says():
    point = pitchfork_point(0.06, 0.95, inadmissible=True)
    arm = switch(point, events=[neimark_sacker()], within={"a": (0, 0.95)})[0]
    assert arm["margin"][-1] < 0 < arm["margin"][0]
    event = arm.first("NS")
    nu = event.detail["nu"]
    assert 0 < nu < 1
    map = event.solution.map
    assert abs(map.F(np.array([0.5 * nu]))[0]) < 1e-11
    window = {"a": (event["a"] - 1e-4, event["a"] + 1e-4)}
    before, after = (
        trace(event, "a", events=(), within=window, inadmissible=True)[i] for i in (0, -1)
    )
    assert before.solution.map.count().count == 0
    assert after.solution.map.count().count == 2
    mu = after.solution.map.unstable_multipliers()
    assert np.abs(np.angle(mu)).max() / math.pi == pytest.approx(nu, abs=2e-2)
    line = boundary(event, ("gamma", "a"), events=(), within={"gamma": (0.055, 0.065)})
    assert len(line) > 4
    for point in (line[0], line[-1]):
        F = orbit_at(point.base_point.problem).map.F(np.array([0.5 * point["nu"]]))
        assert abs(F[0]) < 1e-9


@pytest.mark.slow
def test_neimark_sacker_line_of_an_arm_runs_from_grazing_to_grazing():
    """Found once on the branch; its line ends where the line of grazing meets it."""
    arm = arms(0.034, 0.95)[0]
    assert [point.kind for point in arm.special] == ["EP", "NS", "GR"]
    within = {"gamma": (0, 0.25), "a": (0, 1.2)}
    line = boundary(arm.first("NS"), ("gamma", "a"), within=within)
    assert [point.label for point in line.special] == ["NS-GR1", "NS-GR2"]
    grazing = boundary(arm.first("GR"), ("gamma", "a"), within=within)
    for label in ("1", "2"):
        one, other = line.first(f"NS-GR{label}"), grazing.first(f"GR-NS{label}")
        assert (one["gamma"], one["a"]) == pytest.approx((other["gamma"], other["a"]), abs=1e-9)


def on_ring_of_one(orbit):
    flight = orbit.representation
    return Orbit(replace(flight, conditions=replace(flight.conditions, lattice=Ring(1))))


BENT = Fourier(cos={1: -1.0, 3: -0.45, 5: 0.5})


@cache
def subcritical_arm():
    branch = trace(symmetric(0.6, 0.01, 0.95, forcing=BENT), "a", within={"a": (0.3, 0.9)})
    return switch(branch.first("PF"), within={"a": (0.3, 0.9)})[0]


@pytest.mark.slow
def test_fold_line_of_a_subcritical_arm():
    """Harmonics that make the pitchfork subcritical: the arm turns back at a fold, on its line up
    to where the neighbour grazes and down to single oscillators."""
    arm = subcritical_arm()
    assert arm.origin["criticality"] == "subcritical"
    assert [point.kind for point in arm.special][:3] == ["EP", "LP", "PD"]
    turn = arm.first("LP")
    assert turn["a"] == arm["a"].min()
    line = boundary(turn, ("gamma", "a"), within={"gamma": (0, 0.2), "a": (0, 1.2)})
    assert [point.label for point in line.special] == ["EP1", "LP-GR1"]
    single = on_ring_of_one(line[0].base_point.solution)  # the same without coupling
    assert line[0]["gamma"] == 0.0
    assert np.abs(single.multipliers() - 1).min() < 1e-9
    for point in line[::4]:
        orbit = point.base_point.solution
        assert orbit.admissibility().margin > -1e-12


@pytest.mark.slow
def test_fold_line_of_an_arm_meets_its_mirror_image_at_the_pitchfork():
    """There the pitchfork changes its criticality; no cusp, though two folds of arms meet."""
    turn = subcritical_arm().first("LP")
    line = boundary(turn, ("k", "a"), within={"k": (0.75, 0.96), "a": (0, 1.2)}, towards="down")
    assert [point.kind for point in line.special] == ["EP", "CP", "LP-PF", "CP", "EP"]
    meeting = line.first("LP-PF")
    near = symmetric(meeting["a"] - 0.02, 0.01, meeting["k"], forcing=BENT)
    fork = trace(near, "a", within={"a": (0.6, 0.7)}).first("PF")
    assert fork["a"] == pytest.approx(meeting["a"], abs=1e-8)
    assert abs(fork["coefficient"]) > 1e6  # of asymmetry^2 over distance: a pole there


def test_doubling_line_reaches_elastic_impacts():
    """At k = 1 all multipliers are on the circle; over a stretch F is rounding."""
    line = boundary(
        arms(0.005, 0.95)[0].first("PD"), ("k", "a"), within={"k": (0.93, 1.0)}, towards="up"
    )
    assert line[-1]["k"] == 1.0
    assert line[-1].solution.map.count().certain is False


@pytest.mark.parametrize("shot", [False, True])
def test_neimark_sacker_line_of_an_arm_on_a_ring_keeps_a_pair_at_the_threshold(shot):
    arm = asymmetric(0.82, 0.03, 0.8, lattice=Ring(9))
    start = shooting(arm) if shot else arm.problem
    event = trace(start, "gamma", towards="down", within={"gamma": (0.01, 0.03)}).first("NS")
    line = boundary(event, ("a", "gamma"), events=(), within={"a": (0.815, 0.825)})
    assert [line["a"].min(), line["a"].max()] == [0.815, 0.825]
    for point in line:
        mu = point.base_point.solution.multipliers()
        wanted = 1.005 * np.exp(1j * math.pi * point["nu"])
        assert abs(mu - wanted).min() < 1e-10


def test_an_amplitude_at_which_no_breather_is_found_is_refused() -> None:
    """With what is left; some solutions of the equations have their impacts in another order."""
    chain = lift(trace(symmetric(0.6, 0.04, 0.8), "a").first("PF"))
    start = shooting(symmetric(0.66, 0.04, 0.8, lattice=Ring(8)))
    shot = lift(trace(start, "a", towards="up", within={"a": (0.0, 0.9)}).first("PF"))
    for lifted, amplitude, why in (
        (chain, 2.0, "no orbit at the amplitude 2.*amplitude of the forcing"),
        (chain, 2.5, "no orbit at the amplitude 2.5.*must follow the one on"),
        (shot, -3.0, "is no orbit of .* ring of 8.* out of order"),
    ):
        with pytest.raises(NotConverged, match=why):
            lifted.arm(amplitude)
    assert orbit_at(started_on_arm(chain, 0.3)).asymmetry == pytest.approx(0.3, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("side", [0, 1])
def test_where_an_arm_begins_a_ring_has_a_verdict_too(side) -> None:
    """The matrix is singular there: Newton's iteration would leave a start that is a solution."""
    fork = trace(symmetric(a=0.7, gamma=0.04, k=0.8), "a").first("PF")
    first, second = (point.solution for point in switch(fork)[side].points[:2])
    verdicts = [orbit.stability(sites=400) for orbit in (first, second)]
    assert [verdict.stable for verdict in verdicts] == [True, True]
    assert verdicts[0].largest == pytest.approx(verdicts[1].largest, abs=1e-3)
