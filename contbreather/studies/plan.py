"""What a study will compute: every part with its conditions, and what is there already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from contbreather.errors import BadInput
from contbreather.files import named
from contbreather.parameters import window_of
from contbreather.studies.schema import Study, part
from contbreather.studies.tasks import Task, tasks_of
from contbreather.studies.validation import read
from contbreather.tables import Column, Sheet

WORDS = {"": "to compute", "kept": "there", "failed": "failed before", "absent": "absent"}


@dataclass(frozen=True)
class Plan:
    """What a study will compute.

    Attributes
    ----------
    study : Study
    tasks : sequence of Task
        All parts, those that others start from first.
    left : sequence of Task
        Those that are not there yet.
    folder : Path
        Where results go.
    """

    study: Study
    tasks: Sequence[Task]
    left: Sequence[Task]
    folder: Path

    @cached_property
    def _names(self) -> set[str]:
        return {task.name for task in self.left}

    def wants(self, task: Task) -> bool:
        """Whether a part is to be computed."""
        return task.name in self._names

    def parts(self) -> list[dict[str, Any]]:
        """Name, kind, conditions and state of each part."""
        return [
            {
                "name": task.name,
                "kind": task.kind,
                "conditions": conditions(task),
                "state": WORDS["" if self.wants(task) else task.outcome(self.folder)[0]],
            }
            for task in self.tasks
        ]

    def table(self) -> Sheet:
        """A line for each part."""
        headings, parts = ("name", "conditions", "state"), self.parts()
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
        return ", ".join([chain.place.describe(), chain.drive.describe(), *map(_said, settings)])

    def __rich__(self) -> Sheet:
        return self.table()


def plan(path: str | Path, *, folder: str | Path | None = None, again: bool = False) -> Plan:
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
    >>> for part in plan(path).parts():
    ...     print(part["name"], part["conditions"], part["state"])
    paper/k=0.8 zones at k = 0.8 to compute
    paper/k=0.4 zones at k = 0.4 to compute
    """
    study = read(path)
    place = named("write", folder) if folder is not None else Path(path).with_suffix("")
    place, tasks = place.resolve(), tasks_of(study)
    _check(tasks, place, again)
    left = [task for task in tasks if not task.outcome(place, again)[0]]
    return Plan(study, tasks, left, place)


def _check(tasks: Sequence[Task], folder: Path, again: bool) -> None:
    """Refuse to replace what may have taken weeks."""
    other = [
        task.name
        for task in tasks
        if (mark := task.known(folder)) and mark["settings"] != task.fingerprint
    ]
    if other and not again:
        raise BadInput(
            f"{folder} has results of other settings: {', '.join(other)}. Name another folder, or "
            "have them replaced (again, --again)"
        )


def conditions(task: Task) -> str:
    """What is computed, at which values, in which windows, from what."""
    asked, words = task.asked, [task.kind]
    if task.needs is not None:
        arm = part(asked["of"]).arm
        words += [f"of {asked['at']} on {task.needs.name}{'/' if arm else ''}{arm}"]
    elif task.kind == "branch":
        words += [f"in {asked['free']}"]
    fixed = {} if task.needs else {n: v for n, v in task.values.items() if n != asked.get("free")}
    if fixed:
        words += [f"at {', '.join(map(_said, fixed.items()))}"]
    if "pair" in asked:
        words += [f"in ({', '.join(asked['pair'])})"]
    windows = dict(asked.get("within", {}))
    if task.kind == "branch":
        windows[asked["free"]] = asked.get("window") or window_of(asked["free"])
    ranges = [f"{name} from {low:g} to {high:g}" for name, (low, high) in windows.items()]
    options = [name for name in ("root", "largest", "past_folds") if asked.get(name)]
    return ", ".join([" ".join(words), *ranges, *(_said((name, asked[name])) for name in options)])


def _said(setting: tuple[str, Any]) -> str:
    name, value = setting
    return f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {value}"
