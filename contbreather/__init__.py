"""Exact discrete breathers of an impacting chain: continued, with their true stability.

The front desk: it knows where each public name lives and fetches it on first use (PEP 562), so
that `import contbreather` costs nothing and `contbreather.symmetric` costs numpy and scipy only.

>>> import contbreather as cb
>>> cb.BadInput.__module__
'contbreather.errors'
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the same table again, for type checkers and editors; a test compares the two
    from contbreather.breathers import Breather as Breather
    from contbreather.breathers import Zones as Zones
    from contbreather.breathers import grazing as grazing
    from contbreather.breathers import neimark_sacker as neimark_sacker
    from contbreather.breathers import pitchfork as pitchfork
    from contbreather.breathers import symmetric as symmetric
    from contbreather.breathers import symmetric_roots as symmetric_roots
    from contbreather.breathers import zones as zones
    from contbreather.breathers.multi import multibreather as multibreather
    from contbreather.breathers.multi import multibreathers as multibreathers
    from contbreather.breathers.shooting import shooting as shooting
    from contbreather.continuation import Branch as Branch
    from contbreather.continuation import Event as Event
    from contbreather.continuation import Point as Point
    from contbreather.continuation import Problem as Problem
    from contbreather.continuation import Steps as Steps
    from contbreather.continuation import Stop as Stop
    from contbreather.continuation import boundary as boundary
    from contbreather.continuation import branch_point as branch_point
    from contbreather.continuation import cusp as cusp
    from contbreather.continuation import fold as fold
    from contbreather.continuation import hopf as hopf
    from contbreather.continuation import load as load
    from contbreather.continuation import save as save
    from contbreather.continuation import trace as trace
    from contbreather.continuation import user as user
    from contbreather.continuation import walk as walk
    from contbreather.continuation.diagram import Diagram as Diagram
    from contbreather.continuation.diagram import diagram as diagram
    from contbreather.continuation.maps import FixedPoint as FixedPoint
    from contbreather.continuation.switching import switch as switch
    from contbreather.dynamics import Axis as Axis
    from contbreather.dynamics import Explicit as Explicit
    from contbreather.dynamics import Implicit as Implicit
    from contbreather.dynamics import Sample as Sample
    from contbreather.dynamics import Switching as Switching
    from contbreather.dynamics import attraction as attraction
    from contbreather.dynamics import damped_orbit as damped_orbit
    from contbreather.dynamics import localisation as localisation
    from contbreather.dynamics import lyapunov as lyapunov
    from contbreather.dynamics import open_recording as open_recording
    from contbreather.dynamics import periodic as periodic
    from contbreather.dynamics import record as record
    from contbreather.dynamics import rotation as rotation
    from contbreather.dynamics import simulate as simulate
    from contbreather.dynamics import simulate_smooth as simulate_smooth
    from contbreather.dynamics import smooth_orbit as smooth_orbit
    from contbreather.dynamics import sweep as sweep
    from contbreather.dynamics import there_and_back as there_and_back
    from contbreather.dynamics import variation as variation
    from contbreather.dynamics import verdict as verdict
    from contbreather.errors import BadInput as BadInput
    from contbreather.errors import ContbreatherError as ContbreatherError
    from contbreather.errors import Interrupted as Interrupted
    from contbreather.errors import NoSolution as NoSolution
    from contbreather.errors import NotConverged as NotConverged
    from contbreather.lattice import Fourier as Fourier
    from contbreather.lattice import Harmonic as Harmonic
    from contbreather.lattice import InfiniteChain as InfiniteChain
    from contbreather.lattice import Ring as Ring
    from contbreather.lattice import Samples as Samples
    from contbreather.lattice import Symbolic as Symbolic
    from contbreather.lattice.finite import Grid as Grid
    from contbreather.lattice.finite import Lattice as Lattice
    from contbreather.lattice.finite import OpenChain as OpenChain
    from contbreather.plotting import plot as plot
    from contbreather.plotting import plot_basin as plot_basin
    from contbreather.plotting import plot_diagram as plot_diagram
    from contbreather.plotting import plot_localisation as plot_localisation
    from contbreather.plotting import plot_motion as plot_motion
    from contbreather.plotting import plot_multipliers as plot_multipliers
    from contbreather.plotting import plot_section as plot_section
    from contbreather.plotting import plot_sweep as plot_sweep
    from contbreather.plotting import plot_zones as plot_zones
    from contbreather.plotting import save_figure as save_figure

__version__ = "0.1.0"

_HOME = {
    "Breather": "contbreather.breathers",
    "symmetric": "contbreather.breathers",
    "Zones": "contbreather.breathers",
    "grazing": "contbreather.breathers",
    "neimark_sacker": "contbreather.breathers",
    "pitchfork": "contbreather.breathers",
    "zones": "contbreather.breathers",
    "symmetric_roots": "contbreather.breathers",
    "InfiniteChain": "contbreather.lattice",
    "Ring": "contbreather.lattice",
    "multibreather": "contbreather.breathers.multi",
    "multibreathers": "contbreather.breathers.multi",
    "Lattice": "contbreather.lattice.finite",
    "OpenChain": "contbreather.lattice.finite",
    "Grid": "contbreather.lattice.finite",
    "Harmonic": "contbreather.lattice",
    "Fourier": "contbreather.lattice",
    "Symbolic": "contbreather.lattice",
    "Samples": "contbreather.lattice",
    "Problem": "contbreather.continuation",
    "Steps": "contbreather.continuation",
    "Event": "contbreather.continuation",
    "Point": "contbreather.continuation",
    "Branch": "contbreather.continuation",
    "Stop": "contbreather.continuation",
    "trace": "contbreather.continuation",
    "walk": "contbreather.continuation",
    "boundary": "contbreather.continuation",
    "fold": "contbreather.continuation",
    "branch_point": "contbreather.continuation",
    "cusp": "contbreather.continuation",
    "hopf": "contbreather.continuation",
    "user": "contbreather.continuation",
    "save": "contbreather.continuation",
    "load": "contbreather.continuation",
    "plot": "contbreather.plotting",
    "save_figure": "contbreather.plotting",
    "plot_diagram": "contbreather.plotting",
    "plot_zones": "contbreather.plotting",
    "plot_basin": "contbreather.plotting",
    "plot_localisation": "contbreather.plotting",
    "plot_motion": "contbreather.plotting",
    "plot_multipliers": "contbreather.plotting",
    "plot_section": "contbreather.plotting",
    "plot_sweep": "contbreather.plotting",
    "switch": "contbreather.continuation.switching",
    "FixedPoint": "contbreather.continuation.maps",
    "diagram": "contbreather.continuation.diagram",
    "Diagram": "contbreather.continuation.diagram",
    "shooting": "contbreather.breathers.shooting",
    "Axis": "contbreather.dynamics",
    "Explicit": "contbreather.dynamics",
    "Implicit": "contbreather.dynamics",
    "Sample": "contbreather.dynamics",
    "Switching": "contbreather.dynamics",
    "attraction": "contbreather.dynamics",
    "damped_orbit": "contbreather.dynamics",
    "localisation": "contbreather.dynamics",
    "lyapunov": "contbreather.dynamics",
    "open_recording": "contbreather.dynamics",
    "periodic": "contbreather.dynamics",
    "record": "contbreather.dynamics",
    "rotation": "contbreather.dynamics",
    "simulate": "contbreather.dynamics",
    "simulate_smooth": "contbreather.dynamics",
    "smooth_orbit": "contbreather.dynamics",
    "sweep": "contbreather.dynamics",
    "there_and_back": "contbreather.dynamics",
    "variation": "contbreather.dynamics",
    "verdict": "contbreather.dynamics",
    "BadInput": "contbreather.errors",
    "ContbreatherError": "contbreather.errors",
    "Interrupted": "contbreather.errors",
    "NoSolution": "contbreather.errors",
    "NotConverged": "contbreather.errors",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        message = f"module 'contbreather' has no attribute {name!r}; it has {', '.join(_HOME)}"
        raise AttributeError(message)
    from importlib import import_module

    value: object = getattr(import_module(_HOME[name]), name)
    globals()[name] = value  # from now on an ordinary attribute
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
