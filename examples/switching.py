"""
Switching: the arms of a pitchfork, and where their period doubles
==================================================================

At its pitchfork the symmetric breather gives way to two mirror images of an asymmetric one. Both
arms are followed to their end, beside the parabola of the normal form. Then, for impacts that are
nearly elastic, the boundaries of pitchfork, period doubling and grazing, on the infinite chain and
on a ring.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import contbreather as cb
from contbreather.continuation import refined
from contbreather.plotting import new_figure, save_figure, style

WITHIN = {"gamma": (0.0, 0.08), "a": (0.0, 1.0)}
COLOURS = {"PF": "C0", "PD": "C1", "GR": "C2"}


def arms(folder: Path) -> Path:
    """The symmetric branch and both arms, p and asymmetry."""
    branch = cb.trace(cb.symmetric(a=0.5, gamma=0.04, k=0.8), "a", within={"a": (0.5, 1.0)})
    point = branch.first("PF")
    both = cb.switch(point)
    print(f"pitchfork at a = {point['a']:.12f}, {point['criticality']}")
    for arm in both:
        print(f"an arm ends at a = {arm[-1]['a']:.12f}: {arm[-1].admissibility().reason}")
    figure, (above, below) = new_figure(2)
    cb.plotting.plot_diagram([branch, *both], y="p", ax=above)
    cb.plotting.plot_diagram([branch, *both], y="asymmetry", ax=below)
    delta = np.linspace(-0.9, 0.9, 101)
    below.plot(point["a"] + delta**2 / point["coefficient"], delta, ":", color="0.5", lw=1)
    below.set(ylabel="$t_2 - t_1 - \\pi$", xlim=above.get_xlim())
    return save_figure(figure, folder / "switching.png")


def lines(start: object) -> dict[str, cb.Branch]:
    """Boundaries in (gamma, a), each from its point on the branch or on an arm."""
    branch = cb.trace(start, "a", within={"a": (0.5, 0.99)})
    arm = cb.switch(branch.first("PF"), within={"a": (0.5, 0.99)})[0]
    points = {kind: (branch if kind == "PF" else arm).first(kind) for kind in COLOURS}
    return {kind: cb.boundary(p, ("gamma", "a"), within=WITHIN) for kind, p in points.items()}


def doubling(folder: Path) -> Path:
    """k = 0.95: where the period doubling comes before grazing."""
    breather = cb.symmetric(a=0.6, gamma=0.005, k=0.95)
    chain, ring = lines(breather), lines(cb.shooting(breather, sites=20))
    for name, found in (("infinite chain", chain), ("ring of 20", ring)):
        meeting = found["PD"].first("PD-GR")
        print(f"{name}: PD meets GR at gamma = {meeting['gamma']:.12f}, a = {meeting['a']:.12f}")
    figure, (axes,) = new_figure()
    for kind, line in chain.items():
        fine = refined(line, 30)
        axes.plot(fine["gamma"], fine["a"], color=COLOURS[kind], label=f"{kind}, infinite chain")
    for kind, line in ring.items():
        label = "ring of 20" if kind == "PF" else None
        axes.plot(line["gamma"], line["a"], "k.", ms=4, label=label)
    small = {"fontsize": "small"}
    axes.text(0.004, 0.62, "symmetric breather", **small)
    axes.text(0.012, 0.83, "asymmetric breathers, $2\\pi$", **small)
    axes.text(0.0015, 0.932, "$4\\pi$", **small)
    axes.text(0.047, 0.95, "neighbour hits wall", **small)
    axes.set(xlabel="$\\gamma$", ylabel="$a$", xlim=(0, 0.08), ylim=(0.55, 1.02))
    axes.legend(loc="lower right", **small)
    return save_figure(figure, folder / "doubling.png")


def main(folder: Path = Path()) -> list[Path]:
    """Draw both pictures into a folder."""
    with style():
        return [arms(folder), doubling(folder)]


if __name__ == "__main__":
    main()
