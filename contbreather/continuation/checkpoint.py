"""Results on disk while they are computed: what a killed process loses is some seconds."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from ..checks import kind_of
from ..errors import BadInput, Interrupted, add_partial_result, partial_result
from ..storage import netcdf
from ..storage.serialise import NotSerialisable
from .branch_to_dict import result_to_dict

T = TypeVar("T")

EVERY = 3.0  # seconds between two files
SHARE = 0.03  # of the time that a run takes, at most, goes into writing them


def write_results(
    path: str | Path, results: Mapping[str, Any], *, alone: bool, recorded: bool | None = True
) -> Path:
    """Write results by their names to one file; `alone` if the only one is what the file is, and
    `recorded` as of `result_to_dict`."""
    target = netcdf.target_of(path)  # recorded columns may take long
    try:
        contents = {
            name: result_to_dict(result, recorded=recorded) for name, result in results.items()
        }
    except NotSerialisable as error:
        raise BadInput(
            f"{kind_of(error.args[0])} cannot be kept in a file; branches, boundaries, diagrams, "
            "zones, and simulated runs can"
        ) from error
    return netcdf.write_file(target, contents, alone=alone)


class NotKept(BadInput):
    """What was computed could not be written; it is the `result` of this."""

    def __init__(self, message: str, result: Any) -> None:
        super().__init__(message)
        self.result = result


class Checkpoint:
    """A file that is written anew every few seconds, and where something happens.

    Parameters
    ----------
    path : str or Path
    name : str
        That of the result in it; those of a tuple are numbered, a dict has names.
    """

    def __init__(self, path: str | Path, name: str) -> None:
        self.path, self.name = netcdf.target_of(path), name
        self.soonest = self.due = time.monotonic() + EVERY

    def look(self, special: bool, piece: Callable[[], Any]) -> None:
        """Write what there is, if it is time; `piece` gives it, or None."""
        now = time.monotonic()
        if now < (self.soonest if special else self.due):
            return
        result = piece()
        if result is not None:
            try:
                # recorded columns may take as long as the run
                self._write(result, recorded=False)
            except BadInput as error:  # a disk that is full now may not be later
                logging.getLogger("contbreather").warning("%s; the run goes on", error)
        end = time.monotonic()
        self.soonest = end + (end - now) / SHARE
        self.due = max(self.soonest, end + EVERY)

    def finish(self, result: Any) -> None:
        """Write it now.

        Raises
        ------
        NotKept
            With the result, which is not lost where there is no room for it.
        """
        try:
            self._write(result, recorded=None)
        except BadInput as error:
            raise NotKept(str(error), result) from error

    def _write(self, result: Any, *, recorded: bool | None) -> None:
        several = isinstance(result, tuple)
        named = result if isinstance(result, Mapping) else {self.name: result}
        if several:
            named = {f"{self.name}{i}": part for i, part in enumerate(result, start=1)}
        write_results(self.path, named, alone=len(named) == 1 and not several, recorded=recorded)


class Inner(Checkpoint):
    """The same file as seen from a call within another: what it has is a piece of the whole."""

    def __init__(self, outer: Checkpoint, whole: Callable[[Any], Any]) -> None:
        self.outer, self.whole = outer, whole

    def look(self, special: bool, piece: Callable[[], Any]) -> None:
        def all_of_it() -> Any:
            result = piece()
            return None if result is None else self.whole(result)

        self.outer.look(special, all_of_it)

    def finish(self, result: Any) -> None:
        """Nothing: the outermost call does."""


@contextmanager
def piece_of(
    file: Checkpoint | None, whole: Callable[[Any], Any], before: Any = None
) -> Iterator[Checkpoint | None]:
    """The file for a call within another, of whose result `whole` makes that of the outer one: on
    disk, and where it is interrupted; `before` is what the outer one has by then without it."""
    pieces: list[Any] = []
    with (
        partial_result(lambda: whole(pieces[0]) if pieces else before),
        add_partial_result(pieces.append),
    ):
        yield file and Inner(file, whole)


Save = str | Path | Checkpoint | None


@contextmanager
def checkpoint(
    save: Save, name: str, so_far: Callable[[], Any] | None = None
) -> Iterator[Checkpoint | None]:
    """The file that a call keeps its result in, None for none; an interruption carries what there
    is by then, and so does the file: `so_far()`, or what an inner call has made of it.

    Raises
    ------
    BadInput
        If it cannot be written: before anything is computed.
    """
    if not (save is None or isinstance(save, Checkpoint | str | os.PathLike)):
        raise BadInput(f"save takes the name of a file, 'run.nc' for instance; got {kind_of(save)}")
    file = save if save is None or isinstance(save, Checkpoint) else Checkpoint(save, name)
    try:
        yield file
    except KeyboardInterrupt as stop:
        partial = so_far() if so_far else getattr(stop, "partial", None)
        if file and partial is not None:
            file.finish(partial)
        raise Interrupted(partial=partial) from None
