"""Figures as the field draws them; matplotlib is imported when the first one is drawn.

Reads public types only: a figure can be drawn of anything that was computed, by anybody.
"""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "branches": "plot_diagram plot_energy",
        "canvas": "Drawn new_figure save_figure style",
        "multipliers": "plot_multipliers plot_spectrum",
        "orbits": "plot_orbit plot_profile",
        "pictures": "plot",
        "runs": "plot_basin plot_localisation plot_motion plot_section plot_space_time plot_sweep",
        "zones": "plot_atlas plot_zones",
    },
)
