"""Periodic orbits of anybody's system, smooth, forced or hybrid, as cycles of flows."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "collocation": "Collocation",
        "cycle_constructors": "cycle",
        "cycle_problem": "Cycle cycle_of",
        "flow": "Filippov Flow",
        "flow_equilibria": "equilibrium",
        "integrate": "GuardCrossing Piece Trajectory integrate",
        "several_starts": "FoundCycle cycles",
    },
)
