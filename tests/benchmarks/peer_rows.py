"""The same branch and fold curve by contbreather and by the peers that are installed here."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from .measure import ROOT, Absent, Row, micro, process, span
from .peers import auto07p, closure

SCRIPTS = Path(__file__).parent / "peers"


def script(executable: str, name: str, *arguments: str) -> dict[str, Any]:
    """A session in a process of its own; its last line that starts with RESULT is the outcome."""
    path = {"PYTHONPATH": str(ROOT)} if executable == sys.executable else {"PYTHONPATH": ""}
    command = [executable, SCRIPTS / name, *arguments]
    seconds, out = process(command, env=path)
    result = [line for line in out.splitlines() if line.startswith("RESULT ")][-1]
    return {**json.loads(result.removeprefix("RESULT ")), "session_seconds": seconds}


def curve_error(curve: list[tuple[float, float]]) -> float:
    """Largest relative error in a of the points of a fold curve, against (14) in closed form."""
    inside = [(a, gamma) for a, gamma in curve if 0 <= gamma < closure.GAMMA_END * (1 + 1e-6)]
    return max(abs(a / closure.fold(gamma) - 1) for a, gamma in inside)


def per_point(found: dict[str, Any]) -> tuple[float, float, float]:
    """Seconds a branch point, seconds a fold-curve point, seconds of the session."""
    branch = found["branch_seconds"] / found["branch_points"]
    return branch, found["curve_seconds"] / len(found["curve"]), found["session_seconds"]


def figures(found: dict[str, Any]) -> str:
    branch, curve, session = per_point(found)
    return f"{micro(branch)} a point, fold curve {micro(curve)}, session {span(session)}"


def note(found: dict[str, Any]) -> str:
    fold = abs(found["fold"] / closure.fold(closure.GAMMA) - 1)
    return (
        f"{found['branch_points']} + {len(found['curve'])} points; "
        f"relative error of the fold {fold:.0e}, of its curve {curve_error(found['curve']):.0e}"
    )


def sessions(peers_python: str) -> dict[str, Callable[[], dict[str, Any]]]:
    return {
        "contbreather": lambda: script(sys.executable, "own_session.py"),
        "AUTO-07p": auto07p.session,
        "bifpy": lambda: script(peers_python, "bifpy_session.py"),
        "bifpy, transpiled": lambda: script(peers_python, "bifpy_session.py", "--native"),
        "JaxCont": lambda: script(peers_python, "jaxcont_session.py"),
    }


def rows(peers_python: str) -> list[Row]:
    table = []
    own = None
    with suppress(Absent):
        script(sys.executable, "own_session.py")  # what numba compiles is on disk from here on
    for name, session in sessions(peers_python).items():
        try:
            found = session()
        except Absent as reason:
            table.append(
                Row(f"closure branch and fold curve: {name}", "absent", "-", note=str(reason))
            )
            continue
        own = own or found
        ratio = per_point(found)[0] / per_point(own)[0]
        what = f"closure branch and fold curve: {found['name']}"
        beside = f"time a branch point of {own['name']}"
        table.append(Row(what, figures(found), beside, ratio, note=note(found)))
        if found["name"].startswith("AUTO"):
            table += promised(own, found)
    return table


def promised(own: dict[str, Any], auto: dict[str, Any]) -> list[Row]:
    """A point of a branch and of a fold curve, beside AUTO-07p."""
    what = ("a point of the closure branch, events off", "a point of its fold curve")
    mine, theirs = per_point(own), per_point(auto)
    return [
        Row(
            what[i], micro(mine[i]), f"{auto['name']}: {micro(theirs[i])}",
            mine[i] / theirs[i], f"≤ {most}", mine[i] <= most * theirs[i],
        )
        for i, most in enumerate((1.5, 3.0))
    ]  # fmt: skip


def default_python() -> str:
    return os.environ.get("CONTBREATHER_PEERS_PYTHON", sys.executable)
