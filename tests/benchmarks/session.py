"""Whole processes: the zone diagram, the first run after installation, the cost of the import."""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from .measure import ROOT, Row, process, python, span, within

TIMED = """
import time
start = time.perf_counter()
{statement}
print(time.perf_counter() - start)
"""
ZONES = """
import numpy, scipy.linalg, scipy.optimize, contbreather as cb, time
from contbreather import kernels
from contbreather.orbits import zones
cb.zones, cb.symmetric, cb.trace
assert all(one.code for one in kernels.KERNELS)
cb.zones(k=0.5)
start = time.process_time()
cb.zones(k=0.8)
print(time.process_time() - start)
"""
FIRST = """
import time, contbreather as cb
cb.symmetric(a=0.5, gamma=0.08, k=0.8)
print(time.process_time())
"""
REFERENCE = "import numpy, scipy.linalg, scipy.optimize"
OURS = {
    "import contbreather": "import contbreather",
    "import contbreather and touch symmetric, trace": (
        "import contbreather; contbreather.symmetric; contbreather.trace"
    ),
}


def import_seconds(statements: list[str], runs: int = 20) -> list[float]:
    """Shortest time of each import inside a fresh interpreter (its own start not counted).

    Taken in turns, so that a busy minute of the machine is everybody's.
    """
    codes = [TIMED.format(statement=statement) for statement in statements]
    times = [[float(python(code)[1]) for code in codes] for _ in range(runs)]
    return [min(column) for column in zip(*times, strict=True)]


def import_rows() -> list[Row]:
    reference, *ours = import_seconds([REFERENCE, *OURS.values()])
    beside = f"`{REFERENCE}`: {span(reference)}"
    table = []
    for what, seconds in zip(OURS, ours, strict=True):
        ratio = seconds / reference
        table.append(Row(what, span(seconds), beside, ratio, "≤ 1.3", ratio <= 1.3))
    return [*table, first_breather_row()]


def zones_rows() -> list[Row]:
    """The diagram for k = 0.8 after one for another k, which has all imported and loaded."""
    python(ZONES)  # compiles what is not kept
    seconds = min(float(python(ZONES)[1]) for _ in range(5))
    return [within("zones for k = 0.8, all imported and machine code loaded", seconds, 0.15)]


def first_breather_row() -> Row:
    seconds = min(float(python(FIRST)[1]) for _ in range(20))
    return within("import and first breather, interpreter included", seconds, 0.13)


def installed(folder: Path) -> Path:
    """A copy of the source, installed as the README does it, in an environment of its own."""
    ignore = shutil.ignore_patterns(".venv", ".git", "__pycache__", ".*_cache")
    source = Path(shutil.copytree(ROOT, folder / "source", ignore=ignore))
    process([sys.executable, "-m", "venv", folder / "venv"])
    pip = folder / "venv" / "bin" / "pip"
    process([pip, "install", "--quiet", "--disable-pip-version-check", source], cwd=folder)
    return folder / "venv"


def zones_process(environment: Path, folder: Path) -> float:
    """`contbreather zones` as a whole process with this folder's own caches."""
    home = folder / "home"
    home.mkdir(exist_ok=True)
    caches = {"HOME": home, "XDG_CACHE_HOME": home / "cache", "MPLCONFIGDIR": home / "mpl"}
    env = {"PYTHONPATH": "", **{name: str(path) for name, path in caches.items()}}
    return process([environment / "bin" / "contbreather", "zones"], cwd=folder, env=env)[0]


def first_and_second(environment: Path, folder: Path, *, compiled: bool) -> tuple[float, float]:
    """Shortest of three first and of three second runs, in turns; caches are emptied before each
    first one, on request the compiled files of every package, too."""
    times = []
    for _ in range(3):
        shutil.rmtree(folder / "home", ignore_errors=True)
        for cache in [] if compiled else list(environment.rglob("__pycache__")):
            shutil.rmtree(cache)
        times.append((zones_process(environment, folder), zones_process(environment, folder)))
    first, second = zip(*times, strict=True)
    return min(first), min(second)


def first_run_rows() -> list[Row]:
    table = []
    with tempfile.TemporaryDirectory() as name:
        environment = installed(Path(name))
        for compiled, how, aim in (
            (True, "as pip leaves it", 1.5),
            (False, "no compiled file of any package either", 2.0),
        ):
            first, second = first_and_second(environment, Path(name), compiled=compiled)
            ratio = first / second
            what = f"first `contbreather zones` after installation, {how}"
            beside = f"the second, whole process: {span(second)}"
            table.append(Row(what, span(first), beside, ratio, f"≤ {aim}", ratio <= aim))
    return table
