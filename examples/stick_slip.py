"""
Stick and slip: dry friction as a Filippov system
=================================================

A mass on a spring is carried along by a belt; friction holds it up to a force F and weakens with
the velocity of slip. The vector fields of a mass that is faster and of one that is slower than the
belt make a `Filippov` system: on the surface between them the mass sticks. A simulation finds the
sequence of flows; stick and slip is a cycle of these, followed here in how fast friction weakens.
How long it sticks has a closed form but for one root.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

import contbreather as cb
from contbreather.plotting import new_figure, save_figure, style

ON = {"F": 1.0, "V": 1.0, "d": 0.1}


def friction(sign: int) -> Any:
    """Faster (+1) or slower (-1) than the belt."""

    def field(t: Any, x: Any, p: Any) -> list[Any]:
        return [x[1], -x[0] - sign * p["F"] + p["d"] * (x[1] - p["V"])]

    return field


BELT = cb.Filippov(friction(1), friction(-1), lambda t, x, p: x[1] - p["V"])


def sticking(d: float, V: float = 1.0) -> float:
    """How long the mass sticks: it slips as z = x - F + d V, z'' - d z' + z = 0, until z' = V."""
    w = math.sqrt(1 - d * d / 4)
    sine = (V - d * d * V / 2) / w

    def z(t: float) -> float:
        return math.exp(d * t / 2) * (d * V * math.cos(w * t) + sine * math.sin(w * t))

    def speed(t: float) -> float:
        growth = w * math.exp(d * t / 2)
        return d / 2 * z(t) + growth * (sine * math.cos(w * t) - d * V * math.sin(w * t))

    slip = brentq(lambda t: speed(t) - V, 3.5, 6.25, xtol=1e-15)
    return (d * V - z(slip)) / V


def branch_in_weakening() -> cb.Branch:
    """The orbit of stick and slip, from a simulation, along the weakening of friction."""
    start = cb.cycle(BELT, start={"x": 0.0, "v": 0.5}, params=ON, settle=40)
    branch = cb.trace(start, "d", within={"d": (0.02, 0.6)}, towards="both", progress=False)
    worst = 0.0
    for at in branch:
        stick = [flow is BELT.to_minus for flow in at.solution.equations.flows].index(True)
        worst = max(worst, abs(at.solution.durations[stick] - sticking(at["d"])))
    print(f"{len(branch)} orbits; the time of sticking is that of the closed form to {worst:.0e}")
    assert worst < 1e-9
    # the longest that a mass can stick: all the way from -F to F at the velocity V of the belt
    (end,) = (at for at in branch.special if at.kind == "SL")
    print(f"from {end.label} at d = {end['d']:.9f} on it comes to the belt too far behind to stick")
    assert abs(sticking(end["d"]) - 2 * ON["F"] / ON["V"]) < 1e-9
    return branch


def main(folder: Path = Path()) -> list[Path]:
    """Draw the approach to the orbit in its phase plane, and its period."""
    with style():
        figure, (above, below) = new_figure(2)
        run = cb.integrate(BELT, {"x": 1.5, "v": 1.5}, ON, time=40)
        print(f"{run}: {sum(flow is BELT.to_minus for flow in run.flows)} times it sticks")
        for piece in run.pieces:
            x, v = piece(np.linspace(piece.t[0], piece.t[-1], 200))
            stuck = piece.flow in (BELT.to_plus, BELT.to_minus)
            above.plot(x, v, color="C1" if stuck else "C0", linewidth=1.5 if stuck else 0.6)
        above.set(xlabel="$x$", ylabel="$\\dot x$")
        branch = branch_in_weakening()
        below.plot(branch["d"], branch["period"], label="period")
        below.plot(branch["d"], [sticking(d) for d in branch["d"]], "--", label="time of sticking")
        below.set(xlabel="$d$", ylim=(0, None))
        below.legend()
        return [save_figure(figure, folder / "stick-slip.png")]


if __name__ == "__main__":
    main()
