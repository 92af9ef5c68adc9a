"""Periodic orbits with impacts: closed forms, their roots, and whether they keep off the walls."""

from __future__ import annotations

from contbreather.orbits.clearance import (
    Admissibility,
    centre_margin,
    highest_neighbour,
    neighbour_peak,
)
from contbreather.orbits.closure import Closure, smallest_amplitude
from contbreather.orbits.constructors import symmetric, symmetric_roots
from contbreather.orbits.orbit import Orbit, orbit_of
from contbreather.orbits.orbit_events import (
    grazing,
    neimark_sacker,
    period_doubling,
    pitchfork,
    saddle_node,
)
from contbreather.orbits.regions import Region
from contbreather.orbits.start_search import find_event, find_symmetric
from contbreather.orbits.zone_diagram import Zones
from contbreather.orbits.zones import zones

__all__ = [
    "Admissibility",
    "Closure",
    "Orbit",
    "Region",
    "Zones",
    "centre_margin",
    "find_event",
    "find_symmetric",
    "grazing",
    "highest_neighbour",
    "neighbour_peak",
    "neimark_sacker",
    "orbit_of",
    "period_doubling",
    "pitchfork",
    "saddle_node",
    "smallest_amplitude",
    "symmetric",
    "symmetric_roots",
    "zones",
]
