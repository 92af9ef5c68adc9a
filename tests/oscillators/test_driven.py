"""Driven lattices and walls: beside integration in time, and the chain of the paper."""

from __future__ import annotations

import re

import numpy as np
import pytest

import contbreather as cb
from contbreather.lattice.conditions import Conditions
from contbreather.oscillators import anticontinuum
from tests.orbits.field import Field
from tests.stability.by_hand import apart

pytestmark = pytest.mark.slow

DUFFING = {"b": 1.0, "c": 0.02, "d": 0.1, "a": 0.15}


@pytest.fixture(scope="module")
def driven():
    chain = cb.Oscillators(
        V="u**2/2 + b*u**4/4", W="c*r**2/2", lattice=cb.OpenChain(4),
        damping="d", drive="a*cos(omega*t)",
    )  # fmt: skip
    return cb.breather(chain, {1: "high"}, omega=1.3, params=DUFFING)


def test_a_driven_breather_attracts_what_starts_beside_it(driven) -> None:
    orbit = driven.solution
    assert orbit.unstable == 0
    assert orbit.swings[1] > 3 * orbit.swings[3]
    run = cb.integrate(driven, periods=40, perturb=1e-3)
    np.testing.assert_allclose(run.final, orbit.states(0.0), atol=1e-6)
    exact = cb.integrate(driven, periods=1)
    np.testing.assert_allclose(exact.final, orbit.states(0.0), atol=1e-9)


def test_the_largest_displacement_is_that_of_the_motion_between_samples(driven) -> None:
    orbit = driven.solution
    u = orbit.displacement(slice(None), np.linspace(0.0, orbit.period, 20001))
    assert orbit.farthest == pytest.approx(abs(u).max(), abs=1e-7)


def test_losses_are_the_product_of_all_multipliers(driven) -> None:
    """Liouville: the volume shrinks by exp(-N d T)."""
    orbit = driven.solution
    assert np.prod(orbit.multipliers).real == pytest.approx(np.exp(-4 * 0.1 * orbit.period))


def test_a_site_may_be_damped_by_its_neighbours_alone() -> None:
    """Liouville: as much as the two others lose. A warning of NumPy's would be an error here."""
    lattice = cb.Lattice(cb.OpenChain(3).stiffness, dampings=[1, 0, 1])
    how = {"lattice": lattice, "damping": "d", "drive": "a*cos(omega*t)"}
    chain = cb.Oscillators("u**2/2 + b*u**4/4", "c*r**2/2", **how)
    orbit = cb.breather(chain, {0: "high"}, omega=1.3, params={**DUFFING, "c": 0.05}).solution
    assert np.prod(orbit.multipliers).real == pytest.approx(np.exp(-2 * 0.1 * orbit.period))


def test_its_frequency_response_folds(driven) -> None:
    branch = cb.trace(
        driven, "omega", within={"omega": (1.25, 1.45)}, towards="up", events=[cb.fold()]
    )
    assert branch.first("LP")["omega"] > 1.3
    assert branch["max|u|"].max() > driven.solution.farthest


def test_doublings_of_sites_that_are_almost_alike_are_all_found() -> None:
    """Without coupling those of bistable sites, within one step, are those of each alone."""

    def doublings(shares):
        lattice = cb.OpenChain(len(shares))
        how = {"lattice": lattice, "damping": 0.1, "drive": "a*cos(omega*t)", "onsite": shares}
        chain = cb.Oscillators("(u**2 - 2*u)**2/8", "0*r", **how)
        start = cb.breather(chain, {0: "low"}, omega=1.2, params={"a": 0.1})
        branch = cb.trace(start, "a", within={"a": (0.05, 0.5)}, towards="up")
        return [point["a"] for point in branch.special if point.kind == "PD"]

    shares = [1.04, 1.02, 1.0]
    alone = [doublings([share])[0] for share in shares]
    assert doublings(shares) == pytest.approx(alone, abs=1e-8)


def test_high_needs_two_attractors_and_a_drive_a_damping() -> None:
    how = {"V": "u**2/2", "W": "c*r**2/2", "lattice": cb.Ring(3), "drive": "a*cos(omega*t)"}
    linear = cb.Oscillators(**how, damping=0.2)
    with pytest.raises(cb.NoSolution, match="one attractor only"):
        cb.breather(linear, {0: "high"}, omega=1.3, params={"c": 0.1, "a": 0.1})
    with pytest.raises(cb.BadInput, match="damping above 0"):
        cb.breather(cb.Oscillators(**how), {0: "high"}, omega=1.3, params={"c": 0.1, "a": 0.1})


def test_a_code_that_is_refused_takes_no_more_work_than_one_that_is_found() -> None:
    """Attractors of single sites, which take longest, are looked for once."""
    calls = [0]

    def drive(t, p):
        calls[0] += 1
        return 0.1 * np.cos(p["omega"] * t)

    chain = cb.Oscillators("u**2/2", "r**2/20", cb.Ring(3), damping=0.2, drive=drive)
    cb.breather(chain, {0: "low"}, omega=1.3)
    found, calls[0] = calls[0], 0
    with pytest.raises(cb.NoSolution, match="one attractor only"):
        cb.breather(chain, {0: "high"}, omega=1.3)
    assert calls[0] < found


@pytest.mark.parametrize(
    ("drive", "more", "code", "says"),
    [
        (
            "a*cos(t)",
            {"damping": 0.2},
            {0: "low"},
            r"the breather, 2\*pi/omega = 4.83322",
        ),
        ("a*cos(omega*t)", {"damping": 0.2}, {0: 1, 2: -1}, "site 2: -1 was given; 'low', 'high'"),
        ("a*cos(omega*t)", {"walls": 1.0, "k": 0.8}, {0: 1, 2: -1}, "1 is expected for each site"),
        (None, {"walls": 1.0, "k": 1.0}, {0: 1}, "a driven lattice is needed"),
        ("a*cos(omega*t)", {"walls": 1.0, "k": 1.3}, {0: 1}, "a restitution from 0 to 1"),
        ("a*cos(omega*t)", {"walls": -1.0, "k": 0.8}, {0: 1}, "above 0"),
    ],
)
def test_a_code_that_does_not_fit_the_drive_is_refused(drive, more, code, says) -> None:
    chain = cb.Oscillators(V="u**2/2", W="c*r**2/2", lattice=cb.Ring(3), drive=drive, **more)
    params = {name: 0.1 for name in ("c", "a") if name in chain.names}
    with pytest.raises(cb.BadInput, match=says):
        cb.breather(chain, code, omega=1.3, params=params)


def test_a_drive_of_one_period_has_no_branch_in_the_frequency() -> None:
    chain = cb.Oscillators(V="u**2", W="c*r**2/2", lattice=cb.Ring(3), damping=0.2, drive="cos(t)")
    start = cb.breather(chain, {0: "low"}, omega=1.0, params={"c": 0.1})
    with pytest.raises(cb.BadInput, match=r"write its time as omega\*t"):
        cb.trace(start, "omega", within={"omega": (0.9, 1.1)})


def test_what_escapes_is_no_attractor() -> None:
    """Beyond a Morse potential nothing leads back: the least motion is that about rest."""
    chain = cb.Oscillators(
        V="(1 - exp(-b*u))**2/(2*b**2)", W="c*r**2/2", lattice=cb.Ring(3), damping=0.069,
        drive="a*cos(omega*t)",
    )  # fmt: skip
    low = cb.breather(chain, {0: "low"}, omega=0.7586, params={"b": 1.146, "c": 0.01, "a": 0.06})
    run = cb.integrate(low, periods=30, perturb=1e-3)
    np.testing.assert_allclose(run.final, low.solution.states(0.0), atol=1e-4)
    assert 0.1 < low.solution.farthest < 0.2


@pytest.mark.parametrize(("damping", "a", "omega"), [(0.08, 0.25, 0.75), (0.1, 0.4, 0.7)])
def test_pendula_that_went_round_before_are_no_other_attractors(damping, a, omega) -> None:
    """Under an odd drive the attractors about rest are odd; some starts go round on their way."""
    chain = cb.Oscillators(
        V="1 - cos(u)", W="c*r**2/2", lattice=cb.OpenChain(3), damping=damping,
        drive="a*cos(omega*t)",
    )  # fmt: skip
    orbit = cb.breather(chain, {1: "high"}, omega=omega, params={"c": 0.002, "a": a}).solution
    first, later = orbit.states(0.3), orbit.states(0.3 + np.pi / omega)
    np.testing.assert_allclose(first, -later, atol=1e-6)
    assert orbit.swings[1] > 2 * orbit.swings[0]


def test_an_attractor_with_a_small_basin_is_found_beside_the_free_swing() -> None:
    """Of starts on circles about rest one in 24 leads to it; it is an orbit that stays."""
    chain = cb.Oscillators(
        V="1 - cos(u)", W="c*r**2/2", lattice=cb.OpenChain(2), damping=0.05,
        drive="0.2*cos(omega*t)",
    )  # fmt: skip
    high = cb.breather(chain, {0: "high"}, omega=0.6, params={"c": 0.0})
    run = cb.integrate(high, periods=30, perturb=1e-3)
    np.testing.assert_allclose(run.final, high.solution.states(0.0), atol=1e-4)
    assert high.solution.farthest == pytest.approx(2.6966, abs=1e-3)


def test_where_nothing_settles_orbits_are_not_solved_for() -> None:
    """These pendula go round, or are in chaos; each of their ends was tried for seconds."""
    calls = 0

    def drive(t, p):
        nonlocal calls
        calls += 1
        return 0.6 * np.cos(p["omega"] * t)

    chain = cb.Oscillators(
        V="1 - cos(u)", W="c*r**2/2", lattice=cb.OpenChain(2), damping=0.1, drive=drive
    )
    with pytest.raises(cb.NoSolution, match="alone it has no attractor of the period"):
        cb.breather(chain, {0: "low"}, omega=0.7, params={"c": 0.0})
    assert calls < 8_000


def test_of_two_wells_that_are_mirror_images_that_at_rest_is_low() -> None:
    chain = cb.Oscillators(
        V="u**2*(u + 2)**2/4", W="c*r**2/2", lattice=cb.Ring(3), damping=0.1, drive="a*cos(omega*t)"
    )
    orbit = cb.breather(chain, {0: "low"}, omega=1.0, params={"c": 0.01, "a": 0.2}).solution
    assert all(orbit.min[f"u{n}"] > -0.3 for n in range(3))


def test_sites_unlike_are_in_the_same_of_two_wells_that_are_mirror_images() -> None:
    chain = cb.Oscillators(
        V="(u**2 - 1)**2/4", W="c*r**2/2", lattice=cb.Ring(3), masses=[1, 1.1, 1.2], damping=0.1,
        drive="a*cos(omega*t)",
    )  # fmt: skip
    for omega in (1.0, 1.2, 1.5):
        orbit = cb.breather(chain, {0: "low"}, omega=omega, params={"c": 0.01, "a": 0.05}).solution
        assert all(orbit.min[f"u{n}"] > 0 for n in range(3))


def test_small_swings_in_wells_of_unlike_depth_are_attractors_apart() -> None:
    """Each of them responds as its well does to so weak a drive, V'' of it apart from omega**2."""
    chain = cb.Oscillators(
        V="u**2*(u + 2)**2/4 + u**3/20", W="c*r**2/2", lattice=cb.Ring(3), damping=0.1,
        drive="a*cos(omega*t)",
    )  # fmt: skip
    orbit = cb.breather(chain, {0: "high"}, omega=0.9, params={"c": 1e-6, "a": 2e-3}).solution
    well = np.roots([1.0, 3.15, 2.0]).min()
    for n, u in enumerate([0.0, well, well]):
        stiffness = 3 * u**2 + 6.3 * u + 2
        response = 2e-3 / abs(stiffness - 0.81 + 0.09j)
        assert orbit.swings[n] == pytest.approx(2 * response, rel=0.01)


@pytest.mark.parametrize("omega", [0.99, 1.0])
def test_a_resonance_at_which_no_free_swing_has_the_frequency_is_no_escape(omega) -> None:
    """All sites alike do not feel their bonds: each is Duffing's oscillator, of which a is known
    by its first harmonic, up to the third one."""
    chain = cb.Oscillators(
        V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(3), damping=0.01, drive="a*cos(omega*t)"
    )
    orbit = cb.breather(chain, {0: "low"}, omega=omega, params={"c": 0.1, "a": 1e-3}).solution
    u = orbit.farthest
    assert abs(1 - omega**2 + 0.75 * u**2 + 0.01j * omega) * u == pytest.approx(1e-3, rel=1e-3)


# --- walls --------------------------------------------------------------------------------------


@pytest.mark.parametrize("k", [0.8, 1.0])
def test_without_potentials_it_is_the_chain_of_the_paper(k: float) -> None:
    """Between elastic walls, too, where no simulation settles."""
    ring = cb.Ring(10)
    chain = cb.Oscillators(W="gamma*r**2/2", lattice=ring, drive="-a*cos(t)", walls=1.0, k="k")
    params = {"a": 0.5, "gamma": 0.08, "k": k}
    orbit = cb.breather(chain, {0: 1}, omega=1.0, params=params).solution
    closed_form = cb.symmetric(**params, lattice=ring)
    t = np.linspace(0.1, 6.2, 9)
    for n in range(6):
        np.testing.assert_allclose(
            orbit.displacement(n, t), closed_form.displacement(n, t), atol=1e-9
        )
    assert abs(np.sin(orbit.flights[0].start - closed_form.times[0])) < 1e-9  # modulo pi
    assert apart(orbit.multipliers, closed_form.multipliers(sites=10)) < 1e-9


def test_a_branch_between_walls_ends_where_a_neighbour_touches_its_wall() -> None:
    """Not where rounding puts a site behind the wall that it has just left."""
    ring, on = cb.Ring(4), {"a": 0.7, "damping": 0.02, "k": 0.8, "spring": 0.05}
    chain = cb.Oscillators(
        V="s*u**2/2", W="c*r**2/2", lattice=ring, damping=0.02, drive="a*cos(t)", walls=1.0, k=0.8
    )
    hit = cb.breather(chain, {1: 1}, omega=1.0, params={"a": 0.7, "c": 0.04, "s": 0.05})
    branch = cb.trace(hit, "a", within={"a": (0.7, 0.95)}, towards="up")
    orbit = cb.symmetric(gamma=0.04, lattice=ring, **on)
    shot = cb.trace(orbit, "a", within={"a": (0.7, 0.95)}, towards="up")
    assert [point.kind for point in branch.special] == ["EP", "BP", "GR"]
    site, side, at = re.fullmatch(
        r"site (.) touches its (.*) wall at t = (.*)", branch.reason
    ).groups()
    wall = {"upper": 1, "lower": -1}[side]
    assert branch[-1].solution.displacement(int(site), float(at)) == pytest.approx(wall, abs=1e-6)
    assert abs(branch.first("BP")["a"] - shot.first("PF")["a"]) < 1e-8
    assert abs(branch.first("GR")["a"] - shot.first("GR")["a"]) < 1e-8


def test_an_arm_that_turns_back_in_the_coupling_says_so_and_how_far_it_came() -> None:
    """Alone a site settles on one of two mirror images, and these come together on the way."""
    chain = cb.Oscillators(
        V="s*u**2/2", W="c*r**2/2", lattice=cb.Ring(4), damping=0.02, drive="a*cos(t)",
        walls=1.0, k=0.8,
    )  # fmt: skip
    with pytest.raises(cb.NoSolution, match=r"reaches 0\.442. of the .* there it turns back"):
        cb.breather(chain, {1: 1}, omega=1.0, params={"a": 0.75, "c": 0.04, "s": 0.05})


def test_nonlinear_sites_impact_and_return_under_an_integration_with_impacts() -> None:
    chain = cb.Oscillators(
        V="u**2/20 + u**4/40", W="c*r**2/2", lattice=cb.OpenChain(4), damping=0.05,
        drive="-a*cos(omega*t)", walls=1.0, k=0.8,
    )  # fmt: skip
    hit = cb.breather(chain, {1: 1}, omega=1.0, params={"a": 0.5, "c": 0.05})
    run = cb.integrate(hit, periods=1)
    assert len(run.events) == 2
    begin = hit.solution.flights[0].states[0]
    np.testing.assert_allclose(run.final, begin, atol=1e-8)
    branch = cb.trace(hit, "a", within={"a": (0.45, 0.6)}, towards="down")
    assert branch.special[-1].kind in ("GR", "VI", "LP", "EP")
    assert cb.plot(branch).axes.get_ylabel() == "energy"  # max|u| is 1 all along


@pytest.mark.parametrize(
    ("lattice", "code"),
    [
        (cb.Ring(4), {1: 1, 2: 1}),  # at once, by symmetry
        (cb.OpenChain(5), {0: 1, 3: 1}),  # their order changes
        # two of them at once with a little coupling, and not with all of it
        (cb.OpenChain(6), {0: 1, 2: 1, 3: 1}),
    ],
)
def test_several_sites_impact_in_the_order_they_come(lattice, code) -> None:
    chain = cb.Oscillators(
        V="u**2/20", W="c*r**2/2", lattice=lattice, damping=0.05, drive="-a*cos(omega*t)",
        walls=1.0, k=0.8,
    )  # fmt: skip
    orbit = cb.breather(chain, code, omega=1.0, params={"a": 0.5, "c": 0.05}).solution
    flight = max(orbit.flights, key=lambda flight: flight.duration)
    x, t = flight.states[3], flight.begins[3]
    on = Conditions(0.5, 0.05, 0.8, damping=0.05, spring=0.1, lattice=lattice)
    end, hits, whole = Field(lattice, on).run(x, t, t + 2 * np.pi)
    assert abs(end - x).max() < 1e-9
    assert len(hits) == 2 * len(code)
    assert apart(orbit.multipliers, np.linalg.eigvals(whole)) < 1e-8
    assert orbit.unstable == 0


def test_where_two_sites_come_to_their_walls_at_once_they_do_in_the_other_order_beyond() -> None:
    """CC, whose curve in the damping and the frequency ends where a third site touches its wall."""
    lattice, window = cb.OpenChain(4), {"d": (0.04, 0.06), "omega": (0.9, 1.1)}
    chain = cb.Oscillators(
        V="u**2/20", W="c*r**2/2", lattice=lattice, damping="d", drive="-a*cos(omega*t)",
        walls=1.0, k=0.8,
    )  # fmt: skip
    params = {"c": 0.02, "d": 0.05, "a": 0.7}
    two = cb.breather(chain, {0: 1, 1: 1}, omega=1.0, params=params)
    corner = cb.trace(two, "d", within=window, towards="both").first("CC")
    states = [flight.end for flight in corner.solution.flights if flight.duration < 1e-9]
    assert len(states) == 2  # at the upper walls, and half a period later
    for state in states:
        assert abs(state[:2]) == pytest.approx([1, 1], abs=1e-9)
    (arm,) = cb.switch(corner, within=window)
    assert arm[0]["beyond"] == "persists"
    orbit = arm[-1].solution
    flight = max(orbit.flights, key=lambda flight: flight.duration)
    x, t = flight.states[3], flight.begins[3]
    on = Conditions(0.7, 0.02, 0.8, damping=arm[-1]["d"], spring=0.1, lattice=lattice)
    end, hits, whole = Field(lattice, on).run(x, t, t + 2 * np.pi)
    assert abs(end - x).max() < 1e-9
    assert len(hits) == 4
    assert apart(orbit.multipliers, np.linalg.eigvals(whole)) < 1e-8
    curve = cb.boundary(corner, ("d", "omega"), within=window)
    touches = curve.first("CC-GR").solution.displacement(2, np.linspace(0, 7, 4001))
    assert touches.max() == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize(("sites", "beyond"), [([0, 1], "PF"), ([0, 2], "NS")])
def test_beyond_a_corner_collision_sites_impact_in_the_other_order(sites, beyond) -> None:
    """Orbits from impact to impact do not mind the order, within half of a symmetric one."""
    params, window = {"a": 0.6, "gamma": 0.06, "k": 0.8}, {"gamma": (0.06, 0.2)}
    chain = cb.Oscillators(
        W="gamma*r**2/2", lattice=cb.OpenChain(4), damping=0.05, drive="-a*cos(t)", walls=1.0, k="k"
    )
    two = cb.breather(chain, sites, omega=1.0, params=params)
    collision = cb.trace(two, "gamma", within=window, towards="up").first("CC")
    (arm,) = cb.switch(collision, within=window)
    assert arm[0]["beyond"] == "persists"
    tree = cb.diagram(two, "gamma", within={"gamma": (0.06, 0.08)}, beyond=True)
    assert [branch[-1]["gamma"] for branch in tree] == [pytest.approx(collision["gamma"]), 0.08]
    orbit = cb.multibreather(sites, damping=0.05, lattice=cb.OpenChain(4), **params)
    events = [cb.pitchfork(), cb.neimark_sacker(threshold=1.0), cb.grazing()]
    shot = cb.trace(orbit, "gamma", within=window, events=events, towards="up")
    for kind, of in ((beyond, "BP" if beyond == "PF" else beyond), ("GR", "GR")):
        assert abs(arm.first(of)["gamma"] - shot.first(kind)["gamma"]) < 1e-8


def test_impacts_on_both_walls_that_vanish_at_once_are_named() -> None:
    """The linear response has the amplitude of the walls there, and is its own mirror image."""
    chain = cb.Oscillators(
        "u**2/20", "c*r**2/2", cb.OpenChain(2, drive=[1, 0.2]), damping=0.05,
        drive="a*cos(omega*t)", walls=1.0, k=0.5,
    )  # fmt: skip
    hit = cb.breather(chain, {0: 1}, omega=1.0, params={"a": 0.6, "c": 0.03})
    end = cb.trace(hit, "a", within={"a": (0.02, 1.0)}, towards="down").first("VI")
    stiffness = np.diag([0.1 - 1 + 0.05j] * 2) + 0.03 * np.array([[1, -1], [-1, 1]])
    assert end["a"] == pytest.approx(1 / abs(np.linalg.solve(stiffness, [1, 0.2])[0]), abs=1e-9)
    with pytest.raises(cb.errors.BadInput, match=r"reaches its lower .*reaches its upper wall"):
        cb.switch(end, within={"a": (0.02, 1.0)})


def test_a_site_that_comes_to_its_walls_too_seldom_is_refused_at_once(monkeypatch) -> None:
    """No return of it is waited for, which takes minutes where it hardly moves."""
    monkeypatch.setattr(anticontinuum, "_VELOCITIES", (1.0,))
    monkeypatch.setattr(anticontinuum, "cycle", lambda *_, **__: pytest.fail("waits"))
    chain = cb.Oscillators(
        W="c*r**2/2", lattice=cb.Ring(3), drive="a*cos(omega*t)", walls=1.0, k=0.8
    )
    with pytest.raises(cb.NoSolution, match="site 2: alone it has no orbit that impacts once"):
        cb.breather(chain, {2: 1}, omega=1.0, params={"a": 0.03, "c": 0.05})


@pytest.mark.parametrize(
    ("V", "onsite", "a"),
    [
        ("u**2/20 + u**3/30 + u**4/40", [1, 1], 1.16),  # beside rest the first one has no orbit
        ("u**2/20", [1, 0], 0.6),  # nothing but its bond holds the second one
    ],
)
def test_sites_that_impact_need_no_orbit_beside_rest_nor_idle_ones_a_potential(
    V, onsite, a
) -> None:
    chain = cb.Oscillators(
        V, "c*r**2/2", cb.OpenChain(2, drive=[1, 0.2]), onsite=onsite, damping=0.05,
        drive="a*cos(omega*t)", walls=1.0, k=0.8,
    )  # fmt: skip
    hit = cb.breather(chain, {0: 1}, omega=1.0, params={"a": a, "c": 0.03})
    run = cb.integrate(hit, periods=1.2)
    assert len(run.events) == 2
    np.testing.assert_allclose(run.final, hit.solution.states(run.t[-1]), atol=1e-8)


def test_a_breather_behind_a_wall_is_refused_with_the_site() -> None:
    """The site between two that impact comes to 1.029 at c = 0.02, where its walls are at 1."""
    chain = cb.Oscillators(
        "u**2/20 + u**4/40", "c*(r**2/2 + r**4/4)", cb.OpenChain(3),
        damping=0.05, drive="-0.6*cos(omega*t)", walls=1.0, k=0.7,
    )  # fmt: skip
    with pytest.raises(cb.errors.NoSolution, match=r"coupling site 1 is behind a wall, which"):
        cb.breather(chain, {0: 1, 2: 1}, omega=1.0, params={"c": 0.02})
    # it touches the wall at c = 0.0218, a share of 0.109, and turns back at 0.034, behind it
    pair = cb.Oscillators(
        "u**2/2 + u**4/20", "c*r**2/2", cb.OpenChain(2),
        damping=0.03, drive="cos(omega*t)/2", walls=1.0, k=0.75,
    )  # fmt: skip
    with pytest.raises(cb.errors.NoSolution, match=r"by 0\.1\d* of the coupling site 1 is behind"):
        cb.breather(pair, {0: 1}, omega=1.3, params={"c": 0.2})


def test_the_time_of_a_touch_is_within_the_period() -> None:
    """As `states` takes it."""
    pair = cb.Oscillators(
        "u**2/2 + u**4/20", "c*r**2/2", cb.OpenChain(2),
        damping=0.03, drive="cos(omega*t)/2", walls=1.0, k=0.75,
    )  # fmt: skip
    b = cb.breather(pair, {0: 1}, omega=1.3, params={"c": 0.01})
    branch = cb.trace(b, "c", within={"c": (0, 0.2)}, towards="up")
    t = float(branch.reason.rpartition("t = ")[2])
    assert 0 < t < 2 * np.pi / 1.3
    assert abs(branch[-1].solution.states(t)[1]) == pytest.approx(1.0, abs=1e-5)


def test_a_response_of_grains_is_traced_down_to_rest() -> None:
    """Where their forces cancel to 1e-8 differences had no digit right: it ended before, as MX."""
    W = "2*(1 - r)**(5/2)/5 + r - 2/5"
    lattice = cb.OpenChain(2, ends="fixed", drive=[1.0, 0.0])
    grains = cb.Oscillators(W=W, lattice=lattice, damping=0.1, drive="a*cos(omega*t)")
    how = {"omega": 0.9, "collocation": cb.Collocation(6, 4), "events": ()}
    response = cb.breather(grains, {0: "low"}, params={"a": 0.05}, **how)
    branch = cb.trace(response, "a", within={"a": (0.0, 0.1)}, towards="down")
    assert branch[-1]["a"] == 0.0
    assert branch.special[-1].kind == "EP"
