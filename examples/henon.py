"""
Fixed points of maps: Henon, the logistic cascade, a bouncing ball
==================================================================

The map of Henon has all its curves and resonances in closed form, the doublings of the logistic map
are known to many digits, and the bouncing ball doubles its period at a known strength of its table.
What is found is printed beside what is known.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import contbreather as cb
from contbreather.continuation import refined
from contbreather.plotting import new_figure, save_figure, style

Array = NDArray[np.float64]
WINDOW = {"alpha": (-3.0, 4.0), "beta": (-2.0, 3.0)}


def henon(u: Array, p: Mapping[str, float]) -> Array:
    """x' = y, y' = alpha - beta x - y^2."""
    x, y = u
    return np.array([y, p["alpha"] - p["beta"] * x - y * y])


def show(what: str, found: float, known: float) -> None:
    print(f"{what:36} {found:+.12f}  error {abs(found - known):.0e}")
    assert abs(found - known) < 1e-8


def henon_curves() -> dict[str, cb.Branch]:
    """LP, PD and NS in (alpha, beta)."""
    fixed = cb.FixedPoint(henon, {"x": 0.5, "y": 0.5}, {"alpha": 1.0, "beta": 0.5})
    along = cb.trace(fixed, "alpha", within={"alpha": (-3, 4), "y": (-3, 3)})
    across = cb.trace(fixed, "beta", within={"beta": (0, 2)})
    curves = {
        kind: cb.boundary(point, ("alpha", "beta"), within=WINDOW)
        for kind, point in (
            ("LP", along.first("LP")), ("PD", along.first("PD")), ("NS", across.first("NS"))
        )
    }  # fmt: skip
    for kind, alpha in (("R1", -1.0), ("R2", 3.0), ("R3", 1.25), ("R4", 0.0)):
        show(f"Henon, {kind} on NS: alpha", curves["NS"].first(kind)["alpha"], alpha)
    return curves


def logistic_cascade(generations: int = 4) -> list[cb.Branch]:
    """The fixed point of r x (1 - x) and the cycles of period 2, 4, 8, 16 born from it."""
    start = cb.FixedPoint(lambda x, p: p["r"] * x * (1 - x), {"x": 0.6}, {"r": 2.5})
    branches = [cb.trace(start, "r", within={"r": (2.5, 3.6)})]
    for _ in range(generations):
        branches.append(cb.switch(branches[-1].first("PD"), within={"r": (2.5, 3.6)})[0])
    doublings = [branch.first("PD")["r"] for branch in branches]
    show("logistic, period 2 from r", doublings[0], 3.0)
    show("logistic, period 4 from r", doublings[1], 1 + math.sqrt(6))
    gaps = np.diff(doublings)
    ratios = ", ".join(f"{a / b:.4f}" for a, b in itertools.pairwise(gaps))
    print(f"ratios of their distances: {ratios}; Feigenbaum's constant is 4.6692")
    return branches


def bouncing_ball(n: int = 1, r: float = 0.8) -> None:
    """A ball on a table, v' = r v - g cos(phi + v): its bounce of n table periods."""

    def bounce(u: Array, p: Mapping[str, float]) -> Array:
        phi = u[0] + u[1]
        return np.array([phi - 2 * np.pi * n, p["r"] * u[1] - p["g"] * np.cos(phi)])

    ball = cb.FixedPoint(
        bounce,
        {"phi": -math.pi / 2 - 0.6, "v": 2 * math.pi * n},
        {"r": r, "g": 2 * math.pi * n * (1 - r) / math.cos(math.pi / 2 - 0.6)},
    )
    branch = cb.trace(ball, "g", within={"g": (0.1, 12.0), "phi": (-4.0, 0.0)})
    known = 2 * math.sqrt((n * math.pi) ** 2 * (1 - r) ** 2 + (1 + r) ** 2)
    show("bouncing ball, doubling at g", branch.first("PD")["g"], known)


def picture(folder: Path) -> Path:
    """Henon's curves above, the cascade below."""
    figure, (above, below) = new_figure(2)
    cb.plot(*henon_curves().values(), x="alpha", y="beta", ax=above)
    for branch in (refined(branch, 60) for branch in logistic_cascade()):
        cycles = np.array([point.solution.points[:, 0] for point in branch])
        # stable up to the doubling, which belongs to both lines: there they join
        doubling = [point.kind for point in branch].index("PD")
        for side, line in ((slice(doubling + 1), "-"), (slice(doubling, None), "--")):
            below.plot(branch["r"][side], cycles[side], line, color="C0", lw=1)
    below.set(xlabel="$r$", ylabel="points of the cycle")
    bouncing_ball()
    return save_figure(figure, folder / "maps.png")


def main(folder: Path = Path()) -> list[Path]:
    """Draw Henon's curves and the cascade into a folder."""
    with style():
        return [picture(folder)]


if __name__ == "__main__":
    main()
