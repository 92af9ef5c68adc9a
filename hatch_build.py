"""Compiles the hot loops when the package is built, for the processor that builds it.

A wheel with machine code is tagged for this Python and this kind of machine; on a processor that
can do less it goes on without. CONTBREATHER_COMPILE=0 makes a wheel without any, for all. Where
compiling fails the package is built without, which `contbreather --version --verbose` tells.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDER = "contbreather/_objects"


class CompileHook(BuildHookInterface):  # type: ignore[type-arg]
    """Objects beside their source: in the tree, as Python started in it imports that, and, unless
    the tree itself is what is installed, in the wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if self.target_name != "wheel":
            return
        beside = Path(self.root, FOLDER)
        shutil.rmtree(beside, ignore_errors=True)  # what is there is of older texts
        try:
            compile_into(Path(self.root), beside)
        except OSError as error:
            self.app.display_warning(f"contbreather is installed without compiled loops: {error}")
            return
        if version != "editable":
            build_data["artifacts"].append(FOLDER)
            if any(beside.glob("*.o")):
                build_data["pure_python"], build_data["infer_tag"] = False, True
        for reason in beside.glob("reason.txt"):
            self.app.display_warning(f"contbreather is installed without {reason.read_text()}")


def compile_into(root: Path, folder: Path) -> None:
    """Fill a folder with object files, and with the reason in words if some could not be made."""
    if os.environ.get("CONTBREATHER_COMPILE") == "0":
        reason = "compiled loops, by CONTBREATHER_COMPILE=0"
    else:
        line = [sys.executable, "-m", "contbreather.compiler"]
        done = subprocess.run(line, cwd=root, capture_output=True, text=True, check=False)
        said = (done.stdout + done.stderr).strip().splitlines()
        reason = f"some compiled loops: {said[-1]}" if said else ""
    folder.mkdir(mode=0o755, exist_ok=True)
    if reason:
        (folder / "reason.txt").write_text(f"{reason}\n", encoding="utf-8")
