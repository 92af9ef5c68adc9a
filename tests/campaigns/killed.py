"""Runs that are killed (-9) at random moments: what is on disk loads, and nothing there is lost.

    python -m tests.campaigns.killed [how many]

Each trial starts a process that follows a branch, then both arms of its pitchfork, into a folder,
and kills it. Whatever files are there must load, those that were finished as they are without a
kill, the one that was being written as the beginning of what it would have become.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import contbreather as cb

STUDY = """
import sys, time
import contbreather as cb
from contbreather.continuation import checkpoint
checkpoint.EVERY, checkpoint.SHARE = 0.02, 0.5
run, steps = cb.Run(sys.argv[1]), cb.Steps(first=1e-4, largest=4e-4, most=5000)
start = cb.symmetric(0.7, 0.04, 0.8)
print("begins", flush=True)
branch = cb.trace(start, "a", within={"a": (0.6, 0.8)}, steps=steps, save=run.file("branch"))
cb.switch(branch.first("PF"), within={"a": (0.6, 0.8)}, steps=steps, save=run.file("arms"))
print("ends", flush=True)
"""


def started(folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", STUDY, str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "begins\n"
    return process


def same(kept: cb.Branch, whole: cb.Branch) -> str:
    """How a branch on disk stands to the one without a kill; empty if it does not."""
    known = {point.z.tobytes() for point in whole}
    if len(kept) == len(whole) and repr(kept) == repr(whole):
        return "whole"
    return "begun" if all(point.z.tobytes() in known for point in kept) else ""


def main(count: int) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        for name in ("whole", *(f"trial{i}" for i in range(count))):
            (root / name).mkdir()
        process = started(root / "whole")
        began = time.monotonic()
        assert process.wait() == 0
        length = time.monotonic() - began
        wanted = dict(cb.load(root / "whole"))
        print(f"uninterrupted: {length:.2f} s, {[(n, len(b)) for n, b in wanted.items()]}")
        rng, found = random.Random(9), dict[str, int]()
        for i in range(count):
            folder = root / f"trial{i}"
            process = started(folder)
            time.sleep(rng.uniform(0, 0.95 * length))
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
            run = cb.Run(folder)
            for name, branch in run.items():
                how = same(branch, wanted[name])
                assert how, f"trial {i}: {name} of {len(branch)} points is not what it should be"
                assert np.isfinite(branch["p"]).all()
                found[f"{name} {how}"] = found.get(f"{name} {how}", 0) + 1
            if not run:
                found["nothing yet"] = found.get("nothing yet", 0) + 1
        print(f"{count} kills, every file loads: {found}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
