"""Motions that many tests begin with."""

from __future__ import annotations

from typing import Any

import contbreather as cb
from contbreather.simulation import PeriodicMotion, periodic


def breather(sites: int, **on: Any) -> PeriodicMotion:
    """The symmetric motion of a ring next to the exact breather of the infinite chain."""
    exact = cb.symmetric(on["a"], on["gamma"], on["k"])
    return periodic(exact.state(sites, on.get("t0", 0.0)), symmetric=True, **on)
