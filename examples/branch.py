"""
One branch of breathers, and the curve of one of its bifurcations
=================================================================

A breather at one point, all breathers along the forcing amplitude, and the pitchfork on the way
as a curve in two parameters. On the branch: a fold (LP), a pitchfork (PF), and the grazing of
a neighbour (GR), beyond which there is no breather.
"""

from __future__ import annotations

from pathlib import Path

import contbreather as cb
from contbreather.plotting import new_figure, plot_multipliers, save_figure, style


def main(folder: Path = Path()) -> list[Path]:
    """Draw the branch, its pitchfork line and the multipliers on both sides into a folder."""
    breather = cb.symmetric(a=0.5, gamma=0.04, k=0.8)
    print(f"p = {breather.p:.12f}, phi = {breather.phi:.12f}")
    print(breather.admissibility().reason)
    print(breather.stability().describe())

    branch = cb.trace(breather, "a", within={"a": (0.0, 0.999)})
    for point in branch.special:
        print(f"{point.label}: a = {point['a']:.12f}, p = {point['p']:.12f}")

    # Any special point can be followed in two parameters.
    pitchforks = cb.boundary(branch.first("PF"), ("gamma", "a"), within={"gamma": (0.0, 0.25)})

    with style():
        figure, (above, below) = new_figure(2)
        cb.plot(branch, x="a", y="p", ax=above)
        cb.plot(pitchforks, ax=below)

        # The multiplier that leaves the unit circle at +1 of the half map.
        beyond = cb.symmetric(a=0.82, gamma=0.04, k=0.8)
        return [
            save_figure(figure, folder / "branch.png"),
            save_figure(plot_multipliers(beyond, half=True), folder / "multipliers.png"),
        ]


if __name__ == "__main__":
    main()
