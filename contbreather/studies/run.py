"""A study carried out: what is not finished yet, over cores or a cluster, then what is drawn."""

from __future__ import annotations

from collections import deque
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
from contbreather.studies.schema import Part, Study
from contbreather.studies.tasks import ATLAS, Task, dry_run, finish, put_in_place
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
    outcomes : dict
        What became of each part and figure by its name, "computed" now, "kept" from before,
        "failed", or "absent", where it is optional and there was nothing to start from; and why.
    written : list of Path
        Figures, and atlases as datasets.
    interrupted : bool
        Whether it was stopped; it goes on with the next call.
    """

    folder: Path
    outcomes: dict[str, tuple[str, str]]
    written: list[Path] = field(default_factory=list)
    interrupted: bool = False

    @property
    def computed(self) -> list[str]:
        return [*self._with("computed")]

    @property
    def kept(self) -> list[str]:
        return [*self._with("kept")]

    @property
    def failed(self) -> dict[str, str]:
        """Name of each part without a result, and of each figure that lacks one; and why."""
        return self._with("failed")

    @property
    def absent(self) -> dict[str, str]:
        """Optional parts to which nothing was there to start from, and why."""
        return self._with("absent")

    def _with(self, outcome: str) -> dict[str, str]:
        return {name: why for name, (its, why) in self.outcomes.items() if its == outcome}

    def table(self) -> Sheet:
        """A line for each part that was computed now, for each without a result with the reason,
        and for each file."""
        words = {"computed": "computed", "absent": "absent, which is optional", "failed": "failed"}
        rows = [(name, words[it], why) for it in words for name, why in self._with(it).items()]
        rows += [(path.name, "written", "") for path in self.written]
        columns = zip(*rows, strict=True) if rows else ((), (), ())
        count = len(self.computed)
        title = f"{count} result{'s' * (count != 1)} computed"
        title += f", {len(self.kept)} were there" if self.kept else ""
        title += f", in {self.folder}"
        title += "; interrupted, the same command goes on" if self.interrupted else ""
        return Sheet([*map(Column, ("name", "outcome", "reason"), columns)], title)


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
    report, numbers = Report(asked.folder, dict(asked.outcomes)), count(1)

    def enter(task: Task, outcome: str, why: str) -> None:
        report.outcomes[task.name] = outcome, why
        if tell is not None:
            none = f": none, {why}" if why else ""
            tell(f"{next(numbers)} of {len(asked.left)}, {task.name}{none}")

    def ended(task: Task, result: Failed | str) -> None:
        if isinstance(result, Failed):
            enter(task, "failed", result.reason)
        else:
            enter(task, "absent" if result else "computed", result)

    def so_far() -> Report:
        report.interrupted = True
        return report

    try:
        report.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(
            f"cannot write to {report.folder}: {error.strerror}; name a folder"
        ) from error
    with partial_result(so_far):
        for level in sorted({task.level for task in asked.left}):
            work = []
            for task in (task for task in asked.left if task.level == level):
                before = "" if task.needs is None else report.outcomes[task.needs.name][0]
                if before in ("failed", "absent"):
                    enter(task, *task.lacking(before))
                else:
                    work.append(task)
            results = each(
                partial(finish, folder=report.folder), work, executor=executor,
                progress=progress, unit="parts", together=1, ended=ended,
            )  # fmt: skip
            deque(results, 0)
        draw_figures(asked.study, asked.tasks, report)
    return report


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
    """Write all atlases, and all figures of what is there, which say what is not."""
    missing = report.failed | report.absent
    atlases: dict[str, Any] = {}

    def parts_of(source: Part) -> list[Task]:
        return [one for one in tasks if one.family == source.family and source.has(one.values)]

    def there(source: Part) -> list[Task]:
        return [one for one in parts_of(source) if one.name not in missing]

    for name, table in study.atlas.items():
        if there(every := Part(name, {}, "")):  # made of all diagrams, lost ones with the reason
            diagrams = [
                Failed(one.name, BadInput(missing[one.name]))
                if one.name in missing
                else load(one.file(report.folder))
                for one in parts_of(every)
            ]
            slices = slices_of(table.given, table.over, study.chain.drive)
            atlases[name] = surfaces(slices, diagrams)
            write = partial(save_atlas, atlas=atlases[name])
            report.written.append(put_in_place(report.folder / f"{name}{ATLAS}", write))
    for name, path in study.pictures(report.folder).items():
        figure, title = study.figure[name], f"figure {name}"
        nothing = [source for source in figure.draws if not there(source)]
        names = [task.name for one in figure.draws for task in parts_of(one)]
        lost = [one for one in names if one in report.failed]
        if len(nothing) == len(figure.draws):
            why = f"there is nothing of {', '.join(map(str, nothing))} to draw"
            report.outcomes[title] = "failed" if lost else "absent", why
            continue
        try:
            if (family := figure.draws[0].family) in atlases:
                drawn: Any = plot_atlas(atlases[family], **figure.options)
            else:
                parts = [(task, one.arm) for one in figure.draws for task in there(one)]
                results = (_loaded(task, arm, report.folder) for task, arm in parts)
                drawn = plot(*chain.from_iterable(results), **figure.options)
            report.written.append(put_in_place(path, partial(save_figure, drawn)))
            if lost:
                report.outcomes[title] = "failed", f"drawn without {', '.join(lost)}"
        except ContbreatherError as error:  # a column that is not there: the others are drawn
            report.outcomes[title] = "failed", str(error)


def _loaded(task: Task, arm: str, folder: Path) -> list[Any]:
    result = load(task.file(folder))
    if not isinstance(result, Run):
        return [result]
    return [result[arm]] if arm else list(result.values())
