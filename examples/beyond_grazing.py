"""
Beyond grazing: neighbours hit their walls
==========================================

Where a neighbour touches its wall a breather ends, at GR, and another orbit begins, in which that
neighbour hits as well. Of the symmetric breather both live on one side, a nonsmooth fold; the arms
of its pitchfork persist, with one impact more at either wall. One diagram follows all these roads,
and in the impulse of the new impact it is seen why nobody sees the fold in an experiment: a
multiplier comes from infinity. A zone diagram says what is in its region beyond GR.
"""

from __future__ import annotations

from pathlib import Path

import contbreather as cb
from contbreather.plotting import new_figure, save_figure, style

WITHIN = {"a": (0.7, 1.0)}


def roads(axes: object) -> None:
    """The breather, its arms, and what they become beyond GR."""
    breather = cb.symmetric(a=0.75, gamma=0.04, k=0.8)
    tree = cb.diagram(breather, "a", within=WITHIN, depth=3, beyond=True)
    for birth, branch in zip(tree.births, tree, strict=True):
        if "beyond" in branch[0].detail:
            impacts = branch[1].solution.section.describe()
            print(
                f"{birth.place.name}: {branch[0]['beyond']} at a = {branch[0]['a']:.12f}, {impacts}"
            )
    cb.plotting.plot_diagram(list(tree), ax=axes)


def jump(axes: object) -> None:
    """The largest multiplier over the impulse of the neighbours, of a damped ring."""
    ring = cb.symmetric(0.9, 0.05, 0.8, damping=0.02, lattice=cb.Ring(9))
    grazing = cb.trace(ring, "a", towards="up").first("GR")
    (arm,) = cb.switch(grazing, within={"a": (0.8, 1)}, steps=cb.Steps(first=1e-4))
    J = [-float(point["J2"]) for point in arm[1:]]
    mu = [abs(point.solution.multipliers(half=True)).max() for point in arm[1:]]
    print(f"|mu| J = {mu[0] * J[0]:.4f} at J = {J[0]:.1e}, {arm[0]['|mu| J']:.4f} at 0")
    axes.loglog(J, mu, "ko", ms=3)
    axes.loglog(J, [arm[0]["|mu| J"] / j for j in J], color="gray", zorder=0)
    axes.set(xlabel="impulse $J$ of a neighbour", ylabel="largest $|\\mu|$ over $\\pi$")


def main(folder: Path = Path()) -> list[Path]:
    """Draw the pictures into a folder."""
    plane = cb.zones(k=0.8, beyond=True)
    zones = cb.save_figure(cb.plotting.plot_zones(plane), folder / "zones-beyond.png")
    with style():
        figure, (left, right) = new_figure(2)
        roads(left)
        jump(right)
        return [save_figure(figure, folder / "beyond.png"), zones]


if __name__ == "__main__":
    main()
