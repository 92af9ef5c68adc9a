"""Files whose checksum is right and whose contents make no sense: refused in a sentence when they
are loaded, so that nothing that is asked of a result later meets them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import contbreather as cb

ABOUT = "about_in_json"
SENSELESS: tuple[Any, ...] = (None, -1, 99, 2.5, "x", "", True, [], [[]], ["x"], [-1], {}, {"x": 1})
COLUMNS: tuple[Any, ...] = (
    np.zeros(2), np.zeros((2, 3)), np.float64(1.0), np.zeros(0), np.full(3, b"x", "S1"),
)  # fmt: skip
START: dict[str, Any] = {"a": 0.77, "gamma": 0.04, "k": 0.8}


def branch() -> cb.Branch:
    return cb.trace(cb.symmetric(**START), "a", within={"a": (0.76, 0.78)})


def own() -> cb.Branch:
    mine = cb.Problem(lambda x, p: p["mu"] - x * x, {"x": 1.0}, {"mu": 1.0})
    return cb.trace(mine, "mu", within={"mu": (-1, 2), "x": (-1, 2)})


def run() -> Any:
    return cb.simulate(cb.symmetric(**START).state(4), **START, periods=2)


def smooth() -> Any:
    state = cb.symmetric(**START).state(4)
    return cb.simulation.simulate_smooth(state, **START, m=8, periods=2)


MADE: dict[str, Callable[[], Any]] = {
    "branch": branch,
    "a problem of one's own": own,
    "line": lambda: cb.boundary(
        branch().first("PF"), ("gamma", "a"), within={"gamma": (0.039, 0.041)}
    ),
    "diagram": lambda: cb.diagram(cb.symmetric(**START), "a", within={"a": (0.77, 0.78)}),
    "zones": lambda: cb.zones(k=0.8, within={"gamma": (0.0, 0.01)}),
    "run": run,
    "smooth run": smooth,
}


def shown(result: Any) -> None:
    """Ask for what a prompt, a table and a figure ask for."""
    repr(result)
    str(result.table())
    result.columns()
    if hasattr(result, "describe"):
        result.describe()
    for point in getattr(result, "special", ()):
        repr(point)
    for one in (result, *getattr(result, "branches", ())):
        if isinstance(one, cb.Branch):
            assert all(len(one[name]) == len(one) for name in one.names)
            assert [point.detail for point in one]


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if at:
        yield at
    inside: Any = value.items() if isinstance(value, dict) else ()
    inside = enumerate(value[:2]) if isinstance(value, list) else inside
    for key, inner in inside:
        yield from places(inner, (*at, key))


def changed(about: Any, at: tuple[Any, ...], new: Any) -> bytes:
    copy = json.loads(json.dumps(about))
    *outer, last = at
    inner = copy
    for key in outer:
        inner = inner[key]
    inner[last] = new
    return json.dumps(copy).encode()


def variants(image: bytes, rng: np.random.Generator) -> Iterator[tuple[str, bytes]]:
    """Files with one entry or one column of one of their groups replaced; of many some."""
    with h5py.File(BytesIO(image)) as file:
        groups = list[str]()
        file.visititems(
            lambda name, one: groups.append(name) if isinstance(one, h5py.Group) else None
        )
        entries: list[tuple[str, str, Any]] = []
        for group in groups:
            about = json.loads(file[group][ABOUT][()].tobytes())
            entries += [
                (group, f"{ABOUT} {at} = {new!r}", np.bytes_(changed(about, at, new)))
                for at in places(about)
                for new in SENSELESS
            ]
            names = [name for name, one in file[group].items() if isinstance(one, h5py.Dataset)]
            columns = [name for name in names if not h5py.h5ds.is_scale(file[group][name].id)]
            entries += [(group, name, new) for name in columns if name != ABOUT for new in COLUMNS]
    for i in rng.permutation(len(entries))[:25]:
        group, what, new = entries[i]
        memory = BytesIO(image)
        with h5py.File(memory, "r+") as file:
            name = what.partition(" ")[0]
            del file[group][name]
            file[group][name] = new
        yield f"{group}: {what}", memory.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("name", MADE)
def test_what_makes_no_sense_is_refused_at_the_door(name: str, tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    cb.save(path, MADE[name]())
    image = path.read_bytes().partition(b"\nsha256 of all bytes before")[0]
    for what, other in variants(image, np.random.default_rng(38)):
        checksum = hashlib.sha256(other).hexdigest().encode()
        path.write_bytes(other + b"\nsha256 of all bytes before: %s\n" % checksum)
        print(what)  # in the report of a failure
        with suppress(cb.errors.ContbreatherError):  # in a sentence
            shown(cb.load(path))
