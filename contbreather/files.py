"""Files, whole or not at all: whatever this package writes is written here."""

from __future__ import annotations

import codecs
import csv
import math
import os
import shutil
import stat
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from contbreather.errors import BadInput

STREAMS = {"-": 1, "/dev/stdout": 1, "/dev/stderr": 2}
STREAMS |= {f"{folder}/{n}": n for folder in ("/dev/fd", "/proc/self/fd") for n in (1, 2)}


def write_whole(path: str | Path, write: Callable[[BinaryIO], object]) -> Path:
    """Let `write` fill a temporary file beside `path`, then put it in its place at once.

    Whoever reads `path` sees the old file or the new one, never half of it, even after a loss of
    power. A symbolic link stays one, and a file keeps its mode. What is not an ordinary file
    (``/dev/stdout``, for which ``-`` is short, a named pipe) is written to directly.

    Raises
    ------
    BadInput
        If `path` is no name, a directory or a disk, or cannot be written, with the system's reason.
    """
    target = writable(path)
    try:
        number = stream_of(target)
        if number is not None:
            if sys.stdout is not None:  # as it is where there is none
                sys.stdout.flush()  # what was printed before comes before
            with os.fdopen(os.dup(number), "wb") as stream:
                write(stream)
        elif target.exists() and not target.is_file():
            with target.open("wb") as stream:
                write(stream)
        else:
            _replace(Path(os.path.realpath(target)), write)
    except OSError as error:
        if isinstance(error, BrokenPipeError) and stream_of(target):
            raise  # the reader has seen enough, as with anything printed
        raise refused("write", target, error) from error
    return target


def write_csv(
    path: str | Path, names: Sequence[str], rows: Iterable[Iterable[Any]], remark: str = ""
) -> Path:
    """Rows under their names, each float in the fewest digits that read back as the same, and a
    remark in a last line."""

    def write(file: BinaryIO) -> None:
        writer = csv.writer(codecs.getwriter("utf-8")(file), lineterminator="\n")
        writer.writerow(names)
        for row in rows:
            writer.writerow([_cell(value) for value in row])
        if remark:
            file.write(f"# {remark}\n".encode())

    return write_whole(path, write)


def _cell(value: Any) -> str:
    if isinstance(value, float):  # numpy's double is one
        return "" if math.isnan(value) else repr(float(value))
    return "" if value is None else str(value)


def _replace(target: Path, write: Callable[[BinaryIO], object]) -> None:
    # A name that nobody can foresee, also not another thread: "x" refuses one that is there, be it
    # a link laid by somebody else. It is short, for `target` may be as long as names can be.
    partial = target.with_name(f".{os.urandom(8).hex()}.part")
    try:
        with partial.open("xb") as stream:
            if target.exists():
                with suppress(OSError, AttributeError):  # not ours to give, or unknown to Windows
                    os.chown(partial, target.stat().st_uid, target.stat().st_gid)
                shutil.copymode(target, partial)
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)


def writable(path: str | Path) -> Path:
    """The path, or what is wrong with it: better before a long computation than after it."""
    target = named("write", path)
    if stream_of(target):
        return target
    mode = _mode("write", target)
    if stat.S_ISDIR(mode):
        raise BadInput(f"cannot write {target}: it is a directory; name a file in it")
    if stat.S_ISBLK(mode):
        raise BadInput(f"cannot write {target}: it is a disk; name a file on it")
    folder = Path(os.path.realpath(target)).parent if target.is_symlink() else target.parent
    if not folder.is_dir():
        raise BadInput(f"cannot write {target}: there is no directory {folder}; make it first")
    # a file that is there is replaced, for which its folder must let us write, too
    places = [place for place in (target, folder) if place.exists()]
    if mode and not stat.S_ISREG(mode):
        places = [target]
    if not all(os.access(place, os.W_OK) for place in places):
        read_only = hasattr(os, "statvfs") and os.statvfs(folder).f_flag & os.ST_RDONLY
        reason = "the file system is read-only" if read_only else "no permission"
        raise BadInput(f"cannot write {target}: {reason}; choose another place")
    return target


def stream_of(path: str | Path) -> int | None:
    """The number of the standard stream that a name stands for, if it is one."""
    return STREAMS.get(str(path))


def identity(path: str | Path | int) -> Any:
    """Equal for two names, or numbers of open streams, of the same place; nowhere is no place."""
    path = path if isinstance(path, int) else os.path.expanduser(path)
    try:
        status = os.stat(path)
    except (OSError, ValueError):  # nothing is there yet, or ever
        return object() if isinstance(path, int) else os.path.realpath(path)
    nowhere = os.path.exists(os.devnull) and os.path.samestat(status, os.stat(os.devnull))
    return object() if nowhere else (status.st_dev, status.st_ino)


@contextmanager
def opened(path: str | Path) -> Iterator[BinaryIO]:
    """An ordinary file to read bytes from, or a sentence with the system's reason why not."""
    source = named("read", path)
    mode = _mode("read", source)
    if mode and not stat.S_ISREG(mode):
        obstacle = "a directory" if stat.S_ISDIR(mode) else "not an ordinary file"
        raise BadInput(f"cannot read {source}: it is {obstacle}")
    try:
        with source.open("rb") as stream:
            yield stream
    except OSError as error:
        raise refused("read", source, error) from error


def read_text(path: str | Path) -> str:
    """Read a whole text file, or say in a sentence why not."""
    with opened(path) as stream:
        content = stream.read()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadInput(f"cannot read {path}: it is not text") from error


def named(verb: str, path: object) -> Path:
    """The name of a file, `~` in it the home of the user, or what is wrong with it."""
    if not isinstance(path, str | os.PathLike):
        raise BadInput(
            f"{path!r} is not the name of a file; give one as text, for instance 'run.nc'"
        )
    if not os.fspath(path).strip():
        raise BadInput(f"the name of the file to {verb} is empty; give one, for instance zones.csv")
    return Path(os.path.expanduser(path))  # as a shell does, but for what stands behind a =


def _mode(verb: str, target: Path) -> int:
    """The mode of what is there, behind links; 0 if nothing is."""
    try:
        return target.stat().st_mode
    except FileNotFoundError:
        return 0
    except (OSError, ValueError) as error:  # too long a name, a circle of links, a null byte
        raise refused(verb, target, error) from error


def refused(verb: str, target: Path, error: OSError | ValueError) -> BadInput:
    """The system's reason, as a sentence."""
    reason = getattr(error, "strerror", None) or str(error)
    advice = "; choose another place" if verb == "write" else ""
    return BadInput(f"cannot {verb} {target}: {reason}{advice}")
