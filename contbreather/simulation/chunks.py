"""A run in chunks of some periods, whoever integrates it: what `simulate` and `record` drive."""

from __future__ import annotations

import enum
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.errors import BadInput
from contbreather.progress import Bar, line_of
from contbreather.simulation.states import PERIOD, State

Array = NDArray[Any]

WHERE = [("time", "f8"), ("period", "i8"), ("phase", "f8"), ("site", "i8"), ("wall", "i1")]
IMPACT = np.dtype([*WHERE, ("before", "f8"), ("after", "f8"), ("acceleration", "f8")])
REST = np.dtype([*WHERE, ("begins", "?")])
MOMENT = 0.2  # seconds a chunk should take: how long an interruption waits


class RunStop(enum.Enum):
    """Why a run ended; the value is the sentence a user reads."""

    DONE = "went through all its periods"
    INTERRUPTED = "interrupted; all periods up to here are kept"
    CHATTER = "ended before a period of more impacts than can be followed"


@dataclass(frozen=True)
class Sample:
    """Sites to record densely, and at how many equal times in each whole period.

    Of a run of 1.5 periods the first one is recorded.

    Examples
    --------
    >>> Sample(sites=(0, 1), per_period=128).per_period
    128
    """

    sites: Sequence[int] = (0,)
    per_period: int = 64

    def __post_init__(self) -> None:
        whole("per_period", self.per_period, 1)
        if not isinstance(self.sites, Sequence | np.ndarray) or not np.size(self.sites):
            raise BadInput(
                f"sites = {self.sites!r}: one site or several were expected, as in (0, 1)."
            )
        for n in self.sites:
            if not isinstance(n, int | np.integer) or isinstance(n, bool):
                raise BadInput(
                    f"sites = {self.sites!r}: whole numbers were expected, {n!r} is none."
                )
        object.__setattr__(self, "sites", tuple(int(n) for n in self.sites))


def check_sample(sample: object, sites: int) -> None:
    """Refuse what is no `Sample` of a lattice of so many sites."""
    if not isinstance(sample, Sample | None):
        raise BadInput(f"sample = {sample!r}: a Sample was expected, as in Sample(sites=(0, 1)).")
    for n in sample.sites if sample else ():
        if not -sites <= n < sites:
            raise BadInput(
                f"sample: there is no site {n} among {sites}; sites are 0 to {sites - 1}."
            )


@dataclass(frozen=True, repr=False)
class Chunk:
    """Some successive periods of a run: what happened in them, and the states after each."""

    first: int
    u: Array
    v: Array
    dense_u: Array  # (periods, times, sites) of a `Sample`
    dense_v: Array
    impacts: NDArray[np.void] = field(default_factory=lambda: np.empty(0, IMPACT))
    rests: NDArray[np.void] = field(default_factory=lambda: np.empty(0, REST))
    stop: RunStop | None = None
    reason: str = ""

    @property
    def periods(self) -> int:
        return len(self.u)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.periods} periods from {self.first}>"


class Integrator(Protocol):
    """What carries a state on, between walls of either kind: as many periods as asked for (or one
    of another length), fewer with a reason, or, but one at least, where there is no room for all
    their impacts; `most_periods` is the most that one chunk may have."""

    state: State
    conditions: Any
    sample: Sample | None

    @property
    def most_periods(self) -> int: ...
    def advance(self, periods: int, first: int, *, span: float = PERIOD) -> Chunk: ...


def in_chunks(
    integrator: Integrator, *, periods: int, first: int = 0, progress: bool | Bar | None = None
) -> Iterator[Chunk]:
    """Yield a run in chunks of about a fifth of a second.

    Times of events are counted from t0. Where chunks are cut has no influence on anything.
    """
    count, done = min(4, integrator.most_periods), 0
    with line_of(progress, lambda shown: Bar(shown, periods)) as bar:
        while done < periods:
            began = time.perf_counter()
            chunk = integrator.advance(min(count, periods - done), first + done)
            done += chunk.periods
            bar.advance(done)
            yield chunk
            if chunk.stop is not None:
                return
            # towards half a `MOMENT`, never shorter, as machines are slow for a while
            longer = 0.5 * MOMENT / (time.perf_counter() - began)
            count = min(int(count * min(max(longer, 1.0), 8.0)), integrator.most_periods)
