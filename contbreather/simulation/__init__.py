"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "basin": "Axis Basin Outcome attraction",
        "classify": "Classification Kind classify judge",
        "integrator": "RunStop Sample",
        "measures": "Localisation Lyapunov Rotation localisation lyapunov rotation",
        "periodic": "PeriodicMotion periodic",
        "recording": "Recording open_recording record",
        "simulate": "Record SimulationRun SmoothRun simulate simulate_smooth",
        "states": "SmoothConditions State",
        "sweep": "Sweep sweep there_and_back",
        "variation": "variation",
    },
    Run="SimulationRun",
)
