"""Runs and studies that are killed (-9) at any moment: every file loads, and nothing is lost.

    python -m tests.campaigns.killed [what=run] [trials=50] [seed=0]

A `run` follows a branch, then both arms of its pitchfork, into a folder. A `study` is what
`contbreather run` makes of a file with two workers; killed, it is started again in the same folder
until it is finished, and then another one begins. After each kill, of all processes at once, every
file must load, what was marked as finished must be there, and nothing may differ from what is there
without a kill, to the last digit: a branch that was being written is the beginning of that.
"""

from __future__ import annotations

import collections
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

import contbreather as cb
from tests.test_studies import SMALL

RUN = """
import sys
import contbreather as cb
from contbreather.continuation.walk import checkpoint
checkpoint.EVERY, checkpoint.SHARE = 0.02, 0.5
run, steps = cb.Run(sys.argv[1]), cb.Steps(first=1e-4, largest=4e-4, most=5000)
start = cb.symmetric(0.7, 0.04, 0.8)
print("begins", flush=True)
branch = cb.trace(start, "a", within={"a": (0.6, 0.8)}, steps=steps, save=run.file("branch"))
cb.switch(branch.first("PF"), within={"a": (0.6, 0.8)}, steps=steps, save=run.file("arms"))
"""
LONGER = {"[0.02, 0.04]": "[0.02, 0.03, 0.04]", "[0.7, 0.8]": "[0.6, 0.9]", "0.79]": "0.81]"}
STUDY = SMALL
for short, long in LONGER.items():
    STUDY = STUDY.replace(short, long)
STUDY += "\n[zones.diagrams]\nk = [0.7, 0.8]\nwithin = {gamma = [0.0, 0.01]}\n"


def started(command: list[Any]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *map(str, command)], start_new_session=True, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def a_run(folder: Path) -> subprocess.Popen[str]:
    folder.mkdir()
    child = started(["-c", RUN, folder])
    assert child.stdout is not None
    assert child.stdout.readline() == "begins\n"
    return child


def a_study(folder: Path) -> subprocess.Popen[str]:
    study = folder.parent / "study.toml"
    study.write_text(STUDY)
    return started(["-m", "contbreather", "run", study, "--folder", folder, "--workers", 2])


def killed(child: subprocess.Popen[str], moment: float) -> bool:
    """All of its processes at once, and none of anybody else; whether it was over before."""
    with suppress(subprocess.TimeoutExpired):
        child.communicate(timeout=moment)
    over = child.poll() is not None
    with suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()
    return over


def branches(folder: Path) -> dict[str, Any]:
    """The points of every branch, to the bit."""
    return {name: [point.z.tobytes() for point in one] for name, one in cb.Run(folder).items()}


def numbers(folder: Path) -> dict[str, Any]:
    """Every variable of every file, to the bit; fails where one does not load."""
    found: dict[str, Any] = {}
    for path in sorted(folder.glob("*/*.nc")):
        cb.load(path)
        with xarray.open_datatree(path, engine="h5netcdf", decode_cf=False) as tree:
            found[str(path.relative_to(folder))] = {
                f"{group.path}/{name}": np.asarray(values).tobytes()
                for group in tree.subtree
                for name, values in group.variables.items()
            }
    return found


def finished(folder: Path) -> set[str]:
    """The files of a study of which it was said that they are finished."""
    marks = (folder / ".study").glob("*.json")
    return {f"{mark.stem.replace('@', '/')}.nc" for mark in marks if not mark.name.startswith(".")}


class Kind(NamedTuple):
    begin: Callable[[Path], subprocess.Popen[str]]
    content: Callable[[Path], dict[str, Any]]
    again: bool  # in the same folder, until it is over


KINDS = {"run": Kind(a_run, branches, False), "study": Kind(a_study, numbers, True)}


def judged(folder: Path, there: dict[str, Any], wanted: dict[str, Any], over: bool) -> list[str]:
    """What is on disk after a kill: words that begin with "lost" or "changed" must not be."""
    told = [f"lost {name}" for name in finished(folder) - set(there)]
    for name, one in there.items():
        begun = isinstance(one, list) and not set(one) - set(wanted[name])
        told.append("whole" if one == wanted[name] else "begun" if begun else f"changed {name}")
    return told + ["lost at the end"] * (over and there.keys() != wanted.keys())


def main(what: str = "run", trials: str = "50", seed: str = "0") -> int:
    kind, chance = KINDS[what], random.Random(int(seed))
    tally, folders = collections.Counter[str](), 0
    with tempfile.TemporaryDirectory() as place:
        began = time.monotonic()
        kind.begin(Path(place, "whole")).communicate()
        lasts, wanted = time.monotonic() - began, kind.content(Path(place, "whole"))
        print(f"{len(wanted)} files in {lasts:.1f} s without a kill", flush=True)
        while tally["kills"] < int(trials):
            folder, moment = Path(place, f"{folders}"), chance.uniform(0.0, 0.9 * lasts)
            over = killed(kind.begin(folder), moment)
            told = judged(folder, kind.content(folder), wanted, over)
            tally.update(["over" if over else "kills", *told])
            folders += over or not kind.again
            print(f"{tally['kills']} after {moment:.1f} s: {sorted(told)}", flush=True)
        if kind.again:
            kind.begin(Path(place, f"{folders}")).communicate()
            tally.update(judged(folder, kind.content(Path(place, f"{folders}")), wanted, True))
    print(f"{what} {dict(tally)}")
    return sum(many for word, many in tally.items() if word.startswith(("lost", "changed")))


if __name__ == "__main__":
    sys.exit(bool(main(*sys.argv[1:])))
