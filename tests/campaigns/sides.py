"""Special points of branches and arms on random lattices, confirmed on both sides by simulation.

python -m tests.campaigns.sides [lattices=10] [gamma=0.03]

A little before and behind each PF, PD and NS the multipliers of the simulated period, by
differences, must differ in how many are outside the circle (NS: beyond the threshold); the orbit
before a GR must come back under simulation, the one behind it must not.
"""

from __future__ import annotations

import collections
import sys

import numpy as np

import contbreather as cb
from contbreather.stability.verdict import THRESHOLD
from tests.orbits.test_lattices import random_orbit

LATTICES = int(sys.argv[1]) if len(sys.argv) > 1 else 10
GAMMA = float(sys.argv[2]) if len(sys.argv) > 2 else 0.03
WITHIN = {"a": (0.1, 1.5), "gamma": (0.0, 0.12), "k": (0.4, 0.99)}
BESIDE = 3e-4
OUTSIDE = {"PF": 1.0 + 2e-5, "PD": 1.0 + 2e-5, "NS": THRESHOLD}


def period(orbit, x, t0):
    """State after a simulated period, and the number of impacts in it."""
    u, v = np.split(x, 2)
    on = orbit.conditions
    named = {name: getattr(on, name) for name in ("a", "gamma", "k", "damping", "spring")}
    run = cb.simulate((u, v), lattice=on.lattice, forcing=on.forcing, periods=1, t0=t0, **named)
    return np.concatenate(run.final), len(run.impacts)


def count_outside(orbit, t0, radius, h=1e-6):
    x = np.concatenate(orbit.state(t=t0))
    columns = [
        (period(orbit, x + h * e, t0)[0] - period(orbit, x - h * e, t0)[0]) / (2 * h)
        for e in np.eye(x.size)
    ]
    return int(np.sum(abs(np.linalg.eigvals(np.array(columns).T)) > radius))


def comes_back(orbit, t0):
    x = np.concatenate(orbit.state(t=t0))
    try:
        after, impacts = period(orbit, x, t0)
    except cb.BadInput:  # it begins behind a wall
        return False
    return impacts == len(orbit.hits) and bool(abs(after - x).max() < 1e-9)


def confirmed(point, free):
    sides = []
    for towards, value in (("down", point[free] - BESIDE), ("up", point[free] + BESIDE)):
        window = {free: tuple(sorted((point[free], value)))}
        walk = cb.trace(point, free, within=window, towards=towards, events=(), inadmissible=True)
        sides.append(walk[-1].solution)
    t0 = float(point.solution.times.min()) - 0.05
    if point.kind == "GR":
        return comes_back(sides[0], t0) != comes_back(sides[1], t0)
    before, behind = (count_outside(side, t0, OUTSIDE[point.kind]) for side in sides)
    return before != behind


def main():
    counts, refuted = collections.Counter(), []
    for seed in range(LATTICES):
        start = random_orbit(seed)
        if not start.admissibility().ok:
            continue
        start = cb.trace(start, "gamma", within={"gamma": (GAMMA, 0.04)}, towards="down", events=())
        for free, window in WITHIN.items():
            branch = cb.trace(start[-1], free, within={free: window}, towards="both")
            forks = [point for point in branch.special if point.kind == "PF"]
            arms = [cb.switch(fork)[0] for fork in forks[:2]]
            for point in (point for walk in (branch, *arms) for point in walk.special):
                if point.kind in (*OUTSIDE, "GR"):
                    counts[point.kind] += 1
                    if not confirmed(point, free):
                        refuted.append((seed, free, point))
        print(f"lattice {seed}: {dict(counts)}, refuted {len(refuted)}", flush=True)
    for seed, free, point in refuted:
        print(f"lattice {seed}, branch in {free}: {point}")


if __name__ == "__main__":
    main()
