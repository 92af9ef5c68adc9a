"""Finite rings in motion: the impacting one exactly, the smooth one by an ODE solver."""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .basin import Axis as Axis
    from .basin import Basin as Basin
    from .basin import Outcome as Outcome
    from .basin import attraction as attraction
    from .classify import Classification as Classification
    from .classify import Kind as Kind
    from .classify import classify as classify
    from .classify import judge as judge
    from .integrator import RunStop as RunStop
    from .integrator import Sample as Sample
    from .measures import Localisation as Localisation
    from .measures import Lyapunov as Lyapunov
    from .measures import Rotation as Rotation
    from .measures import localisation as localisation
    from .measures import lyapunov as lyapunov
    from .measures import rotation as rotation
    from .periodic import PeriodicMotion as PeriodicMotion
    from .periodic import periodic as periodic
    from .recording import Recording as Recording
    from .recording import open_recording as open_recording
    from .recording import record as record
    from .simulate import Record as Record
    from .simulate import SimulationRun as SimulationRun
    from .simulate import SmoothRun as SmoothRun
    from .simulate import simulate as simulate
    from .simulate import simulate_smooth as simulate_smooth
    from .states import SmoothConditions as SmoothConditions
    from .states import State as State
    from .sweep import Sweep as Sweep
    from .sweep import sweep as sweep
    from .sweep import there_and_back as there_and_back
    from .variation import variation as variation

__all__ = front(__name__, Run="SimulationRun")
