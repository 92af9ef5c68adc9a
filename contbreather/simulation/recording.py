"""Long runs on disk: a folder of files, each written whole or not at all.

``start.npz`` holds what the run began with, ``000000000000-000000000123.npz``, ... some seconds of
the run each, named by their first period and the one after their last. A file appears under its
name only when it is complete, so a run that was killed at any moment goes on from its last file,
and ends with the same bits.

Each file ends with a checksum of itself (the comment of a zip file, so that anything that reads npz
reads it) and knows that of the file before it: nothing is taken from a file that was altered, and
none can be missing, exchanged or another run's without being noticed.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import time
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.errors import BadInput
from contbreather.files import alone, named, write_whole
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.finite import Lattice
from contbreather.lattice.forcing import Forcing, Fourier, Harmonic
from contbreather.parameters import NAMES
from contbreather.progress import Bar
from contbreather.simulation.integrator import (
    IMPACT,
    Chunk,
    EventDriven,
    RunStop,
    Sample,
    check_sample,
    in_chunks,
    joined_chunks,
)
from contbreather.simulation.simulate import SimulationRun, joined
from contbreather.simulation.states import (
    PERIOD,
    ModelParameters,
    State,
    ranged,
    start_of,
    time_of,
    within,
    within_period,
)
from contbreather.storage.serialise import NotSerialisable, from_dict, to_dict
from contbreather.tables import Cell, HtmlRepr, Sheet

EVERY = 5.0  # seconds between two files: what a crash may cost
LARGEST = 4_000_000  # numbers in one file
START = "start.npz"
LOCK = "lock"
NAME = re.compile(r"(\d{12,})-(\d{12,})\.npz")
CHECKSUM = 32  # bytes of it


@dataclass(frozen=True)
class Recording(HtmlRepr):
    """A run on disk. Nothing is read before it is asked for, and `chunks` reads file by file.

    Attributes
    ----------
    path : Path
    conditions : Conditions
    t0 : float
        Time of the first state.
    sample : Sample or None
    interrupted : bool
        Whether the call that gives it back was cut short by Ctrl-C; what it had done is on disk.
    """

    path: Path
    conditions: Conditions
    t0: float
    sample: Sample | None
    start: State
    interrupted: bool = False

    @property
    def files(self) -> list[Path]:
        """Finished files in order of time; a sentence where one between them is missing."""
        files = sorted(p for p in _listed(self.path) if NAME.fullmatch(p.name))
        end, before = 0, START
        for path in files:
            first, after = _span(path)
            if first != end:
                raise BadInput(
                    f"{self.path} is damaged: {path.name} does not follow on from {before}, which "
                    f"ends at period {end}; bring the files between them back, or remove "
                    f"{path.name} and those after it to go on from there."
                )
            end, before = after, path.name
        return files

    @property
    def periods(self) -> int:
        """Whole periods on disk."""
        files = self.files
        return _span(files[-1])[1] if files else 0

    @property
    def final(self) -> State:
        """The state after the last period on disk."""
        for path in reversed(self.files):
            stretch = read_part(path)
            if stretch.periods:
                return State(stretch.u[-1], stretch.v[-1])
        return self.start

    @property
    def end(self) -> float:
        """The time of `final`."""
        return self.t0 + PERIOD * self.periods

    @property
    def stop(self) -> RunStop:
        if self.interrupted:
            return RunStop.INTERRUPTED
        files = self.files
        return (read_part(files[-1]).stop if files else None) or RunStop.DONE

    def table(self) -> Sheet:
        """How long it is, how it ended, and what it moved under; impacts are not counted, they may
        be too many to read."""
        rows: list[tuple[str, Cell]] = [
            ("sites", self.start.u.size),
            ("periods", self.periods),
            ("files", len(self.files)),
            ("until t =", self.end),
            ("then |u| <=", float(abs(self.final.u).max())),
            ("end", self.stop.value),
        ]
        return Sheet.of([*rows, *self.conditions.params.items()])

    def chunks(self) -> Iterator[Chunk]:
        """The run piece by piece, so that memory does not grow with its length."""
        for before, path in pairwise([self.path / START, *self.files]):
            yield read_part(path, after=before)

    @property
    def impacts(self) -> NDArray[np.void]:
        """All impacts, columns as in `Run.impacts`."""
        table = np.concatenate([np.empty(0, IMPACT), *(s.impacts for s in self.chunks())])
        table["time"] += self.t0
        return table

    def last(self, periods: int) -> SimulationRun:
        """Its last periods as a run."""
        first, start, chunks = max(0, self.periods - periods), self.start, list[Chunk]()
        for chunk in self.chunks():
            if chunk.first + chunk.periods < first:
                start = State(chunk.u[-1], chunk.v[-1])
            else:
                chunks.append(chunk)
        left = joined(chunks, start, self.t0, None)
        before = chunks[0].first if chunks else 0
        return SimulationRun(conditions=self.conditions, **left).since(first - before)

    def strobe(self, n: int | slice = slice(None)) -> State:
        """Stroboscopic displacements and velocities of one site, or of all of them."""
        u = [self.start.u[None, n], *(s.u[:, n] for s in self.chunks())]
        v = [self.start.v[None, n], *(s.v[:, n] for s in self.chunks())]
        return State(np.concatenate(u), np.concatenate(v))


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
    """`simulate` into a folder: for runs longer than memory or patience.

    Called again with the same arguments (and as many periods or more) it goes on where the last
    finished file ends; the result is the same, bit for bit, as that of an uninterrupted run.

    Parameters
    ----------
    path : str or Path
        A folder, made unless it exists.
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
        Also where the folder holds another run (the sentence says what differs), is being written
        to by somebody else, or is damaged.

    Examples
    --------
    >>> import tempfile
    >>> from contbreather.orbits import symmetric
    >>> state = symmetric(a=0.5, gamma=0.08, k=0.8).state(20)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = record(f"{folder}/run", state, a=0.5, gamma=0.08, k=0.8, periods=10)
    ...     run = record(f"{folder}/run", state, a=0.5, gamma=0.08, k=0.8, periods=30)
    ...     run.periods, len(run.impacts)
    (30, 60)
    """
    start, conditions = start_of(state, None, t0, **on)
    check_sample(sample, start.u.size)
    start = within(start, conditions.walls)
    wanted = Recording(named("write", path), conditions, time_of(t0), sample, start)
    count = whole("periods", periods, 0)
    with _locked(wanted.path):
        if os.path.lexists(wanted.path / START):
            _check_same(open_recording(path), wanted)
        else:
            _make(wanted)
        done = wanted.periods
        if done < count and wanted.stop is RunStop.DONE:
            return replace(wanted, interrupted=_go_on(wanted, done, count, progress))
    return wanted


def _go_on(run: Recording, done: int, count: int, progress: bool | Bar | None) -> bool:
    """Simulate and write; whether Ctrl-C ended it. What is on disk is a run: only shorter."""
    pending: list[Chunk] = []
    began = time.monotonic()
    integrator = EventDriven(run.final, run.conditions, within_period(run.t0), run.sample)
    ahead = in_chunks(integrator, periods=count - done, first=done, progress=False)
    with Bar(progress, count) as bar:
        try:
            for stretch in ahead:
                pending.append(stretch)
                size = sum(p.u.size + p.dense_u.size for p in pending) * 2
                if time.monotonic() - began > EVERY or size > LARGEST:
                    done = _write(run, pending)
                    pending, began = [], time.monotonic()
                    bar.advance(done)
        except KeyboardInterrupt:
            return True
        finally:
            if pending:
                bar.advance(_write(run, pending))
    return False


# --- files ----------------------------------------------------------------------------------------


def open_recording(path: str | Path) -> Recording:
    """A run on disk.

    Raises
    ------
    BadInput
        If there is none.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = record(f"{folder}/run", ([0.2], [0.3]), a=0.5, gamma=0.0, k=0.8, periods=7)
    ...     open_recording(f"{folder}/run").periods
    7
    """
    folder = named("read", path)
    if not os.path.lexists(folder / START):
        raise BadInput(f"no run in {folder}: there is no {START} in it; make one with record(...)")
    arrays = _arrays(folder / START)
    with _as_written(folder / START):
        about = json.loads(str(arrays["about"]))
        earlier = "conditions" not in about
        conditions = _earlier(about, arrays) if earlier else from_dict(about["conditions"])
        sample = Sample(**about["sample"]) if about["sample"] else None
        start = State(arrays["u"], arrays["v"])
        run = Recording(folder, ranged(conditions), about["t0"], sample, start)
    _ = run.files  # those that are missing are told of before anything is read
    return run


def _earlier(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Conditions:
    """As versions wrote them whose forcings were harmonics and whose lattices were arrays."""
    of_all, *of_sites = about["walls"]
    parts = [arrays[name] for name in ("stiffness", "masses", "drive") if name in arrays]
    return Conditions(
        **{name: about[name] for name in NAMES},
        forcing=_by_harmonics(about["harmonics"]),
        walls=Walls(tuple(of_all), tuple((site, (low, high)) for site, low, high in of_sites)),
        lattice=Lattice(*parts, name=about["lattice"]) if parts else Ring(arrays["u"].size),
    )


def _by_harmonics(harmonics: Iterable[Sequence[float]]) -> Forcing:
    rows = [(int(m), float(c), float(s)) for m, c, s in harmonics]
    if rows == [(1, 1.0, 0.0)]:
        return Harmonic()
    return Fourier.from_response({m: c for m, c, _ in rows}, {m: s for m, _, s in rows})


def _check_same(there: Recording, wanted: Recording) -> None:
    for name in (*NAMES, "forcing", "walls", "t0", "sample", "start", "lattice"):
        old, new = (
            getattr(run if hasattr(run, name) else run.conditions, name) for run in (there, wanted)
        )
        if name == "forcing":  # the harmonics of F and of f are converted into each other
            rows, other = np.array([*old.harmonics]), np.array([*new.harmonics])
            same = rows.shape == other.shape and np.allclose(rows, other, rtol=1e-14, atol=0)
        else:
            same = np.array_equal(old, new) if name == "start" else old == new
        if not same and name == "start":
            raise BadInput(
                f"{there.path} holds a run from another state; choose another folder, or start "
                f"from open_recording({str(there.path)!r}).start to go on with it."
            )
        if not same:
            was, here = (x.describe() if hasattr(x, "describe") else x for x in (old, new))
            what = f"is {was} there and {here}" if was != here else f"is another {here} than"
            raise BadInput(
                f"{there.path} holds another run: {name} {what} here; choose another folder, or "
                "the same settings to go on with it."
            )


def _make(run: Recording) -> None:
    # what a process that was killed has left half written is nobody's
    others = [p.name for p in _listed(run.path) if p.name != LOCK and p.suffix != ".part"]
    if others:
        raise BadInput(f"{run.path} is not empty and holds no run; choose another folder.")
    on = run.conditions
    try:
        conditions = to_dict(on)
    except NotSerialisable:  # somebody's own forcing: a run needs no more than its harmonics
        conditions = to_dict(replace(on, forcing=_by_harmonics(on.forcing.harmonics)))
    about = {"conditions": conditions, "t0": run.t0, "sample": run.sample and vars(run.sample)}
    save_part(run.path / START, {"about": np.array(json.dumps(about)), **run.start._asdict()})


@contextmanager
def _allowed(what: str, path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        why = error.strerror or error
        raise BadInput(f"cannot {what} {path}: {why}; choose another place.") from error


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Nobody else writes to the folder meanwhile; the system lets go when the process ends."""
    with _allowed("write", folder):
        folder.mkdir(parents=True, exist_ok=True)
        number = os.open(folder / LOCK, os.O_WRONLY | os.O_CREAT, 0o666)
    try:
        with _allowed("lock", folder):
            taken = alone(number)
        if not taken:
            raise BadInput(
                f"{folder} is being written to by another run; wait for its end, or choose another "
                "folder."
            )
        yield
    finally:
        os.close(number)


def _listed(folder: Path) -> list[Path]:
    with _allowed("read", folder):
        return list(folder.iterdir())


def _span(path: Path) -> tuple[int, int]:
    """First period of a file, and the one after its last, by its name."""
    name = NAME.fullmatch(path.name)
    assert name is not None
    return int(name[1]), int(name[2])


def _write(run: Recording, pieces: list[Chunk]) -> int:
    """One file from some chunks; the number of periods now on disk."""
    first, last = pieces[0], pieces[-1]
    stop = "" if last.stop is None else last.stop.name
    texts = {"stop": np.array(stop), "reason": np.array(last.reason)}
    done = last.first + last.periods
    path = run.path / f"{first.first:012d}-{done:012d}.npz"
    before = [run.path / START, *(p for p in run.files if p != path)][-1]
    link = np.frombuffer(_bytes(before, last=CHECKSUM), np.uint8)
    save_part(
        path, {**joined_chunks(pieces), **texts, "first": np.array(first.first), "link": link}
    )
    return done


def read_part(path: Path, *, after: Path | None = None) -> Chunk:
    """One file of a run, which is to follow another one if that is given."""
    arrays = _arrays(path)
    with _as_written(path):
        link = arrays.pop("link").tobytes()
        stop, first = str(arrays.pop("stop")), int(arrays.pop("first"))
        texts = {"reason": str(arrays.pop("reason")), "first": first}
        stretch = Chunk(**arrays, **texts, stop=RunStop[stop] if stop else None)  # type: ignore[arg-type]
        if _span(path) != (first, first + stretch.periods):
            raise ValueError("its name is that of another file")
    if after is not None and link != _bytes(after, last=CHECKSUM):
        raise _damaged(path, f"it was not written after the {after.name} that is there")
    return stretch


def save_part(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """An npz file with its checksum, there whole or not at all, even after a loss of power."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    # the last two bytes of a zip file are the length of the comment behind them
    body = buffer.getvalue()[:-2] + CHECKSUM.to_bytes(2, "little")
    write_whole(path, lambda file: file.write(body + hashlib.sha256(body).digest()))


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a file, once its checksum has shown that it is as it was written."""
    data = _bytes(path)
    if len(data) < CHECKSUM or hashlib.sha256(data[:-CHECKSUM]).digest() != data[-CHECKSUM:]:
        raise _damaged(path, "its checksum does not fit what is in it")
    with _as_written(path), np.load(io.BytesIO(data)) as file:
        return {name: file[name] for name in file.files}


def _bytes(path: Path, *, last: int | None = None) -> bytes:
    """What is in a file, or the last bytes of it."""
    if not os.path.isfile(path):  # a pipe would be waited for
        raise _damaged(
            path, "it is not an ordinary file" if os.path.lexists(path) else "it is missing"
        )
    try:
        with open(path, "rb") as file:
            if last is not None:
                file.seek(max(0, os.path.getsize(path) - last))
            return file.read()
    except OSError as error:
        raise _damaged(path, error.strerror or str(error)) from error


@contextmanager
def _as_written(path: Path) -> Iterator[None]:
    """What is sound, yet not as this version writes it, is refused as well."""
    try:
        yield
    except (KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        if isinstance(error, BadInput):
            raise
        raise _damaged(path, f"this version does not write such a file ({error})") from error


def _damaged(path: Path, why: str) -> BadInput:
    return BadInput(
        f"{path} is damaged: {why}; bring it back from a copy, or remove it and all files after it "
        "to go on from there."
    )
