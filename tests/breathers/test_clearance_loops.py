"""The least margin in numbers and loops is that of `clearance`, whatever orbit is asked about."""

from __future__ import annotations

import ctypes
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.breathers import clearance, clearance_loops
from contbreather.breathers import rivals as rivals_of
from contbreather.breathers.arms import asymmetric
from contbreather.breathers.clearance import least_margin
from contbreather.breathers.orbit import Orbit, orbit_of
from contbreather.breathers.rivals import rivals, rivals_data
from contbreather.breathers.section import Section
from contbreather.breathers.waves import equations_of
from contbreather.kernels import Kernel
from contbreather.lattice import wave_loops
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.periodic import wave_table

from .by_hand import touching

PLAIN = [
    cb.symmetric(a, gamma, k)
    for a, gamma, k in ((0.5, 0.12, 0.4), (0.93, 0.04, 0.8), (0.2, 0.2, 0.99), (0.99, 0.01, 0.02))
]
OTHERS = [
    cb.breathers.symmetric_roots(0.9, 0.12, 0.8)[1],  # where the second neighbour climbs highest
    cb.symmetric(0.7, 0.0, 0.0, root=1),
    cb.symmetric(0.6, 0.07, 0.7, forcing="cos(t) + 0.3*cos(3*t)"),
    *(cb.symmetric(0.5, 0.05, 0.8, lattice=cb.Ring(sites)) for sites in (1, 2, 5)),
    asymmetric(0.87, 0.04, 0.8),
    asymmetric(0.8, 0.04, 0.8).doubled(),
    cb.symmetric(0.5, 0.08, 0.0).unfolded(),
]


def two_sites() -> Orbit:
    """On the infinite chain, with an offset for each site."""
    found = cb.multibreather([0, 3], a=0.5, gamma=0.02, k=0.8, lattice=cb.Ring(12)).unfolded()
    on = Conditions(0.5, 0.02, 0.8)
    return orbit_of(on, found.section, found.times, found.impulses, (0.0, 0.0)).solved()


OTHERS.append(two_sites())


@pytest.fixture(autouse=True)
def arrays_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the loops are held against is not compiled from them."""
    monkeypatch.setattr(Kernel, "code", lambda kernel: None)


def by_loops(orbit: Orbit, function: Any = clearance_loops.margin, data: Any = None) -> float:
    """As the text says, without compiling it."""
    packed = orbit.watch.packed()
    assert packed is not None
    out, grid = [math.nan] * packed.own, [math.nan] * packed.points
    data = packed.data.tolist() if data is None else data
    assert function(data, packed.table.ravel().tolist(), grid, out) == 0
    return out[0]


@pytest.mark.parametrize("orbit", [*PLAIN, *OTHERS], ids=repr)
def test_the_least_margin_by_loops_is_that_of_the_clearance(orbit: Orbit) -> None:
    assert by_loops(orbit) == pytest.approx(orbit.admissibility().margin, abs=1e-13)


@pytest.mark.parametrize("orbit", [*PLAIN, *OTHERS], ids=repr)
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_least_rival_by_loops_is_that_of_all_rivals(orbit: Orbit, mirrored: bool) -> None:
    watch = orbit.watch
    for gap in clearance.gaps_of_idle(watch):  # as if each of them touched
        data = rivals_data(watch, watch.packed(), gap.site, gap.time, mirrored=mirrored).tolist()
        busy = {one.site for one in orbit.impacts}
        known = rivals(watch, gap.site, gap.time, mirrored=mirrored)
        found = by_loops(orbit, clearance_loops.rivals, data)
        assert found == pytest.approx(min(known).margin, abs=1e-10)
        data[clearance_loops.FLIGHTS] = 0  # impacts come first almost always: without them, too
        idle = [one.margin for one in known if one.site not in busy]
        found = by_loops(orbit, clearance_loops.rivals, data)
        assert found == pytest.approx(min(idle), abs=1e-10)


@pytest.mark.parametrize("size", [64, 100, 336])
def test_both_forms_look_at_the_same_places(size: int) -> None:
    """Of a flight, and of a section as long as it takes."""
    wanted = clearance._grid(size)
    own = [clearance_loops.share(p, size) for p in range(wanted.size)]
    assert own == pytest.approx(wanted, rel=1e-15)
    assert clearance_loops.STEEP + size - 1 == wanted.size
    assert min(own) > 0.0
    assert 1.0 - max(own) == pytest.approx(1.0 / size)
    for length in (0.1, 1.0, 2.0, math.pi, 3.2, 2.0 * math.pi, 12.0 * math.pi, 13.7):
        orbit = SimpleNamespace(highest=size / 16)
        data = [math.nan] * clearance_loops.FINE + [float(size)]
        points = clearance.points_of(orbit, length)
        assert clearance_loops.looks(data, length) == points
        assert points == pytest.approx(size * max(1.0, length / math.pi), abs=1.0)


@pytest.mark.parametrize("side", [0.0, 1.0, -1.0])
def test_a_crest_is_climbed_by_loops_from_wherever_it_is_asked(side: float) -> None:
    """A motion without impacts, ``0.1 + 0.5 (cos t - cos(3 t)/5)``: Newton's step leaves too wide
    intervals next to its inflections."""
    data = [math.nan] * clearance_loops.FIRST
    data[clearance_loops.A], data[clearance_loops.N] = 0.5, 1.0
    data[clearance_loops.HARMONICS], data[clearance_loops.IMPACTS] = 2, 0
    data += [1.0, 1.0, 0.0, 3.0, -0.2, 0.0, 0.1, 0.0]
    t = np.linspace(-math.pi, math.pi, 200001)
    u = 0.1 + 0.5 * (np.cos(t) - 0.2 * np.cos(3 * t))
    out = [math.nan] * 4
    for start, step in ((0.9, 0.8), (0.5, 0.3), (-0.6, 0.5), (3.0, 0.6), (1.9, 1.4)):
        near = u[abs(t - start) <= step]
        up = side > 0.0 or (side == 0.0 and np.interp(start, t, u) > 0.0)
        wanted = near.max() if up else near.min()
        if wanted in (near[0], near[-1]):
            continue  # no extremum within
        found = clearance_loops.climbed(data, [], out, 0, start, step, side)
        assert found == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("gamma", [0.02, 0.05])
def test_where_a_flat_crest_grazes_loops_divide_it_out_as_well(gamma: float) -> None:
    forcing = cb.Fourier.from_response(cos={1: 1.0, 3: -0.1})
    orbit, t = touching(2, gamma, 1.0, 0.3, forcing=forcing)
    watch, packed = orbit.watch, orbit.watch.packed()
    data = rivals_data(watch, packed, 2, t, mirrored=False).tolist()
    out, grid = [math.nan] * packed.own, [math.nan] * packed.points
    table, own = packed.table.ravel().tolist(), packed.sites.index(2)
    assert clearance_loops.rivals(data, table, grid, out) == 0
    points = clearance_loops.looks(data, data[clearance_loops.LENGTH])
    end = (len(packed.sites) - 1) * points
    found = clearance_loops.besides(data, table, grid, out, own, points, end)
    assert found == pytest.approx(rivals(watch, 2, t)[0].margin, abs=1e-9)


def test_once_compiled_code_for_rivals_is_at_hand_it_is_asked(monkeypatch) -> None:
    class Told:
        def code(self) -> object:
            return lambda *at: ctypes.c_double.from_address(at[3]).__setattr__("value", 0.25)

    kernels = rivals_of._RIVALS, clearance._MARGIN
    assert [kernel.function for kernel in kernels] == [
        clearance_loops.rivals,
        clearance_loops.margin,
    ]
    watch = PLAIN[0].watch
    gap = min(clearance.gaps_of_idle(watch))
    wanted = min(rivals(watch, gap.site, gap.time)).margin
    assert rivals_of.least_rival(watch, gap.site, gap.time) == wanted
    monkeypatch.setattr(rivals_of, "_RIVALS", Told())
    assert rivals_of.least_rival(watch, gap.site, gap.time) == 0.25
    own = min(rivals(watch, 0, watch.start + 1.0)).margin
    assert rivals_of.least_rival(watch, 0, watch.start + 1.0) == own  # which loops do not know


def test_beyond_its_limits_the_margin_by_loops_is_negative_alike() -> None:
    touching = cb.breathers.symmetric_roots(1.2, 0.1, 0.03)[0]
    assert by_loops(touching) == pytest.approx(touching.admissibility().margin, abs=1e-13)
    assert by_loops(touching) < 0.0


def test_orbits_without_such_a_form_are_asked_as_before() -> None:
    held = cb.symmetric(a=0.5, gamma=0.05, k=0.8, spring=0.2)
    assert held.watch.packed() is None
    assert least_margin(held.watch) == held.admissibility().margin


def test_once_compiled_code_is_at_hand_it_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    class Counting:
        def code(self) -> object:
            return lambda *addresses: asked.append(len(addresses))

    orbit = PLAIN[0]
    assert least_margin(orbit.watch) == pytest.approx(orbit.admissibility().margin, abs=1e-13)
    monkeypatch.setattr(clearance, "_MARGIN", Counting())
    least_margin(orbit.watch)
    assert asked == [4]


@pytest.mark.parametrize(
    ("section", "times"),
    [
        (Section(((0, 1), (0, -1))), [0.3, 3.2]),
        (Section(((0, 1), (3, -1))), [0.3, 3.2]),
        (Section(((0, 1), (3, 1), (0, -1), (3, -1)), turns=2), [0.1, 0.1, 7.0, 12.4]),
    ],
)
def test_what_impacts_do_to_each_other_by_loops(section: Section, times: list[float]) -> None:
    equations = equations_of(section, cb.Harmonic(), cb.InfiniteChain())
    gamma, m = 0.05, len(times)
    distances, rows = equations._rows
    table = wave_table(cb.InfiniteChain(), gamma, distances, section.turns).ravel().tolist()
    out = [math.nan] * (4 * m * m)
    assert wave_loops.meetings([m, section.turns, *times, *rows], table, out) == 0
    wanted = equations.meetings(gamma, np.array(times))
    assert np.reshape(out, (4, m, m)) == pytest.approx(wanted, rel=1e-12, abs=1e-13)


def test_a_site_that_is_skipped_cannot_climb_highest() -> None:
    from contbreather.lattice.periodic import wave_basis, wave_rows

    rows = wave_rows(cb.InfiniteChain(), 0.2, tuple(range(14)))
    assert rows is not None
    answers = rows[:, :-1] @ wave_basis(np.linspace(0.0, 2.0 * math.pi, 4001))
    assert (abs(answers).max(axis=1) <= rows[:, -1]).all()
