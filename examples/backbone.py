"""
Nonlinear normal modes: backbones, and one that becomes localised
=================================================================

Two hard oscillators hang together by a spring, without damping and without a drive. Their normal
modes, in phase and out of phase, grow into families of periodic orbits with the energy: backbones,
along which the period becomes shorter. Where the mode out of phase loses its stability two families
leave it, on which one of both oscillators swings more than the other: the energy localises, and
stays where it is. That is a breather of the shortest chain there is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import contbreather as cb
from contbreather.plotting import new_figure, plot_orbit, save_figure, style

WINDOW = {"energy": (0.01, 3.0)}


def pair(t: Any, x: Any, p: Any) -> list[Any]:
    """Two Duffing oscillators, and c the stiffness of the spring between them."""
    u, w, pull = x[0], x[1], p["c"] * (x[0] - x[1])
    return [x[2], x[3], -u - u**3 - pull, -w - w**3 + pull]


def energy(x: Any, p: Any) -> Any:
    """The energy, which is conserved."""
    own = sum(v**2 / 2 + u**2 / 2 + u**4 / 4 for u, v in ((x[0], x[2]), (x[1], x[3])))
    return own + p["c"] * (x[0] - x[1]) ** 2 / 2


def mode(w: float) -> cb.Branch:
    """The family of the mode that begins with the second oscillator at w, the first at 0.5."""
    begin = {"u": 0.5, "w": w, "v": 0.0, "s": 0.0}
    start = cb.cycle(pair, begin, {"c": 0.1}, conserves=energy)
    return cb.trace(start, "energy", within=WINDOW, progress=False)


def main(folder: Path = Path()) -> list[Path]:
    """Draw the families in the energy, and an orbit on which the energy is localised."""
    together, against = mode(0.5), mode(-0.5)
    where = against.first("BP")
    arms = cb.switch(where, within=WINDOW, progress=False)
    print(f"the energy localises beyond E = {where['energy']:.9f}, T = {where['period']:.9f}")
    for name, branch in (("in phase", together), ("out of phase", against), ("localised", arms[0])):
        found = ", ".join(f"{p.label} at {p['energy']:.6f}" for p in branch.special)
        print(f"{name}: {found}; lambda up to {abs(branch['lambda']).max():.0e}")
        assert not branch.doubtful
    with style():
        figure, panels = new_figure(1, 3, width=17.5)
        cb.plot(together, against, *arms, x="energy", y="max(u)", ax=panels[0])
        cb.plot(together, against, arms[0], x="energy", y="period", ax=panels[1])
        for arm, colour in zip((against, arms[0]), ("C1", "C2"), strict=True):
            plot_orbit(arm[-1], x="u", y="w", ax=panels[2])[0].set_color(colour)
    return [save_figure(figure, folder / "backbone.png")]


if __name__ == "__main__":
    main()
