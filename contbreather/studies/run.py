"""A study carried out: what is not finished yet, over the cores, then what is drawn of it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from itertools import count
from pathlib import Path
from typing import Any

from contbreather.errors import BadInput, partial_result
from contbreather.studies.figures import drawn
from contbreather.studies.plan import plan
from contbreather.studies.report import Report
from contbreather.studies.tasks import Task, Worker
from contbreather.workers import Failed, each

Tell = Callable[[str], object]


def run(
    path: str | Path,
    *,
    folder: str | Path | None = None,
    executor: Executor | int | None = None,
    progress: bool | None = None,
    again: bool = False,
    tell: Tell | None = None,
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
    tell : callable, optional
        ``tell(line)`` is called with one line on each part as it ends, for a log.

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
    asked = plan(path, folder=folder, again=again)
    report, todo = Report(asked.folder), asked.left
    ended = _told(tell, len(todo))
    _made(report.folder)
    for task in asked.tasks:
        if not asked.wants(task):
            report.enter(task.name, *task.outcome(report.folder))
    with partial_result(report.so_far):
        for level in sorted({task.level for task in todo}):
            work = [task for task in todo if task.level == level and _begun(task, report, ended)]
            computed = each(
                Worker(report.folder), work, executor=executor, progress=progress, unit="parts",
                together=1, ended=ended,
            )  # fmt: skip
            for task, result in zip(work, computed, strict=False):
                report.enter(task.name, *_outcome(result))
        drawn(asked.study, asked.tasks, report)
    return report


def _made(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot write to {folder}: {error.strerror}; name a folder") from error


def _begun(task: Task, report: Report, ended: Callable[[Task, Any], object]) -> bool:
    """Whether there is what it starts from."""
    if task.needs is None or task.needs.name not in report.missing:
        return True
    outcome, why = task.lacking("absent" if task.needs.name in report.absent else "failed")
    report.enter(task.name, outcome, why)
    ended(task, why)
    return False


def _outcome(result: Failed | str) -> tuple[str, str]:
    """What became of a part that was not there, and why."""
    if isinstance(result, Failed):
        return "failed", result.reason
    return "absent" if result else "computed", result


def _told(tell: Tell | None, total: int) -> Callable[[Task, Any], object]:
    """Called with each part as it ends."""
    numbers = count(1)

    def told(task: Task, result: Failed | str) -> None:
        _, why = _outcome(result)
        if tell is not None:
            tell(f"{next(numbers)} of {total}, {task.name}{f': none, {why}' if why else ''}")

    return told
