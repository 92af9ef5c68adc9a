"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from contbreather.dynamics.basin import Axis, Basin, Fate, attraction
from contbreather.dynamics.energy import Localisation, localisation
from contbreather.dynamics.impacting import Record, Run, simulate
from contbreather.dynamics.recording import Recording, open_recording, record
from contbreather.dynamics.returning import PeriodicMotion, periodic
from contbreather.dynamics.slow_sweep import Sweep, sweep, there_and_back
from contbreather.dynamics.smooth import (
    Explicit,
    Implicit,
    SmoothConditions,
    SmoothRun,
    Switching,
    simulate_smooth,
)
from contbreather.dynamics.states import State
from contbreather.dynamics.stretches import RunStop, Sample
from contbreather.dynamics.tangent import Lyapunov, lyapunov, variation
from contbreather.dynamics.verdicts import Kind, Rotation, Verdict, judge, rotation, verdict

__all__ = [
    "Axis",
    "Basin",
    "Explicit",
    "Fate",
    "Implicit",
    "Kind",
    "Localisation",
    "Lyapunov",
    "PeriodicMotion",
    "Record",
    "Recording",
    "Rotation",
    "Run",
    "RunStop",
    "Sample",
    "SmoothConditions",
    "SmoothRun",
    "State",
    "Sweep",
    "Switching",
    "Verdict",
    "attraction",
    "judge",
    "localisation",
    "lyapunov",
    "open_recording",
    "periodic",
    "record",
    "rotation",
    "simulate",
    "simulate_smooth",
    "sweep",
    "there_and_back",
    "variation",
    "verdict",
]
