"""The one problem that every program is given, in plain Python: also read by foreign interpreters.

Equations (11) for F = -a cos t: p chi(gamma) + a cos phi = 1, -a sin phi = p q. The branch runs in
a at fixed gamma and k, from a = 1 on the upper sheet through the fold (14) to a = 1 on the lower
one; the fold curve runs in (gamma, a) over all of 0 <= gamma <= 0.2499.

chi(gamma) keeps the pole of (10) next to the band exact and expands the others in gamma: sixteen
terms are at machine precision, and every program can be told them in its own language.
"""

from __future__ import annotations

import math
from itertools import pairwise

K = 0.8
GAMMA = 0.08
GAMMA_END = 0.2499
POINTS = 2000
FOLD_STEP = 1e-3
TERMS = 16


def odd_sum(power: int) -> float:
    """Sum of (2l + 1)^-power over l >= 1."""
    closed = {2: math.pi**2 / 8, 4: math.pi**4 / 96}
    if power in closed:
        return closed[power] - 1
    return math.fsum((2 * m + 1) ** -power for m in range(1, 3000))


CHI_SERIES = tuple(4 / math.pi * math.comb(2 * n, n) * odd_sum(2 * n + 2) for n in range(TERMS))


def chi(gamma: float) -> float:
    tail = 0.0
    for coefficient in reversed(CHI_SERIES):
        tail = tail * gamma + coefficient
    return 4 / math.pi / math.sqrt(1 - 4 * gamma) + tail


def restitution(k: float) -> float:
    """q of (11)."""
    return (1 - k) / (1 + k)


def fold(gamma: float, k: float = K) -> float:
    """The smallest a at which (11) has a solution, equation (14) in closed form."""
    q = restitution(k)
    return q / math.hypot(chi(gamma), q)


def start(gamma: float = GAMMA, k: float = K) -> tuple[float, float]:
    """(p, phi) at a = 1 on the upper sheet."""
    slope, q = chi(gamma), restitution(k)
    p = 2 * slope / (slope**2 + q**2)
    return p, math.atan2(-p * q, 1 - p * slope)


def branch_length(gamma: float, k: float, pieces: int = 20_000) -> float:
    """Length of the branch in (p, phi, a) between its two ends at a = 1."""
    slope, q = chi(gamma), restitution(k)
    top = start(gamma, k)[0]
    points = []
    for i in range(pieces):
        p = top * (1 - i / pieces)
        points.append((p, math.atan2(-p * q, 1 - p * slope), math.hypot(1 - p * slope, p * q)))
    return sum(math.dist(one, other) for one, other in pairwise(points))
