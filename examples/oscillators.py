"""
Breathers of nonlinear lattices: Morse, FPUT, and a plane
=========================================================

A chain of Morse oscillators has breathers below the band of its small oscillations, a chain of hard
springs between fixed ends above it, and a plane of soft oscillators has them as well. Each is
continued from the limit without coupling, along its family, with its stability.
"""

from __future__ import annotations

from pathlib import Path

import contbreather as cb
from contbreather.plotting import (
    new_figure,
    plot_energy,
    plot_multipliers,
    plot_profile,
    plot_space_time,
    save_figure,
    style,
)


def morse() -> tuple[cb.oscillators.BreatherProblem, cb.Branch]:
    """A breather of a ring of Morse oscillators, and its family in the frequency."""
    chain = cb.Oscillators(V="(1 - exp(-u))**2/2", W="c*r**2/2", lattice=cb.Ring(11))
    start = cb.breather(chain, {5: 1}, omega=0.8, params={"c": 0.03})
    return start, cb.trace(start, "omega", within={"omega": (0.7, 0.97)}, progress=False)


def between_fixed_ends() -> cb.oscillators.BreatherProblem:
    """A breather of the Fermi-Pasta-Ulam-Tsingou chain: no potential but that of the bonds."""
    chain = cb.Oscillators(W="r**2/2 + r**4/4", lattice=cb.OpenChain(11, ends="fixed"))
    return cb.breather(chain, {5: 1}, omega=2.6)


def in_the_plane() -> cb.oscillators.BreatherProblem:
    """Two soft oscillators side by side in a plane, half a period apart: they are stable."""
    plane = cb.Oscillators(V="u**2/2 - u**4/4", W="c*r**2/2", lattice=cb.Grid(5, 5))
    return cb.breather(plane, {11: 1, 12: -1}, omega=0.85, params={"c": 0.01})


def main(folder: Path = Path()) -> list[Path]:
    """Draw a Morse breather and its family, and the profiles of the others."""
    (start, family), hard, plane = morse(), between_fixed_ends(), in_the_plane()
    for name, breather in (("Morse", start), ("FPUT", hard), ("plane", plane)):
        orbit = breather.solution
        print(f"{name}: energy {orbit.energy:.9f}, largest multiplier {orbit.largest:.6f}")
    with style():
        figure, panels = new_figure(2, 3, width=17.5, height=11.0)
        plot_profile(start, ax=panels[0])
        plot_space_time(start, ax=panels[1])
        plot_multipliers(start, ax=panels[2], digits=1)
        plot_energy(family, ax=panels[3])
        plot_profile(hard, ax=panels[4])
        plot_profile(plane, ax=panels[5])
        titles = ("Morse: profile", "over a period", "multipliers", "family up to the band")
        for panel, title in zip(panels, (*titles, "FPUT, fixed ends", "plane"), strict=True):
            panel.set_title(title, fontsize="medium")
        for label in panels[3].texts:  # its ends are those of the window
            label.set_visible(not label.get_text().startswith("EP"))
    return [save_figure(figure, folder / "oscillators.png")]


if __name__ == "__main__":
    main()
