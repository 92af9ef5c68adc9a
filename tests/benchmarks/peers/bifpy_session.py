"""bifpy (PyPI): AUTO-07p's engine called from Python. Run by the interpreter that has it.

Prints one line of JSON. `iads=0` and `iad=0`, which AUTO's own files allow for "never adapt", end
its process with an arithmetic exception, hence the large number.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import closure
import numpy as np
from bifpy import auto

NATIVE = "--native" in sys.argv[1:]  # equations traced by sympy and compiled by gfortran


def equations(state: Any, parameters: Any) -> list[Any]:
    a, gamma, k = parameters[0], parameters[1], parameters[2]
    tail = 0.0
    for coefficient in reversed(closure.CHI_SERIES):
        tail = tail * gamma + coefficient
    chi = 4 / np.pi / np.sqrt(1 - 4 * gamma) + tail
    q = (1 - k) / (1 + k)
    p, phi = state[0], state[1]
    return [p * chi + a * np.cos(phi) - 1, -a * np.sin(phi) - p * q]


def starting_point(state: Any, parameters: Any, _: float) -> None:
    state[0], state[1] = closure.start()
    parameters[0], parameters[1], parameters[2] = 1.0, closure.GAMMA, closure.K


def settings(step: float, **changed: Any) -> dict[str, Any]:
    fixed = {
        **{"ips": auto.IPS_ALGEBRAIC_SYSTEM, "ndim": 2, "npar": 3, "nmx": 4000, "npr": 10**6},
        **{"ntst": 5, "ncol": 4, "iad": 3, "ilp": 0, "isp": 0, "iads": 10**6, "jac": 0},
        **{"itmx": 8, "itnw": 7, "nwtn": 3, "epsl": 1e-9, "epsu": 1e-9, "epss": 1e-9},
        **{"ds": step, "dsmin": 1e-8, "dsmax": abs(step)},
        **{"rl0": -1e300, "rl1": 1e300, "a0": -1e300, "a1": 1e300},
    }
    return {**fixed, **changed}


def main() -> None:
    step = closure.branch_length(closure.GAMMA, closure.K) / closure.POINTS
    how: dict[str, Any] = {"transpile": NATIVE}
    to_one = {"icu": [1], "uzstop": {1: 1.0000001}}
    begin = time.perf_counter()
    branch = auto.run(equations, starting_point, settings(-step), **to_one, **how).branches[0]
    branch_seconds = time.perf_counter() - begin
    coarse = settings(-0.01, ilp=1, iads=1, dsmin=1e-6, dsmax=0.05)
    found = auto.run(equations, starting_point, coarse, **to_one, **how).branches[0].points
    lp = next(point for point in found if point.point_type.name == "FOLD")
    begin = time.perf_counter()
    curve = []
    for ds in (-closure.FOLD_STEP, closure.FOLD_STEP):
        ends = {2: [0.0, closure.GAMMA_END]}
        part = auto.restart(equations, settings(ds), lp, icu=[1, 2], uzstop=ends, **how)
        curve += [tuple(map(float, point.parameters[:2])) for point in part.branches[0].points]
    data = {
        "name": f"bifpy {version('bifpy')}" + (", transpiled" if NATIVE else ", callbacks"),
        "branch_points": len(branch.points),
        "branch_seconds": branch_seconds,
        "fold": float(lp.parameters[0]),
        "curve": curve,
        "curve_seconds": time.perf_counter() - begin,
    }
    print("RESULT " + json.dumps(data))


if __name__ == "__main__":
    main()
