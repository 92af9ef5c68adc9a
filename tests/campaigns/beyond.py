"""Random GR points of all kinds of orbits: what lies beyond each, flown by an own integrator.

    python -m tests.campaigns.beyond [points=100] [seed=0]

Each is switched at; what sets out is asked for the sites that hit, flown over a period with matrix
exponentials and its own search for impacts, and followed back to its vanishing impact, which must
be the same place.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from dataclasses import replace

import numpy as np

import contbreather as cb
from contbreather.errors import ContbreatherError
from tests.orbits.field import Field

ENDLESS = 41  # sites of a ring in place of the infinite chain: its tails are gone by then


def flown(orbit):
    """By how much half periods of the forcing miss where an orbit is after them, and its impacts
    as (site, wall), in order of time. A whole period grows rounding by multipliers of 1e5."""
    sites = orbit.lattice.sites
    lattice = orbit.lattice if sites else cb.Ring(ENDLESS)
    N, middle = lattice.sites, ENDLESS // 2
    named = np.arange(N) if sites else (np.arange(N) + middle) % N - middle
    chain = Field(lattice, replace(orbit.conditions, lattice=lattice))

    def at(t):
        u, v, _ = orbit.motion.states(named, t)
        return np.concatenate([u, v])

    hits, off, first = [], 0.0, float(orbit.times.min()) - 1e-3 * math.pi
    for half in first + math.pi * np.arange(2 * orbit.section.turns):
        end, its, _ = chain.run(at(half), half, half + math.pi)
        hits += [(int(named[site]), wall) for site, _, wall, _ in its]
        off = max(off, float(abs(end - at(half + math.pi)).max()))
    return off, hits


def drawn(rng):
    """An orbit of one of seven kinds, and which."""
    kind = str(rng.choice(["endless", "ring", "open", "grid", "damped", "arm", "several"]))
    gamma, k = float(rng.uniform(0.01, 0.12)), float(rng.uniform(0.2, 0.95))
    a, N = float(rng.uniform(0.3, 0.9)), int(rng.integers(3, 12))
    on = {"gamma": gamma, "k": k}
    loss = float(rng.uniform(0.005, 0.1))
    if kind == "several":
        sites = sorted(rng.choice(N, size=2, replace=False).tolist())
        return kind, cb.multibreather(sites, a=a, lattice=cb.Ring(N), damping=loss, **on)
    if kind == "arm":
        lattice = cb.Ring(N) if rng.random() < 0.5 else cb.InfiniteChain()
        branch = cb.trace(cb.symmetric(a, lattice=lattice, **on), "a", within={"a": (0.3, 1)})
        return kind, cb.switch(branch.first("PF"), within={"a": (0.3, 1)})[0][2].solution
    if kind in ("open", "grid"):
        lattice = cb.OpenChain(N) if kind == "open" else cb.Grid(3, int(rng.integers(2, 4)))
        on |= {"site": int(rng.integers(lattice.sites)), "damping": loss}
    else:
        lattice = cb.InfiniteChain() if kind == "endless" else cb.Ring(N)
        on |= {"damping": loss} if kind == "damped" else {}
    return kind, cb.symmetric(a, lattice=lattice, **on)


def beyond(orbit, free="a"):
    """What lies beyond the first GR of a branch: a word or a sentence, and what is wrong."""
    within = {free: {"a": (0.05, 1.5), "gamma": (0.0, 0.2)}[free]}
    ends = [p for p in cb.trace(orbit, free, within=within).special if p.kind == "GR"]
    if not ends:
        return None, ""
    end = ends[-1]
    try:
        (arm,) = cb.switch(end, within=within)
    except ContbreatherError as error:
        return str(error).partition("): ")[2] or str(error), ""
    if len(arm) < 3:
        return f"{arm[0]['beyond']}, a short one: {arm[-1].label}", ""
    # a branch that ends in its own mirror image has a branch point in its middle
    there = arm[len(arm) // 3]
    wrong = checked(there.solution)
    back = [p for p in cb.trace(there, free, within=within).special if p.kind == "VI"]
    off = min((abs(p[free] - end[free]) for p in back), default=math.inf)
    if off > 1e-11:
        wrong += f" the way back ends {off:.2g} off"
    return arm[0]["beyond"], wrong


def checked(orbit):
    """What its own integrator finds wrong with an orbit."""
    off, hits = flown(orbit)
    listed = Counter((hit.site, hit.wall) for hit in orbit.hits)
    wrong = "" if Counter(hits) == listed else f" flown, it hits {hits}, not {dict(listed)};"
    return wrong + ("" if off < 1e-10 else f" a period is {off:.2g} off;")


def run(points=100, seed=0):
    rng, found, wrong, n = np.random.default_rng(seed), Counter(), [], 0
    while n < points:
        try:
            kind, orbit = drawn(rng)
            what, why = beyond(orbit, str(rng.choice(["a", "a", "gamma"])))
        except ContbreatherError:
            continue  # no such orbit, no pitchfork
        if what is None:
            continue
        n += 1
        found[kind, what] += 1
        if why:
            wrong.append((kind, what, why, repr(orbit)))
            print("WRONG", *wrong[-1], flush=True)
    for (kind, what), count in sorted(found.items()):
        print(f"{count:4d}  {kind:8s} {what}")
    print(f"{len(wrong)} wrong of {points}")
    return found, wrong


if __name__ == "__main__":
    run(*map(int, sys.argv[1:]))
