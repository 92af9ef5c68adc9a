"""Long runs on disk: one netCDF file a run, which goes on where it ends, with the same bits.

The file is what `contbreather.save` writes of a run, so `contbreather.load` reads it as well, all
at once. A run appends to a copy without a name; now and then the copy is written in the place of
the file, whole or not at all. A process that is killed at any moment leaves what it saved last.
"""

from __future__ import annotations

import os
import time
from bisect import bisect_left
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.errors import BadInput, deferred
from contbreather.files import named
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.forcing import Fourier
from contbreather.parameters import NAMES
from contbreather.progress import Bar
from contbreather.simulation.integrator import (
    IMPACT,
    REST,
    Chunk,
    EventDriven,
    RunStop,
    Sample,
    check_sample,
    in_chunks,
    periods_at_once,
)
from contbreather.simulation.simulate import SimulationRun, event_table, joined
from contbreather.simulation.states import (
    PERIOD,
    ModelParameters,
    State,
    ranged,
    start_of,
    within,
    within_period,
)
from contbreather.storage.netcdf import (
    GrowingFile,
    about_of,
    checked_image,
    growing_file,
    target_of,
    write_file,
)
from contbreather.storage.serialise import NotSerialisable, from_dict, to_dict
from contbreather.tables import Cell, HtmlRepr, Sheet

if TYPE_CHECKING:
    import h5py

EVERY = 1.0  # seconds between two saves at least
SAMPLED = ("sample_u", "sample_v")
RECORDED = "samples_per_period"  # attribute that a recording has, and no other file


@dataclass(frozen=True)
class Recording(HtmlRepr):
    """A run on disk, as long as it was when it was opened: `chunks` reads it piece by piece.

    Attributes
    ----------
    path : Path
    conditions : Conditions
    t0 : float
        Time of the first state.
    sample : Sample or None
    start : State
        The first state.
    final : State
        The state after the last period on disk.
    periods : int
        Whole periods on disk.
    stop : RunStop
        ``INTERRUPTED`` where Ctrl-C cut the call short that gives it back.
    """

    path: Path
    conditions: Conditions
    t0: float
    sample: Sample | None
    start: State
    final: State
    periods: int = 0
    stop: RunStop = RunStop.DONE

    @property
    def interrupted(self) -> bool:
        return self.stop is RunStop.INTERRUPTED

    @property
    def end(self) -> float:
        return self.t0 + PERIOD * self.periods

    def table(self) -> Sheet:
        """Its length, its end, and what it moved under; impacts are not counted, they may be too
        many to read."""
        rows: list[tuple[str, Cell]] = [
            ("sites", self.start.u.size),
            ("periods", self.periods),
            ("until t =", self.end),
            ("then |u| <=", float(abs(self.final.u).max())),
            ("end", self.stop.value),
        ]
        return Sheet.of([*rows, *self.conditions.params.items()])

    def chunks(self) -> Iterator[Chunk]:
        """The run piece by piece, so that memory does not grow with its length; times are those of
        the run, as in `impacts`."""
        count = periods_at_once(self.start.u.size, self.sample)
        with _opened(self.path) as group:
            for first in range(0, self.periods, count):
                yield self._chunk(group, first, min(first + count, self.periods))

    def _chunk(self, group: h5py.Group, first: int, after: int) -> Chunk:
        u, v = (group[name][first + 1 : after + 1] for name in "uv")
        dense_u = dense_v = np.empty((after - first, 0, 0))
        if self.sample is not None:
            count = self.sample.per_period
            samples = (group[name][first * count : after * count] for name in SAMPLED)
            dense_u, dense_v = (x.reshape(after - first, count, -1) for x in samples)
        tables = []
        for kind, dtype in (("impact", IMPACT), ("rest", REST)):
            period = group[f"{kind}_period"]
            rows = slice(bisect_left(period, first), bisect_left(period, after))
            if after == len(group["u"]) - 1:  # a rest may begin after the last period
                rows = slice(rows.start, None)
            names = [f"{kind}_{name}" for name in dtype.names or ()]
            tables.append(event_table({name: group[name][rows] for name in names}, kind, dtype))
        return Chunk(first, u, v, dense_u, dense_v, *tables)

    @property
    def impacts(self) -> NDArray[np.void]:
        """Impacts of the whole run, columns as in `Run.impacts`."""
        return np.concatenate([np.empty(0, IMPACT), *(s.impacts for s in self.chunks())])

    def last(self, periods: int) -> SimulationRun:
        """Its last periods as a run."""
        first = max(0, self.periods - periods)
        with _opened(self.path) as group:
            chunk, reason = self._chunk(group, first, self.periods), about_of(group)["reason"]
            times, u, v = (group[name][first : self.periods + 1] for name in ("time", "u", "v"))
        for table in (chunk.impacts, chunk.rests):
            table["period"] -= first
        ends: dict[str, Any] = {"final": self.final, "end": self.end, "stop": self.stop}
        return SimulationRun(
            times=times, strobe=State(u, v), record=None, conditions=self.conditions,
            impacts=chunk.impacts, rests=chunk.rests, reason=reason, **ends,
        )  # fmt: skip

    def strobe(self, n: int | slice = slice(None)) -> State:
        """Stroboscopic displacements and velocities of one site, or of all of them."""
        with _opened(self.path) as group:
            return State(*(group[name][: self.periods + 1, n] for name in "uv"))


def record(
    path: str | Path,
    state: Any,
    *,
    periods: int,
    t0: float = 0.0,
    sample: Sample | None = None,
    progress: bool | Bar | None = None,
    **on: Unpack[ModelParameters],
) -> Recording:
    """`simulate` into a file: for runs longer than memory or patience.

    Called again with the same arguments (and as many periods or more) it goes on where the file
    ends; the result is the same, bit for bit, as that of an uninterrupted run. The file is saved at
    most once in a second, and so seldom that saving takes a twentieth of the time: that much of a
    run may be lost with its process, no more.

    Parameters
    ----------
    path : str or Path
        A file, ``run.nc`` for instance.
    periods : int
        Length of the whole run, what is on disk already included.

    Other parameters, and errors, are those of `simulate`.

    Returns
    -------
    Recording
        After Ctrl-C as well, `interrupted`, with the periods completed until then.

    Raises
    ------
    BadInput
        Also where the file holds another run (the sentence says what differs), or is damaged.

    Examples
    --------
    >>> import tempfile
    >>> from contbreather.orbits import symmetric
    >>> state = symmetric(a=0.5, gamma=0.08, k=0.8).state(20)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = record(f"{folder}/run.nc", state, a=0.5, gamma=0.08, k=0.8, periods=10)
    ...     run = record(f"{folder}/run.nc", state, a=0.5, gamma=0.08, k=0.8, periods=30)
    ...     run.periods, len(run.impacts)
    (30, 60)
    """
    start, conditions = start_of(state, None, t0, **on)
    check_sample(sample, start.u.size)
    start, count = within(start, conditions.walls), whole("periods", periods, 0)
    place = named("write", path)
    wanted = Recording(place, conditions, float(t0), sample, start, start)
    if os.path.lexists(place):
        there = open_recording(place)
        _check_same(there, wanted)
        wanted = replace(there, conditions=conditions)
    else:
        _begin(wanted)
    if wanted.stop is RunStop.DONE and wanted.periods < count:
        return _go_on(wanted, count, progress)
    return wanted


def _begin(run: Recording) -> None:
    conditions = run.conditions
    try:
        to_dict(conditions)
    except NotSerialisable:  # somebody's own forcing: a run needs no more than its harmonics
        rows = conditions.forcing.harmonics
        cos, sin = {m: c for m, c, _ in rows}, {m: s for m, _, s in rows}
        conditions = replace(conditions, forcing=Fourier.from_response(cos, sin))
    nothing = joined([], run.start, run.t0, run.sample)
    content = to_dict(SimulationRun(conditions=conditions, **nothing))
    content["attributes"] = {RECORDED: str(run.sample.per_period if run.sample else 0)}
    growing = ("strobe", "impact", "rest", "sample")
    write_file(target_of(run.path), {"run": content}, alone=True, growing=growing)


def _go_on(run: Recording, count: int, progress: bool | Bar | None) -> Recording:
    """Simulate, append and save; what is on disk is a run at any time, only shorter."""
    integrator = EventDriven(run.final, run.conditions, within_period(run.t0), run.sample)
    missing = count - run.periods
    ahead = in_chunks(integrator, periods=missing, first=run.periods, progress=False)
    interrupted, due = False, time.monotonic() + EVERY
    with Bar(progress, count) as bar, growing_file(run.path) as file:
        try:
            for chunk in ahead:
                with deferred():  # half a chunk would be no run
                    run = _appended(run, file, chunk)
                    began = time.monotonic()
                    if began > due:
                        file.save()
                        now = time.monotonic()
                        # the longer a run is the longer a save takes: a twentieth of the time
                        due = now + max(EVERY, 20.0 * (now - began))
                bar.advance(run.periods)
        except KeyboardInterrupt:
            interrupted = True
        finally:
            with deferred():
                file.save()
    return replace(run, stop=RunStop.INTERRUPTED) if interrupted else run


def _appended(run: Recording, file: GrowingFile, chunk: Chunk) -> Recording:
    after, sampled = run.periods + chunk.periods, run.sample.per_period if run.sample else 0
    strobe = run.t0 + PERIOD * np.arange(run.periods + 1, after + 1)
    columns: dict[str, Any] = {"time": strobe, "u": chunk.u, "v": chunk.v}
    if run.sample is not None:
        times = np.arange(sampled * run.periods, sampled * after)
        columns["sample_time"] = run.t0 + PERIOD / sampled * times
        for name, rows in zip(SAMPLED, (chunk.dense_u, chunk.dense_v), strict=True):
            columns[name] = rows.reshape(len(times), -1)
    for kind, table in (("impact", chunk.impacts), ("rest", chunk.rests)):
        table["time"] += run.t0
        columns |= {f"{kind}_{name}": table[name] for name in table.dtype.names or ()}
    file.append(columns)
    final = State(chunk.u[-1], chunk.v[-1]) if chunk.periods else run.final
    run = replace(run, periods=after, final=final, stop=chunk.stop or RunStop.DONE)
    for name, value in (("final_u", final.u), ("final_v", final.v), ("end", run.end)):
        file.group[name][...] = value
    if chunk.stop:
        file.describe(stop=run.stop.name, reason=chunk.reason)
    return run


# --- what is there --------------------------------------------------------------------------------


def open_recording(path: str | Path) -> Recording:
    """A run on disk.

    Raises
    ------
    BadInput
        If there is none, or it is damaged.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = record(f"{folder}/run.nc", ([0.2], [0.3]), a=0.5, gamma=0.0, k=0.8, periods=7)
    ...     open_recording(f"{folder}/run.nc").periods
    7
    """
    place = named("read", path)
    if place.is_dir():
        raise BadInput(
            f"{place} is a folder, as versions before recorded into; a recording is one file, "
            f"{place / 'run.nc'} for instance: record the run anew"
        )
    with _opened(place) as group:
        about, times, count = about_of(group), group["time"], int(group.attrs[RECORDED])
        sites = group["sampled_sites"][()].tolist() if count else ()
        start, final = (State(group["u"][i], group["v"][i]) for i in (0, -1))
        ends: dict[str, Any] = {"periods": len(times) - 1, "stop": RunStop[about["stop"]]}
        sample = Sample(tuple(sites), count) if count else None
        conditions = ranged(from_dict(about["conditions"]))
        return Recording(place, conditions, float(times[0]), sample, start, final, **ends)


@contextmanager
def _opened(path: Path) -> Iterator[h5py.Group]:
    """The run in a file whose checksum is its own."""
    with checked_image(path) as root:
        groups = list(root.values())
        if len(groups) != 1 or RECORDED not in groups[0].attrs:
            raise BadInput(
                f"{path} holds no recording: it was saved, and contbreather.load reads it"
            )
        yield groups[0]


def _check_same(there: Recording, wanted: Recording) -> None:
    for name in (*NAMES, "forcing", "walls", "t0", "sample", "lattice"):
        old, new = (
            getattr(run if hasattr(run, name) else run.conditions, name) for run in (there, wanted)
        )
        same = old == new
        if name == "forcing":  # the harmonics of F and of f are converted into each other
            rows, other = np.array([*old.harmonics]), np.array([*new.harmonics])
            same = rows.shape == other.shape and np.allclose(rows, other, rtol=1e-14, atol=0)
        if not same:
            was, here = (x.describe() if hasattr(x, "describe") else x for x in (old, new))
            what = f"is {was} there and {here}" if was != here else f"is another {here} than"
            raise BadInput(
                f"{there.path} holds another run: {name} {what} here; choose another file, or "
                "the same settings to go on with it."
            )
    if not np.array_equal(there.start, wanted.start):
        raise BadInput(
            f"{there.path} holds a run from another state; choose another file, or start "
            f"from open_recording({str(there.path)!r}).start to go on with it."
        )
