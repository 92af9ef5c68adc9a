"""The tasks of a study: each computed by itself, kept in a file of its own, and never again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contbreather.checks import combinations
from contbreather.continuation import Branch, Point, Steps, boundary, trace
from contbreather.continuation.switching import switch
from contbreather.errors import BadInput, ContbreatherError
from contbreather.files import write_whole
from contbreather.orbits.start_search import find_symmetric, problem_with
from contbreather.orbits.zones_many import Slice, drawn
from contbreather.parameters import window_of
from contbreather.runs import load, save
from contbreather.studies.schema import Chain, Study, Table

MARKS = ".study"  # the folder of what is known of the tasks


@dataclass(frozen=True)
class Task:
    """What one process computes: plain data, so that it goes anywhere."""

    family: str  # the name in the study
    label: str  # which of its family, "k=0.8"; empty where it is alone
    kind: str  # branch, arms, boundary or zones
    asked: Mapping[str, Any]  # all that its result depends on, but for the part it starts from
    needs: Task | None = None  # that task

    @property
    def name(self) -> str:
        return f"{self.family}/{self.label}" if self.label else self.family

    @property
    def level(self) -> int:
        return 0 if self.needs is None else 1 + self.needs.level

    @property
    def fingerprint(self) -> str:
        """Of everything that the result depends on."""
        before = None if self.needs is None else self.needs.fingerprint
        said = json.dumps([self.kind, self.asked, before], sort_keys=True)
        return hashlib.sha256(said.encode()).hexdigest()

    def file(self, folder: Path) -> Path:
        return folder / f"{self.name}.nc"

    def _mark(self, folder: Path) -> Path:
        return folder / MARKS / f"{self.name.replace('/', '@')}.json"

    def known(self, folder: Path) -> dict[str, Any] | None:
        """What is known of it: of which settings its result is, and why there is none."""
        try:
            mark: dict[str, Any] = json.loads(self._mark(folder).read_text(encoding="utf-8"))
        except (FileNotFoundError, ValueError):
            return None
        return mark if mark["failed"] or self.file(folder).exists() else None

    def mark(self, folder: Path, failed: str = "") -> None:
        """Say that it is finished; last of all, so that what is said is there."""
        text = json.dumps({"settings": self.fingerprint, "failed": failed})
        self._mark(folder).parent.mkdir(parents=True, exist_ok=True)
        write_whole(self._mark(folder), lambda file: file.write(text.encode()))


def tasks_of(study: Study) -> list[Task]:
    """All tasks, those that others start from first."""
    chain = study.chain.plain
    found: dict[str, list[Task]] = {}
    for name, branch in study.branch.items():
        found[name] = _over(name, "branch", branch.grid, {**branch.plain, "chain": chain})
    for name, zones in {**study.zones, **study.atlas}.items():
        found[name] = _over(name, "zones", zones.grid, {**zones.plain, "chain": chain})
    rest: dict[str, Table] = {**study.arms, **study.boundary}
    while rest:
        for name, table in list(rest.items()):
            source = table.source
            if source in found:
                kind = "arms" if name in study.arms else "boundary"
                found[name] = [
                    Task(name, one.label, kind, table.plain, one) for one in found[source]
                ]
                del rest[name]
    return sorted((one for family in found.values() for one in family), key=lambda one: one.level)


def _over(
    name: str, kind: str, grid: Mapping[str, list[float]], asked: Mapping[str, Any]
) -> list[Task]:
    """A task for each combination of values."""
    several = [one for one in grid if len(grid[one]) > 1]
    # a result depends on its own values only, so that more of them may be asked for later
    alike = {key: value for key, value in asked.items() if key not in (*grid, "over")}
    family = []
    for at in combinations(grid):
        label = ",".join(f"{one}={at[one]!r}" for one in several)
        family.append(Task(name, label, kind, {**alike, "at": at}))
    return family


@dataclass(frozen=True)
class Worker:
    """Computes tasks, and keeps them in a folder that all workers see."""

    folder: Path

    def __call__(self, task: Task) -> Task:
        """The part, once its result is on disk.

        Raises
        ------
        ContbreatherError
            Where there is none; the folder knows why, so that it is not tried again.
        """
        try:
            result = _COMPUTED[task.kind](task, self.folder)
        except ContbreatherError as error:
            task.mark(self.folder, str(error))
            raise
        path = task.file(self.folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(result, tuple):
            save(path, **{f"arm{i}": arm for i, arm in enumerate(result, start=1)})
        else:
            save(path, **{task.kind: result})
        task.mark(self.folder)
        return task


# --- what is computed -------------------------------------------------------------------------


def _chain(asked: Mapping[str, Any]) -> tuple[Chain, Any]:
    """What it lives on, and the forcing with the values of this part."""
    chain = Chain.model_validate(asked["chain"])
    drive = chain.drive
    own = {name: value for name, value in asked["at"].items() if name in drive.params}
    return chain, drive.at(**own) if own else drive


def _branch(task: Task, folder: Path) -> Branch:
    asked, free = task.asked, task.asked["free"]
    chain, drive = _chain(asked)
    span = tuple(asked.get("window") or window_of(free))
    at = {name: value for name, value in asked["at"].items() if name in ("a", "gamma", "k")}
    near = (at[free], at[free]) if free in at else span
    start = find_symmetric(
        free, near, root=asked.get("root"), **{**at, **chain.on, "forcing": drive}
    )
    problem = problem_with(start, free, threshold=chain.verge)
    return trace(problem, free, within={free: span}, steps=_steps(asked), progress=False)


def _arms(task: Task, folder: Path) -> tuple[Branch, ...]:
    return switch(_source(task, folder), within=_within(task), progress=False)


def _boundary(task: Task, folder: Path) -> Branch:
    one, other = task.asked["pair"]
    steps, point = _steps(task.asked), _source(task, folder)
    return boundary(point, (one, other), within=_within(task), steps=steps, progress=False)


def _zones(task: Task, folder: Path) -> Any:
    asked = task.asked
    chain, drive = _chain(asked)
    name = next(name for name in asked["at"] if name not in drive.params)
    shared = {"lattice": chain.place, "threshold": chain.verge, "within": _within(task)}
    plane = Slice(name, asked["at"][name], drive)
    return drawn(plane, **shared, past_folds=asked["past_folds"])


_COMPUTED: Mapping[str, Callable[[Task, Path], Any]] = {
    "branch": _branch,
    "arms": _arms,
    "boundary": _boundary,
    "zones": _zones,
}


def _steps(asked: Mapping[str, Any]) -> Steps | None:
    return Steps(largest=asked["largest"]) if "largest" in asked else None


def _within(task: Task) -> dict[str, tuple[float, float]]:
    return {name: (low, high) for name, (low, high) in task.asked.get("within", {}).items()}


def _source(task: Task, folder: Path) -> Point:
    """The special point that it starts from."""
    assert task.needs is not None
    found, member = load(task.needs.file(folder)), task.asked["of"].partition("/")[2]
    branch: Branch = found[member] if member and not isinstance(found, Branch) else found
    if not isinstance(branch, Branch):
        raise BadInput(f"{task.name}: no {member!r} in {task.needs.name}; it has {list(found)}")
    return branch.first(task.asked["at"])
