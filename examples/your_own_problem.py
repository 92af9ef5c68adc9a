"""
Your own F(x, p) = 0
====================

The equilibria of Lorenz's equations with one term more, a constant push h on the first of them:
a branch point, a fold, Hopf points and a cusp. What is found is printed beside what is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import contbreather as cb


def lorenz(x: NDArray[np.float64], params: Mapping[str, float]) -> NDArray[np.float64]:
    """As many equations as unknowns, in the order of `start`."""
    X, Y, Z = x
    return np.array(
        [
            params["sigma"] * (Y - X) + params["h"],
            X * (params["rho"] - Z) - Y,
            X * Y - params["beta"] * Z,
        ]
    )


def unstable(point: cb.continuation.Point) -> int:
    """Eigenvalues of the Jacobian with a positive real part; drawn solid where there is none."""
    own = point.jacobian()[:, : len(point.x)]  # the last column belongs to the free parameter
    return int((np.linalg.eigvals(own).real > 0).sum())


EQUILIBRIA = cb.Problem(
    lorenz,
    start={"x": 8.0, "y": 8.0, "z": 27.0},  # near a solution is near enough
    params={"rho": 28.0, "sigma": 10.0, "beta": 8 / 3, "h": 0.0},
    events=(cb.fold(), cb.branch_point(), cb.hopf()),
    record={"unstable": unstable},
    label="Lorenz equilibria",
)


def show(found: float, known: float, what: str) -> None:
    print(f"{what:32} {found:.12f}  error {abs(found - known):.0e}")
    assert abs(found - known) < 1e-9


def main(folder: Path = Path()) -> list[Path]:
    """Draw the branches into a folder."""
    # A branch: down from rho = 28 on one side, through the branch point, up again on the other.
    window = {"rho": (0.0, 30.0)}
    sides = cb.trace(EQUILIBRIA, "rho", within=window)
    rest = cb.trace(EQUILIBRIA.at(x=0.0, y=0.0, z=0.0, rho=0.5), "rho", within=window)
    show(sides.first("BP")["rho"], 1.0, "branch point, rho")
    show(sides.first("HB")["rho"], 10 * (10 + 8 / 3 + 3) / (10 - 8 / 3 - 1), "Hopf point, rho")

    # The push takes the branch point apart: one branch goes through, the other turns at a fold.
    through = cb.trace(EQUILIBRIA.at(h=10.0), "rho", within=window)
    turning = cb.trace(EQUILIBRIA.at(h=10.0, x=-8.0, y=-8.0), "rho", within=window)
    assert [point.kind for point in through.special] == ["EP", "HB", "EP"]

    # Both kinds of point as curves in two parameters; the cusp on the curve of folds is passed.
    folds = cb.boundary(turning.first("LP"), ("h", "rho"), within={"h": (-10.0, 10.0)})
    show(folds.first("CP")["rho"], 1.0, "cusp, rho")
    hopf = cb.boundary(
        sides.first("HB"), ("beta", "rho"), within={"beta": (0.1, 5.0)}, steps=cb.Steps(largest=1.0)
    )
    beta = hopf["beta"]
    worst = abs(hopf["rho"] - 10 * (13 + beta) / (9 - beta)).max()
    show(worst, 0.0, "Hopf curve, largest error")

    drawn = cb.plot(sides, rest, turning, through, x="rho", y="x")
    return [cb.save_figure(drawn, folder / "lorenz.png")]


if __name__ == "__main__":
    main()
