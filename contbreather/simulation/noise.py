"""White noise on every site: kicks of the velocities between exact flights.

``u'' = ... + noise xi(t)`` with ``<xi_n(t) xi_m(s)> = delta_nm delta(t - s)``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from contbreather.simulation.chunks import Chunk
from contbreather.simulation.integrator import EventDriven
from contbreather.simulation.states import PERIOD, State, reduced

KICKS = 16  # in a step of the series: 64 in a period, more where modes are fast


@dataclass
class Noisy:
    """An integrator of rigid walls whose sites are kicked.

    Over a time dt white noise changes a velocity by a normal number of variance noise^2 dt. All of
    it comes in the middle of dt, so that moments of a smooth motion are right to (omega dt)^2.
    Kicks depend on the seed and the number of the period alone, not on where chunks are cut.
    """

    flight: EventDriven
    noise: float
    seed: int

    def __post_init__(self) -> None:
        self.t0, self.sample, self.conditions = self.flight.t0, None, self.flight.conditions

    @property
    def state(self) -> State:
        return self.flight.state

    @property
    def most_periods(self) -> int:
        return self.flight.most_periods

    def advance(self, periods: int, first: int, *, span: float = PERIOD) -> Chunk:
        chunks: list[Chunk] = []
        for period in range(first, first + periods):
            chunks.append(self._period(period, span))
            if chunks[-1].stop is not None:
                break
        columns = ("u", "v", "dense_u", "dense_v", "impacts", "rests")
        return replace(chunks[-1], first=first, **_joined(chunks, *columns))

    def _period(self, period: int, span: float) -> Chunk:
        """Half a dt, a kick, a whole dt, a kick, ..., half a dt; no state where it chatters."""
        start = State(*(x.copy() for x in self.state))
        count = math.ceil(KICKS * span / self.flight.parameters.step)
        dt = span / count
        size = self.noise * math.sqrt(dt)
        kicks = size * np.random.default_rng([self.seed, period]).normal(size=(count, start.u.size))
        ends = [0.0, *(dt * (np.arange(count) + 0.5)).tolist(), span]
        chunks = []
        for i, (begin, end) in enumerate(pairwise(ends)):
            self.flight.t0 = reduced(self.t0 + begin)
            chunks.append(self.flight.advance(1, period, span=end - begin))
            for table in (chunks[-1].impacts, chunks[-1].rests):
                table["time"] += begin
            if chunks[-1].stop is not None:  # nothing is kept of a period that does not end
                self.flight.state = start
                return chunks[-1]
            if i < count:
                self.state.v[:] += kicks[i]
        return replace(chunks[-1], **_joined(chunks, "impacts", "rests"))


def _joined(chunks: Sequence[Chunk], *names: str) -> dict[str, Any]:
    return {name: np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in names}
