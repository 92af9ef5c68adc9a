"""Tasks of a study: each computed by itself, kept in a file of its own, and never again; the list
of what is to be computed; and the folder, where the study replaces nothing but its own."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from filecmp import cmp
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from contbreather.checks import combinations
from contbreather.continuation.branches.boundary import boundary
from contbreather.continuation.branches.switching import switch
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.settings import Steps
from contbreather.continuation.walk.trace import trace
from contbreather.errors import BadInput, ContbreatherError, NoSolution
from contbreather.files import named, writable, write_whole
from contbreather.orbits.start_search import find_symmetric
from contbreather.orbits.zones import zones
from contbreather.parameters import window_of
from contbreather.runs import load, save
from contbreather.studies.schema import Arms, Boundary, Chain, FromPoint, Study, ZonesTask, read
from contbreather.tables import Column, HtmlRepr, Sheet

MARKS = ".study"  # folder of what is known of the files beside it
ATLAS = ".nc4"  # beside the results that `load` reads
WORDS = {"": "to compute", "kept": "there", "failed": "failed before", "absent": "absent"}
# keys that do not change a result: where it starts, which is a task of its own, and values, which
# are in lists to which others may be added later
OUTSIDE = {"of", "a", "gamma", "k", "over", "optional"}


class Mark(BaseModel):
    """Record of a task: the settings that its result is of, and why there is none: it `failed`, or
    its start is `absent`."""

    model_config = ConfigDict(frozen=True, strict=True)

    settings: str
    failed: str = ""
    absent: str = ""


@dataclass(frozen=True)
class Task:
    """One process's work: plain data, so that it goes anywhere."""

    family: str  # its name in the study
    label: str  # which of its family it is, "k=0.8"; empty where it is alone
    table: Any  # a BranchTask, Arms, Boundary or ZonesTask
    values: Mapping[str, float]  # parameters that the study fixes
    chain: Chain
    needs: Task | None = None  # the one whose result it starts from

    @property
    def name(self) -> str:
        return f"{self.family}/{self.label}" if self.label else self.family

    @property
    def level(self) -> int:
        return 0 if self.needs is None else 1 + self.needs.level

    @property
    def said(self) -> dict[str, Any]:
        """Settings of its result, but for values, the chain and where it starts."""
        return self.table.model_dump(exclude=OUTSIDE, exclude_none=True)

    @property
    def fingerprint(self) -> str:
        """Hash of everything that the result depends on."""
        start = None if self.needs is None else [self.table.of.arm, self.needs.fingerprint]
        settings = [self.table.kind, self.said, self.values, self.chain.model_dump(), start]
        return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()

    @property
    def conditions(self) -> str:
        """Say what is computed, at which values, in which windows, from what."""
        table, said, words = self.table, self.said, self.table.kind
        windows, fixed = dict(said.get("within", {})), dict(self.values)
        if self.needs is not None:
            arm = f"/{table.of.arm}" if table.of.arm else ""
            words += f" of {table.at} on {self.needs.name}{arm}"
            fixed = {}
        elif "free" in said:
            words += f" in {table.free}"
            fixed.pop(table.free, None)
            windows[table.free] = table.window or window_of(table.free, self.chain.omega)
        words += f" at {', '.join(map(_setting, fixed.items()))}" if fixed else ""
        words += f" in ({', '.join(table.pair)})" if "pair" in said else ""
        ranges = [f"{name} from {low:g} to {high:g}" for name, (low, high) in windows.items()]
        options = [(name, said.get(name)) for name in ("root", "largest", "past_folds", "beyond")]
        return ", ".join([words, *ranges, *(_setting(option) for option in options if option[1])])

    def file(self, folder: Path) -> Path:
        return folder / f"{self.name}.nc"

    def mark_file(self, folder: Path) -> Path:
        return folder / MARKS / f"{self.name.replace('/', '@')}.json"

    def last_mark(self, folder: Path) -> Mark | None:
        """Read what the last run said of it, as far as its result is there."""
        try:
            mark = Mark.model_validate_json(self.mark_file(folder).read_bytes())
        except (FileNotFoundError, NotADirectoryError, ValidationError):
            return None
        return mark if mark.failed or mark.absent or self.file(folder).exists() else None

    def outcome(self, folder: Path, again: bool = False) -> tuple[str, str]:
        """Look up what is on disk of it, "kept", "failed" or "absent", and why; nothing where it is
        to be computed, `again` where there is no result."""
        before = "" if self.needs is None else self.needs.outcome(folder, again)[0]
        if before in ("failed", "absent"):
            return self.lacking(before)
        mark = self.last_mark(folder)
        if mark is None or mark.settings != self.fingerprint:
            return "", ""
        why = mark.failed or mark.absent
        if not why:
            return "kept", ""
        absent = not mark.failed and self.table.optional
        return ("", "") if again else ("absent" if absent else "failed", why)

    def lacking(self, before: str) -> tuple[str, str]:
        """Outcome where what it starts from failed, or is absent."""
        assert self.needs is not None
        absent = self.table.optional and before == "absent"
        return "absent" if absent else "failed", f"there is no {self.needs.name} to start from"

    def mark(self, folder: Path, **why: str) -> None:
        """Record that it is finished, or why there is nothing."""
        mark = Mark(settings=self.fingerprint, **why)
        path = self.mark_file(folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, lambda file: file.write(mark.model_dump_json().encode()))


def tasks_of(study: Study) -> list[Task]:
    """List all tasks, those that others start from first."""

    @cache
    def family(name: str) -> list[Task]:
        table: Any = study.results[name]
        if isinstance(table, FromPoint):
            every = family(table.of.family)
            starts = [start for start in every if table.of.has(start.values)]
            if not starts:
                have = ", ".join(start.name for start in every)
                raise BadInput(f"{name}.of: there is no {table.of}; there are {have}")
            return [Task(name, one.label, table, one.values, study.chain, one) for one in starts]
        grid = {**table.given, **table.over}
        several = [key for key in grid if len(grid[key]) > 1]
        return [
            Task(name, ",".join(f"{key}={at[key]!r}" for key in several), table, at, study.chain)
            for at in combinations(grid)
        ]

    tasks = (task for name in study.results for task in family(name))
    return sorted(tasks, key=lambda task: task.level)


class NoStart(BadInput):
    """Nothing is there that a part could start from."""


def finish(task: Task, folder: Path) -> str:
    """Compute a task and keep it in a folder that all workers see, or the reason why there is no
    result, so that it is not tried again: returned for an optional part, else raised."""
    try:
        result = computed(task, folder)
    except NoStart as error:
        task.mark(folder, absent=str(error))
        if task.table.optional:
            return str(error)
        raise
    except ContbreatherError as error:
        task.mark(folder, failed=str(error))
        raise
    path = task.file(folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    # the mark comes first, so that a file without one is somebody else's; the result of other
    # settings before that, so that none is taken for this one
    path.unlink(missing_ok=True)
    task.mark(folder)
    if isinstance(result, tuple):
        save(path, **{f"arm{i}": arm for i, arm in enumerate(result, start=1)})
    else:
        save(path, **{task.table.kind: result})
    return ""


# --- what is computed -------------------------------------------------------------------------


def computed(task: Task, folder: Path) -> Any:
    """Compute the result of a task; `NoStart` where what it starts from is not there."""
    table, chain, values = task.table, task.chain, dict(task.values)
    largest = getattr(table, "largest", None)
    steps = None if largest is None else Steps(largest=largest)
    within = getattr(table, "within", {})
    if isinstance(table, Arms):
        return switch(_source(task, folder), within=within, progress=False)
    if isinstance(table, Boundary):
        start, (first, second) = _source(task, folder), table.pair
        return boundary(start, (first, second), within=within, steps=steps, progress=False)
    drive = chain.drive.at(**{name: values.pop(name) for name in table.over})
    on: dict[str, Any] = {**values, **chain.on, "forcing": drive}
    if isinstance(table, ZonesTask):
        more = {name: getattr(table, name) for name in ("past_folds", "beyond", "within")}
        return zones(**on, **more, threshold=chain.threshold, progress=False)
    free, span = table.free, table.window or window_of(table.free, chain.omega)
    near = (values[free], values[free]) if free in values else span
    try:
        breather = find_symmetric(free, near, root=table.root, **on)
    except NoSolution as error:
        raise NoStart(str(error)) from error
    problem = breather.problem_beyond(chain.verge).having(free)
    return trace(problem, free, within={free: span}, steps=steps, progress=False)


def _source(task: Task, folder: Path) -> Point:
    assert task.needs is not None
    branches, arm = load(task.needs.file(folder)), task.table.of.arm
    if isinstance(branches, Branch):  # also where there is one arm alone
        branches = {"": branches, "arm1": branches}
    if arm not in branches:
        raise NoStart(f"{task.needs.name} has no {arm}; it has {', '.join(filter(None, branches))}")
    branch, at = branches[arm], task.table.at
    try:
        return branch.first(at)
    except BadInput as error:
        labels = ", ".join(point.label for point in branch.special)
        name = "/".join(filter(None, (task.needs.name, arm)))
        raise NoStart(f"{name} has no {at}; it has {labels}") from error


# --- what is to be computed -------------------------------------------------------------------


@dataclass(frozen=True)
class DryRun(HtmlRepr):
    """Plan of a study: its parts, and what is there of them.

    Attributes
    ----------
    study : Study
    tasks : sequence of Task
        All parts, those that others start from first.
    folder : Path
        Where results go.
    outcomes : dict
        State of each part by its name, "kept", "failed" or "absent", and why; empty for those that
        are to be computed.
    """

    study: Study
    tasks: Sequence[Task]
    folder: Path
    outcomes: Mapping[str, tuple[str, str]]

    @property
    def left(self) -> list[Task]:
        return [task for task in self.tasks if not self.outcomes[task.name][0]]

    def overview(self) -> list[dict[str, Any]]:
        """Name, kind, conditions and state of each part."""
        return [
            {"name": task.name, "kind": task.table.kind, "conditions": task.conditions,
             "state": WORDS[self.outcomes[task.name][0]]}
            for task in self.tasks
        ]  # fmt: skip

    def table(self) -> Sheet:
        headings, parts = ("name", "conditions", "state"), self.overview()
        return Sheet(
            [Column(heading, [row[heading] for row in parts]) for heading in headings],
            f"{len(self.left)} of {len(self.tasks)} parts to compute, on the {self.on}",
        )

    @property
    def on(self) -> str:
        chain = self.study.chain
        names = ("damping", "spring", "site", "walls", "threshold")
        settings = [(name, value) for name in names if (value := getattr(chain, name))]
        settings += [("omega", chain.omega)] * (chain.omega != 1.0)
        return ", ".join([chain.place.describe(), chain.drive.describe(), *map(_setting, settings)])


def dry_run(path: str | Path, *, folder: str | Path | None = None, again: bool = False) -> DryRun:
    """List what `run` would do with a study file: nothing is computed or written.

    Parameters
    ----------
    path, folder, again
        As of `run`.

    Raises
    ------
    BadInput
        As of `run`.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "small.toml"
    >>> _ = path.write_text("[zones.paper]\\nk = [0.8, 0.4]\\n")
    >>> for part in dry_run(path).overview():
    ...     print(part["name"], part["conditions"], part["state"])
    paper/k=0.8 zones at k = 0.8 to compute
    paper/k=0.4 zones at k = 0.4 to compute
    """
    study = read(path)
    place = named("write", Path(path).with_suffix("") if folder is None else folder)
    place, tasks = place.resolve(), tasks_of(study)
    drawn = [place / f"{name}{ATLAS}" for name in study.atlas] + [*study.pictures(place).values()]
    check_links(file for task in tasks for file in (task.file(place), task.mark_file(place)))
    check_links(file for path in drawn for file in (path, copy_of(path)))
    if not again:
        _check_replaced(place, tasks, drawn)
    return DryRun(study, tasks, place, {task.name: task.outcome(place, again) for task in tasks})


def _check_replaced(place: Path, tasks: Sequence[Task], drawn: Sequence[Path]) -> None:
    """Refuse what would be replaced, for it may have taken weeks."""
    marks = [(task, task.last_mark(place)) for task in tasks]
    changed = [task.name for task, mark in marks if mark and mark.settings != task.fingerprint]
    files = [task.file(place) for task, mark in marks if mark is None]
    foreign = [file for file in files if os.path.lexists(file)]
    foreign += [file for file in drawn if not is_own(file)]
    others = [str(file.relative_to(place)) for file in foreign]
    found = ("results of other settings", changed), ("files that it did not write", others)
    for what, names in found:
        if names:
            raise BadInput(
                f"{place} has {what}: {', '.join(names)}. Name another folder, or have them "
                "replaced (again, --again)"
            )


def _setting(setting: tuple[str, Any]) -> str:
    name, value = setting
    return f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {value}"


# --- the folder -------------------------------------------------------------------------------


def put_in_place(path: Path, write: Callable[[Path], object]) -> Path:
    """Let `write` draw a file, and put it in its place once a copy is on record as the study's own.

    A process may die after each line: there is then no file, or one that is on record.
    """
    target, copy = writable(path), copy_of(path)
    copy.parent.mkdir(parents=True, exist_ok=True)
    target.unlink(missing_ok=True)  # our own, or it was asked for
    write(copy)
    return write_whole(target, lambda file: file.write(copy.read_bytes()))


def copy_of(path: Path) -> Path:
    return path.parent / MARKS / path.name


def is_own(path: Path) -> bool:
    """Tell whether `put_in_place` has written what is there, or nothing is."""
    if not os.path.lexists(path):
        return True
    copy = copy_of(path)
    return path.is_file() and copy.is_file() and cmp(path, copy, shallow=False)


def check_links(files: Iterable[Path]) -> None:
    """Refuse files that a link would put elsewhere; their folder is without links."""
    for file in files:
        if (place := os.path.realpath(file)) != str(file):
            raise BadInput(
                f"{file} is behind a link to {place}; results are kept in the folder itself: "
                "remove the link, or name another folder"
            )
