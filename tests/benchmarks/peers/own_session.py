"""contbreather on the problem of the peers, in a process of its own. Prints one line of JSON."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import closure

import contbreather as cb


def timed(call: Callable[..., Any]) -> Callable[..., tuple[Any, float]]:
    def measured(*given: Any, **named: Any) -> tuple[Any, float]:
        begin = time.perf_counter()
        found = call(*given, **named)
        return found, time.perf_counter() - begin

    return measured


def main() -> None:
    step = closure.branch_length(closure.GAMMA, closure.K) / closure.POINTS
    fixed = cb.Steps(first=step, largest=step, most=2 * closure.POINTS)
    start = cb.symmetric(1.0, closure.GAMMA, closure.K).problem
    how: dict[str, Any] = {"within": {"a": (0.0, 1.0)}, "inadmissible": True}
    trace, boundary = timed(cb.trace), timed(cb.boundary)
    for _ in range(2):  # code is loaded at the first
        branch, branch_seconds = trace(start, "a", **how, events=(), steps=fixed)
    lp = cb.trace(start, "a", **how, events=[cb.fold()]).first("LP")
    how["within"]["gamma"] = (0.0, closure.GAMMA_END)
    steps = cb.Steps(first=closure.FOLD_STEP, largest=closure.FOLD_STEP)
    for _ in range(2):
        curve, curve_seconds = boundary(lp, ("gamma", "a"), **how, events=(), steps=steps)
    data = {
        "name": "contbreather, second call",
        "branch_points": len(branch),
        "branch_seconds": branch_seconds,
        "fold": float(lp["a"]),
        "curve": list(zip(curve["a"].tolist(), curve["gamma"].tolist(), strict=True)),
        "curve_seconds": curve_seconds,
    }
    print("RESULT " + json.dumps(data))


if __name__ == "__main__":
    main()
