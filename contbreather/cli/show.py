"""`contbreather show` and `extend`: what is in a file, or a folder, that was kept; more of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Literal, NamedTuple

import contbreather as cb
from contbreather.cli.curves import arms_entry, curve_entry, diagram_entry, leave
from contbreather.cli.options import Axes, Span, Whole, typed_interval
from contbreather.cli.output import (
    Output,
    SavedOutput,
    Table,
    branch_entry,
    branch_table,
    lines_of,
    lives_on,
    point_entry,
    table_of,
)
from contbreather.cli.process import until_interrupted
from contbreather.cli.simulate import content, strobe_table, summary_of, with_verdict
from contbreather.cli.simulate import draw as draw_run
from contbreather.cli.zones import curves_table, zones_entry, zones_lines
from contbreather.errors import BadInput
from contbreather.files import identity
from contbreather.parameters import NEEDED


def show(
    run: str | None = None,
    name: str | None = None,
    /,
    *,
    axes: Axes = Axes(),
    into: Output = Output(),
) -> None:
    """What is in a file that --save has kept, or in a folder of such files.

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
    results = opened_results(run)
    chosen = results if name is None else {"": results[name]}
    if len(chosen) == 1:
        (result,) = chosen.values()
        lines, what = _lines(result), _entry(result)
    else:
        lines, what = iter([results.table()]), {}
    into.leave(
        lambda: {"path": str(results.path), **what, **_as_left(chosen, axes).entry()},
        lines,
        lambda: _as_left(chosen, axes).table(),
        lambda: _as_left(chosen, axes).draw(),
    )


def extend(
    run: str | None = None,
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
    from contbreather.continuation.checkpoint import Checkpoint, Inner

    results = opened_results(run)
    branch, place, key = _chosen(results, name)
    in_place = into.save is None or identity(into.save) == identity(place)
    into = replace(into, save=str(place) if in_place else into.save)
    into.check({} if in_place else {"RUN": str(place)})
    settings = branch.settings or cb.continuation.settings.Settings()
    within = dict(settings.within)
    if window is not None:
        within[branch.free] = typed_interval(branch.free, window, {})
    steps = settings.steps if most is None else replace(settings.steps, most=most)
    others = dict(cb.Run(place)) if in_place else {}
    file = Checkpoint(into.save or place, key)
    inner = Inner(file, lambda longer: {**others, key: longer})
    longer, cut = until_interrupted(
        cb.extend, branch, end=end, within=within, steps=steps, save=inner
    )
    file.finish({**others, key: longer})
    leave(longer, "branch", into, cut, entry=lambda x: {"free": x.free, **branch_entry(x)})


def _chosen(run: cb.Run, name: str | None) -> tuple[cb.Branch, Any, str]:
    """The branch, the file it is in, and its name there."""
    branches = [key for key, result in run.items() if isinstance(result, cb.Branch)]
    if not branches:
        raise BadInput(
            f"{run.path} has no branch or boundary to extend, only {', '.join(run)}; a branch of a "
            "diagram is extended from Python, cb.extend(diagram.branches[0])"
        )
    if name is None and len(branches) > 1:
        there = ", ".join(branches)
        raise BadInput(f"which branch of {run.path}? There are {there}; give the name of one")
    name = name or branches[0]
    branch = run[name]
    if name not in branches:
        raise BadInput(f"{name!r} is not a branch or a boundary; there are {', '.join(branches)}")
    return branch, *run.place(name)


def opened_results(path: str | None) -> cb.Run:
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
    elif isinstance(result, cb.orbits.Zones):
        yield from (f"{_described(result)}.", *zones_lines([result]))
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


class _Left(NamedTuple):
    """Results as the command that leaves such makes them: for JSON, for CSV, as a figure."""

    entry: Callable[[], Mapping[str, Any]]
    table: Callable[[], Table]
    draw: Callable[[], Any]


def _as_left(by_name: Mapping[str, Any], axes: Axes) -> _Left:
    """Results of one command together, those of several each by its name."""
    from contbreather.continuation.diagram import Diagram

    results: list[Any] = list(by_name.values())
    stacked, draw = partial(_stacked, by_name), partial(_branches_drawn, results, axes)
    if all(isinstance(result, cb.orbits.Zones) for result in results):
        draw = partial(cb.plotting.plot_zones, results)
        if all(map(any, results)):
            return _Left(partial(zones_entry, results), partial(curves_table, results), draw)
    arms = all(isinstance(result, cb.Branch) and result[0].parent for result in results)
    arms = arms and all(re.fullmatch(r"arm\d+", name) for name in by_name)
    if arms and all(map(lives_on, results)):
        return _Left(partial(arms_entry, results), partial(branch_table, results, "arm", 1), draw)
    if len(results) > 1:
        return _Left(partial(_each, by_name, axes), stacked, draw)
    match results[0]:
        case cb.Branch() as branch:
            return _Left(partial(curve_entry, branch), partial(branch_table, [branch]), draw)
        case Diagram() as tree:
            table = partial(branch_table, tree.branches, "branch")
            draw = partial(cb.plotting.plot_diagram, tree)
            return _Left(partial(diagram_entry, tree), table, draw)
        case cb.simulation.SimulationRun() | cb.simulation.SmoothRun() as run:
            hits = getattr(run, "impacts", {"site": ()})["site"]
            draw = partial(draw_run, run, int(hits[0]) if len(hits) else 0)  # its site hits first
            return _Left(partial(_run_entry, run), partial(strobe_table, summary_of(run)), draw)
        case other:
            return _Left(partial(_special, other), stacked, draw)


def _run_entry(run: Any) -> dict[str, Any]:
    on = run.conditions
    params = {name: getattr(on, name) for name in NEEDED if hasattr(on, name)}
    return content(with_verdict(summary_of(run)), params, getattr(on, "m", None))


def _each(by_name: Mapping[str, Any], axes: Axes) -> dict[str, Any]:
    entries = {
        name: {**_entry(one), **_as_left({"": one}, axes).entry()} for name, one in by_name.items()
    }
    return {"results": entries}


def _special(result: Any) -> dict[str, Any]:
    special = [point_entry(point) for point in getattr(result, "special", ())]
    return {"special": special} if special else {}


def _entry(result: Any) -> dict[str, Any]:
    """What a result is, for JSON."""
    if isinstance(result, cb.continuation.Point):
        return point_entry(result)
    return {"kind": type(result).__name__, "description": _described(result)}


def _stacked(by_name: Mapping[str, Any]) -> Table:
    """All columns, below each other."""
    from contbreather.columns import stacked

    results = list(by_name.values())
    if not all(hasattr(result, "columns") for result in results):
        raise BadInput("--csv: a point has no columns; name what it is on")
    if len(by_name) > 1:
        return table_of(
            stacked(({"name": name}, result.columns()) for name, result in by_name.items())
        )
    columns = results[0].columns().items()
    return table_of({name: column for name, column in columns if column.ndim == 1})


def _branches_drawn(results: list[Any], axes: Axes) -> Any:
    branches = [result for result in results if isinstance(result, cb.Branch)]
    if not branches:
        raise BadInput("--output: only branches, diagrams, zones and runs are drawn; name one")
    return axes.plot(*branches)
