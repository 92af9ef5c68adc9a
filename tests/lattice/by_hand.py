"""Means over the modes of a ring in mpmath's precision, slopes of forcings, and a site between two
impacts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp

from contbreather.lattice.forcing import TrigonometricSeries
from contbreather.lattice.periodic_green import half_period_green

MEANS = {
    "chi": lambda w: mp.tan(mp.pi * w / 2) / w if w else mp.pi / 2,
    "eta": lambda w: w * mp.tan(mp.pi * w / 2),
    "sigma": lambda w: w / mp.sin(mp.pi * w) if w else 1 / mp.pi,
    "psi": lambda w: w * mp.cot(mp.pi * w / 2) if w else 2 / mp.pi,
}


def ring_mean(of: Callable[[Any], Any], gamma: Any, sites: int, n: int = 0) -> Any:
    """``<of(w) cos(n theta)>``; of a ring long enough that of the infinite chain. Waves to the left
    and to the right are one term."""
    root = 2 * mp.sqrt(mp.mpf(gamma))
    return (
        mp.fsum(
            (1 if j in (0, sites / 2) else 2)
            * of(root * mp.sin(mp.pi * j / sites))
            * mp.cos(2 * mp.pi * n * j / sites)
            for j in range(sites // 2 + 1)
        )
        / sites
    )


def slope_of(forcing: Any, name: str, t: float, order: int) -> float:
    """The slope of a derivative of f in a parameter."""
    return float(TrigonometricSeries(forcing.slope_harmonics(name)).at(t, order))


def response(lattice: Any, gamma: float, n: int, s: Any, by: str = "") -> tuple[Any, ...]:
    """v, v' and v'' of site n, per unit p, s after an impact of site 0."""
    return tuple(-2.0 * half_period_green(lattice, gamma, (n,), by).at(s)[:3])
