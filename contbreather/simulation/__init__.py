"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(__name__, Run="SimulationRun")
