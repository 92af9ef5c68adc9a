"""A study carried out: what is not finished yet, over the cores, then what is drawn of it."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

from contbreather.errors import BadInput, partial_result
from contbreather.files import named
from contbreather.studies.figures import drawn
from contbreather.studies.report import Report
from contbreather.studies.tasks import Task, Worker, tasks_of
from contbreather.studies.validation import read
from contbreather.workers import Failed, each


def run(
    path: str | Path,
    *,
    folder: str | Path | None = None,
    executor: Executor | int | None = None,
    progress: bool | None = None,
    again: bool = False,
) -> Report:
    """Do what a study file says, or the rest of it.

    Parameters
    ----------
    path : str or Path
        The file, TOML; the page on studies of the documentation says what may stand in it.
    folder : str or Path, optional
        Where results go, a file for each part; beside the study, by its name, unless given. Workers
        on other machines have to see it under the same path.
    executor : concurrent.futures.Executor or int, optional
        Who computes the parts: as of `contbreather.trace_many`.
    progress : bool, optional
        Show how many parts are done; by default at a terminal or in a notebook only.
    again : bool
        Replace results of other settings, and try once more what failed; such results are
        refused otherwise.

    Returns
    -------
    Report

    Raises
    ------
    BadInput
        If the file is wrong: all mistakes at once. If there are results of other settings.
    Interrupted
        On Ctrl-C; its ``partial`` is the report up to there.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "small.toml"
    >>> _ = path.write_text('''
    ... [branch.first]
    ... free = "a"
    ... gamma = 0.04
    ... k = 0.8
    ... window = [0.6, 0.8]
    ... ''')
    >>> run(path).computed, run(path).kept
    (['first'], ['first'])
    """
    study = read(path)
    place = named("write", folder) if folder is not None else Path(path).with_suffix("")
    place = place.resolve()
    tasks, report = tasks_of(study), Report(place)
    _made(place)
    _check(tasks, place, again)
    with partial_result(report.so_far):
        for level in sorted({task.level for task in tasks}):
            todo = _left([task for task in tasks if task.level == level], report, again)
            _do(todo, report, executor, progress)
        drawn(study, tasks, report)
    return report


def _made(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot write to {folder}: {error.strerror}; name a folder") from error


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


def _left(level: Sequence[Task], report: Report, again: bool) -> list[Task]:
    """What is not finished, and can be begun."""
    todo = []
    for task in level:
        mark = task.known(report.folder)
        done = mark is not None and mark["settings"] == task.fingerprint
        if task.needs is not None and task.needs.name in report.failed:
            report.failed[task.name] = f"there is no {task.needs.name} to start from"
        elif not done or (again and mark and mark["failed"]):
            todo.append(task)
        elif mark and mark["failed"]:
            report.failed[task.name] = mark["failed"]
        else:
            report.kept.append(task.name)
    return todo


def _do(
    todo: Sequence[Task], report: Report, executor: Executor | int | None, progress: bool | None
) -> None:
    work = Worker(report.folder)
    results = each(work, todo, executor=executor, progress=progress, unit="parts", together=1)
    for task, found in zip(todo, results, strict=False):
        if isinstance(found, Failed):
            report.failed[task.name] = found.reason
        else:
            report.computed.append(task.name)
