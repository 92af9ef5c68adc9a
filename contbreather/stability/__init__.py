"""Stability of a breather with one impacting site: plain numbers in, verdicts out.

Floor 3. Knows the lattice and the 2x2 block of the saltation matrix, nothing of breathers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from contbreather.fronts import front

if TYPE_CHECKING:
    from .one_impact import ns_points as ns_points
    from .saltation import saltation as saltation
    from .saltation import saltation_entry as saltation_entry
    from .scattering import OverReflection as OverReflection
    from .verdict import Verdict as Verdict
    from .verdict import stability as stability
    from .verdict import verdict as verdict
    from .zeros import Count as Count

__all__ = front(__name__)
