"""Zone diagrams of random forcings with several harmonics, each point of a GR curve by brute force.

    python tests/campaigns/zones_forcings.py [first=0] [count=20] [seed=1]

Heights are taken from the profiles `displacement`, over times and sites, not from the library's own
margins: a point is behind a wall if another site, or site 0 between its impacts, is beyond
1 + TOLERANCE.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

import contbreather as cb

TOLERANCE = 3e-8  # heights above it are looked at again on a fine grid
SITES = np.arange(1, 11)


def forcing_of(rng):
    orders = [(3,), (5,), (3, 5)][rng.integers(3)]
    size = (0.5, 3.0, 6.0)[rng.integers(3)]
    cos, sin = {1: -1.0}, {}
    for m in orders:
        which = rng.integers(3)
        if which != 1:
            cos[m] = round(float(rng.normal(0, size)), 2)
        if which != 0:
            sin[m] = round(float(rng.normal(0, size)), 2)
    return cb.Fourier(cos=cos, sin=sin)


def crests(u):
    """Largest |u| of each row, by a parabola through the highest points of the grid."""
    u = np.abs(u)
    top = np.clip(u.argmax(axis=1), 1, u.shape[1] - 2)
    row = np.arange(len(u))
    x, y, z = u[row, top - 1], u[row, top], u[row, top + 1]
    bend = 2 * y - x - z
    return np.where(
        (bend > 0) & (y >= x) & (y >= z),
        y + (z - x) ** 2 / (8 * np.where(bend > 0, bend, 1)),
        u.max(axis=1),
    )


def excess(b, times=640):
    """How far any site is beyond its walls where it must not be."""
    s = (
        math.pi * (np.arange(-2, times + 2) + 0.5) / times
    )  # a little over, so that no crest is at an end
    beyond = crests(b.displacement(SITES[:, None], b.phi + s[None, :])) - 1.0
    s = math.pi * (np.arange(1, times)) / times
    centre = np.abs(b.displacement(np.zeros(s.size, int), b.phi + s)).max() - 1.0
    return max(float(beyond.max()), float(centre))


def plain(b, times=30000):
    s = math.pi * np.arange(1, times) / times
    others = np.abs(b.displacement(SITES[:, None], b.phi + s)).max()
    return float(max(others, np.abs(b.displacement(np.zeros(s.size, int), b.phi + s)).max())) - 1.0


def one(i, seed):
    rng = np.random.default_rng((seed, i))
    f = forcing_of(rng)
    k = round(float(rng.uniform(0.02, 0.995)), 3)
    t = time.process_time()
    try:
        z = cb.zones(k=k, forcing=f, progress=False)
    except Exception as error:  # noqa: BLE001 (what escapes is what is counted)
        print(i, "RAISED", f, k, type(error).__name__, str(error)[:150], flush=True)
        return {"raised": 1}
    dt = time.process_time() - t
    worst, where, n = -9.0, None, 0
    for line in z["GR"]:
        for point in line:
            n += 1
            e = excess(point.solution)
            if e > max(worst, 3e-8):  # the parabola may be too high: look again on a fine grid
                e = plain(point.solution)
            if e > worst:
                worst, where = e, point
    broken = [
        (kind, b.stop.name, b.began and b.began.name, len(b), b.reason, b.began_reason, b[0], b[-1])
        for kind, b in z
        if b.stop.failed or (b.began and b.began.failed) or len(b) < 3
    ]
    doubtful = [p for _, b in z for p in b.doubtful]
    flag = "" if worst < TOLERANCE else f"BEHIND {worst:.2e} at {where}"
    print(
        i,
        f,
        f"k={k} {dt:.1f}s GR points {n} worst {worst:.1e}",
        {kind: len(z[kind]) for kind in ("LP", "GR", "PF", "NS")},
        flag,
        flush=True,
    )
    for b in broken:
        print("   BROKEN", b, flush=True)
    for p in doubtful:
        print("   DOUBTFUL", p, flush=True)
    return {
        "behind": int(bool(flag)),
        "seconds": dt,
        "broken": len(broken),
        "doubtful": len(doubtful),
        "points": n,
        "worst": worst,
    }


if __name__ == "__main__":
    first, count, seed = [int(x) for x in (sys.argv[1:] + ["0", "20", "1"][len(sys.argv) - 1 :])]
    rows = [one(i, seed) for i in range(first, first + count)]

    def get(name):
        return [r.get(name, 0) for r in rows]

    print(
        f"{count} forcings: raised {sum(get('raised'))}, behind a wall {sum(get('behind'))}, "
        f"broken off {sum(get('broken'))} curves, "
        f"doubtful {sum(get('doubtful'))}, GR points {sum(get('points'))}, "
        f"worst excess {max(r.get('worst', -9) for r in rows):.1e}, "
        f"seconds median {np.median(get('seconds')):.1f}, longest {max(get('seconds')):.1f}"
    )
