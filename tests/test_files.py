"""Every file is written whole or not at all, in its place, or refused in a sentence."""

from __future__ import annotations

import errno
import os
import stat
import subprocess
import sys
import threading
from pathlib import Path
from typing import BinaryIO

import pytest

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.files import identity, opened, writable, write_whole


def saying(text: bytes):
    return lambda file: file.write(text)


@pytest.mark.parametrize(
    ("error", "seen"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), BadInput),
        (KeyboardInterrupt("No space"), KeyboardInterrupt),
        (ZeroDivisionError("No space"), ZeroDivisionError),
    ],
)
def test_failed_writing_leaves_the_old_file_and_nothing_else(tmp_path, error, seen) -> None:
    target = tmp_path / "table.csv"
    target.write_text("old")

    def half(file: BinaryIO) -> None:
        file.write(b"ha")
        raise error

    with pytest.raises(seen, match=r"^(cannot write .*table\.csv: )?No space"):
        write_whole(target, half)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_bytes_are_on_the_disk_before_they_have_the_name(monkeypatch, tmp_path):
    seen: list[int] = []

    def fsync(number: int) -> None:
        seen.append(os.fstat(number).st_size)
        assert not (tmp_path / "table.csv").exists()

    monkeypatch.setattr(os, "fsync", fsync)
    write_whole(tmp_path / "table.csv", saying(b"one\n"))
    assert seen == [4]


def test_file_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    made = write_whole(tmp_path / "made", saying(b""))
    assert made.stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("mode", [0o600, 0o644, 0o664, 0o755])
def test_file_that_is_there_keeps_its_mode(tmp_path: Path, mode: int) -> None:
    target = tmp_path / "mine"
    target.touch()
    target.chmod(mode)
    assert stat.S_IMODE(write_whole(target, saying(b"new")).stat().st_mode) == mode


def test_symbolic_links_stay_also_those_that_lead_nowhere_yet(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    link = tmp_path / "link.txt"
    link.symlink_to("folder/real.txt")
    for text in (b"first", b"second"):
        write_whole(link, saying(text))
        assert link.is_symlink()
        assert (tmp_path / "folder" / "real.txt").read_bytes() == text
    assert {path.name for path in tmp_path.rglob("*")} == {"folder", "link.txt", "real.txt"}


def test_devices_and_pipes_are_written_to_and_not_replaced(tmp_path: Path) -> None:
    write_whole(os.devnull, saying(b"gone"))
    assert Path(os.devnull).is_char_device()
    pipe, heard = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: heard.append(pipe.read_bytes()))
    reader.start()
    write_whole(pipe, saying(b"through"))
    reader.join()
    assert heard == [b"through"]
    assert pipe.is_fifo()


@pytest.mark.parametrize("into", ["a pipe", "a file", "the end of a file"])
def test_standard_output_takes_a_file_between_what_is_printed(tmp_path: Path, into: str) -> None:
    script = (
        "from contbreather.files import write_whole\n"
        "print('before')\n"
        "write_whole('/dev/stdout', lambda file: file.write(b'table\\n'))\n"
        "print('after')\n"
    )
    kept = tmp_path / "kept"
    kept.write_text("old\n" if into == "the end of a file" else "")
    with kept.open("a") as stream:
        given = subprocess.PIPE if into == "a pipe" else stream
        done = subprocess.run([sys.executable, "-c", script], stdout=given, check=True)
    found = done.stdout.decode() if into == "a pipe" else kept.read_text()
    assert found.removeprefix("old\n") == "before\ntable\nafter\n"


@pytest.mark.parametrize(
    ("closing", "said"), [(">&-", "cannot write /dev/stdout: Bad file desc"), ("| true", "Pipe")]
)
def test_standard_output_that_is_closed_is_told(closing: str, said: str) -> None:
    script = (
        "from contbreather.files import write_whole\n"
        "try:\n"
        "    write_whole('/dev/stdout', lambda file: file.write(bytes(10**6)))\n"
        "except Exception as error:\n"
        "    import sys, os; os.write(2, f'{type(error).__name__} {error}'.encode()); os._exit(0)\n"
    )
    line = f'"{sys.executable}" -c "{script}" {closing}'
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=True)
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_link_laid_in_place_of_the_temporary_file_is_not_followed(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "urandom", bytes)
    (tmp_path / "victim").write_text("precious")
    (tmp_path / f".{bytes(8).hex()}.part").symlink_to("victim")
    with pytest.raises(BadInput, match="File exists"):
        write_whole(tmp_path / "mine", saying(b"new"))
    assert (tmp_path / "victim").read_text() == "precious"


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("", "the name of the file to write is empty"),
        (" ", "the name of the file to write is empty"),
        (7, "7 is not the name of a file"),
        (None, "None is not the name of a file"),
        (b"x", "b'x' is not the name of a file"),
        ("folder", "it is a directory"),
        (".", "it is a directory"),
        ("nowhere/x", "there is no directory nowhere"),
        ("lost", "there is no directory"),
        ("file/x", "Not a directory"),
        ("circle", "Too many levels of symbolic links"),
        ("n" * 256, "File name too long"),
        ("n/" * 3000, "File name too long"),
        ("a\0b", "null"),
        ("\ud800", "surrogates"),
    ],
)
def test_place_that_cannot_be_is_refused(name, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("file").touch()
    Path("circle").symlink_to("circle")
    Path("lost").symlink_to("nowhere/x")
    for attempt in (writable, lambda path: write_whole(path, saying(b"x"))):
        with pytest.raises(BadInput, match=sentence):
            attempt(name)
    assert {path.name for path in Path().iterdir()} == {"folder", "file", "circle", "lost"}


def test_a_tilde_is_the_home_of_the_user_in_each_call(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", within={"a": (0.65, 0.75)})
    cb.save("~/x.nc", branch)
    branch.to_csv("~/x.csv")
    (tmp_path / "s.toml").write_text("[zones.z]\nk = 0.8\n")
    assert len(cb.load("~/x.nc")) == len(branch)
    assert cb.studies.dry_run("~/s.toml").folder == tmp_path / "s"
    assert identity("~/x.nc") == identity(tmp_path / "x.nc")
    assert {path.name for path in tmp_path.iterdir()} == {"x.nc", "x.csv", "s.toml"}
    with pytest.raises(BadInput, match="there is no directory ~nobody-here"):
        writable("~nobody-here/x.nc")


def test_another_place_is_advised_to_who_writes_and_not_to_who_reads() -> None:
    with pytest.raises(BadInput, match=r"cannot write .*; choose another place$"):
        writable("a\0b")
    with (
        pytest.raises(BadInput, match=r"cannot read .*null (byte|character)[^;]*$"),
        opened("a\0b"),
    ):
        pass


def test_missing_permission_and_read_only_file_systems_have_their_sentence(tmp_path, monkeypatch):
    """That of the folder counts for files, and not for devices."""
    target, pipe = tmp_path / "x", tmp_path / "pipe"
    target.write_text("old")
    os.mkfifo(pipe)

    def lock(locked: Path) -> None:
        monkeypatch.setattr(os, "access", lambda place, _: place != locked)  # root may do anything

    for locked, place in ((tmp_path, target), (target, target), (pipe, pipe)):
        lock(locked)
        with pytest.raises(BadInput, match=f"{place}: no permission; choose another place"):
            write_whole(place, saying(b"new"))
    assert target.read_text() == "old"
    lock(tmp_path)
    assert writable(pipe) == pipe
    there = os.statvfs(tmp_path)
    flags = [*there[:8], there.f_flag | os.ST_RDONLY, *there[9:]]
    monkeypatch.setattr(os, "statvfs", lambda _: os.statvfs_result(flags))
    with pytest.raises(BadInput, match=r"x: the file system is read-only"):
        writable(target)


def test_folder_that_goes_away_meanwhile_is_a_sentence(tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(BadInput, match=r"cannot write x: No such file"):
        write_whole("x", saying(b"x"))


def test_reading_is_of_ordinary_files(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(b"all")
    with opened(tmp_path / "x") as file:
        assert file.read() == b"all"
    os.mkfifo(tmp_path / "pipe")
    for place, sentence in (
        (tmp_path, "it is a directory"),
        (tmp_path / "pipe", "it is not an ordinary file"),
        (tmp_path / "y", "No such file"),
        (None, "None is not the name"),
        ("n" * 256, "File name too long"),
    ):
        with pytest.raises(BadInput, match=sentence), opened(place):
            pass
