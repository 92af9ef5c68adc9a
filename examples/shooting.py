"""
Shooting on rings: both arms of a pitchfork, and a cascade
==========================================================

On a ring of 20 the symmetric breather is shot from impact to impact. At its pitchfork both arms
set out and end where the neighbour comes to touch its wall. On a single oscillator the same arms go
on to double their period, again and again.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

import contbreather as cb
from contbreather.continuation import refined
from contbreather.plotting import new_figure, save_figure, style


def arms_on_a_ring() -> list[cb.Branch]:
    """The symmetric branch on a ring of 20, and both arms."""
    start = cb.shooting(cb.symmetric(a=0.7, gamma=0.04, k=0.8), sites=20, symmetric=False)
    branch = cb.trace(start, "a", within={"a": (0.7, 0.9)})
    arms = cb.switch(branch.first("BP"), within={"a": (0.7, 0.9)})
    for arm in arms:
        print(f"the arm to asymmetry {arm[-1]['asymmetry']:+.6f} ends at {arm[-1]['a']:.9f}:")
        print(f"  {arm[-1].solution.admissibility().reason}")
    return [branch, *arms]


def cascade(generations: int = 3) -> list[cb.Branch]:
    """Orbits of the single oscillator with the periods 2 pi, 4 pi, 8 pi, ... of one arm."""
    start = cb.shooting(cb.symmetric(a=0.6, gamma=0.0, k=0.8, lattice=cb.Ring(1)))
    symmetric = cb.trace(start, "a", within={"a": (0.6, 0.8)})
    print(f"single oscillator: pitchfork at a = {symmetric.first('PF')['a']:.12f}")
    within = {"a": (0.6, 1.0)}
    branches = [symmetric, cb.switch(symmetric.first("PF"), within=within)[0]]
    for _ in range(generations):
        branches += cb.switch(branches[-1].first("PD"), within=within)
    doublings = [branch.first("PD")["a"] for branch in branches[1:]]
    for i, a in enumerate(doublings):
        print(f"period {2 ** (i + 1)} pi doubles at a = {a:.12f}")
    gaps = np.diff(doublings)
    ratios = [f"{before / after:.4f}" for before, after in itertools.pairwise(gaps)]
    print(f"ratios of their distances: {', '.join(ratios)}; Feigenbaum's constant is 4.6692")
    return branches


def main(folder: Path = Path()) -> list[Path]:
    """Draw the arms and the cascade into a folder."""
    with style():
        figure, (above, below) = new_figure(2)
        cb.plotting.plot_diagram(arms_on_a_ring(), x="a", y="asymmetry", ax=above)
        above.set(ylabel="$t_2 - t_1 - \\pi$", xticks=np.arange(0.7, 0.91, 0.05))
        for i, branch in enumerate(refined(branch, 60) for branch in cascade()[1:]):
            # half the momentum of every impact on the wall at +1
            p = [
                [0.5 * (hit.before - hit.after) for hit in point.solution.hits if hit.wall > 0]
                for point in branch
            ]
            # stable up to the doubling, which belongs to both lines: there they join
            doubling = [point.kind for point in branch].index("PD")
            for side, line in ((slice(doubling + 1), "-"), (slice(doubling, None), "--")):
                below.plot(branch["a"][side], p[side], line, color=f"C{i}", lw=1)
        below.set(xlabel="$a$", ylabel="$p$ of impacts on +1", xlim=(0.9, 1.0), ylim=(1.22, 1.54))
        return [save_figure(figure, folder / "shooting.png")]


if __name__ == "__main__":
    main()
