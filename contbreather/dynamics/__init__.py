"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from contbreather.dynamics.conditions import Conditions, State
from contbreather.dynamics.impacting import Record, Run, RunStop, Sample, simulate
from contbreather.dynamics.periodic_motion import PeriodicMotion, periodic
from contbreather.dynamics.recording import Recording, open_recording, record
from contbreather.dynamics.smooth import (
    Explicit,
    Implicit,
    SmoothConditions,
    SmoothRun,
    Switching,
    simulate_smooth,
)
from contbreather.dynamics.smooth_shooting import SmoothOrbit, smooth_orbit
from contbreather.dynamics.tangent import Lyapunov, lyapunov, variation

__all__ = [
    "Conditions",
    "Explicit",
    "Implicit",
    "Lyapunov",
    "PeriodicMotion",
    "Record",
    "Recording",
    "Run",
    "RunStop",
    "Sample",
    "SmoothConditions",
    "SmoothOrbit",
    "SmoothRun",
    "State",
    "Switching",
    "lyapunov",
    "open_recording",
    "periodic",
    "record",
    "simulate",
    "simulate_smooth",
    "smooth_orbit",
    "variation",
]
