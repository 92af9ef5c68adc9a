"""Figures as the field draws them; matplotlib is imported when the first one is drawn.

Reads public types only: a figure can be drawn of anything that was computed, by anybody.
"""

from __future__ import annotations

from contbreather.plotting.canvas import Drawn, new_figure, save_figure, style
from contbreather.plotting.diagrams import plot_diagram
from contbreather.plotting.fields import plot_profile, plot_space_time
from contbreather.plotting.multipliers import plot_multipliers, plot_spectrum
from contbreather.plotting.orbits import plot_orbit
from contbreather.plotting.pictures import plot
from contbreather.plotting.runs import (
    plot_basin,
    plot_localisation,
    plot_motion,
    plot_section,
    plot_sweep,
)
from contbreather.plotting.zones import plot_atlas, plot_zones

__all__ = [
    "Drawn",
    "new_figure",
    "plot",
    "plot_atlas",
    "plot_basin",
    "plot_diagram",
    "plot_localisation",
    "plot_motion",
    "plot_multipliers",
    "plot_orbit",
    "plot_profile",
    "plot_section",
    "plot_space_time",
    "plot_spectrum",
    "plot_sweep",
    "plot_zones",
    "save_figure",
    "style",
]
