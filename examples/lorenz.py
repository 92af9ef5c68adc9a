"""
Lorenz's equations: from an equilibrium to a homoclinic orbit
=============================================================

Two equilibria leave the origin at r = 1 and lose their stability in a Hopf point at r = 470/19. The
cycles that are born there are unstable; followed to smaller r they pass the origin ever more
closely and slowly, until they end at HOM, an orbit that leaves the origin and comes back to it. How
r goes to its limit is known: as exp(-8 T/3) of the period T, with the weakest eigenvalue there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import contbreather as cb
from contbreather.plotting import new_figure, plot_orbit, save_figure, style
from contbreather.plotting.canvas import CYCLE

B = 8 / 3
HOMOCLINIC = 13.926557407  # published


def lorenz(t: Any, x: Any, p: Any) -> list[Any]:
    """x' = f(t, x, p), as for scipy's integrators."""
    X, Y, Z = x
    return [p["s"] * (Y - X), X * (p["r"] - Z) - Y, X * Y - p["b"] * Z]


def branches() -> tuple[cb.Branch, cb.Branch]:
    """The equilibria, and the cycles from their Hopf point on, up to where they come to rest."""
    rest = cb.equilibrium(lorenz, {"x": 8.0, "y": 8.0, "z": 27.0}, {"r": 28.0, "s": 10.0, "b": B})
    equilibria = cb.trace(rest, "r", within={"r": (0.5, 30)}, progress=False)
    for point in equilibria.special:
        print(f"{point.label}: r = {point['r']:.9f}, x = {point['x']:+.6f}")
    hopf = equilibria.first("HB2")
    print("the Hopf point is", hopf.detail["criticality"])
    assert abs(hopf["r"] - 470 / 19) < 1e-9
    (cycles,) = cb.switch(hopf, within={"r": (1, 30)}, progress=False)
    return equilibria, cycles


def main(folder: Path = Path()) -> list[Path]:
    """Draw equilibria and cycles, their period, and the cycles on their way to the origin."""
    equilibria, cycles = branches()
    end = cycles.first("HOM")
    found = end["r"]
    print(f"homoclinic orbit at r = {found:.8f}, published {HOMOCLINIC}:")
    print(end.detail["said"])
    assert abs(found - HOMOCLINIC) < 1e-5
    near = np.geomspace(1e-4, 1.0, 50)
    at = int(np.searchsorted(cycles["period"], 4.0))
    slope = cycles["period"][at] + np.log((cycles["r"][at] - HOMOCLINIC) / near) / B
    with style():
        figure, (above, middle, below) = new_figure(3)
        cb.plot(equilibria, cycles, x="r", y="x", ax=above)
        middle.semilogx(cycles["r"] - HOMOCLINIC, cycles["period"])
        middle.plot(near, slope, "--", label="$-\\frac{3}{8}\\,\\log(r - r_h)$")
        middle.set(xlabel="$r - r_h$", ylabel="period")
        middle.legend()
        for wanted, colour in zip((0.7, 0.9, 1.2, 2.0, end["period"]), CYCLE, strict=False):
            cycle = cycles[int(np.searchsorted(cycles["period"], wanted))]
            plot_orbit(cycle, x="x", y="z", ax=below)[0].set(
                color=colour, label=f"{cycle['period']:.2f}"
            )
        below.legend(title="period", loc="lower right")
    return [save_figure(figure, folder / "lorenz.png")]


if __name__ == "__main__":
    main()
