"""What a simulation starts from and what it leaves: whole numbers, and states in files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.files import read_text, write_whole

WANTED = "JSON with u, v and t, or two columns u and v were expected"


def read_state(path: str) -> tuple[tuple[Any, Any], float]:
    """Displacements, velocities, and their time; 0 where the file does not say."""
    import numpy as np

    try:
        text = read_text(path)
    except BadInput as error:
        raise BadInput(f"{error}; {WANTED}") from error
    try:
        if text.lstrip().startswith("{"):
            content = json.loads(text)
            content = content.get("final", content)  # what --json prints will do, too
            u, v = (np.array(content[name], dtype=float) for name in "uv")
            return (u, v), float(content.get("t", 0.0))
        rows = [line.replace(",", " ").split() for line in text.splitlines() if line.strip()]
        if rows and rows[0] == ["u", "v"]:
            rows = rows[1:]
        u, v = np.array(rows, dtype=float).T
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise BadInput(f"no state in {path}: {WANTED}") from error
    return (u, v), 0.0


def write_state(path: str, state: cb.simulation.State, t: float) -> Path:
    """JSON with u, v and t, all digits."""
    content = {"t": float(t), "u": state.u.tolist(), "v": state.v.tolist()}
    text = json.dumps(content, allow_nan=False) + "\n"
    return write_whole(path, lambda file: file.write(text.encode()))
