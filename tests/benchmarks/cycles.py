"""Branches of cycles with all events, and a curve of period doublings, beside AUTO-07p."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np

from .measure import Row, best_of, span
from .peers import auto07p_cycles as auto

INTERVALS, POINTS = 40, 4  # what AUTO is usually given
AS_EXACT = (10, 8)  # of Lorenz's cycles: PD is off by 2e-9, with 40 x 4 by 3e-8
REPEAT = 3
SITES = 10  # of a chain of van der Pol oscillators, two states each


def lorenz(t: Any, x: Any, p: Any) -> Any:
    return [p["s"] * (x[1] - x[0]), x[0] * (p["r"] - x[2]) - x[1], x[0] * x[1] - p["b"] * x[2]]


def chain(t: Any, x: Any, p: Any) -> Any:
    """Neighbours are coupled, and each site is a little faster than the one before."""
    u, v = x[:SITES], x[SITES:]
    stretch = np.concatenate([x[1:SITES] - u[:-1], 0 * x[:1]])
    pull = stretch - np.concatenate([0 * x[:1], stretch[:-1]])
    fast = 1 + 0.02 * np.arange(SITES).reshape(-1, *[1] * (u.ndim - 1))
    return np.concatenate([v, p["mu"] * (1 - u**2) * v - fast * u + p["k"] * pull])


LORENZ = auto.System(
    """\
  F(1) = PAR(2)*(U(2) - U(1))
  F(2) = U(1)*(PAR(1) - U(3)) - U(2)
  F(3) = U(1)*U(2) - PAR(3)*U(3)""",
    {"r": 280.0, "s": 10.0, "b": 8 / 3}, "r", (200.0, 281.0), -0.2, ("s", 8.0, 12.0),
)  # fmt: skip
CHAIN = auto.System(
    f"""\
  F(1:{SITES}) = U({SITES + 1}:{2 * SITES})
  DO i = 1, {SITES}
    F({SITES}+i) = PAR(1)*(1 - U(i)**2)*U({SITES}+i) - (1 + 0.02D0*(i-1))*U(i)
    IF (i > 1) F({SITES}+i) = F({SITES}+i) - PAR(2)*(U(i) - U(i-1))
    IF (i < {SITES}) F({SITES}+i) = F({SITES}+i) + PAR(2)*(U(i+1) - U(i))
  END DO""",
    {"mu": 1.0, "k": 0.5}, "mu", (0.9, 1.5), 0.01,
)  # fmt: skip


def rows() -> list[Row]:
    x = {"x": 0.0, "y": 10.0, "z": 280.0}
    names = [f"{what}{i}" for what in "uv" for i in range(SITES)]
    start = {name: 2.0 * (name[0] == "u") for name in names}
    same = INTERVALS, POINTS
    return [
        *_rows("Lorenz, 3 states", lorenz, x, 60.0, LORENZ, AS_EXACT),
        *_rows("Lorenz, 3 states", lorenz, x, 60.0, LORENZ, same),
        *_rows("chain, 20 states", chain, start, 200.0, CHAIN, same),
    ]


def _rows(
    what: str, f: Any, start: Any, settle: float, system: auto.System, mesh: tuple[int, int]
) -> list[Row]:
    import contbreather as cb
    from contbreather.flows import Collocation, cycle_of

    own_mesh = Collocation(*mesh)
    ring = cb.cycle(f, start, system.params, settle=settle, collocation=own_mesh)
    orbit = cycle_of(ring)
    t = np.linspace(orbit.times[0], orbit.times[-1], 401)
    x = orbit.states(np.append(t[:-1], t[0]))
    sessions = [auto.session(system, t - t[0], x, INTERVALS, POINTS) for _ in range(REPEAT)]
    theirs, (free, window) = sessions[0], (system.free, system.window)
    towards = "down" if system.step < 0 else "up"
    walk = partial(cb.trace, ring, free, within={free: window}, towards=towards)
    branch = walk()
    few = system.curve is not None  # states
    walks = [("branch with all events", "branch", walk, len(branch), 3.5 if few else 1.6)]
    last = [(at.kind, at[free], at["period"]) for at in branch.special][1:]
    notes = [f"here {last}, there {theirs['special'][1:]}"]
    if few:
        second, *ends = system.curve
        line = partial(
            cb.boundary, branch.first("PD"), (free, second), within={second: tuple(ends)}
        )
        curve = line()
        walks.append(("curve of PD", "curve", line, len(curve), 6.0))
        notes.append(f"ends here {[curve[i][free] for i in (0, -1)]}, there {theirs['ends']}")
    table = []
    for (kind, key, run, many, most), note in zip(walks, notes, strict=True):
        own = best_of(run, REPEAT, time.process_time) / many
        other = min(one[key] for one in sessions)
        table.append(Row(
            f"{what}, {mesh[0]} x {mesh[1]}, {kind}: a point", span(own),
            f"{theirs['name']}, {INTERVALS} x {POINTS}: {span(other)}", own / other,
            f"≤ {most:g}", own <= most * other, note,
        ))  # fmt: skip
    return table
