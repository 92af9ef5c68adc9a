"""
An impact oscillator: grazing from both sides, and its doublings
================================================================

A forced linear oscillator meets a wall and keeps e of its speed. The orbit that does not reach the
wall is known in closed form, and so is where it begins to touch: GR. There, too, the orbit of one
impact a period loses its impact: VI. On its way there from lower frequencies that one doubles its
period, and what is born so doubles again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

import contbreather as cb
from contbreather.plotting import new_figure, plot_orbit, save_figure, style

PARAMS = {"z": 0.02, "e": 0.8, "s": 0.1, "w": 2.2}  # damping, restitution, wall, frequency
START = {"x": -0.2, "v": 0.0}
MESH = {"collocation": cb.Collocation(intervals=8)}
WINDOW = {"w": (2.1, 4.2)}


def field(t: Any, x: Any, p: Any) -> list[Any]:
    return [x[1], -2 * p["z"] * x[1] - x[0] + np.cos(p["w"] * t)]


def to_the_wall(t: Any, x: Any, p: Any) -> Any:
    return p["s"] - x[0]


def rebound(t: Any, x: Any, p: Any) -> list[Any]:
    return [p["s"], -p["e"] * x[1]]


HITS = cb.Flow(field, until=to_the_wall, reset=rebound)
FREE = cb.Flow(field, walls=(HITS,))


def turn(p: Any) -> Any:
    """The period of the forcing."""
    return 2 * np.pi / p["w"]


def oscillating(w: float) -> dict[str, float]:
    """The state of the free oscillation at the time 0."""
    x = 1 / (1 - w * w + 2j * PARAMS["z"] * w)
    return {"x": x.real, "v": -w * x.imag}


def touching() -> float:
    """The frequency at which the free oscillation has the amplitude s."""
    z, s = PARAMS["z"], PARAMS["s"]
    return float(brentq(lambda w: s * np.hypot(1 - w * w, 2 * z * w) - 1, 2.0, 5.0, xtol=1e-14))


def branches() -> tuple[cb.Branch, cb.Branch, cb.Branch]:
    """No impact, one impact a period, and two in two periods."""
    free = cb.trace(
        cb.cycle(FREE, start=oscillating(3.8), params={**PARAMS, "w": 3.8}, period=turn, **MESH),
        "w", within=WINDOW, towards="both", progress=False,
    )  # fmt: skip
    hitting = cb.trace(
        cb.cycle([HITS], start=START, params=PARAMS, period=turn, settle=30, **MESH),
        "w", within=WINDOW, towards="both", progress=False,
    )  # fmt: skip
    grazing, vanishing = free.first("GR")["w"], hitting.first("VI")["w"]
    print(f"the wall is touched from w = {grazing:.9f} on; in closed form {touching():.9f}")
    print(f"the impact vanishes at   w = {vanishing:.9f}")
    assert abs(grazing - touching()) < 1e-8
    assert abs(vanishing - touching()) < 1e-8
    (gone,) = cb.switch(hitting.first("VI"), within=WINDOW, progress=False)
    (begun,) = cb.switch(free.first("GR"), within=WINDOW, progress=False)
    print(f"beyond, from either side: {gone[0]['beyond']}, {begun[0]['beyond']}")
    doubling = hitting.first("PD")
    mu = doubling.solution.multipliers
    print(f"period doubling at w = {doubling['w']:.9f}, multipliers {np.round(mu.real, 9)}")
    # areas shrink by exp(-2 z T) in flight, and by e squared at an impact
    product = PARAMS["e"] ** 2 * np.exp(-2 * PARAMS["z"] * turn({"w": doubling["w"]}))
    assert abs(np.prod(mu) - product) < 1e-9
    (double,) = cb.switch(doubling, within={"w": (2.3, 2.6)}, progress=False)
    print(f"and once more at     w = {double.first('PD')['w']:.9f}")
    return free, hitting, double


def main(folder: Path = Path()) -> list[Path]:
    """Draw the branches by how far they swing, and one orbit of each in its phase plane."""
    free, hitting, double = branches()
    with style():
        figure, (above, below) = new_figure(2)
        cb.plot(free, hitting, double, x="w", y="min(x)", ax=above)
        for at, colour in ((free[-1], "C0"), (hitting.first("PD"), "C1"), (double[-1], "C2")):
            for artist in plot_orbit(at, x="x", y="v", ax=below):
                artist.set_color(colour)
        below.axvline(PARAMS["s"], color="grey", linewidth=0.8, zorder=0)
    return [save_figure(figure, folder / "impact-oscillator.png")]


if __name__ == "__main__":
    main()
