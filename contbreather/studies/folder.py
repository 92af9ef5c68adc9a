"""The folder of a study: what it writes is in there, and replaces nothing but its own."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable
from pathlib import Path

from contbreather.errors import BadInput
from contbreather.files import read_text, writable, write_whole

MARKS = ".study"  # what is known of the files beside it


def put_in_place(path: Path, write: Callable[[Path], object]) -> Path:
    """Let `write` draw a file, and put it in its place once it is on record as the study's own.

    A process may die after each line: there is then no file, or one that is on record.
    """
    target, draft, record = places(writable(path))
    draft.parent.mkdir(parents=True, exist_ok=True)
    write(draft)
    target.unlink(missing_ok=True)  # our own, or it was asked for
    write_whole(record, lambda file: file.write(_digest(draft).encode()))
    os.replace(draft, target)
    return target


def is_own(path: Path) -> bool:
    """Tell whether `put_in_place` has written what is there, or nothing is."""
    if not os.path.lexists(path):
        return True
    *_, record = places(path)
    return path.is_file() and record.is_file() and read_text(record) == _digest(path)


def places(path: Path) -> tuple[Path, Path, Path]:
    """The file, where it is drawn first, and the record of it."""
    marks = path.parent / MARKS
    return path, marks / path.name, marks / f"{path.name}.sha256"


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check_links(files: Iterable[Path]) -> None:
    """Refuse files that a link would put elsewhere; their folder is without links."""
    for file in files:
        if (place := os.path.realpath(file)) != str(file):
            raise BadInput(
                f"{file} is behind a link to {place}; results are kept in the folder itself: "
                "remove the link, or name another folder"
            )
