"""Exact discrete breathers of an impacting chain: continued, with their true stability.

The front desk: what it holds is fetched on first use, so that `import contbreather` costs nothing
and `contbreather.symmetric` costs numpy and what a breather is made of. All else is in the
subpackages, which are fetched on first use as well.

>>> import contbreather as cb
>>> cb.BadInput.__module__, cb.simulation.sweep.__name__
('contbreather.errors', 'sweep')
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .fronts import front
from .tables import HtmlRepr

if TYPE_CHECKING:
    from . import certified as certified
    from . import continuation as continuation
    from . import errors as errors
    from . import explorer as explorer
    from . import flows as flows
    from . import lattice as lattice
    from . import orbits as orbits
    from . import paper as paper
    from . import plotting as plotting
    from . import simulation as simulation
    from . import stability as stability
    from . import studies as studies
    from . import workers as workers
    from .continuation import Branch as Branch
    from .continuation import Event as Event
    from .continuation import Problem as Problem
    from .continuation import Steps as Steps
    from .continuation import boundary as boundary
    from .continuation import branch_point as branch_point
    from .continuation import extend as extend
    from .continuation import fold as fold
    from .continuation import hopf as hopf
    from .continuation import trace as trace
    from .continuation import user as user
    from .continuation.diagram import diagram as diagram
    from .continuation.many import trace_many as trace_many
    from .continuation.maps import FixedPoint as FixedPoint
    from .continuation.switching import switch as switch
    from .errors import BadInput as BadInput
    from .errors import NoSolution as NoSolution
    from .errors import NotConverged as NotConverged
    from .flows import Collocation as Collocation
    from .flows import Filippov as Filippov
    from .flows import Flow as Flow
    from .flows import cycle as cycle
    from .flows import equilibrium as equilibrium
    from .flows import integrate as integrate
    from .lattice import Fourier as Fourier
    from .lattice import Harmonic as Harmonic
    from .lattice import InfiniteChain as InfiniteChain
    from .lattice import Ring as Ring
    from .lattice import Samples as Samples
    from .lattice import Symbolic as Symbolic
    from .lattice.finite import Grid as Grid
    from .lattice.finite import Lattice as Lattice
    from .lattice.finite import OpenChain as OpenChain
    from .orbits import Orbit as Orbit
    from .orbits import grazing as grazing
    from .orbits import neimark_sacker as neimark_sacker
    from .orbits import period_doubling as period_doubling
    from .orbits import pitchfork as pitchfork
    from .orbits import symmetric as symmetric
    from .orbits import zones as zones
    from .orbits.atlas import atlas as atlas
    from .orbits.atlas import zones_many as zones_many
    from .orbits.constructors import shooting as shooting
    from .orbits.multibreathers import multibreather as multibreather
    from .orbits.multibreathers import multibreathers as multibreathers
    from .plotting import plot as plot
    from .plotting import save_figure as save_figure
    from .runs import Run as Run
    from .runs import load as load
    from .runs import save as save
    from .simulation import simulate as simulate

__version__ = "0.1.0"
__all__ = front(__name__, breathers="orbits", dynamics="simulation")


def _card(value: object) -> str:
    """A value as a notebook shows it; what draws it is loaded then."""
    return str(import_module(f"{__name__}.plotting.pictures").card(value))


HtmlRepr.renderer = _card
