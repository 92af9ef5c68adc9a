"""
A hundred uneven chains: how far thresholds scatter
===================================================

No two parts of a chain that somebody has built are the same. Here are a hundred chains of nine
sites whose springs, dampings and restitution are each off by up to ten per cent. Each has a
pitchfork (PF), a grazing (GR), and a threshold of stability (NS) of its own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import contbreather as cb
from contbreather.plotting import new_figure, save_figure, style

SITES, CENTRE, CHAINS = 9, 4, 100
MEANS = {"spring": 0.05, "damping": 0.002, "k": 0.8}
KINDS = ("NS", "PF", "GR")


def uneven(seed: int, spread: float = 0.1) -> dict[str, Any]:
    """Draw the parts of a chain."""
    rng = np.random.default_rng(seed)
    return {name: mean * (1 + spread * rng.uniform(-1, 1, SITES)) for name, mean in MEANS.items()}


def start(parts: dict[str, Any]) -> cb.Orbit:
    """The breather of a chain, where its branch sets out."""
    return cb.symmetric(a=0.3, gamma=0.05, lattice=cb.OpenChain(SITES), site=CENTRE, **parts)


def main(folder: Path = Path(), chains: int = CHAINS, cores: int = 2) -> list[Path]:
    """Draw into a folder where each of many chains has its points, and where the even one."""
    starts = [start(MEANS), *(start(uneven(seed)) for seed in range(chains))]
    way = {"towards": "up", "within": {"a": (0.3, 1.1)}}
    even, *branches = cb.trace_many(starts, "a", **way, executor=cores)
    for kind in KINDS:
        found = values(branches, kind)
        if found.size:
            print(
                f"{kind}: even {values([even], kind)}, {found.size} of {chains} chains, "
                f"mean {found.mean():.6f}, standard deviation {found.std():.6f}"
            )
    with style():
        return [draw(even, branches, folder)]


def values(branches: list[cb.Branch], kind: str) -> Any:
    """Where each branch has its first point of a kind, if it has any."""
    found = [[p["a"] for p in branch.special if p.kind == kind] for branch in branches]
    return np.array([places[0] for places in found if places])


def draw(even: cb.Branch, branches: list[cb.Branch], folder: Path) -> Path:
    """A histogram for each kind of point; a line where the even chain has it."""
    figure, axes = new_figure(1, len(KINDS), width=17.5, height=5.5)
    for ax, kind in zip(axes, KINDS, strict=True):
        found = values(branches, kind)
        ax.hist(found, bins=20)
        for place in values([even], kind):
            ax.axvline(place, color="black", linestyle="--")
        ax.set(title=f"{kind}: {found.size} of {len(branches)} chains", xlabel="$a$")
    axes[0].set_ylabel("chains")
    return save_figure(figure, folder / "disorder.png")


if __name__ == "__main__":
    main()
