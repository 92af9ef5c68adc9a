"""`contbreather show` and `extend`: what is in a file, or a folder, that was kept; more of it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import contbreather as cb
from contbreather.cli.curves import of_arms, of_branch, of_diagram
from contbreather.cli.options import Axes, Span, Whole
from contbreather.cli.output import (
    Output,
    Result,
    SavedOutput,
    Table,
    check_ends,
    lines_of,
    lives_on,
    point_entry,
    stacked_table,
)
from contbreather.cli.process import until_interrupted
from contbreather.cli.simulate import RunSummary, of_run
from contbreather.cli.zones import of_zones, zones_lines
from contbreather.errors import BadInput
from contbreather.files import identity


def show(
    run: str, name: str | None = None, /, *, axes: Axes = Axes(), into: Output = Output()
) -> None:
    """Print a file that --save has kept, or a folder of such files.

    Parameters
    ----------
    run
        The file or the folder.
    name
        One of its results, or a special point by its label, PF1 or branch/PF1; all results, in
        brief, unless given. --json and --csv are those of the command that computed it.
    """
    into.check({"RUN": run})
    axes.check(into.output)
    results = _opened(run)
    result = _presented(dict(results) if name is None else {"": results[name]}, axes)
    if name is None and len(results) > 1:
        result = result._replace(lines=lambda: [results.table()])
    into.leave(result._replace(entry=lambda: {"path": str(results.path), **result.entry()}))


def extend(
    run: str,
    name: str | None = None,
    /,
    *,
    window: Span | None = None,
    end: Literal["both", "last", "first"] = "both",
    most: Whole | None = None,
    into: SavedOutput = SavedOutput(),
) -> None:
    """Follow a branch or a boundary that was kept further, and keep it where it was.

    Its equations, its events and its steps are those it was asked for with.

    Parameters
    ----------
    run
        The file, or the folder, that --save has kept.
    name
        Which of its results; needed where there are several.
    window
        Lowest and highest value of the free parameter, wider than before.
    end
        At which end to go on.
    most
        Number of steps after which it ends, at each end.
    """
    from contbreather.continuation.curve.settings import Settings
    from contbreather.continuation.walk.checkpoint import Checkpoint, Inner

    branch, place, key = _chosen(_opened(run), name)
    in_place = into.save is None or identity(into.save) == identity(place)
    into = replace(into, save=str(place) if in_place else into.save)
    into.check({} if in_place else {"RUN": str(place)})
    settings = branch.settings or Settings()
    within = {**settings.within, **({} if window is None else {branch.free: window})}
    steps = settings.steps if most is None else replace(settings.steps, most=most)
    others = dict(cb.Run(place)) if in_place else {}
    file = Checkpoint(into.save or place, key)
    inner = Inner(file, lambda longer: {**others, key: longer})
    longer, cut = until_interrupted(
        cb.extend, branch, end=end, within=within, steps=steps, save=inner
    )
    file.finish({**others, key: longer})
    result, free = of_branch(longer), {"free": longer.free}
    into.leave(result._replace(entry=lambda: {**result.entry(), **free}), cut=cut)
    check_ends(longer, "branch")


def _opened(path: str) -> cb.Run:
    cb.load(path)  # says what is wrong where nothing is there
    return cb.Run(path)


def _chosen(run: cb.Run, name: str | None) -> tuple[cb.Branch, Any, str]:
    """Find the branch, the file it is in, and its name there."""
    branches = [key for key, result in run.items() if isinstance(result, cb.Branch)]
    name = branches[0] if name is None and len(branches) == 1 else name
    if name not in branches:
        raise BadInput(
            f"name a branch or a boundary of {run.path} to extend: there is "
            f"{', '.join(branches) or 'none'}; a branch of a diagram is extended from Python, "
            "cb.extend(diagram.branches[0])"
        )
    return run[name], *run.place(name)


def _described(result: Any) -> str:
    text = result.describe() if hasattr(result, "describe") else repr(result).strip("<>")
    return str(text)


def _lines(result: Any) -> Iterator[object]:
    if isinstance(result, cb.Branch):
        yield from lines_of(result)
    elif isinstance(result, cb.orbits.Zones):
        yield from (f"{_described(result)}.", *zones_lines([result]))
    elif isinstance(result, cb.continuation.Point):
        yield f"{result!r}"
        for name, value in result.named_detail.items():
            yield f"{name} = {_in_words(result, value)}."
    else:
        yield result if hasattr(result, "__rich__") else f"{_described(result)}."
        yield from (f"{point!r}" for point in getattr(result, "special", ()))


def _in_words(point: cb.continuation.Point, value: Any) -> str:
    """Write a number, or a vector by the names of its unknowns, arrays by their largest entry."""
    if isinstance(value, list | tuple):
        return "; ".join(_in_words(point, item) for item in value)
    if not hasattr(value, "shape") or not value.shape:
        return f"{value:.9g}" if isinstance(value, float) else str(value)
    words = []
    for name, slot in point.base_point.curve.slots.items():
        entries = value[slot] if isinstance(slot, slice) else value[slot : slot + 1]
        if entries.size == 1:
            words.append(f"{name} {entries[0]:.9g}")
        elif entries.size:
            words.append(f"{name} {entries.size} numbers up to {abs(entries).max():.3g}")
    return ", ".join(words)


def _presented(by_name: Mapping[str, Any], axes: Axes) -> Result:
    """Present results of one command together, as it does, those of several each by its name."""
    from contbreather.continuation.branches.diagram import Diagram

    results: list[Any] = list(by_name.values())
    table, draw = partial(_stacked, by_name), partial(_branches_drawn, results, axes)
    arms = all(isinstance(one, cb.Branch) and one[0].parent and lives_on(one) for one in results)
    match results:
        case _ if all(isinstance(one, cb.orbits.Zones) and any(one) for one in results):
            axes.refuse("zones are drawn over their two parameters")
            result = of_zones(results)
        case _ if arms and all(re.fullmatch(r"arm\d+", name) for name in by_name):
            result = of_arms(results, axes)
        case [cb.Branch() as branch]:
            result = of_branch(branch, axes)
        case [Diagram() as tree]:
            result = of_diagram(tree, axes)
        case [cb.simulation.SimulationRun() | cb.simulation.SmoothRun() as run]:
            hits = getattr(run, "impacts", {"site": ()})["site"]  # its site hits first
            axes.refuse("a run is drawn over time")
            result = of_run(RunSummary(run, site=int(hits[0]) if len(hits) else 0))
        case [_]:
            result = Result(dict, list, table, draw)
        case _:

            def each() -> dict[str, Any]:
                alone = {name: _presented({"": one}, Axes()) for name, one in by_name.items()}
                return {"results": {name: result.entry() for name, result in alone.items()}}

            result = Result(each, list, table, draw)
    if len(results) > 1:
        return result
    (alone,) = results

    def entry() -> dict[str, Any]:
        if isinstance(alone, cb.continuation.Point):
            return point_entry(alone)
        about = {"kind": type(alone).__name__, "description": _described(alone)}
        return {**about, **result.entry()}

    return result._replace(entry=entry, lines=partial(_lines, alone))


def _stacked(by_name: Mapping[str, Any]) -> Table:
    results = list(by_name.values())
    if not all(hasattr(result, "columns") for result in results):
        raise BadInput("--csv: a point has no columns; name what it is on")
    heads = [{"name": name} if len(by_name) > 1 else {} for name in by_name]
    return stacked_table(zip(heads, (result.columns() for result in results), strict=True))


def _branches_drawn(results: list[Any], axes: Axes) -> Any:
    branches = [result for result in results if isinstance(result, cb.Branch)]
    if not branches:
        raise BadInput("--output: only branches, diagrams, zones and runs are drawn; name one")
    return axes.plot(*branches)
