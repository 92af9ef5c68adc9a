"""Forcings, lattices and conditions as numbers and names, for files; and made again from these.

What somebody else has written, a forcing of his own for instance, cannot be said so: `NotPlain`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from contbreather.continuation.recipes import NotPlain
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions, Pair, Walls
from contbreather.lattice.finite import Lattice
from contbreather.lattice.forcing import Fourier, Harmonic, Samples
from contbreather.lattice.formula import Symbolic
from contbreather.lattice.held import Held, held
from contbreather.lattice.modes import InfiniteChain, Ring
from contbreather.parameters import NAMES

__all__ = ["NotPlain", "made", "plain"]

Plain = Mapping[str, Any]


def plain(value: Any) -> Any:
    """A value by numbers and names: the kind it is of, and what it is made of.

    Examples
    --------
    >>> plain(Ring(20))
    {'kind': 'ring', 'sites': 20}
    >>> made(plain(Fourier(cos={1: -1.0, 3: 0.1})))
    Fourier(cos={1: -1.0, 3: 0.1}, sin={})
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if hasattr(value, "plain"):
        return value.plain()
    said = _SAID.get(type(value))
    if said is None:
        raise NotPlain(value)
    kind, content = said[0], said[1](value)
    return {"kind": kind, **content}


def made(given: Any) -> Any:
    """What `plain` has said."""
    if not isinstance(given, Mapping):
        return given
    kind = given["kind"]
    if kind not in _MADE:
        raise BadInput(f"{kind!r} is not a forcing, a lattice or the like")
    return _MADE[kind]({name: value for name, value in given.items() if name != "kind"})


def _of_lattice(lattice: Lattice) -> dict[str, Any]:
    """By the entries of its stiffness that are not zero, each once."""
    rows, columns = np.nonzero(np.triu(lattice.stiffness))
    found: dict[str, Any] = {
        "name": lattice.name,
        "sites": lattice.sites,
        "rows": rows.tolist(),
        "columns": columns.tolist(),
        "entries": lattice.stiffness[rows, columns].tolist(),
    }
    for name in ("masses", "drive"):
        values = getattr(lattice, name)
        if (values != 1.0).any():
            found[name] = values.tolist()
    return found


def _lattice(of: Plain) -> Lattice:
    matrix = np.zeros((of["sites"], of["sites"]))
    matrix[of["rows"], of["columns"]] = matrix[of["columns"], of["rows"]] = of["entries"]
    return Lattice(matrix, of.get("masses"), of.get("drive"), name=of["name"])


def _pair(pair: Pair) -> list[float | None]:
    return [one if math.isfinite(one) else None for one in pair]


def _of_walls(walls: Walls) -> dict[str, Any]:
    own = [[site, _pair(pair)] for site, pair in walls.own]
    return {"of_all": _pair(walls.of_all), "own": own}


def _walls(of: Plain) -> Walls:
    all_alike = Walls.given(tuple(of["of_all"]))
    own = Walls.given({site: tuple(pair) for site, pair in of["own"]})
    return Walls(all_alike.of_all, own.own)


def _of_conditions(on: Conditions) -> dict[str, Any]:
    numbers = {name: float(getattr(on, name)) for name in NAMES}
    return {**numbers, **{name: plain(getattr(on, name)) for name in _BESIDE}}


_BESIDE = ("forcing", "walls", "lattice")


def _conditions(of: Plain) -> Conditions:
    values = {name: made(of[name]) for name in (*NAMES, *_BESIDE)}
    return Conditions(**values)


Say = Callable[[Any], dict[str, Any]]
_SAID: dict[type, tuple[str, Say]] = {
    Harmonic: ("harmonic", lambda f: {}),
    Fourier: ("fourier", lambda f: {"cos": [*map(list, f.cos)], "sin": [*map(list, f.sin)]}),
    Symbolic: ("formula", lambda f: {"formula": f.expression, "values": dict(f.values)}),
    Samples: ("samples", lambda f: {"values": list(f.values)}),
    Held: ("held", lambda f: {"of": plain(f.of), "spring": f.spring}),
    InfiniteChain: ("infinite chain", lambda chain: {"spring": chain.spring}),
    Ring: ("ring", lambda ring: {"sites": ring.sites}),
    Lattice: ("lattice", _of_lattice),
    Walls: ("walls", _of_walls),
    Conditions: ("conditions", _of_conditions),
}
_MADE: dict[str, Callable[[Any], Any]] = {
    "harmonic": lambda of: Harmonic(),
    "fourier": lambda of: Fourier(dict(of["cos"]), dict(of["sin"])),
    "formula": lambda of: Symbolic(of["formula"], **of["values"]),
    "samples": lambda of: Samples(of["values"]),
    "held": lambda of: held(made(of["of"]), of["spring"]),
    "infinite chain": lambda of: InfiniteChain(of["spring"]),
    "ring": lambda of: Ring(of["sites"]),
    "lattice": _lattice,
    "walls": _walls,
    "conditions": _conditions,
}
