"""The frequency of the drive: the motion of a scaled problem, and that of its own in true time."""

from __future__ import annotations

import functools
import itertools
import json
import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.certified import certify
from contbreather.continuation.algebra.derivatives import differences
from contbreather.continuation.curve.curve import Curve
from contbreather.errors import BadInput, NoSolution
from contbreather.lattice.conditions import Conditions
from contbreather.orbits import multibreathers
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import orbit_at
from contbreather.plotting.multipliers import band

POWERS = {"a": 2, "gamma": 2, "spring": 2, "damping": 1}
OPEN = cb.OpenChain(5)
UNEVEN = np.array([1.0, 0.5, 2.0, 1.0, 1.5])
FORCED = cb.Symbolic("-cos(t) - c3*cos(3*t)", c3=0.2)
# numbers in units of the drive
CASES = {
    "chain": (cb.symmetric, {"a": 0.5, "gamma": 0.08, "k": 0.8}),
    "chain with springs": (cb.symmetric, {"a": 0.5, "gamma": 0.05, "k": 0.7, "spring": 0.2}),
    "lower root": (cb.symmetric, {"a": 0.3, "gamma": 0.1, "k": 0.6, "root": 2}),
    "another forcing": (cb.symmetric, {"a": 0.5, "gamma": 0.06, "k": 0.8, "forcing": FORCED}),
    "ring": (cb.symmetric, {"a": 0.6, "gamma": 0.09, "k": 0.8, "lattice": cb.Ring(8)}),
    "damped": (
        cb.symmetric,
        {"a": 0.6, "gamma": 0.05, "k": 0.8, "lattice": OPEN, "damping": 0.03, "spring": 0.15,
         "site": 1},
    ),
    "uneven": (
        cb.symmetric,
        {"a": 0.6, "gamma": 0.05, "k": 0.8, "lattice": OPEN, "damping": 0.03 * UNEVEN},
    ),
    "arm": (asymmetric, {"a": 0.82, "gamma": 0.04, "k": 0.8}),
    "arm of a ring": (asymmetric, {"a": 0.82, "gamma": 0.04, "k": 0.8, "lattice": cb.Ring(9)}),
    "two sites": (
        lambda **on: cb.multibreather([0, 6], **on),
        {"a": 0.5, "gamma": 0.03, "k": 0.8, "lattice": cb.Ring(12)},
    ),
}  # fmt: skip


def driven(name, omega):
    """An orbit at a frequency, and that of the scaled problem."""
    make, on = CASES[name]
    own = {n: on[n] * omega ** POWERS[n] if n in POWERS else on[n] for n in on}
    return make(**own, omega=omega), make(**on)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("omega", [0.37, 1.9])
def test_an_orbit_at_any_frequency_is_that_of_the_scaled_problem(name, omega):
    orbit, scaled = driven(name, omega)
    assert orbit.times == pytest.approx(scaled.times, abs=1e-12)
    assert orbit.impulses == pytest.approx(scaled.impulses, abs=1e-12)
    assert orbit.entries == pytest.approx(scaled.entries, rel=1e-11)
    _, on = CASES[name]
    for parameter, power in POWERS.items():
        mean = np.mean(on.get(parameter, 0.0))
        assert getattr(orbit, parameter) == pytest.approx(mean * omega**power, rel=1e-14)
    assert orbit.omega == omega
    if orbit.lattice.sites:
        mine, other = (np.sort_complex(o.multipliers()) for o in (orbit, scaled))
        assert abs(mine) == pytest.approx(abs(other), abs=1e-8)
        assert orbit.state(t=0.3)[1] == pytest.approx(scaled.state(t=0.3)[1], abs=1e-12)
    else:
        assert orbit.stability().unstable == scaled.stability().unstable
        assert orbit.velocity(1, 0.3) == pytest.approx(scaled.velocity(1, 0.3), abs=1e-12)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("omega", [1.0, 1.3])
def test_its_equations_know_their_derivatives_in_every_parameter(name, omega):
    problem = driven(name, omega)[0].problem
    names = [n for n in ("omega", "a", "gamma", "k", "damping", "c3") if n in problem.params]
    for free in (*((n,) for n in names), names[:2]):
        curve = Curve(problem, tuple(free))
        z = curve.start + 1e-3 * (2.0 + np.cos(np.arange(curve.start.size)))
        assert abs(curve.jacobian(z) - differences(curve.residual, z)).max() < 1e-8


def test_sites_obey_the_equation_of_motion_in_true_time():
    """``u'' = ... - a cos(omega t)``, with derivatives in the phase omega t."""
    a, gamma, k, damping, spring, omega = 1.2, 0.14, 0.8, 0.05, 0.1, 1.3
    on = {"a": a, "gamma": gamma, "k": k, "damping": damping, "spring": spring, "omega": omega}
    orbit = cb.symmetric(**on, lattice=OPEN, site=2)
    sites, phase = np.arange(OPEN.sites), np.linspace(0, 2 * math.pi, 50)[:, None]
    u, v, bend = (
        of(sites, phase) for of in (orbit.displacement, orbit.velocity, orbit.acceleration)
    )
    pull = gamma * u @ OPEN.stiffness + spring * u + damping * omega * v
    bend = omega**2 * orbit.acceleration(sites, phase)
    assert bend == pytest.approx(-a * np.cos(phase) - pull, abs=1e-12)
    for hit in orbit.hits:
        assert hit.after == pytest.approx(-k * hit.before, rel=1e-12)


# --- along branches -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "kinds"),
    [
        ({"a": 0.9, "gamma": 0.05, "k": 0.8}, {"PF", "GR", "LP"}),
        ({"a": 0.3, "gamma": 0.08, "k": 0.8}, {"NS", "LP"}),
        ({"a": 0.9, "gamma": 0.05, "k": 0.8, "damping": 0.01, "lattice": cb.Ring(9)},
         {"PF", "GR", "LP"}),
        ({"a": 0.6, "gamma": 0.05, "k": 0.8, "spring": 0.2}, {"GR", "LP"}),
    ],
)  # fmt: skip
def test_what_happens_along_the_frequency_happens_on_branches_in_a_of_scaled_problems(start, kinds):
    branch = cb.trace(cb.symmetric(**start), "omega", within={"omega": (0.7, 5)})
    found = [point for point in branch.special if point.kind in kinds]
    assert {point.kind for point in found} == kinds
    for point in found:
        w = point["omega"]
        scaled = {n: start[n] / w ** POWERS.get(n, 0) if n in POWERS else start[n] for n in start}
        near = {"within": {"a": (0.9 * scaled["a"], 1.1 * scaled["a"])}, "inadmissible": True}
        shift = {"LP": 1.05, "GR": 0.97}.get(point.kind, 1.02)
        breather = cb.symmetric(**{**scaled, "a": shift * scaled["a"]})
        same = cb.trace(breather, "a", events=breather.problem.events, **near)
        places = [other["a"] for other in same.special if other.kind == point.kind]
        assert min(abs(np.array(places) / scaled["a"] - 1), default=1) < 1e-9


CHAINS = {}, {"damping": 0.02, "lattice": cb.Ring(7), "spring": 0.05}


@functools.cache
def along_omega(a: float, gamma: float, damped: bool) -> cb.Branch:
    start = cb.symmetric(a, gamma, 0.8, **CHAINS[damped])
    return cb.trace(start, "omega", within={"omega": (0.7, 6)})


# no pair passes the threshold of the damped ring here
@pytest.mark.parametrize(
    ("kind", "on"), [("NS", CHAINS[0]), *itertools.product(("LP", "PF", "GR"), CHAINS)]
)
def test_a_boundary_in_the_frequency_is_that_in_the_plane_of_a_and_gamma(kind, on):
    """Along (omega, a) at one gamma both scaled parameters move: each place of the curve is on that
    kind's curve of the scaled problem, for there its defining system holds."""
    first = along_omega(*((0.3, 0.08) if kind == "NS" else (0.9, 0.05)), bool(on))
    line = cb.boundary(
        first.first(kind), ("omega", "a"), within={"omega": (0.7, 6), "a": (0.01, 9)},
        steps=cb.Steps(most=12),
    )  # fmt: skip
    assert len(line) > 8
    for point in line[:: len(line) // 5]:
        orbit = point.solution
        map = orbit.map
        if kind in ("LP", "PF"):
            assert abs(map.crosses(-1.0 if kind == "LP" else 1.0)) < 1e-6
        elif kind == "GR":
            assert abs(orbit.admissibility().margin) < 1e-9
        else:
            assert abs(map.on_circle(point["nu"], 1.0)) < 1e-7
    w = line["omega"]
    assert np.ptp(w) > 0.1


def test_arms_in_the_frequency_are_those_of_the_closed_form():
    branch = cb.trace(cb.symmetric(0.9, 0.05, 0.8), "omega", within={"omega": (0.8, 2)})
    up, down = cb.switch(branch.first("PF"), within={"omega": (0.8, 2)})
    assert up.first("GR")["omega"] == pytest.approx(down.first("GR")["omega"], abs=1e-9)
    w = up[-1]["omega"]
    arm = asymmetric(0.9 / w**2, 0.05 / w**2, 0.8, arm=1, inadmissible=True)
    assert up[-1]["p"] == pytest.approx(arm.p, abs=1e-9)
    assert up[-1].solution.omega == w
    pitchfork, near = branch.first("PF"), up[1]
    slope = near["asymmetry"] ** 2 / (near["omega"] - pitchfork["omega"])
    assert slope == pytest.approx(pitchfork.detail["coefficient"], rel=0.05)
    back = cb.trace(up[-1], "omega", within={"omega": (0.8, 2)})
    assert back.first("PF")["omega"] == pytest.approx(branch.first("PF")["omega"], abs=1e-9)


def test_beyond_grazing_in_the_frequency_the_same_orbits_live():
    ring = cb.symmetric(0.9, 0.05, 0.8, damping=0.02, lattice=cb.Ring(9))
    end = cb.trace(ring, "omega", towards="down", within={"omega": (0.5, 1)}).first("GR")
    beyond = cb.switch(end, within={"omega": (0.9, 1.1)}, steps=cb.Steps(most=5))[0]
    on = end.solution.conditions.scaled
    scaled = cb.symmetric(on.a, on.gamma, on.k, damping=on.damping, lattice=on.lattice)
    (alike,) = cb.switch(cb.trace(scaled, "a", towards="up").first("GR"), steps=cb.Steps(most=5))
    assert beyond[0]["beyond"] == alike[0]["beyond"] == "fold"
    assert beyond[0]["|mu| J"] == pytest.approx(alike[0]["|mu| J"], rel=1e-9)
    assert beyond[1].solution.omega == beyond[1]["omega"]
    assert beyond[1].solution.section.describe().count("1+")


def test_other_parameters_join_and_a_point_at_frequency_one_is_one_like_any_other():
    orbit = cb.symmetric(0.6, 0.05, 0.8, omega=1.2)
    branch = cb.trace(orbit, "spring", within={"spring": (0, 0.2)})
    w2 = 1.2**2
    wanted = cb.symmetric(0.6 / w2, 0.05 / w2, 0.8, spring=0.2 / w2)
    assert branch[-1]["p"] == pytest.approx(wanted.p, abs=1e-10)
    both = orbit_at(cb.symmetric(0.6, 0.05, 0.8).problem.having("omega", "spring"))
    assert (both.omega, both.spring, "omega" in both.conditions.params) == (1.0, 0.0, False)


@pytest.mark.parametrize(("omega", "free"), [(1.0, "gamma"), (1.2, "omega")])
def test_tied_parameters_of_a_breather_have_its_events_and_curves(omega, free):
    breather = cb.symmetric(a=0.7, gamma=0.05, k=0.8, omega=omega)
    half = breather.problem.tied({"a": lambda p: 2 * p["a"]}, a=0.35)
    branch = cb.trace(breather, "a", within={"a": (0.01, 2)}, towards="both")
    tied = cb.trace(half, "a", within={"a": (0.005, 1)}, towards="both")
    assert [point.label for point in tied.special] == [point.label for point in branch.special]
    for kind in ("LP", "PF", "GR"):
        assert tied.first(kind)["a"] == pytest.approx(branch.first(kind)["a"] / 2, abs=1e-12)
    near = {free: (0.05, 1.21)}
    lines = [cb.boundary(b.first("PF"), (free, "a"), within=near) for b in (tied, branch)]
    ends = [line.first("PF-GR") for line in lines]
    assert ends[0]["a"] == pytest.approx(ends[1]["a"] / 2, abs=1e-10)
    assert ends[0][free] == pytest.approx(ends[1][free], abs=1e-10)


@pytest.mark.parametrize("name", CASES)
def test_parameters_come_back_as_they_were_given(name, tmp_path):
    make, on = CASES[name]
    given = {n: np.round(on[n] * 1.3**power, 3) for n, power in POWERS.items() if n in on}
    orbit = make(**{**on, **given}, omega=1.3)
    branch = cb.trace(orbit, "k", within={"k": (0.6, 0.9)}, steps=cb.Steps(most=1), events=())
    cb.save(tmp_path / "k.nc", branch)
    shot = orbit_at(cb.shooting(orbit, sites=orbit.lattice.sites or 9))
    again = cb.load(tmp_path / "k.nc")[-1].solution
    for one in (orbit, orbit.solved(), shot, branch[-1].solution, again):
        assert {n: getattr(one, n) for n in given} == {n: np.mean(x) for n, x in given.items()}


def test_conditions_at_frequency_one_are_as_they_were_in_files_and_tables():
    on = Conditions(0.5, 0.08, 0.8)
    assert "omega" not in on.params
    assert "omega" not in cb.symmetric(0.5, 0.08, 0.8).table().__str__()
    assert Conditions(0.5, 0.08, 0.8, omega=2.0).scaled == Conditions(0.125, 0.02, 0.8)


@pytest.mark.parametrize(
    ("on", "sentence"),
    [
        (
            {"omega": 0.3},
            r"omega = 0.3: harmonic 1 of the drive, 0.3, is in the band .* 0 to 0.4; .* that\.$",
        ),
        ({"omega": 0.11, "spring": 0.1}, r"harmonic 3 of the drive, 0.33, is in the band .* 0.316"),
        ({"omega": 0.3, "spring": 0.2}, "the drive is below the band of the lattice, 0.447214 to"),
        ({"omega": 0.3, "lattice": cb.Ring(9)}, "harmonic 1 of the drive"),
        ({"omega": 0}, "the frequency of the forcing must be a number with 0 < omega <= 1e4"),
        ({"omega": "fast"}, "omega = 'fast': the frequency of the forcing"),
        ({"omega": math.inf}, "omega = inf"),
        ({"omega": 2.0, "k": 1.5}, r"k = 1.5: .* in that range\.$"),
        ({"omega": 2.0, "a": -0.5}, r"a = -0.5: .* > 0; its sign belongs in the forcing\.$"),
        (
            {"omega": 2.0, "lattice": OPEN, "spring": [0.1] * 4},
            r"spring = \[0.1, 0.1, .* of 5 sites",
        ),
        ({"omega": 2.0, "lattice": OPEN, "damping": [0.1, -0.3] * 2 + [0.1]}, "damping = -0.3: .*"),
        ({"omega": 2.0, "lattice": OPEN, "k": [0.8, 1.3] * 2 + [0.1]}, "k = 1.3: .*"),
        ({"omega": 2.0, "spring": [0.1] * 3}, "one number for each site is for finite lattices"),
        ({"omega": 2.0, "gamma": "x"}, "gamma = 'x': the coupling must be a finite"),
    ],
)
def test_frequencies_that_cannot_be_are_refused(on, sentence):
    with pytest.raises(BadInput, match=sentence):
        cb.symmetric(**{"a": 0.5, "gamma": 0.04, "k": 0.8, **on})


@pytest.mark.parametrize(
    ("on", "sentence"),
    [
        ({"a": -0.9}, "a = -0.9: .* >= 0"),
        ({"gamma": -0.3}, "gamma = -0.3: the coupling"),
        ({"gamma": 1.5}, "omega = 2: harmonic 1 of the drive, 2, is in the band"),
        ({"damping": -0.1}, "damping = -0.1: "),
        ({"spring": 5e8}, "spring = 5.*: the on-site stiffness"),
    ],
)
def test_simulations_at_a_frequency_refuse_what_was_given(on, sentence):
    with pytest.raises(BadInput, match=sentence):
        cb.simulate(
            (np.zeros(9), np.zeros(9)), periods=1, lattice=cb.Ring(9), omega=2.0,
            **{"a": 0.5, "gamma": 0.04, "k": 0.8, **on},
        )  # fmt: skip


def test_below_the_fold_the_sentence_names_the_units():
    with pytest.raises(NoSolution, match=r"below the fold.* in units of omega = 2"):
        cb.symmetric(0.1, 0.04, 0.8, omega=2.0)


def test_a_branch_ends_where_a_harmonic_comes_to_the_band():
    branch = cb.trace(
        cb.symmetric(0.3, 0.1, 0.8), "omega", towards="down", within={"omega": (0.2, 1)},
        events=(), inadmissible=True,
    )  # fmt: skip
    # of the band [0, 2 sqrt(gamma)]; single steps end at gamma/omega^2 = 0.2499, others later
    assert branch["omega"][-1] == pytest.approx(2 * math.sqrt(0.1), abs=2e-4)
    assert "harmonic 1 of the drive, omega = 0.632" in branch.reason
    # and in the units of whoever asked, with springs too
    driven = cb.symmetric(0.3, 0.2, 0.8, omega=1.2, spring=0.1)
    free = {"events": (), "inadmissible": True, "towards": "down"}
    ended = cb.trace(driven, "omega", within={"omega": (0.2, 2)}, **free)
    assert ended["omega"].min() == pytest.approx(math.sqrt(0.9), rel=1e-3)
    assert "comes to the band of the lattice, 0.316228 to 0.9486" in ended.reason
    assert "at gamma = 0.2, spring = 0.1" in ended.reason
    # and not where the drive is below the band, though a ring has no such coupling
    held = cb.symmetric(0.5, 0.08, 0.7, omega=0.6, spring=0.5, damping=0.1, lattice=cb.Ring(2))
    below = cb.trace(held, "omega", within={"omega": (0.2, 1)}, **free)
    assert below.reason == (
        "in the unit of time in which omega is 1, gamma = 0.2499 leaves its domain, 0 to 0.2499"
    )


@pytest.mark.parametrize(
    ("name", "free"),
    [("chain", "gamma"), ("chain with springs", "spring"), ("ring", "gamma"), ("ring", "damping")],
)
def test_a_curve_at_a_frequency_ends_at_the_domain_as_that_of_the_scaled_problem(name, free):
    unit = 1.2 ** POWERS[free]
    own, scaled = (
        cb.trace(orbit, free, towards="both", events=(), inadmissible=True)
        for orbit in driven(name, 1.2)
    )
    ends = [(point.label, pytest.approx(unit * point[free])) for point in scaled.special]
    assert [(point.label, point[free]) for point in own.special] == ends
    assert [label for label, _ in ends] == ["EP1", "EP2"]


def test_a_boundary_in_the_frequency_and_the_coupling_ends_where_there_is_none():
    line = cb.boundary(along_omega(0.9, 0.05, False).first("PF"), ("omega", "gamma"))
    assert (line[-1].label, line[-1]["gamma"]) == ("EP1", 0.0)
    assert line.reason == "the domain of gamma ends at 0"


# --- runs, zones, commands ------------------------------------------------------------------------


def test_a_run_at_any_frequency_is_that_of_the_scaled_lattice():
    lattice, rng = cb.Ring(7), np.random.default_rng(3)
    state = rng.uniform(-0.8, 0.8, 7), rng.uniform(-1, 1, 7)
    w, shared = 1.7, {"lattice": lattice, "k": 0.7, "periods": 6, "t0": 0.4}
    run = cb.simulate(state, a=1.1, gamma=0.3, damping=0.02, spring=0.4, omega=w, **shared)
    scaled = cb.simulate(
        state, a=1.1 / w**2, gamma=0.3 / w**2, damping=0.02 / w, spring=0.4 / w**2, **shared
    )
    assert len(run.impacts) == len(scaled.impacts) > 10
    assert run.final.u == pytest.approx(scaled.final.u, abs=1e-9)
    assert (run.conditions.omega, run.conditions.gamma) == (w, 0.3)
    assert "omega" in str(run.table())


def test_a_periodic_motion_at_any_frequency_has_the_multipliers_of_the_orbit():
    orbit = cb.symmetric(0.8, 0.07, 0.8, damping=0.05, omega=1.2, lattice=cb.Ring(4))
    motion = cb.simulation.periodic(orbit)
    assert motion.largest == pytest.approx(abs(orbit.multipliers()).max(), abs=1e-9)


def test_a_sweep_of_the_frequency_keeps_the_velocities_of_the_sites():
    on = {"a": 0.0, "gamma": 0.0, "k": 1.0, "periods": 3}
    sweep = cb.simulation.sweep(([0.1], [0.3]), "omega", [1.0, 2.0, 4.0], **on)
    assert abs(sweep.final.v) == pytest.approx(0.3 / 4.0)  # in d omega


def test_what_is_about_the_band_is_in_the_time_of_the_drive():
    orbit, scaled = driven("ring", 1.9)
    assert band(orbit) == pytest.approx(band(scaled))


@pytest.mark.parametrize("free", ["omega", "a", "gamma"])
def test_what_is_proved_at_a_frequency_holds_the_scaled_breather(free):
    orbit, scaled = driven("chain", 1.3)
    proof, same = certify(orbit), certify(scaled)
    assert (proof.exists, proof.unique, proof.admissible) == (True, True, True)
    assert proof.unstable == same.unstable
    for name in ("p", "phi", "chi", "b"):
        one, other = proof.enclosure[name], same.enclosure[name]
        assert max(one.low, other.low) <= min(one.high, other.high) + 1e-14
    # tiles of a branch, from omega = 1 on, too, hold its points
    start = orbit if free != "omega" else scaled
    here = getattr(start, free)
    ends = (here, 1.05 * here)
    branch = cb.trace(start, free, within={free: ends}, towards="up", progress=False)
    covering = certify(branch)
    assert covering.tiles
    assert not covering.unproved
    for point in branch:
        tile = next(t for t in covering.tiles if t.covers.low <= point[t.along] <= t.covers.high)
        assert all(box.low <= point[n] <= box.high for n, box in tile.box.items())


def test_smooth_walls_have_no_frequency_but_in_the_units_that_the_sentence_says():
    """u/D and D omega^2 leave ``D^(2 m) = omega`` of the wall's (2 m + 1) |u|^(2 m) u' alone."""
    with pytest.raises(BadInput, match=r"units of D = omega\^\(1/\(2 m\)\).* a/\(D omega\^2\)"):
        cb.simulation.simulate_smooth(
            ([0.0], [0.0]), a=0.9, gamma=0.0, k=0.8, m=6, omega=1.3, periods=1
        )


def test_a_catalogue_of_multibreathers_at_a_frequency_is_that_of_the_scaled_problem():
    catalogue = multibreathers.multibreathers
    w2, on = 1.3**2, {"k": 0.8, "most": 2}
    mine = catalogue(cb.Ring(6), a=0.5 * w2, gamma=0.16 * w2, omega=1.3, **on)
    other = catalogue(cb.Ring(6), a=0.5, gamma=0.16, **on)
    assert {entry.exists for entry in other} == {True, False}
    for entry, scaled in zip(mine, other, strict=True):
        assert (entry.sites, entry.copies, entry.ended) == (
            scaled.sites,
            scaled.copies,
            scaled.ended,
        )
        assert entry.gamma == pytest.approx(scaled.gamma * w2, rel=1e-9)
        assert entry.orbit.omega == 1.3
        assert entry.orbit.times == pytest.approx(scaled.orbit.times, abs=1e-9)


@pytest.mark.slow
def test_zones_in_the_frequency_and_the_coupling_have_the_closed_forms():
    zones = cb.zones(k=0.8, a=0.5, within={"omega": (0.5, 3), "gamma": (0, 1.5)})
    assert (zones.pair, zones.held) == (("omega", "gamma"), {"a": 0.5})
    assert {kind for kind, _ in zones} == {"LP", "GR", "PF", "NS"}
    for kind in ("LP", "PF"):
        for line in zones[kind]:
            for w, gamma, p in zip(line["omega"], line["gamma"], line["p"], strict=True):
                means = cb.InfiniteChain()
                chi, sigma = (means.mean(gamma / w**2, name) for name in ("chi", "sigma"))
                size = math.hypot(1 / 9, chi) if kind == "LP" else 1 / math.hypot(1 / 9, 2 * sigma)
                scaled = 1 / (9 * size) if kind == "LP" else p / size
                assert 0.5 / w**2 == pytest.approx(scaled, abs=1e-9)
    assert "PF-GR" in zones.meetings()


@pytest.mark.slow
def test_zones_in_omega_and_a_are_those_in_gamma_and_a_in_other_coordinates(tmp_path):
    plane = cb.zones(k=0.8, gamma=0.05, within={"omega": (0.55, 1.2)})
    assert (plane.pair, dict(plane.held)) == (("omega", "a"), {"gamma": 0.05})
    assert cb.plot(plane).axes.get_title(loc="left") == r"$k$ = 0.8, $\gamma$ = 0.05"
    scaled = cb.zones(k=0.8, within={"gamma": (0.05 / 1.2**2, 0.05 / 0.55**2)})
    mine = {p.kind: (0.05 / p["omega"] ** 2, p["a"] / p["omega"] ** 2) for p in plane.special}
    theirs = {p.kind: (p["gamma"], p["a"]) for p in scaled.special}
    assert len(mine) == 3
    assert {frozenset(kind.split("-")) for kind in mine} == {
        frozenset(k.split("-")) for k in theirs
    }
    for kind, place in mine.items():
        other = theirs.get(kind) or theirs["-".join(reversed(kind.split("-")))]
        assert place == pytest.approx(other, abs=1e-9)
    # between the fold and the pitchfork there is a stable breather, below the fold none
    assert (plane.unstable(1.0, 0.4), plane.unstable(1.0, 0.01)) == (0, None)
    assert plane.unstable(0.4, 0.4) is None  # a harmonic in the band
    cb.save(tmp_path / "zones.nc", plane)
    again = cb.load(tmp_path / "zones.nc")
    assert again.held == plane.held
    assert again.unstable(1.0, 0.4) == 0
    assert len(again.curves["GR"][0]) == len(plane.curves["GR"][0])


def test_zones_at_another_frequency_are_scaled_ones():
    plane = cb.zones(k=0.8, omega=1.5, within={"gamma": (0.1, 0.2)})
    scaled = cb.zones(k=0.8, within={"gamma": (0.1 / 2.25, 0.2 / 2.25)})
    (mine,), (other,) = plane.special, scaled.special
    assert (mine["gamma"] / 2.25, mine["a"] / 2.25) == pytest.approx((other["gamma"], other["a"]))
    with pytest.raises(BadInput, match="past_folds: lower breathers are drawn at omega = 1"):
        cb.zones(k=0.8, omega=1.5, past_folds=True)
    with pytest.raises(BadInput, match="exactly one of k, gamma and a"):
        cb.zones(k=0.8, gamma=0.1, omega=1.5)


@pytest.mark.slow
def test_zones_of_a_coupling_go_up_to_the_band_of_their_frequency_and_lattice():
    """Not to 1/4, where the band of the chain comes to the frequency 1."""
    plane, scaled = cb.zones(gamma=0.6, omega=2.0), cb.zones(gamma=0.15)
    ours, theirs = ([(p.kind, p["k"], p["a"]) for p in zones.special] for zones in (plane, scaled))
    assert [(kind, k, a / 4) for kind, k, a in ours] == [pytest.approx(one) for one in theirs]
    with pytest.raises(BadInput, match="harmonic 1 of the drive, 2, is in the band of the lattice"):
        cb.zones(gamma=1.2, omega=2.0)
    with pytest.raises(BadInput, match=r"gamma = 0.6: .* stays below the forcing frequency 1"):
        cb.zones(gamma=0.6)
    pair = cb.zones(gamma=0.3, lattice=cb.OpenChain(2), within={"k": (0.7, 0.72)})
    fold = pair["LP"][0][
        0
    ]  # eq. (14), with the mean of tan(pi w/2)/w over modes 0 and sqrt(2 gamma)
    q, w = (1 - fold["k"]) / (1 + fold["k"]), math.sqrt(0.6)
    chi = 0.5 * (0.5 * math.pi + math.tan(0.5 * math.pi * w) / w)
    assert fold["a"] == pytest.approx(q / math.hypot(chi, q))


@pytest.mark.slow
def test_commands_look_at_couplings_up_to_the_band_of_their_frequency(capsys):
    """At omega = 2 up to four times as large ones as at 1, where a start was outside its window."""
    from contbreather.cli import main

    scaled = cb.zones(k=0.7, within={"gamma": (0.06, 0.08)})["PF"][0].special[-1]
    for line in ("branch --free gamma --gamma 0.6 --a 2", "boundary PF"):
        main([*line.split(), "--k", "0.7", "--omega", "2", "--json"])
        ends = json.loads(capsys.readouterr().out)["special"]
        assert ends[-1]["kind"] in ("GR", "PF-GR")
    assert (ends[-1]["gamma"] / 4, ends[-1]["a"] / 4) == pytest.approx(
        (scaled["gamma"], scaled["a"])
    )


def test_the_command_line_and_studies_have_the_frequency(capsys):
    from contbreather.cli import main
    from contbreather.studies.schema import Chain

    point = ["point", "--a", "0.5", "--gamma", "0.04", "--k", "0.8"]
    assert main([*point, "--omega", "1.1", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["omega"], said["p"]) == (1.1, cb.symmetric(0.5, 0.04, 0.8, omega=1.1).p)
    assert main([*point, "--omega", "0.3"]) == 2
    assert "harmonic 1 of the drive" in capsys.readouterr().err
    assert Chain(omega=1.1).on["omega"] == 1.1
