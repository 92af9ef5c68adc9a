"""`contbreather run`: a whole study out of its file, or the rest of it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import asdict
from typing import TYPE_CHECKING

from contbreather.cli.interrupts import end, kept
from contbreather.cli.options import Workers
from contbreather.cli.output import note, say, to_json
from contbreather.errors import BadInput, NotConverged

if TYPE_CHECKING:
    from contbreather.studies import Report


def run(
    study: str | None = None,
    /,
    *,
    folder: str | None = None,
    workers: Workers | None = None,
    cluster: str | None = None,
    again: bool = False,
    dry_run: bool = False,
    json: bool = False,
) -> None:
    """A study: everything that a TOML file asks for, over all cores, or what is left of it.

    What is finished is on disk; after an interruption the same command goes on. Where standard
    error is no terminal each part that ends is a line there.

    Parameters
    ----------
    study
        The file.
    folder
        Where results go, a file for each part; a folder of the name of the study unless given.
    workers
        Number of processes, all cores unless given.
    cluster
        Address of the scheduler of a Dask cluster, tcp://HOST:PORT, in place of this machine. Its
        workers have to see the folder.
    again
        Replace results of other settings, and try again what failed.
    dry_run
        Check everything, and list what would be computed; nothing is computed or written.
    json
        Print one JSON object.
    """
    from contbreather.studies import plan
    from contbreather.studies import run as conduct
    from contbreather.studies.cluster import cluster as dask

    if study is None:
        raise BadInput("which study? Name its file: contbreather run study.toml")
    if cluster is not None and workers is not None:
        raise BadInput(f"--workers {workers} and --cluster {cluster}: give one of the two")
    if dry_run:
        planned = plan(study, folder=folder, again=again)
        if json:
            to_json({"folder": str(planned.folder), "on": planned.on, "parts": planned.parts()})
        else:
            say(planned)
        return
    tell = None if sys.stderr.isatty() else note
    with nullcontext(workers) if cluster is None else dask(cluster) as executor:
        report, cut = kept(conduct, study, folder=folder, executor=executor, again=again, tell=tell)
    if json:
        written = [str(path) for path in report.written]
        to_json({**asdict(report), "folder": str(report.folder), "written": written})
    else:
        say(*_lines(report))
    end(cut)
    if report.failed:
        raise NotConverged(f"{len(report.failed)} of the study failed: {', '.join(report.failed)}")


def _lines(report: Report) -> Iterator[str]:
    there = f", {len(report.kept)} were there" if report.kept else ""
    yield f"{len(report.computed)} results computed{there}, in {report.folder}."
    for name, reason in report.failed.items():
        yield f"No {name}: {reason.rstrip('.')}."
    for name, reason in report.absent.items():
        yield f"No {name}, which is optional: {reason.rstrip('.')}."
    for path in report.written:
        yield f"Wrote {path}."
    if report.interrupted:
        yield "Interrupted: the same command goes on."
