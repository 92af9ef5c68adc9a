"""`python -m tests.benchmarks`: one table of every promised speed, beside what it is measured by.

Run from the root of the source tree. Measured is what a user gets: no number of threads is set,
here and in the processes started.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from .measure import Absent, Row

for name in [name for name in os.environ if name.endswith("_NUM_THREADS")]:
    del os.environ[name]  # before numpy is imported by anything below


def groups(long: bool, peers_python: str) -> dict[str, Callable[[], list[Row]]]:
    """The groups of rows; each is imported only when it is run, so that any can be run alone."""

    def of(module: str, name: str = "rows", *given: Any) -> Callable[[], list[Row]]:
        return lambda: getattr(import_module(f".{module}", __package__), name)(*given)

    return {
        "stability": of("stability", "rows", long),
        "branch": of("branch"),
        "peers": of("peer_rows", "rows", peers_python),
        "imports": of("session", "import_rows"),
        "zones": of("session", "zones_rows"),
        "first-run": of("session", "first_run_rows"),
        "shooting": of("shooting"),
        "simulation": of("simulation"),
        "large": of("large"),
        "cycles": of("cycles"),
    }


def collect(wanted: dict[str, Callable[[], list[Row]]]) -> list[Row]:
    table: list[Row] = []
    for name, run in wanted.items():
        print(f"{name} ...", file=sys.stderr, flush=True)
        try:
            table += run()
        except (Absent, AttributeError, ImportError) as reason:
            table.append(Row(name, "not available", "-", note=str(reason).splitlines()[0]))
    return table


def show(table: list[Row]) -> None:
    from rich.console import Console
    from rich.table import Table

    drawn = Table(title="contbreather: speed, as ratios taken in one run", show_lines=True)
    for head in ("what", "figure", "compares with", "ratio", "aim", "met", "same result?"):
        short = head in {"ratio", "aim", "met"}
        drawn.add_column(head, no_wrap=short, ratio=None if short else 1)
    for row in table:
        ratio = "" if row.ratio is None else f"{row.ratio:.3g}"
        met = {True: "yes", False: "NO", None: ""}[row.met]
        drawn.add_row(row.what, row.figure, row.compares_with, ratio, row.aim, met, row.note)
    console = Console()
    console = console if console.is_terminal else Console(width=180)
    console.print(drawn)


def main() -> int:
    from .peer_rows import default_python

    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("--long", action="store_true", help="the baseline at N = 1600, too")
    parser.add_argument("--only", action="append", help="a group of rows; may be repeated")
    parser.add_argument("--json", type=Path, help="write the table to this file, too")
    parser.add_argument(
        "--peers-python",
        default=default_python(),
        help="has bifpy and jaxcont (default: $CONTBREATHER_PEERS_PYTHON, or this interpreter)",
    )
    asked = parser.parse_args()
    known = groups(asked.long, asked.peers_python)
    unknown = set(asked.only or ()) - set(known)
    if unknown:
        parser.error(f"no group {sorted(unknown)}; there are {list(known)}")
    table = collect({name: known[name] for name in asked.only or known})
    show(table)
    if asked.json:
        rows = [dataclasses.asdict(row) for row in table]
        asked.json.write_text(json.dumps(rows, indent=1, ensure_ascii=False), encoding="utf-8")
    return int(any(row.met is False for row in table))


if __name__ == "__main__":
    sys.exit(main())
