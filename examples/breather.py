"""
One breather: its motion, its walls, its stability
==================================================

A chain of particles between walls, all driven alike. One of them hits its walls; the others follow
and touch nothing. The motion is known in closed form, so it can be asked at any site and any time.
Its stability is three questions: on the infinite chain, on a ring, and on long rings.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import contbreather as cb
from contbreather.plotting import new_figure, plot_multipliers, plot_orbit, save_figure, style


def main(folder: Path = Path()) -> list[Path]:
    """Draw the motion, the profile and the multipliers into a folder."""
    breather = cb.symmetric(a=0.5, gamma=0.12, k=0.4)
    print(f"p = {breather.p:.12f}, phi = {breather.phi:.12f}")

    # Which site comes closest to a wall that it must not touch, and when?
    print(breather.admissibility().reason)

    # Three questions, three answers.
    print(breather.stability())
    print(breather.stability(sites=400))
    reflection = breather.stability().over_reflection
    print(f"waves come back amplified by a factor of up to {np.exp(reflection.gain):.3f}")

    with style():
        figure, (motion, profile) = new_figure(2)
        plot_orbit(breather, sites=(0, 1, 2), ax=motion)

        # Once the forced motion is taken out the profile falls by one factor from site to site.
        n = np.arange(-8, 9)
        height = np.abs(breather.displacement(n, 0.0) - breather.displacement(60, 0.0))
        profile.semilogy(n, height, "o-", markersize=3)
        profile.set(xlabel="site $n$", ylabel="$|u_n - u_\\infty|$ at $t = 0$")
        print(f"from one site to the next it falls by {height[11] / height[10]:.4f}")

        circle = plot_multipliers(breather, sites=200, half=True)
        return [
            save_figure(figure, folder / "breather.png"),
            save_figure(circle, folder / "circle.png"),
        ]


if __name__ == "__main__":
    main()
