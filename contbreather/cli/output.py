"""Results of a command: a table for people, JSON or CSV for programs, a figure."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

from cyclopts import Parameter

import contbreather as cb
from contbreather.cli.process import CutShort
from contbreather.errors import BadInput, NotConverged
from contbreather.files import identity, stream_of, writable, write_csv
from contbreather.tables import visible

Table = tuple[Sequence[str], Iterable[Sequence[Any]]]  # the names of columns, and the rows
CUT = "interrupted: cut short"


def say(*lines: object, aside: bool = False) -> None:
    """Print for people; into a pipe tables go as wide as they are. Where a table for programs has
    standard output to itself it is said on standard error."""
    from rich.console import Console

    # of sentences, where there is no terminal to fit into
    width = None if (sys.stderr if aside else sys.stdout).isatty() else 160
    shown = Console(highlight=False, width=width, soft_wrap=False, stderr=aside)
    for line in lines:
        free = not isinstance(line, str) and not shown.is_terminal
        line = visible(line) if isinstance(line, str) else line
        shown.print(line, markup=False, width=100_000 if free else None)


def inform(line: str) -> None:
    """Say on standard error what a person should know; programs go on undisturbed."""
    print(f"contbreather: {visible(line)}", file=sys.stderr)


def to_json(content: Mapping[str, Any]) -> None:
    """One JSON object on standard output; what is not finite becomes null, never NaN."""
    plain = not (sys.stdout.encoding or "utf-8").lower().startswith("utf")
    text = json.dumps(_plain(content), allow_nan=False, ensure_ascii=plain)
    # what a terminal obeys is written out, as JSON itself writes what is below a space
    sys.stdout.write("".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in text) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if hasattr(value, "tolist"):  # numpy's arrays and scalars
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, complex):
        return [_plain(value.real), _plain(value.imag)]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def table_of(columns: Mapping[str, Any]) -> Table:
    """Turn columns of single numbers into rows, for CSV."""
    flat = {name: column for name, column in columns.items() if getattr(column, "ndim", 1) == 1}
    plain = [array.tolist() if hasattr(array, "tolist") else array for array in flat.values()]
    return list(flat), zip(*plain, strict=True)


def sentences(lines: Iterable[str]) -> list[str]:
    """Give each a capital and one full stop."""
    return [f"{line[0].upper()}{line[1:].rstrip('.')}." for line in lines]


# --- where it goes --------------------------------------------------------------------------------


class Result(NamedTuple):
    """Forms of what a command leaves, each made where it is wanted: a JSON object, lines for
    people, a table of numbers, a figure; and what these say where Ctrl-C has cut it short."""

    entry: Callable[[], Mapping[str, Any]]
    lines: Callable[[], Iterable[object]]
    table: Callable[[], Table]
    draw: Callable[[], Any]
    cut: str = CUT


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Output:
    """Places where results go."""

    csv: str | None = None
    """Write the numbers to this file, in full precision."""
    output: Annotated[str | None, Parameter(alias="-o")] = None
    """Draw to this file: .png, .pdf or .svg."""
    json: bool = False
    """Print one JSON object, in full precision."""

    @property
    def library_file(self) -> str | None:
        return getattr(self, "save", None)

    def check(self, read: Mapping[str, str | None] | None = None, **more: str | None) -> None:
        """Refuse files that cannot be written before anything is computed, `more` by their options
        among them, and one place for two things, however its name is written: two files, a file
        and what is `read`, or what is printed."""
        from contbreather.storage.netcdf import target_of

        typed = {"--csv": self.csv, "--save": self.library_file}
        typed |= {f"--{name}": path for name, path in more.items()} | {"--output": self.output}
        # what is kept and a figure have names of their sort
        checks = {"--save": target_of, "--output": cb.plotting.canvas.figure_path}
        written = {option: path for option, path in typed.items() if path is not None}
        for option, path in written.items():
            checks.get(option, writable)(path)
        taken = {identity(path): name for name, path in (read or {}).items() if path is not None}
        taken |= {identity(1): "standard output"} | ({1: "--json"} if self.json else {})
        for option, path in written.items():
            place = stream_of(path) or identity(path)
            if other := taken.get(place):
                raise BadInput(f"{other} and {option} both name {path}; give different names")
            taken[place] = option

    def leave(self, result: Result, *, cut: bool = False, others: Sequence[str] = ()) -> None:
        """Write files first, beside `others` that are there, then one JSON object, or lines for
        people; raise where Ctrl-C has `cut` it short."""
        written = [*others] if self.library_file is None else [self.library_file, *others]
        if self.csv is not None:
            written.append(str(write_csv(self.csv, *result.table(), result.cut if cut else "")))
        if self.output is not None:
            drawn = result.draw()
            if cut:
                (getattr(drawn, "figure", None) or drawn).suptitle(result.cut, fontsize="small")
            written.append(str(cb.plotting.canvas.save_figure(drawn, self.output)))
        if self.json:
            entry = result.entry()
            cut_too = entry.get("interrupted", cut)
            to_json({**entry, "interrupted": cut_too, "written": written})
        else:
            # a table that has standard output to itself
            aside = any(stream_of(path) == 1 for path in (self.csv, *others) if path is not None)
            say(*result.lines(), *(f"Wrote {path}." for path in written), aside=aside)
        if cut:
            raise CutShort


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SavedOutput(Output):
    """Places of results that are kept as they are found."""

    save: str | None = None
    """Keep the results in this file while they are computed: show prints them, extend follows
    branches and boundaries further."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SavedRun(SavedOutput):
    """Places where a run goes."""

    save: str | None = None
    """Keep the run in this file when it has ended, for show and load; --stream keeps one as it goes
    on."""


# --- branches -----------------------------------------------------------------------------------


def stacked_table(tables: Iterable[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> Table:
    """Put columns of the library one below the other, each with what its rows have in common."""
    from contbreather.columns import stacked

    return table_of(stacked(tables))


def point_entry(point: cb.continuation.Point) -> dict[str, Any]:
    numbers = {n: value for n, value in point.values.items() if not getattr(value, "ndim", 0)}
    return {
        "kind": point.kind,
        "label": point.label,
        **numbers,
        "arclength": point.arclength,
        "residual": point.residual,
        "located": point.located,
        **({"parent": point.parent.label} if point.parent else {}),
        **point.named_detail,
    }


def _drive(forcing: cb.lattice.Forcing, varied: Iterable[str]) -> str:
    """The forcing in words, with its numbers but for those that vary."""
    numbers = {name: f", {name} = {value:.6g}" for name, value in forcing.params.items()}
    said = forcing.describe()
    formula = said.removesuffix("".join(numbers.values()))
    fixed = (words for name, words in numbers.items() if name not in varied)
    return said if formula == said else "".join([formula, *fixed])


def model_entry(
    threshold: float,
    *,
    forcing: cb.lattice.Forcing,
    lattice: Any,
    site: int,
    walls: Any,
    varied: Iterable[str] = (),
) -> dict[str, Any]:
    """Lattice and drive of a breather for JSON; of the infinite chain the forcing alone."""
    about: dict[str, Any] = {"forcing": _drive(forcing, varied)}
    if lattice.sites is not None:
        about |= {"lattice": lattice.describe(), "sites": lattice.sites, "threshold": threshold}
        about |= {"site": site, "walls": walls_entry(walls)}
    return about


def walls_entry(walls: Any) -> Any:
    """Walls for JSON, those of all or of each site; nothing of the usual ones."""
    from contbreather.lattice.conditions import Walls

    every = Walls.given(walls)
    pairs = dict(every.own) or every.of_all
    return None if pairs == (-1.0, 1.0) else pairs


def lives_on(branch: cb.Branch) -> dict[str, Any]:
    """Lattice and drive of the breathers of a branch for JSON; nothing of other problems."""
    from contbreather.orbits.orbit_problem import OrbitProblem

    problem: Any = branch[0].base_point.curve.problem
    if not isinstance(problem, OrbitProblem):
        return {}
    (site, _), *_ = problem.section.impacts
    on = problem.conditions
    return model_entry(
        problem.threshold, forcing=on.forcing, lattice=on.lattice, site=site, walls=on.walls,
        varied=branch.curve.varied,
    )  # fmt: skip


def branch_entry(branch: cb.Branch) -> dict[str, Any]:
    """A branch for JSON: all columns, special points, and why it ends where it does."""
    columns = branch.columns()
    return {
        "columns": {name: columns[name] for name in branch.names if columns[name].ndim == 1},
        "special": [point_entry(point) for point in branch.special],
        "doubtful": [point_entry(point) for point in branch.doubtful],
        "ends": end_sentences(branch),
    }


def end_sentences(branch: cb.Branch) -> list[str]:
    """Reason of each end, as sentences."""
    sentences = []
    sides = (
        (branch[0], branch.began, branch.began_reason, "began"),
        (branch[-1], branch.stop, branch.reason, "ended"),
    )
    for point, stop, reason, word in sides:
        if stop is not None:
            why = reason.rstrip(".")
            phrase = _as_option(stop.value).replace("ended", word)
            if word == "began" and point.parent is not None:
                phrase = f"left another branch at its {point.parent.label}"
            sentences.append(f"{point.label}: {phrase}{f' ({why})' if why else ''}")
    return sentences


def _drive_and_walls(branch: cb.Branch) -> str:
    """Name those that are not the usual ones; its title has the rest of its model."""
    from contbreather.lattice.parse import as_typed
    from contbreather.orbits.orbit_problem import OrbitProblem

    problem: Any = branch[0].base_point.curve.problem
    if not isinstance(problem, OrbitProblem):
        return ""
    drive, walls = problem.conditions.forcing, as_typed(problem.conditions.walls)
    formula = _drive(drive, drive.params)  # its title has the numbers, too
    return ", ".join([formula] * (drive != cb.Harmonic()) + [f"walls {walls}"] * bool(walls))


def _as_option(said: str) -> str:
    return said.replace("Steps.most", "--most of contbreather extend")


def lines_of(branch: cb.Branch) -> Iterator[object]:
    """A branch for people: its table, its model, why it ends, and what could not be verified."""
    table = branch.table()
    yield replace(table, title=_as_option(table.title))
    if words := _drive_and_walls(branch):
        yield f"{words}."
    yield from (f"{line}." for line in end_sentences(branch))
    for point in branch.doubtful:
        place = ", ".join(f"{name} = {point[name]:.10g}" for name in branch.curve.varied)
        why = point.detail.get("reason", "not located").rstrip(".")
        yield f"In doubt: {point.kind} at {place}: {why}."


def check_ends(branch: cb.Branch, what: str) -> None:
    """Raise where the numerics gave up: what there is was shown, but it is not all."""
    if any(stop is not None and stop.failed for stop in (branch.began, branch.stop)):
        raise NotConverged(f"the {what} broke off: {'; '.join(end_sentences(branch))}")
