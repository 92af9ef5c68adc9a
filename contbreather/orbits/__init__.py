"""Periodic orbits with impacts: closed forms, their roots, and whether they keep off the walls."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "clearance": "Admissibility centre_margin highest_neighbour neighbour_peak",
        "closed_form": "symmetric symmetric_roots",
        "closed_problem": "Closure",
        "closure": "smallest_amplitude",
        "orbit": "Orbit orbit_of",
        "orbit_events": "grazing neimark_sacker period_doubling pitchfork saddle_node",
        "start_search": "find_event find_symmetric",
        "zone_diagram": "Region Zones",
        "zones": "zones",
    },
)
