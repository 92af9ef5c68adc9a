"""Files written whole or not at all."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path

from contbreather.errors import BadInput

FIGURES = (".png", ".pdf", ".svg")


def written(path: str | Path, write: Callable[[Path], None]) -> Path:
    """Let `write` fill a temporary file beside `path`, then put it in its place at once.

    Whoever reads `path` sees the old file or the new one, never half of it; a symbolic link stays
    one. What is no ordinary file (``/dev/stdout``, a named pipe) is written to directly.

    Raises
    ------
    BadInput
        If `path` is empty, a directory, or cannot be written, with the system's reason.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = written(f"{folder}/note.txt", lambda file: Path.touch(file))
    ...     made.name, made.exists()
    ('note.txt', True)
    """
    target = writable(path)
    if target.exists() and not target.is_file():
        _attempt(target, lambda: write(target))
        return target
    real = Path(os.path.realpath(target))
    # the suffix stays last: some writers choose their format by it
    partial = real.with_name(f".{real.stem}.{os.getpid()}.part{real.suffix}")
    try:
        _attempt(target, lambda: write(partial))
        _attempt(target, lambda: os.replace(partial, real))
    finally:
        partial.unlink(missing_ok=True)
    return target


def writable(path: str | Path) -> Path:
    """The path, or what is wrong with it: better before a long computation than after it."""
    if not str(path).strip():
        raise BadInput("the name of the file to write is empty; give one, for instance zones.csv")
    target = Path(path)
    if target.is_dir():
        raise BadInput(f"cannot write {target}: it is a directory; name a file in it")
    folder = target.parent
    if not folder.is_dir():
        raise BadInput(f"cannot write {target}: there is no directory {folder}; make it first")
    ordinary = not target.exists() or stat.S_ISREG(target.stat().st_mode)
    place = Path(os.path.realpath(target)).parent if ordinary else target
    if not os.access(place, os.W_OK):
        raise BadInput(f"cannot write {target}: no permission; choose another place")
    return target


def figure_path(path: str | Path) -> Path:
    """The path of a figure: its suffix says the format."""
    target = writable(path)
    if target.suffix.lower() not in FIGURES:
        raise BadInput(
            f"cannot write the figure {target}: its suffix must be one of {', '.join(FIGURES)}"
        )
    return target


def _attempt(target: Path, action: Callable[[], object]) -> None:
    try:
        action()
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInput(f"cannot write {target}: {reason}; choose another place") from error
