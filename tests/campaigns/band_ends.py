"""Stability at the ends of the band: each at it, and 1e-16 to 1e-3 beside it on both sides.

    python -m tests.campaigns.band_ends [what=orbits] [sets=2000] [seed=0]

Of `orbits`: random impacts of one or several sites over one or two forcing periods, where the band
of the whole period begins, reaches -1 (n^2 gamma = 1/16) or +1 again (1/4). Of `halves`: the half
map with and without springs, where its band begins, reaches -1, or leaves +1 with the spring; k = 0
and k = 1 among them. An answer is asked of every question there is: no exception, warning or NaN.
It must be that of two other roads: the turning of a determinant summed over the modes of a long
ring, on a circle next to that of modulus 1 and all around, and the same answer beside it.
"""

from __future__ import annotations

import collections
import math
import sys
import time
import traceback
import warnings

import numpy as np

from contbreather.lattice import InfiniteChain
from contbreather.stability import ns_points
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.one_impact import HalfMap, window
from contbreather.stability.saltation import saltation
from contbreather.stability.verdict import verdict
from tests.stability.by_hand import even_half_map
from tests.stability.half import over_reflection, over_reflects

DEPTH = 0.004  # of the other circle: radius 1.025
MODES = 2500
LOOKED = 8  # every so many sets by modes


def beside(rng):
    """Nothing, or 1e-16 to 1e-3, on either side."""
    return float(rng.choice([0.0, *(s * 10.0 ** rng.uniform(-16, -3) for s in (1, -1, 1, -1))]))


def drawn_k(rng):
    tiny = 10.0 ** rng.uniform(-16, -2)
    return float(rng.choice([0.0, 1.0, tiny, 1.0 - tiny, *rng.uniform(0, 1, 4)]))


# --- orbits -----------------------------------------------------------------------------------


def drawn_orbit(rng):
    n = int(rng.integers(1, 3))
    scaled = rng.choice([0.0, 0.0625, 0.0625, 0.0625, 0.25])
    off = beside(rng)
    scaled = float(scaled + (abs(off) if scaled == 0.0 else -abs(off) if scaled == 0.25 else off))
    gamma = min(max(scaled, 0.0), np.nextafter(0.25, 0)) / n**2
    m = int(rng.integers(1, 5))
    times = np.sort(rng.uniform(0, 2 * np.pi * n, m))
    sites = rng.integers(0, rng.choice([1, 2, 4, 30]), m)
    if rng.random() < 0.2 and len(set(sites.tolist())) == m:  # at one time
        times[:] = times[0]
    size = rng.choice([0.3, 1.0, 5.0])
    kicks = [
        (int(i), float(t), float(b))
        for i, t, b in zip(sites, times, size * rng.normal(size=m), strict=True)
    ]
    return gamma, drawn_k(rng), kicks, n


def by_modes(map, kappa):
    """D as a determinant of means over modes of a long ring: ``1 - X (S - 1)``, in plain time."""
    theta = 2 * np.pi * (np.arange(MODES) + 0.5) / MODES
    w = 2 * math.sqrt(map.gamma) * np.abs(np.sin(theta / 2))
    T, mu = map.period, np.exp(2j * np.pi * kappa)[:, None]
    slope = 1 - 2 * np.cos(w * T) / mu + mu**-2

    def flight(t):
        return np.array(
            [[np.cos(w * t), t * np.sinc(w * t / np.pi)], [-w * np.sin(w * t), np.cos(w * t)]]
        )

    m = len(map.kicks)
    matrix = np.zeros((kappa.size, 2 * m, 2 * m), dtype=complex)
    for i, to in enumerate(map.kicks):
        for j, of in enumerate(map.kicks):
            late = to.time - of.time if i > j else to.time - of.time + T
            share = np.cos((to.site - of.site) * theta) / slope / MODES
            # 1 + Q/mu + ... = (1 - Q^-1/mu)/det(1 - Q/mu)
            X = np.einsum("abw,kw->kab", flight(late), share)
            X = X - np.einsum("abw,kw->kab", flight(late - T), share) / mu[..., None]
            X = X if i > j else X / mu[..., None]
            jump = saltation(map.k, of.b) - np.eye(2)
            matrix[:, 2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = -X @ jump
    return np.linalg.det(matrix + np.eye(2 * m))


def turned(map):
    """Zeros of D farther out than that circle, by modes; None where samples are too few to tell."""
    half = 0.25 * (1 - np.cos(np.pi * np.linspace(0, 1, 241)))
    ends = [map.edge, 1 - map.edge]
    near = [e + s * DEPTH * np.linspace(0, 3, 16) for e in ends for s in (1, -1)]
    x = np.unique(np.clip(np.concatenate([half, *near]), 0, 0.5))
    values = by_modes(map, x - 1j * DEPTH)
    turns = np.angle(values[1:] / values[:-1])
    if np.abs(turns).max() > 1.5:
        return None
    return round(-float(turns.sum()) / math.pi)


def ask_orbit(rng, look):
    gamma, k, kicks, n = drawn_orbit(rng)
    map = OrbitMap(gamma, k, kicks, n)
    count, mu = map.count(), map.unstable_multipliers()
    numbers = [map.crosses(-1.0), map.approach(), *map.pairs(), count.distance, count.nu]
    if gamma > 0.0:
        numbers.append(map.nearest())
        numbers += [map.on_circle(x).real for x in (2 * map.edge % 1.0 or 0.3, 0.5, 1.0)]
    if len({kick[0] for kick in kicks}) == 1:
        numbers.append(map.crosses(1.0))
    assert str(verdict(map))
    told = {"uncertain"} if not count.certain else set()
    if not np.all(np.isfinite(numbers)) or not np.all(np.isfinite(mu)):
        return {"nan"}
    if count.certain and mu.size != count.count:
        told.add("other number of multipliers")
    if gamma > 0.0 and look and count.certain:
        far = turned(map)
        known = np.abs(np.log(np.abs(mu)) / (2 * np.pi) - DEPTH).min(initial=1.0) > 2e-4
        if far is not None and known:
            told.add("by modes")
            if far != np.count_nonzero(np.abs(mu) > math.exp(2 * math.pi * DEPTH)):
                told.add("not that by modes")
    # the same next to the end itself
    for end in (0.0625, 0.25):
        off = n * n * gamma - end
        if gamma > 0.0 and abs(off) < 1e-9 and count.certain and count.distance > 1e-3:
            far = OrbitMap((end - 2e-9) / n**2, k, kicks, n).count()
            told.add("beside")
            if far.count != count.count and far.certain and far.distance > 1e-3:
                told.add("not that beside")
    return told


# --- half maps --------------------------------------------------------------------------------


def drawn_half(rng):
    spring = float(
        rng.choice([0.0, 0.0, 10.0 ** rng.uniform(-16, -3), rng.uniform(0, 0.9), 1 - 1e-3])
    )
    room = 0.25 * (1.0 - spring)
    end = rng.choice([0.0, 0.0625, room, room])
    off = beside(rng)
    gamma = abs(off) if end == 0.0 else end - abs(off) if end == room else end + off
    gamma = float(min(max(gamma, 0.0), room))
    while spring + 4 * gamma >= 1.0:
        gamma = float(np.nextafter(gamma, 0.0))
    return gamma, drawn_k(rng), float(rng.choice([0.3, 1.0, 5.0]) * rng.normal()), spring


def ask_half(rng, look):
    gamma, k, b, spring = drawn_half(rng)
    chain = InfiniteChain(spring)
    map = HalfMap(gamma, k, b, chain)
    count, mu = map.count(), map.unstable_multipliers()
    waves = over_reflection(gamma, k, b, spring)
    numbers = [map.crosses(1.0), map.crosses(-1.0), *map.pairs(), *waves.__dict__.values()]
    numbers += [count.distance, count.nu, *window(gamma, k, spring)]
    for point in ns_points(gamma, k, spring):
        numbers += [*point]
    told = {"uncertain"} if not count.certain else set()
    if not np.all(np.isfinite(numbers)) or not np.all(np.isfinite(mu)):
        return {"nan"}
    assert str(verdict(map))
    over_reflects(gamma, k, b, spring)
    if not 0 <= count.count <= (4 if spring else 2):
        told.add("no such count")
    if count.certain and mu.size != count.count:
        told.add("other number of multipliers")
    if count.certain and gamma > 0.0 and k < 1.0:
        turning = OrbitMap(gamma, k, [(0, 0.0, b)], 0.5, spring).count()
        told.add("by the turning")
        if turning.certain and turning.count != count.count:
            told.add("not that of the turning")
    if spring == 0.0 and gamma > 0.0 and count.certain:
        whole = OrbitMap(gamma, k, [(0, 0.3, b), (0, 0.3 + math.pi, b)])
        found = whole.count()
        told.add("by the whole period")
        if found.count != count.count and found.certain:
            told.add("not that of the whole period")
    if look and count.certain and gamma > 0.0:
        M = even_half_map(240, spring, gamma, k, b)
        ring = np.linalg.eigvals(M)
        told.add("by modes")
        if np.count_nonzero(np.abs(ring) > 1.5) != np.count_nonzero(np.abs(mu) > 1.5):
            told.add("not that by modes")
    return told


BAD = ("raised", "warned", "nan", "not", "no such", "other")


def main(what="orbits", sets=2000, seed=0):
    ask = {"orbits": ask_orbit, "halves": ask_half}[what]
    drawn = {"orbits": drawn_orbit, "halves": drawn_half}[what]
    tally, slow, began = collections.Counter(), 0.0, time.process_time()
    for i in range(sets):
        start = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                told = ask(np.random.default_rng((seed, i)), i % LOOKED == 0)
        except Warning as error:
            told = {f"warned: {error}"}
        except Exception as error:  # noqa: BLE001 (what escapes is what is counted)
            told = {f"raised {type(error).__name__}: {str(error)[:60]}"}
            if "-v" in sys.argv:
                traceback.print_exc()
        slow = max(slow, time.process_time() - start)
        tally.update(told)
        if any(word.startswith(BAD) for word in told):
            print(i, sorted(told), drawn(np.random.default_rng((seed, i))), flush=True)
    seconds = time.process_time() - began
    print(f"{what}: {sets} sets, {seconds:.0f} s, the slowest {slow:.2f} s", dict(tally))


if __name__ == "__main__":
    given = [x for x in sys.argv[1:] if not x.startswith("-")]
    main(*given[:1], *(int(x) for x in given[1:]))
