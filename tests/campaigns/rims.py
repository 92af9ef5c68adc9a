"""Random parameter sets up to the rims: an answer or a sentence, no NaN, no warning, none slow.

python -m tests.campaigns.rims [sets=2000] [seed=0]
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

ANSWERED = ("certain", "uncertain", "vanishing", "NoSolution", "BadInput", "NotConverged")


def drawn(rng):
    tiny = 10.0 ** rng.uniform(-17, -1, 3)
    gammas = rng.uniform(0, 0.25), 0.0, tiny[0], 0.25 - tiny[0], 0.25 - 10 ** rng.uniform(-9, -7)
    ks = rng.uniform(0, 1), 0.0, 1.0, tiny[1], 1.0 - tiny[1]
    powers = 10.0 ** rng.uniform(-12, 0), 10.0 ** rng.uniform(0, 12)
    amplitudes = rng.uniform(0, 1.2), *powers, 1.0 - tiny[2], 1.0 + tiny[2]
    forcing = None
    if rng.random() < 0.4:
        cos = {1: -1.0, 3: rng.normal(), 5: rng.normal() * (rng.random() < 0.5)}
        forcing = cb.Fourier(cos=cos, sin={3: rng.normal()})
    return *(float(rng.choice(some)) for some in (amplitudes, gammas, ks)), forcing


def ask(a, gamma, k, forcing):
    """Every number the three answers hold."""
    b = cb.symmetric(a, gamma, k, forcing=forcing)
    v, m = b.stability(), b.admissibility()
    numbers = [b.p, b.phi, b.b, v.unstable, v.nu]
    numbers += [m.margin, m.max_neighbour, m.centre, m.neighbours, m.far, m.time]
    assert v.describe()
    assert m.reason
    if b.vanishing is not None:  # nothing is said of multipliers
        return "vanishing" if math.isfinite(m.margin) else "nan"
    if not all(math.isfinite(x) for x in numbers):
        return "nan"
    if not 0 <= v.unstable <= 4:
        return f"count {v.unstable}"
    if b.residual > 1e-9 * (1 + b.p * b.chi + a):
        return "residual"
    assert v.over_reflecting in (True, False)
    return "certain" if v.certain else "uncertain"


def answer(a, gamma, k, forcing):
    """One of those above, or what is wrong."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return ask(a, gamma, k, forcing)
    except ContbreatherError as error:
        known = isinstance(error, cb.NoSolution) or gamma >= 0.25
        return type(error).__name__ + ("" if known else f": {error}"[:150])
    except Exception as error:  # noqa: BLE001 (what escapes is what is counted)
        return f"RAW {type(error).__name__}: {error}"[:100]


def main(sets=2000, seed=0):
    ask(0.5, 0.1, 0.8, None)  # imports are not what is timed
    rng = np.random.default_rng(seed)
    tally, slow = collections.Counter(), 0.0
    for _ in range(sets):
        case, began = drawn(rng), time.process_time()
        what = answer(*case)
        took = time.process_time() - began
        slow, what = max(slow, took), "slow" if took > 1.0 else what
        tally[what.split(":")[0]] += 1
        if what not in ANSWERED:
            print(case, what)
    print(dict(tally), f"slowest {slow:.3f} s")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
