"""What a lattice moves under: forcing, coupling, losses, springs, walls; and all of it as dicts of
numbers and names, and from these again.

What somebody else has written, a forcing of his own for instance, is not among them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import MOST, number, real, whole
from contbreather.errors import BadInput, ContbreatherError, NoSolution
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.finite import PER_SITE, ROWS, Lattice, per_site
from contbreather.lattice.forcing import (
    Forcing,
    Fourier,
    Harmonic,
    Harmonics,
    Periodic,
    Samples,
    TrigonometricSeries,
    even_harmonics,
)
from contbreather.lattice.formula import Symbolic
from contbreather.parameters import NAMES, POWERS, parameter
from contbreather.storage.serialise import NotSerialisable, serialised, to_dict


def restitution_ratio(k: float) -> float:
    """``q = (1 - k)/(1 + k)``: the loss at an impact; `BadInput` unless k is in [0, 1]."""
    k = parameter("k", k)
    return (1.0 - k) / (1.0 + k)  # of (7) and (13): f'(phi) = p q


Array = NDArray[Any]
Restitution = Callable[[float], float]  # of a speed
Pair = tuple[float, float]  # low and high; infinite where there is no wall

# Of walls: an impact between nearer ones would be taken for one that vanishes, and between farther
# ones rounding hides what tells branches apart.
NEAREST, FARTHEST = 1e-6, 1e4


@dataclass(frozen=True)
class Walls:
    """Walls of each site: `of_all` sites, but for those with `own` ones.

    Examples
    --------
    >>> Walls.given({3: (None, 0.8)}).at(3)
    (-inf, 0.8)
    >>> Walls.given([1.0, 1.2, 0.9]).at(1)
    (-1.2, 1.2)
    """

    of_all: Pair = (-1.0, 1.0)
    own: tuple[tuple[int, Pair], ...] = ()
    # of sites that they were given for one by one, until they are placed
    count: int | None = field(default=None, repr=False)

    @classmethod
    def given(cls, walls: Any) -> Walls:
        """Make them of what there is for all sites, for each in turn or, a dict, for some: a pair
        ``(low, high)``, None for a wall that is not there, a number for both as far from 0, or None
        for a site without walls. Two numbers are a pair."""
        if walls is None or isinstance(walls, Walls):
            return walls or cls()
        if _listed(walls) and (len(walls) != 2 or any(map(_listed, walls))):
            return replace(cls.given(dict(enumerate(walls))), count=len(walls))
        if isinstance(walls, Mapping):
            pairs = (
                (whole("walls of site", site, -MOST), _pair(pair, f"walls[{site!r}]"))
                for site, pair in walls.items()
            )
            return cls(own=tuple(sorted(pairs)))
        return cls(_pair(walls, "walls"))

    def placed(self, lattice: Any) -> Walls:
        """Look their sites up on a lattice, negative ones counted from its end."""
        sites, own = lattice.sites, dict[int, Pair]()
        if self.count not in (None, sites):
            each = f", or one for each of {sites} sites," if sites else ""
            raise BadInput(
                f"walls of {self.count} sites are given one by one: a pair low, high for all{each} "
                f"is expected on the {lattice.describe()}."
            )
        for site, pair in self.own if sites is not None else ():
            if not -sites < site < sites:
                raise BadInput(
                    f"walls of site {site}: there is no such site on the {lattice.describe()}; "
                    f"sites are 0 to {sites - 1}."
                )
            if site % sites in own:
                raise BadInput(f"walls of site {site % sites} are given twice.")
            own[site % sites] = pair
        if len(own) == sites and len({*own.values()}) == 1:
            return Walls(own[0])  # the same walls are equal, however they were given
        apart = tuple(sorted(item for item in own.items() if item[1] != self.of_all))
        return Walls(self.of_all, apart) if own else self

    @cached_property
    def _by_site(self) -> dict[int, Pair]:
        return dict(self.own)

    def at(self, site: int) -> Pair:
        """Low and high wall of a site."""
        return self._by_site.get(int(site), self.of_all)

    def position(self, site: int, wall: int) -> float:
        """Position of its wall +1 or -1."""
        return self.at(site)[wall > 0]  # of (low, high)

    @property
    def symmetric(self) -> bool:
        """True where every site has both its walls equally far from 0."""
        return self.askew is None

    @property
    def askew(self) -> Pair | None:
        """Walls of some site that are not equally far from 0, if there are any."""
        pairs = (self.of_all, *self._by_site.values())
        return next(((low, high) for low, high in pairs if low != -high), None)


def _listed(values: Any) -> bool:
    return isinstance(values, Sequence | np.ndarray) and not isinstance(values, str)


def _pair(ends: Any, name: str) -> Pair:
    if ends is None:
        ends = (None, None)
    try:
        low, high = ends if _listed(ends) else (-ends, ends)
        pair = (-math.inf if low is None else float(low), math.inf if high is None else float(high))
    except (TypeError, ValueError):
        pair = (math.nan, math.nan)  # refused below: nan < nan is false
    if not pair[0] < pair[1]:
        raise BadInput(
            f"{name} = {ends!r}: two numbers low < high are expected, None for a wall that is not "
            "there, or a number above 0 for both."
        )
    distances = [abs(wall) for wall in pair if math.isfinite(wall)]
    # at 0 a wall has no size: there the drive alone says how far a site moves
    if 0.0 < max(distances, default=0.0) < NEAREST or min(distances, default=0.0) > FARTHEST:
        raise BadInput(
            f"{name} = {ends!r}: tolerances are for walls from {NEAREST:g} to {FARTHEST:g} away; "
            "everything scales with them: measure displacements and a in a larger or smaller unit."
        )
    return pair


@dataclass(frozen=True)
class Conditions:
    """Every parameter of the motion, its forcing, and where it happens.

    Attributes
    ----------
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    damping, spring : float
        ``u'' + damping u' + spring u + ...``, per unit mass. These and k may be given for each site
        of a finite lattice: they are the means then, and the lattice has their proportions.
    forcing : Forcing
    walls : Walls
    lattice : InfiniteChain, Ring or Lattice
    restitution : callable, optional
        Of the speed before an impact, in simulations: k is no number then.
    omega : float
        Frequency of the drive, ``F = a f(omega t)``. Everything that moves has its times in units
        of 1/omega, as phases of the drive, and its velocities in d omega: see `scaled`.
    """

    a: float
    gamma: float
    k: float
    damping: float = 0.0
    spring: float = 0.0
    forcing: Forcing = field(default_factory=Harmonic)
    walls: Walls = Walls()
    lattice: Any = field(default_factory=InfiniteChain)
    restitution: Restitution | None = None
    omega: float = 1.0

    def __post_init__(self) -> None:
        given = {name: getattr(self, name) for name in PER_SITE}
        lattice, means = per_site(self.lattice, given)
        for name, value in {**means, "lattice": lattice}.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "walls", self.walls.placed(lattice))

    def checked(self) -> Conditions:
        """Say what is wrong with it, or return it. Derivatives by differences look beyond the edges
        of the domain, where everything is defined still: so this is asked where numbers come in."""
        for name in NAMES:
            # how far gamma goes its lattice knows: no further than 1/4 on chain and ring
            other = {"high": math.inf, "why": ""} if name == "gamma" else {}
            parameter(name, getattr(self, name), **other)
        if self.omega != 1.0:
            check_drive(self.omega, self.gamma, self.spring, self.lattice)
        return self.at({})

    @property
    def params(self) -> dict[str, float]:
        """Parameters by name, those of the forcing last; omega where it is not 1."""
        absent = {"k"} if self.restitution is not None else set()
        absent |= {"omega"} if self.omega == 1.0 else set()
        own = {name: getattr(self, name) for name in NAMES if name not in absent}
        return {**own, **self.forcing.params}

    @property
    def scaled(self) -> Conditions:
        """Conditions with the time in units of 1/omega, in which equations are written."""
        return self.at_frequency(1.0)

    def at_frequency(self, omega: float, /, **given: float) -> Conditions:
        """Conditions with the time in units in which the drive has this frequency, and parameters
        that are known in these.

        Examples
        --------
        >>> on = Conditions(0.5, 0.04, 0.8, damping=0.1, omega=2.0).scaled
        >>> on.a, on.gamma, on.damping, on.omega
        (0.125, 0.01, 0.05, 1.0)
        """
        if omega == self.omega:
            return self
        own = {n: getattr(self, n) * (omega / self.omega) ** power for n, power in POWERS.items()}
        return self.at({**own, **given, "omega": omega})

    def at_sites(self, name: str, sites: Any) -> Any:
        """Values of k, damping or spring at sites, of which a lattice may give each its own."""
        if self.lattice.sites is None:
            return getattr(self, name)
        which = np.asarray(sites) % self.lattice.sites  # around a ring
        return getattr(self, name) * getattr(self.lattice, PER_SITE[name])[which]

    @property
    def symmetric(self) -> bool:
        """Tell whether the mirror image of a motion, half a period later, obeys the same laws."""
        return self.walls.symmetric and not even_harmonics(self.forcing)

    # ------------------------------------------------------------------------ law of an impact

    def restitution_at(self, speed: float) -> float:
        """The restitution coefficient at the speed before an impact."""
        if self.restitution is None:
            return self.k
        name = f"restitution({speed:.6g})"
        return number(name, self.restitution(speed), 0.0, 1.0, "a number from 0 to 1")

    def laws_at(self, velocities: Array, sites: Array) -> tuple[Array, Array]:
        """Ratios R(v)/v of the velocities after and before impacts, eq. (2), and slopes R'(v)."""
        if self.restitution is None:
            ratios = -self.at_sites("k", sites)
            return ratios, ratios

        def ratio(v: Array) -> Array:
            return np.array([-self.restitution_at(speed) for speed in abs(v).tolist()])

        # differences of order 4 over so much are right to 1e-12, of a law as smooth as that
        v, h = velocities, 1e-4 * np.where(velocities == 0.0, 1.0, velocities)
        near, far = ((v + d) * ratio(v + d) - (v - d) * ratio(v - d) for d in (h, 2.0 * h))
        shares = self.lattice.restitutions[sites]
        return shares * ratio(v), shares * ((8.0 * near - far) / (12.0 * h))

    # ------------------------------------------------------------------------ with other values

    def at(self, params: Mapping[str, float]) -> Conditions:
        """Replace values of its parameters."""
        own = {name: getattr(self, name) for name in NAMES} | self.forcing.params
        values = tuple(float(params.get(name, value)) for name, value in own.items())
        # lattices of the same numbers are equal, and each keeps its name
        name = getattr(self.lattice, "name", "")
        return _moved(self.forcing, self.walls, self.lattice, values, name, self.restitution)


@lru_cache(maxsize=256)
def _moved(
    forcing: Forcing, walls: Walls, lattice: Any, values: tuple[float, ...], _: str,
    restitution: Restitution | None,
) -> Conditions:  # fmt: skip
    names = tuple(forcing.params)
    if names:
        forcing = forcing.at(**dict(zip(names, values[len(NAMES) :], strict=True)))
    own: Any = dict(zip(NAMES, values, strict=False))
    return Conditions(**own, forcing=forcing, walls=walls, lattice=lattice, restitution=restitution)


# --- in the time of the drive ---------------------------------------------------------------------


@contextmanager
def in_time_of_drive(on: Conditions) -> Iterator[Conditions]:
    """Conditions with the time in units of 1/omega; a refusal says so, but for one of what was
    given, which is checked in its own units."""
    scaled = on if on.omega == 1.0 else on.checked().scaled
    try:
        yield scaled
    except ContbreatherError as error:
        if on.omega != 1.0 and any(f"{name} = " in str(error) for name in POWERS):
            units = (
                f"units of omega = {on.omega:g}: a, gamma, spring by its square, damping by itself"
            )
            error.args = (f"{error} These numbers are in {units}.",)
        raise


def check_drive(omega: float, gamma: Any, spring: Any, lattice: Any) -> None:
    """`NoSolution` where a harmonic of the drive is in the band of the infinite chain or a ring."""
    if not isinstance(lattice or InfiniteChain(), InfiniteChain | Ring):
        return
    # a ring with springs goes by its modes, of which each says so itself
    ground = 0.0 if spring is None or isinstance(lattice, Ring) else real(spring)
    low, high = math.sqrt(abs(ground)), math.sqrt(abs(ground + 4.0 * real(gamma)))
    if not omega <= high:  # of what is no number others say so
        return
    m = 2 * math.ceil(0.5 * (low / omega - 1.0)) + 1  # the lowest odd one above the lower edge
    place = f"harmonic {m} of the drive, {m * omega:.6g}, is in the band of the lattice"
    if m * omega > high:
        place = "the drive is below the band of the lattice"
    raise NoSolution(
        f"omega = {omega:.6g}: {place}, {low:.6g} to {high:.6g}; take a frequency above that."
    )


# --- the forced response where a spring holds every site: f'' + spring f = F ----------------------


@dataclass(frozen=True)
class SpringResponse(Periodic):
    """The response to a forcing, with the spring, below 1, as one of its parameters."""

    of: Forcing
    spring: float

    def __post_init__(self) -> None:
        # -F_m/m^2 of the free lattice becomes F_m/(spring - m^2)
        object.__setattr__(self, "_series", TrigonometricSeries(self._scaled(self.of.harmonics)))

    def _scaled(self, harmonics: Harmonics, power: int = 1) -> Harmonics:
        """Divided by ``1 - spring/m^2``; with the second power the slope of that."""
        # d/ds of m^2/(m^2 - s) is m^2/(m^2 - s)^2
        scales = [float(m * m / (m * m - self.spring) ** power) for m, *_ in harmonics]
        return tuple((m, c * A, c * B) for c, (m, A, B) in zip(scales, harmonics, strict=True))

    @property
    def params(self) -> dict[str, float]:
        return {**self.of.params, "spring": self.spring}

    def _with(self, params: dict[str, float]) -> SpringResponse:
        spring = params.pop("spring")
        return spring_response(self.of.at(**params), spring)

    def slope_harmonics(self, name: str) -> Harmonics:
        """Slope in a parameter of the forcing or in the spring."""
        if name == "spring":
            return self._scaled(self.of.harmonics, 2)
        return self._scaled(self.of.slope_harmonics(name))

    def describe(self) -> str:
        return self.of.describe()


# kept: residual, Jacobian and sensitivities ask for the same few in turn
spring_response = lru_cache(maxsize=256)(SpringResponse)


# --- as dicts -------------------------------------------------------------------------------------

serialised("harmonic", Harmonic, lambda forcing: {})(Harmonic)
serialised("samples", Samples, lambda forcing: {"values": list(forcing.values)})(Samples)
serialised("infinite chain", InfiniteChain, lambda chain: {"spring": chain.spring})(InfiniteChain)
serialised("ring", Ring, lambda ring: {"sites": ring.sites})(Ring)


serialised("fourier", Fourier, lambda f: {"cos": [*map(list, f.cos)], "sin": [*map(list, f.sin)]})(
    lambda cos, sin: Fourier(dict(cos), dict(sin))
)
serialised("formula", Symbolic, lambda f: {"formula": f.expression, "values": dict(f.values)})(
    lambda formula, values: Symbolic(formula, **values)
)
serialised("held", SpringResponse, lambda held: {"of": to_dict(held.of), "spring": held.spring})(
    spring_response
)


def _lattice_to_dict(lattice: Lattice) -> dict[str, Any]:
    """By the entries of its stiffness that are not zero, each once."""
    rows, columns = np.nonzero(np.triu(lattice.stiffness))
    entries = lattice.stiffness[rows, columns]
    weights = {name: getattr(lattice, name) for name in ROWS}
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
def _lattice(sites: int, rows: Any, columns: Any, entries: Any, **more: Any) -> Lattice:
    matrix = np.zeros((sites, sites))
    matrix[rows, columns] = matrix[columns, rows] = entries  # symmetric: a file has its upper half
    return Lattice(matrix, **more)


def _ends(pair: Pair) -> list[float | None]:
    """Low and high, None for a wall that is not there: JSON has no infinity."""
    return [wall if math.isfinite(wall) else None for wall in pair]


@serialised(
    "walls",
    Walls,
    lambda walls: {"of_all": _ends(walls.of_all), "own": [[n, _ends(p)] for n, p in walls.own]},
)
def _walls(of_all: Sequence[float | None], own: Sequence[Any]) -> Walls:
    return Walls(Walls.given(tuple(of_all)).of_all, Walls.given(dict(own)).own)


def _conditions_to_dict(on: Conditions) -> dict[str, Any]:
    if on.restitution is not None:
        raise NotSerialisable(on.restitution)
    numbers = {name: float(getattr(on, name)) for name in NAMES if name in on.params}
    parts = ("forcing", "walls", "lattice")
    return {**numbers, **{name: to_dict(getattr(on, name)) for name in parts}}


serialised("conditions", Conditions, _conditions_to_dict)(Conditions)
