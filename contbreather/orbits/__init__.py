"""Periodic orbits with impacts: closed forms, their roots, and whether they keep off the walls."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(__name__)
