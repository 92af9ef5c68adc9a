"""
Hénon and Heiles: families in the energy, and what leaves them
==============================================================

A star in a galaxy with a symmetry of three, as M. Hénon and C. Heiles wrote it down in 1964. The
orbit along one of the axes of symmetry is one of a family in the energy, up to that at which the
star may escape. Next to that energy it loses and regains its stability ever faster; where a
multiplier is 1 another family crosses it, and that has the star move off the axis.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import contbreather as cb
from contbreather.plotting import new_figure, plot_orbit, save_figure, style


def field(t: Any, z: Any, p: Any) -> list[Any]:
    """Positions, and then velocities."""
    x, y, u, v = z
    return [u, v, -x - 2 * x * y, -y - x**2 + y**2]


def energy(z: Any, p: Any) -> Any:
    """The energy, which is conserved; the star may escape from 1/6 on."""
    x, y, u, v = z
    return (u**2 + v**2 + x**2 + y**2) / 2 + x**2 * y - y**3 / 3


def main(folder: Path = Path()) -> list[Path]:
    """Draw the family over the energy, and an orbit that has left the axis."""
    start = cb.cycle(field, {"x": 0.0, "y": 0.3, "u": 0.0, "v": 0.0}, {}, conserves=energy)
    axis = cb.trace(start, "energy", within={"energy": (0.02, 0.166)}, progress=False)
    print(", ".join(f"{point.label} at {point['energy']:.7f}" for point in axis.special))
    arms = cb.switch(
        axis.first("BP"), within={"energy": (0.1, 0.18)}, steps=cb.Steps(most=20), progress=False
    )
    with style():
        figure, panels = new_figure(1, 2, width=13.0)
        cb.plot(axis, *arms, x="energy", y="period", ax=panels[0])
        for point, colour in ((axis[-1], "C0"), (arms[0][-1], "C1")):
            plot_orbit(point, x="x", y="y", ax=panels[1])[0].set_color(colour)
    return [save_figure(figure, folder / "henon_heiles.png")]


if __name__ == "__main__":
    main()
