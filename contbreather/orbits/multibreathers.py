"""Multibreathers: several impacting sites, continued from the limit without coupling.

At gamma = 0 every site is a single oscillator under the same forcing, so any choice of one of its
orbits for each impacting site is a solution, and where it is regular it goes on to gamma > 0.
What ends it is a fold, where it merges with another choice, or a site that grazes a wall.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import is_whole
from contbreather.continuation.bifurcations.equilibria import branch_point, fold
from contbreather.continuation.curve.branch import Branch, Points, Stop
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.problem import Problem
from contbreather.continuation.walk.trace import trace
from contbreather.errors import BadInput, NoSolution, NotConverged, partial_result
from contbreather.lattice.conditions import Conditions, Walls, in_time_of_drive
from contbreather.lattice.finite import PER_SITE, ROWS, Finite, finite, stiffness_of
from contbreather.lattice.forcing import Drive, even_harmonics, with_even
from contbreather.lattice.formula import forcing_of
from contbreather.one_thread import one_thread
from contbreather.orbits.by_impacts import ByImpacts, symmetric_orbits
from contbreather.orbits.clearance import Inadmissible
from contbreather.orbits.grazing import CATCHING, GRAZING
from contbreather.orbits.orbit import Orbit, orbit_at
from contbreather.orbits.orbit_events import from_arms
from contbreather.orbits.section import WEAK, Section
from contbreather.orbits.start_search import grown
from contbreather.stability.verdict import THRESHOLD
from contbreather.tables import Cell, HtmlRepr, Sheet

FloatArray = NDArray[np.float64]

ROOTS = ("upper", "lower")
TOGETHER = 9  # digits to which times are compared: impacts at once are listed by their sites


Single = tuple[int, Orbit]  # a site, and the orbit it has in the limit without coupling


@one_thread
def multibreather(
    choice: Sequence[int] | Mapping[int, Any],
    *,
    a: float,
    gamma: float,
    k: float,
    lattice: Finite,
    damping: float = 0.0,
    spring: float = 0.0,
    walls: Any = None,
    omega: float = 1.0,
    forcing: Drive | None = None,
) -> Orbit:
    """An orbit of several impacting sites, continued from gamma = 0 to the coupling asked for.

    Parameters
    ----------
    choice : sequence of int, or dict
        The sites that impact; or for each the orbit it has without coupling: ``"upper"`` or
        ``"lower"``, the root of the closure with the larger or the smaller p (with even harmonics
        in the drive what it becomes as they grow from 0), or any orbit of the
        single oscillator (symmetric, asymmetric or doubled) under the same forcing, or a point of
        one of its branches.
    a, gamma, k, damping, spring, walls, omega, forcing
        As for `symmetric`.
    lattice : Ring or Lattice

    Returns
    -------
    Orbit

    Raises
    ------
    BadInput
        For sites that are not there, or orbits of other parameters.
    NoSolution
        Where a fold or a grazing comes first; the sentence names the coupling reached.

    Examples
    --------
    >>> from contbreather.lattice import Ring
    >>> two = multibreather([0, 6], a=0.5, gamma=0.03, k=0.8, lattice=Ring(12))
    >>> two.section.impacts, bool(two.admissibility())
    (((0, 1), (6, 1)), True)
    """
    at, drive = Walls.given(walls), forcing_of(forcing)
    place = finite(lattice)
    on = Conditions(a, gamma, k, damping, spring, drive, at, place, omega=omega).checked()
    with in_time_of_drive(on) as scaled:
        branch = _from_the_limit(_singles(choice, scaled), scaled)
        if branch is None or branch[-1]["gamma"] < scaled.gamma:
            raise NoSolution(_refusal(_in_words(choice), branch, scaled))
    return replace(branch[-1].solution, omega=on.omega, given=on.params)


def _in_words(choice: Sequence[int] | Mapping[int, Any]) -> str:
    named = dict(choice) if isinstance(choice, Mapping) else dict.fromkeys(choice, "")
    phrases = (
        f"{site} ({orbit if isinstance(orbit, str) else orbit.section.describe()})"
        if orbit
        else f"{site}"
        for site, orbit in named.items()
    )
    return f"site{'s' * (len(named) > 1)} {', '.join(phrases)}"


def _refusal(choice: str, branch: Branch | None, on: Conditions) -> str:
    if branch is None:
        return f"{choice}: without coupling these impacts are no orbit of the lattice already."
    end = _farthest(branch)
    why = {
        "LP": "it turns back, into an orbit of another choice",
        # where it doubles, or unfolds: beyond it comes back to where it set out
        "BP": "it turns back, into an image of itself, at a branch point",
        "PF": "it meets its mirror image, at a pitchfork of an orbit that is its own",
        "GR": str(end.solution.admissibility().reason),
        "VI": str(end.solution.admissibility().reason),
        "CC": "sites hit their walls at once that did so one after the other",
    }.get(end.kind, branch.reason or branch.stop.value)
    return (
        f"{choice}: this orbit reaches gamma = {end['gamma']:.9g}, not {on.gamma:.9g}; "
        f"there {why.removesuffix('.')}."
    )


def _farthest(branch: Branch) -> Point:
    """Point of its largest coupling: located, as where it meets an image of itself and comes back,
    or its end."""
    points: tuple[Point, ...] = (*branch.special, branch[-1])
    return max(points, key=lambda point: float(point["gamma"]))


# --- from one site to many ----------------------------------------------------------------------


def _singles(choice: Sequence[int] | Mapping[int, Any], on: Conditions) -> list[Single]:
    try:
        chosen = dict(choice) if isinstance(choice, Mapping) else dict.fromkeys(choice, "upper")
    except TypeError:
        raise BadInput(
            f"{choice!r}: a list of sites is expected, or a dict of sites and orbits."
        ) from None
    if not chosen or len(chosen) < len(choice):
        raise BadInput(f"{choice!r}: name at least one site, and each once.")
    return [_single(site, orbit, replace(on, gamma=0.0)) for site, orbit in chosen.items()]


def _single(site: int, orbit: Any, on: Conditions) -> Single:
    """One site without coupling: by the name of a root, or by an orbit of its own."""
    ((site, _),) = Section(((site, 1),)).placed(on.lattice).impacts
    if isinstance(orbit, Point) and orbit.base_point.curve.problem.interpret is not None:
        orbit = orbit.solution
    if isinstance(orbit, str) and orbit in ROOTS:
        # one alone at the fold (14), where both meet, and where the lower has no p > 0
        roots = symmetric_orbits(site, replace(on, forcing=with_even(0.0, on.forcing)))
        orbit = roots[min(ROOTS.index(orbit), len(roots) - 1)]
        if even_harmonics(on.forcing):
            orbit = grown(orbit, on.forcing)
    elif not isinstance(orbit, Orbit):
        raise BadInput(
            f"site {site}: {orbit!r} was given; 'upper', 'lower' or an orbit of the single "
            "oscillator is expected."
        )
    elif orbit.lattice.sites != 1 and (orbit.gamma != 0.0 or not orbit.section.local):
        raise BadInput(
            f"site {site}: {orbit!r} has gamma = {orbit.gamma!r}; an orbit of the single "
            "oscillator, without coupling, is expected."
        )
    elif not np.allclose(
        _under(orbit.representation.conditions, orbit.section.hit[0]), _under(on, site)
    ):
        own = "".join(f", {name} = {on.at_sites(name, site):g}" for name in PER_SITE)
        raise BadInput(
            f"site {site}: {orbit!r} was given; one of the same a, k, damping, spring and forcing "
            f"is expected, a = {on.a}{own} and {on.forcing.describe()}, say."
        )
    return site, orbit


def _under(on: Conditions, site: int) -> FloatArray:
    """Conditions of a site without coupling: its losses, its spring, its drive over a period."""
    drive = on.a if on.lattice.sites is None else on.a * on.lattice.drive[site]
    # drives of different kinds are the same if their values are
    times = np.linspace(0.0, 2.0 * math.pi, 16)
    own = [on.at_sites(name, site) for name in PER_SITE]
    return np.array([*own, *(drive * on.forcing.d2f(times))])


def _section(singles: Sequence[Single]) -> tuple[Section, list[float]]:
    """Impacts in order of time over one common section."""
    # the shortest period they have in common; half of it where n is odd and each orbit is its own
    # mirror image, u(t + n pi) = -u(t)
    turns = math.lcm(*(orbit.section.turns for _, orbit in singles))
    symmetric = turns % 2 == 1 and all(orbit.section.symmetric for _, orbit in singles)
    length, sign = math.pi * turns * (1 if symmetric else 2), -1 if symmetric else 1
    course = [
        (time, site, wall)
        for site, orbit in singles
        for _, wall, time, _ in orbit.section.course(
            orbit.impacts, round(length / orbit.section.length)
        )
    ]
    # each orbit counts its times from an impact of its own: all are taken into one section
    first, impacts = min(course)[0], []
    for time, site, wall in course:
        ahead = int(round((time - first) / length, TOGETHER))
        impacts.append((time - ahead * length, site, sign**ahead * wall))
    impacts.sort(key=lambda impact: (round(impact[0], TOGETHER), impact[1]))
    # which begins after the longest flight: times of different sites drift along a branch, and the
    # last one must not come a section after the first
    flights = np.diff([time for time, *_ in impacts], append=impacts[0][0] + length)
    last = np.round(flights[::-1], TOGETHER).argmax()  # of those as long, as it is if it can be
    cut = (len(impacts) - int(last)) % len(impacts)
    again = [(time + length, site, sign * wall) for time, site, wall in impacts[:cut]]
    impacts = impacts[cut:] + again
    impacts = _halves(impacts) or impacts
    sequence = tuple((n, wall) for _, n, wall in impacts)
    return Section(sequence, turns, sign), [time for time, _, _ in impacts]


def _halves(impacts: list[tuple[float, int, int]]) -> list[tuple[float, int, int]]:
    """Impacts whose second half comes in the order of the first, where each site then hits its
    opposite walls; empty if not all do. Those of different sites may overtake each other."""
    of_site: dict[int, list[tuple[float, int, int]]] = {}
    for impact in impacts:
        of_site.setdefault(impact[1], []).append(impact)
    late: dict[tuple[float, int, int], tuple[float, int, int]] = {}
    for own in of_site.values():
        half = len(own) // 2
        late |= dict(zip(own[:half], own[half:], strict=False))
    opposite = all(a[2] == -b[2] for a, b in late.items())
    first = [impact for impact in impacts if impact in late]
    whole = opposite and 2 * len(first) == len(impacts)
    return [*first, *(late[impact] for impact in first)] if whole else []


def _from_the_limit(singles: Sequence[Single], on: Conditions) -> Branch | None:
    """The branch from the limit up to the coupling asked for; None if it does not begin."""
    section, times = _section(singles)
    section = section.placed(on.lattice)
    try:
        seed = ByImpacts.closest(replace(on, gamma=0.0), section, times)
        start, _ = seed.guess(THRESHOLD).solve(tolerance=1e-11)
    except NotConverged:
        return None
    orbit = orbit_at(start)
    if abs(orbit.times - times).max() > 0.1:  # not the orbit that was chosen
        return None
    # its idle sites as they rest next to no coupling at all
    weak = replace(orbit.representation, conditions=replace(orbit.conditions, gamma=WEAK))
    if (margin := Orbit(weak).admissibility()).margin < 0.0:
        raise Inadmissible(f"without coupling already {margin.reason}", orbit=orbit)
    if on.gamma <= 0.0:
        curve = Curve(start, ("gamma",))
        return Branch(Points.of([Point(curve, curve.start)]), Stop.START)
    # behind a fold the coupling falls again, and behind a branch point where it meets its image
    ends = (replace(fold(), ends="branch"), from_arms(branch_point()), GRAZING, CATCHING)
    return trace(start, "gamma", within={"gamma": (0.0, on.gamma)}, towards="up", events=ends)


# --- all of them --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Multibreather(HtmlRepr):
    """One entry of the catalogue: a choice of sites, and what becomes of it.

    Attributes
    ----------
    sites : tuple of int
        One representative of all choices that a symmetry of the lattice makes alike.
    copies : int
        How many those are.
    gamma : float
        The coupling it reaches, at most the one asked for.
    ended : str
        What ended it there: GR, LP or another kind; empty where it exists.
    orbit : Orbit or None
        The last one of its branch.
    """

    sites: tuple[int, ...]
    copies: int
    gamma: float
    ended: str
    orbit: Orbit | None = field(repr=False)

    @property
    def exists(self) -> bool:
        """True where it lives at the coupling that was asked for."""
        return self.orbit is not None and not self.ended

    @property
    def problem(self) -> Problem:
        """What `trace` sets out from: that of its orbit, where it exists."""
        if self.orbit is None or self.ended:
            raise NoSolution(f"nothing to set out from: gamma = {self.gamma:.6g}, {self.ended}")
        return self.orbit.problem

    def table(self) -> Sheet:
        """Its sites, how far it goes, and what ends it."""
        rows: list[tuple[str, Cell]] = [("sites", ", ".join(map(str, self.sites)))]
        rows += [("choices alike", self.copies), ("reaches gamma", self.gamma)]
        return Sheet.of([*rows, ("ends with", self.ended or None)])

    def stable(self, threshold: float = THRESHOLD) -> bool:
        """True where it exists, and no multiplier of it is beyond the threshold."""
        orbit = self.orbit if self.exists else None
        return orbit is not None and bool(orbit.stability(threshold=threshold).stable)


def multibreathers(
    lattice: Finite,
    *,
    a: float,
    gamma: float,
    k: float,
    most: int = 3,
    damping: float = 0.0,
    spring: float = 0.0,
    walls: Any = None,
    omega: float = 1.0,
    forcing: Drive | None = None,
) -> tuple[Multibreather, ...]:
    """Choices of up to `most` sites that impact on their upper root, one for each class of
    choices that a symmetry of the lattice maps into each other.

    Examples
    --------
    >>> from contbreather.lattice import Ring
    >>> catalogue = multibreathers(Ring(6), a=0.5, gamma=0.02, k=0.8, most=2)
    >>> [(entry.sites, entry.copies, entry.exists) for entry in catalogue]
    [((0,), 6, True), ((0, 1), 6, True), ((0, 2), 6, True), ((0, 3), 3, True)]
    """
    finite(lattice)
    if not is_whole(most) or not 1 <= most <= lattice.sites:
        raise BadInput(f"most = {most!r}: a whole number of sites, 1 to {lattice.sites}.")
    at, drive = Walls.given(walls), forcing_of(forcing)
    on = Conditions(a, gamma, k, damping, spring, drive, at, lattice, omega=omega).checked()
    catalogue: list[Multibreather] = []
    with partial_result(lambda: tuple(catalogue)), in_time_of_drive(on) as scaled:
        for count in range(1, most + 1):
            for sites, copies in _classes(on.lattice, count, on.walls):
                catalogue.append(_entry(sites, copies, on, scaled))
    return tuple(catalogue)


def _entry(
    sites: tuple[int, ...], copies: int, on: Conditions, scaled: Conditions
) -> Multibreather:
    try:
        branch = _from_the_limit(_singles(sites, scaled), scaled)
    except NoSolution:  # a site that the forcing does not bring to its walls
        branch = None
    if branch is None:
        return Multibreather(sites, copies, 0.0, "no orbit without coupling", None)
    end, gamma, ended = _farthest(branch), on.gamma, ""
    if end["gamma"] < scaled.gamma:
        gamma, ended = float(end["gamma"]) * on.omega**2, end.kind
    orbit = replace(end.solution, omega=on.omega, given={**on.params, "gamma": gamma})
    return Multibreather(sites, copies, gamma, ended, orbit)


def _classes(lattice: Finite, count: int, walls: Walls) -> list[tuple[tuple[int, ...], int]]:
    """Choices of sites up to the symmetries of the lattice and its walls, with the size of each
    class."""
    own = [getattr(lattice, name) for name in ROWS]
    own += zip(*map(walls.at, range(lattice.sites)), strict=True)
    exchanges = [*exchanges_of_sites(stiffness_of(lattice).toarray(), own)]
    choices = itertools.combinations(range(lattice.sites), count)
    return classes_of(
        {sites: [tuple(sorted(to[n] for n in sites)) for to in exchanges] for sites in choices}
    )


def classes_of(images: Mapping[Any, Iterable[Any]]) -> list[tuple[Any, int]]:
    """The first of each class of choices that are images of each other, and how many it has."""
    import networkx as nx  # dear to import, as below

    alike, order = nx.Graph(), {choice: i for i, choice in enumerate(images)}
    alike.add_nodes_from(images)
    alike.add_edges_from((a, b) for a, others in images.items() for b in others if b in order)
    classes = nx.connected_components(alike)
    return [(min(choices, key=order.__getitem__), len(choices)) for choices in classes]


def exchanges_of_sites(bonds: FloatArray, own: Iterable[Any]) -> Iterator[Mapping[int, int]]:
    """Exchanges of sites that together generate all symmetries: with the first n sites held, those
    that take the next one to all places it can be taken to.

    To nine digits what sets sites apart is the diagonal of a symmetric matrix and rows of their
    own, and what sets bonds apart are its other entries.
    """
    import networkx as nx

    graph = nx.Graph()
    for n, traits in enumerate(zip(bonds.diagonal(), *own, strict=True)):
        graph.add_node(n, colour=" ".join(f"{x:.9g}" for x in traits))
    for i, j in np.argwhere(np.triu(bonds, 1) != 0.0).tolist():
        graph.add_edge(i, j, weight=f"{bonds[i, j]:.9g}")
    far = nx.floyd_warshall_numpy(graph, weight=None)
    same = [
        nx.isomorphism.categorical_node_match(["colour", "held"], ["", -1]),
        nx.isomorphism.categorical_edge_match("weight", ""),
    ]
    for n in graph:
        held, reached = [*range(n)], nx.empty_graph(len(graph))
        for to in range(n + 1, len(graph)):
            if (far[n, held] != far[to, held]).any() or nx.has_path(reached, n, to):
                continue
            before, after = graph.copy(), graph.copy()
            nx.set_node_attributes(before, {i: i for i in [*held, n]}, "held")
            nx.set_node_attributes(after, {**{i: i for i in held}, to: n}, "held")
            matcher = nx.isomorphism.GraphMatcher(before, after, *same)
            if matcher.is_isomorphic():
                reached.add_edges_from(matcher.mapping.items())
                yield matcher.mapping
