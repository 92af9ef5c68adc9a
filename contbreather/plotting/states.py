"""Motions of anybody's flows: states over time, or one state over another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.flows import Cycle, Trajectory
from contbreather.plotting.canvas import CYCLE, GREY, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TIME = "t"
FINE = 12  # lines in an interval of a mesh, or in a step of the integrator


class Piece(NamedTuple):
    """One flow: times, states of shape (n, len(t)), and whether a condition ended it."""

    t: Array
    states: Array
    ended: bool


def draw_states(
    axes: Axes,
    motion: Cycle | Trajectory,
    x: str | None,
    y: str | Sequence[str] | None,
    within: tuple[float, float] | None = None,
) -> None:
    """Lines of the flows; a dot where a condition ends one, and from there a dotted line to where
    the next one begins."""
    cycle = isinstance(motion, Cycle)
    names = motion.equations.states if isinstance(motion, Cycle) else motion.names
    x = TIME if x is None else x
    chosen = [y] if isinstance(y, str) else [n for n in names if n != x] if y is None else list(y)
    for name in (x, *chosen):
        if name not in (TIME, *names):
            raise BadInput(f"no state {name!r}; there are {[*names]}, and the time, 't'")
    pieces = _of_cycle(motion) if isinstance(motion, Cycle) else _of_run(motion, within)
    # the time of a cycle begins anew, its states go on
    following = [*pieces[1:], *pieces[: cycle and x != TIME]]
    for i, name in enumerate(chosen):
        colour = CYCLE[i % len(CYCLE)]
        lines = [(_column(piece, names, x), _column(piece, names, name)) for piece in pieces]
        for j, line in enumerate(lines):
            axes.plot(*line, "-", color=colour, label=None if j else symbol(name))
        for piece, onward, line in zip(pieces, following, lines, strict=False):
            if piece.ended:
                last = line[0][-1], line[1][-1]
                first = _column(onward, names, x)[0], _column(onward, names, name)[0]
                axes.plot(*zip(last, first, strict=True), ":", color=colour, linewidth=0.8)
                axes.plot(*last, "o", color=GREY, markersize=3, zorder=3, clip_on=False)
    axes.set(xlabel=symbol(x), ylabel=symbol(chosen[0]) if len(chosen) == 1 else "states")
    if x == TIME:
        axes.margins(x=0.0)
    if len(chosen) > 1:
        axes.legend(frameon=False, ncols=len(chosen), loc="lower right",
                    bbox_to_anchor=(1.0, 0.97), handlelength=1.3)  # fmt: skip


def _column(piece: Piece, names: Sequence[str], name: str) -> Array:
    """The time or a state; nothing where this flow has fewer of them."""
    if name == TIME:
        return piece.t
    i = names.index(name)
    return piece.states[i] if i < len(piece.states) else np.full(piece.t.size, np.nan)


def _of_cycle(orbit: Cycle) -> list[Piece]:
    pieces = []
    for flow, flight in zip(orbit.equations.flows, orbit.flights, strict=True):
        s, states = flight.sampled(FINE)
        pieces.append(Piece(flight.start + flight.duration * s, states, flow.until is not None))
    return pieces


def _of_run(run: Trajectory, within: tuple[float, float] | None) -> list[Piece]:
    """Between the steps of the integrator by its own interpolant."""
    first, last = (-np.inf, np.inf) if within is None else within
    pieces = []
    for piece in run.pieces:
        steps = piece.t.size - 1
        t = np.interp(np.linspace(0, steps, FINE * steps + 1), np.arange(steps + 1), piece.t)
        t = t[(first <= t) & (t <= last)]
        if t.size:
            ended = bool(piece.ended and t[-1] == piece.t[-1])
            pieces.append(Piece(t, piece(t), ended))
    if not pieces:
        raise BadInput(
            f"nothing lies between {first:g} and {last:g}: the trajectory goes from "
            f"t = {run.t[0]:g} to {run.t[-1]:g}"
        )
    return pieces
