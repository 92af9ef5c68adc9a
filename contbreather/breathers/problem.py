"""A breather as a problem of the engine: closure, domain, events, and what to record of it."""

from __future__ import annotations

from math import inf

from contbreather.breathers.closure import Closure
from contbreather.breathers.events import (
    asymmetric_arms,
    grazing,
    neimark_sacker,
    pitchfork,
    saddle_node,
)
from contbreather.breathers.symmetric import Breather
from contbreather.continuation import Event, Point, Problem
from contbreather.continuation.events import Judged
from contbreather.lattice import Lattice, Ring
from contbreather.stability.verdict import THRESHOLD as PAPER

# An impact of p = 0 is none: there b has a pole, so the branch ends a hair before. With harmonic
# forcing that is at a = 1, where the far field grazes. Without forcing there is no phase, and at
# gamma = 1/4 everything ends in one singular point.
DOMAIN = {"gamma": (0.0, 0.24999), "k": (0.0, 1.0), "a": (1e-9, inf), "p": (1e-14, inf)}


def problem_of(breather: Breather, threshold: float = PAPER) -> Problem:
    """The closure (11) with the breather as its start, and all its events.

    Columns: p, phi; a, gamma, k and the parameters of the forcing; ``unstable``, the number of
    multipliers of QS outside the circle, on a ring those over 2 pi beyond the threshold; computed
    when asked for.
    """
    forcing, lattice = breather.forcing, breather.lattice
    closure = Closure(forcing, lattice)

    def interpret(point: Point) -> Breather:
        values = point.params
        own = {name: values[name] for name in forcing.params}
        p, phi = float(point.z[0]), float(point.z[1])
        driven = forcing.at(**own) if own else forcing
        return Breather(values["a"], values["gamma"], values["k"], p, phi, driven, lattice)

    events = events_on(lattice, threshold)
    ring = isinstance(lattice, Ring)
    where = f" (ring of {lattice.sites}, threshold {threshold:g})" if ring else ""
    return Problem(
        closure.residual,
        {"p": breather.p, "phi": breather.phi},
        {"a": breather.a, "gamma": breather.gamma, "k": breather.k, **forcing.params},
        jacobian=closure.jacobian,
        sensitivity=closure.sensitivity,
        events=events,
        record=next(event for event in events if isinstance(event, Judged)).record,
        domain=DOMAIN,
        interpret=interpret,
        lifts={"PF": asymmetric_arms},
        label=f"symmetric breather{where}",
    )


def events_on(lattice: Lattice, threshold: float = PAPER) -> tuple[Event, ...]:
    """All events of a symmetric breather; on a ring Neimark-Sacker by the paper's rule."""
    on = lattice if isinstance(lattice, Ring) else None
    return (saddle_node(), pitchfork(), neimark_sacker(on=on, threshold=threshold), grazing())
