"""`contbreather figure`, `explore`, `run`: the paper, the explorer, studies, each a package."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from dataclasses import replace
from typing import Annotated, Any

from contbreather.cli.options import Whole, Workers, parameter_help
from contbreather.cli.output import Output, Result, inform, say, to_json
from contbreather.cli.process import CutShort, computing, until_interrupted
from contbreather.errors import BadInput, NotConverged
from contbreather.parameters import NUMBERS


def figure(number: str, *, into: Output = Output()) -> None:
    """A figure of the paper, with what is exact beside what the paper says, and our verdict.

    It is drawn to the file that --output names; without --output, --csv and --json to figure2.png
    for figure 2, and so on, in the current directory.

    Parameters
    ----------
    number
        2 to 8, as numbered in the captions.
    """
    from contbreather.paper import FIGURES

    if number not in map(str, FIGURES):
        raise BadInput(f"figure {number}: there are the figures {', '.join(map(str, FIGURES))}")
    if into == Output():
        into = replace(into, output=f"figure{number}.png")
    into.check()
    with computing():
        drawing = FIGURES[int(number)]()
    rows = list(drawing.rows())
    content: dict[str, Any] = {"figure": int(number), "caption": drawing.caption, "rows": rows}
    if hasattr(drawing, "numbers"):  # what the caption's verdict is made of
        content["numbers"] = drawing.numbers
    table = list(rows[0]), [[row.get(name) for name in rows[0]] for row in rows]
    into.leave(Result(lambda: content, lambda: [drawing.caption], lambda: table, drawing.draw))


def explore(
    run: str | None = None,
    /,
    *,
    k: Annotated[float, parameter_help("k")] = NUMBERS["k"].first,
    port: Whole = 0,
    address: str = "127.0.0.1",
    origin: tuple[str, ...] = (),
    headless: bool = False,
) -> None:
    """Zones, branches and breathers to click through, in a browser; Ctrl-C ends it.

    Parameters
    ----------
    run
        A file with curves to begin with.
    port
        Where to listen; any free port unless given.
    address
        Of this machine, on which others may reach it; 127.0.0.1, this machine alone, unless given.
    origin
        HOST:PORT of another name that it is reached by, behind a proxy for instance, or of a page
        from elsewhere that may talk to it.
    headless
        Do not open a browser.
    """
    from contbreather.explorer import Explorer, server_for

    with computing():
        explorer = Explorer(run=run, k=k)
        server, url = server_for(explorer, port=port, address=address, origins=origin)
        say(f"The explorer is at {url} (Ctrl-C ends it).")
        if not headless:
            server.io_loop.add_callback(server.show, "/")
        server.start()
        server.io_loop.start()  # Ctrl-C stops it between two callbacks, not in the middle of one
        raise KeyboardInterrupt


def run(
    study: str,
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
        Replace results of other settings and files of others, and try again what failed.
    dry_run
        Check everything, and list what would be computed; nothing is computed or written.
    json
        Print one JSON object.
    """
    from contbreather import studies

    if cluster is not None and workers is not None:
        raise BadInput(f"--workers {workers} and --cluster {cluster}: give one of the two")
    if dry_run:
        planned = studies.dry_run(study, folder=folder, again=again)
        if json:
            to_json({"folder": str(planned.folder), "on": planned.on, "parts": planned.overview()})
        else:
            say(planned.table())
        return
    tell = None if sys.stderr.isatty() else inform
    with nullcontext(workers) if cluster is None else studies.cluster(cluster) as executor:
        report, cut = until_interrupted(
            studies.run, study, folder=folder, executor=executor, again=again, tell=tell
        )
    if json:
        parts = ("computed", "kept", "failed", "absent", "interrupted")
        content = {"folder": str(report.folder)} | {name: getattr(report, name) for name in parts}
        to_json({**content, "written": [str(path) for path in report.written]})
    else:
        say(report.table())
    if cut:
        raise CutShort
    if report.failed:
        raise NotConverged(f"{len(report.failed)} of the study failed: {', '.join(report.failed)}")
