"""Breathers of any lattice of oscillators, from the limit without coupling."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(__name__)
