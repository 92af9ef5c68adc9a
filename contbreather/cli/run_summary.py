"""What a run shows a person: its impacts, how long its breather lived, and a verdict.

A run and its verdict are two steps: what took long to simulate is on disk before it is judged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import contbreather as cb
from contbreather.cli.process import computing

if TYPE_CHECKING:
    from contbreather.simulation.integrator import Chunk
    from contbreather.simulation.simulate import SmoothRun

JUDGED = 4096  # periods that a verdict looks at, at most
ENOUGH = 50  # and at least


@dataclass(frozen=True)
class RunSummary:
    """A run (of a stream its last periods), what it is in the end, and how it ended."""

    run: cb.simulation.SimulationRun | SmoothRun
    periods: int
    interrupted: bool
    stop: str
    stream: cb.simulation.Recording | None = None
    site: int = 0
    by_site: dict[int, int] | None = None
    lost: int | None = None
    kind: str = "UNDECIDED"
    motion: str = "UNDECIDED"
    reason: str = "no verdict: interrupted before it was found"
    evidence: dict[str, float] = field(default_factory=dict)

    def chunks(self) -> Iterator[Chunk]:
        """All of it; a stream piece by piece, so that memory does not grow with its length."""
        if self.stream is None:
            from contbreather.simulation.integrator import Chunk

            u, v = (row[1:] for row in self.run.strobe)
            hits: dict[str, Any] = (
                {"impacts": self.run.impacts}
                if isinstance(self.run, cb.simulation.SimulationRun)
                else {}
            )
            yield Chunk(0, u, v, u[:0], v[:0], **hits)
            return
        for chunk in self.stream.chunks():
            chunk.impacts["time"] += self.stream.t0
            yield chunk


def summary_of(run: cb.simulation.SimulationRun | SmoothRun, site: int = 0) -> RunSummary:
    """A whole run and how it ended, not judged yet."""
    stop = getattr(run, "reason", "") or run.stop.value
    return RunSummary(
        run, run.periods, run.stop is cb.simulation.RunStop.INTERRUPTED, stop, site=site
    )


def summary_in(stream: cb.simulation.Recording, wanted: int, site: int = 0) -> RunSummary:
    """A run on disk, not judged yet: it is read piece by piece, only its end is held."""
    run = stream.last(2 * JUDGED)
    interrupted = stream.interrupted
    stop = run.reason or run.stop.value
    if interrupted:
        stop = f"interrupted after {stream.periods} of {wanted} periods; the same command goes on"
    return RunSummary(run, stream.periods, interrupted, stop, stream, site)


@computing()
def judged(summary: RunSummary) -> RunSummary:
    """What it shows, and the verdict; without it where Ctrl-C does not wait for it."""
    try:
        if isinstance(summary.run, cb.simulation.SimulationRun):
            by_site = _counted(chunk.impacts for chunk in summary.chunks())
            summary = replace(summary, by_site=by_site, lost=_lost_in(summary))
        verdict = _judged(summary.run)
    except KeyboardInterrupt:
        return replace(summary, interrupted=True)
    return replace(summary, **verdict)


def _counted(tables: Iterable[Any]) -> dict[int, int]:
    """Impacts of each site that has any."""
    counts = Counter[int]()
    for table in tables:
        counts.update(table["site"].tolist())
    return dict(sorted(counts.items()))


def _lost_in(summary: RunSummary) -> int | None:
    """After which period it was no breather any more, if ever."""
    import numpy as np

    from contbreather.paper.lifetimes import unlike_a_breather

    wall = 0
    for chunk in summary.chunks():
        wrong = unlike_a_breather(chunk.impacts, chunk.periods, chunk.first, wall, summary.site)
        gone = np.flatnonzero(wrong)
        if gone.size:
            return chunk.first + int(gone[0])
        wall = int(chunk.impacts["wall"][-1]) if chunk.impacts.size else wall
    return None


def periods_gone(run: cb.simulation.SimulationRun | SmoothRun) -> float:
    """How many periods it went, the fraction at its end included."""
    from contbreather.simulation.states import PERIOD

    return run.periods + round((run.end - float(run.times[-1])) / PERIOD, 6)


def periods_in_words(count: float) -> str:
    """So many periods, in numbers."""
    return "1 period" if count == 1 else f"{count:.12g} periods"


def _judged(run: cb.simulation.SimulationRun | SmoothRun) -> dict[str, Any]:
    """Kind, sentence and evidence from the later half of a run."""
    from contbreather.simulation.classify import judge

    half = min(JUDGED, run.periods // 2)
    if run.stop is cb.simulation.RunStop.CHATTER:
        return {"reason": "it ends before a period of too many impacts"}
    if half < ENOUGH:
        length = periods_gone(run)
        words = f"{periods_in_words(length)} {'is' if length == 1 else 'are'} too few"
        return {"reason": f"no verdict: {words}, give at least {2 * ENOUGH}"}
    verdict: Any
    try:
        verdict = judge(run.since(run.periods - half))
    except cb.errors.ContbreatherError as error:
        return {"reason": f"no verdict: {error}"}
    kinds = {"kind": verdict.kind.name, "motion": verdict.motion.name}
    return {**kinds, "reason": str(verdict), "evidence": dict(verdict.evidence)}
