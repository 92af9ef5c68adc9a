"""Stability of a breather with one impacting site: plain numbers in, verdicts out.

Floor 3. Knows the lattice and the 2x2 block of the saltation matrix, nothing of breathers.
"""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "one_impact": "ns_points",
        "saltation": "saltation saltation_entry",
        "scattering": "OverReflection",
        "verdict": "Verdict stability verdict",
        "zeros": "Count",
    },
)
