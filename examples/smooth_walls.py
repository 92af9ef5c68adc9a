"""
Smooth walls: the branch of (21) over the exact one
===================================================

On a damped ring of 6 the periodic motion between smooth walls is followed in the amplitude, for
walls of three hardnesses, beside that between rigid walls and the exact breather of the undamped
infinite chain. Each ends in a fold; the harder the wall, the closer to the rigid one. Then m itself
is the parameter, and the fold is followed in both.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import contbreather as cb
from contbreather.continuation import refined
from contbreather.plotting import new_figure, save_figure, style
from contbreather.simulation import periodic

SETTINGS = {"a": 0.3, "gamma": 0.04, "k": 0.8, "damping": 0.005}
WINDOW = {"a": (0.06, 0.3)}
SITES = 6


def branches(hardnesses: tuple[int, ...]) -> dict[str, cb.Branch]:
    """The branch in a for each m, and for rigid walls, through both sides of its fold."""
    state = cb.symmetric(a=0.3, gamma=0.04, k=0.8).state(SITES)
    starts = {f"m = {m}": periodic(state, m=m, symmetric=True, **SETTINGS) for m in hardnesses}
    starts["rigid"] = periodic(state, symmetric=True, **SETTINGS)
    found = {}
    for name, start in starts.items():
        found[name] = cb.trace(start, "a", within=WINDOW, towards="down", progress=False)
        print(f"{name}: fold at a = {found[name].first('LP')['a']:.6f}")
    return found


def main(folder: Path = Path(), hardnesses: tuple[int, ...] = (6,), points: int = 2) -> list[Path]:
    """Draw the branches (with at least so many points), and the folds in (m, a)."""
    found = branches(hardnesses)
    exact = cb.trace(cb.symmetric(a=0.3, gamma=0.04, k=0.8), "a", within=WINDOW, progress=False)
    exact = refined(exact, 60)
    height = [point.solution.displacement(0, 0.0) for point in exact]
    fold = found[f"m = {hardnesses[0]}"].first("LP")
    line = cb.boundary(
        fold, ("m", "a"), within={"m": (hardnesses[0], 60)},
        steps=cb.Steps(largest=4), progress=False,
    )  # fmt: skip
    print(f"the fold goes from a = {line[0]['a']:.6f} at m = {line[0]['m']:.0f}", end=" ")
    print(f"to {line[-1]['a']:.6f} at m = {line[-1]['m']:.0f}")

    with style():
        figure, (above, below) = new_figure(2)
        for name, branch in found.items():
            fine, look = refined(branch, points), {"label": name.replace("m", "$m$")}
            if name == "rigid":
                look = {"label": "rigid walls", "color": "black", "linestyle": "--"}
            above.plot(fine["a"], np.asarray(fine["u"])[:, 0], **look)
        above.plot(exact["a"], height, "k:", label="rigid, infinite chain")
        above.set(xlabel="$a$", ylabel="$u_0(0)$")
        above.legend()
        line = refined(line, points)
        below.plot(line["m"], line["a"])
        below.axhline(found["rigid"].first("LP")["a"], color="black", linestyle="--")
        below.set(xlabel="$m$", ylabel="$a$ of the fold")
        return [save_figure(figure, folder / "smooth-walls.png")]


if __name__ == "__main__":
    main()
