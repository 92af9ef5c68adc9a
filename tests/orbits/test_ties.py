"""Sites that hit their walls at the same time: pitchforks on which the order of their impacts
changes, where curves meet such orbits, and what multibreathers end at there."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.curve.derivative_checks import wrong_entry
from contbreather.orbits.normal_form import pitchfork_form

from .by_hand import run_once

RING = {"gamma": 0.03, "k": 0.8, "damping": 0.05, "lattice": cb.Ring(8)}
CASES = {
    "ring of 8": ([0, 1], "a", {"a": 0.6, **RING}, (0.6, 0.72)),
    "ring of 6": (
        {0: "upper", 1: "upper"},
        "a",
        {"a": 0.6, "gamma": 0.05, "k": 0.8, "damping": 0.02, "lattice": cb.Ring(6)},
        (0.6, 0.72),
    ),
    "chain of 2": (
        [0, 1],
        "gamma",
        {
            "a": 0.628215310440778, "gamma": 0.05, "k": 0.7264621072894921,
            "damping": 0.07233006103198816, "lattice": cb.OpenChain(2),
        },
        (0.05, 0.1),
    ),
    "three in a row": ([0, 1, 2], "a", {"a": 0.6, **RING, "lattice": cb.Grid(2, 3)}, (0.6, 0.69)),
    "ends of the list": ([6, 0], "a", {"a": 0.6, **RING, "lattice": cb.Ring(7)}, (0.6, 0.72)),
}  # fmt: skip


@functools.cache
def fork(name: str) -> cb.Point:
    choice, free, given, window = CASES[name]
    start = cb.multibreather(choice, **given)
    return cb.trace(start, free, within={free: window}, towards="both").first("PF")


@functools.cache
def arms(name: str) -> tuple[cb.Branch, ...]:
    point, free = fork(name), CASES[name][1]
    near = (point[free] - 0.02, point[free] + 0.02)
    return cb.switch(point, within={free: near}, steps=cb.Steps(first=1e-3, largest=0.02))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_arms_leave_to_both_sides_each_in_its_own_order(name) -> None:
    both, free, point = arms(name), CASES[name][1], fork(name)
    assert len(both) == 2
    orders = set()
    for arm in both:
        orbit = arm[-1].solution
        assert abs(orbit.asymmetry) > 0.05
        assert orbit.residual < 1e-10
        assert run_once(orbit) < 1e-9
        orders.add(tuple(np.argsort(orbit.times[: orbit.section.count // 2])))
        # a line, not a square root: of the first steps the nearest is closest to the limit
        slopes = [abs(p.solution.asymmetry) / (p[free] - point[free]) for p in arm[1:4]]
        assert slopes == pytest.approx(slopes[:1] * 3, rel=0.15)
    assert len(orders) == 2


@pytest.mark.parametrize("name", CASES)
def test_their_law_is_linear_and_its_coefficient_that_of_the_arms(name) -> None:
    """Against arms at small distances, extrapolated; their equations are Newton's alone."""
    point, free = fork(name), CASES[name][1]
    form = pitchfork_form(point.solution, free)
    assert form.power == 1
    assert point["power"] == 1
    assert point["coefficient"] == pytest.approx(form.coefficient, rel=1e-6)
    for arm in arms(name):
        x = np.array([p[free] - point[free] for p in arm[1:7]])
        y = np.array([abs(p.solution.asymmetry) for p in arm[1:7]])
        limit = np.polynomial.polynomial.polyfit(x, y / x, 4)[0]
        assert form.coefficient == pytest.approx(limit, rel=1e-4)
    assert form.criticality == "supercritical"


def test_of_two_neighbours_it_is_what_was_measured() -> None:
    assert fork("ring of 8")["coefficient"] == pytest.approx(19.6, abs=0.1)


def test_simulation_settles_on_the_arms() -> None:
    """From the symmetric orbit beyond its pitchfork, pushed a little."""
    arm = arms("ring of 6")[0]
    point = max(arm.points, key=lambda p: p["a"])
    orbit = point.solution
    given = {name: getattr(orbit, name) for name in ("a", "gamma", "k", "damping", "lattice")}
    half = cb.multibreather({0: "upper", 1: "upper"}, **given)
    u, v = half.state(t=0.0)
    u = u + 1e-3 * np.eye(6)[0]
    run = cb.simulate((u, v), periods=3000, **given)
    settled = np.ravel(run.final)
    ends = [np.ravel(arm_end(each, orbit.a).state(t=0.0)) for each in arms("ring of 6")]
    assert min(abs(settled - end).max() for end in ends) < 1e-6


def arm_end(arm: cb.Branch, a: float) -> cb.orbits.Orbit:
    return min(arm.points, key=lambda p: abs(p["a"] - a)).solution


def test_sites_apart_that_hit_at_once_keep_the_square_root() -> None:
    """Of sites that are no neighbours the kink is of higher order than the normal form."""
    start = cb.multibreather([0, 3], a=0.6, **RING)
    point = cb.trace(start, "a", within={"a": (0.6, 0.85)}, towards="up").first("PF")
    assert point["power"] == 2
    assert len(cb.switch(point, within={"a": (0.6, 0.85)})) == 2


@pytest.mark.parametrize("name", ["ring of 8", "chain of 2", "three in a row"])
def test_their_curve_in_two_parameters_is_followed(name) -> None:
    point = fork(name)
    line = cb.boundary(point, ("damping", "a"), within={"damping": (0.03, 0.09), "a": (0.4, 0.9)})
    assert not line.stop.failed
    end = line[-1]
    assert {wrong_entry(p.curve, p.z) for p in (line[0], end)} == {""}  # by differences
    again = cb.trace(end.base_point.problem, "a", within={"a": (end["a"] - 0.02, end["a"] + 0.02)})
    assert min(abs(p["a"] - end["a"]) for p in again.special if p.kind == "PF") < 1e-8


# --- impacts that catch up with those of the next section -----------------------------------------

CAUGHT = {
    "chain": (
        {0: "upper", 5: "lower"},
        {
            "a": 0.4262865587780223, "gamma": 0.06068290911, "k": 0.34759558506,
            "damping": 0.029746438195, "spring": 0.22368495798, "lattice": cb.OpenChain(6),
        },
    ),
    "grid": (
        {0: "upper", 2: "lower"},
        {"a": 0.43, "gamma": 0.04, "k": 0.5, "damping": 0.03, "spring": 0.2,
         "lattice": cb.Grid(2, 2)},
    ),
    "three of a grid": (
        {3: "lower", 2: "lower", 0: "upper"},
        {"a": 0.43, "gamma": 0.04, "k": 0.5, "damping": 0.03, "spring": 0.2,
         "lattice": cb.Grid(2, 2)},
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", CAUGHT)
def test_a_branch_that_comes_to_simultaneous_impacts_ends_at_a_located_point(name) -> None:
    choice, given = CAUGHT[name]
    start = cb.multibreather(choice, **given)
    branch = cb.trace(start, "a", within={"a": (0.01, given["a"])}, towards="down")
    end = branch[-1]
    assert branch.stop is cb.continuation.Stop.EVENT
    assert end.located
    assert end.kind == "CC"
    assert "hit their walls at once" in end["impacts"]
    # both have become one orbit there, in which the two sites move alike
    fork = branch.special[-2]
    assert fork.kind == "BP"
    assert fork["a"] == pytest.approx(end["a"], abs=1e-6)
    assert np.ptp(fork.solution.times) == pytest.approx(math.pi, abs=1e-10)
    assert run_once(fork.solution) < 1e-10
    for arm in cb.switch(fork, within={"a": (fork["a"] - 0.02, fork["a"] + 0.02)}):
        orbit = arm[-1].solution
        assert np.ptp(orbit.times) == pytest.approx(math.pi, abs=1e-10)
        assert abs(arm[-1]["a"] - fork["a"]) > 1e-3
        assert run_once(orbit) < 1e-10


@pytest.mark.slow
def test_beyond_its_end_it_goes_on_by_the_same_impacts_in_another_order() -> None:
    """Of two arms, mirror images, one ends so; the other has no such end, and comes to GR."""
    lattice = cb.Lattice(cb.OpenChain(3).stiffness, masses=[1.0, 1.2, 1.0])
    start = cb.multibreather([0, 1], a=0.6, gamma=0.03, k=0.7, lattice=lattice, damping=0.05)
    within = {"a": (0.1, 1.0)}
    fork = cb.trace(start, "a", within=within, towards="both").first("PF")
    ends = [arm[-1] for arm in cb.switch(fork, within=within)]
    assert [end.kind for end in ends] == ["CC", "GR"]
    (further,) = cb.switch(ends[0], within=within)
    assert further[-1].kind == "GR"
    assert further[-1]["a"] == pytest.approx(ends[1]["a"], abs=1e-12)
    assert run_once(further[1].solution) < 1e-10
    mu, before = (np.sort_complex(p.solution.multipliers()) for p in (further[0], ends[0]))
    assert mu == pytest.approx(before, rel=1e-6, abs=1e-6)


@pytest.mark.slow
def test_it_goes_on_where_both_neighbours_come_at_once_with_the_first_of_the_next_section() -> None:
    breather = cb.symmetric(a=0.8, gamma=0.02, k=0.8)
    branch = cb.trace(breather, "gamma", towards="up")
    (three,) = cb.switch(branch.first("GR"))
    ended, whole = cb.switch(three.first("BP"))
    (further,) = cb.switch(ended.first("CC"))
    assert further[0]["p"] == pytest.approx(ended[-1]["p"], rel=1e-9)  # of the same impact
    assert further[-1]["gamma"] == 0.0
    speeds = (np.sort(abs(arm[-1].solution.incoming)) for arm in (further, whole))
    assert next(speeds) == pytest.approx(next(speeds), rel=1e-12)


def test_its_end_is_where_the_branch_of_both_alike_has_its_branch_point() -> None:
    choice, given = CAUGHT["chain"]
    start = cb.multibreather(choice, **given)
    end = cb.trace(start, "a", within={"a": (0.01, given["a"])}, towards="down").special[-2]
    assert end["a"] == pytest.approx(0.2037793, abs=1e-7)
    alike = cb.multibreather({0: "upper", 5: "upper"}, **given)
    branch = cb.trace(alike, "a", within={"a": (0.1, given["a"])}, towards="down")
    points = [p for p in branch.special if p.kind == "BP"]
    assert min(abs(p["a"] - end["a"]) for p in points) < 1e-9


# --- arms of one site beside another that is symmetric --------------------------------------------


def tilted(a: float, k: float, damping: float = 0.0) -> list[cb.orbits.Orbit]:
    """Both arms of the single oscillator, mirror images of each other."""
    start = cb.symmetric(0.5, 0.0, k, lattice=cb.Ring(1), damping=damping)
    axis = cb.trace(start, "a", within={"a": (0.1, 1.2)}, inadmissible=True)
    found = []
    for arm in cb.switch(axis.first("PF"), within={"a": (0.1, 1.2)}):
        near = min(arm.points, key=lambda p: abs(p["a"] - a))
        at = cb.trace(near, "a", within={"a": (0.1, 1.2)}, events=[cb.user("a", a)],
                      inadmissible=True)  # fmt: skip
        found.append(at.first("UZ").solution)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lattice", "a", "k", "word"),
    [
        (cb.OpenChain(9), 0.8469206416136429, 0.8693763873918778, "mirror image"),
        (cb.Grid(3, 3), 0.8570170246115486, 0.5976710052563745, "mirror image"),
        # there both sites tilt, to opposite sides: exchanged, they are the mirror image
        (cb.Ring(9), 0.698396352720022, 0.7525403978356009, "an image of itself"),
    ],
    ids=["chain", "grid", "ring"],
)
def test_mirror_images_end_at_one_coupling_which_is_located(lattice, a, k, word) -> None:
    reached, reasons = [], []
    for one in tilted(a, k):
        with pytest.raises(cb.NoSolution) as refused:
            cb.multibreather({4: one, 8: "upper"}, a=one.a, gamma=0.2, k=k, lattice=lattice)
        said = str(refused.value)
        reached.append(float(said.split("gamma = ")[1].split(",")[0]))
        reasons.append(said.split("there ")[1])
    assert reached[0] == pytest.approx(reached[1], rel=2e-9)
    assert reasons[0] == reasons[1]
    assert word in reasons[0]
    if word != "mirror image":
        return
    # there it is the orbit of both sites on symmetric roots, at its pitchfork
    both = cb.multibreather({4: "upper", 8: "upper"}, a=a, gamma=1e-5, k=k, lattice=lattice)
    branch = cb.trace(both, "gamma", within={"gamma": (1e-6, 1.1 * reached[0])}, towards="up")
    forks = [p["gamma"] for p in branch.special if p.kind == "PF"]
    assert min(abs(gamma / reached[0] - 1.0) for gamma in forks) < 1e-8


@pytest.mark.slow
def test_arms_of_neighbours_at_once_set_out_though_a_mode_is_an_unknown_on_one_side_only() -> None:
    chain = cb.OpenChain(4, ends="fixed")  # its highest mode comes to half the drive's frequency
    on = {"a": 0.65, "k": 0.756, "damping": 0.0221, "spring": 0.126, "lattice": chain}
    four = cb.multibreather([0, 1, 2, 3], gamma=0.03, **on)
    fork = cb.trace(four, "gamma", within={"gamma": (0.03, 0.04)}).first("PF")
    arm = cb.switch(fork, within={"gamma": (0.03, 0.04)}, steps=cb.Steps(first=1e-4))[0]
    off = abs(arm[1]["asymmetry"]) / (arm[1]["gamma"] - fork["gamma"])
    assert (fork["power"], fork["coefficient"]) == (1, pytest.approx(off, rel=0.02))
    state = arm[-1].solution.state()
    after = cb.simulate(state, gamma=arm[-1]["gamma"], periods=1, **on).final
    assert np.abs(np.subtract(after, state)).max() < 1e-9
