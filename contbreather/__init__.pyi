"""The names of the front desk and where each lives, for Python and for type checkers."""

# For type checkers, which would not know cb.paper otherwise; lazy_loader skips such a line.
import contbreather.paper  # noqa: F401

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

__version__: str
