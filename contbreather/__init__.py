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

from .fronts import front
from .tables import HtmlRepr

__version__ = "0.1.0"
__all__ = front(
    __name__,
    {
        "": (
            "certified continuation errors explorer flows lattice orbits oscillators paper "
            "plotting simulation stability studies workers"
        ),
        "continuation": (
            "Branch Event Problem Steps boundary branch_point extend fold hopf trace user"
        ),
        "continuation.branches.diagram": "diagram",
        "continuation.walk.trace": "trace_many",
        "continuation.bifurcations.maps": "FixedPoint",
        "continuation.branches.switching": "switch",
        "errors": "BadInput NoSolution NotConverged",
        "flows": "Collocation Filippov Flow cycle cycles equilibrium integrate",
        "lattice": "Fourier Harmonic InfiniteChain Ring Samples Symbolic",
        "lattice.finite": "Grid Lattice OpenChain",
        "lattice.units": "Units",
        "orbits": "Orbit grazing neimark_sacker period_doubling pitchfork symmetric zones",
        "orbits.atlas": "atlas zones_many",
        "orbits.constructors": "shooting",
        "orbits.multibreathers": "multibreather multibreathers",
        "oscillators": "Oscillators breather breathers",
        "plotting": "plot save_figure",
        "runs": "Run load save",
        "simulation": "simulate",
    },
    dynamics="simulation",
)


def _card(value: object) -> str:
    """A value as a notebook shows it; what draws it is loaded then."""
    return str(import_module(f"{__name__}.plotting.pictures").card(value))


HtmlRepr.renderer = _card
