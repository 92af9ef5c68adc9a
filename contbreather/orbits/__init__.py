"""Periodic orbits with impacts: closed forms, their roots, and whether they keep off the walls."""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .clearance import Admissibility as Admissibility
    from .clearance import centre_margin as centre_margin
    from .clearance import highest_neighbour as highest_neighbour
    from .clearance import neighbour_peak as neighbour_peak
    from .closed_form import symmetric as symmetric
    from .closed_form import symmetric_roots as symmetric_roots
    from .closed_problem import Closure as Closure
    from .closure import smallest_amplitude as smallest_amplitude
    from .orbit import Orbit as Orbit
    from .orbit import orbit_of as orbit_of
    from .orbit_events import grazing as grazing
    from .orbit_events import neimark_sacker as neimark_sacker
    from .orbit_events import period_doubling as period_doubling
    from .orbit_events import pitchfork as pitchfork
    from .orbit_events import saddle_node as saddle_node
    from .regions import Region as Region
    from .start_search import find_event as find_event
    from .start_search import find_symmetric as find_symmetric
    from .zone_diagram import Zones as Zones
    from .zones import zones as zones

__all__ = front(__name__)
