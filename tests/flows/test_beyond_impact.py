"""Cycles beyond GR and VI at rigid walls: one impact more, one impact less."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import contbreather as cb
from contbreather.flows import cycle_of

from .zoo import across, van_der_pol

TAU = 2 * np.pi
ON = {"c": 0.1, "k": 0.6, "w": 3.0, "s": 0.2}


def field(t: Any, x: Any, p: Any) -> Any:
    return [x[1], -p["c"] * x[1] - x[0] + np.cos(p["w"] * t)]


def rebound(t: Any, x: Any, p: Any) -> Any:
    return [x[0], -p["k"] * x[1]]


def right(t: Any, x: Any, p: Any) -> Any:
    return p["s"] - x[0]


def left(t: Any, x: Any, p: Any) -> Any:
    return p["s"] + 0.05 + x[0]


def period(p: Any) -> Any:
    return TAU / p["w"]


HIT, OTHER = (cb.Flow(field, until=wall, reset=rebound) for wall in (right, left))


def amplitude(c: float, w: float) -> float:
    return 1 / abs(1 - w * w + 1j * c * w)


def without_impacts(walls: Any, **on: float) -> cb.Problem:
    p = {**ON, **on}
    x = 1 / (1 - p["w"] ** 2 + 1j * p["c"] * p["w"])
    start = {"x": x.real, "v": -p["w"] * x.imag}
    return cb.cycle(cb.Flow(field, walls=walls), start, p, period=period)


def impulses(c: float, k: float, w: float, s: float) -> np.ndarray:
    """Those of all orbits of one impact a period: the forced motion less J times the response g to
    an impulse each period, so that ``s + J g`` and ``J (g' - k/(1 + k))`` at the impact are its
    displacement and velocity, of which the amplitude is known."""
    g, slope = np.linalg.solve(np.eye(2) - expm(np.array([[0, 1], [-1, -c]]) * TAU / w), [0, 1])
    square = g**2 + ((slope - k / (1 + k)) / w) ** 2
    return np.roots([square, 2 * s * g, s**2 - amplitude(c, w) ** 2])


def misses(orbit: cb.flows.Cycle, walls: Any = None) -> float:
    """How far off each flow arrives, by Dormand and Prince and the first of the walls that is met,
    unless said that of the flow alone."""
    p, worst = orbit.params, 0.0
    for i, (flow, flight) in enumerate(zip(orbit.equations.flows, orbit.flights, strict=True)):
        watched = [lambda t, x, w=w: w(t, x, p) for w in walls or (flow.until,)]
        for wall in watched:
            wall.terminal, wall.direction = True, -1.0  # type: ignore[attr-defined]
        run = solve_ivp(
            lambda t, x, f=flow.f: f(t, x, p), (flight.start, flight.last + 1), flight.states[0],
            "DOP853", events=watched, rtol=1e-13, atol=1e-13, max_step=0.02,
        )  # fmt: skip
        end = run.y[:, -1]
        after = orbit.flights[i - len(orbit.flights) + 1].states[0]
        off = [*((flow.reset(0, end, p) if flow.reset else end) - after), run.t[-1] - flight.last]
        worst = max(worst, *map(abs, off))
    return worst


def hard(branch: cb.Branch) -> list[cb.flows.Cycle]:
    """Orbits whose impacts are hard enough for the integrator of the test to see them."""
    orbits = [point.solution for point in branch]
    return [o for o in orbits if min(flight.end[1] ** 2 for flight in o.flights) > 1e-3]


@cache
def first_impact(w: float) -> tuple[Any, ...]:
    """Start without impacts, and follow it to where it touches the wall and beyond."""
    reach = amplitude(ON["c"], w)
    start, within = without_impacts(HIT, w=w, s=1.2 * reach), {"s": (0.3 * reach, 1.5 * reach)}
    return reach, start, within, *across(start, "s", "GR", within, towards="down")


def test_a_diagram_goes_beyond_the_first_impact() -> None:
    """When it is asked to."""
    _, start, within, grazing, arm = first_impact(3.0)
    asked = {"within": within, "depth": 1}
    assert len(cb.diagram(start, "s", **asked)) == 1
    tree = cb.diagram(start, "s", **asked, beyond=True)
    assert tree.failed == ()
    (birth,) = tree.births[1:]
    assert birth.place.point["s"] == pytest.approx(grazing["s"], rel=1e-9)
    assert [point.label for point in tree[1].special] == [point.label for point in arm.special]


@pytest.mark.parametrize(("w", "beyond"), [(3.0, "persists"), (1.5, "fold")])
def test_the_first_impact_is_that_of_the_closed_form(w: float, beyond: str) -> None:
    reach, _, _, grazing, arm = first_impact(w)
    assert grazing["s"] == pytest.approx(reach, rel=1e-9)
    assert (arm[0]["beyond"], arm[0].parent) == (beyond, grazing)
    assert arm[0]["s"] == pytest.approx(reach, rel=1e-9)
    # how many there are with the wall nearer, and farther: the arm and, in a fold, one beyond it
    counts = []
    for side in (0.99, 1.01):
        J = impulses(0.1, 0.6, w, side * reach)
        counts.append(int(sum((abs(J.imag) < 1e-12) & (J.real > 0))))
    assert counts == ([1, 0] if beyond == "persists" else [1, 2])
    for point in arm:
        (speed,) = (flight.end[1] for flight in point.solution.flights)
        known = impulses(0.1, 0.6, w, point["s"]) / 1.6
        assert abs(known - speed).min() < 1e-9
    assert max(map(misses, hard(arm)[::4])) < 1e-9


@pytest.mark.parametrize("w", [3.0, 1.5])
def test_the_way_back_leads_to_the_same_orbits_without_an_impact(w: float) -> None:
    reach, start, within, grazing, arm = first_impact(w)
    gone, back = across(arm[3].problem, "s", "VI", within, events=())
    assert gone["s"] == pytest.approx(grazing["s"], rel=1e-9)
    assert back[0]["beyond"] == arm[0]["beyond"]
    assert back[0]["s"] == pytest.approx(grazing["s"], rel=1e-9)
    assert back[-1]["s"] == 1.5 * reach
    assert back[-1].solution.equations.flows == start.residual.flows
    assert back[-1]["max(x)"] == pytest.approx(reach, rel=1e-9)


def ends(branch: cb.Branch) -> Iterator[cb.Point]:
    kinds = ("GR", "VI")
    return (point for point in branch.special if point.kind in kinds and not point.parent)


@pytest.mark.slow
def test_each_grazing_adds_an_impact_to_an_orbit() -> None:
    on, within = {"c": 0.04, "k": 0.8, "w": 2.2, "s": 0.1}, {"w": (0.55, 2.2)}
    mesh = cb.Collocation(intervals=10)
    start = {"x": -0.2, "v": 0.0}
    orbit = cb.cycle([HIT], start, on, period=period, settle=60, collocation=mesh)
    branch = cb.trace(orbit, "w", within=within, events=())
    for count in (2, 3):
        grazing = branch.first("GR")
        (branch,) = cb.switch(grazing, within=within, events=())
        assert {len(point.solution.flights) for point in branch} == {count}
        assert max(map(misses, hard(branch)[::8])) < 1e-9
        near = {"w": (grazing["w"] - 0.01, grazing["w"] + 0.01)}
        there = cb.trace(branch[2].problem, "w", within=near, events=())
        gone = next(end for end in ends(there) if end.kind == "VI")
        assert gone["w"] == pytest.approx(grazing["w"], rel=1e-9)
        (back,) = cb.switch(gone, within=near)
        assert len(back[0].solution.flights) == count - 1


@pytest.mark.slow
def test_without_its_last_impact_an_orbit_may_go_around_twice() -> None:
    on, within = {"c": 0.04, "k": 0.5, "w": 2.2, "s": 0.3}, {"w": (2.1, 2.3)}
    orbit = cb.cycle([HIT], {"x": -0.2, "v": 0.0}, on, period=period, settle=60)
    _, arm = across(orbit, "w", "GR", within, towards="down", events=())
    gone = arm.first("VI")
    (back,) = cb.switch(gone, within=within)
    long, short = gone.solution, back[0].solution
    assert (len(long.flights), len(short.flights)) == (5, 2)
    assert long.period == pytest.approx(2 * short.period)
    assert back[0]["w"] == pytest.approx(gone["w"], rel=1e-9)
    assert max(map(misses, hard(back)[::8])) < 1e-9


@pytest.mark.slow
def test_a_motion_that_settles_clear_of_its_conditions_has_them_as_walls() -> None:
    free, rest = cb.Flow(field, until=right), {"x": 0.0, "v": 0.0}
    stop = [free, cb.Flow(lambda t, x, p: [x[1], -x[0]], until=lambda t, x, p: x[0] - p["s"])]
    belt = cb.Filippov(field, lambda t, x, p: [x[1], -x[0]], right)
    for flows, walls in (
        (HIT, [HIT]),
        ([HIT, OTHER], [HIT, OTHER]),
        (stop, [stop]),
        (belt, [(belt.plus, belt.to_plus)]),
    ):
        clear = cb.cycle(flows, rest, ON, period=period, settle=200)
        assert clear.residual.flows == (cb.Flow(field, walls=walls),)
    touched = cb.trace(clear, "s", within={"s": (0.05, 0.3)}, towards="down").first("GR")
    assert touched["s"] == pytest.approx(amplitude(ON["c"], ON["w"]), rel=1e-9)


def test_a_motion_that_passes_a_wall_its_flow_does_not_know_is_refused_with_that() -> None:
    """A ball in a box that is hit at one wall twice in a row goes through it, and away."""

    def pushed(t: Any, x: Any, p: Any) -> Any:
        return [x[1], 2 * np.sin(t)]

    ball = [cb.Flow(pushed, until=wall, reset=rebound) for wall in (right, left)]
    with pytest.raises(cb.NotConverged, match="behind the condition of another flow"):
        cb.cycle(ball, {"x": 0.0, "v": 1.0}, {"s": 1.0, "k": 0.6}, period=TAU, settle=30)


def test_a_motion_that_never_leaves_a_surface_is_refused() -> None:
    def side(sign: int) -> Any:
        return lambda t, x, p: [x[1], -x[0] + 0.1 * np.cos(t) - 0.5 * sign]

    held = cb.Filippov(side(1), side(-1), lambda t, x, p: x[1])
    with pytest.raises(cb.NotConverged, match="does not leave it: give"):
        cb.cycle(held, {"x": 1.3, "v": 0.0}, {}, period=TAU, settle=25)


@pytest.mark.slow
def test_an_orbit_between_two_walls_meets_one_after_the_other() -> None:
    walls = HIT, OTHER
    within = {"w": (2.0, 2.6)}
    branch = cb.trace(without_impacts(walls, s=0.3, w=2.5), "w", within=within, events=())
    met = []
    for _ in range(2):
        (branch,) = cb.switch(branch.first("GR"), within=within)
        met.append({flow.until for flow in branch[-1].solution.equations.flows})
        assert max(misses(orbit, (right, left)) for orbit in hard(branch)[::4]) < 1e-9
    assert met == [{right}, {right, left}]


def test_a_field_that_is_written_anew_leads_on() -> None:
    anew = cb.Flow(lambda t, x, p: field(t, x, p), until=right, reset=rebound)
    within = {"s": (0.05, 0.3)}
    grazing = cb.trace(without_impacts((anew,)), "s", within=within, towards="down").first("GR")
    (hits,) = cb.switch(grazing, within=within)
    assert max(misses(orbit) for orbit in hard(hits)[::4]) < 1e-9


@pytest.mark.slow
def test_what_is_beyond_is_refused_where_it_is_no_orbit_of_these_flows() -> None:
    within = {"s": (0.05, 0.3)}

    def refused(start: cb.Problem, why: str) -> None:
        grazing = cb.trace(start, "s", within=within, towards="down").first("GR")
        with pytest.raises(cb.BadInput, match=why):
            cb.switch(grazing, within=within)

    rubs = cb.Flow(field, until=right, reset=lambda t, x, p: [x[0] - 0.1, -p["k"] * x[1]])
    refused(without_impacts(rubs), "a reset moves the state even where nothing is hit")
    other = cb.Flow(lambda t, x, p: [x[1], -x[0]], until=right, reset=rebound)
    refused(without_impacts(other), "a flow with the same f has to lead on")
    mirror = cb.Flow(field, walls=(HIT,), reset=lambda t, x, p: [-x[0], -x[1]])
    start = {"x": -0.123, "v": 0.0}
    half = cb.cycle(mirror, start, ON, period=lambda p: np.pi / p["w"], settle=100)
    refused(half, "half of a symmetric orbit")
    opposite = cb.Flow(field, until=lambda t, x, p: p["s"] + x[0], reset=rebound)
    refused(without_impacts((HIT, opposite)), r"walls are touched at once, flow 0 touches walls")
    for flows in ((cb.Flow(field, until=right),), (HIT, HIT), (cb.Flow(field),) * 2):
        with pytest.raises(cb.BadInput, match="a wall is met by a flow with `until` and `reset`"):
            cb.Flow(field, walls=[flows])


@pytest.mark.slow
def test_beyond_grazing_in_a_plane_an_impact_keeps_the_limit_cycle() -> None:
    """Van der Pol's cycle has a wall moved into it. In a plane what an impact takes off the
    velocity is a later time: the orbit goes on as one that hits, and back."""
    hit = cb.Flow(
        van_der_pol, until=lambda t, x, p: p["g"] - x[0], reset=lambda t, x, p: [x[0], -0.7 * x[1]]
    )
    start, params, window = {"x": 2.0, "v": 0.0}, {"g": 2.3, "mu": 0.5}, {"g": (1.0, 2.5)}
    free = cb.cycle(cb.Flow(van_der_pol, walls=(hit,)), start, params, settle=99)
    grazing, hits = across(free, "g", "GR", window)
    assert [(end.kind, end["g"]) for end in hits.special] == [
        ("EP", pytest.approx(grazing["g"], abs=1e-7)), ("EP", 1.0)
    ]  # fmt: skip
    vanishing = cb.trace(hits[2].problem, "g", within=window, towards="both").first("VI")
    assert vanishing["g"] == pytest.approx(hits[0]["g"], abs=1e-9)


def test_a_mass_that_only_impacts_move_rests_beyond_the_last_one() -> None:
    def masses(t: Any, x: Any, p: Any) -> Any:
        return [x[2], x[3], np.cos(p["w"] * t) - x[0] - 0.1 * x[2], -1.5 * x[1] - 0.05 * x[3]]

    def shared(t: Any, x: Any, p: Any) -> Any:  # of masses 1 and 2
        mean, apart = (x[2] + 2 * x[3]) / 3, x[2] - x[3]
        return [x[0], x[1], mean - 1.6 / 3 * apart, mean + 0.8 / 3 * apart]

    hit = cb.Flow(masses, until=lambda t, x, p: 0.3 + x[1] - x[0], reset=shared)
    start = dict.fromkeys("xyuv", 0.0)
    orbit = cb.cycle([hit], start, {"w": 2.08}, period=period, settle=100)
    hits = cb.trace(orbit, "w", within={"w": (2.0, 2.15)}, towards="up")
    (alone,) = cb.switch(hits.first("VI"), within={"w": (2.0, 2.15)})
    assert abs(amplitude(0.1, alone[0]["w"]) - 0.3) < 1e-9
    assert abs(alone["max(y)"][1:]).max() < 1e-9


@pytest.mark.slow
def test_a_wall_at_the_origin_is_gone_beyond() -> None:
    """Where an impact oscillator touches a wall at 0 its state is 0, which has no size of its own:
    between both GR of its orbit of three impacts is the one of four."""
    hit = cb.Flow(
        lambda t, x, p: [x[1], np.cos(p["w"] * t) - x[0]],
        until=lambda t, x, p: -x[0], reset=lambda t, x, p: [x[0], -0.8 * x[1]],
    )  # fmt: skip
    # next to an orbit that is not stable: what settles there is chaos, which rounding decides
    start, window = {"x": 0.0, "v": -0.2579}, {"w": (1.5, 8.0)}
    three = cb.cycle([hit], start, {"w": 2.8}, period=period, t0=0.0971)
    branch = cb.trace(three, "w", within=window)
    (four,) = cb.switch(branch.first("GR1"), within=window)
    assert [len(each[1].solution.durations) for each in (branch, four)] == [3, 4]
    assert four[-1].kind == "VI"
    assert four[-1]["w"] == pytest.approx(branch.first("GR2")["w"], abs=1e-8)


@pytest.mark.slow
def test_an_orbit_far_from_where_its_branch_began_leads_on() -> None:
    """A relief valve that comes to hit its seat (C. Hos, A. R. Champneys, 2012): next to its GR
    slopes of the orbit at the start lead to negative pressures, of which the field has a root."""

    def valve(t: Any, x: Any, p: Any) -> Any:
        force = x[2] - x[0] - 10 - 1.25 * x[1]
        return [x[1], force, 20 * (p["q"] - x[0] * np.sqrt(x[2]))]

    def seat(t: Any, x: Any, p: Any) -> Any:
        return [x[0], -0.8 * x[1], x[2]]

    wall = cb.Flow(valve, until=lambda t, x, p: x[0], reset=seat)
    start = {"y": 1.5, "v": 0.5, "P": 12.0}
    free = cb.cycle(cb.Flow(valve, walls=(wall,)), start, {"q": 8.19}, settle=50)
    lost = cb.trace(free, "q", towards="both", within={"q": (7.5, 8.25)}, events=()).first("GR")
    assert lost["q"] == pytest.approx(7.55721097, abs=1e-7)  # by scipy
    (hits,) = cb.switch(lost, within={"q": (7.5, 8.3)}, events=())
    assert hits[0]["beyond"] == "persists"


def test_a_ball_that_sticks_to_its_table_ends_where_it_would_take_off_at_once() -> None:
    """It is thrown where A sin t = 1, and comes back as long after as it sticks there no more: a
    period later, where A cos t = pi."""

    def table(t: Any, x: Any, p: Any) -> Any:
        return [p["A"] * np.sin(t), p["A"] * np.cos(t)]

    free = cb.Flow(lambda t, x, p: [x[1], -1.0], lambda t, x, p: x[0] - table(t, x, p)[0], table)
    stick = cb.Flow(
        lambda t, x, p: [x[1], -table(t, x, p)[0]], lambda t, x, p: 1 - table(t, x, p)[0], table
    )
    start, period = {"y": 0.0, "v": 2.0}, 2 * np.pi
    ball = cb.cycle([stick, free], start, {"A": 2.0}, period=period, settle=10)
    branch = cb.trace(ball, "A", within={"A": (1.05, 5)})
    assert [point.kind for point in branch.special] == ["EP", "CC"]
    assert branch[-1]["A"] == pytest.approx(np.sqrt(1 + np.pi**2), abs=1e-12)


@pytest.mark.slow
def test_the_curve_of_a_ball_that_sticks_no_more_goes_on_until_it_hardly_rebounds() -> None:
    """It rebounds once, by e, before it sticks, and comes down where it would take off again:
    slowly against its fall before, which is no tangency."""

    def table(t: Any, x: Any, p: Any) -> Any:
        return [p["A"] * np.sin(t), p["A"] * np.cos(t)]

    def rebounds(t: Any, x: Any, p: Any) -> Any:
        return [x[0], -p["e"] * x[1] + (1 + p["e"]) * table(t, x, p)[1]]

    def strikes(reset: Any) -> cb.Flow:
        return cb.Flow(
            lambda t, x, p: [x[1], -1.0], lambda t, x, p: x[0] - table(t, x, p)[0], reset
        )

    stick = cb.Flow(
        lambda t, x, p: [x[1], -table(t, x, p)[0]], lambda t, x, p: 1 - table(t, x, p)[0], table
    )
    flows, start = [stick, strikes(rebounds), strikes(table)], {"y": 0.0, "v": 2.0}
    ball = cb.cycle(flows, start, {"A": 2.7, "e": 0.02}, period=2 * np.pi, settle=10)
    collides = cb.trace(ball, "A", within={"A": (2.7, 3.2)}).first("CC")
    curve = cb.boundary(collides, ("A", "e"), within={"e": (0.003, 0.03)}, towards="up")
    assert [point.kind for point in curve.special] == ["EP", "EP"]
    A, off = curve[-1]["A"], np.arcsin(1 / curve[-1]["A"])

    def height(t: float) -> float:  # above the table until it comes down first
        return 1 + A * np.cos(off) * (t - off) - (t - off) ** 2 / 2 - A * np.sin(t)

    down = brentq(height, off + 5, off + 6.25, xtol=1e-14)
    y, v = table(down, None, {"A": A})
    again = off + 2 * np.pi - down
    rebound = v + 0.003 * (v - A * np.cos(off) + down - off)
    assert y + rebound * again - again**2 / 2 == pytest.approx(1, abs=1e-9)


@pytest.mark.slow
def test_beyond_a_corner_collision_two_neurons_fire_in_the_other_order() -> None:
    """At 1.5 + d and 1.5, driven alike: at once where d = 0. Each is as it is alone."""

    def rate(current: Any, x: Any, t: Any) -> Any:
        return current - x + 0.9 * np.cos(2 * np.pi * t)

    def alone(current: float) -> float:
        one = cb.Flow(
            lambda t, x, p: [rate(current, x[0], t)],
            lambda t, x, p: 1 - x[0],
            lambda t, x, p: [0 * x[0]],
        )
        (mu,) = cycle_of(cb.cycle([one], {"x": 0.1}, {}, period=1.0, settle=100)).multipliers
        return float(mu.real)

    def both(t: Any, x: Any, p: Any) -> Any:
        return [rate(1.5 + p["d"], x[0], t), rate(1.5, x[1], t)]

    fires = [
        cb.Flow(both, lambda t, x, p: 1 - x[0], lambda t, x, p: [0 * x[0], x[1]]),
        cb.Flow(both, lambda t, x, p: 1 - x[1], lambda t, x, p: [x[0], 0 * x[1]]),
    ]
    flows = [cb.Flow(both, fires[i].until, fires[i].reset, (fires[1 - i],)) for i in (0, 1)]
    pair = cb.cycle(flows, {"x": 0.1, "y": 0.0}, {"d": 0.02}, period=1.0, settle=100)
    window = {"d": (-0.03, 0.03)}
    corner = cb.trace(pair, "d", within=window, towards="both").first("CC")
    assert corner["d"] == pytest.approx(0, abs=1e-12)
    (arm,) = cb.switch(corner, within=window)
    assert (arm[0]["beyond"], arm[-1]["d"]) == ("persists", -0.03)
    found = sorted(arm[-1].solution.multipliers.real)
    assert found == pytest.approx(sorted([alone(1.47), alone(1.5)]), abs=1e-8)
