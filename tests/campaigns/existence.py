"""What the regions of random zone diagrams say of existence, against all roots of (11) at a place.

    python tests/campaigns/existence.py [first=0] [count=26] [seed=1] [places=39]

Diagrams of chains and rings, under one harmonic or several, with any of k, gamma, a fixed, of the
upper breathers or of both families. At each random place the roots of (11) are judged one by one:
`admissibility`, and the family by the sign of the determinant of the closure. A region must say
whether an admissible one is there, of the families the diagram is of, and whether one is stable.
"""

from __future__ import annotations

import collections
import sys
import time
from typing import Any

import numpy as np
import shapely

import contbreather as cb
from contbreather.orbits import Closure, symmetric_roots

BESIDE = 2e-3  # of the diagram's sides: so close to a curve its chords decide, not the curve
WORDS = ("places", "no region", "disagree", "mixed", "misjudged", "lower unsaid", "lower said")


def drawn(rng: np.random.Generator) -> tuple[dict[str, Any], cb.orbits.Zones]:
    """A random diagram, and how it was asked for."""
    cos, sin = {1: -1.0}, {}
    for m in ((), (3,), (5,), (3, 5))[rng.integers(4)]:
        size = (1e-9, 0.5, 3.0)[rng.integers(3)]
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
    counts: collections.Counter[str] = collections.Counter()
    wrong = []
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


if __name__ == "__main__":
    first, count, seed, places = (
        int(x) for x in (sys.argv[1:] + ["0", "26", "1", "39"][len(sys.argv) - 1 :])
    )
    totals: collections.Counter[str] = collections.Counter()
    for i in range(first, first + count):
        totals += one(i, seed, places)
    print(f"{count} diagrams:", ", ".join(f"{word} {totals[word]}" for word in WORDS))
