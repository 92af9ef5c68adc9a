"""Figures as the field draws them; matplotlib is imported when the first one is drawn.

Reads public types only: a figure can be drawn of anything that was computed, by anybody.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .branches import plot_diagram as plot_diagram
    from .canvas import Drawn as Drawn
    from .canvas import new_figure as new_figure
    from .canvas import save_figure as save_figure
    from .canvas import style as style
    from .multipliers import plot_multipliers as plot_multipliers
    from .multipliers import plot_spectrum as plot_spectrum
    from .orbits import plot_orbit as plot_orbit
    from .orbits import plot_profile as plot_profile
    from .orbits import plot_space_time as plot_space_time
    from .pictures import plot as plot
    from .runs import plot_basin as plot_basin
    from .runs import plot_localisation as plot_localisation
    from .runs import plot_motion as plot_motion
    from .runs import plot_section as plot_section
    from .runs import plot_sweep as plot_sweep
    from .zones import plot_atlas as plot_atlas
    from .zones import plot_zones as plot_zones

__all__ = front(__name__)
