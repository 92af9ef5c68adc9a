"""
Neighbours of a hard chain: in phase and half a period apart
============================================================

Two neighbours of a chain with the potential of phi^4 make a breather in phase, and another one half
a period apart. The potential is hard, so the first is stable, and the second is not: one pair of
multipliers has left the unit circle.
"""

from __future__ import annotations

from pathlib import Path

import contbreather as cb
from contbreather.plotting import (
    new_figure,
    plot_multipliers,
    plot_profile,
    save_figure,
    style,
)


def main(folder: Path = Path()) -> list[Path]:
    """Draw the profiles and the multipliers of both."""
    chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(11))
    with style():
        figure, panels = new_figure(2, 2, width=13.0, height=10.0)
        for i, sign in enumerate((1, -1)):
            breather = cb.breather(chain, {5: 1, 6: sign}, omega=1.5, params={"c": 0.05})
            orbit = breather.solution
            print(f"{sign:+d}: energy {orbit.energy:.9f}, largest multiplier {orbit.largest:.6f}")
            plot_profile(breather, ax=panels[2 * i])
            plot_multipliers(breather, ax=panels[2 * i + 1], digits=1)
    return [save_figure(figure, folder / "phi4.png")]


if __name__ == "__main__":
    main()
