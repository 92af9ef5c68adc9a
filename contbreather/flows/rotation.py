"""Angles: states that an orbit closes in up to whole turns, as those of a rotation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief, check_kind, number
from ..continuation.algebra.newton import Array
from ..errors import BadInput
from .collocation import TrajectorySegment
from .flow import Filippov, Flow, TurnedBack, plain
from .functions import Params, values

PERIODIC = 1e-9  # of a function: off by less after a turn it is that of an angle


def unturned(
    flows: Iterable[Flow], flights: Iterable[TrajectorySegment]
) -> tuple[list[Flow], list[TrajectorySegment], Array]:
    """Let an orbit run on through its whole turns, and return these, shape (n,)."""
    parts, pieces, turns = [], [], np.zeros(1)
    for flow, flight in zip(flows, flights, strict=True):
        pieces.append(replace(flight, states=flight.states + turns) if turns.any() else flight)
        if isinstance(flow.reset, TurnedBack):
            turns = turns + flow.reset.turns
        parts.append(plain(flow))
    return parts, pieces, turns


def turned_back(flow: Flow, turns: Array, whole: Array | float = math.inf) -> Flow:
    """Let a flow end with whole turns taken back."""
    return replace(flow, reset=TurnedBack(turns, flow.reset, whole)) if turns.any() else flow


def moves(flow: Flow) -> bool:
    """Tell whether the reset of a flow moves its state, by more than whole turns."""
    return plain(flow).reset is not None


@dataclass(frozen=True)
class Angles:
    """A turn of each state, 0 of those that are none, shape (n,); those that only turn all at once,
    as coupled ones, are `tied`."""

    turn: Array
    tied: NDArray[np.bool_]

    @classmethod
    def of(cls, wraps: Mapping[str, float] | None, parts: Mapping[str, tuple[str, ...]]) -> Angles:
        """Read ``{"theta": 2 * pi}``, of a state or all those of an array."""
        turn = dict.fromkeys(chain.from_iterable(parts.values()), 0.0)
        listed = {} if wraps is None else wraps
        check_kind(listed, Mapping, "wraps={'theta': 2*np.pi}, a state and its turn,")
        for name, whole in listed.items():
            if name not in turn and name not in parts:
                raise BadInput(f"wraps: {name!r} is none of the states {', '.join(turn)}")
            size = number(f"the turn of {name}", whole, 1e-300, 1e300, "a positive number")
            turn |= dict.fromkeys(parts.get(name, (name,)), size)
        return cls(np.array([*turn.values()]), np.zeros(len(turn), dtype=bool))

    def turns(self, moved: Array) -> Array:
        """Round a difference of states, shape (n, ...), to whole turns; none of another flow's."""
        if len(moved) != self.turn.size or not self.turn.any():
            return np.zeros_like(moved)
        whole = self.turn.reshape(-1, *[1] * (moved.ndim - 1))
        share = np.divide(moved, whole, out=np.zeros_like(moved), where=whole > 0.0)
        if self.tied.any():
            share[self.tied] = share[self.tied].mean(axis=0)
        return np.asarray(whole * np.round(share))

    def checked(self, flows: Any, t: float, x: Array, p: Params) -> Angles:
        """Refuse functions that are not the same a turn later, of each angle or of all those of
        which one alone changes them."""
        if not self.turn.any():
            return self
        slides = isinstance(flows, Filippov)
        checked = (flows.f_plus, flows.f_minus, flows.h) if slides else (flows[0].f,)

        def off(turned: Array) -> str:
            """Say what differs, if anything does."""
            at = (x, x + np.where(turned, self.turn, 0.0))
            here, there = (
                np.concatenate([values(function, t, y[:, None], p) for function in checked])
                for y in at
            )
            same = float(abs(here - there).max()) <= PERIODIC * (1.0 + float(abs(here).max()))
            return "" if same else f"{brief(here[:, 0].tolist())} and {brief(there[:, 0].tolist())}"

        tied = np.array([bool(off(one)) for one in np.eye(x.size, dtype=bool)])
        if tied.any() and (words := off(tied)):
            which = ", ".join(
                f"{self.turn[i]:.6g} later in state {i}" for i in np.flatnonzero(tied)
            )
            raise BadInput(f"wraps: f is not the same a turn of {which}: {words}")
        return replace(self, tied=tied)

    def taken_from(self, flow: Flow, moved: Array) -> Flow:
        """Let a flow end with the whole turns that an orbit makes taken back."""
        return turned_back(flow, self.turns(moved), self.turn)
