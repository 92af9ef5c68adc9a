"""The parameters of the model, each declared once: what it is, its range, unit, and default.

Checks and their sentences, the domains of curves, the options of commands, the keys of a study,
the fields of the explorer and the table in the documentation are made from this list. Lengths are
in distances d of a wall, times in 1/Omega of the drive. No numerics are loaded: help is at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from .errors import BadInput


@dataclass(frozen=True, eq=False, repr=False)
class Parameter:
    """Quantity that a motion depends on, by the name of the argument, the option, the key, the
    field; its default is None where a value is needed."""

    name: str
    meaning: str  # a noun, for sentences
    label: str  # the same in a word or two, beside a field
    default: Any = None
    typed: str = ""  # how it is typed

    @property
    def help(self) -> str:
        """A sentence for options and tables."""
        return self.typed


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Number(Parameter):
    """A number from `low` to `high`; `above` and `below` exclude these ends themselves."""

    dimension: str = "1"
    low: float = 0.0
    high: float = math.inf
    above: bool = False
    below: bool = False
    power: int = 0  # of omega that it is measured in
    margin: float = 0.0  # how far from an end that is excluded curves stop
    why: str = ""  # the reason for the range, behind it
    lattices: str = ""  # those that the range holds for
    window: tuple[float, float] | None = None  # where it is looked at, if not in all its range
    window_reason: str = ""  # why not in all
    first: float = 0.0  # where the explorer begins
    # of what a plane of zones may fix
    slider: tuple[float, float, float] = (0.0, 1.0, 0.01)  # its ends and its step

    def holds(self, value: float) -> bool:
        """Tell whether a number is in the range; NaN and infinity never are."""
        over = self.low < value if self.above else self.low <= value
        under = value < self.high if self.below else value <= self.high
        return over and under and value < math.inf

    @property
    def wanted(self) -> str:
        if self.high == math.inf:
            sign = ">" if self.above else ">="
            return f"the {self.meaning} must be a finite number {sign} {self.low:g}{self.why}."
        less = "<" if self.above else "<="
        span = (
            f"{self.low:g} {less} {self.name} {'<' if self.below else '<='} {_plainly(self.high)}"
        )
        also = f"{self.why}; choose {self.name} in that range."
        return f"the {self.meaning} must be a number with {span}{also}"

    @property
    def span(self) -> str:
        """The range in words, and where it holds."""
        if self.high == math.inf:
            return f"{'above' if self.above else 'at least'} {self.low:g}{self.lattices}"
        start, end = "(" if self.above else "[", ")" if self.below else "]"
        return f"in {start}{self.low:g}, {_plainly(self.high)}{end}{self.lattices}"

    @property
    def help(self) -> str:
        return f"{self.meaning[0].upper()}{self.meaning[1:]}, {self.span}."

    @property
    def domain(self) -> tuple[float, float]:
        """The range as a closed one, in which curves are followed."""
        low = self.low + self.margin if self.above else self.low
        return low, self.high - self.margin if self.below else self.high


def _plainly(end: float) -> str:
    if end == 0.25:
        return "1/4"
    return f"{end:g}" if end < 1e4 else f"{end:.0e}".replace("e+0", "e")


# Damping, or a frequency: beyond it exp(-damping t) or a phase has no digit left over a period,
# and a simulation takes steps of 3/HEAVIEST.
HEAVIEST = 1e4

_MODEL = (
    # without forcing there is no phase; simulations may have none
    Number("a", "amplitude of the forcing", "amplitude a", dimension="d Omega^2", power=2,
           above=True, margin=1e-9, why="; its sign belongs in the forcing", window=(0.0, math.inf),
           first=0.5, slider=(0.05, 0.99, 0.01)),  # beyond 1 there is nothing
    # At 1/4 the band reaches the drive: chi grows as (1/4 - gamma)^(-1/2), p goes to 0 and all
    # curves end in one point. The equations of NS hold to 2e-10 at 0.2499, to 1e-7 at 0.24999;
    # within 1e-6 Newton's iteration fails on NS and on the fold.
    Number("gamma", "coupling", "coupling \N{GREEK SMALL LETTER GAMMA}", dimension="Omega^2",
           power=2, high=0.25, below=True, margin=1e-4, lattices=" on chain and ring",
           why=", so that the band [0, 2 sqrt(gamma)] stays below the forcing frequency 1",
           first=0.08, slider=(0.005, 0.245, 0.005)),
    # the arc of multipliers is neutral throughout at 1; the impact of site 0 degenerates at 0
    Number("k", "restitution coefficient", "restitution k", high=1.0, window=(0.01, 0.999),
           why=" (0 sticks, 1 loses nothing)", window_reason=": at 0 and 1 curves degenerate",
           first=0.8, slider=(0.01, 0.99, 0.01)),
    Number("damping", "damping coefficient", "damping", 0.0, dimension="Omega", power=1,
           high=HEAVIEST),
    Number("spring", "on-site stiffness", "spring", 0.0, dimension="Omega^2", power=2,
           high=HEAVIEST**2),
    # In units of 1/omega, the time of everything that moves, the frequency of the drive is 1.
    Number("omega", "frequency of the forcing", "frequency \N{GREEK SMALL LETTER OMEGA}", 1.0,
           dimension="Omega", high=HEAVIEST, above=True, margin=1e-4,
           window=(0.1, 3.0), window_reason=", in units in which gamma is below 1/4"),
)  # fmt: skip
_WALLS = (  # smooth ones, (21), in place of k
    Number("lam", "damping of the wall", "wall's damping", high=2.0),
    Number("m", "hardness of the wall", "hardness", low=0.5, high=1e4,
           why=" (natural in (21), here any real one)"),
)  # fmt: skip
_CHOICES = (
    Parameter("forcing", "shape of the forcing", "forcing F/a", "-cos(t)",
              "F(t)/a as a formula in t, antisymmetric over half the period 2 pi."),
    Parameter("lattice", "lattice", "lattice", "infinite chain",
              "ring:20, open:9, open:9:fixed, grid:5x5, grid:5x5:periodic, a stiffness matrix in "
              "a .csv, a graph in a .graphml, whose nodes may have a mass and a drive; behind any "
              "of them numbers of all sites, :masses=1,2,1 for instance; the infinite chain unless "
              "given, a ring of 20 to simulate."),
    Parameter("site", "site", "impacts at site", 0, "The site that impacts."),
    Parameter("walls", "walls", "walls", "-1,1",
              "LOW,HIGH of all sites, a number of each for both of its walls, 1,1.2,0.9, or "
              "SITE:LOW,HIGH of one, once for each; a wall that is not there is none. -1,1 unless "
              "given."),
)  # fmt: skip
NUMBERS = {entry.name: entry for entry in _MODEL}
SMOOTH = {entry.name: entry for entry in _WALLS}
CHOICES = {entry.name: entry for entry in _CHOICES}
NAMES = tuple(NUMBERS)  # a, gamma, k, damping, spring, omega
POWERS = {entry.name: entry.power for entry in _MODEL if entry.power}
NEEDED = tuple(name for name, entry in NUMBERS.items() if entry.default is None)
OPTIONAL = tuple(name for name in NAMES if name not in NEEDED)


def parameter(name: str, value: object, **range_: Any) -> float:
    """A parameter as a float in its range, or its sentence; some functions have another range."""
    declared = NUMBERS[name] if name in NUMBERS else SMOOTH[name]
    if range_:
        declared = replace(declared, **range_)
    if type(value) is float and declared.holds(value):  # most are, and are asked for often
        return value
    from .checks import brief, real

    number = real(value)
    if declared.holds(number):
        return number
    raise BadInput(f"{name} = {brief(value)}: {declared.wanted}")


def window_of(name: str, omega: float = 1.0) -> tuple[float, float]:
    """Default window of a parameter, in units of the frequency; any value of one of the forcing."""
    if name not in NUMBERS:
        return -math.inf, math.inf
    unit = omega ** POWERS.get(name, 0)
    low, high = NUMBERS[name].window or NUMBERS[name].domain
    return unit * low, unit * high


def windows_of(
    pair: tuple[str, str], given: Mapping[str, tuple[float, float]], omega: float = 1.0
) -> dict[str, tuple[float, float]]:
    """Windows of two parameters, the default ones where none is given; beside omega, where it is
    the first, that of the other is that of its highest value."""
    first, second = pair
    span = given.get(first) or window_of(first, omega)
    highest = span[1] if first == "omega" else omega
    return {first: span, second: given.get(second) or window_of(second, highest)}


def table() -> Iterator[tuple[str, str, str, str, str]]:
    """Name, meaning, range or how it is typed, dimension and default of each."""
    for entry in (*_MODEL, *_WALLS):
        default = "" if entry.default is None else f"{entry.default:g}"
        yield entry.name, entry.meaning, entry.span, entry.dimension, default
    for choice in _CHOICES:
        yield choice.name, choice.meaning, choice.typed, "", str(choice.default)
