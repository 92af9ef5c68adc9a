"""What the buttons do: each a computation, and the line of the script that does the same."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from contbreather.continuation import Branch, boundary, trace
from contbreather.continuation.switching import switch
from contbreather.errors import BadInput
from contbreather.explorer.jobs import Job, Progress
from contbreather.explorer.state import Chosen
from contbreather.lattice import Ring
from contbreather.lattice.parse import as_code, lattice_by, walls_by
from contbreather.orbits import symmetric
from contbreather.simulation import Run, RunStop, Sample, judge, simulate

Window = tuple[float, float]
MOMENTS = 32  # in a period, at which a simulation is seen
JUDGED = 300  # sites at most of a run that is judged


@dataclass(frozen=True)
class Work:
    """A computation."""

    title: str  # what is under way, for people
    name: str  # of its result in the script, without its number
    code: str  # the expression that gives it
    job: Job
    setup: tuple[str, ...] = ()  # lines of the script that come before


@dataclass(frozen=True)
class OnLattice:
    """A lattice, and how the script makes it."""

    lattice: Any
    code: str

    @classmethod
    def typed(cls, text: str) -> OnLattice:
        """By what is typed at the command line, too; the infinite chain for nothing."""
        return cls(lattice_by(text or None), as_code(text) if text else "")


def breather(on: OnLattice, **values: Any) -> Chosen:
    """A breather by its parameters, typed in or clicked at: what `symmetric` takes, walls as at the
    command line; None, and text that is empty, for what was not given.

    Raises
    ------
    BadInput
        If there is none, or a value is out of range.
    """
    params, words = arguments(on, **values)
    return Chosen(f"cb.symmetric({words})", symmetric(**params), typed=tuple(values.items()))


def arguments(on: OnLattice, **values: Any) -> tuple[dict[str, Any], str]:
    """What was typed, as the library takes it and as the script has it."""
    params = {name: value for name, value in values.items() if value not in (None, "")}
    codes = {name: repr(value) for name, value in params.items() if (name, value) != ("site", 0)}
    if on.code:
        params["lattice"], codes["lattice"] = on.lattice, on.code
    if "walls" in params:
        params["walls"] = walls_by(params["walls"].split(), on.lattice.sites)
        codes["walls"] = repr(params["walls"])
    return params, ", ".join(f"{name}={code}" for name, code in codes.items())


def point_of(code: str, branch: Branch, index: int) -> Chosen:
    """A point of a curve; of one that was loaded without its equations its numbers only."""
    point = branch[index]
    try:
        orbit = point.solution
    except BadInput:
        orbit = None
    if not hasattr(orbit, "admissibility"):  # what another problem's points are is its own
        orbit = None
    place = f".first({point.label!r})" if point.label else f"[{index}]"
    return Chosen(code + place, orbit, point, code, index)


def traced(chosen: Chosen, free: str, window: Window) -> Work:
    """The branch through it in one parameter."""
    start = chosen.orbit if chosen.point is None else chosen.point
    within = {free: window}
    code = f'cb.trace({chosen.code}, "{free}", within={within})'
    return Work(
        f"branch in {free}", "branch", code,
        lambda progress: trace(start, free, within=within, progress=progress.points()),
    )  # fmt: skip


def switched(chosen: Chosen) -> Work:
    """All that leaves a special point."""
    point = _special(chosen, "to switch at")
    return Work(
        f"arms of {point.label}", "arms", f"cb.switch({chosen.code})",
        lambda progress: switch(point, progress=progress.points()),
    )  # fmt: skip


def bounded(chosen: Chosen, pair: tuple[str, str], within: Mapping[str, Window]) -> Work:
    """The curve of a special point in two parameters."""
    point = _special(chosen, "to trace")
    windows = {name: within[name] for name in pair if name in within}
    return Work(
        f"boundary of {point.label}", "line",
        f"cb.boundary({chosen.code}, {pair}, within={windows})",
        lambda progress: boundary(point, pair, within=windows, progress=progress.points()),
    )  # fmt: skip


def _special(chosen: Chosen, what: str) -> Any:
    if chosen.point is None or not chosen.point.kind:
        raise BadInput(
            f"no special point {what}: choose one of the labelled points of a curve first."
        )
    return chosen.point


def simulated(
    chosen: Chosen, sites: int, periods: int, push: float, watched: tuple[int, ...]
) -> Work:
    """The lattice let go from its state, with a push to the site that impacts."""
    if chosen.orbit is None:
        raise BadInput("nothing to simulate: choose a breather or a point of its branch first.")
    infinite = chosen.orbit.lattice.sites is None
    orbit = chosen.orbit.on(Ring(sites)) if infinite else chosen.orbit
    site, size = orbit.section.hit[0], orbit.lattice.sites
    sample = Sample(tuple(n for n in watched if -size <= n < size) or (site,), MOMENTS)

    def job(progress: Progress) -> Any:
        u, v = (np.array(x) for x in orbit.state())
        v[site] += push
        shown = progress.periods(periods)
        run = simulate(
            (u, v), **vars(orbit.conditions), periods=periods, sample=sample, progress=shown
        )
        fate(run)  # here, not where pages are drawn
        return run

    setup = (
        f"orbit = {chosen.code}" + f".on(cb.Ring({sites}))" * infinite,
        "u, v = (one.copy() for one in orbit.state())",
        f"v[{site}] += {push!r}",
        f"sample = cb.simulation.Sample({sample.sites}, {MOMENTS})",
    )
    code = f"cb.simulate((u, v), **vars(orbit.conditions), periods={periods}, sample=sample)"
    return Work(f"{periods} periods on the {orbit.lattice.describe()}", "run", code, job, setup)


@lru_cache(maxsize=1)
def fate(run: Run) -> str:
    """The verdict on a run where that takes no minutes, else how it ended."""
    if run.stop is RunStop.DONE and run.sites <= JUDGED:
        with suppress(BadInput):  # of too few periods
            return judge(run).kind.value
    return run.stop.value
