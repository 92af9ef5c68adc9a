"""Random parameter sets up to the rims: an answer or a sentence, no NaN, no warning, none slow.

python tests/campaigns/rims.py [sets=2000] [seed=0]
"""

from __future__ import annotations

import collections
import math
import sys
import time
import warnings

import numpy as np

import contbreather as cb
from contbreather.errors import ContbreatherError

SETS = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
SEED = int(sys.argv[2]) if len(sys.argv) > 2 else 0


def drawn(rng):
    tiny = 10.0 ** rng.uniform(-17, -1)
    gamma = float(
        rng.choice([rng.uniform(0, 0.25), 0.0, tiny, 0.25 - tiny, 0.25 - 10 ** rng.uniform(-9, -7)])
    )
    tiny = 10.0 ** rng.uniform(-17, -1)
    k = float(rng.choice([rng.uniform(0, 1), 0.0, 1.0, tiny, 1.0 - tiny]))
    a = float(
        rng.choice(
            [
                rng.uniform(0, 1.2),
                10.0 ** rng.uniform(-12, 0),
                10.0 ** rng.uniform(0, 12),
                1.0 - tiny,
                1.0 + tiny,
            ]
        )
    )
    forcing = None
    if rng.random() < 0.4:
        cos = {1: -1.0, 3: rng.normal(), 5: rng.normal() * (rng.random() < 0.5)}
        forcing = cb.Fourier(cos=cos, sin={3: rng.normal()})
    return a, gamma, k, forcing


def ask(a, gamma, k, forcing):
    """Every number the three answers hold."""
    b = cb.symmetric(a, gamma, k, forcing=forcing)
    v, m = b.stability(), b.admissibility()
    numbers = [
        b.p,
        b.phi,
        b.b,
        v.unstable,
        v.nu,
        m.margin,
        m.max_neighbour,
        m.centre,
        m.neighbours,
        m.far,
        m.time,
    ]
    assert v.describe()
    assert m.reason
    if not all(math.isfinite(x) for x in numbers):
        return "nan"
    if not 0 <= v.unstable <= 4:
        return f"count {v.unstable}"
    if b.residual > 1e-9 * (1 + b.p * b.chi + a):
        return "residual"
    assert v.over_reflecting in (True, False)
    return "certain" if v.certain else "uncertain"


def main():
    ask(0.5, 0.1, 0.8, None)  # imports are not what is timed
    rng = np.random.default_rng(SEED)
    tally, slow = collections.Counter(), 0.0
    for _i in range(SETS):
        case = drawn(rng)
        began = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                what = ask(*case)
        except ContbreatherError as error:
            what = type(error).__name__
            if what != "NoSolution" and not (what == "BadInput" and case[1] >= 0.25):
                print(case, what, str(error)[:150])
        except Exception as error:  # noqa: BLE001 (what escapes is what is counted)
            what = "RAW " + type(error).__name__ + ": " + str(error)[:80]
        took = time.process_time() - began
        if took > 1.0:
            what = "slow"
        slow = max(slow, took)
        tally[what] += 1
        if what not in ("certain", "uncertain", "NoSolution", "BadInput", "NotConverged"):
            print(case, what)
    print(dict(tally), f"slowest {slow:.3f} s")


if __name__ == "__main__":
    main()
