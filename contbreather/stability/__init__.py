"""Stability of a breather with one impacting site: plain numbers in, verdicts out.

Floor 3. Knows the lattice and the 2x2 block of the saltation matrix, nothing of breathers.
"""

from __future__ import annotations

from contbreather.stability.arc import (
    NeimarkSacker,
    OverReflection,
    Window,
    neimark_sacker,
    on_arc,
    over_reflection,
    over_reflects,
    scattering,
    window,
)
from contbreather.stability.characteristic import D, D_gradient, D_slope, G, Gradient
from contbreather.stability.counting import (
    Count,
    closest_approach,
    unstable_count,
    unstable_multipliers,
)
from contbreather.stability.ring_multipliers import (
    apply_half_map,
    dense_half_map,
    eigenvector,
    even_multipliers,
    half_multipliers,
)
from contbreather.stability.saltation import saltation, saltation_entry
from contbreather.stability.verdict import Verdict, stability, verdict

__all__ = [
    "Count",
    "D",
    "D_gradient",
    "D_slope",
    "G",
    "Gradient",
    "NeimarkSacker",
    "OverReflection",
    "Verdict",
    "Window",
    "apply_half_map",
    "closest_approach",
    "dense_half_map",
    "eigenvector",
    "even_multipliers",
    "half_multipliers",
    "neimark_sacker",
    "on_arc",
    "over_reflection",
    "over_reflects",
    "saltation",
    "saltation_entry",
    "scattering",
    "stability",
    "unstable_count",
    "unstable_multipliers",
    "verdict",
    "window",
]
