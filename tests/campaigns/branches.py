"""Random branches of symmetric breathers against a scan point by point, from three starts and with
two step sizes.

    python -m tests.campaigns.branches [branches=50] [seed=0] [first=0]
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from itertools import pairwise

import numpy as np

import contbreather as cb
from contbreather.errors import ContbreatherError

SMALL = cb.Steps(largest=0.01, most=20000)
WINDOWS = {"a": (1e-3, 1.5), "gamma": (0.0, 0.2499), "k": (0.5, 0.999)}


def drawn(rng):
    """A start, the free parameter, and its window."""
    while True:
        k = float(rng.choice([rng.uniform(0.5, 0.999), 1 - 10 ** rng.uniform(-3, -0.3)]))
        a = float(rng.choice([rng.uniform(0.02, 1.0), 10 ** rng.uniform(-2, 0)]))
        gamma = float(rng.choice([rng.uniform(0, 0.24), 10 ** rng.uniform(-4, -0.7)]))
        free = str(rng.choice(["a", "gamma", "k"]))
        forcing = None
        if rng.random() < 0.4:
            forcing = cb.Fourier(
                cos={1: -1.0, 3: 0.6 * rng.normal(), 5: 0.3 * rng.normal()},
                sin={3: 0.6 * rng.normal()},
            )
        if not WINDOWS[free][0] < {"a": a, "gamma": gamma, "k": k}[free] < WINDOWS[free][1]:
            continue
        try:
            found = cb.orbits.symmetric_roots(a, gamma, k, forcing=forcing)
        except ContbreatherError:
            continue
        good = [b for b in found if b.admissibility().margin > 1e-3]
        if good:
            return good[int(rng.integers(len(good)))], free


def walked(start, free, events, steps=None):
    return cb.trace(start, free, within={free: WINDOWS[free]}, events=events, steps=steps)


def ends_only():
    """What ends a branch, whatever its name."""
    return [event for event in cb.symmetric(0.5, 0.04, 0.8).problem.events if event.ends]


def scan(start, free):
    """Changes of sign and of counts along a curve of small steps: (kind, value, p) of each."""
    branch = walked(start, free, ends_only(), SMALL)
    rows = []
    for point in branch:
        b = point.solution
        broken = b.b > 0.5 * (1 + b.k) ** 2 * b.lattice.psi(b.gamma)
        pairs = b.map.count().pairs
        rows.append({"LP": point.tangent[-1] > 0, "PF": broken, "NS": pairs, "z": point.z})
    return branch, [
        (kind, one["z"], two["z"])
        for one, two in pairwise(rows)
        for kind in ("LP", "PF", "NS")
        if one[kind] != two[kind]
    ]


def compare(found, branch, wanted, label):
    """Sentences on what differs between special points and what a scan saw."""
    said = []
    got = [p for p in branch.special if p.kind in ("LP", "PF", "NS")]
    used = set()
    for kind, z0, z1 in found:
        near = [
            i
            for i, p in enumerate(got)
            if i not in used
            and p.kind == kind
            and np.linalg.norm(p.z - z0) + np.linalg.norm(p.z - z1)
            < 1.1 * np.linalg.norm(z1 - z0) + 1e-7
        ]
        if near:
            used.add(near[0])
        else:
            said.append(f"{label}: {kind} missed at {z0}")
    said += [f"{label}: {p!r} not in the scan" for i, p in enumerate(got) if i not in used]
    ends = {p.kind for p in (branch[0], branch[-1])}
    if ends != wanted:
        said.append(f"{label}: ends {ends}, the scan's {wanted}")
    said += [f"{label}: doubtful {p!r}" for p in branch.doubtful]
    return said


def check(rng, starts=3):
    start, free = drawn(rng)
    fine, found = scan(start, free)
    wanted = {p.kind for p in (fine[0], fine[-1])}
    said, specials = [], Counter(kind for kind, *_ in found)
    inner = [p for p in fine if not p.kind]
    for j in range(starts):
        point = inner[int(rng.integers(len(inner)))].solution if j and inner else start
        for name, steps in (("default", None), ("0.01", SMALL)):
            label = f"start {j}, steps {name}"
            try:
                branch = walked(point, free, None, steps)
            except ContbreatherError as error:
                said.append(f"{label}: {error}")
                continue
            said += compare(found, branch, wanted, label)
    return start, free, said, specials


def main(branches=50, seed=0, first=0):
    tally, began = Counter(), time.time()
    for i in range(first, first + branches):
        start, free, said, specials = check(np.random.default_rng([seed, i]))
        tally += specials
        tally["agree" if not said else "disagree"] += 1
        if i % 20 == 19:
            print(f"... {i + 1}: {dict(tally)}", flush=True)
        if said:
            print(i, free, start, flush=True)
            for line in said:
                print("   ", line, flush=True)
    print(dict(tally), f"{time.time() - began:.0f} s")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
