"""Studies that are killed at any moment, and go on: `python -m tests.campaigns.studies [TRIALS]`.

A study is started, all of its processes are killed (-9) at a random moment, and it is started again
in the same folder until it is finished; then another one begins. After each kill every file must
load, what was marked as finished must be there, and nothing may differ from what a study without a
kill has, to the last digit.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from tests.test_studies import SMALL

LONGER = {"[0.02, 0.04]": "[0.02, 0.03, 0.04]", "[0.7, 0.8]": "[0.6, 0.9]", "0.79]": "0.81]"}
STUDY = SMALL
for short, long in LONGER.items():
    STUDY = STUDY.replace(short, long)
STUDY += "\n[zones.diagrams]\nk = [0.7, 0.8]\nwithin = {gamma = [0.0, 0.01]}\n"
Numbers = dict[str, dict[str, bytes]]


def started(folder: Path) -> subprocess.Popen[bytes]:
    study = folder.parent / "study.toml"
    command = [sys.executable, "-m", "contbreather", "run", study, "--folder", folder, "--workers"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([*map(str, command), "2"], start_new_session=True, **quiet)  # type: ignore[call-overload,no-any-return]


def killed(child: subprocess.Popen[bytes]) -> None:
    """All of its processes at once, and none of anybody else."""
    with suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()


def numbers(folder: Path) -> Numbers:
    """Every variable of every file, to the bit; fails where one does not load."""
    import contbreather as cb

    found: Numbers = {}
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
    """The files of which it was said that they are finished."""
    marks = (folder / ".study").glob("*.json")
    return {f"{mark.stem.replace('@', '/')}.nc" for mark in marks if not mark.name.startswith(".")}


def trial(folder: Path, wanted: Numbers, moment: float) -> dict[str, Any]:
    """Start or go on, kill, look."""
    child = started(folder)
    with suppress(subprocess.TimeoutExpired):
        child.wait(moment)
    over = child.poll() is not None
    killed(child)
    there, said = numbers(folder), finished(folder)
    return {
        "over": over,
        "files": len(there),
        "finished": len(said),
        "lost": sorted(said - set(there)),
        "changed": sorted(name for name in there if there[name] != wanted[name]),
        "complete": over and set(there) == set(wanted),
    }


def main(trials: int = 50, seed: int = 0) -> int:
    chance, bad, kills, studies = random.Random(seed), 0, 0, 0
    with tempfile.TemporaryDirectory() as place:
        (Path(place) / "study.toml").write_text(STUDY)
        begun = time.monotonic()
        started(Path(place) / "whole").wait()
        lasts, wanted = time.monotonic() - begun, numbers(Path(place) / "whole")
        print(f"{len(wanted)} files in {lasts:.1f} s without a kill", flush=True)
        while kills < trials:
            moment = chance.uniform(0.0, 0.6 * lasts)
            seen = trial(Path(place) / f"study{studies}", wanted, moment)
            bad += bool(seen["lost"] or seen["changed"] or (seen["over"] and not seen["complete"]))
            kills += not seen["over"]
            studies += seen["over"]
            print(f"{kills} after {moment:.1f} s: {seen}", flush=True)
        started(Path(place) / f"study{studies}").wait()
        bad += numbers(Path(place) / f"study{studies}") != wanted
    print(f"{kills} kills of {1 + studies} studies; {bad} times something was lost or changed")
    return bad


if __name__ == "__main__":
    sys.exit(bool(main(*map(int, sys.argv[1:]))))
