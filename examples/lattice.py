"""
On a grid: breathers of one site and of two
===========================================

The same breather on a square lattice, with some damping, and its branch in the amplitude of the
forcing. Then two sites hit their walls together: that orbit is continued from the uncoupled grid.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import contbreather as cb
from contbreather.plotting import new_figure, save_figure, style

SIDE = 9
GRID = cb.Grid(SIDE, SIDE)
CENTRE = GRID.sites // 2
ON = {"a": 0.5, "gamma": 0.03, "k": 0.8, "lattice": GRID, "damping": 0.02}


def main(folder: Path = Path()) -> list[Path]:
    """Draw both breathers and the branch of the first into a folder."""
    one = cb.symmetric(**ON, site=CENTRE)
    print(one.admissibility().reason)
    print(one.stability())
    branch = cb.trace(one, "a", within={"a": (0.1, 0.99)})
    for point in branch.special:
        print(f"{point.label}: a = {point['a']:.9f}")

    two = cb.multibreather([CENTRE - 1, CENTRE + 1], **ON)
    print(f"two sites: {two.stability()}")
    with style():
        return [draw(one, two, branch, folder)]


def draw(one: cb.Orbit, two: cb.Orbit, branch: cb.Branch, folder: Path) -> Path:
    """Profiles of both beside the branch."""
    figure, axes = new_figure(1, 3, width=17.5, height=6)
    n = np.arange(GRID.sites)
    for ax, orbit, title in zip(axes, (one, two), ("one site", "two sites"), strict=False):
        # just when a wall is hit, what is left when the forced motion of a far site is taken out
        u = orbit.displacement(n, orbit.times[0])
        shown = np.log10(np.abs(u - u[0]) + 1e-12).reshape(SIDE, SIDE)
        image = ax.imshow(shown, vmin=-5, vmax=0, cmap="cividis")
        ax.set(title=title, xticks=[], yticks=[])
    figure.colorbar(image, ax=axes[:2], label=r"$\log_{10} |u_n - u_0|$", shrink=0.8)
    axes[2].margins(0.08)  # room for the names of points
    cb.plot(branch, x="a", y="p", ax=axes[2])
    return save_figure(figure, folder / "lattice.png")


if __name__ == "__main__":
    main()
