"""What a study draws, and the atlases of it, from what is on disk."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from contbreather.continuation import Branch
from contbreather.errors import BadInput, ContbreatherError
from contbreather.orbits.atlas import save_atlas, surfaces
from contbreather.orbits.zones_many import slices_of
from contbreather.plotting import plot, plot_atlas, plot_zones, save_figure
from contbreather.runs import Run, load
from contbreather.studies.report import Report
from contbreather.studies.schema import Figure, Study, part
from contbreather.studies.tasks import Task
from contbreather.workers import Failed

ATLAS = ".nc4"  # beside the results that `load` reads


def drawn(study: Study, tasks: Sequence[Task], report: Report) -> None:
    """All figures of which everything is there, and all atlases."""
    shown = _Shown(study, tasks, report)
    for name in study.atlas:
        if shown.there(name):
            path = report.folder / f"{name}{ATLAS}"
            report.written.append(save_atlas(path, shown.atlas(name)))
    for name, figure in study.figure.items():
        missing = [name for name in figure.draws if not shown.there(name)]
        lost = [name for name in missing if not shown.absent(name)]
        if lost or len(missing) == len(figure.draws):
            why = f"there is nothing of {', '.join(lost or missing)} to draw"
            (report.failed if lost else report.absent)[f"figure {name}"] = why
            continue
        path = report.folder / (figure.file or f"{name}.png")
        try:
            report.written.append(save_figure(shown.drawn(figure), path))
        except ContbreatherError as error:  # a column that is not there: the others are drawn
            report.failed[f"figure {name}"] = str(error)


class _Shown:
    """The results of a study, read for drawing."""

    def __init__(self, study: Study, tasks: Sequence[Task], report: Report) -> None:
        self.study, self.report = study, report
        self.families: dict[str, list[Task]] = {}
        for task in tasks:
            self.families.setdefault(task.family, []).append(task)

    def tasks(self, name: str) -> list[Task]:
        """Those that a figure names."""
        source = part(name)
        return [task for task in self.families[source.family] if source.has(task.values)]

    def there(self, name: str) -> bool:
        return any(task.name not in self.report.missing for task in self.tasks(name))

    def absent(self, name: str) -> bool:
        return all(task.name in self.report.absent for task in self.tasks(name))

    def results(self, name: str) -> list[Any]:
        """All that is named, as far as it is there; arms one by one."""
        arm, results = part(name).arm, list[Any]()
        for task in self.tasks(name):
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
            for task in self.families[name]
        ]
        return surfaces(slices, diagrams)

    def drawn(self, figure: Figure) -> Any:
        first = figure.draws[0]
        if first in self.study.atlas:
            return plot_atlas(self.atlas(first), over=figure.over, at=figure.at)
        results = [result for name in figure.draws for result in self.results(name)]
        if not isinstance(results[0], Branch):
            return plot_zones(results)
        axes = {"x": figure.x, "y": figure.y}
        chosen: dict[str, Any] = {name: value for name, value in axes.items() if value is not None}
        return plot(*results, **chosen)
