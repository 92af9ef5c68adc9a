"""What a run starts from: a state, and the conditions of a finite lattice it moves under."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Required, TypedDict, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import number, shown, state_rows
from contbreather.errors import BadInput
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.lattice.finite import Finite, finite
from contbreather.lattice.forcing import Forcing
from contbreather.lattice.formula import forcing_of
from contbreather.parameters import HEAVIEST, NAMES, NEEDED, OPTIONAL, SMOOTH, parameter

Array = NDArray[Any]
PERIOD = 2.0 * math.pi
OUTSIDE = 1e-9  # beyond a wall by more than this is no rounding
FASTEST = 1e6

# A lattice may be at rest, or ring freely: without forcing, too.
RANGES: dict[str, dict[str, Any]] = {"a": {"above": False}}


C = TypeVar("C", bound=Any)  # rigid or smooth


class State(NamedTuple):
    """Displacements and velocities of all sites, site 0 first; arrays of shape (N,)."""

    u: Array
    v: Array

    def __repr__(self) -> str:
        size = " x ".join(map(str, np.shape(self.u)))
        return f"<State of {size} displacements and velocities, |u| <= {np.abs(self.u).max():.6g}>"


class LatticeParameters(TypedDict, total=False):
    """Keywords that say what a lattice moves under, whatever its walls."""

    a: Required[float]
    gamma: Required[float]
    damping: float
    spring: float
    forcing: Forcing | str | None
    lattice: Finite | None


class ModelParameters(LatticeParameters, total=False):
    """Those of `simulate`, which every function takes."""

    k: Required[float]
    walls: Any


def conditions_of(
    sites: int,
    *,
    forcing: Forcing | str | None = None,
    lattice: Finite | None = None,
    walls: Any = None,
    **numbers: float,
) -> Conditions:
    """The conditions of a state of so many sites, on a ring unless a lattice is given.

    Raises
    ------
    BadInput
        A number that is missing, unknown or out of its range, another number of sites, walls of a
        site that is not there.
    """
    without_noise(numbers)
    missing = [name for name in NEEDED if name not in numbers]
    unknown = [name for name in numbers if name not in NAMES]
    if missing or unknown:
        what = f"missing {', '.join(missing)}" if missing else f"not known {', '.join(unknown)}"
        raise BadInput(
            f"simulate and all that simulates takes {', '.join(NEEDED)}, and, where wanted, "
            f"{', '.join(OPTIONAL)}, forcing, lattice and walls; {what}."
        )
    where = lattice_for(sites, lattice)
    around, drive = Walls.given(walls), forcing_of(forcing)
    conditions = Conditions(forcing=drive, walls=around, lattice=where, **numbers)
    return ranged(conditions).at({})


def without_noise(keywords: Mapping[str, Any]) -> None:
    """Refuse noise; only `simulate`, which takes it out before, has it."""
    if "noise" in keywords:
        raise BadInput(
            f"noise = {shown(keywords['noise'])}: noise is for simulate() alone, on rigid walls; "
            "leave it out here, or judge() the run that simulate(..., noise=...) returns"
        )


def ranged(on: C) -> C:
    """The same conditions, with numbers that a simulation can have."""
    free = {"high": HEAVIEST**2, "below": False, "why": ""}
    coupling = {} if isinstance(on.lattice, Ring) else free
    for name in (*NAMES, *SMOOTH):
        if hasattr(on, name):
            parameter(name, getattr(on, name), **{"gamma": coupling, **RANGES}.get(name, {}))
    return on


def lattice_for(sites: int, lattice: Finite | None) -> Finite:
    """The lattice of a state: a ring unless one is given."""
    where = Ring(sites) if lattice is None else finite(lattice)
    if where.sites != sites:
        raise BadInput(
            f"the state has {sites} sites, the lattice ({where.describe()}) has {where.sites}: "
            "both must have the same; leave out lattice for a ring of the state's length."
        )
    return where


def check_state(state: Any) -> State:
    """A copy of a state as two float arrays, or what is wrong with it.

    Raises
    ------
    BadInput
        Not a pair of rows of equal length, or not finite.
    """
    u, v = state_rows(state)
    fast = int(np.abs(v).argmax())
    if abs(v[fast]) > FASTEST:
        raise BadInput(
            f"v[{fast}] = {v[fast]:.3g}: velocities above {FASTEST:g} blow up the energy; the "
            "walls are at distance 1 and the forcing has period 2 pi, so those of interest are "
            "of order 1."
        )
    return State(u, v)


def within(state: State, walls: Walls) -> State:
    """The same state, with what is beyond a wall by rounding put onto it; more is refused."""
    low, high = wall_rows(walls, state.u.size)
    beyond = np.maximum(state.u - high, low - state.u)
    n = int(beyond.argmax())
    if beyond[n] > OUTSIDE * max(1.0, abs(state.u[n])):
        places = " and ".join(f"{x:g}" for x in (low[n], high[n]) if math.isfinite(x))
        raise BadInput(
            f"u[{n}] = {state.u[n]:.12g} lies outside the walls at {places}; start with all sites "
            "between them."
        )
    return State(np.clip(state.u, low, high), state.v)


def wall_rows(walls: Walls, sites: int) -> tuple[Array, Array]:
    """The walls of each site: low ones and high ones, infinite where there is none."""
    low, high = (np.full(sites, float(x)) for x in walls.of_all)
    for site, pair in walls.own:
        low[site], high[site] = pair
    return low, high


def reduced(t0: ArrayLike) -> float:
    """A time within one period of the forcing, [0, 2 pi)."""
    t = number("t0", t0, -1e300, 1e300, "a time")
    return t % PERIOD
