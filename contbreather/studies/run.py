"""A study carried out: what is not finished yet, over cores or a cluster, then what is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from contbreather.errors import BadInput, ContbreatherError, partial_result
from contbreather.orbits.atlas import save_atlas, slices_of, surfaces
from contbreather.plotting.canvas import save_figure
from contbreather.plotting.pictures import plot
from contbreather.plotting.zones import plot_atlas
from contbreather.runs import Run, load
from contbreather.studies.folder import put_in_place
from contbreather.studies.schema import Figure, Study, part
from contbreather.studies.tasks import ATLAS, Task, dry_run, finish
from contbreather.tables import Column, HtmlRepr, Sheet
from contbreather.workers import Failed, each

Tell = Callable[[str], object]
PATIENCE = 5  # seconds until a scheduler that does not answer is given up


@dataclass
class Report(HtmlRepr):
    """What became of a study.

    Attributes
    ----------
    folder : Path
        Where everything is; `contbreather.load` reads it.
    computed, kept : list of str
        Names of the parts that were computed now, and of those that were there already.
    failed : dict
        Name of each part without a result, and the reason.
    absent : dict
        The same of what the study calls optional: there was nothing to start from.
    written : list of Path
        Figures, and atlases as datasets.
    interrupted : bool
        Whether it was stopped; it goes on with the next call.
    """

    folder: Path
    computed: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    absent: dict[str, str] = field(default_factory=dict)
    written: list[Path] = field(default_factory=list)
    interrupted: bool = False

    @property
    def missing(self) -> dict[str, str]:
        """All parts without a result, and why."""
        return self.failed | self.absent

    def table(self) -> Sheet:
        """A line for each part that was computed now, for each without a result with the reason,
        and for each file."""
        rows = [
            *((name, "computed", "") for name in self.computed),
            *((name, "absent, which is optional", why) for name, why in self.absent.items()),
            *((name, "failed", why) for name, why in self.failed.items()),
            *((path.name, "written", "") for path in self.written),
        ]
        there = f", {len(self.kept)} were there" if self.kept else ""
        cut = "; interrupted, the same command goes on" if self.interrupted else ""
        names, outcomes, reasons = zip(*rows, strict=True) if rows else ((), (), ())
        return Sheet(
            [Column("name", names), Column("outcome", outcomes), Column("reason", reasons)],
            f"{len(self.computed)} results computed{there}, in {self.folder}{cut}",
        )

    def enter(self, name: str, outcome: str, why: str = "") -> None:
        """A part that was computed or kept, or failed or is absent for a reason."""
        where = getattr(self, outcome)
        if isinstance(where, dict):
            where[name] = why
        else:
            where.append(name)

    def so_far(self) -> Report:
        """Where an interruption leaves it."""
        self.interrupted = True
        return self


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
        Replace results of other settings and files that it did not write, which are refused
        otherwise, and try once more what failed.
    tell : callable, optional
        ``tell(line)`` is called with one line on each part as it ends, for a log.

    Returns
    -------
    Report

    Raises
    ------
    BadInput
        If the file is wrong: all mistakes at once. If something would be replaced, or a link in
        the folder leads out of it.
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
    asked = dry_run(path, folder=folder, again=again)
    report, todo = Report(asked.folder), asked.left
    ended = _reporting(tell, len(todo))
    try:
        report.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(
            f"cannot write to {report.folder}: {error.strerror}; name a folder"
        ) from error
    for name, (outcome, why) in asked.outcomes.items():
        if outcome:
            report.enter(name, outcome, why)
    with partial_result(report.so_far):
        for level in sorted({task.level for task in todo}):
            work = [task for task in todo if task.level == level and _begun(task, report, ended)]
            computed = each(
                partial(finish, folder=report.folder), work, executor=executor,
                progress=progress, unit="parts", together=1, ended=ended,
            )  # fmt: skip
            for task, result in zip(work, computed, strict=False):
                report.enter(task.name, *_outcome(result))
        draw_figures(asked.study, asked.tasks, report)
    return report


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


def _reporting(tell: Tell | None, total: int) -> Callable[[Task, Any], object]:
    """Called with each part as it ends."""
    numbers = count(1)

    def report_part(task: Task, result: Failed | str) -> None:
        _, why = _outcome(result)
        if tell is not None:
            tell(f"{next(numbers)} of {total}, {task.name}{f': none, {why}' if why else ''}")

    return report_part


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The executor of the cluster with this scheduler.

    Raises
    ------
    BadInput
        If the extra is not installed, or nothing answers.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise BadInput(
            "a cluster needs dask: pip install 'contbreather[cluster]', here and on its workers"
        ) from error
    try:
        client = distributed.Client(address, timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise BadInput(
            f"no cluster answers at {address}: {error}; start one with `dask scheduler` and "
            "`dask worker ADDRESS`"
        ) from error
    with client:
        yield client.get_executor(pure=False)


# --- what is drawn ----------------------------------------------------------------------------


def draw_figures(study: Study, tasks: Sequence[Task], report: Report) -> None:
    """All figures of which everything is there, and all atlases."""
    shown = _StudyResults(study, tasks, report)
    for name in study.atlas:
        if shown.there(name):
            path, atlas = report.folder / f"{name}{ATLAS}", shown.atlas(name)
            report.written.append(put_in_place(path, partial(save_atlas, atlas=atlas)))
    for name, figure in study.figure.items():
        missing = [name for name in figure.draws if not shown.there(name)]
        lost = [name for name in missing if not shown.absent(name)]
        if lost or len(missing) == len(figure.draws):
            why = f"there is nothing of {', '.join(lost or missing)} to draw"
            (report.failed if lost else report.absent)[f"figure {name}"] = why
            continue
        path = report.folder / figure.path(name)
        try:
            report.written.append(put_in_place(path, partial(save_figure, shown.drawn(figure))))
        except ContbreatherError as error:  # a column that is not there: the others are drawn
            report.failed[f"figure {name}"] = str(error)


class _StudyResults(NamedTuple):
    """The results of a study, read for drawing."""

    study: Study
    tasks: Sequence[Task]
    report: Report

    def named(self, name: str) -> list[Task]:
        """Those that a figure names."""
        source = part(name)
        family = [task for task in self.tasks if task.family == source.family]
        return [task for task in family if source.has(task.values)]

    def there(self, name: str) -> bool:
        return any(task.name not in self.report.missing for task in self.named(name))

    def absent(self, name: str) -> bool:
        return all(task.name in self.report.absent for task in self.named(name))

    def results(self, name: str) -> list[Any]:
        """All that is named, as far as it is there; arms one by one."""
        arm, results = part(name).arm, list[Any]()
        for task in self.named(name):
            if task.name in self.report.missing:
                continue
            result = load(task.file(self.report.folder))
            several = result.values() if isinstance(result, Run) else [result]
            results += [result[arm]] if arm and isinstance(result, Run) else several
        return results

    def atlas(self, name: str) -> Any:
        table, drive = self.study.atlas[name], self.study.chain.drive
        slices = slices_of({table.fixed: getattr(table, table.fixed)}, table.over, drive)
        diagrams = [
            Failed(task.name, BadInput(self.report.failed[task.name]))
            if task.name in self.report.failed
            else load(task.file(self.report.folder))
            for task in self.named(name)
        ]
        return surfaces(slices, diagrams)

    def drawn(self, figure: Figure) -> Any:
        first = figure.draws[0]
        if first in self.study.atlas:
            return plot_atlas(self.atlas(first), over=figure.over, at=figure.at)
        results = [result for name in figure.draws for result in self.results(name)]
        return plot(*results, x=figure.x, y=figure.y)
