"""contbreather on the problem of the peers, in a process of its own. Prints one line of JSON."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import closure

import contbreather as cb


def main() -> None:
    step = closure.branch_length(closure.GAMMA, closure.K) / closure.POINTS
    fixed = cb.Steps(first=step, largest=step, most=2 * closure.POINTS)
    start = cb.symmetric(a=1.0, gamma=closure.GAMMA, k=closure.K)
    window = {"a": (0.0, 1.0)}
    begin = time.perf_counter()
    branch = cb.trace(start, "a", within=window, towards="both", events=(), steps=fixed)
    branch_seconds = time.perf_counter() - begin
    lp = cb.trace(start, "a", within=window, towards="both", events=[cb.fold()]).first("LP")
    begin = time.perf_counter()
    curve = cb.boundary(
        lp,
        ("gamma", "a"),
        within={"gamma": (0.0, closure.GAMMA_END), "a": (0.0, 1.0)},
        towards="both",
        events=(),
        steps=cb.Steps(first=closure.FOLD_STEP, largest=closure.FOLD_STEP),
    )
    data = {
        "name": "contbreather",
        "branch_points": len(branch),
        "branch_seconds": branch_seconds,
        "fold": float(lp["a"]),
        "curve": list(zip(curve["a"].tolist(), curve["gamma"].tolist(), strict=True)),
        "curve_seconds": time.perf_counter() - begin,
    }
    print("RESULT " + json.dumps(data))


if __name__ == "__main__":
    main()
