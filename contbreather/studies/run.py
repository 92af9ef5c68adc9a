"""A study carried out: what is not finished yet, over cores or a cluster, then what is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from itertools import chain, count
from pathlib import Path
from typing import Any

from contbreather.errors import BadInput, ContbreatherError, partial_result
from contbreather.orbits.atlas import save_atlas, slices_of, surfaces
from contbreather.plotting.canvas import save_figure
from contbreather.plotting.pictures import plot
from contbreather.plotting.zones import plot_atlas
from contbreather.runs import Run, load
from contbreather.studies.folder import put_in_place
from contbreather.studies.schema import Part, Study
from contbreather.studies.tasks import ATLAS, Task, dry_run, finish
from contbreather.tables import Column, HtmlRepr, Sheet
from contbreather.workers import Failed, each

Tell = Callable[[str], object]


@dataclass
class Report(HtmlRepr):
    """Outcome of a study.

    Attributes
    ----------
    folder : Path
        Where everything is; `contbreather.load` reads it.
    computed, kept : list of str
        Names of the parts that were computed now, and of those that were there already.
    failed : dict
        Name of each part without a result, and the reason.
    absent : dict
        Parts that the study calls optional, and to which nothing was there to start from.
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
        """Parts without a result, and why."""
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
        made = f"{len(self.computed)} result{'s' * (len(self.computed) != 1)} computed"
        return Sheet(
            [Column("name", names), Column("outcome", outcomes), Column("reason", reasons)],
            f"{made}{there}, in {self.folder}{cut}",
        )

    def enter(self, name: str, outcome: str, why: str = "") -> None:
        """Enter a part that was computed or kept, or failed or is absent for a reason."""
        where = getattr(self, outcome)
        if isinstance(where, dict):
            where[name] = why
        else:
            where.append(name)

    def so_far(self) -> Report:
        """Mark it as interrupted."""
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
    report, todo, numbers = Report(asked.folder), asked.left, count(1)

    def ended(task: Task, result: Failed | str) -> None:
        _, why = _outcome(result)
        if tell is not None:
            tell(f"{next(numbers)} of {len(todo)}, {task.name}{f': none, {why}' if why else ''}")

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
            work = []
            for task in todo:
                if task.level == level:
                    if task.needs is None or task.needs.name not in report.missing:
                        work.append(task)
                        continue
                    before = "absent" if task.needs.name in report.absent else "failed"
                    outcome, why = task.lacking(before)
                    report.enter(task.name, outcome, why)
                    ended(task, why)
            results = each(
                partial(finish, folder=report.folder), work, executor=executor,
                progress=progress, unit="parts", together=1, ended=ended,
            )  # fmt: skip
            for task, result in zip(work, results, strict=False):
                report.enter(task.name, *_outcome(result))
        draw_figures(asked.study, asked.tasks, report)
    return report


def _outcome(result: Failed | str) -> tuple[str, str]:
    """Tell what became of a part that was not there, and why."""
    if isinstance(result, Failed):
        return "failed", result.reason
    return "absent" if result else "computed", result


@contextmanager
def cluster(address: str, patience: float = 5.0) -> Iterator[Executor]:
    """Connect to the scheduler of a cluster, as an executor; given up after so many seconds.

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
        client = distributed.Client(address, timeout=patience)
    except (OSError, TimeoutError, ValueError) as error:
        raise BadInput(
            f"no cluster answers at {address}: {error}; start one with `dask scheduler` and "
            "`dask worker ADDRESS`"
        ) from error
    with client:
        yield client.get_executor(pure=False)


# --- what is drawn ----------------------------------------------------------------------------


def draw_figures(study: Study, tasks: Sequence[Task], report: Report) -> None:
    """Write all atlases, and all figures of which everything is there."""

    def named(source: Part) -> list[Task]:
        return [one for one in tasks if one.family == source.family and source.has(one.values)]

    def there(source: Part) -> list[Task]:
        return [one for one in named(source) if one.name not in report.missing]

    def atlas(name: str) -> Any:
        """Make it of all diagrams, those that failed with their reasons."""
        table, drive, whole = study.atlas[name], study.chain.drive, named(Part(name, {}, ""))
        lost = report.failed
        diagrams = [
            Failed(one.name, BadInput(lost[one.name]))
            if one.name in lost
            else load(one.file(report.folder))
            for one in whole
        ]
        return surfaces(slices_of(table.given, table.over, drive), diagrams)

    for name in study.atlas:
        if there(Part(name, {}, "")):
            path = report.folder / f"{name}{ATLAS}"
            report.written.append(put_in_place(path, partial(save_atlas, atlas=atlas(name))))
    for name, path in study.pictures(report.folder).items():
        figure, title = study.figure[name], f"figure {name}"
        missing = [source for source in figure.draws if not there(source)]
        lost = [one for one in missing if {task.name for task in named(one)} - {*report.absent}]
        if lost or len(missing) == len(figure.draws):
            why = f"there is nothing of {', '.join(map(str, lost or missing))} to draw"
            report.enter(title, "failed" if lost else "absent", why)
            continue
        try:
            if (family := figure.draws[0].family) in study.atlas:
                drawn: Any = plot_atlas(atlas(family), **figure.options)
            else:
                results = [
                    _loaded(task, source.arm, report.folder)
                    for source in figure.draws
                    for task in there(source)
                ]
                drawn = plot(*chain.from_iterable(results), **figure.options)
            report.written.append(put_in_place(path, partial(save_figure, drawn)))
        except ContbreatherError as error:  # a column that is not there: the others are drawn
            report.enter(title, "failed", str(error))


def _loaded(task: Task, arm: str, folder: Path) -> list[Any]:
    """Read a result; arms one by one, or the one that is named."""
    result = load(task.file(folder))
    if not isinstance(result, Run):
        return [result]
    return [result[arm]] if arm else list(result.values())
