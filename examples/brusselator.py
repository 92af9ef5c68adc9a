"""
A partial differential equation: from a Hopf point to its cycles
================================================================

Two chemicals that react and diffuse on a line of length L, the Brusselator, with concentrations
that are held at both ends. Cells make of it a large system of ordinary differential equations, in
each of which few states meet: given the pattern of the derivative, equilibria and cycles are solved
for by sparse factorisations. The line is at rest until it is long enough for its first mode to
oscillate, at a length that is known in closed form, for the cells as for the line itself.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import block_array, diags_array, eye_array

import contbreather as cb
from contbreather.plotting import new_figure, save_figure, style

CELLS, A, B = 24, 2.0, 5.45
D = {"D1": 0.008, "D2": 0.004}


def diffused(x: Any, edge: float) -> Any:
    """Second differences of states, the rows of `x`, between ends that are held."""
    end = np.full((1, *x.shape[1:]), edge)
    return np.diff(np.concatenate([end, x, end]), n=2, axis=0) * (len(x) + 1) ** 2


def brusselator(cells: int, t: Any, x: Any, p: Any) -> Any:
    """x' = f(t, x, p), as for scipy's integrators: u in all cells, then v in all cells."""
    u, v = x[:cells], x[cells:]
    reaction, scale = u * u * v, p["L"] ** -2
    return np.concatenate(
        [
            p["D1"] * scale * diffused(u, A) + A - (B + 1) * u + reaction,
            p["D2"] * scale * diffused(v, B / A) + B * u - reaction,
        ]
    )


def pattern(cells: int) -> Any:
    """Which states each equation contains: its neighbours, and the other one of its cell."""
    ones = np.ones(cells)
    near, here = diags_array([ones[1:], ones, ones[1:]], offsets=(-1, 0, 1)), eye_array(cells)
    return block_array([[near, here], [here, near]])


def main(folder: Path = Path()) -> list[Path]:
    """Draw how the amplitude grows with the length, and one cycle over space and time."""
    rest = cb.equilibrium(
        partial(brusselator, CELLS),
        start={"u": np.full(CELLS, A), "v": np.full(CELLS, B / A)}, params={"L": 0.45, **D},
        jacobian=pattern(CELLS), collocation=cb.Collocation(intervals=10, points=4),
    )  # fmt: skip
    born = cb.trace(rest, "L", within={"L": (0.45, 0.6)}, progress=False).first("HB")
    k = 2 * (CELLS + 1) * np.sin(0.5 * np.pi / (CELLS + 1))  # of the first mode, by differences
    length = k * np.sqrt(sum(D.values()) / (B - 1 - A**2))
    print(f"oscillations begin at L = {born['L']:.10f}; in closed form {length:.10f}")
    assert abs(born["L"] - length) < 1e-9
    (cycles,) = cb.switch(born, within={"L": (0.45, 0.53)}, progress=False)
    last = cycles[-1]
    print(f"at L = {last['L']:.2f} the period is {last['period']:.6f}")
    shown = ", ".join(f"{abs(mu):.4f}" for mu in last.solution.multipliers[:4])
    print(f"leading multipliers in modulus: {shown}")

    with style():
        figure, (above, below) = new_figure(2)
        above.plot(cycles["L"], cycles["max(u)"], cycles["L"], cycles["min(u)"], color="C0")
        above.plot([0.45, 0.53], [A, A], "--", color="0.5")
        above.set(xlabel="$L$", ylabel="extremes of $u$")
        t = np.linspace(0, last["period"], 200)
        states = last.solution.states(t)[:CELLS]
        below.pcolormesh(t, np.arange(1, CELLS + 1) / (CELLS + 1), states, shading="auto")
        below.set(xlabel="$t$", ylabel="$x / L$")
        return [save_figure(figure, folder / "brusselator.png")]


if __name__ == "__main__":
    main()
