"""Means over the modes of a ring in mpmath's precision, mode by mode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp

MEANS = {
    "chi": lambda w: mp.tan(mp.pi * w / 2) / w if w else mp.pi / 2,
    "eta": lambda w: w * mp.tan(mp.pi * w / 2),
    "sigma": lambda w: w / mp.sin(mp.pi * w) if w else 1 / mp.pi,
    "psi": lambda w: w * mp.cot(mp.pi * w / 2) if w else 2 / mp.pi,
}


def ring_mean(of: Callable[[Any], Any], gamma: Any, sites: int, n: int = 0) -> Any:
    """``<of(w) cos(n theta)>``; of a ring long enough that of the infinite chain."""
    root = 2 * mp.sqrt(mp.mpf(gamma))
    return (
        mp.fsum(
            of(root * mp.sin(mp.pi * j / sites)) * mp.cos(2 * mp.pi * n * j / sites)
            for j in range(sites)
        )
        / sites
    )
