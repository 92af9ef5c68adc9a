"""
The zone diagram of the paper, and of a forcing that the paper did not try
==========================================================================

Where does the symmetric breather exist, and where is it stable? Each limit is a curve in the plane
of coupling and forcing amplitude. `zones` finds all of them by itself; nobody supplies a seed.
"""

from __future__ import annotations

from pathlib import Path

import contbreather as cb
from contbreather.plotting import plot_zones, save_figure


def main(folder: Path = Path()) -> list[Path]:
    """Draw both diagrams into a folder."""
    # The paper's Fig. 2: two values of the restitution coefficient.
    paper = [cb.zones(k=0.8), cb.zones(k=0.4)]
    for diagram in paper:
        for kind, curve in diagram:
            first, last = curve[0], curve[-1]
            ends = [f"({end['gamma']:.4f}, {end['a']:.4f})" for end in (first, last)]
            print(f"k = {diagram.fixed[1]}, {kind}: from (gamma, a) = {' to '.join(ends)}")

    # Codim-2 points, where two of these curves meet.
    for point in paper[0].special:
        print(f"{point.label}: gamma = {point['gamma']:.10f}, a = {point['a']:.10f}")

    # A third harmonic in the forcing: several breathers coexist, and a pitchfork limits them all.
    third = cb.Symbolic("-cos(t) - 2.7*cos(3*t)")
    other = cb.zones(k=0.7, forcing=third)

    return [
        save_figure(plot_zones(paper)[0], folder / "zones_paper.png"),
        save_figure(plot_zones(other), folder / "zones_two_harmonics.png"),
    ]


if __name__ == "__main__":
    main()
