"""Forcings, lattices and conditions as dicts of numbers and names, and from these again.

What somebody else has written, a forcing of his own for instance, is not among them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions, Pair, Walls
from contbreather.lattice.finite import Lattice
from contbreather.lattice.forcing import Fourier, Harmonic, Samples
from contbreather.lattice.formula import Symbolic
from contbreather.lattice.on_site_spring import SpringResponse, spring_response
from contbreather.parameters import NAMES
from contbreather.storage.serialise import serialised, to_dict

serialised("harmonic", Harmonic, lambda forcing: {})(Harmonic)
serialised("samples", Samples, lambda forcing: {"values": list(forcing.values)})(Samples)
serialised("infinite chain", InfiniteChain, lambda chain: {"spring": chain.spring})(InfiniteChain)
serialised("ring", Ring, lambda ring: {"sites": ring.sites})(Ring)


@serialised("fourier", Fourier, lambda f: {"cos": [*map(list, f.cos)], "sin": [*map(list, f.sin)]})
def _fourier(cos: Sequence[tuple[int, float]], sin: Sequence[tuple[int, float]]) -> Fourier:
    return Fourier(dict(cos), dict(sin))


@serialised("formula", Symbolic, lambda f: {"formula": f.expression, "values": dict(f.values)})
def _formula(formula: str, values: dict[str, float]) -> Symbolic:
    return Symbolic(formula, **values)


@serialised(
    "held", SpringResponse, lambda forcing: {"of": to_dict(forcing.of), "spring": forcing.spring}
)
def _spring_response(of: Any, spring: float) -> SpringResponse:
    return spring_response(of, spring)


def _lattice_to_dict(lattice: Lattice) -> dict[str, Any]:
    """By the entries of its stiffness that are not zero, each once."""
    rows, columns = np.nonzero(np.triu(lattice.stiffness))
    entries = lattice.stiffness[rows, columns]
    weights = {name: getattr(lattice, name) for name in ("masses", "drive")}
    return {
        "name": lattice.name,
        "sites": lattice.sites,
        "rows": rows.tolist(),
        "columns": columns.tolist(),
        "entries": entries.tolist(),
        # ones are what a lattice has unless it is told otherwise
        **{name: values.tolist() for name, values in weights.items() if (values != 1.0).any()},
    }


@serialised("lattice", Lattice, _lattice_to_dict)
def _lattice(
    name: str,
    sites: int,
    rows: list[int],
    columns: list[int],
    entries: list[float],
    masses: list[float] | None = None,
    drive: list[float] | None = None,
) -> Lattice:
    matrix = np.zeros((sites, sites))
    matrix[rows, columns] = matrix[columns, rows] = entries  # symmetric: a file has its upper half
    return Lattice(matrix, masses, drive, name=name)


def _ends(pair: Pair) -> list[float | None]:
    """Low and high, None for a wall that is not there: JSON has no infinity."""
    return [wall if math.isfinite(wall) else None for wall in pair]


def _walls_to_dict(walls: Walls) -> dict[str, Any]:
    return {"of_all": _ends(walls.of_all), "own": [[n, _ends(pair)] for n, pair in walls.own]}


@serialised("walls", Walls, _walls_to_dict)
def _walls(of_all: Sequence[float | None], own: Sequence[Any]) -> Walls:
    return Walls(Walls.given(tuple(of_all)).of_all, Walls.given(dict(own)).own)


def _conditions_to_dict(on: Conditions) -> dict[str, Any]:
    numbers = {name: float(getattr(on, name)) for name in NAMES}
    parts = ("forcing", "walls", "lattice")
    return {**numbers, **{name: to_dict(getattr(on, name)) for name in parts}}


serialised("conditions", Conditions, _conditions_to_dict)(Conditions)
