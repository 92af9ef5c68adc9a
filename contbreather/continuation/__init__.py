"""Floor 1: curves H(z) = 0 and everything that walks them. Knows nothing of breathers."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "boundary": "boundary",
        "branch": "Branch Stop",
        "equilibria": "branch_point cusp fold hopf",
        "point": "DefiningSystem Event Point user",
        "problem": "Problem",
        "result_files": "Run load save",
        "resume": "extend refined with_columns",
        "settings": "Steps",
        "switching": "SwitchingProblem",
        "trace": "iterate trace",
    },
)
