"""The tasks of a study: each computed by itself, kept in a file of its own, and never again; what
will be computed, with its conditions, and what is there already."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from contbreather.checks import combinations
from contbreather.continuation.boundary import boundary
from contbreather.continuation.branch import Branch
from contbreather.continuation.point import Point
from contbreather.continuation.settings import Steps
from contbreather.continuation.switching import switch
from contbreather.continuation.trace import trace
from contbreather.errors import BadInput, ContbreatherError, NoSolution
from contbreather.files import named, write_whole
from contbreather.orbits.atlas import Slice, drawn_in_plane
from contbreather.orbits.start_search import find_symmetric, problem_with
from contbreather.parameters import window_of
from contbreather.runs import load, save
from contbreather.studies.folder import MARKS, check_links, is_own, places
from contbreather.studies.schema import Chain, FromPoint, GridTask, Study, part
from contbreather.studies.validation import read
from contbreather.tables import Column, HtmlRepr, Sheet

ATLAS = ".nc4"  # beside the results that `load` reads
WORDS = {"": "to compute", "kept": "there", "failed": "failed before", "absent": "absent"}


class Mark(BaseModel):
    """What is known of a task: of which settings its result is, and why there is none: it `failed`,
    or what it starts from is `absent`."""

    model_config = ConfigDict(frozen=True, strict=True)

    settings: str
    failed: str = ""
    absent: str = ""


@dataclass(frozen=True)
class Task:
    """What one process computes: plain data, so that it goes anywhere."""

    family: str  # the name in the study
    label: str  # which of its family, "k=0.8"; empty where it is alone
    kind: str  # branch, arms, boundary or zones
    asked: Mapping[str, Any]  # all that its result depends on, but for the part it starts from
    needs: Task | None = None  # that task
    optional: bool = False  # whether it may be that there is nothing to start from

    @property
    def name(self) -> str:
        return f"{self.family}/{self.label}" if self.label else self.family

    @property
    def level(self) -> int:
        return 0 if self.needs is None else 1 + self.needs.level

    @property
    def values(self) -> dict[str, float]:
        """Of the parameters, as far as the study fixes them."""
        return dict(self.asked["at"]) if self.needs is None else self.needs.values

    @property
    def fingerprint(self) -> str:
        """Of everything that the result depends on."""
        before = None if self.needs is None else self.needs.fingerprint
        settings = json.dumps([self.kind, self.asked, before], sort_keys=True)
        return hashlib.sha256(settings.encode()).hexdigest()

    def file(self, folder: Path) -> Path:
        return folder / f"{self.name}.nc"

    def mark_file(self, folder: Path) -> Path:
        return folder / MARKS / f"{self.name.replace('/', '@')}.json"

    def last_mark(self, folder: Path) -> Mark | None:
        """Read what the last run said of it, if any did."""
        try:
            return Mark.model_validate_json(self.mark_file(folder).read_bytes())
        except (FileNotFoundError, NotADirectoryError, ValidationError):
            return None

    def stored_state(self, folder: Path) -> Mark | None:
        """What is known of it, as far as its result is there."""
        mark = self.last_mark(folder)
        there = mark and (mark.failed or mark.absent or self.file(folder).exists())
        return mark if there else None

    def outcome(self, folder: Path, again: bool = False) -> tuple[str, str]:
        """What is on disk of it, "kept", "failed" or "absent", and why; nothing where it is to be
        computed, `again` where there is no result."""
        before = "" if self.needs is None else self.needs.outcome(folder, again)[0]
        if before in ("failed", "absent"):
            return self.lacking(before)
        mark = self.stored_state(folder)
        if mark is None or mark.settings != self.fingerprint:
            return "", ""
        why = mark.failed or mark.absent
        if not why:
            return "kept", ""
        absent = self.optional and not mark.failed
        return ("", "") if again else ("absent" if absent else "failed", why)

    def lacking(self, before: str) -> tuple[str, str]:
        """Its outcome where what it starts from failed, or is absent."""
        assert self.needs is not None
        absent = self.optional and before == "absent"
        return "absent" if absent else "failed", f"there is no {self.needs.name} to start from"

    def mark(self, folder: Path, **why: str) -> None:
        """Say that it is finished, or why there is nothing."""
        mark = Mark(settings=self.fingerprint, **why)
        path = self.mark_file(folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, lambda file: file.write(mark.model_dump_json().encode()))


def tasks_of(study: Study) -> list[Task]:
    """All tasks, those that others start from first."""
    chain = study.chain.entries

    @cache
    def family(name: str) -> list[Task]:
        table = study.results[name]
        if isinstance(table, GridTask):
            kind = "branch" if name in study.branch else "zones"
            return _over(name, kind, table.grid, {**table.entries, "chain": chain})
        assert isinstance(table, FromPoint)
        source, kind = part(table.of), "arms" if name in study.arms else "boundary"
        # a result is the same, be it asked for alone or with the others of its family
        asked = table.entries | {"of": "/".join(filter(None, (source.family, source.arm)))}
        starts = (start for start in family(source.family) if source.has(start.values))
        return [_task(name, start.label, kind, asked, start) for start in starts]

    tasks = (task for name in study.results for task in family(name))
    return sorted(tasks, key=lambda task: task.level)


def _over(
    name: str, kind: str, grid: Mapping[str, list[float]], asked: Mapping[str, Any]
) -> list[Task]:
    """A task for each combination of values."""
    several = [name for name in grid if len(grid[name]) > 1]
    # a result depends on its own values only, so that more of them may be asked for later
    alike = {key: value for key, value in asked.items() if key not in (*grid, "over")}
    family = []
    for at in combinations(grid):
        label = ",".join(f"{name}={at[name]!r}" for name in several)
        family.append(_task(name, label, kind, {**alike, "at": at}))
    return family


def _task(
    family: str, label: str, kind: str, said: Mapping[str, Any], needs: Task | None = None
) -> Task:
    """What it comes to does not depend on whether it may be absent."""
    asked = {name: value for name, value in said.items() if name != "optional"}
    return Task(family, label, kind, asked, needs, said.get("optional", False))


class NoStart(BadInput):
    """What a part starts from is not there."""


def finish(task: Task, folder: Path) -> str:
    """Compute a task and keep it in a folder that all workers see.

    Returns
    -------
    str
        Nothing, once the result is on disk; of an optional part why there is none.

    Raises
    ------
    ContbreatherError
        Where there is none; the folder knows why, so that it is not tried again.
    """
    try:
        result = computed(task, folder)
    except NoStart as error:
        task.mark(folder, absent=str(error))
        if task.optional:
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
        save(path, **{task.kind: result})
    return ""


# --- what is computed -------------------------------------------------------------------------


def computed(task: Task, folder: Path) -> Any:
    """The result of a task.

    Raises
    ------
    NoStart
        Where what it starts from is not there.
    """
    asked = task.asked
    steps = Steps(largest=asked["largest"]) if "largest" in asked else None
    within = {name: (low, high) for name, (low, high) in asked.get("within", {}).items()}
    if task.needs is not None:
        point = _source(task, folder)
        if task.kind == "arms":
            return switch(point, within=within, progress=False)
        return boundary(point, tuple(asked["pair"]), within=within, steps=steps, progress=False)
    chain = Chain.model_validate(asked["chain"])
    drive = chain.drive
    letters = {name: value for name, value in asked["at"].items() if name in drive.params}
    at = {name: value for name, value in asked["at"].items() if name not in letters}
    drive = drive.at(**letters) if letters else drive
    if task.kind == "zones":
        ((name, value),) = at.items()
        how = {"past_folds": asked["past_folds"], "threshold": chain.threshold}
        return drawn_in_plane(Slice(name, value, drive), **chain.on, **how, within=within)
    free = asked["free"]
    span = tuple(asked.get("window") or window_of(free))
    near = (at[free], at[free]) if free in at else span
    chosen = {**at, **chain.on, "forcing": drive}
    try:
        start = find_symmetric(free, near, root=asked.get("root"), **chosen)
    except NoSolution as error:
        raise NoStart(str(error)) from error
    problem = problem_with(start, free, threshold=chain.verge)
    return trace(problem, free, within={free: span}, steps=steps, progress=False)


def _source(task: Task, folder: Path) -> Point:
    """The special point that it starts from."""
    assert task.needs is not None
    branches, arm = load(task.needs.file(folder)), part(task.asked["of"]).arm
    if isinstance(branches, Branch):  # also where there is one arm alone
        branches = {"": branches, "arm1": branches}
    if arm not in branches:
        raise NoStart(f"{task.needs.name} has no {arm}; it has {', '.join(filter(None, branches))}")
    branch, at = branches[arm], task.asked["at"]
    try:
        return branch.first(at)
    except BadInput as error:
        labels = ", ".join(point.label for point in branch.special)
        name = "/".join(filter(None, (task.needs.name, arm)))
        raise NoStart(f"{name} has no {at}; it has {labels}") from error


# --- what is to be computed -------------------------------------------------------------------


@dataclass(frozen=True)
class DryRun(HtmlRepr):
    """What a study would compute.

    Attributes
    ----------
    study : Study
    tasks : sequence of Task
        All parts, those that others start from first.
    folder : Path
        Where results go.
    outcomes : dict
        By the name of a part what there is of it, "kept", "failed" or "absent", and why; nothing of
        those that are to be computed.
    """

    study: Study
    tasks: Sequence[Task]
    folder: Path
    outcomes: Mapping[str, tuple[str, str]]

    @property
    def left(self) -> list[Task]:
        """Those that are not there yet."""
        return [task for task in self.tasks if not self.outcomes[task.name][0]]

    def overview(self) -> list[dict[str, Any]]:
        """Name, kind, conditions and state of each part."""
        return [
            {
                "name": task.name,
                "kind": task.kind,
                "conditions": task_conditions(task),
                "state": WORDS[self.outcomes[task.name][0]],
            }
            for task in self.tasks
        ]

    def table(self) -> Sheet:
        """A line for each part."""
        headings, parts = ("name", "conditions", "state"), self.overview()
        return Sheet(
            [Column(heading, [row[heading] for row in parts]) for heading in headings],
            f"{len(self.left)} of {len(self.tasks)} parts to compute, on the {self.on}",
        )

    @property
    def on(self) -> str:
        """What breathers live on, and what drives it."""
        chain = self.study.chain
        names = ("damping", "spring", "site", "walls", "threshold")
        settings = [(name, value) for name in names if (value := getattr(chain, name))]
        return ", ".join([chain.place.describe(), chain.drive.describe(), *map(_setting, settings)])


def dry_run(path: str | Path, *, folder: str | Path | None = None, again: bool = False) -> DryRun:
    """What `run` would do with a study file: everything is checked, nothing is computed or written.

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
    place = named("write", folder) if folder is not None else Path(path).with_suffix("")
    place, tasks = place.resolve(), tasks_of(study)
    drawn = [place / f"{name}{ATLAS}" for name in study.atlas]
    drawn += [place / figure.path(name) for name, figure in study.figure.items()]
    check_links(file for task in tasks for file in (task.file(place), task.mark_file(place)))
    check_links(file for path in drawn for file in places(path))
    if not again:
        _check_replaced(place, tasks, drawn)
    return DryRun(study, tasks, place, {task.name: task.outcome(place, again) for task in tasks})


def _check_replaced(place: Path, tasks: Sequence[Task], drawn: Sequence[Path]) -> None:
    """Refuse what would be replaced, for it may have taken weeks."""
    states = {task.name: (task.stored_state(place), task.fingerprint) for task in tasks}
    changed = [name for name, (mark, now) in states.items() if mark and mark.settings != now]
    files = [task.file(place) for task in tasks if task.last_mark(place) is None]
    foreign = [file for file in files if os.path.lexists(file)]
    foreign += [file for file in drawn if not is_own(file)]
    others = [str(file.relative_to(place)) for file in foreign]
    for what, names in {"results of other settings": changed,
                        "files that it did not write": others}.items():  # fmt: skip
        if names:
            raise BadInput(
                f"{place} has {what}: {', '.join(names)}. Name another folder, or have them "
                "replaced (again, --again)"
            )


def task_conditions(task: Task) -> str:
    """What is computed, at which values, in which windows, from what."""
    asked, words = task.asked, [task.kind]
    if task.needs is not None:
        arm = part(asked["of"]).arm
        words += [f"of {asked['at']} on {task.needs.name}{'/' if arm else ''}{arm}"]
    elif task.kind == "branch":
        words += [f"in {asked['free']}"]
    fixed = {} if task.needs else {n: v for n, v in task.values.items() if n != asked.get("free")}
    if fixed:
        words += [f"at {', '.join(map(_setting, fixed.items()))}"]
    if "pair" in asked:
        words += [f"in ({', '.join(asked['pair'])})"]
    windows = dict(asked.get("within", {}))
    if task.kind == "branch":
        windows[asked["free"]] = asked.get("window") or window_of(asked["free"])
    ranges = [f"{name} from {low:g} to {high:g}" for name, (low, high) in windows.items()]
    options = [name for name in ("root", "largest", "past_folds") if asked.get(name)]
    return ", ".join(
        [" ".join(words), *ranges, *(_setting((name, asked[name])) for name in options)]
    )


def _setting(setting: tuple[str, Any]) -> str:
    name, value = setting
    return f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {value}"
