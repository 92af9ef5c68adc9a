"""What tests of the command line share: its answer, and how its JSON and its tables are read."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

Output = tuple[int, str, str]  # status, standard output, standard error
Run = Callable[[str], Output]


def strict(text: str) -> Any:
    """Exactly one JSON value, without NaN or infinities."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} in JSON")

    return json.loads(text, parse_constant=refuse)


def table(path: str | Path) -> list[dict[str, str]]:
    """The rows of a CSV file."""
    with Path(path).open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def write_matrix(name: str, rows: Any) -> None:
    """Rows of numbers, as a lattice is read from."""
    Path(name).write_text("\n".join(",".join(map(str, row)) for row in rows), encoding="utf-8")
