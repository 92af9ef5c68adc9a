"""Cycles beyond SL and GR of Filippov systems: into sliding and out of it."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import contbreather as cb
from contbreather import NotConverged, Problem
from contbreather.flows import cycle_of

from .test_filippov import MASS, pushed
from .zoo import STICK_SLIP, across

pytestmark = pytest.mark.slow

TAU = 2 * np.pi
ONSET = np.sqrt(1 + np.pi**2 / 4)  # where a pushed mass begins to stick: Den Hartog
BELT = {"F": 1.0, "V": 1.0, "d": 0.1}
MESH = cb.Collocation(intervals=12)  # flows are sines


def names(orbit: cb.flows.Cycle, system: cb.Filippov) -> list[str]:
    every = ["above", "below", "sticks up", "sticks down"]
    return ordered([every[system.flows.index(flow)] for flow in orbit.equations.flows])


def ordered(flows: list[str]) -> list[str]:
    """From the one below on."""
    first = flows.index("below")
    return flows[first:] + flows[:first]


def follow(orbit: cb.flows.Cycle, system: cb.Filippov, V: float) -> tuple[float, list[str]]:
    """How far off itself an orbit is a period after the middle of its longest flow off the surface,
    and its flows, by Dormand and Prince; the surface is where the last state is V."""
    off = [flow in system.flows[:2] for flow in orbit.equations.flows]
    p, longest = orbit.params, int((orbit.durations * off).argmax())
    t = start = orbit.times[longest] + 0.5 * orbit.durations[longest]
    x, end, seen = orbit.states(start), start + orbit.period, []

    def rise(side: int, t: float, x: Any) -> float:
        f = system.f_plus if side > 0 else system.f_minus
        return float(np.ravel(f(t, x, p))[-1])

    side = int(np.sign(x[-1] - V))
    while True:
        if side:
            seen.append("above" if side > 0 else "below")
            field = system.f_plus if side > 0 else system.f_minus
            gates = [lambda t, x, side=side: side * (x[-1] - V)]
        else:
            field = lambda t, x, p: [V, 0.0][2 - len(x) :]  # noqa: E731 - carried by the surface
            gates = [lambda t, x: -rise(1, t, x), lambda t, x: rise(-1, t, x)]
        for gate in gates:
            gate.terminal, gate.direction = True, -1.0  # type: ignore[attr-defined]
        run = solve_ivp(
            lambda t, x, field=field: np.ravel(field(t, x, p)), (t, end), x, "DOP853",
            events=gates, rtol=1e-12, atol=1e-13, max_step=min(0.05, orbit.durations.min() / 3),
        )  # fmt: skip
        t, x = run.t[-1], run.y[:, -1].copy()
        if run.status == 0:
            return float(abs(x - orbit.states(start)).max()), ordered(seen[:-1])
        if side:
            x[-1] = V
            up, down = rise(1, t, x), rise(-1, t, x)
            side = 0 if up < 0 < down else int(np.sign(up + down))
        else:
            side = 1 if run.t_events[0].size else -1
            seen.append("sticks up" if side > 0 else "sticks down")


def check(branch: cb.Branch, system: cb.Filippov, flows: list[str], V: float = 0.0) -> None:
    """All orbits of a branch have these flows; the integrator of the test sees those that last."""
    assert all(names(point.solution, system) == flows for point in branch)
    orbits = [point.solution for point in branch if not point.kind]
    orbits = [orbit for orbit in orbits if orbit.durations.min() > 0.02]
    assert orbits
    for orbit in orbits[:: 1 + len(orbits) // 3]:
        off, seen = follow(orbit, system, V)
        assert off < 1e-9
        assert seen == flows


def test_both_sides_of_a_symmetric_orbit_begin_to_stick_at_once() -> None:
    within = {"A": (1.75, 2.0)}
    _, sticking = across(pushed(2.0), "A", "SL", within, towards="down", events=())
    assert sticking[0]["beyond"] == "persists"
    assert sticking[0]["A"] == pytest.approx(ONSET, abs=1e-12)
    assert sticking[-1]["A"] == 1.75
    check(sticking, MASS, ["below", "sticks up", "above", "sticks down"])
    # and from the other side
    again, back = across(pushed(1.8), "A", "SL", within, towards="up", events=())
    assert again["A"] == pytest.approx(ONSET, abs=1e-12)
    assert (back[0]["beyond"], back[-1]["A"]) == ("persists", 2.0)
    check(back, MASS, ["below", "above"])


def test_without_symmetry_one_side_sticks_first() -> None:
    def rubbing(sign: int) -> Any:
        def f(t: Any, x: Any, p: Any) -> Any:
            return [p["A"] * np.cos(t) + 0.2 * np.cos(2 * t + 0.7) - sign + 0 * x[0]]

        return f

    mass = cb.Filippov(rubbing(1), rubbing(-1), lambda t, x, p: x[0])
    within, roads = {"A": (1.7, 2.0)}, []
    for start, way in ((1.95, "down"), (1.75, "up")):
        orbit = cb.cycle(mass, {"v": 0.3}, {"A": start}, period=TAU, settle=25, collocation=MESH)
        branch = cb.trace(orbit, "A", within=within, towards=way, events=())
        places = []
        for _ in range(2):
            places.append(branch.first("SL"))
            (branch,) = cb.switch(places[-1], within=within, events=())
            check(branch, mass, names(branch[0].solution, mass))
        roads.append([place["A"] for place in places])
        assert len(branch[-1].solution.flights) == (4 if way == "down" else 2)
    assert roads[0] == pytest.approx(roads[1][::-1], abs=1e-12)


def test_a_mass_that_is_too_fast_to_stick_passes_the_belt_first_and_then_does_not_stick() -> None:
    within = {"d": (0.25, 0.55)}
    orbit = cb.cycle(
        STICK_SLIP, {"x": 0.0, "v": 0.5}, {**BELT, "d": 0.26}, settle=60, collocation=MESH
    )
    branch = cb.trace(orbit, "d", within=within, towards="up", events=())
    (passing,) = cb.switch(branch.first("SL"), within=within, events=())
    assert passing[0]["beyond"] == "persists"
    check(passing, STICK_SLIP, ["below", "above", "sticks down"], V=1.0)
    # where the flow above the belt counts as none is that far beyond
    assert passing[0]["d"] == pytest.approx(branch.first("SL")["d"], abs=1e-5)
    short = {"events": (), "steps": cb.Steps(most=9)}
    (moving,) = cb.switch(passing.first("SL"), within={"d": (0.46, 0.6)}, **short)
    check(moving, STICK_SLIP, ["below", "above"], V=1.0)
    # and back
    lost = cb.trace(passing[4].problem, "d", within=within, towards="down", events=()).first("SL")
    (back,) = cb.switch(lost, within=within, **short)
    assert back[0]["d"] == pytest.approx(branch.first("SL")["d"], abs=1e-9)
    check(back, STICK_SLIP, ["below", "sticks down"], V=1.0)


def test_a_mass_that_comes_as_fast_as_the_belt_begins_to_stick() -> None:
    def field(sign: int) -> Any:
        def f(t: Any, x: Any, p: Any) -> Any:
            return [x[1], -x[0] - 0.2 * x[1] - sign * 0.3 + p["a"] * np.cos(0.7 * t)]

        return f

    belt = cb.Filippov(field(1), field(-1), lambda t, x, p: x[1] - 1.0)
    slips = cb.Flow(belt.f_minus, walls=([belt.minus, belt.to_minus],))
    rest, turn = {"x": 0.3, "v": 0.0}, TAU / 0.7
    start = cb.cycle(slips, rest, {"a": 0.3}, period=turn, settle=200, collocation=MESH)
    within = {"a": (0.3, 0.78)}
    grazing, sticking = across(start, "a", "GR", within, events=())
    known = abs(1 - 0.49 + 0.14j) / 0.7  # the velocity of the linear motion is that of the belt
    assert grazing["a"] == pytest.approx(known, rel=1e-9)
    assert sticking[0]["beyond"] == "persists"
    assert sticking[0]["a"] == pytest.approx(known, rel=1e-9)
    check(sticking, belt, ["below", "sticks down"], V=1.0)
    _, back = across(sticking[3].problem, "a", "SL", within, towards="down", events=())
    assert back[0]["a"] == pytest.approx(known, rel=1e-9)
    assert back[-1].solution.equations.flows == start.residual.flows


def test_a_mass_that_slips_alone_is_followed_to_its_hopf_point() -> None:
    """By Stribeck's law friction falls with the velocity of slip. Nothing drives the mass, so that
    nothing says when it comes closest to the belt; slipping alone it may shrink to nothing."""

    def field(sign: int) -> Any:
        def f(t: Any, x: Any, p: Any) -> Any:
            mu = 0.3 + 0.1 * np.exp(-sign * (x[1] - p["V"]) / 0.1)
            return [x[1], -100.0 * x[0] - 0.5 * x[1] - sign * 9.81 * mu]

        return f

    belt, within = cb.Filippov(field(1), field(-1), lambda t, x, p: x[1] - p["V"]), {"V": (0.2, 1)}
    sticks = cb.cycle(belt, {"x": -0.05, "v": 0.3}, {"V": 0.5}, settle=20, collocation=MESH)
    lost, slips = across(sticks, "V", "SL", within)
    assert slips[0]["V"] == pytest.approx(lost["V"], rel=1e-9)
    assert slips[0]["beyond"] == "fold"  # between this cycle and the stable rest there is another
    assert [point.label for point in slips.special] == ["EP1", "HB1"]
    assert slips[-1]["V"] == pytest.approx(0.1 * np.log(19.62), rel=1e-8)  # damping by its slope


def rocked(mean: float, B: float = 0.36, n: int = 6) -> tuple[cb.Filippov, Problem]:
    """A mass with friction 1 that is pushed so that it slips twice a period, and nearly oftener."""

    def field(sign: int) -> Any:
        push = lambda t, p: 1.1 * np.cos(t) + p["B"] * np.cos(n * t) + mean  # noqa: E731
        return lambda t, x, p: [push(t, p) - sign + 0 * x[0]]

    mass = cb.Filippov(field(1), field(-1), lambda t, x, p: x[0])
    return mass, cb.cycle(mass, {"v": 0.3}, {"B": B}, period=TAU, settle=25)


def test_sliding_that_touches_its_edge_leaves_the_surface_beyond() -> None:
    mass, orbit = rocked(0.02)
    within = {"B": (0.36, 0.5)}
    touched, leaving = across(orbit, "B", "GR", within, events=())
    # where the push next to t = 2 pi / 6 just overcomes friction
    t = np.linspace(0.9, 1.2, 30_001)
    known = brentq(lambda B: (1.1 * np.cos(t) + B * np.cos(6 * t)).max() + 0.02 - 1, 0.3, 0.5)
    assert touched["B"] == pytest.approx(known, abs=1e-9)
    assert leaving[0]["beyond"] == "persists"
    # the time off the surface that counts as none is that far beyond, as its square
    assert leaving[0]["B"] == pytest.approx(known, abs=1e-6)
    slips = ["sticks up", "above"]
    check(leaving, mass, ["below", *slips, *slips, "sticks down"])
    _, back = across(leaving[3].problem, "B", "SL", within, towards="down", events=())
    assert (back[0]["beyond"], back[0]["B"]) == ("persists", pytest.approx(known, abs=1e-9))
    check(back, mass, ["below", *slips, "sticks down"])


def test_an_arm_beyond_the_edge_of_sliding_goes_on_where_its_period_grows() -> None:
    def field(sign: int) -> Any:
        push = lambda s, p: 1.1 * np.cos(s) + 0.06 * p["T"] * np.cos(6 * s) + 0.02  # noqa: E731
        return lambda t, x, p: [push(TAU * t / p["T"], p) - sign + 0 * x[0]]

    mass = cb.Filippov(field(1), field(-1), lambda t, x, p: x[0])
    orbit = cb.cycle(mass, {"v": 0.3}, {"T": 6.0}, period=lambda p: p["T"], settle=25)
    _, leaving = across(orbit, "T", "GR", {"T": (6.0, 8.0)}, events=())
    assert leaving[-1]["T"] == 8.0


@pytest.mark.parametrize(("push", "kind"), [((0.36, 6), "GR"), ((0.35, 7), "SL")])
def test_sliding_that_touches_both_edges_at_once_is_refused_with_the_reason(push, kind) -> None:
    orbit = rocked(0.0, *push)[1]
    touched = cb.trace(orbit, "B", within={"B": (0.25, 0.5)}, events=()).first(kind)
    with pytest.raises(cb.BadInput, match="walls are touched at once"):
        cb.switch(touched)


@pytest.mark.parametrize("B", [0.351, 0.354])
def test_a_slip_that_shrinks_after_sliding_touches_no_surface_where_it_begins(B: float) -> None:
    """Its height falls as the cube of how long it lasts, below the rounding of its velocity."""
    lost = cb.trace(rocked(0.0, B, 7)[1], "B", within={"B": (0.25, 0.4)}, events=()).special[0]
    t = np.linspace(2.1, 2.5, 30_001)  # where the push overcomes friction in its second crest
    push = lambda at: (-1.1 * np.cos(t) - at * np.cos(7 * t)).max() - 1  # noqa: E731
    assert lost.kind == "SL"
    assert lost["B"] == pytest.approx(brentq(push, 0.25, 0.4), abs=1e-6)


def test_an_orbit_that_has_grown_since_its_branch_began_comes_to_slide() -> None:
    """A predator that is harvested above a threshold: at SL its cycle has twice the size by which
    meshes were measured at the start. Beyond it slides, as simulations do."""
    system = cb.Filippov(harvested(0.1), harvested(0.0), lambda t, x, p: x[1] - p["Y"])
    start, within = {"x": 1.0, "y": 1.0}, {"Y": (0.5, 6.0)}
    crosses = cb.cycle(system, start, {"Y": 2.2}, settle=400)
    lost, slides = across(crosses, "Y", "SL", within, events=())
    assert slides[0]["beyond"] == "persists"
    run = cb.integrate(system, start, {"Y": lost["Y"] + 0.05}, time=400)
    assert slides[1].solution.equations.flows == tuple(run.flows[-3:])
    _, back = across(slides[3].problem, "Y", "SL", within, towards="down", events=())
    assert back[0]["Y"] == pytest.approx(lost["Y"], abs=1e-9)


@pytest.mark.parametrize("intervals", [20, 40])
def test_an_orbit_that_slides_no_more_leads_back_whatever_its_mesh(intervals: int) -> None:
    """Without sliding, the mesh is another one, and the orbit is closest to the surface a little
    sooner or later than it touched it."""

    def fished(share: float) -> Any:
        def field(t: Any, x: Any, p: Any) -> Any:
            eaten = 0.3556 * x[0] / (0.33 + x[0])
            return [x[0] * (1 - x[0]) - eaten * x[1], (eaten - 0.0444 - share) * x[1]]

        return field

    system = cb.Filippov(fished(0.2067), fished(0.0), lambda t, x, p: x[1] - p["Y"])
    mesh, within = cb.Collocation(intervals=intervals), {"Y": (1.9, 4.0)}
    slides = cb.cycle(system, {"x": 0.4, "y": 0.5}, {"Y": 2.0}, settle=500, collocation=mesh)
    lost, free = across(slides, "Y", "SL", within, events=())
    assert len(free[-1].solution.flights) == 1
    assert free[-1]["max(y)"] == pytest.approx(lost["Y"], abs=5e-6)
    _, back = across(free[-1].problem, "Y", "GR", within, towards="down", events=())
    assert names(back[1].solution, system) == names(cycle_of(slides), system)


def harvested(share: float) -> Any:
    return lambda t, x, p: [
        x[0] * (1 - x[0] / 5) - x[0] * x[1] / (1 + x[0]),
        x[1] * (x[0] / (1 + x[0]) - 0.4 - share),
    ]


def rubbed(side: int) -> Any:
    return lambda t, x, p: [
        x[1],
        p["A"] * np.cos(t) - np.sin(x[0]) - p["d"] * x[1] - side * p["mu"],
    ]


SHAFT = cb.Filippov(rubbed(1), rubbed(-1), lambda t, x, p: x[1] - p["V"])
TURNING = {"A": 0.0, "d": 0.1, "V": 1.0, "mu": 1.0}


def test_a_pendulum_is_carried_over_the_top_by_a_shaft_that_rubs() -> None:
    """Froude's pendulum: it sticks while |sin(theta) + d V| < mu, so that slipping ahead begins at
    mu = 1 - d V, backwards at 1 + d V; there sticking takes the whole of a turn."""
    start, within = {"theta": 0.0, "v": 0.5}, {"mu": (0.8, 1.2)}
    carried = cb.cycle(SHAFT, start, TURNING, wraps={"theta": TAU}, settle=30)
    whole = cb.trace(carried, "mu", within=within)
    assert whole.first("SL")["mu"] == pytest.approx(1.1, abs=1e-6)
    assert whole.first("SL")["period"] == pytest.approx(TAU, abs=1e-6)
    assert whole.first("GR")["mu"] == pytest.approx(0.9, abs=1e-9)
    (arm,) = cb.switch(whole.first("GR"), within=within)
    orbit = arm[-1].solution
    slips = max(orbit.flights, key=lambda flight: float(np.ptp(flight.states[:, 1])))
    middle = slips.at(np.array([0.5]))[:, 0]
    run = cb.integrate(SHAFT, middle, orbit.params, time=orbit.period)
    assert run.final - middle == pytest.approx([TAU, 0.0], abs=1e-9)
    # fewer flows where it slips backwards no more: mu + d V = 1
    lost, sticks = across(arm[-1].problem, "V", "SL", {"V": (0.5, 3)}, towards="up")
    assert lost["V"] == pytest.approx(2.0, abs=1e-6)
    assert len(sticks[0].solution.flights) == 2

    tilted = cb.Filippov(SHAFT.f_plus, SHAFT.f_minus, lambda t, x, p: x[1] - p["V"] - 0.1 * x[0])
    with pytest.raises(cb.BadInput, match="not the same a turn"):
        cb.cycle(tilted, start, TURNING, wraps={"theta": TAU}, settle=30)


def test_a_curve_closes_where_phase_and_angle_have_made_a_turn() -> None:
    """A shaft that is pushed once a turn: the orbit is the same one a period, and a turn, later."""
    params = TURNING | {"A": 0.4, "V": 1.02, "mu": 0.6}
    turns = cb.cycle(
        SHAFT, {"theta": 0.0, "v": 3.0}, params, wraps={"theta": TAU}, period=TAU, settle=200
    )
    loop = cb.trace(turns, "A", within={"A": (0, 2)}, steps=cb.Steps(most=80))
    assert loop.stop is cb.continuation.Stop.CLOSED
    assert abs(loop[-1]["phase"] - loop[0]["phase"]) == pytest.approx(TAU, rel=1e-9)
    assert [at.kind for at in loop.special] == ["LP", "LP"]


def capsule(side: int) -> Any:
    """A mass, driven inside of a capsule that rubs, strikes a soft stop there (Liu et al.)."""

    def field(t: Any, x: Any, p: Any) -> Any:
        y, mass, capsule = x
        force = y + 0.1 * (mass - capsule) + 1.5 * np.logaddexp(0.0, 10 * y - 0.2)
        drive = p["a"] * np.cos(0.9 * t)
        return [mass - capsule, drive - force, (force - side * p["mu"]) / 5]

    return field


CAPSULE = cb.Filippov(capsule(1), capsule(-1), lambda t, x, p: x[2])


@pytest.fixture(scope="module")
def moving() -> cb.Branch:
    start, turn = {"y": 0.0, "mass": 0.0, "capsule": 0.01}, TAU / 0.9
    orbit = cb.cycle(CAPSULE, start, {"a": 1.0, "mu": 1.0}, period=turn, settle=100)
    return cb.trace(orbit, "a", within={"a": (0.7, 1.5)}, events=(), towards="both")


def test_where_the_surface_is_left_for_as_long_as_counts_as_none_is_followed(moving: Any) -> None:
    lost = moving.special[0]
    line = cb.boundary(lost, ("a", "mu"), within={"mu": (0.9, 1.1)}, towards="both")
    assert (line[0]["mu"], line[-1]["mu"]) == (0.9, 1.1)
    assert not line.doubtful
    for at in line[::5]:
        orbit, a = at.solution, at["a"]
        begins = orbit.flights[lost.detail["flow"] - 1]  # at rest the spring comes to pull with mu
        force = lambda y, v: y + 0.1 * v + 1.5 * np.logaddexp(0.0, 10 * y - 0.2)  # noqa: E731
        rests = solve_ivp(
            lambda t, x, a=a, force=force: [x[1], a * np.cos(0.9 * t) - force(*x)],
            (begins.start, begins.last + 0.1), begins.states[0, :2], "DOP853",
            rtol=1e-11, atol=1e-12, max_step=1e-3,
        )  # fmt: skip
        assert force(*rests.y).min() == pytest.approx(-at["mu"], abs=1e-5)


def test_the_curve_of_sliding_sets_out_where_that_lasts_no_time_at_all(moving: Any) -> None:
    slides = moving.special[-1]
    line = cb.boundary(slides, ("a", "mu"), within={"mu": (0.9, 1.1)}, towards="both")
    assert (line[0]["mu"], line[-1]["mu"]) == (0.9, 1.1)


def test_curves_on_which_a_mass_begins_to_stick_end_where_it_does_at_both_turns() -> None:
    """A mass on a table that shakes and leans by s: level, it begins to stick at both at once."""
    table = cb.Filippov(
        lambda t, x, p: [-p["s"] - 1 + 0 * x[0]],
        lambda t, x, p: [-p["s"] + 1 + 0 * x[0]],
        lambda t, x, p: x[0] - p["A"] * np.cos(t),
    )
    mass = cb.cycle(table, {"v": 0.0}, {"A": 3.0, "s": 0.2}, period=TAU, settle=60)
    window = {"A": (1.7, 3.5), "s": (-0.5, 0.5)}
    slips, sticks = across(mass, "A", "SL", window, towards="down")
    for end in (slips, sticks.special[-1]):
        met = cb.boundary(end, ("A", "s"), within=window).first("SL-SL")
        assert [met["A"], met["s"]] == pytest.approx([ONSET, 0.0], abs=1e-9)


def test_curves_of_sliding_end_where_the_edge_is_touched_from_within() -> None:
    """A driven mass on a belt that passes it twice a period: where it falls behind the push without
    it, m + F cos w t - x, and the change of that vanish."""

    def push(side: int) -> Any:
        return lambda t, x, p: [x[1], -x[0] - side + p["F"] * np.cos(p["w"] * t)]

    belt = cb.Filippov(push(1), push(-1), lambda t, x, p: x[1] - 1)
    period, start = (lambda p: 2 * np.pi / p["w"]), {"x": 0.0, "v": 0.5}
    passes = cb.cycle(belt, start, {"F": 2.5, "w": 1.7}, period=period, settle=100)
    slides = cb.trace(passes, "F", within={"F": (1, 4)}).first("SL")
    line = cb.boundary(slides, ("w", "F"), within={"w": (0.3, 2), "F": (1, 8)}, events=())
    end = line.first("SL-GR")

    def flown(side: int, t0: float, t1: float, x: float, w: float, F: float) -> tuple[float, float]:
        """x and v from v = 1 on."""
        rest = np.array([F * np.cos(w * t) / (1 - w * w) - side for t in (t0, t1)])
        pace = np.array([-F * w * np.sin(w * t) / (1 - w * w) for t in (t0, t1)])
        turned = (x - rest[0] + 1j * (1 - pace[0])) * np.exp(-1j * (t1 - t0))
        return turned.real + rest[1], turned.imag + pace[1]

    def left(z: Any) -> list[float]:
        t0, t1, x0, w, F = z
        x1 = 1 + F * np.cos(w * t1)
        over, under = flown(1, t0, t1, x0, w, F), flown(-1, t1, t0 + 2 * np.pi / w, x1, w, F)
        return [over[0] - x1, over[1] - 1, under[0] - x0, under[1] - 1, 1 + F * w * np.sin(w * t1)]

    flights = end.solution.flights
    begins = next(of for of in flights if of.at(np.array([0.5]))[1, 0] > 1)
    near = [begins.start, begins.last, begins.states[0][0], end["w"], end["F"]]
    exact = fsolve(left, near, xtol=1e-13)
    assert [end["w"], end["F"]] == pytest.approx(exact[-2:], abs=1e-8)
    assert exact == pytest.approx(near, abs=1e-6)


def test_a_run_that_has_yet_to_settle_by_turns_is_no_orbit_of_other_flows() -> None:
    """A mass passes its belt every other period, ever more briefly; settled it sticks at once."""

    def push(side: int) -> Any:
        return lambda t, x, p: [x[1], -x[0] - side + p["F"] * np.cos(1.7 * t)]

    belt = cb.Filippov(push(1), push(-1), lambda t, x, p: x[1] - 1)
    found = partial(cb.cycle, belt, {"x": 0.0, "v": 0.5}, {"F": 1.49}, period=2 * np.pi / 1.7)
    with pytest.raises(NotConverged, match=r"beyond where .*settle longer"):
        found(settle=200)
    orbit = cycle_of(found(settle=1500))
    assert [belt.flows.index(flow) for flow in orbit.equations.flows] == [1, 3]


def test_a_mass_that_turns_slowly_stops_once_more_just_after_its_turn() -> None:
    """Pushed against friction that falls with the velocity it leaves its turn so slowly that it
    stops again within 0.4 % of its way back, before it begins to stick."""

    def rubs(way: int) -> Any:
        def field(t: Any, x: Any, p: Any) -> Any:
            friction = 0.15 * (1 + np.exp(-3 * way * x[1]))
            return [x[1], p["F"] * np.cos(p["w"] * t) - x[0] - 0.04 * x[1] - way * friction]

        return field

    block = cb.Filippov(rubs(1), rubs(-1), lambda t, x, p: x[1])
    moving = cb.cycle(block, {"x": 0.5, "v": 0.0}, {"F": 0.605, "w": 0.7}, settle=200,
                      period=lambda p: 2 * np.pi / p["w"])  # fmt: skip
    branch = cb.trace(moving, "w", within={"w": (0.1, 0.7)}, towards="down")
    assert branch[-1].kind == "GR"

    def off(unknown: Any) -> list[float]:  # half of a symmetric orbit, and a stop in between
        x, begin, w, stop = unknown
        p = {"F": 0.605, "w": w}
        run = solve_ivp(rubs(1), (begin, begin + np.pi / w), [x, 0.0], args=(p,), rtol=1e-12,
                        atol=1e-13, method="DOP853", dense_output=True)  # fmt: skip
        there = run.sol(stop)
        end = run.y[:, -1]
        return [end[0] + x, end[1], there[1], rubs(1)(stop, there, p)[1]]

    orbit = branch[-1].solution
    up = [flow.until(0.0, np.array([0.0, 1.0]), orbit.params) > 0 for flow in orbit.equations.flows]
    i = up.index(True)
    begin, x = orbit.times[i], orbit.flights[i].states[0, 0]
    found = fsolve(off, [x, begin, branch[-1]["w"], begin + 0.0036 * np.pi / branch[-1]["w"]],
                   xtol=1e-13)  # fmt: skip
    assert max(map(abs, off(found))) < 1e-10
    assert branch[-1]["w"] == pytest.approx(found[2], abs=1e-8)
