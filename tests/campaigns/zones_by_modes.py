"""Zone diagrams of rings without losses by exact modes, against those of the closed form.

    python tests/campaigns/zones_by_modes.py [count=6] [seed=0]

Windows are random. Both must have the same curves, with the same ends to 1e-8, and the regions the
same verdicts.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import contbreather as cb

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 6
SEED = int(sys.argv[2]) if len(sys.argv) > 2 else 0


def ends(zones: cb.orbits.Zones, kind: str) -> np.ndarray:
    """Where curves of a kind begin and end, in order."""
    places = [[branch[name][i] for name in zones.pair] for branch in zones[kind] for i in (0, -1)]
    return np.array(sorted(places)).reshape(-1, 2)


def main() -> None:
    rng, wrong = np.random.default_rng(SEED), 0
    for number in range(COUNT):
        low = rng.uniform(0.0, 0.08)
        shared = {"k": float(rng.uniform(0.4, 0.9)), "lattice": cb.Ring(int(rng.integers(1, 7)))}
        shared |= {"within": {"gamma": (low, low + 0.01), "a": (0.1, 1.0)}, "progress": False}
        begun = time.monotonic()
        closed, modal = cb.zones(**shared), cb.zones(**shared, spring=0.0)
        found = [
            kind
            for kind in ("LP", "GR", "PF")
            if len(closed[kind]) != len(modal[kind])
            or not np.allclose(ends(closed, kind), ends(modal, kind), rtol=0.0, atol=1e-8)
        ]
        verdicts = [sorted({one.verdict for one in zones.regions}) for zones in (closed, modal)]
        if verdicts[0] != verdicts[1]:
            found.append(f"verdicts {verdicts}")
        wrong += bool(found)
        print(f"{number}: {modal}, {time.monotonic() - begun:.0f} s {found or 'alike'}", flush=True)
    print(f"{wrong} of {COUNT} differ")


if __name__ == "__main__":
    main()
