"""Oracles that share nothing with the code: the paper's own series, at 30 digits."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import mpmath as mp
import pytest

TERMS = 8  # of the expansion in 1/s^2 that is summed in closed form (Clausen functions)
DIRECT = 60  # harmonics summed one by one: (2*60)^-16 < 1e-33


@cache
def chi_of(gamma):
    """(10) as printed, extrapolated."""
    with mp.workdps(30):
        total = mp.nsum(
            lambda m: 1 / mp.sqrt((2 * m + 1) ** 4 - 4 * mp.mpf(gamma) * (2 * m + 1) ** 2),
            [0, mp.inf],
        )
        return 4 / mp.pi * total


def coefficient(gamma, n, s):
    """Of cos(s (t - phi)) in (9), per unit p; the fraction as in (B8), without cancellation."""
    root = mp.sqrt(1 - 4 * gamma / s**2)
    xi = -2 * gamma / (s**2 - 2 * gamma + s**2 * root)
    return 4 / mp.pi * xi**n / (s**2 * root)


@cache
def _expansion(gamma, n):
    """Taylor coefficients of s^2 times the coefficient in powers of 1/s^2."""
    with mp.workdps(60):

        def of(x):
            root = mp.sqrt(1 - 4 * gamma * x)
            return 4 / mp.pi * (-2 * gamma * x / (1 - 2 * gamma * x + root)) ** n / root

        # by a Cauchy integral on a circle well inside the branch point 1/(4 gamma) >= 1
        points = [mp.expjpi(mp.mpf(2 * i) / 256) / 2 for i in range(256)]
        values = [of(z) for z in points]
        return [
            mp.re(mp.fsum(v / z**j for v, z in zip(values, points, strict=True)) / 256)
            for j in range(TERMS)
        ]


@cache  # of a time, which all sites share
def _odd_cosines(order, s):
    return mp.clcos(order, s) - mp.clcos(order, 2 * s) / mp.mpf(2) ** order


@cache
def _odd_sines(order, s):
    return mp.clsin(order, s) - mp.clsin(order, 2 * s) / mp.mpf(2) ** order


@cache
def _beside(gamma, n):
    """What the expansion leaves of the coefficients of the first harmonics."""
    e = _expansion(gamma, n)
    with mp.workdps(30):
        return [
            coefficient(gamma, n, mp.mpf(m))
            - mp.fsum(c / mp.mpf(m) ** (2 * j + 2) for j, c in enumerate(e))
            for m in range(1, 2 * DIRECT, 2)
        ]


def flight_of(gamma, n, s):
    """v_n and v_n' per unit p at the time s after the impact, 0 < s < pi, from (9)."""
    gamma, s = mp.mpf(gamma), mp.mpf(s)
    e = _expansion(gamma, n)
    v = mp.fsum(c * _odd_cosines(2 * j + 2, s) for j, c in enumerate(e))
    w = -mp.fsum(c * _odd_sines(2 * j + 1, s) for j, c in enumerate(e))
    for m, left in zip(range(1, 2 * DIRECT, 2), _beside(gamma, n), strict=True):
        v += left * mp.cos(m * s)
        w -= left * m * mp.sin(m * s)
    return v, w


def root_of(a, gamma, k, *, upper=True):
    """p and phi of (11) by the quadratic for p; the phase by the arccosine, not by (13)."""
    a, k, chi = mp.mpf(a), mp.mpf(k), chi_of(gamma)
    q = (1 - k) / (1 + k)
    disc = mp.sqrt(chi**2 - (chi**2 + q**2) * (1 - a**2))
    p = (chi + (disc if upper else -disc)) / (chi**2 + q**2)
    return p, -mp.acos((1 - p * chi) / a)


@pytest.fixture(scope="session")
def paper():
    """The oracles by name; use inside `mp.workdps(30)`."""
    return SimpleNamespace(chi=chi_of, flight=flight_of, root=root_of)
