"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from contbreather.simulation.basin import Axis, Basin, Fate, attraction
from contbreather.simulation.energy import Localisation, localisation
from contbreather.simulation.impacting import Record, Run, simulate
from contbreather.simulation.recording import Recording, open_recording, record
from contbreather.simulation.returning import PeriodicMotion, periodic
from contbreather.simulation.slow_sweep import Sweep, sweep, there_and_back
from contbreather.simulation.smooth import (
    Explicit,
    Implicit,
    SmoothConditions,
    SmoothRun,
    Switching,
    simulate_smooth,
)
from contbreather.simulation.states import State
from contbreather.simulation.stretches import RunStop, Sample
from contbreather.simulation.tangent import Lyapunov, lyapunov, variation
from contbreather.simulation.verdicts import Kind, Rotation, Verdict, judge, rotation, verdict

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
