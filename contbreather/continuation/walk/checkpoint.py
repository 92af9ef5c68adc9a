"""Results in files, as nested dicts: at once, and while they are computed, so that what a killed
process loses is some seconds.

What others read of a branch are columns, one row for each point. What only this package needs,
which equations these are and how the walk was asked for, are plain values.
"""

from __future__ import annotations

import logging
import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...checks import kind_of
from ...errors import BadInput, Interrupted
from ...storage import netcdf
from ...storage.netcdf import Column
from ...storage.serialise import NotSerialisable, to_dict
from ..curve.branch import Branch, Points
from ..curve.point import Event
from ..curve.problem import Problem
from ..systems.defining_systems import ExtendedProblem, event_of

Array = NDArray[Any]

EVERY = 3.0  # seconds between two files
SHARE = 0.03  # of the time that a run takes, at most, goes into writing them
_PARTS = {"columns", "groups"}  # what a result has besides plain values


def write_results(
    path: str | Path, results: Mapping[str, Any], *, alone: bool, recorded: bool | None = True
) -> Path:
    """Write results by names; `alone` if the only one is what the file is."""
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
    """No file could be written of what was computed, the `result` of this."""

    def __init__(self, message: str, result: Any) -> None:
        super().__init__(message)
        self.result = result


class Checkpoint:
    """A file that is written anew every few seconds, and where something happens; its result has
    this name in it, those of a tuple are numbered, those of a dict have names."""

    def __init__(self, path: str | Path, name: str) -> None:
        self.path, self.name = netcdf.target_of(path), name
        self.soonest = self.due = time.monotonic() + EVERY

    def look(self, special: bool, piece: Callable[[], Any]) -> None:
        """Write what there is, if it is time; `piece` gives it, or None."""
        now = time.monotonic()
        if now < (self.soonest if special else self.due):
            return
        if (result := piece()) is not None:
            try:  # without recorded columns, which may take as long as the run
                self._write(result, recorded=False)
            except BadInput as error:  # a disk that is full now may not be later
                logging.getLogger("contbreather").warning("%s; the run goes on", error)
        end = time.monotonic()
        self.soonest = end + (end - now) / SHARE
        self.due = max(self.soonest, end + EVERY)

    def finish(self, result: Any) -> None:
        """Write it now, without recorded columns before one that raises does; where there is no
        room for it, `NotKept` has the result."""
        try:
            try:
                self._write(result, recorded=None)
            except Exception:
                self._write(result, recorded=False)
                raise
        except BadInput as error:
            raise NotKept(str(error), result) from error

    def _write(self, result: Any, *, recorded: bool | None) -> None:
        several, named = isinstance(result, tuple), {self.name: result}
        if several:
            named = {f"{self.name}{i}": part for i, part in enumerate(result, start=1)}
        elif isinstance(result, Mapping):
            named = {**result}
        write_results(self.path, named, alone=len(named) == 1 and not several, recorded=recorded)


class Inner(Checkpoint):
    """File of an outer call as seen from a call within: that result is a piece of the whole."""

    def __init__(self, outer: Checkpoint, whole: Callable[[Any], Any]) -> None:
        self.outer, self.whole = outer, whole

    def look(self, special: bool, piece: Callable[[], Any]) -> None:
        self.outer.look(special, lambda: None if (own := piece()) is None else self.whole(own))

    def finish(self, result: Any) -> None:
        """Leave that to the outermost call."""


Save = str | Path | Checkpoint | None


@contextmanager
def checkpoint(save: Save, name: str, so_far: Callable[[], Any]) -> Iterator[Checkpoint | None]:
    """The file that a call keeps its result in, None for none; an interruption carries what there
    is by then, `so_far()`, and so does the file. One that cannot be written is refused before
    anything is computed."""
    if not (save is None or isinstance(save, Checkpoint | str | os.PathLike)):
        raise BadInput(f"save takes the name of a file, 'run.nc' for instance; got {kind_of(save)}")
    file = save if save is None or isinstance(save, Checkpoint) else Checkpoint(save, name)
    try:
        yield file
    except KeyboardInterrupt:
        partial = so_far()
        if file and partial is not None:
            file.finish(partial)
        raise Interrupted(partial=partial) from None


# --- results as dicts -----------------------------------------------------------------------------


def result_to_dict(result: Any, *, recorded: bool | None = True) -> dict[str, Any]:
    """The dict of a branch, of what consists of branches, or of anything else that has one.

    `recorded` asks for recorded columns, which may take as long as the branches themselves; None
    does where the dict has no equations that give them later.
    """
    if isinstance(result, Branch):
        return branch_to_dict(result, recorded=recorded)
    content = to_dict(result)
    parts = content if isinstance(content, dict) and "kind" in content else {}
    # of a lattice columns are those of its matrix, a row of numbers
    if not any(isinstance(parts.get(name), Mapping) for name in _PARTS):
        raise NotSerialisable(result)
    groups = content.get("groups", {}).items()
    inside = {name: result_to_dict(part, recorded=recorded) for name, part in groups}
    return {**content, "groups": inside}


def branch_to_dict(branch: Branch, *, recorded: bool | None = True) -> dict[str, Any]:
    """Make a dict of a branch, with its doubtful points and the one it was born from as groups."""
    groups = {}
    if branch.doubtful:
        inside = replace(branch, points=Points.of(branch.doubtful), doubtful=(), origin=None)
        groups["doubtful"] = branch_to_dict(inside, recorded=False)
    if branch.origin is not None:
        born = Branch(Points.of([branch.origin]), branch.stop)
        groups["origin"] = branch_to_dict(born, recorded=False)
    points, problem, settings = branch.points, branch.problem, branch.settings
    event = event_of(problem)
    # of a boundary what the equations of the original problem are made of
    base: Problem = problem.residual.problem if isinstance(problem, ExtendedProblem) else problem
    equations = _form(base)
    record = problem.record if recorded or (recorded is None and equations is None) else ()
    kinds = ["", *sorted({point.kind for point in points.made.values()} - {""})]
    ends = {
        "label": problem.label,
        "stop": branch.stop.name,
        "reason": branch.reason,
        "began": branch.began.name if branch.began else None,
        "began_reason": branch.began_reason,
    }
    words = {"free": branch.free, "boundary": event.kind if event else ""}
    asked = settings and {
        "within": {name: [float(end) for end in ends] for name, ends in settings.within.items()},
        "events": settings.events and [_event_to_dict(event) for event in settings.events],
        "steps": asdict(settings.steps),
        "inadmissible": settings.inadmissible,
    }
    return {
        "kind": "branch",
        **ends,
        "unknowns": list(problem.start),
        "parameters": list(problem.params),
        "recorded": list(record),
        "free": list(branch.curve.free),
        "boundary": _event_to_dict(event) if event else None,
        "image_of": branch.image_of,
        "kinds": kinds,
        "detail": {i: _detail_to_dict(p.detail) for i, p in points.made.items() if p.detail},
        "parent": bool(points[0].parent),
        "point_label": points[0].label,
        "period": base.rounds,
        "equations": equations,
        "base": [list(base.start), list(base.params)],
        "shown": list(base.shown),
        "internals": sorted(problem.internals),
        "settings": asked,
        "columns": _columns(branch, record, kinds),
        "attributes": {**ends, **words, "stop_meaning": branch.stop.value},
        "groups": groups,
    }


def _form(thing: Problem | Event) -> Any:
    """The serialised form of equations or of an event, None where something in it has none."""
    with suppress(NotSerialisable):
        return to_dict(thing.serialised)
    return None


def _event_to_dict(event: Event) -> dict[str, Any]:
    return _form(event) or {"kind": event.kind, "ends": event.ends}


def _columns(branch: Branch, record: Iterable[str], kinds: Sequence[str]) -> dict[str, Column]:
    points, curve, problem = branch.points, branch.curve, branch.problem
    columns = {name: column(points.z[:, at], name, "unknown") for name, at in curve.slots.items()}
    columns[curve.free[0]][2]["role"] = "free"
    for name, value in problem.params.items():
        if name not in curve.free:
            columns[name] = (), float(value), {"role": "fixed"}
    for name, values in points.recorded(*record).items():
        columns[name] = column(values, name, "recorded")
    more = _columns_of_points(points, kinds)
    if taken := sorted(set(columns) & set(more)):
        raise BadInput(f"{taken[0]!r} is a name that the file needs itself; choose another")
    return columns | more


def column(values: Array, name: str = "", role: str = "") -> Column:
    """One value for each point, which may be an array."""
    axes = (f"{name}_axis{i}" for i in range(1, values.ndim))
    return ("point", *axes), values, {"role": role} if role else {}


def _columns_of_points(points: Points, kinds: Sequence[str]) -> dict[str, Column]:
    """Columns of every point, and of the numbers and words in `detail` of the special ones."""
    special, count = points.made, len(points)
    codes, located = np.zeros(count, dtype="i1"), np.ones(count, dtype=bool)
    brackets = np.full((count, 2), math.nan)
    for i, point in special.items():
        codes[i], located[i] = kinds.index(point.kind), point.located
        brackets[i] = point.bracket or brackets[i]
    meanings = ["regular", *("_".join(kind.split()) for kind in kinds[1:])]  # CF parts at blanks
    flags = {"flag_values": np.arange(len(kinds), dtype="i1"), "flag_meanings": " ".join(meanings)}
    columns: dict[str, Column] = {
        "arclength": column(points.arclength),
        "residual": column(points.residual),
        "point_tangent": column(points.tangent, "point_tangent"),
        "point_kind": (("point",), codes, flags),
        "point_bracket": (("point", "bracket_end"), brackets, {}),
        "point_located": column(located),
    }
    for name in sorted({name for point in special.values() for name in point.detail}):
        values = {i: point.detail[name] for i, point in special.items() if name in point.detail}
        words = all(isinstance(value, str) for value in values.values())
        if words or all(isinstance(v, complex | float | int | np.number) for v in values.values()):
            nothing = "" if words else math.nan
            cells = np.array([values.get(i, nothing) for i in range(count)])
            columns[f"detail_{name}"] = column(cells, role="detail")
    return columns


def _detail_to_dict(value: Any) -> Any:
    """Numbers, words, arrays, and lists and dicts of these; None stands for anything else."""
    if isinstance(value, np.ndarray):
        parts = [value.real.tolist(), value.imag.tolist()] if value.dtype.kind == "c" else None
        return {"complex array": parts} if parts else {"array": value.tolist()}
    if isinstance(value, complex | np.complexfloating):
        return {"complex": [float(value.real), float(value.imag)]}
    if isinstance(value, Mapping):
        return {"dict": {str(name): _detail_to_dict(inner) for name, inner in value.items()}}
    if isinstance(value, list | tuple):
        return [_detail_to_dict(inner) for inner in value]
    if isinstance(value, np.generic):
        return value.item()
    return value if value is None or isinstance(value, bool | int | float | str) else None
