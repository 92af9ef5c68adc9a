"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from contbreather.dynamics.conditions import Conditions, State
from contbreather.dynamics.impacting import Record, Run, RunStop, Sample, simulate
from contbreather.dynamics.periodic_motion import PeriodicMotion, periodic
from contbreather.dynamics.recording import Recording, open_recording, record
from contbreather.dynamics.tangent import Lyapunov, lyapunov, variation

__all__ = [
    "Conditions",
    "Lyapunov",
    "PeriodicMotion",
    "Record",
    "Recording",
    "Run",
    "RunStop",
    "Sample",
    "State",
    "lyapunov",
    "open_recording",
    "periodic",
    "record",
    "simulate",
    "variation",
]
