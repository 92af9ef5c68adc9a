"""Breathers of any lattice of oscillators, from the limit without coupling."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "breather_constructors": "CodedBreather breather breathers",
        "breather_problem": "Breather BreatherProblem",
        "oscillator_lattice": "Oscillators",
    },
)
