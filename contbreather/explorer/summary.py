"""What the panels show of an orbit, as numbers and sentences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.continuation.branch import Branch
from contbreather.errors import BadInput, ContbreatherError
from contbreather.explorer.jobs import point_of
from contbreather.explorer.state import Named
from contbreather.lattice.chain import Ring
from contbreather.orbits.orbit import Orbit
from contbreather.plotting.multipliers import with_band

Array = NDArray[Any]

REACH = 10  # sites on either side of the one that impacts
MOMENTS = 401  # of a period


@dataclass(frozen=True, eq=False)
class Profile:
    """All sites at an impact, and between what they move; walls are NaN where there is none."""

    sites: Array
    time: float
    at_impact: Array
    lowest: Array
    highest: Array
    walls: Array  # (sites, 2)


@dataclass(frozen=True, eq=False)
class ShownMotion:
    """Some sites over a period, in units of it, with their impacts."""

    times: Array
    by_site: dict[int, Array]
    hits: tuple[tuple[int, float, float], ...]  # site, time, where
    walls: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Those over a section, half a period of a symmetric orbit, on the lattice that is named;
    `alone` are off the `waves`, where multipliers of plane waves lie: rows of complex numbers."""

    mu: Array
    alone: NDArray[np.bool_]
    waves: Array
    about: str


def names(curves: Iterable[Named]) -> dict[str, str]:
    """The codes of curves by their names, which have what not all of them share: the parameters
    that vary, those that do not, and the lattice."""
    by_code = {curve.code: _facts(curve.branch) for curve in curves}
    shared = set.intersection(*map(set, by_code.values())) if by_code else set()
    rest = {code: [fact for fact in facts if fact not in shared] for code, facts in by_code.items()}
    return {": ".join(filter(None, (code, ", ".join(rest[code])))): code for code in rest}


def _facts(branch: Branch) -> list[str]:
    varied, first = branch.curve.varied, point_of("", branch, 0)
    facts = [f"in {', '.join(varied)}"]
    facts += [first.orbit.lattice.describe()] if first.orbit is not None else []
    fixed = ((n, v) for n, v in branch.problem.params.items() if n not in varied)
    return facts + [f"{name} = {value:.6g}" for name, value in fixed]


def profile(orbit: Orbit) -> Profile:
    """The sites around the first that impacts, all of a small lattice."""
    size, middle = orbit.lattice.sites, orbit.section.hit[0]
    near = np.arange(middle - REACH, middle + REACH + 1)
    if size is not None and (size <= near.size or not isinstance(orbit.lattice, Ring)):
        near = np.arange(min(size, 4 * REACH + 1))
    times = _moments(orbit)
    u = orbit.displacement(near[:, None], times)
    first = float(orbit.times[0])
    walls = np.array([orbit.walls.at(n if size is None else n % size) for n in near.tolist()])
    walls[~np.isfinite(walls)] = math.nan
    at = orbit.displacement(near, first)
    return Profile(near, first, at, u.min(axis=1), u.max(axis=1), walls)


def _moments(orbit: Orbit) -> Array:
    """Times of a period, its impacts among them: there sites turn round sharply."""
    hits = [hit.time % orbit.period for hit in orbit.hits]
    return np.sort(np.concatenate([np.linspace(0.0, orbit.period, MOMENTS), hits]))


def sites_wanted(orbit: Orbit, sites: tuple[int, ...]) -> ShownMotion:
    """The sites that there are among those wanted."""
    size = orbit.lattice.sites
    shown = [n for n in sites if size is None or -size <= n < size] or [orbit.section.hit[0]]
    times = _moments(orbit)
    u = orbit.displacement(np.array(shown)[:, None], times)
    real = {n if size is None else n % size: n for n in shown}
    hits = tuple(
        (
            real[hit.site],
            (hit.time % orbit.period) / math.tau,
            orbit.walls.at(hit.site)[hit.wall > 0],
        )
        for hit in orbit.hits
        if hit.site in real
    )
    walls = {wall for n in real for wall in orbit.walls.at(n) if math.isfinite(wall)}
    return ShownMotion(
        times / math.tau, dict(zip(shown, u, strict=True)), hits, tuple(sorted(walls))
    )


def multipliers_shown(orbit: Orbit, ring: int) -> Multipliers:
    """On its own lattice if that is finite, otherwise on a ring of so many sites."""
    size, half = orbit.lattice.sites, orbit.symmetric
    finite = orbit if size is not None else map_on_ring(orbit, ring)
    lattice = f"ring of {ring}" if size is None else orbit.lattice.describe()
    about = f"over {'half a' if half else 'a'} period, {lattice}"
    mu, waves, alone = with_band(finite, None, half)
    return Multipliers(mu, alone, waves, about)


@lru_cache(maxsize=1)
def map_on_ring(orbit: Orbit, ring: int) -> Orbit:
    """The same there, once: its multipliers are drawn and judged."""
    return orbit.on(Ring(ring))


def verdict_in_words(orbit: Orbit) -> str:
    """Whether the lattice moves so, and whether it stays at it, in half a line."""
    margins = orbit.admissibility()
    if not margins.ok and margins.margin < -1e-9:
        return "not admissible: it passes a wall"
    words = {True: "stable", False: "unstable", None: "of unknown stability"}
    stable = _sentence(lambda: words[orbit.stability().stable])
    return stable if margins.ok else f"{stable}, at the edge of what is admissible"


def verdicts(orbit: Orbit, ring: int) -> Iterator[tuple[str, str]]:
    """What is said of it: a heading and a sentence each."""
    margins = orbit.admissibility()
    yield "admissible" if margins.ok else "not admissible", margins.reason
    if not margins.ok and margins.margin < -1e-9:
        yield "stability", "nothing is said of it: the lattice has no such motion"
        return
    yield "own lattice", _sentence(lambda: orbit.stability().describe())
    if orbit.lattice.sites is None:
        yield f"ring of {ring}", _sentence(lambda: map_on_ring(orbit, ring).stability().describe())
        if orbit.symmetric and orbit.section.count == 1:
            yield "over-reflection", _sentence(lambda: _reflection(orbit))


def _reflection(orbit: Orbit) -> str:
    waves = orbit.stability().over_reflection
    if not waves.over_reflecting:
        return "waves come back no larger than they were: no ring of any size is unstable by them"
    return (
        f"waves come back up to {math.exp(waves.gain):.6g} times as large (at the angle "
        f"{waves.nu:.6g} pi); on long rings |mu| = 1 + {waves.growth:.6g}/N over half a period"
    )


def _sentence(ask: Callable[[], str]) -> str:
    try:
        return ask()
    except BadInput as error:
        return f"not known: {error}"
    except ContbreatherError as error:
        return str(error)
