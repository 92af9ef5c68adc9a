"""Two impacts of one site at one wall that become one: curves end there, and say so."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.curve.curve import Curve
from contbreather.lattice.conditions import Conditions
from contbreather.orbits.orbit import orbit_at, orbit_of
from contbreather.orbits.section import Section

TWICE = [(0, 1), (0, 1)]


@pytest.fixture(scope="module")
def twice():
    """A branch of orbits that hit each wall twice."""
    seed, on = {"t1": 2.7118, "t2": 3.958}, {"a": 3.265, "gamma": 0.0, "k": 0.834, "damping": 0.05}
    start = cb.shooting(seed, sites=1, sequence=TWICE, symmetric=True, **on)
    return cb.trace(start, "a", within={"a": (2.0, 6.0)})


def test_a_curve_ends_where_two_impacts_of_one_wall_become_one(twice) -> None:
    """There the orbit that hits each wall once is the same, and at rest on the wall."""
    line = cb.boundary(twice.first("VI"), ("k", "a"), towards="down", within={"a": (0.1, 6.0)})
    end, (met,) = line[-1], [p for p in (*line.special, *line.doubtful) if p.kind == "VI-VI"]
    # Along the curve k is the square of the time between the impacts over 11, and 0 is the end of
    # its domain: VI-VI is seen within 1e-9 of that, and rounding decides if it can be located.
    assert met.located or "k = " in met.detail["reason"]
    assert end["k"] < 1e-9
    assert end["t2"] - end["t1"] < 1e-4 + 1e-7  # as near as a place is located
    on = {name: end[name] for name in ("a", "gamma", "k", "damping")}
    seed = {"t1": end["t1"]}
    once = orbit_at(
        cb.shooting(seed, sites=1, sequence=TWICE[:1], symmetric=True, inadmissible=True, **on)
    )
    assert once.times[0] == pytest.approx(end["t1"], abs=1e-4)
    assert once.impulses[0] == pytest.approx(end.solution.impulses.sum(), abs=1e-7)
    assert abs(once.hits[0].acceleration) < 1e-4  # just after it


@pytest.mark.slow
def test_walls_that_are_lifted_do_not_keep_two_impacts_apart() -> None:
    """With the Green's function of a ring: without an end the times would agree to rounding."""
    section = Section(((0, 1), (0, 1), (0, -1)))
    seed = {"t1": -3.565, "t2": -2.55, "t3": 0.138}
    alone = {"a": 1.7, "gamma": 0.0, "k": 0.55}
    first = cb.shooting(seed, sites=1, sequence=section.impacts, inadmissible=True, **alone)
    single = orbit_at(first)
    on = Conditions(1.7, 1e-3, 0.55, lattice=cb.Ring(3))
    start = orbit_of(on, section, single.times, single.impulses)
    branch = cb.trace(start, "a", within={"a": (0.3, 3.0)}, inadmissible=True)
    fold = min(branch.special, key=lambda point: (point.kind != "LP", point["a"]))
    line = cb.boundary(fold, ("k", "a"), towards="down", within={"a": (0.1, 6.0)})
    assert (line.stop.name, line[-1].kind) == ("EVENT", "LP-VI")
    assert line[-1]["t2"] - line[-1]["t1"] == pytest.approx(1e-4)


@pytest.mark.parametrize("late", [0.3, 3e-3, 1e-4, -1e-3])
def test_equations_of_impacts_at_one_wall_are_smooth_where_these_are_one(twice, late: float):
    """The derivative fits differences, before, at and beyond the place, both ways."""
    half = twice.first("LP").solution
    on = Conditions(half.a, 0.01, half.k, lattice=cb.Ring(3))
    whole = half.unfolded()
    waves = orbit_of(on, whole.section, whole.times, whole.impulses).problem
    modes = twice.problem
    for problem in (waves, modes):
        curve = Curve(problem, ("a",))
        z, step = curve.start.copy(), 1e-5
        z[1] = z[0] + late
        found = curve.jacobian(z)
        for column, aside in enumerate(step * np.eye(z.size)):
            slope = (curve.equations(z + aside) - curve.equations(z - aside)) / (2 * step)
            assert found[:, column] == pytest.approx(slope, abs=1e-7)


def test_a_fold_on_a_curve_of_vanishing_impacts_is_named_by_both() -> None:
    """Without an impact all sites are the forced oscillator, ``|1 - spring - i damping| = a``."""
    on = {"lattice": cb.Ring(3), "damping": 0.03, "spring": 0.7}
    start = cb.symmetric(0.25, 0.05, 0.8, **on)
    branch = cb.trace(start, "a", within={"a": (0.2, 1.5)})
    line = cb.boundary(branch.first("VI"), ("spring", "a"), within={"spring": (0.7, 0.9)})
    assert [point.kind for point in line.special] == ["EP", "VI-LP", "EP"]
    np.testing.assert_allclose(line["a"], np.hypot(1 - line["spring"], 0.03), atol=1e-9)


def test_impacts_that_vanish_together_by_symmetry_do_so_all_along():
    """A symmetric orbit by its whole period: both of its impacts vanish where the forced
    oscillation touches both walls."""
    given = {"lattice": cb.Ring(1), "damping": 0.1, "spring": 0.3, "omega": 1.2}
    whole = cb.shooting(cb.symmetric(1.5, 0.0, 0.6, **given), symmetric=False)
    branch = cb.trace(whole, "a", towards="down")
    line = cb.boundary(branch.first("VI"), ("omega", "a"), within={"omega": (0.8, 2.0)})
    assert line.stop.name == "BOUND"
    assert not line.doubtful
    touching = np.hypot(0.3 - line["omega"] ** 2, 0.1 * line["omega"])
    assert line["a"] == pytest.approx(touching, abs=1e-10)


def test_a_curve_of_vanishing_impacts_ends_where_another_site_comes_to_its_wall():
    """The place is that of Newton's method on flows by exponentials of matrices, with no impact
    but the one that is left."""
    on = {"lattice": cb.OpenChain(3, ends="fixed"), "damping": 0.0431}
    start = cb.multibreather([0, 1], a=0.53, gamma=0.0396, k=0.7169, **on)
    vanishing = cb.trace(start, "a").first("VI")
    line = cb.boundary(vanishing, ("k", "a"), within={"k": (0.05, 0.9)})
    assert [point.label for point in line.special] == ["VI-GR1", "VI-PF1", "EP1"]
    end = line.first("VI-GR")
    assert (end["site"], end["k"], end["a"]) == pytest.approx((2, 0.185145509613, 0.96142546685))
    u = [point.solution.displacement(2, np.linspace(0.0, np.pi, 999)) for point in line]
    assert np.abs(u).max() < 1.0 + 1e-9
