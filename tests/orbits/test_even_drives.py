"""Drives with even harmonics and an offset, whole periods of their orbits: against an integrator of
its own, walls that are shifted, the simulation, and a pitchfork that they break."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.errors import BadInput, NoSolution
from contbreather.lattice import Fourier
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import stiffness_of
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import orbit_at, orbit_of
from contbreather.orbits.section import Section
from contbreather.orbits.symmetries import simpler_than
from contbreather.simulation import localisation, periodic, simulate

from .field import FieldOf

ON = {"a": 0.5, "gamma": 0.03, "k": 0.8}
UNEVEN = cb.Lattice(
    np.array([[1.0, -1.0, 0.0], [-1.0, 2.5, -1.5], [0.0, -1.5, 1.5]]),
    masses=[1.0, 2.0, 1.5],
    drive=[1.0, 0.7, 1.2],
)
PLACES: dict[str, tuple[Any, float, Any, float]] = {  # lattice, damping, spring, size of the mean
    "ring": (cb.Ring(6), 0.0, 0.0, 0.002),
    "damped ring": (cb.Ring(5), 0.02, 0.0, 0.003),
    "open chain": (cb.OpenChain(4), 0.02, 0.0, 0.003),
    "fixed ends": (cb.OpenChain(5, ends="fixed"), 0.01, 0.0, 0.003),
    "springs": (cb.OpenChain(3), 0.0, 0.15, 0.05),
    "damped springs": (cb.Ring(4), 0.01, 0.2, 0.05),
    "one": (cb.Ring(1), 0.0, 0.0, 0.05),
    "masses and drives": (UNEVEN, 0.03, 0.1, 0.03),
    "springs by sites": (cb.Ring(3), 0.01, np.array([0.2, 0.1, 0.3]), 0.04),
}


@cache
def orbit(place: str, seed: int) -> Any:
    """An orbit under a random drive, from the breather of its odd harmonics."""
    lattice, damping, spring, size = PLACES[place]
    c0, c2, s2, c3, s4 = np.random.default_rng(seed).uniform(-1.0, 1.0, 5) * (size, *[0.12] * 4)
    full = Fourier(cos={0: c0, 1: -1.0, 2: c2, 3: c3}, sin={2: s2, 4: s4})
    on = {"lattice": lattice, "damping": damping, "spring": spring}
    odd = cb.symmetric(**ON, forcing=Fourier(cos={1: -1.0, 3: c3}), **on)
    return orbit_at(cb.shooting(odd, symmetric=False, forcing=full))


@pytest.mark.parametrize("omega", [1.0, 1.2])
def test_a_search_for_breathers_finds_what_they_become_under_the_whole_drive(omega: float) -> None:
    """As the shot of `shooting` from the breather of the odd harmonics does."""
    drive = Fourier(cos={0: -0.01, 1: -1.0, 2: -0.05})
    on = {"a": 0.5, "gamma": 0.03, "k": 0.8, "lattice": cb.Ring(5), "damping": 0.02, "spring": 0.2}
    found = cb.orbits.find_symmetric("a", (0.5, 0.5), forcing=drive, omega=omega, **on)
    shot = cb.shooting(cb.symmetric(**on, omega=omega), symmetric=False, forcing=drive)
    assert (found.omega, found.section.sign) == (omega, 1)
    assert found.times == pytest.approx(orbit_at(shot).times, abs=1e-11)
    assert found.impulses == pytest.approx(orbit_at(shot).impulses, abs=1e-11)
    if omega == 1.0:
        FieldOf(found).comes_back(1e-9)
    branch = cb.trace(found, "c2", within={"c2": (-0.1, 0.0)})
    assert branch["asymmetry"][0] != branch["asymmetry"][-1]


def test_a_drive_without_odd_harmonics_is_not_said_to_be_zero() -> None:
    """No breather of odd harmonics is there to begin with."""
    drive = cb.Symbolic("0.3 + cos(2*t)")
    with pytest.raises(BadInput, match=r"0\.3 \+ cos\(2 \* t\).* has no odd harmonics.*shoot one"):
        cb.orbits.find_symmetric("a", (0.1, 0.9), gamma=0.03, k=0.8, forcing=drive)


def test_kinds_that_broken_symmetry_has_not_are_named() -> None:
    drive = cb.Symbolic("-cos(t) - 0.05*cos(2*t)")
    with pytest.raises(BadInput, match=r"kind under this drive must be .LP., .BP., .* got .PF."):
        cb.orbits.find_event("PF", ("gamma", "a"), gamma=0.03, k=0.8, forcing=drive)
    fold = cb.orbits.find_event("LP", ("gamma", "a"), gamma=0.03, k=0.8, forcing=drive)
    assert fold.solution.section.sign == 1


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("place", PLACES)
def test_an_orbit_returns_by_an_integrator_of_its_own(place: str, seed: int) -> None:
    found = orbit(place, seed)
    FieldOf(found).comes_back(1e-10)
    assert not found.symmetric
    assert bool(found.admissibility())


@pytest.mark.parametrize("place", ["ring", "masses and drives", "springs by sites", "one"])
def test_its_multipliers_are_those_of_the_integrated_map(place: str) -> None:
    """By their characteristic polynomial: multipliers by themselves may be double."""
    found = orbit(place, 1)
    own, wanted = (np.poly(of.multipliers()).real for of in (found, FieldOf(found)))
    np.testing.assert_allclose(own, wanted, rtol=0, atol=2e-7)


@pytest.mark.parametrize("place", PLACES)
def test_equations_know_their_derivatives_in_every_parameter(place: str) -> None:
    found = orbit(place, 1)
    equations, x = found.representation.equations, found.representation.x
    params = found.conditions.params
    for name, value in params.items():
        h = 1e-5 if value or name in {"c0"} else 0.0  # springs and damping at 0 are edges
        if not h:
            continue
        up, down = (equations.residual(x, {**params, name: value + s}) for s in (h, -h))
        exact = equations.along(x, params, {name: 1.0})
        np.testing.assert_allclose(exact, (up - down) / (2 * h), rtol=0, atol=2e-8, err_msg=name)


@pytest.mark.parametrize("place", ["springs", "damped springs", "masses and drives"])
def test_an_offset_at_springs_is_a_shift_of_the_walls(place: str) -> None:
    """u = w + s solves the same equations without the offset, K s = a F0 d."""
    found = orbit(place, 2)
    on, lattice = found.conditions, found.lattice
    K = on.gamma * stiffness_of(lattice).toarray() + on.spring * np.diag(lattice.masses)
    shift = np.linalg.solve(K, on.a * on.forcing.params["c0"] * lattice.masses * lattice.drive)
    drive = Fourier({m: c for m, c in on.forcing.cos if m}, dict(on.forcing.sin))
    walls = {n: (-1.0 - s, 1.0 - s) for n, s in enumerate(shift.tolist())}
    other = orbit_at(cb.shooting(found, walls=walls, forcing=drive))
    times = np.linspace(0.0, 2 * math.pi, 7)[:, None]
    each = np.arange(lattice.sites)
    np.testing.assert_allclose(
        found.displacement(each, times), other.displacement(each, times) + shift, atol=1e-12
    )
    assert found.c == pytest.approx(other.c + shift.mean(), abs=1e-12)
    assert found.admissibility().margin == pytest.approx(other.admissibility().margin, abs=1e-12)


@pytest.mark.parametrize("k", [0.0, 0.6])
@pytest.mark.parametrize("ring", [True, False])
def test_a_simulation_takes_an_offset_as_a_shift_of_the_walls(k: float, ring: bool) -> None:
    """With rests on the walls, k = 0, and without."""
    lattice, spring = (cb.Ring(4) if ring else UNEVEN), 0.4
    K = 0.1 * stiffness_of(lattice).toarray() + spring * np.diag(lattice.masses)
    shift = np.linalg.solve(K, 0.8 * 0.2 * lattice.masses * lattice.drive)
    odd = {"cos": {1: -1.0, 2: 0.3}, "sin": {3: 0.2}}
    n, on = lattice.sites, {"a": 0.8, "gamma": 0.1, "k": k, "spring": spring, "periods": 3}
    u, v = 0.1 * np.arange(n), 0.2 - 0.1 * np.arange(n)
    walls = {i: (-1.0 - s, 1.0 - s) for i, s in enumerate(shift.tolist())}
    full = Fourier({0: 0.2, **odd["cos"]}, odd["sin"])
    with_mean = simulate((u, v), **on, lattice=lattice, forcing=full, damping=0.02)
    shifted = simulate(
        (u - shift, v), **on, lattice=lattice, forcing=Fourier(**odd), walls=walls, damping=0.02
    )
    assert len(with_mean.impacts) == len(shifted.impacts) > 5
    assert (len(with_mean.rests) > 0) == (k == 0.0)
    np.testing.assert_allclose(with_mean.final.u, shifted.final.u + shift, rtol=0, atol=1e-10)
    np.testing.assert_allclose(with_mean.final.v, shifted.final.v, rtol=0, atol=1e-10)


def test_nothing_holds_a_free_lattice_and_a_simulation_drifts_with_its_offset() -> None:
    """Its centre of mass, far from all walls: a F0 t^2/2 besides a (cos t - 1)."""
    drive = Fourier(cos={0: 0.01, 1: -1.0})
    still = np.zeros(3)
    run = simulate(
        (still, still), a=0.3, gamma=0.1, k=0.5, lattice=cb.OpenChain(3), forcing=drive,
        walls=(-50.0, 50.0), periods=4,
    )  # fmt: skip
    np.testing.assert_allclose(run.final.u, 0.5 * 0.003 * (8 * math.pi) ** 2, atol=1e-12)


# --- a broken pitchfork ---------------------------------------------------------------------------


def _branch(arm: int, share: float) -> Any:
    """Down from beyond the pitchfork, along what was one of its arms."""
    seed = asymmetric(0.8, 0.04, 0.8, arm=arm, lattice=cb.Ring(6))
    start = cb.shooting(seed, forcing=Fourier(cos={1: -1.0, 2: share}))
    return cb.trace(start, "a", within={"a": (0.72, 0.82)}, towards="down")


@pytest.mark.slow
def test_a_small_even_harmonic_breaks_a_pitchfork_into_a_fold_and_nothing() -> None:
    """The cusp a - a_PF = const share^(2/3), as of every imperfect pitchfork."""
    whole = cb.symmetric(0.7, 0.04, 0.8, lattice=cb.Ring(6))
    fork = cb.trace(whole, "a", within={"a": (0.7, 0.8)}, towards="up").first("PF")
    rates, folds = [], []
    for share in (1e-4, 8e-4):
        cut, passing = _branch(1, share), _branch(-1, share)
        assert [point.kind for point in cut.special].count("LP") == 1
        assert passing[-1]["a"] == pytest.approx(0.72)
        assert not {"LP", "BP", "PF"} & {point.kind for point in passing.special}
        folds.append(cut.first("LP"))
        rates.append((folds[-1]["a"] - fork["a"]) / share ** (2 / 3))
    assert rates[0] == pytest.approx(rates[1], rel=5e-3)
    assert rates[0] > 0.4
    # the other sign of the harmonic cuts the other arm
    assert "LP" in [point.kind for point in _branch(-1, -1e-4).special]
    # the fold's curve has its cusp at the pitchfork
    line = cb.boundary(folds[0], ("c2", "a"), within={"c2": (-0.003, 0.003), "a": (0.7, 0.9)})
    cusp = line.first("CP")
    assert cusp["a"] == pytest.approx(fork["a"], abs=1e-9)
    assert abs(cusp["c2"]) < 1e-9


def test_where_the_harmonic_is_zero_the_whole_period_has_a_branch_point_there() -> None:
    """It leads to both arms: no symmetry is used, and none is named, from an arm neither."""
    whole = cb.symmetric(0.75, 0.04, 0.8, lattice=cb.Ring(6))
    start = cb.shooting(whole, symmetric=False, forcing=Fourier(cos={1: -1.0, 2: 0.0}))
    assert simpler_than(orbit_at(start)) is None
    assert "BP" in {point.kind for point in _branch(1, 0.0).special}
    branch = cb.trace(start, "a", within={"a": (0.7, 0.8)}, towards="up")
    crossing = branch.first("BP")
    assert crossing["a"] == pytest.approx(0.7776324456, abs=1e-9)
    arms = cb.switch(crossing, within={"a": (0.7, 0.79)})
    ends = sorted(arm[-1]["asymmetry"] for arm in arms)
    assert ends[1] == pytest.approx(-ends[0], abs=1e-9)
    assert ends[1] > 0.1


def test_a_curve_of_grazing_passes_equal_flights() -> None:
    """Which are nothing special where the second half is no mirror image of the first: there both
    maxima touch, not quite at equal flights."""
    odd = cb.symmetric(0.4, 0.1, 0.4, lattice=cb.Ring(6), damping=0.01)
    start = cb.shooting(odd, symmetric=False, forcing=Fourier({1: -1.0, 2: -0.02}, {4: 0.01}))
    branch = cb.trace(start, "a", within={"a": (0.3, 1.0)}, towards="up", events=[cb.grazing()])
    line = cb.boundary(branch.first("GR"), ("c2", "a"), within={"c2": (-0.1, 0.1), "a": (0.2, 1.2)})
    assert [point.kind for point in line.special] == ["EP", "GR-GR"]
    assert line[-1].solution.asymmetry < -1e-3


# --- branches -------------------------------------------------------------------------------------


@cache
def doubling() -> Any:
    lattice, drive = cb.Ring(1), Fourier(cos={0: 0.02, 1: -1.0, 2: 0.01})
    seed = asymmetric(0.9, 0.0, 0.8, lattice=lattice)
    start = cb.shooting(seed, forcing=drive)
    return cb.trace(start, "a", within={"a": (0.85, 1.0)}, towards="up").first("PD")


def test_a_doubling_is_one_of_the_simulation_and_its_arm_repeats_after_two_periods() -> None:
    point = doubling()
    assert abs(point.solution.multipliers() + 1.0).min() < 1e-7
    arm = cb.switch(point, within={"a": (0.85, 1.0)})
    twice = (arm[0] if isinstance(arm, tuple) else arm)[-1].solution
    u, v = twice.state()
    on = twice.conditions
    run = simulate((u, v), a=on.a, gamma=0.0, k=on.k, lattice=cb.Ring(1), forcing=on.forcing,
                   periods=2)  # fmt: skip
    np.testing.assert_allclose(np.concatenate(run.final), np.concatenate([u, v]), atol=1e-9)
    assert abs(run.strobe.u[1] - run.strobe.u[0]).max() > 1e-3


def test_it_is_followed_in_the_offset() -> None:
    line = cb.boundary(doubling(), ("c0", "a"), within={"c0": (-0.05, 0.05), "a": (0.5, 1.5)})
    assert np.ptp(line["c0"]) > 0.01
    for end in (line[0], line[-1]):
        assert abs(end.solution.multipliers() + 1.0).min() < 1e-6


def test_offsets_of_several_sites_and_coefficients_have_names_of_their_own() -> None:
    drive = Fourier(cos={1: -1.0, 2: 0.05})
    two = cb.multibreather([0, 3], **ON, lattice=cb.Ring(6), forcing=drive)
    branch = cb.trace(two, "c2", within={"c2": (0.0, 0.1)}, towards="both")
    assert {"offset1", "offset2", "c1", "c2"} <= {*branch.columns()}
    assert branch["c2"].min() == 0.0
    # at c2 = 0 it is the whole period of the symmetric one
    whole = cb.multibreather([0, 3], **ON, lattice=cb.Ring(6))
    end = branch[int(branch["c2"].argmin())].solution
    assert abs(end.impulses) == pytest.approx(np.full(4, abs(whole.impulses[0])), abs=1e-9)


# --- multibreathers, one wall, no end -------------------------------------------------------------


@pytest.mark.slow
def test_multibreathers_grow_out_of_their_odd_harmonics() -> None:
    drive, lattice = Fourier(cos={0: 0.02, 1: -1.0, 2: 0.1}, sin={2: 0.05}), cb.OpenChain(5)
    on = {**ON, "lattice": lattice, "damping": 0.01, "spring": 0.2, "forcing": drive}
    two = cb.multibreather([0, 2], **on)
    FieldOf(two).comes_back(1e-10)
    assert len(two.hits) == 4
    entries = cb.multibreathers(most=1, **on)
    assert [entry.exists for entry in entries] == [True] * 3


@pytest.mark.parametrize("level", [0.0, -1.0])
def test_a_ball_on_a_vibrating_table_is_as_in_its_closed_form(level: float) -> None:
    """Once in a period; a table at rest is a wall at 0, from where heights are counted."""
    k = 0.6
    fold, flip = math.pi * (1 - k) / (1 + k), 2 * (1 + k * k) / (1 + k) ** 2
    ball = cb.shooting(
        {"t1": 1.0}, a=1.0, gamma=0.0, k=k, lattice=cb.Ring(1), walls=(level, None),
        sequence=((0, -1),), forcing=cb.Fourier(cos={0: -1.0, 1: fold + 0.1}),
    )  # fmt: skip
    branch = cb.trace(ball, "c1", within={"c1": (0.5, 2.0)}, towards="both")
    assert branch.first("LP")["c1"] == pytest.approx(fold, abs=1e-12)
    assert branch.first("PD")["c1"] == pytest.approx(math.hypot(fold, flip), abs=1e-12)


def test_an_offset_alone_brings_a_site_back_to_its_one_wall() -> None:
    """A ball on a vibrating table, of the rest of a free lattice."""
    drive = Fourier(cos={0: 1.0, 1: -0.5})
    on = Conditions(0.2, 0.0, 0.8, forcing=drive, lattice=cb.Ring(1))
    # from the balance: J = -2 pi a F0 once in a period
    found = orbit_of(on, Section(((0, 1),)), [1.0], [-0.4 * math.pi], [0.5]).solved()
    assert found.impulses == pytest.approx([-0.4 * math.pi], abs=1e-12)
    # the mean velocity at the impact is -q J/2, that of the drive there
    assert -0.1 * math.sin(found.times[0]) == pytest.approx(-found.impulses[0] / 18.0, abs=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_infinite_chain_has_orbits_of_even_harmonics(sign: int) -> None:
    """As a long ring has, next to which its sites are; its far field has two walls."""
    drive = Fourier(cos={1: -sign, 2: 0.1 * sign}, sin={2: 0.05 * sign})
    odd = cb.symmetric(**ON, forcing=Fourier(cos={1: -sign}), lattice=cb.Ring(40))
    ring = orbit_at(cb.shooting(odd, symmetric=False, forcing=drive))
    on = replace(ring.conditions, lattice=cb.InfiniteChain())
    chain = orbit_of(on, ring.section, ring.times, ring.impulses, ring.offsets).solved()
    np.testing.assert_allclose(chain.times, ring.times, rtol=0, atol=1e-9)
    far = chain.displacement(60, np.linspace(0.0, 2 * math.pi, 20001))
    assert chain.admissibility().far == pytest.approx(1.0 - abs(far).max(), abs=1e-7)
    assert chain.displacement(60, chain.admissibility().places["far"][1]) == pytest.approx(
        far[abs(far).argmax()], abs=1e-3
    )
    branches = [cb.trace(start, "a", within={"a": (0.5, 0.6)}) for start in (chain, ring)]
    np.testing.assert_allclose(branches[0][-1]["t2"], branches[1][-1]["t2"], rtol=0, atol=1e-9)
    assert branches[0][-1].solution.residual < 1e-11


def test_times_of_what_is_closest_to_its_limit_are_those_of_the_period() -> None:
    found = cb.orbits.find_symmetric(
        "a", (0.3, 0.3), gamma=0.05, k=0.8, forcing="cos(t)+.3*cos(2*t)"
    )
    site, time = found.admissibility().places["neighbours"]
    assert 0.0 < time < 2 * math.pi
    assert found.velocity(site, time) == pytest.approx(0.0, abs=1e-12)


# --- refusals -------------------------------------------------------------------------------------

LOPSIDED = Fourier(cos={0: 0.1, 1: -1.0, 2: 0.0}, sin={4: 0.1})
NEEDS = (
    r"F = a \(.*\), has a mean and the even harmonics 2, 4: .* no pitchfork; drop them, or shoot "
    r"the whole period .* shooting\(b, forcing=..., symmetric=False\)"
)


def _half(**more: Any) -> Any:
    return cb.shooting(cb.symmetric(**ON), sites=6, forcing=LOPSIDED, **more)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: cb.symmetric(**ON, forcing=LOPSIDED), NEEDS),
        (lambda: cb.zones(k=0.8, forcing=LOPSIDED), NEEDS),
        (lambda: cb.orbits.find_symmetric("a", (0.5, 0.8), gamma=0.1, k=0.8, forcing=LOPSIDED),
         "has a mean: nothing holds an infinite chain against it; take a finite lattice"),
        (_half, NEEDS),
        (lambda: _half(symmetric=True), NEEDS),
        (lambda: cb.symmetric(**ON, forcing="-cos(t) + cos(2*t)"), "has the even harmonic 2: "),
        # a branch in it would leave the symmetry without a word
        (lambda: cb.symmetric(**ON, forcing=Fourier(cos={1: -1.0, 2: 0.0})),
         "has the even harmonic 2: "),
        (lambda: cb.symmetric(**ON, forcing=lambda t: 1.0 - math.cos(t)), "has a mean: without"),
        (lambda: periodic(([0.0], [0.0]), **ON, forcing=LOPSIDED, symmetric=True), NEEDS),
        (lambda: cb.multibreather([0], **ON, forcing=LOPSIDED, lattice=cb.Ring(4)),
         "has a mean, and nothing holds sites of the ring of 4 against it .* springs"),
        (lambda: orbit("ring", 1).on(cb.InfiniteChain()),
         "has a mean: nothing holds an infinite chain against it; take a finite lattice"),
    ],
)  # fmt: skip
def test_what_needs_a_symmetry_or_a_hold_is_refused_with_what_to_do(make: Any, says: str) -> None:
    with pytest.raises((BadInput, NoSolution), match=says):
        make()


def test_what_follows_the_drive_with_its_offset_has_no_energy_of_its_own() -> None:
    """Displacements count from the static one where springs hold it."""
    u = np.full(4, 0.5 * (0.3 / 0.4 - 1.0 / (0.4 - 1.0)))  # a (F0/s + F1/(s - 1))
    on = {"a": 0.5, "gamma": 0.05, "forcing": Fourier(cos={0: 0.3, 1: -1.0})}
    assert abs(localisation(u, np.zeros(4), spring=0.4, **on).energy).max() < 1e-30
