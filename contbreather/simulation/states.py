"""Starts of runs: a state, and the conditions of a finite lattice it moves under."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Protocol, TypedDict, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import brief, number, state_rows
from contbreather.continuation.curve.point import Point
from contbreather.errors import BadInput
from contbreather.lattice.chain import Ring
from contbreather.lattice.conditions import Conditions, Restitution, Walls, check_drive
from contbreather.lattice.finite import PER_SITE, Finite, finite
from contbreather.lattice.forcing import Drive, Forcing, Harmonic
from contbreather.lattice.formula import forcing_of
from contbreather.parameters import HEAVIEST, NAMES, NEEDED, OPTIONAL, SMOOTH, parameter
from contbreather.storage.serialise import to_dict

Array = NDArray[Any]
PERIOD = 2.0 * math.pi
LONGEST = 1e12  # periods; beyond, not even their number is exact enough to keep time
OWN = ("a", "gamma", "lam", "m", "damping", "spring")  # in the order of the compiled variations

C = TypeVar("C", bound=Any)  # rigid or smooth


class State(NamedTuple):
    """Displacements and velocities of all sites, site 0 first; arrays of shape (N,)."""

    u: Array
    v: Array

    def __repr__(self) -> str:
        size = " x ".join(map(str, np.shape(self.u)))
        return f"<State of {size} displacements and velocities, |u| <= {np.abs(self.u).max():.6g}>"


def damping_of(k: float) -> float:
    """lambda of the smooth wall with restitution k, eq. (22) solved for it."""
    k = parameter("k", k)
    if k == 0.0:
        return 2.0  # the limit of (22) for k -> 0, where it is a quotient of infinities
    loss = -math.log(k)
    return 2.0 * loss / math.hypot(math.pi, loss)


@dataclass(frozen=True)
class SmoothConditions:
    """Parameters of a lattice with smooth walls; lam and m are those of (21)."""

    a: float
    gamma: float
    lam: float
    m: float
    damping: float = 0.0
    spring: float = 0.0
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: Finite = field(kw_only=True)
    omega: ClassVar[float] = 1.0  # their walls have a time of their own

    @property
    def scaled(self) -> SmoothConditions:
        return self

    @property
    def k(self) -> float:
        """Restitution of the impacting limit, (22)."""
        lam = parameter("lam", self.lam)
        if lam == 2.0:
            return 0.0
        return math.exp(-0.5 * math.pi * lam / math.sqrt(1.0 - 0.25 * lam * lam))

    @property
    def params(self) -> dict[str, float]:
        """Its parameters by name, those of the forcing last."""
        return {**{name: getattr(self, name) for name in OWN}, **self.forcing.params}

    def to_dict(self) -> dict[str, Any]:
        """By numbers and names, for files."""
        numbers = {name: float(getattr(self, name)) for name in OWN}
        return {**numbers, "forcing": to_dict(self.forcing), "lattice": to_dict(self.lattice)}

    def at(self, params: Mapping[str, float]) -> SmoothConditions:
        """Replace some values of its parameters, or with the lam of another k."""
        values = {name: float(params.get(name, value)) for name, value in self.params.items()}
        if "k" in params:
            values["lam"] = damping_of(params["k"])
        numbers: dict[str, Any] = {name: values.pop(name) for name in OWN}
        return replace(
            self, **numbers, forcing=self.forcing.at(**values) if values else self.forcing
        )


class LatticeParameters(TypedDict, total=False):
    """Keywords that say what a lattice moves under, whatever its walls; a and gamma are needed but
    where an orbit brings them."""

    a: float
    gamma: float
    damping: float
    spring: float
    omega: float
    forcing: Drive | None
    lattice: Finite | None


class ModelParameters(LatticeParameters, total=False):
    """Keywords of `simulate`, which every function takes."""

    k: float
    walls: Any
    restitution: Restitution | None


def conditions_of(
    sites: int,
    m: float | None = None,
    /,
    *,
    forcing: Drive | None = None,
    lattice: Finite | None = None,
    walls: Any = None,
    restitution: Restitution | None = None,
    **numbers: Any,
) -> Any:
    """The conditions of a state of so many sites, on a ring unless a lattice is given: of rigid
    walls, or of smooth ones if there is a hardness m."""
    if "noise" in numbers:  # which only `simulate` has, and takes out before
        raise BadInput(
            f"noise = {brief(numbers['noise'])}: noise is for simulate() alone, on rigid walls; "
            "leave it out here, or judge() the run that simulate(..., noise=...) returns"
        )
    if restitution is not None:
        if m is not None or "k" in numbers or not callable(restitution):
            raise BadInput(
                f"restitution = {brief(restitution)}: a function of the speed before an impact was "
                "expected, in place of k and on rigid walls; leave out k and m, or restitution"
            )
        numbers["k"] = math.nan
        if getattr(restitution, "__hash__", None) is None:  # then by which object it is
            restitution = getattr(restitution, "__call__")  # noqa: B004, B009
    # of smooth walls there may be lam in place of k
    needed, known = (NEEDED, NAMES) if m is None else (("a", "gamma"), (*NAMES, "lam"))
    missing = [name for name in needed if name not in numbers]
    unknown = [name for name in numbers if name not in known]
    if missing or unknown:
        what = f"missing {', '.join(missing)}" if missing else f"not known {', '.join(unknown)}"
        raise BadInput(
            f"simulate and all that simulates takes {', '.join(NEEDED)}, and, where wanted, "
            f"{', '.join(OPTIONAL)}, forcing, lattice and walls; {what}."
        )
    if m is not None:
        if (omega := numbers.pop("omega", 1.0)) != 1.0:
            raise BadInput(
                f"smooth walls have a time of their own: leave out omega = {brief(omega)}, or m. "
                "With displacements in units of D = omega^(1/(2 m)) and times in those of 1/omega "
                "the same motion has a/(D omega^2), gamma/omega^2, spring/omega^2, damping/omega, "
                "and the same lam and m."
            )
        if walls is not None:
            raise BadInput("smooth walls are at -1 and 1: leave walls out, or m")
        k, lam = numbers.pop("k", None), numbers.pop("lam", None)
        if (k is None) == (lam is None):
            raise BadInput(f"k = {k}, lam = {lam}: give one of them, (22) ties the other to it.")
        if any(np.any(getattr(lattice, name, 1.0) != 1.0) for name in PER_SITE.values()):
            raise BadInput("smooth walls take one spring, damping and k for all sites; leave m out")
        numbers |= {"lam": lam if k is None else damping_of(k), "m": m}
    where = Ring(sites) if lattice is None else finite(lattice)
    if where.sites != sites:
        raise BadInput(
            f"the state has {sites} sites, the lattice ({where.describe()}) has {where.sites}: "
            "both must have the same; leave out lattice for a ring of the state's length."
        )
    numbers |= {"lattice": where, "forcing": forcing_of(forcing)}
    if m is not None:
        return ranged(SmoothConditions(**numbers))
    walls = Walls.given(walls)
    return ranged(Conditions(walls=walls, restitution=restitution, **numbers)).at({})


def start_of(
    state: Any, m: float | None = None, t0: float = 0.0, /, **on: Any
) -> tuple[State, Any]:
    """A state, and what it moves under. An orbit of a finite lattice brings both, and a point of a
    branch of such; what is given besides takes the place of its own."""
    time, orbit = time_of(t0), orbit_given(state)
    if orbit is not None:
        own = dict(vars(orbit.conditions))
        if m is not None and own["walls"] == Walls():  # where smooth ones are, too
            del own["walls"]
        if (m is not None and "lam" in on) or "restitution" in on:  # say what k does
            del own["k"]
        state, on = orbit.state(t=time), {**own, **on}
    start = check_state(state)
    return start, conditions_of(start.u.size, m, **on)


@runtime_checkable
class GivenOrbit(Protocol):
    """A periodic orbit that knows what it moves under, as simulation sees it from below."""

    @property
    def conditions(self) -> Conditions: ...
    @property
    def section(self) -> Any: ...
    def state(self, sites: int | None = None, t: float = 0.0) -> tuple[Array, Array]: ...


def orbit_given(state: Any) -> GivenOrbit | None:
    """The orbit that a state was given by, if it was."""
    orbit = state.solution if isinstance(state, Point) else state
    return orbit if isinstance(orbit, GivenOrbit) else None


def ranged(on: C) -> C:
    """Conditions, checked to have numbers that a simulation can have."""
    if parameter("omega", on.omega) != 1.0:
        check_drive(on.omega, on.gamma, on.spring, on.lattice)
    heaviest = HEAVIEST * on.omega
    ranges: dict[str, dict[str, Any]] = {
        "a": {"above": False},  # a lattice may be at rest, or ring freely: without forcing, too
        "damping": {"high": heaviest},
        "spring": {"high": heaviest**2},
    }
    if on.omega != 1.0 or not isinstance(on.lattice, Ring):  # the band of a ring is looked at above
        ranges["gamma"] = {"high": heaviest**2, "below": False, "why": ""}
    for name, value in on.params.items():
        if name in (*NAMES, *SMOOTH):
            parameter(name, value, **ranges.get(name, {}))
    if isinstance(on, Conditions):  # nor does a site gain by an impact that has more than k
        largest = on.k if on.restitution is None else 1.0
        parameter("k", largest * float(on.lattice.restitutions.max()))
    return on


def check_state(state: Any) -> State:
    """A copy of a state as two float arrays, or what is wrong with it."""
    if hasattr(getattr(state, "solution", state), "begin_of_orbit"):
        raise BadInput(f"{brief(state)} has its own equations: cb.integrate follows it")
    u, v = state_rows(state)
    fast = int(np.abs(v).argmax())
    if abs(v[fast]) > 1e6:  # its energy would blow up
        raise BadInput(
            f"v[{fast}] = {v[fast]:.3g}: velocities above 1e+06 blow up the energy; the "
            "walls are at distance 1 and the forcing has period 2 pi, so those of interest are "
            "of order 1."
        )
    return State(u, v)


def within(state: State, walls: Walls) -> State:
    """A state, with sites beyond a wall by rounding put onto it; more is refused."""
    low, high = wall_rows(walls, state.u.size)
    beyond = np.maximum(state.u - high, low - state.u)
    n = int(beyond.argmax())
    if beyond[n] > 1e-9 * max(1.0, abs(state.u[n])):  # more than rounding of many steps
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


def within_period(t0: ArrayLike) -> float:
    """A time within one period of the forcing, [0, 2 pi)."""
    return time_of(t0) % PERIOD


def time_of(t0: object) -> float:
    """A time at which a run may begin: exact enough to say when something happens after it."""
    last = LONGEST * PERIOD
    return number("t0", t0, -last, last, f"a time within {LONGEST:g} periods of 0")
