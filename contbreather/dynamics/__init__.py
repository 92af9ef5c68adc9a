"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from contbreather.dynamics.conditions import Conditions, State
from contbreather.dynamics.impacting import Record, Run, RunStop, Sample, simulate

__all__ = ["Conditions", "Record", "Run", "RunStop", "Sample", "State", "simulate"]
