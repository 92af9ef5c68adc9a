"""Breathers of lattices of oscillators: published-type numbers, an own integrator, closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

import contbreather as cb
from contbreather.continuation.curve.branch import Stop
from contbreather.flows.functions import slopes
from contbreather.oscillators.breather_problem import BreatherProblem, SparseHalfOrbit
from contbreather.plotting import plot_multipliers, plot_space_time

from .test_boundaries import HARD as PULL
from .test_boundaries import half_map, whole

HARD, LINEAR = "u**2/2 + u**4/4", "c*r**2/2"


def phi4(lattice, code, c, **how):
    chain = cb.Oscillators(V=HARD, W=LINEAR, lattice=lattice)
    return cb.breather(chain, code, omega=1.5, params={"c": c}, **how)


# by half a period's shooting with DOP853 at 1e-13 and the variational equations
NUMBERS = [
    (cb.Ring(11), {5: 1}, 0.05, {5: 1.24950007}, 1.477894660123, 1.0, 0),
    (cb.Ring(11), {5: 1}, 0.1, {5: 1.18376790}, 1.374091165415, 1.0, 0),
    (cb.Ring(11), {5: 1, 6: 1}, 0.05, dict.fromkeys((5, 6), 1.27829490), 3.061056703746, 1.0, 0),
    (cb.Ring(11), {5: 1, 6: -1}, 0.05, {5: 1.22257518, 6: -1.22257518}, 2.845365125630,
     1.785304246, 1),
    (cb.OpenChain(8, ends="fixed"), {0: 1}, 0.1, {0: 1.18944374}, 1.370661072860, 1.0, 0),
]  # fmt: skip


@pytest.mark.parametrize(("lattice", "code", "c", "u", "energy", "largest", "unstable"), NUMBERS)
def test_amplitudes_energies_and_multipliers_are_those_of_shooting(
    lattice, code, c, u, energy, largest, unstable
) -> None:
    orbit = phi4(lattice, code, c).solution
    for site, value in u.items():
        assert orbit.displacement(site, 0.0) == pytest.approx(value, abs=6e-9)
    assert orbit.energy == pytest.approx(energy, abs=1e-9)
    assert orbit.largest == pytest.approx(largest, abs=1e-9)
    assert orbit.unstable == unstable


@pytest.mark.slow
def test_a_slow_single_oscillator_is_found_next_to_its_separatrix() -> None:
    """A pendulum: sin(a / 2)^2 = m, where 2 K(m) is half of its period. Of Morse's oscillator it is
    the coupling that is at fault: harmonic 2 is the frequency of those at rest."""
    m = brentq(lambda m: 2 * ellipk(m) - np.pi / 0.23, 0.5, 1 - 1e-9)
    pendula = cb.Oscillators(V="1 - cos(u)", W=LINEAR, lattice=cb.Ring(3))
    orbit = cb.breather(pendula, {1: 1}, omega=0.23, params={"c": 0.0}).solution
    assert orbit.displacement(1, 0.0) == pytest.approx(2 * np.arcsin(np.sqrt(m)), abs=1e-9)
    morse = cb.Oscillators(V="(1 - exp(-u))**2/2", W=LINEAR, lattice=cb.OpenChain(5))
    with pytest.raises(cb.NoSolution, match="harmonic 2, 1, lies among the frequencies"):
        cb.breather(morse, {2: 1}, omega=0.5, params={"c": 0.05})


@pytest.mark.slow
@pytest.mark.parametrize("code", [{2: 1}, {2: 1, 3: -1}])
def test_equations_in_which_nothing_is_eliminated_have_the_same_orbits(code) -> None:
    """Those of many sites, on a lattice of few: multipliers, branches and their ends, too."""
    few = phi4(cb.Ring(5), code, 0.05)
    half = few.residual
    of = half.flows, half.start, half.period, half.turns, half.states, half.sizes
    sparse = SparseHalfOrbit(*of)
    many = BreatherProblem.of(sparse, few.params, few.events, "").solve(tolerance=1e-12)[0]
    assert many.x.size > 4 * few.x.size
    mu, nu = (problem.solution.indices for problem in (few, many))
    np.testing.assert_allclose(np.sort_complex(mu), np.sort_complex(nu), atol=1e-10)
    for problem in (few, many):
        assert abs(problem.solution.trivial - 1) < 1e-10
    assert max(few.solution.errors.values()) < 1e-9
    with pytest.raises(cb.BadInput, match="compare with more intervals"):
        _ = many.solution.errors
    one, other = (cb.trace(problem, "c", within={"c": (0.02, 0.1)}) for problem in (few, many))
    assert [p.kind for p in one.special] == [p.kind for p in other.special]
    for name in ("energy", "largest", "max|u|"):
        np.testing.assert_allclose(one[name][[0, -1]], other[name][[0, -1]], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2])
def test_at_pd_the_orbit_of_twice_the_period_sets_out(number: int) -> None:
    """From where the perturbation is at rest, at either end of the half on the two edges of one
    tongue: it returns after two periods, and not after one."""
    V, n, c = "u**2/2 + 0.2*u**3 + u**4/4", 3, 0.1
    chain = cb.Oscillators(V=V, W=LINEAR, lattice=cb.OpenChain(n))
    start = cb.breather(chain, {0: 1}, omega=2.0, params={"c": c})
    doublings = cb.trace(start, "omega", within={"omega": (2.0, 2.05)})
    point = [p for p in doublings.special if p.kind == "PD"][number - 1]
    (arm,) = cb.switch(point, within={"omega": (0.9, 1.2)}, events=())
    assert arm[0]["omega"] == pytest.approx(point["omega"] / 2, abs=1e-7)
    assert arm[0]["energy"] == pytest.approx(point["energy"], abs=1e-6)
    orbit = arm[len(arm) // 2].solution
    K = cb.OpenChain(n).stiffness

    def field(t, y):
        u = y[:n]
        return np.concatenate([y[n:], -u - 0.6 * u**2 - u**3 - c * K @ u])

    start_state = np.concatenate(orbit.state())
    how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "dense_output": True}
    run = solve_ivp(field, (0, orbit.period), start_state, **how)
    assert abs(run.y[:, -1] - start_state).max() < 1e-7
    assert abs(run.sol(orbit.period / 2) - start_state).max() > 1e-2


@pytest.mark.slow
def test_sites_far_away_change_nothing() -> None:
    """Its tails fall as c^n: rings of 17 and 41 sites have one breather, by both equations."""
    few, many = phi4(cb.Ring(17), {8: 1}, 0.05), phi4(cb.Ring(41), {20: 1}, 0.05)
    assert not isinstance(few.residual, SparseHalfOrbit)
    assert isinstance(many.residual, SparseHalfOrbit)
    assert many.solution.energy == pytest.approx(few.solution.energy, abs=1e-10)
    assert many.solution.unstable == 0


def test_tails_that_are_next_to_nothing_are_differentiated_as_well() -> None:
    """A hundred sites away it moves by 1e-200: its derivative is that of any site at rest."""
    chain = cb.Oscillators(V=HARD, W=LINEAR, lattice=cb.Ring(3))
    x = np.array([[1.0], [1e-200], [1e-310], [0.0], [1e-200], [1e-310]])
    slope = slopes(chain, 0.0, x, {"c": 0.05})[1][:, :6, 0]
    K = np.diag([1 + 3.0, 1, 1]) + 0.05 * (3 * np.eye(3) - 1)
    np.testing.assert_allclose(
        slope, np.block([[np.zeros((3, 3)), np.eye(3)], [-K, np.zeros((3, 3))]])
    )


def test_rounding_of_a_formula_in_the_tails_is_no_doubt_about_it(caplog) -> None:
    """1 - exp(-u) is rounding where u is next to nothing: complex steps are exact there, too; by
    differences this breather was not reached."""
    caplog.set_level("DEBUG", "contbreather.flows.functions")
    chain = cb.Oscillators(V="(1 - exp(-u))**2/2", W=LINEAR, lattice=cb.Ring(11))
    breather = cb.breather(chain, {5: 1}, omega=0.8, params={"c": 0.03})
    assert breather.solution.unstable == 0
    assert "by differences" not in caplog.text


def test_an_own_integration_returns_and_has_the_same_multipliers() -> None:
    lattice = cb.OpenChain(5, ends="fixed")
    orbit = phi4(lattice, {1: 1, 2: -1}, 0.05).solution
    u = orbit.displacement(slice(None), 0.0)
    end, blocks = half_map(PULL, lattice.stiffness, 0.05, u, orbit.period)
    M = whole(blocks)
    np.testing.assert_allclose(end, np.concatenate(orbit.state()), atol=1e-9)
    trace = np.trace(M)  # of pairs: twice the sum of indices, that of the trivial pair is 1
    assert 2 * (orbit.indices.sum().real + 1) == pytest.approx(trace, abs=1e-8)
    mu = np.linalg.eigvals(M)
    assert orbit.largest == pytest.approx(abs(mu).max(), rel=1e-8)
    assert orbit.unstable == 1


def test_sites_that_are_held_by_a_harmonic_potential_begin_beside_neighbours_at_rest() -> None:
    """Alone they have one frequency; an own integration returns, and forces of contact are read as
    they are where they begin, at r = 0."""
    V, lattice = "u**2/2", cb.OpenChain(5)
    chain = cb.Oscillators(V=V, W="c*r**2/2 + r**4/8", lattice=lattice)
    orbit = cb.breather(chain, {2: 1}, omega=1.5, params={"c": 0.05}).solution

    def field(t, x):
        r = np.diff(x[:5])
        force = np.append(0.05 * r + r**3 / 2, 0)
        return np.append(x[5:], force - np.roll(force, 1) - x[:5])

    x = np.concatenate(orbit.state())
    run = solve_ivp(field, (0, orbit.period), x, "DOP853", rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(run.y[:, -1], x, atol=1e-9)
    cradle = cb.Oscillators(V=V, W="((Abs(r) - r)/2)**2.5", lattice=lattice)
    np.testing.assert_allclose(cradle.frequencies({}), 1)
    x = np.random.default_rng(1).normal(size=(10, 30))
    for named in ("Max(-r, 0)**2.5", "(-min(0, r))**2.5"):
        same = cb.Oscillators(V=V, W=named, lattice=lattice)
        for one, other in zip(slopes(same, 0.0, x, {}), slopes(cradle, 0.0, x, {}), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-14, atol=1e-14)


def test_energy_is_the_integral_of_the_frequency_over_the_action() -> None:
    """dE = omega dJ along a family, whichever of both is its parameter."""
    start = phi4(cb.Ring(5), {2: 1}, 0.05)
    for free, window in (("omega", (1.4, 1.6)), ("energy", (1.2, 1.7))):
        branch = cb.trace(start, free, within={free: window}, steps=cb.Steps(largest=0.05))
        J, E = branch["action"], branch["energy"]
        rule = np.polynomial.Polynomial.fit(J, E, 9).deriv()(J)
        np.testing.assert_allclose(rule, branch["omega"], atol=1e-5)
        assert not branch["unstable"].any()


@pytest.mark.parametrize(
    ("omega", "code", "over"), [(0.8, 1, False), (0.8, 2.5, True), (1.3, 1, True), (1.3, -1, True)]
)
def test_oscillations_over_a_barrier_are_among_those_of_a_frequency(omega, code, over) -> None:
    """That between the wells at 0 and 2, at 1, which one alone never comes to."""
    V = "(u**2 - 2*u)**2/8"
    chain = cb.Oscillators(V=V, W="c*r**2/2", lattice=cb.OpenChain(1))
    (u,), _ = cb.breather(chain, {0: code}, omega=omega, params={"c": 0.0}).solution.state()
    right = lambda t, y: [y[1], -(y[0] ** 2 - 2 * y[0]) * (y[0] - 1) / 2]  # noqa: E731
    run = solve_ivp(right, (0, np.pi / omega), [u, 0.0], "DOP853", rtol=1e-12, atol=1e-13)
    low, high = sorted((u, run.y[0, -1]))
    assert run.y[1, -1] == pytest.approx(0.0, abs=1e-9)
    assert (low < 0 and high > 2) if over else (low < 0 and high < 1)
    assert (u == high) if code > 0 else (u == low)


def test_how_many_sites_take_part_is_no_matter_of_the_zero_of_the_energy() -> None:
    one, two = (
        cb.breather(
            cb.Oscillators(V=V, W=LINEAR, lattice=cb.Ring(6)), {2: 1}, omega=0.8, params={"c": 0.05}
        ).solution
        for V in ("1 - cos(u)", "-cos(u)")
    )
    assert two.energy == pytest.approx(one.energy - 6)
    assert two.participation == pytest.approx(one.participation)
    assert 1 < one.participation < 1.2


@pytest.mark.slow
def test_potentials_may_be_functions() -> None:
    """The same numbers as from formulas, with an odd part that tells the ends of a bond apart."""
    V, W = "(1 - exp(-b*u))**2/(2*b**2)", "c*(r**2/2 - r**3/9)"
    written = cb.Oscillators(V=V, W=W, lattice=cb.OpenChain(4))
    made = cb.Oscillators(
        V=lambda u, p: (1 - np.exp(-p["b"] * u)) ** 2 / (2 * p["b"] ** 2),
        W=lambda r, p: p["c"] * (r**2 / 2 - r**3 / 9), lattice=cb.OpenChain(4),
    )  # fmt: skip
    params = {"b": 1.1, "c": 0.03}
    one, other = (
        cb.breather(chain, {1: 1, 3: -1}, omega=0.8, params=params).solution
        for chain in (written, made)
    )
    assert one.energy == pytest.approx(other.energy, abs=1e-11)
    np.testing.assert_allclose(
        np.sort_complex(one.indices), np.sort_complex(other.indices), atol=1e-9
    )


def test_a_function_that_complex_steps_do_not_differentiate_is_refused() -> None:
    """A site of it was at rest, to 1e-78, and called a breather."""
    kinked = cb.Oscillators(V=lambda u, p: u**2 / 2 + abs(u) ** 3, W=LINEAR, lattice=cb.Ring(3))
    with pytest.raises(cb.BadInput, match="have to be analytic, without abs"):
        cb.breather(kinked, {0: 1}, omega=1.5, params={"c": 0.05})


@pytest.mark.slow
def test_where_the_energy_of_the_family_turns_is_an_event(tmp_path) -> None:
    """At given c the energies of the family are stationary in the frequency there, and so they are
    along its curve, which is another one than that of the fold beside it when it was loaded."""
    chain = cb.Oscillators(V=HARD, W=LINEAR, lattice=cb.OpenChain(3))
    start = cb.breather(chain, {0: 1}, omega=1.5, params={"c": 0.2})
    branch = cb.trace(start, "c", within={"c": (0.2, 1.0)}, towards="up")
    turns = [p for p in branch.special if p.kind == "LP" and "energy" in str(p.detail)]
    line = cb.boundary(turns[0], ("omega", "c"), within={"omega": (1.48, 1.52)})
    for point in (turns[0], line[0].base_point, line[-1].base_point):
        h, omega = 1e-4, point["omega"]
        family = [
            point.problem.at(omega=omega + k * h).solve(tolerance=1e-12)[0]
            for k in (-2, -1, 0, 1, 2)
        ]
        E = [problem.solution.energy for problem in family]
        slope = (E[0] - 8 * E[1] + 8 * E[3] - E[4]) / (12 * h)
        bend = (E[1] - 2 * E[2] + E[3]) / h**2
        assert abs(slope) < 1e-7 * abs(bend)
    cb.save(tmp_path / "turns.nc", line)
    again = cb.extend(cb.load(tmp_path / "turns.nc"), end="last", within={"omega": (1.48, 1.53)})
    assert again[-1]["omega"] == 1.53


@pytest.fixture(scope="module")
def none() -> cb.oscillators.CodedBreather:
    """What the catalogue has of a breather that is refused."""
    chain = cb.Oscillators(V=HARD, W=LINEAR, lattice=cb.Ring(3))
    (found,) = cb.breathers(chain, omega=1.2, sites=[0], params={"c": 0.3})
    return found


def test_what_ends_on_the_way_names_the_harmonic_and_the_band(none) -> None:
    """The band is that of the matrix that is written down here."""
    says, share = none.ended, none.share
    assert not none.exists
    assert 0 < share < 1
    assert f"reaches {share:.4g} of the coupling" in says
    high = np.sqrt(1 + 3 * 0.3 * share)
    assert says.endswith(f"the frequencies of small oscillations, 1 to {high:.6g}.")
    assert "the frequency itself, 1.2," in says


@pytest.mark.slow
@pytest.mark.parametrize(("free", "window"), [("omega", (0.9, 1.5)), ("energy", (-1.0, 2.0))])
def test_a_family_that_shrinks_to_rest_ends_at_the_mode_that_it_is_born_from(free, window) -> None:
    """A hard one at the upper edge: of an open chain of three that has w^2 = 1 + 3 c."""
    start = phi4(cb.OpenChain(3), {1: 1}, 0.1)
    branch = cb.trace(start, free, within={free: window}, towards="down")
    end = branch.special[-1]
    assert (end.kind, branch.stop, branch.doubtful) == ("HB", Stop.EVENT, ())
    assert f"frequency {np.sqrt(1.3):.9g}, the highest of 3" in end.detail["said"]
    assert end["omega"] == pytest.approx(np.sqrt(1.3), abs=1e-5)


@pytest.mark.slow
def test_a_family_born_from_the_mode_of_a_defect_is_not_said_to_be_born_at_an_edge_of_the_band():
    """A light site in a ring of seven: its mode, by the matrix, is far above the band."""
    masses = np.array([1, 1, 1, 0.6, 1, 1, 1])
    chain = cb.Oscillators(V=HARD, W=LINEAR, lattice=cb.Ring(7), masses=masses)
    start = cb.breather(chain, {3: 1}, omega=1.6, params={"c": 0.05})
    end = cb.trace(start, "omega", within={"omega": (1.2, 1.6)}, towards="down").special[-1]
    ring = 1.1 * np.eye(7) - 0.05 * (np.roll(np.eye(7), 1, 0) + np.roll(np.eye(7), -1, 0))
    high = np.sqrt(np.linalg.eigvalsh(ring / np.sqrt(np.outer(masses, masses)))[-1])
    assert end.detail["said"].endswith(f"from the mode of frequency {high:.9g}, the highest of 7")


@pytest.mark.slow
@pytest.mark.parametrize("free", ["energy", "omega"])
@pytest.mark.parametrize(
    ("V", "energy", "rests"),
    [("1 - cos(u)", 2.0, "u0 = -3.14159"), ("(u**2 - 2*u)**2/8", 0.125, "the saddle u0 = 1,")],
)
def test_a_family_that_comes_to_a_separatrix_ends_there_with_hom(V, energy, rests, free) -> None:
    chain = cb.Oscillators(V=V, W="c*r**2/2", lattice=cb.OpenChain(1))
    alone = cb.breather(chain, {0: 1}, omega=0.8, params={"c": 0.0})
    window = {"energy": (0.01, 3.0), "omega": (0.01, 0.9)}
    branch = cb.trace(alone, free, within={free: window[free]})
    end = branch.first("HOM")
    assert end["energy"] == pytest.approx(energy, abs=1e-4)
    assert rests in end.detail["said"]


@pytest.mark.slow
def test_a_breather_that_moves_freely_along_a_ring_has_no_branch_points() -> None:
    """Next to the band what holds it at its site is less than rounding; and the end of its branch
    names the harmonic and the band."""
    start = phi4(cb.Ring(5), {2: 1}, 0.05)
    near = cb.trace(start, "omega", within={"omega": (1.09, 1.5)}, towards="down", events=())
    assert abs(near[-1].solution.indices - 1).min() < 1e-5
    branch = cb.trace(near[-1].problem, "omega", within={"omega": (1.0, 1.1)}, towards="down")
    assert branch.stop is Stop.NO_CONVERGENCE
    assert abs(branch[-1].solution.indices - 1).min() < 1e-12
    assert not branch.doubtful
    assert f"|u| is at most {branch[-1]['max|u|']:.3g} there" in branch.reason
    assert {point.kind for point in branch.special} <= {"EP", "MX"}
    edge = np.sqrt(1 + 0.2 * np.sin(2 * np.pi / 5) ** 2)
    assert f"the frequency itself, {branch[-1]['omega']:.6g}, is" in branch.reason
    assert branch.reason.endswith(f"the frequencies of small oscillations, 1 to {edge:.6g}")


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"W": "r**2/2 + r**4/4", "lattice": cb.Ring(10)}, "may be shifted together"),
        ({"W": "r**2/2 + r**4/4", "lattice": cb.OpenChain(11)}, "may be shifted together"),
        ({"V": "(u**2 - 1)**2/8", "W": "r**2/2", "lattice": cb.Ring(5)}, "minimum of its potent"),
        ({"V": "1 - cos(u)", "W": "r**2/2", "lattice": cb.Ring(5)}, r"to 1, not at 2\.5$"),
        # that of u^4/4 is 0.8472 |u|
        ({"V": "u**4/40000", "W": "r**2/2", "lattice": cb.Ring(5)}, r"to 0\.8472.*, not at 2\.5$"),
        # that of Hertz's contacts has no value beyond 1, at an end on one side only; over a barrier
        # at 1 a site does not come back
        ({"V": "u**2/2", "W": "(1-r)**2.5/2.5 + r", "lattice": cb.Ring(5)}, r"up to \|u\| = 0\.99"),
        ({"V": "u**2/2", "W": "(1+r)**2.5/2.5 - r", "lattice": cb.OpenChain(5)}, r"\|u\| = 0\.\d"),
        ({"V": "u**2/2 - u**3/3", "W": "r**2/9", "lattice": cb.Ring(5)}, r"up to \|u\| = 1, "),
    ],
)
def test_lattices_without_isolated_breathers_say_why(given, says) -> None:
    with pytest.raises((cb.BadInput, cb.NoSolution), match=says):
        cb.breather(cb.Oscillators(**given), {4: 1}, omega=2.5)


@pytest.mark.slow
def test_a_branch_of_breathers_is_drawn_by_its_largest_displacement(tmp_path) -> None:
    """Also one that was loaded: its unknowns, a mesh and times, say nothing."""
    branch = cb.trace(phi4(cb.Ring(5), {2: 1}, 0.05), "c", within={"c": (0.04, 0.06)})
    cb.save(tmp_path / "breathers.nc", branch)
    for shown in (branch, cb.load(tmp_path / "breathers.nc")):
        axes = cb.plot(shown).axes
        drawn = np.concatenate([line.get_ydata() for line in axes.get_lines()])
        assert drawn.max() == pytest.approx(branch["max|u|"].max())
        assert "|u|" in axes.get_ylabel()


def test_half_of_a_period_is_in_no_table_of_breathers() -> None:
    """It follows from omega; and where room is short the count of what is unstable stays."""
    start = phi4(cb.Ring(5), {2: 1}, 0.05)
    branch = cb.trace(start, "c", within={"c": (0.04, 0.06)}, events=())
    assert [column.heading for column in branch.table().columns[:4]] == [
        "label", "c", "unstable", "energy",
    ]  # fmt: skip
    for shown in (start, branch[0], branch.table(), branch[0].curve.problem):
        assert "held" not in repr(shown)
    assert "held" not in str(branch[0].table())


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"V": "x**2/2"}, "has no u in it: a function of u was expected"),
        ({"V": "u*cos(t)"}, "depends on t: a function of u was expected"),
        ({"V": "u**2/"}, "not a formula: invalid syntax; write it as Python, with . for products"),
        ({"W": "c*u**2/2"}, "has no r in it: a function of r was expected"),
        ({"V": [HARD] * 4}, "V = .*one formula for all of 5 sites"),
        ({"W": lambda r: r**2 / 2}, r"called with r and the dict .*lambda r, p: \.\.\.; too many"),
    ],
)
def test_a_potential_is_one_formula_in_its_variable(given, says) -> None:
    with pytest.raises(cb.BadInput, match=says):
        cb.Oscillators(**{"V": HARD, "W": LINEAR, "lattice": cb.Ring(5), **given})


@pytest.mark.parametrize("W", ["c*((1 - r)**(5/2)*2/5 + r)", "-c*log(1 - r**2)/2"])
def test_sites_that_stretch_a_bond_beyond_a_pole_are_refused_at_once(W) -> None:
    """A hard site of omega = 1.5 swings by 1.3, and both potentials end at r = 1."""
    chain = cb.Oscillators(V="u**2/2 + u**4/4", W=W, lattice=cb.Ring(5))
    with pytest.raises(cb.NoSolution, match=r"W = .* is not finite"):
        cb.breather(chain, {2: 1}, omega=1.5, params={"c": 0.01})


@pytest.mark.slow
def test_a_walk_that_ends_where_a_force_has_no_value_says_so() -> None:
    """Of grains the contact opens on the way: it was said that steps shrink to nothing."""
    W, masses = "2*(1-r)**(5/2)/5 + r - 2/5", [1.0, 0.27, 1.0]
    grains = cb.Oscillators(W=W, lattice=cb.OpenChain(3, ends="fixed"), masses=masses)
    few = cb.Collocation(4, 4)
    with pytest.raises(cb.NoSolution, match="reached the edge of the domain of the equations"):
        cb.breather(grains, {1: 1}, omega=3.31, params={}, collocation=few)


def test_what_no_formula_has_and_sites_that_are_not_there_are_refused() -> None:
    chain = cb.Oscillators(V=HARD, W=LINEAR, lattice=cb.Grid(2, 3))
    with pytest.raises(cb.BadInput, match="params has 'bb', which is in no formula"):
        cb.breather(chain, {4: 1}, omega=1.5, params={"c": 0.01, "bb": 1.0})
    with pytest.raises(cb.BadInput, match=r"Site \(i, j\) of this grid has the number 3 i \+ j"):
        cb.breather(chain, {(1, 1): 1}, omega=1.5, params={"c": 0.01})
    with pytest.raises(cb.BadInput, match=r"masses = .*Lattice\(stiffness, masses=\)"):
        cb.Ring(9, masses=np.ones(9))
    with pytest.raises(cb.BadInput, match="a dict of sites, from 0 to 5"):
        cb.breathers(chain, omega=1.5, sites=[9], params={"c": 0.01})
    with pytest.raises(cb.BadInput, match=r"\{3: 1\} for instance"):
        cb.breather(chain, 2, omega=1.5, params={"c": 0.01})
    start = cb.breather(chain, {4: 1}, omega=1.5, params={"c": 0.01})
    with pytest.raises(AttributeError, match=r"has no 'energy'; its orbit may: problem\.solution"):
        start.energy  # noqa: B018
    for asked in (start.solution.displacement, start.solution.velocity):
        with pytest.raises(cb.BadInput, match="sites of this lattice are 0 to 5"):
            asked(6, 0.0)
        with pytest.raises(cb.BadInput, match=r"\(i, j\) of this grid has the number 3 i \+ j"):
            asked((1, 1), 0.0)
    with pytest.raises(cb.BadInput, match=r"perturb has shape \(3,\).*each of 12 states"):
        cb.integrate(start, periods=1, perturb=np.ones(3))
    with pytest.raises(cb.BadInput, match="periods = -2: how many, above 0"):
        cb.integrate(start, periods=-2)
    orbit = phi4(cb.Ring(5), {2: 1}, 0.05).solution
    assert orbit.displacement(7, 0.3) == orbit.displacement(2, 0.3)  # modulo the ring


def test_its_stability_is_a_verdict() -> None:
    orbit = phi4(cb.Ring(11), {5: 1, 6: -1}, 0.05).solution
    exact, ruled = orbit.stability(), orbit.stability(threshold=1.9)
    assert (exact.stable, exact.unstable, ruled.stable) == (False, 1, True)
    assert exact.largest == ruled.largest == pytest.approx(1.785304246, abs=1e-9)
    assert "ring of 11: unstable, 1 multiplier" in repr(exact)
    with pytest.raises(cb.BadInput, match="sites = 9: leave it out; this is the ring of 11"):
        orbit.stability(sites=9)
    assert repr(orbit) == "<Breather of frequency 1.5, 1 unstable>"
    assert "participation" in str(orbit.table())
    assert "max(v9)" not in str(orbit.table())


@pytest.mark.slow
def test_an_orbit_says_which_of_its_harmonics_is_in_the_band() -> None:
    """Odd forces have no second one."""
    chain = cb.Oscillators(V="1 - cos(u)", W=LINEAR, lattice=cb.Ring(3))
    for omega, said in (
        (0.34, "; harmonic 3, 1.02, lies among the frequencies of small oscillations, 1 to "),
        (0.52, "unstable>"),
    ):
        orbit = cb.breather(chain, {1: 1}, omega=omega, params={"c": 0.05}).solution
        assert said in repr(orbit)
        assert (orbit.swings.min() > 1.0) == (omega == 0.34)


def test_a_breather_in_a_gap_says_between_which_frequencies() -> None:
    """As of sites of two kinds: the band begins and ends far off."""
    chain = cb.Oscillators(HARD, LINEAR, cb.Ring(4), onsite=[1, 4] * 2)
    orbit = cb.breather(chain, {0: 1}, omega=1.5, params={"c": 0.05}).solution
    low, high = chain.frequencies({"b": 1.0, "c": 0.05})[1:3]
    assert repr(orbit).endswith(f"between {low:.6g} and {high:.6g}>")
    assert orbit.swings[2] < 0.01 * orbit.swings[0]


def test_where_a_light_site_has_a_mode_of_its_own_that_is_no_edge_of_the_band() -> None:
    """Without it modes of the ring end at sqrt(1 + 4 c); that of the light one is above omega."""
    ring = cb.Oscillators(HARD, LINEAR, cb.Ring(7), masses=[1, 1, 1, 0.6, 1, 1, 1])
    orbit = cb.breather(ring, {0: 1}, omega=1.2, params={"c": 0.05}).solution
    low, *_, below, above = ring.frequencies({"c": 0.05})
    assert below < np.sqrt(1 + 4 * 0.05) < orbit.omega < above
    said = f"among the frequencies of small oscillations, {low:.6g} to {above:.6g}, between"
    assert repr(orbit).endswith(f"lies {said} {below:.6g} and {above:.6g}>")


def test_entries_of_a_catalogue_are_drawn_one_by_one(none) -> None:
    chain = cb.Oscillators(V=HARD, W=LINEAR, lattice=cb.Ring(5))
    one = cb.breathers(chain, omega=1.5, sites=[0], params={"c": 0.03})
    assert repr(one) == "(CodedBreather(code={0: 1}, copies=2, share=1.0, ended=''),)"
    heights = cb.plot(one[0]).axes.get_lines()[0].get_ydata()
    np.testing.assert_array_equal(heights, one[0].breather.solution.displacement(slice(5), 0.0))
    with pytest.raises(cb.BadInput, match="a CodedBreather was among them: leave it"):
        cb.plot(*one, none)
    with pytest.raises(cb.BadInput, match=r"nothing to draw.*reaches 0\.\d+ of the coupling"):
        cb.plot(none)


def test_a_branch_sets_out_from_an_entry_of_a_catalogue(none) -> None:
    """The same as from the breather that is found alone, where the entry exists."""
    chain = cb.Oscillators(V=HARD, W=LINEAR, lattice=cb.Ring(5))
    at = {"omega": 1.5, "params": {"c": 0.03}}
    starts = [*cb.breathers(chain, sites=[0], **at), cb.breather(chain, {0: 1}, **at)]
    ends = [cb.trace(one, "c", within={"c": (0.03, 0.05)})[-1]["energy"] for one in starts]
    assert ends[0] == pytest.approx(ends[1], rel=1e-10)
    with pytest.raises(cb.NoSolution, match=r"nothing to set out from.*of the coupling"):
        cb.trace(none, "c")


@pytest.mark.slow
def test_open_circles_among_the_multipliers_have_a_legend() -> None:
    """Those of the band, below a hard breather; above a soft one they have the signature +1."""
    both = phi4(cb.Ring(5), {0: 1, 2: -1}, 0.03).solution
    axes = plot_multipliers(both).axes
    words = {word.get_text() for word in axes.get_legend().get_texts()}
    assert words == {"Krein signature \N{MINUS SIGN}1"}
    (drawn,) = (line for line in axes.get_lines() if line.get_label() in words)
    circles = drawn.get_xdata() + 1j * drawn.get_ydata()
    ends = [abs(both.others - mu).min() for mu in circles]
    assert (len(circles), max(ends) < 1e-12) == (6, True)
    soft = cb.Oscillators(V="1 - cos(u)", W=LINEAR, lattice=cb.Ring(5))
    alone = cb.breather(soft, {0: 1}, omega=0.8, params={"c": 0.03})
    assert plot_multipliers(alone).axes.get_legend() is None


@pytest.mark.slow
def test_long_runs_are_drawn_in_space_and_time_with_their_energy() -> None:
    """The largest displacement of each site in each period, and the energies of all and of one."""
    start = phi4(cb.OpenChain(3), {1: 1}, 0.05)
    run = cb.integrate(start, periods=25, tolerance=1e-8)
    picture, energies, _ = cb.plot(run).figure.axes
    (mesh,) = picture.collections
    sizes = np.asarray(mesh.get_array()).reshape(25, 3)
    wanted = [np.ptp(start.solution.displacement(n, np.linspace(0, 10, 999))) / 2 for n in range(3)]
    np.testing.assert_allclose(sizes, np.tile(wanted, (25, 1)), rtol=2e-2)
    whole, site = (line.get_ydata() for line in energies.get_lines())
    np.testing.assert_allclose(whole, start.solution.energy, atol=1e-6)
    assert site.max() < start.solution.energy
    alone = plot_space_time(start).axes  # over one period, in the same units
    assert alone.get_ylabel() == picture.get_ylabel()
    assert alone.get_ylim() == pytest.approx((0.0, 1.0), abs=5e-3)
    few = cb.plot(cb.integrate(start, periods=2)).figure.axes
    # u and v of the site in the middle, and of both others, which move alike
    assert sum(len(axes.get_lines()) for axes in few) == 4


FORCED = {"damping": "d", "drive": "-a*cos(omega*t)"}
KEPT = {
    "half": ({"V": HARD}, {2: 1}, 1.5, {"c": 0.05}, "c"),
    "masses": ({"V": HARD, "masses": [1, 1, 2, 1]}, {2: 1}, 1.3, {"c": 0.05}, "energy"),
    "driven": ({"V": HARD, **FORCED}, {1: "high"}, 1.3, {"c": 0.02, "d": 0.1, "a": 0.15}, "a"),
    "walls": ({"V": "u**2/20", **FORCED, "walls": 1.0, "k": 0.8}, {1: 1}, 1.0,
              {"c": 0.05, "d": 0.05, "a": 0.5}, "a"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*KEPT])
def test_a_loaded_branch_has_its_equations(kind, tmp_path) -> None:
    given, code, omega, params, free = KEPT[kind]
    chain = cb.Oscillators(**given, W=LINEAR, lattice=cb.OpenChain(4))
    start = cb.breather(chain, code, omega=omega, params=params)
    here = start.params[free] if free in params else start.solution.energy
    branch = cb.trace(start, free, within={free: (0.97 * here, here)})
    cb.save(tmp_path / "breathers.nc", branch)
    again = cb.load(tmp_path / "breathers.nc")
    mu, kept = (of[1].solution.stability(threshold=9.0).map.over_period for of in (branch, again))
    np.testing.assert_allclose(np.sort_complex(mu), np.sort_complex(kept), atol=1e-9)
    wider = {free: (0.97 * here, 1.01 * here)}
    longer = [cb.extend(of, end="last", within=wider, events=()) for of in (branch, again)]
    far, as_far = (of["arclength"] for of in longer)
    np.testing.assert_allclose(far, as_far, rtol=1e-8)  # in steps as long
    one, other = (of[-1] for of in longer)
    assert one["largest"] == pytest.approx(other["largest"], abs=1e-8)
    assert one[free] == other[free] == wider[free][1]


@pytest.mark.slow
def test_what_holds_functions_is_saved_without_equations(tmp_path) -> None:
    chain = cb.Oscillators(V=lambda u, p: u**2 / 2 + u**4 / 4, W=LINEAR, lattice=cb.Ring(3))
    start = cb.breather(chain, {1: 1}, omega=1.5, params={"c": 0.02})
    branch = cb.trace(start, "c", within={"c": (0.01, 0.02)}, events=())
    cb.save(tmp_path / "breathers.nc", branch)
    again = cb.load(tmp_path / "breathers.nc")
    np.testing.assert_array_equal(again["energy"], branch["energy"])
    with pytest.raises(cb.BadInput, match="without its equations"):
        again[0].solution  # noqa: B018
    assert cb.load(tmp_path / "breathers.nc", problem=start)[0].solution.unstable == 0


@pytest.mark.slow
def test_two_pf_and_a_bp_within_one_step_are_located() -> None:
    """The places are those of steps a fourteenth as long."""
    chain = cb.Oscillators("1 - cos(u)", "c*r**2/2", lattice=cb.OpenChain(5))
    start = cb.breather(chain, {2: 1}, omega=0.9, params={"c": 0.08})
    branch = cb.trace(
        start, "omega", within={"omega": (0.5, 0.9)}, towards="down",
        events=[event for event in start.events if event.kind in ("PF", "BP")],
    )  # fmt: skip
    met = [(at.kind, round(float(at["omega"]), 6)) for at in branch.special[1:-1]]
    first = [("PF", 0.547302), ("PF", 0.546093), ("BP", 0.545779), ("BP", 0.540093)]
    assert met == [*first, ("PF", 0.506478), ("PF", 0.505817), ("BP", 0.505554)]
    assert branch.doubtful == ()
    for at in branch.special[1:-1]:
        assert abs(at.solution.indices - 1).min() < 1e-6


@pytest.mark.slow
def test_both_edges_of_a_tongue_within_one_step_are_located() -> None:
    """Where a pair is at -1 either end of the half comes to rest: each has a test of its own."""
    chain, code = (
        cb.Oscillators("u**2/2 - u**3/3", "c*r**2/2", lattice=cb.OpenChain(5)),
        {0: 1, 4: 1},
    )
    start = cb.breather(chain, code, omega=0.7531, params={"c": 0.0942})
    branch = cb.trace(start, "omega", within={"omega": (0.45, 0.98)}, towards="down")
    edges = [at for at in branch.special if at.kind == "PD"]
    assert len(edges) == 6
    high, low = (at["omega"] for at in edges[-2:])
    assert [low, high] == pytest.approx([0.488571, 0.492352], abs=1e-6)
    middle = 0.5 * (low + high)
    for edge, window in zip(edges[-2:], ((middle, high + 1e-3), (low - 1e-3, middle)), strict=True):
        beside = cb.trace(edge, "omega", within={"omega": window}, events=())
        counts = {at["omega"]: at.solution.inverse_hyperbolic for at in beside}
        assert counts[middle] == 2
        assert [counts[end] for end in window if end != middle] == [3]


@pytest.mark.slow
def test_an_orbit_that_is_its_own_image_does_not_double_where_a_pair_touches_minus_one() -> None:
    """Its multipliers are squares of those of the half: at -1 pairs at +-i meet, and pass."""
    chain = cb.Oscillators("u**2/2 - u**4/4", "c*r**2/2", lattice=cb.OpenChain(3))
    start = cb.breather(chain, {1: 1}, omega=0.8, params={"c": 0.03})
    branch = cb.trace(start, "omega", within={"omega": (0.62, 0.8)}, towards="down")
    touched = [point.solution.indices.real.min() for point in branch]
    assert min(touched) < -0.98
    assert "PD" not in [at.kind for at in (*branch.special, *branch.doubtful)]
    assert max(point.solution.inverse_hyperbolic for point in branch) == 0


@pytest.mark.slow
def test_curves_from_a_branch_in_the_energy_may_be_in_the_frequency() -> None:
    """Of either edge of a tongue, each by the block that is singular there."""
    chain = cb.Oscillators("u**2/2 + 0.2*u**3 + u**4/4", LINEAR, lattice=cb.OpenChain(3))
    start = cb.breather(chain, {0: 1}, omega=2.0, params={"c": 0.1})
    family = cb.trace(start, "omega", within={"omega": (2.0, 2.05)})
    high = family[-1]["energy"]
    branch = cb.trace(start, "energy", within={"energy": (6.0, high)}, towards="up")
    edges = [at for at in branch.special if at.kind == "PD"]
    assert len(edges) == 2
    for edge in edges:
        curve = cb.boundary(edge, ("omega", "c"), within={"c": (0.09, 0.11)})
        assert np.hypot(curve["omega"] - edge["omega"], curve["c"] - 0.1).min() < 1e-9


@pytest.mark.slow
def test_sites_that_hardly_feel_each_other_have_no_pf_next_to_no_coupling() -> None:
    """A site in between makes the index leave 1 as the coupling squared: to both sides of it."""
    chain = cb.Oscillators("u**2/2 + u**4/4", "c*r**2/2", lattice=cb.Ring(9))
    apart = cb.breather(chain, {2: 1, 4: -1}, omega=1.6, params={"c": 0.04})
    branch = cb.trace(apart, "c", within={"c": (0.0, 0.1)})
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    assert branch.doubtful == ()


@pytest.mark.slow
def test_a_breather_that_turns_where_a_force_has_no_value_is_none() -> None:
    """Grains that come out of contact there: all places of the equations are in between."""
    how = {"lattice": cb.OpenChain(3, ends="fixed"), "masses": [1.0, 0.1, 1.0]}
    grains = cb.Oscillators(W="2*(1 - r)**2.5/5 + r - 2/5", **how)
    touching = cb.breather(grains, {1: 1}, omega=5.423, collocation=cb.Collocation(12, 4))
    with pytest.raises(cb.errors.ContbreatherError, match="at rest forces have no value"):
        touching.at(omega=5.4219).solve()


def test_a_branch_of_breathers_ends_where_a_contact_opens_at_a_turn() -> None:
    """Its last point had no multipliers: counts of them, or a table, raised."""
    W = "c*(2*(b - r)**(5/2)/5 + b**(3/2)*r)"
    pair = cb.Oscillators(V="u**2/2 + u**4/4", W=W, lattice=cb.OpenChain(2))
    begin = cb.breather(pair, {0: 1}, omega=1.1, params={"c": 0.02, "b": 0.8})
    branch = cb.trace(begin, "omega", within={"omega": (1.05, 1.6)})
    # by shooting, with u1 - u0 = b at rest
    assert branch[-1]["omega"] == pytest.approx(1.20224004, abs=1e-8)
    assert "at rest forces have no value" in branch.reason
    assert branch.table()
    assert branch.doubtful == ()


def test_crossings_of_a_breather_with_few_unknowns_are_looked_for() -> None:
    """Tests of BP of many points at once were those of equilibria: a sentence about arrays."""
    W, few = "c*(2*(b - r)**(5/2)/5 + b**(3/2)*r)", cb.Collocation(4, 4)
    pair = cb.Oscillators(V="u**2/2 + u**4/4", W=W, lattice=cb.OpenChain(2))
    begin = cb.breather(pair, {0: 1}, omega=1.1, params={"c": 0.02, "b": 0.8}, collocation=few)
    branch = cb.trace(begin, "b", within={"b": (0.1, 1.0)})
    assert [point.kind for point in branch.special] == ["MX", "EP"]
