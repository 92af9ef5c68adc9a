"""Random zone diagrams: their GR curves by brute force, and what their regions say of existence.

    python -m tests.campaigns.existence [first=0] [count=26] [seed=1] [places=39]

Diagrams of chains and rings, under one harmonic or several, with any of k, gamma, a fixed, of the
upper breathers or of both families. On no point of a GR curve may another site, or site 0 between
its impacts, be beyond its walls, by the profiles `displacement`, over times and sites, not by the
library's own margins. At each random place the roots of (11) are judged one by one:
`admissibility`, and the family by the sign of the determinant of the closure. A region must say
whether an admissible one is there, of the families the diagram is of, and whether one is stable.
"""

from __future__ import annotations

import collections
import math
import sys
import time
import traceback
from typing import Any

import numpy as np
import shapely

import contbreather as cb
from contbreather.orbits import Closure, symmetric_roots

BESIDE = 2e-3  # of the diagram's sides: so close to a curve its chords decide, not the curve
TOLERANCE = 3e-8  # heights above it are looked at again on a fine grid
WORDS = ("places", "no region", "disagree", "mixed", "misjudged", "lower unsaid", "lower said")
WORDS += ("raised", "broken", "doubtful", "behind")


def drawn(rng: np.random.Generator) -> tuple[dict[str, Any], cb.orbits.Zones]:
    """A random diagram, and how it was asked for."""
    cos, sin = {1: -1.0}, {}
    for m in ((), (3,), (5,), (3, 5))[rng.integers(4)]:
        size = (1e-9, 0.5, 3.0, 6.0)[rng.integers(4)]
        cos[m], sin[m] = (round(float(x), 10) for x in rng.normal(0, size, 2))
    forcing = cb.Harmonic() if len(cos) == 1 else cb.Fourier(cos=cos, sin=sin)
    fixed = ("k", "k", "k", "gamma", "a")[rng.integers(5)]
    low, high = {"k": (0.05, 0.99), "gamma": (0.01, 0.24), "a": (0.05, 0.95)}[fixed]
    value = round(float(rng.uniform(low, high)), 3)
    if fixed == "a":
        value = round(value / forcing.peak(), 4)
    lattice = cb.Ring(int(rng.integers(3, 60))) if rng.random() < 0.5 else cb.InfiniteChain()
    asked = {"forcing": forcing, "lattice": lattice, "past_folds": bool(rng.random() < 0.5)}
    return asked | {fixed: value}, cb.zones(**asked, **{fixed: value}, progress=False)


def there(values: dict[str, float], asked: dict[str, Any]) -> dict[str, list[Any]]:
    """All admissible breathers at a place, by family."""
    found: dict[str, list[Any]] = {"upper": [], "lower": []}
    forcing, lattice = asked["forcing"], asked["lattice"]
    try:
        roots = symmetric_roots(**values, forcing=forcing, lattice=lattice)
    except cb.NoSolution:
        return found
    for one in roots:
        if one.admissibility().ok:
            turn = np.linalg.det(Closure(forcing, lattice).jacobian([one.p, one.phi], values))
            found["upper" if turn > 0.0 else "lower"].append(one)
    return found


def judged(
    region: cb.orbits.Region, breathers: dict[str, list[Any]], zones: cb.orbits.Zones
) -> list[str]:
    """What is wrong with what a region says of a place in it."""
    own = [one for family in zones.families for one in breathers[family]]
    said = {count is not None for count in region.counts}
    if len(said) > 1:
        return ["mixed"]
    if said == {True}:
        ring = zones.threshold if own and own[0].lattice.sites is not None else None
        stable = any(one.stability(threshold=ring).stable for one in own)
        wrong = region.verdict != ("S" if stable else "US")
        return ["disagree"] if not own else ["misjudged"] if wrong else []
    if own:
        return ["disagree"]
    if breathers["lower"]:
        return ["lower said" if any(region.lower) else "lower unsaid"]
    return []


def heights(b: cb.Orbit, times: int) -> tuple[np.ndarray, float]:
    """|u| of ten idle sites at many times, and the largest of site 0 between its impacts."""
    n = np.arange(1, 11)
    n = n[n % (b.lattice.sites or 11) != 0]
    # a little over half a period, so that no crest is at an end
    s = math.pi * (np.arange(-2, times + 2) + 0.5) / times
    own = np.abs(b.displacement(0, b.phi + math.pi * np.arange(1, times) / times)).max()
    return np.abs(b.displacement(n[:, None], b.phi + s)), float(own)


def plain(b: cb.Orbit, times: int = 30000) -> float:
    """How far any site is beyond its walls where it must not be."""
    idle, own = heights(b, times)
    return max(float(idle.max(initial=0.0)), own) - 1.0


def excess(b: cb.Orbit) -> float:
    """The same, of each site by a parabola through the highest points of a coarse grid."""
    u, own = heights(b, 640)
    row, top = np.arange(len(u)), np.clip(u.argmax(axis=1), 1, u.shape[1] - 2)
    x, y, z = u[row, top - 1], u[row, top], u[row, top + 1]
    bend = 2 * y - x - z
    crest = (bend > 0) & (y >= x) & (y >= z)
    tops = np.where(crest, y + (z - x) ** 2 / (8 * np.where(crest, bend, 1)), u.max(axis=1))
    return max(float(tops.max(initial=0.0)), own) - 1.0


def unsound(zones: cb.orbits.Zones) -> list[tuple[str, Any]]:
    """Curves that break off, what is doubtful on them, and points of GR behind another wall."""
    found: list[tuple[str, Any]] = []
    for kind, line in zones:
        began = line.began is not None and line.began.failed
        found += [("broken", line)] * (began or line.stop.failed or len(line) < 3)
        found += [("doubtful", point) for point in line.doubtful]
        for b in (point.solution for point in line if kind == "GR"):
            # the parabola may be too high: look again on a fine grid
            found += [("behind", b)] * (excess(b) > TOLERANCE and plain(b) > TOLERANCE)
    return found


def one(i: int, seed: int, places: int) -> collections.Counter[str]:
    """A diagram, and the places that are looked at in it."""
    rng = np.random.default_rng((seed, i))
    since = time.process_time()
    asked, zones = drawn(rng)
    took, box = time.process_time() - since, np.array(zones.box())
    low, size = box[:, 0], box[:, 1] - box[:, 0]
    shapes = [
        (shapely.Polygon((r.outline - low) / size, [(h - low) / size for h in r.holes]), r)
        for r in zones.regions
    ]
    rims = shapely.union_all([shape.exterior for shape, _ in shapes])
    told = unsound(zones)
    counts = collections.Counter(word for word, _ in told)
    wrong = [f"   {word.upper()} {what!r}" for word, what in told]
    while counts["places"] < places:
        unit = shapely.Point(rng.random(2))
        if unit.distance(rims) < BESIDE:
            continue
        counts["places"] += 1
        at = low + size * np.array([unit.x, unit.y])
        values = {zones.fixed[0]: zones.fixed[1], **dict(zip(zones.pair, at.tolist(), strict=True))}
        region = next((region for shape, region in shapes if shape.contains(unit)), None)
        found = there(values, asked)
        told = ["no region"] if region is None else judged(region, found, zones)
        counts.update(told)
        if told and told != ["lower said"]:
            admissible = {name: [b.p for b in own] for name, own in found.items() if own}
            wrong.append(f"   {told[0].upper()} {values}: {admissible}, {region!r}")
    print(i, asked, f"{took:.1f} s", dict(counts), *wrong, sep="\n   ", flush=True)
    return counts


def main(first: int = 0, count: int = 26, seed: int = 1, places: int = 39) -> None:
    totals: collections.Counter[str] = collections.Counter()
    for i in range(first, first + count):
        try:
            totals += one(i, seed, places)
        except Exception:  # noqa: BLE001 (what escapes is what is counted)
            totals["raised"] += 1
            print(i, "RAISED", traceback.format_exc(), flush=True)
    print(f"{count} diagrams:", ", ".join(f"{word} {totals[word]}" for word in WORDS))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
