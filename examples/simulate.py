"""
Simulation: a fold seen from both sides, and how far a breather attracts
========================================================================

On a damped ring of 10 the amplitude is lowered slowly. The breather follows its branch to the
fold, is lost there, and does not come back when the amplitude does. Then many starts of one site:
which of them end on the breather, which in silence?
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import contbreather as cb
from contbreather.continuation import refined
from contbreather.plotting import new_figure, plot_basin, plot_sweep, save_figure, style
from contbreather.simulation import Axis, Basin, Sweep, attraction, periodic, sweep, there_and_back

FOLD = {"a": 0.2, "gamma": 0.04, "k": 0.8, "damping": 0.01}
ATTRACTOR = {"a": 0.3, "gamma": 0.05, "k": 0.8, "damping": 0.05}


def around_the_fold() -> tuple[Sweep, cb.Branch]:
    """The sweep down and up, and the branch of the same ring."""
    start = cb.symmetric(a=0.2, gamma=0.04, k=0.8).state(10)
    loop = sweep(
        start, "a", there_and_back(np.linspace(0.2, 0.05, 31)), periods=60, progress=False, **FOLD
    )
    orbit = periodic(start, symmetric=True, **FOLD)
    within = {"a": (0.05, 0.2)}
    branch = cb.trace(orbit, "a", towards="down", within=within, progress=False)
    print(f"the branch ends in a fold at a = {branch.first('LP')['a']:.6f}")
    print(f"the sweep loses the breather at a = {loop.lost():.3f} and never finds it again")
    return loop, refined(branch, 30)


def momenta(branch: cb.Branch) -> list[float]:
    """Half the momentum of an impact along a branch of damped breathers, as a sweep counts it."""
    runs = (point.solution.run() for point in branch)
    return [float(np.abs(r.impacts["before"] - r.impacts["after"]).mean() / 2) for r in runs]


def basin_of_attraction(points: int) -> Basin:
    """Starts of site 0 over displacement and velocity."""
    state = cb.symmetric(a=0.3, gamma=0.05, k=0.8).state(8)
    own = periodic(state, symmetric=True, **ATTRACTOR)
    u = Axis("u", 0, np.linspace(-0.99, 0.99, points))
    v = Axis("v", 0, np.linspace(-3.0, 3.0, points))
    found = attraction(own.state, u, v, periods=120, progress=False, **ATTRACTOR)
    print(f"of {points}^2 starts {found.share:.0%} come back to the breather")
    return found


def main(folder: Path = Path(), points: int = 15) -> list[Path]:
    """Draw both into a folder."""
    with style():
        figure, (above, below) = new_figure(2)
        loop, branch = around_the_fold()
        p, fold = momenta(branch), [point.kind for point in branch].index("LP")
        # stable up to the fold, which belongs to both lines: there they join
        for side, line in ((slice(fold + 1), "-"), (slice(fold, None), "--")):
            above.plot(branch["a"][side], p[side], line, color="black", linewidth=0.9)
        plot_sweep(loop, ax=above)
        plot_basin(basin_of_attraction(points), ax=below)
        return [save_figure(figure, folder / "simulation.png")]


if __name__ == "__main__":
    main()
