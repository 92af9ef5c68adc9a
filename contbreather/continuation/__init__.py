"""Floor 1: curves H(z) = 0 and everything that walks them. Knows nothing of breathers."""

from __future__ import annotations

from contbreather.fronts import front

__all__ = front(
    __name__,
    {
        "branches.boundary": "boundary",
        "curve.branch": "Branch Stop",
        "bifurcations.equilibria": "branch_point cusp fold hopf",
        "curve.point": "DefiningSystem Event Point user",
        "curve.problem": "Problem",
        "files.result_files": "Run load save",
        "files.resume": "extend refined with_columns",
        "curve.settings": "Steps",
        "branches.switching": "SwitchingProblem",
        "walk.trace": "iterate trace",
    },
)
