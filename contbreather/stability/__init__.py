"""Stability of a breather with one impacting site: plain numbers in, verdicts out.

Floor 3. Knows the lattice and the 2x2 block of the saltation matrix, nothing of breathers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .arc import NeimarkSacker as NeimarkSacker
    from .arc import OverReflection as OverReflection
    from .arc import Window as Window
    from .arc import ns_points as ns_points
    from .arc import on_arc as on_arc
    from .arc import over_reflection as over_reflection
    from .arc import over_reflects as over_reflects
    from .arc import scattering as scattering
    from .arc import window as window
    from .characteristic import D as D
    from .characteristic import D_gradient as D_gradient
    from .characteristic import D_slope as D_slope
    from .characteristic import G as G
    from .characteristic import Gradient as Gradient
    from .counting import Count as Count
    from .counting import closest_approach as closest_approach
    from .counting import unstable_count as unstable_count
    from .counting import unstable_multipliers as unstable_multipliers
    from .ring_multipliers import apply_half_map as apply_half_map
    from .ring_multipliers import dense_half_map as dense_half_map
    from .ring_multipliers import eigenvector as eigenvector
    from .ring_multipliers import even_multipliers as even_multipliers
    from .ring_multipliers import half_multipliers as half_multipliers
    from .saltation import saltation as saltation
    from .saltation import saltation_entry as saltation_entry
    from .verdict import Verdict as Verdict
    from .verdict import stability as stability
    from .verdict import verdict as verdict

__all__ = front(__name__)
