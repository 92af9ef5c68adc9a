"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from contbreather.simulation.basin import Axis, Basin, Outcome, attraction
from contbreather.simulation.classify import Kind, Verdict, judge, verdict
from contbreather.simulation.integrator import RunStop, Sample
from contbreather.simulation.measures import (
    Localisation,
    Lyapunov,
    Rotation,
    localisation,
    lyapunov,
    rotation,
)
from contbreather.simulation.periodic import PeriodicMotion, periodic
from contbreather.simulation.recording import Recording, open_recording, record
from contbreather.simulation.simulate import Record, Run, simulate
from contbreather.simulation.smooth import (
    Explicit,
    Implicit,
    SmoothConditions,
    SmoothRun,
    Switching,
    simulate_smooth,
)
from contbreather.simulation.states import State
from contbreather.simulation.sweep import Sweep, sweep, there_and_back
from contbreather.simulation.variation import variation

__all__ = [
    "Axis",
    "Basin",
    "Explicit",
    "Outcome",
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
