"""Long runs on disk: a folder of files, each written whole or not at all.

``start.npz`` holds what the run began with, ``000000000000.npz``, ... some seconds of the run each,
named by their first period. A file appears under its name only when it is complete, so a run
that was killed at any moment goes on from its last file, and ends with the same bits.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.dynamics.conditions import PERIOD, Conditions, State, check_state, reduced
from contbreather.dynamics.impacting import IMPACT, RunStop, Sample, Stretch, walk
from contbreather.dynamics.progress import Bar
from contbreather.errors import BadInput
from contbreather.files import write_whole
from contbreather.lattice import Forcing, Fourier, Harmonic, forcing_of

EVERY = 5.0  # seconds between two files: what a crash may cost
LARGEST = 4_000_000  # numbers in one file
START = "start.npz"


@dataclass(frozen=True)
class Recording:
    """A run on disk. Nothing is read before it is asked for, and `stretches` reads file by file.

    Attributes
    ----------
    path : Path
    conditions : Conditions
    t0 : float
        Time of the first state.
    sample : Sample or None
    """

    path: Path
    conditions: Conditions
    t0: float
    sample: Sample | None
    start: State

    @property
    def files(self) -> list[Path]:
        """Finished files in order of time."""
        return sorted(p for p in self.path.glob("*.npz") if p.stem.isdigit())

    @property
    def periods(self) -> int:
        """Whole periods on disk."""
        last = self._last()
        return 0 if last is None else last.first + last.periods

    @property
    def final(self) -> State:
        """The state after the last period on disk."""
        for path in reversed(self.files):
            one = read(path)
            if one.periods:
                return State(one.u[-1], one.v[-1])
        return self.start

    @property
    def end(self) -> float:
        """The time of `final`."""
        return self.t0 + PERIOD * self.periods

    @property
    def stop(self) -> RunStop:
        last = self._last()
        return RunStop.DONE if last is None or last.stop is None else last.stop

    def stretches(self) -> Iterator[Stretch]:
        """The run piece by piece, so that memory does not grow with its length."""
        for path in self.files:
            yield read(path)

    @property
    def impacts(self) -> NDArray[np.void]:
        """All impacts, columns as in `Run.impacts`."""
        table = np.concatenate([np.empty(0, IMPACT), *(s.impacts for s in self.stretches())])
        table["time"] += self.t0
        return table

    def strobe(self, n: int | slice = slice(None)) -> State:
        """Stroboscopic displacements and velocities of one site, or of all of them."""
        u = [self.start.u[None, n], *(one.u[:, n] for one in self.stretches())]
        v = [self.start.v[None, n], *(one.v[:, n] for one in self.stretches())]
        return State(np.concatenate(u), np.concatenate(v))

    def _last(self) -> Stretch | None:
        files = self.files
        return read(files[-1]) if files else None


def record(
    path: str | Path,
    state: Any,
    *,
    a: float,
    gamma: float,
    k: float,
    periods: int,
    damping: float = 0.0,
    t0: float = 0.0,
    forcing: Forcing | str | None = None,
    sample: Sample | None = None,
    progress: bool | None = None,
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

    Raises
    ------
    BadInput
        Also where the folder holds another run: the sentence says what differs.

    Examples
    --------
    >>> import tempfile
    >>> from contbreather.breathers import symmetric
    >>> state = symmetric(a=0.5, gamma=0.08, k=0.8).state(20)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = record(f"{folder}/run", state, a=0.5, gamma=0.08, k=0.8, periods=10)
    ...     run = record(f"{folder}/run", state, a=0.5, gamma=0.08, k=0.8, periods=30)
    ...     run.periods, len(run.impacts)
    (30, 60)
    """
    conditions = Conditions(a, gamma, k, damping, forcing_of(forcing))
    wanted = Recording(Path(path), conditions, float(t0), sample, check_state(state))
    count = whole("periods", periods, 0)
    if (wanted.path / START).exists():
        _check_same(open_recording(path), wanted)
    else:
        _make(wanted)
    done = wanted.periods
    if done < count and wanted.stop is RunStop.DONE:
        _go_on(wanted, done, count, progress)
    return wanted


def _go_on(run: Recording, done: int, count: int, progress: bool | None) -> None:
    pending: list[Stretch] = []
    began = time.monotonic()
    ahead = walk(
        run.final,
        run.conditions,
        periods=count - done,
        t0=reduced(run.t0),
        first=done,
        sample=run.sample,
        progress=False,
    )
    with Bar(progress, count) as bar:
        try:
            for one in ahead:
                pending.append(one)
                size = sum(p.u.size + p.dense_u.size for p in pending) * 2
                if time.monotonic() - began > EVERY or size > LARGEST:
                    done = _write(run, pending)
                    pending, began = [], time.monotonic()
                    bar.advance(done)
        except KeyboardInterrupt:
            pass  # what is on disk is a run: only shorter
        finally:
            if pending:
                bar.advance(_write(run, pending))


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
    folder = Path(path)
    if not (folder / START).exists():
        raise BadInput(f"no run in {folder}: there is no {START} in it; make one with record(...)")
    with np.load(folder / START) as file:
        about = json.loads(str(file["about"]))
        start = State(file["u"], file["v"])
    forcing = _forcing(about["harmonics"])
    numbers = {name: about[name] for name in ("a", "gamma", "k", "damping")}
    sample = Sample(**about["sample"]) if about["sample"] else None
    return Recording(folder, Conditions(**numbers, forcing=forcing), about["t0"], sample, start)


def _forcing(harmonics: list[list[float]]) -> Forcing:
    if harmonics == [[1, 1.0, 0.0]]:
        return Harmonic()
    return Fourier.from_response(
        {int(m): c for m, c, _ in harmonics}, {int(m): s for m, _, s in harmonics}
    )


def _about(run: Recording) -> dict[str, Any]:
    sample = None
    if run.sample is not None:
        sample = {"sites": list(run.sample.sites), "per_period": run.sample.per_period}
    harmonics = [[int(m), float(c), float(s)] for m, c, s in run.conditions.forcing.harmonics]
    numbers = {name: float(value) for name, value in run.conditions.as_params().items()}
    return {**numbers, "t0": run.t0, "sample": sample, "harmonics": harmonics}


def _check_same(there: Recording, wanted: Recording) -> None:
    old, new = _about(there), _about(wanted)
    for name in old:
        same = old[name] == new[name]
        if name == "harmonics":  # those of F and of f are converted into each other on the way
            same = np.shape(old[name]) == np.shape(new[name]) and np.allclose(
                old[name], new[name], rtol=1e-14, atol=0
            )
        if not same:
            raise BadInput(
                f"{there.path} holds another run: {name} is {old[name]} there and {new[name]} "
                "here; choose another folder, or the same settings to go on with it."
            )
    if not all(np.array_equal(a, b) for a, b in zip(there.start, wanted.start, strict=True)):
        raise BadInput(
            f"{there.path} holds a run from another state; choose another folder, or start from "
            f"open_recording({str(there.path)!r}).start to go on with it."
        )


def _make(run: Recording) -> None:
    try:
        run.path.mkdir(parents=True, exist_ok=True)
        others = [p.name for p in run.path.iterdir()]
        if others:
            raise BadInput(f"{run.path} is not empty and holds no run; choose another folder.")
        save(run.path / START, {"about": np.array(json.dumps(_about(run))), **run.start._asdict()})
    except OSError as error:
        raise BadInput(
            f"cannot write {run.path}: {error.strerror}; choose another place."
        ) from error


def _write(run: Recording, pieces: list[Stretch]) -> int:
    """One file from some stretches; the number of periods now on disk."""
    first, last = pieces[0], pieces[-1]
    names = ("u", "v", "impacts", "rests", "dense_u", "dense_v")
    columns = {name: np.concatenate([getattr(p, name) for p in pieces]) for name in names}
    stop = "" if last.stop is None else last.stop.name
    texts = {"stop": np.array(stop), "reason": np.array(last.reason)}
    save(run.path / f"{first.first:012d}.npz", {**columns, **texts, "first": np.array(first.first)})
    return last.first + last.periods


def read(path: Path) -> Stretch:
    """One file of a run."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    stop = str(arrays.pop("stop"))
    texts = {"reason": str(arrays.pop("reason")), "first": int(arrays.pop("first"))}
    return Stretch(**arrays, **texts, stop=RunStop[stop] if stop else None)  # type: ignore[arg-type]


def save(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """An npz file that is there whole or not at all."""
    write_whole(path, lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]


__all__ = ["Recording", "open_recording", "record"]
