"""What a run shows a person: its impacts, how long its breather lived, and a verdict."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from contbreather.dynamics import Recording, Run, SmoothRun

JUDGED = 4096  # periods that a verdict looks at, at most
ENOUGH = 50  # and at least


@dataclass(frozen=True)
class Seen:
    """A run (of a stream its last periods), what it is in the end, and how it ended."""

    run: Run | SmoothRun
    kind: str
    reason: str
    evidence: dict[str, float]
    periods: int
    by_site: dict[int, int] | None
    lost: int | None
    interrupted: bool
    stop: str
    stream: Recording | None = None


def seen_of(run: Run | SmoothRun) -> Seen:
    """What a whole run shows."""
    from contbreather.dynamics import Run, RunStop
    from contbreather.paper.fates import life

    by_site, lost = None, None
    if isinstance(run, Run):
        by_site = _counted([run.impacts])
        lost = life(run) if run.periods else None
    interrupted = run.stop is RunStop.INTERRUPTED
    stop = getattr(run, "reason", "") or run.stop.value
    return Seen(run, *_judged(run), run.periods, by_site, lost, interrupted, stop)


def seen_in(kept: Recording, wanted: int) -> Seen:
    """What a run on disk shows: it is read piece by piece, only its end is held."""
    from contbreather.dynamics import RunStop

    run = _end_of(kept, 2 * JUDGED)
    interrupted = kept.stop is RunStop.DONE and kept.periods < wanted
    by_site = _counted(one.impacts for one in kept.stretches())
    stop = run.reason or run.stop.value
    if interrupted:
        stop = f"interrupted after {kept.periods} of {wanted} periods; the same command goes on"
    lost = _lost_in(kept)
    return Seen(run, *_judged(run), kept.periods, by_site, lost, interrupted, stop, kept)


def _counted(tables: Iterable[Any]) -> dict[int, int]:
    """Impacts of each site that has any."""
    import numpy as np

    found: dict[int, int] = {}
    for table in tables:
        for site, count in zip(*np.unique(table["site"], return_counts=True), strict=True):
            found[int(site)] = found.get(int(site), 0) + int(count)
    return dict(sorted(found.items()))


def _lost_in(kept: Recording) -> int | None:
    """`life`, piece by piece."""
    import numpy as np

    from contbreather.paper.fates import unlike_a_breather

    wall = 0
    for one in kept.stretches():
        gone = np.flatnonzero(unlike_a_breather(one.impacts, one.periods, one.first, wall))
        if gone.size:
            return one.first + int(gone[0])
        wall = int(one.impacts["wall"][-1]) if one.impacts.size else wall
    return None


def _end_of(kept: Recording, count: int) -> Run:
    """The last periods of a stream as a run."""
    import numpy as np

    from contbreather.dynamics import Run, RunStop, State
    from contbreather.dynamics.conditions import PERIOD
    from contbreather.dynamics.impacting import IMPACT, REST

    first = max(0, kept.periods - count)
    u, v = [kept.start.u[None]], [kept.start.v[None]]
    impacts, rests, stop, reason = [np.empty(0, IMPACT)], [np.empty(0, REST)], RunStop.DONE, ""
    for one in kept.stretches():
        stop, reason = one.stop or stop, one.reason or reason
        if one.first + one.periods < first:
            continue
        u, v = [*u, one.u], [*v, one.v]
        impacts, rests = [*impacts, one.impacts], [*rests, one.rests]
    whole = kept.periods - first + 1
    states = State(np.concatenate(u)[-whole:], np.concatenate(v)[-whole:])
    tables: list[Any] = []
    for table in (np.concatenate(impacts), np.concatenate(rests)):
        late = table[table["period"] >= first].copy()
        late["period"] -= first
        late["time"] += kept.t0
        tables.append(late)
    times = kept.t0 + PERIOD * (first + np.arange(len(states.u)))
    hits, held = tables
    end = (kept.final, kept.end, None, kept.conditions, stop, reason)
    return Run(hits, held, times, states, *end)


def _judged(run: Run | SmoothRun) -> tuple[str, str, dict[str, float]]:
    """Kind, sentence and evidence from the later half of a run."""
    from contbreather.dynamics import Run, RunStop
    from contbreather.dynamics.quasiperiodic import Kind, judge
    from contbreather.dynamics.smooth_verdict import judge_smooth
    from contbreather.errors import ContbreatherError

    half = min(JUDGED, run.periods // 2)
    if run.stop is RunStop.CHATTER:
        return Kind.UNDECIDED.name, "it ends at a chatter", {}
    if half < ENOUGH:
        reason = f"no verdict: {run.periods} periods are too few, give at least {2 * ENOUGH}"
        return Kind.UNDECIDED.name, reason, {}
    later = _later(run, run.periods - half)
    found: Any
    try:
        found = judge(later) if isinstance(later, Run) else judge_smooth(later)
    except ContbreatherError as error:
        return Kind.UNDECIDED.name, f"no verdict: {error}", {}
    return found.kind.name, f"{found.kind.value}; {found.reason}", dict(found.evidence)


def _later(run: Any, skip: int) -> Any:
    """A run without its first periods."""
    from dataclasses import replace

    from contbreather.dynamics import Run, State

    rest: dict[str, Any] = {
        "times": run.times[skip:],
        "strobe": State(run.strobe.u[skip:], run.strobe.v[skip:]),
        # the verdict is about whole periods
        "final": State(run.strobe.u[-1].copy(), run.strobe.v[-1].copy()),
        "end": float(run.times[-1]),
    }
    if isinstance(run, Run):
        for name in ("impacts", "rests"):
            table = getattr(run, name)
            late = table[table["period"] >= skip].copy()
            late["period"] -= skip
            rest[name] = late
    return replace(run, **rest)
