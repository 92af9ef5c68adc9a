"""
A forced pendulum: resonance, symmetry and its loss, doubling
=============================================================

A pendulum with friction is driven periodically. Driven weakly its resonance leans over to lower
frequencies, with two folds that meet in a cusp where the forcing is weak enough. Driven more
strongly the swing, which was its own mirror image half a period later, loses that symmetry; both
of the orbits that are born so double their period soon after, on the way to chaos.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import contbreather as cb
from contbreather.plotting import new_figure, plot_orbit, save_figure, style

SLOW = {"q": 2.0, "g": 0.9, "w": 2 / 3}


def pendulum(t: Any, x: Any, p: Any) -> list[Any]:
    """The angle, and its velocity; q is the quality of the pendulum."""
    return [x[1], -x[1] / p["q"] - np.sin(x[0]) + p["g"] * np.cos(p["w"] * t)]


def swing(params: dict[str, float]) -> cb.Problem:
    """What it settles on."""
    return cb.cycle(
        pendulum, start={"x": 0.0, "v": 0.0}, params=params,
        period=lambda p: 2 * np.pi / p["w"], settle=60,
    )  # fmt: skip


def resonance() -> tuple[cb.Branch, cb.Branch]:
    """Weakly damped and driven: the response over the frequency, and the folds in the plane."""
    response = cb.trace(
        swing({"q": 10.0, "g": 0.15, "w": 1.2}), "w", within={"w": (0.7, 1.2)}, progress=False
    )
    folds = cb.boundary(
        response.first("LP"), ("w", "g"), within={"w": (0.8, 1.0), "g": (0.1, 0.16)}, progress=False
    )
    cusp = folds.first("CP")
    print(f"the folds meet at w = {cusp['w']:.8f}, g = {cusp['g']:.8f}")
    return response, folds


def doubling() -> tuple[cb.Branch, list[cb.Branch], cb.Branch]:
    """The symmetric swing, both that lost their symmetry, and one of twice the period."""
    window = {"g": (0.5, 1.1)}
    symmetric = cb.trace(swing(SLOW), "g", within=window, towards="both", progress=False)
    arms = cb.switch(symmetric.first("BP"), within=window, progress=False)
    (double,) = cb.switch(arms[0].first("PD"), within=window, progress=False)
    names = ("symmetric", "one that is not", "its mirror image", "of twice the period")
    for name, branch in zip(names, (symmetric, *arms, double), strict=True):
        print(f"{name}:", ", ".join(f"{p.label} at g = {p['g']:.9f}" for p in branch.special))
    one, other = (arm.first("PD")["g"] for arm in arms)
    assert abs(one - other) < 1e-9  # mirror images
    return symmetric, arms, double


def main(folder: Path = Path()) -> list[Path]:
    """Draw the resonance, where it folds, the branches in the forcing, and three orbits."""
    response, folds = resonance()
    symmetric, arms, double = doubling()
    with style():
        figure, panels = new_figure(2, 2, width=17.5)
        cb.plot(response, x="w", y="max(x)", ax=panels[0])
        cb.plot(folds, x="w", y="g", ax=panels[1])
        cb.plot(symmetric, *arms, double, x="g", y="max(x)", ax=panels[2])
        for branch, colour in zip((symmetric, arms[0], double), ("C0", "C1", "C2"), strict=True):
            plot_orbit(branch[-1], x="x", y="v", ax=panels[3])[0].set_color(colour)
    return [save_figure(figure, folder / "pendulum.png")]


if __name__ == "__main__":
    main()
