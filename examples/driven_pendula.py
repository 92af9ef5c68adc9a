"""
Driven pendula: one that swings high among others that hardly move
==================================================================

Pendula on a common axis, each held to its neighbours by a torsional spring, are shaken below the
frequency of their small oscillations. There each has two responses, and one of them on the high one
is a breather. Along the frequency it folds, into one that is unstable.
"""

from __future__ import annotations

from pathlib import Path

import contbreather as cb
from contbreather.plotting import new_figure, plot_profile, save_figure, style


def main(folder: Path = Path()) -> list[Path]:
    """Draw the response of the breather over the frequency, and its profile."""
    pendula = cb.Oscillators(
        V="1 - cos(u)", W="c*r**2/2", lattice=cb.OpenChain(5), damping="d", drive="a*cos(omega*t)"
    )
    params = {"c": 0.01, "d": 0.04, "a": 0.06}
    start = cb.breather(pendula, {2: "high"}, omega=0.85, params=params)
    branch = cb.trace(
        start, "omega", within={"omega": (0.74, 0.92)}, events=[cb.fold()], progress=False
    )
    run = cb.integrate(start, periods=40, perturb=1e-3)
    off = abs(run.final - start.solution.states(0.0)).max()
    print(f"largest multiplier {start.solution.largest:.6f}; after 40 periods {off:.1e} off")
    with style():
        figure, panels = new_figure(1, 2, width=13.0)
        cb.plot(branch, x="omega", y="max|u|", ax=panels[0])
        plot_profile(start, ax=panels[1])
    return [save_figure(figure, folder / "pendula.png")]


if __name__ == "__main__":
    main()
