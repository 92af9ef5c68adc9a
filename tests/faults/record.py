"""Coverage map of a checkout: which test executes which line.

    python tests/faults/record.py CHECKOUT [tests]

With tests (files), the map is renewed for these alone, the rest stays.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
# Outside the checkout, whose tests would otherwise be collected with their copies.
HOME = Path(os.environ.get("PLANT_HOME", Path(tempfile.gettempdir()) / "contbreather-faults"))
MAP = HOME / "map"
TREE = MAP / "tree"
PYTHON = ["nice", sys.executable, "-m"]
PYTEST = ["pytest", "-q", "-p", "no:cacheprovider"]


def copy(source: Path, target: Path) -> None:
    """All files of a checkout that git knows or would know; times kept, for caches to hold."""
    line = ["git", "ls-files", "-co", "--exclude-standard"]
    known = subprocess.run(line, cwd=source, check=True, capture_output=True, text=True).stdout
    wanted = {name for name in known.split("\n") if name and (source / name).is_file()}
    for path in target.rglob("*"):
        kept = "__pycache__" in path.parts or str(path.relative_to(target)) in wanted
        if path.is_file() and not kept:
            path.unlink()
    for name in wanted:
        there = target / name
        there.parent.mkdir(parents=True, exist_ok=True)
        if not there.exists() or there.read_bytes() != (source / name).read_bytes():
            shutil.copy2(source / name, there)


def environment(tree: Path, **more: str) -> dict[str, str]:
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    # loops of a fault are compiled for nobody else
    own = {"PYTHONPATH": f"{tree}:{HERE}", "XDG_CACHE_HOME": f"{tree}.cache"}
    return {**os.environ, **threads, **own, **more}


def main(checkout: str, only: list[str]) -> None:
    MAP.mkdir(parents=True, exist_ok=True)
    copy(Path(checkout), TREE)
    known, tests, fresh = {}, MAP / "tests.json", MAP / "fresh.json"
    if only and tests.exists():
        kept = json.loads(tests.read_text())
        renewed = tuple(str(Path(one)) for one in only)
        known = {name: one for name, one in kept.items() if not one["file"].startswith(renewed)}
    data, part = MAP / "coverage.db", MAP / "part.db"
    part.unlink(missing_ok=True)
    line = [*PYTHON, "coverage", "run", f"--data-file={part}", "--source=contbreather", "-m"]
    line += [*PYTEST, "-p", "cover_plugin", "--here", *only]  # coverage sees no other process
    subprocess.run(line, cwd=TREE, env=environment(TREE, PLANT_TESTS=str(fresh)), check=False)
    if only:
        line = [*PYTHON, "coverage", "combine", "-a", f"--data-file={data}", str(part)]
        subprocess.run(line, cwd=TREE, check=True)
    else:
        part.replace(data)
    known.update(json.loads(fresh.read_text()))
    tests.write_text(json.dumps(known))
    bad = [name for name, entry in known.items() if not entry["ok"]]
    said = f"{len(known)} tests in the map, {len(bad)} of them not passed (never used):"
    print(said, *bad, sep="\n  ")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
