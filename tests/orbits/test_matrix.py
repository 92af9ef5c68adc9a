"""Cases x representations: every orbit by every representation of it, each claim written once.

A case is an orbit, a representation a way to evaluate it: the closed form of one symmetric impact,
the periodic Green's function, exact modes, and, sharing nothing with the package, the equation of
motion integrated from impact to impact. A cell without a representation has its reason in `EMPTY`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from typing import Any

import networkx as nx
import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.by_impacts import ByImpacts
from contbreather.orbits.closed_form import ClosedForm
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import Orbit
from tests.stability.by_hand import apart

from .by_hand import one_wall
from .field import FieldOf

# --- cases --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """An orbit, and the special points its branch has between two values of a parameter."""

    make: Callable[[], Orbit]
    free: str
    within: tuple[float, float]
    special: tuple[str, ...]


def doubled_orbit() -> Orbit:
    arm = asymmetric(0.9, 0.0, 0.8, lattice=cb.Ring(1))
    branch = cb.trace(arm, "a", towards="up", within={"a": (0, 0.94)})
    return cb.switch(branch.first("PD"), within={"a": (0, 0.96)})[0][-1].solution


def weighted_graph() -> cb.Lattice:
    rng = np.random.default_rng(5)
    graph = nx.house_graph()
    for edge in graph.edges:
        graph.edges[edge]["weight"] = rng.uniform(0.5, 1.5)
    return cb.Lattice.from_graph(
        graph, masses=rng.uniform(0.6, 1.6, 5), drive=rng.uniform(0.8, 1.2, 5)
    )


HARMONICS = cb.Fourier({1: -1.0, 3: 0.3}, {3: 0.1})

CASES = {
    "symmetric, infinite chain": Case(
        lambda: cb.symmetric(0.6, 0.04, 0.8), "a", (0.02, 1.2), ("GR", "LP", "PF", "VI")
    ),
    "symmetric, infinite chain, near a pair": Case(
        lambda: cb.symmetric(0.2, 0.08, 0.8), "gamma", (0.05, 0.1), ("NS",)
    ),
    "symmetric, ring": Case(
        lambda: cb.symmetric(0.6, 0.04, 0.8, lattice=cb.Ring(12)),
        "a",
        (0.02, 1.2),
        ("GR", "LP", "NS", "NS", "PF", "VI"),
    ),
    "symmetric, ring of two": Case(
        lambda: cb.symmetric(0.6, 0.1, 0.6, lattice=cb.Ring(2)), "a", (0.5, 0.7), ("GR",)
    ),
    "symmetric, several harmonics": Case(
        lambda: cb.symmetric(0.6, 0.05, 0.7, lattice=cb.Ring(7), forcing=HARMONICS),
        "a",
        (0.02, 1.2),
        ("GR", "LP", "NS", "VI"),
    ),
    "asymmetric, infinite chain": Case(
        lambda: asymmetric(0.82, 0.04, 0.8), "a", (0.78, 1.2), ("GR",)
    ),
    "asymmetric, ring": Case(
        lambda: asymmetric(0.82, 0.04, 0.8, lattice=cb.Ring(6)), "a", (0.78, 1.2), ("GR", "NS")
    ),
    "asymmetric, single oscillator": Case(
        lambda: asymmetric(0.9, 0.0, 0.8, lattice=cb.Ring(1)), "a", (0.85, 0.97), ("PD",)
    ),
    "doubled, single oscillator": Case(doubled_orbit, "a", (0.93, 0.985), ("PD",)),
    "two sites, ring": Case(
        lambda: cb.multibreather([0, 4], a=0.7, gamma=0.03, k=0.8, lattice=cb.Ring(9)),
        "a",
        (0.65, 0.76),
        ("NS", "PF", "PF"),
    ),
    "open chain, losses and springs": Case(
        lambda: cb.symmetric(
            0.6, 0.05, 0.8, lattice=cb.OpenChain(5), site=1, damping=0.02, spring=0.1
        ),
        "a",
        (0.1, 1.2),
        ("GR", "NS", "NS"),
    ),
    "graph, masses and drive": Case(
        lambda: cb.symmetric(0.6, 0.03, 0.8, lattice=weighted_graph(), site=2),
        "a",
        (0.1, 0.8),
        ("NS", "NS", "PF"),
    ),
    "one wall": Case(one_wall, "a", (0.5, 1.5), ("GR", "LP", "VI")),
}


@functools.cache
def given(case: str) -> Orbit:
    return CASES[case].make()


# --- representations ----------------------------------------------------------------------------

REPRESENTATIONS: dict[str, Any] = {
    "closed form": ClosedForm,
    "own section": ByImpacts,
    "whole period": ByImpacts,
}
FIELD = "integrated field"

SYMMETRIC_ONLY = "only one symmetric impact in half a period has a closed form"
CHAIN_ONLY = "waves along a chain: rings and the infinite chain, without losses and springs"
INFINITE = "the infinite chain has no finite state"
CLOSED = "half a period of the infinite chain has the closed form"
WHOLE = "its own section is a whole period"
EMPTY = {
    ("symmetric, infinite chain", "own section"): CLOSED,
    ("symmetric, infinite chain", FIELD): INFINITE,
    ("symmetric, infinite chain, near a pair", "own section"): CLOSED,
    ("symmetric, infinite chain, near a pair", FIELD): INFINITE,
    ("asymmetric, infinite chain", "closed form"): SYMMETRIC_ONLY,
    ("asymmetric, infinite chain", "whole period"): WHOLE,
    ("asymmetric, infinite chain", FIELD): INFINITE,
    ("asymmetric, ring", "closed form"): SYMMETRIC_ONLY,
    ("asymmetric, ring", "whole period"): WHOLE,
    ("asymmetric, single oscillator", "closed form"): SYMMETRIC_ONLY,
    ("asymmetric, single oscillator", "whole period"): WHOLE,
    ("doubled, single oscillator", "closed form"): SYMMETRIC_ONLY,
    ("doubled, single oscillator", "whole period"): WHOLE,
    ("two sites, ring", "closed form"): SYMMETRIC_ONLY,
    ("open chain, losses and springs", "closed form"): CHAIN_ONLY,
    ("graph, masses and drive", "closed form"): CHAIN_ONLY,
    ("one wall", "closed form"): SYMMETRIC_ONLY,
    ("one wall", "whole period"): WHOLE,
}
FULL = [cell for cell in product(CASES, [*REPRESENTATIONS, FIELD]) if cell not in EMPTY]
SOLVED = [cell for cell in FULL if cell[1] != FIELD]
INTEGRATED = [case for case, representation in FULL if representation == FIELD]


def each(names: str, rows: Iterable[tuple[str, ...]]) -> pytest.MarkDecorator:
    found = list(rows)
    return pytest.mark.parametrize(names, found, ids=[" by ".join(row) for row in found])


cells = each("case, representation", SOLVED)
integrated = pytest.mark.parametrize("case", INTEGRATED)


def guess(case: str, representation: str, off: float = 0.0) -> Orbit | None:
    """The orbit put together from its impacts in one representation, off a little; None if none."""
    orbit, kind = given(case), REPRESENTATIONS[representation]
    whole = representation == "whole period"
    told = orbit.unfolded() if whole else orbit
    if (whole and not orbit.symmetric) or not kind.suits(orbit.conditions, told.section):
        return None
    times, impulses = told.times + off, told.impulses * (1.0 + off)
    offsets = told.offsets or (told.c,) * len(told.section.hit)
    return Orbit(kind.through(told.conditions, told.section, times, impulses, offsets))


@functools.cache
def solved(case: str, representation: str) -> Orbit:
    found = guess(case, representation, 1e-4)
    assert found is not None
    return found.solved()


# --- the matrix itself --------------------------------------------------------------------------


@each("case, representation", product(CASES, [*REPRESENTATIONS, FIELD]))
def test_a_cell_is_empty_where_that_representation_does_not_lead_and_nowhere_else(
    case, representation
) -> None:
    if representation == FIELD:
        assert ((case, representation) in EMPTY) == (given(case).lattice.sites is None)
    else:
        assert ((case, representation) in EMPTY) == (guess(case, representation) is None)


# --- the orbit itself ---------------------------------------------------------------------------


@cells
def test_its_equations_hold_and_only_there(case: str, representation: str) -> None:
    off = guess(case, representation, 1e-3)
    assert solved(case, representation).residual < 2e-14
    assert type(solved(case, representation).representation) is REPRESENTATIONS[representation]
    assert off is not None
    assert off.residual > 1e-5


@cells
def test_impacts_are_the_same_by_every_representation(case: str, representation: str) -> None:
    orbit, wanted = solved(case, representation), given(case)
    # those that come at once in the order of their sites
    by_time = [
        sorted(one.hits, key=lambda hit: (round(hit.time, 9), hit.site)) for one in (orbit, wanted)
    ]
    for hit, other in zip(*by_time, strict=True):
        assert (hit.site, hit.wall) == (other.site, other.wall)
        assert hit.time == pytest.approx(other.time, abs=1e-11)
        for name in ("before", "after", "acceleration"):
            assert getattr(hit, name) == pytest.approx(getattr(other, name), abs=1e-10)
    assert np.unique(orbit.entries.round(9)).tolist() == np.unique(wanted.entries.round(9)).tolist()
    if orbit.section.local:
        assert orbit.c == pytest.approx(wanted.c, abs=1e-11)


@cells
def test_motion_is_the_same_by_every_representation(case: str, representation: str) -> None:
    orbit, wanted = solved(case, representation), given(case)
    sites = np.arange(min(5, wanted.lattice.sites or 5))[:, None]
    t = np.linspace(-7.0, 7.0, 41)
    for name in ("displacement", "velocity", "acceleration"):
        own, other = getattr(orbit, name)(sites, t), getattr(wanted, name)(sites, t)
        assert own == pytest.approx(other, abs=1e-12)


@integrated
def test_the_integrated_motion_comes_back_through_the_same_impacts(case: str) -> None:
    FieldOf(given(case)).comes_back(2e-11)


@cells
def test_clearance_is_the_same_by_every_representation(case: str, representation: str) -> None:
    own, wanted = solved(case, representation).admissibility(), given(case).admissibility()
    assert own.ok == wanted.ok
    assert own.ok
    assert own.margin == pytest.approx(wanted.margin, abs=1e-10)


@integrated
def test_clearance_is_what_the_integrated_motion_keeps(case: str) -> None:
    orbit, found = given(case), given(case).admissibility()
    turns = FieldOf(orbit).turns()
    assert turns[0][0] > 0.0
    if found.site in orbit.section.hit:  # measured by its flights, not at its turns
        assert all(n == found.site for _, n in turns if n in orbit.section.hit)
        return
    assert found.margin == pytest.approx(min(gap for gap, n in turns if n == found.site), abs=1e-8)
    assert min(gap for gap, n in turns if n not in orbit.section.hit) > found.margin - 1e-8


# --- stability ----------------------------------------------------------------------------------


@cells
def test_multipliers_and_verdict_are_the_same_by_every_representation(case, representation):
    orbit, wanted = solved(case, representation), given(case)
    own, other = orbit.stability(), wanted.stability()
    assert (own.stable, own.unstable) == (other.stable, other.unstable)
    assert own.largest == pytest.approx(other.largest, abs=1e-9)
    if wanted.lattice.sites is not None:
        assert apart(orbit.multipliers(), wanted.multipliers()) < 1e-6
        mu = orbit.multipliers()
        assert mu.size == 2 * wanted.lattice.sites
        # Liouville: each impact k^2, damping exp(-mu T) for every mode
        lost = math.exp(-orbit.damping * orbit.period * wanted.lattice.sites)
        assert np.prod(mu) == pytest.approx(orbit.k ** (2 * len(orbit.hits)) * lost, rel=1e-9)


@integrated
def test_multipliers_are_those_of_the_integrated_map(case: str) -> None:
    orbit = given(case)
    own = orbit.multipliers(half=orbit.symmetric)
    assert apart(own, orbit.section.sign * FieldOf(orbit).multipliers()) < 1e-6


# --- special points, their curves and what leaves them --------------------------------------------


EVENTS: dict[str, Callable[[], cb.Event]] = {
    "LP": cb.fold,
    "BP": cb.branch_point,
    "PF": cb.pitchfork,
    "PD": cb.period_doubling,
    "NS": cb.neimark_sacker,
    "GR": cb.grazing,
}


@functools.cache
def walked(case: str, representation: str) -> cb.Branch:
    """With all events that there are, each asked for by its name."""
    problem, free = solved(case, representation).problem, CASES[case].free
    events = [EVENTS[event.kind]() for event in problem.events if event.kind in EVENTS]
    return cb.trace(problem, free, within={free: CASES[case].within}, events=events)


@cells
def test_an_event_can_be_asked_for_or_the_sentence_says_why_not(case: str, representation: str):
    orbit = solved(case, representation)
    known = {event.kind for event in orbit.problem.events}
    assert known >= {"LP", "NS", "GR", "PF" if orbit.symmetric else "PD"}
    assert ("PD" in known) != orbit.symmetric
    for kind in EVENTS.keys() - known - {"BP"}:
        with pytest.raises(cb.BadInput, match=rf"no {kind} of this problem .*symmetr"):
            cb.trace(orbit, "a", events=[EVENTS[kind]()])


def kind_of(point: cb.continuation.Point, case: str) -> str:
    """With the whole period written out, the pitchfork of a symmetric orbit is a branch point."""
    half = given(case).symmetric and not point.solution.symmetric
    return "PF" if half and point.kind == "BP" else point.kind


def named(case: str, representation: str, kind: str) -> list[cb.continuation.Point]:
    return [point for point in walked(case, representation).special if kind_of(point, case) == kind]


def first_representation(case: str) -> str:
    return next(representation for one, representation in SOLVED if one == case)


def places(case: str, representation: str) -> list[tuple[str, float]]:
    found = ((kind_of(p, case), p[CASES[case].free]) for p in walked(case, representation).special)
    return sorted(row for row in found if row[0] != "EP")


@cells
def test_special_points_are_the_same_by_every_representation(case: str, representation: str):
    found = places(case, representation)
    assert [kind for kind, _ in found] == sorted(CASES[case].special)
    for own, other in zip(found, places(case, first_representation(case)), strict=True):
        assert own[1] == pytest.approx(other[1], abs=1e-10)


CRITICAL = {"LP": -1.0, "PF": 1.0}  # multiplier of the half map of a symmetric orbit


@each(
    "case, kind", ((c, k) for c in INTEGRATED for k in dict.fromkeys(CASES[c].special) if k != "VI")
)
def test_special_points_are_special_for_the_integrated_map(case: str, kind: str) -> None:
    for point in named(case, "own section", kind):
        orbit = point.solution
        field = FieldOf(orbit)
        if kind == "GR":
            assert field.turns()[0][0] == pytest.approx(0.0, abs=1e-8)
            continue
        mu = orbit.section.sign * field.multipliers()
        if kind == "NS":
            beyond = abs(mu[mu.imag > 1e-3]).max() ** (orbit.period / field.length)
            assert beyond == pytest.approx(1.005, abs=1e-8)
            continue
        wanted = CRITICAL[kind] if orbit.symmetric else {"LP": 1.0, "PD": -1.0}[kind]
        # at a fold a defective pair: it splits by the root of what rounding leaves
        assert abs(mu - wanted).min() < (1e-4 if kind == "LP" else 1e-8)


FOLLOWED = [
    (c, r, k) for c, r in SOLVED for k in dict.fromkeys(CASES[c].special) if k not in ("VI",)
]


@functools.cache
def ends_of_curves(case: str, representation: str, kind: str) -> list[float]:
    """Where the curves from all points of a kind are at a larger k."""
    free, k = CASES[case].free, given(case).k
    found = []
    for point in named(case, representation, kind):
        window = {"k": (k - 0.001, k + 0.01)}
        line = cb.boundary(point, ("k", free), within=window, towards="up", events=[])
        assert line[-1]["k"] == pytest.approx(k + 0.01, abs=1e-12)
        found.append(line[-1][free])
    return sorted(found)


@each("case, representation, kind", FOLLOWED)
def test_curves_of_special_points_are_the_same_by_every_representation(case, representation, kind):
    ends = ends_of_curves(case, representation, kind)
    assert len(ends) == CASES[case].special.count(kind)
    assert ends == pytest.approx(ends_of_curves(case, first_representation(case), kind), abs=1e-8)


LEFT = [row for row in FOLLOWED if row[2] in ("PF", "PD")]


@functools.cache
def arms(case: str, representation: str, kind: str) -> list[list[float]]:
    """Impulses on each branch that leaves a point of a kind, some way off."""
    free, found = CASES[case].free, []
    for point in named(case, representation, kind):
        for branch in cb.switch(point, within={free: (point[free] - 0.004, point[free] + 0.004)}):
            orbit = branch[-1].solution
            assert orbit.section.turns == given(case).section.turns * (1 + (kind == "PD"))
            assert not orbit.symmetric
            found.append(sorted(abs(orbit.impulses).tolist()))
    return sorted(found)


@each("case, representation, kind", LEFT)
def test_branches_that_leave_are_the_same_by_every_representation(case, representation, kind):
    own, wanted = (arms(case, by, kind) for by in (representation, first_representation(case)))
    assert len(own) == len(wanted) > 0
    for one, other in zip(own, wanted, strict=True):
        assert one == pytest.approx(other, abs=1e-7)


@cells
def test_symmetry_related_orbits_solve_the_same_equations(case: str, representation: str) -> None:
    orbit = solved(case, representation)
    problem = orbit.problem
    for image in problem.images(problem.x, problem.params):
        assert abs(problem.residual(image, problem.params)).max() < 1e-11
        assert abs(image - problem.x).max() < 10.0
