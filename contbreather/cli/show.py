"""`contbreather show`: what is in a file, or a folder, that was kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import contbreather as cb
from contbreather.cli.options import Output
from contbreather.cli.output import branch_entry, lines_of, point_entry, table_of
from contbreather.errors import BadInput


def show(run: str | None = None, name: str | None = None, /, *, into: Output = Output()) -> None:
    """What is in a file that --save has kept, or in a folder of such files.

    Parameters
    ----------
    run
        The file or the folder.
    name
        One of its results, or a special point by its label, PF1 or branch/PF1; all results, in
        brief, unless given.
    """
    into.check({"RUN": run})
    found = opened(run)
    if name is None and len(found) > 1:
        into.leave(
            lambda: {"path": str(found.path), "results": {n: _entry(v) for n, v in found.items()}},
            [found.table()],
            lambda: _table_of(found, None),
            lambda: _drawn(found),
        )
        return
    result = found[next(iter(found)) if name is None else name]
    into.leave(
        lambda: {"path": str(found.path), **_entry(result)},
        _lines(result),
        lambda: _table_of(found, result),
        lambda: _drawn({"": result}),
    )


def opened(path: str | None) -> cb.Run:
    """What is on disk; a sentence where nothing is."""
    if path is None:
        raise BadInput("RUN is missing: the file, or the folder, that --save has kept")
    cb.load(path)  # says what is wrong
    return cb.Run(path)


def _described(result: Any) -> str:
    text = result.describe() if hasattr(result, "describe") else repr(result).strip("<>")
    return str(text)


def _lines(result: Any) -> Iterator[object]:
    if isinstance(result, cb.Branch):
        yield from lines_of(result)
    elif isinstance(result, cb.continuation.Point):
        yield f"{result!r}"
        for name, value in result.detail.items():
            yield f"{name} = {_in_words(result, value)}."
    else:
        yield result if hasattr(result, "__rich__") else f"{_described(result)}."
        yield from (f"{point!r}" for point in getattr(result, "special", ()))


def _in_words(point: cb.continuation.Point, value: Any) -> str:
    """A number or a word; a vector by the names of its unknowns, arrays by their largest entry."""
    if isinstance(value, list | tuple):
        return "; ".join(_in_words(point, one) for one in value)
    if not hasattr(value, "shape") or not value.shape:
        return f"{value:.9g}" if isinstance(value, float) else str(value)
    words = []
    for name, slot in point.ground.curve.slots.items():
        entries = value[slot] if isinstance(slot, slice) else value[slot : slot + 1]
        if entries.size == 1:
            words.append(f"{name} {entries[0]:.9g}")
        elif entries.size:
            words.append(f"{name} {entries.size} numbers up to {abs(entries).max():.3g}")
    return ", ".join(words)


def _entry(result: Any) -> dict[str, Any]:
    """For JSON."""
    if isinstance(result, cb.continuation.Point):
        return point_entry(result)
    about: dict[str, Any] = {"kind": type(result).__name__, "description": _described(result)}
    if isinstance(result, cb.Branch):
        return {**about, **branch_entry(result)}
    special = [point_entry(point) for point in getattr(result, "special", ())]
    return {**about, "special": special} if special else about


def _table_of(found: Mapping[str, Any], result: Any) -> Any:
    """Rows and columns for CSV: of one result, or of all below each other."""
    from contbreather.columns import stacked

    if result is None:
        columns = stacked(({"name": name}, one.columns()) for name, one in found.items())
    elif hasattr(result, "columns"):
        columns = result.columns()
    else:
        raise BadInput("--csv: a point has no columns; name what it is on")
    return table_of({name: column for name, column in columns.items() if column.ndim == 1})


def _drawn(found: Mapping[str, Any]) -> Any:
    from contbreather.continuation.diagram import Diagram

    values = list(found.values())
    if all(isinstance(value, cb.orbits.Zones) for value in values):
        return cb.plotting.plot_zones(values)[0]
    if len(values) == 1 and isinstance(values[0], Diagram):
        return cb.plotting.plot_diagram(values[0])
    branches = [value for value in values if isinstance(value, cb.Branch)]
    if not branches:
        raise BadInput("--output: only branches, diagrams and zones are drawn here; name one")
    return cb.plotting.plot(*branches)
