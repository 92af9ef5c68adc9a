"""
A bouncing ball: its fold, its doublings, and chaos between them
================================================================

A ball falls on a table that moves as A sin t and keeps e of its speed. One flow with a condition
that ends it and a reset describes it. The orbit that bounces once a period begins in a fold at
A = pi (1 - e)/(1 + e) and doubles where A sin(phase) = 2 (1 + e^2)/(1 + e)^2. The doubled ones are
followed from there, beside simulations.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

import contbreather as cb
from contbreather.plotting import new_figure, save_figure, style

WITHIN = {"A": (0.3, 1.3)}


def fall(t: Any, x: Any, p: Any) -> list[Any]:
    """Height and velocity, in units in which gravity is 1."""
    return [x[1], -1.0]


def above_table(t: Any, x: Any, p: Any) -> Any:
    return x[0] - p["A"] * np.sin(t)


def bounce(t: Any, x: Any, p: Any) -> list[Any]:
    """The velocity relative to the table is turned around, e of it is left."""
    return [p["A"] * np.sin(t), -p["e"] * x[1] + (1 + p["e"]) * p["A"] * np.cos(t)]


BALL = cb.Flow(fall, until=above_table, reset=bounce)


def show(what: str, found: float, known: float) -> None:
    print(f"{what:22} {found:.12f}  error {abs(found - known):.0e}")
    assert abs(found - known) < 1e-8


def families(e: float = 0.8, generations: int = 3) -> list[cb.Branch]:
    """The orbit of one bounce and those of 2, 4, ... that are born at its doublings."""
    ball = cb.cycle(
        BALL, start={"y": 0.5, "v": 3.1}, params={"A": 0.6, "e": e},
        period=2 * np.pi, t0=0.9, settle=40,
    )  # fmt: skip
    branches = [cb.trace(ball, "A", within=WITHIN, towards="both", progress=False)]
    contact = math.pi * (1 - e) / (1 + e)
    doubling = math.hypot(contact, 2 * (1 + e**2) / (1 + e) ** 2)
    show("fold at A =", branches[0].first("LP")["A"], contact)
    show("first doubling at A =", branches[0].first("PD")["A"], doubling)
    for _ in range(generations):
        branches.append(cb.switch(branches[-1].first("PD"), within=WITHIN, progress=False)[0])
    doublings = [branch.first("PD")["A"] for branch in branches[:-1]]
    print("doublings at A =", ", ".join(f"{A:.8f}" for A in doublings))
    return branches


def phases(orbit: Any) -> Any:
    """When the ball is on the table, in fractions of the period of the table."""
    return np.mod(orbit.times[:-1] / (2 * np.pi) + 0.25, 1.0)


def simulated(forces: Any, e: float = 0.8) -> tuple[list[float], list[float]]:
    """The phases of the last bounces of a simulation, for each strength of the table."""
    where, when = [], []
    for A in forces:
        phase = math.acos(math.pi * (1 - e) / (1 + e) / A)  # beside the orbit of one bounce
        start = [A * math.sin(phase), 3.2]
        run = cb.integrate(BALL, start, {"A": A, "e": e}, events=70, t0=phase)
        times = np.array([event.time for event in run.events[-40:]])
        where += [A] * times.size
        when += np.mod(times / (2 * np.pi) + 0.25, 1.0).tolist()
    return where, when


def main(folder: Path = Path(), points: int = 9) -> list[Path]:
    """Draw the families over simulations, and the ball of period 2 in flight."""
    with style():
        figure, (above, below) = new_figure(2)
        branches = families()
        above.plot(*simulated(np.linspace(1.03, 1.27, points)), ".", color="grey", markersize=1.5)
        for branch, color in zip(branches, ("C0", "C1", "C2", "C3"), strict=True):
            stable = branch["unstable"] == 0
            when = np.array([phases(at.solution) for at in branch])
            for line in when.T:
                above.plot(branch["A"], line, "--", color=color, linewidth=0.5)
                above.plot(branch["A"], np.where(stable, line, np.nan), color=color, linewidth=1.2)
        above.set(xlabel="$A$", ylabel="phase of the impacts / $2\\pi + 1/4$")
        twice = branches[1][len(branches[1]) // 2]
        t = np.linspace(0, 8 * np.pi, 1000)
        below.plot(t, twice.solution.states(t)[0], color="C1", linewidth=0.9)
        below.fill_between(t, twice["A"] * np.sin(t), -2, color="lightgrey", linewidth=0)
        below.set(xlabel="$t$", ylabel="height", ylim=(-2, None), xlim=(0, t[-1]))
        below.set_title(f"$A = {twice['A']:.3f}$: period $4\\pi$", fontsize="small")
        return [save_figure(figure, folder / "bouncing-ball.png")]


if __name__ == "__main__":
    main()
