"""The parameters of the model, each declared once: what it is, its range, unit, and default.

Checks and their sentences, the domains of curves, the options of commands, the keys of a study,
the fields of the explorer and the table in the documentation are made from it. Lengths are
in distances d of a wall, times in 1/Omega of the drive. No numerics are loaded: so help is at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from .errors import BadInput


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """What a motion depends on.

    Parameters
    ----------
    name : str
        Of the argument, the option, the key, the field.
    meaning : str
        A noun, as sentences name it.
    label : str
        The same in a word or two, beside a field.
    typed : str
        How it is typed, as help says it.
    default : float or str, optional
        Unless given, as it is typed; None where a value is needed.
    """

    name: str
    meaning: str
    label: str
    typed: str = ""
    default: Any = None

    @property
    def help(self) -> str:
        """A sentence for options and tables."""
        return self.typed or f"{self.meaning[0].upper()}{self.meaning[1:]}."


@dataclass(frozen=True, kw_only=True)
class Number(Parameter):
    """A parameter that is a number within a range.

    Parameters
    ----------
    unit : str
    low, high : float
        The ends of its range.
    above, below : bool
        Whether the lower, the upper end itself is outside.
    margin : float
        How far from an end that is outside curves stop: next to it equations are singular.
    why : str
        The reason for the range, behind it in a sentence.
    where : str
        On which lattices.
    window : (low, high), optional
        Where it is looked at unless a window is given; the whole range unless said here.
    rim : str
        Why the window is narrower than the range.
    """

    unit: str
    low: float = 0.0
    high: float = math.inf
    above: bool = False
    below: bool = False
    margin: float = 0.0
    why: str = ""
    where: str = ""
    window: tuple[float, float] | None = None
    rim: str = ""

    def holds(self, value: float) -> bool:
        """Whether a number is in the range; NaN and infinity never are."""
        over = self.low < value if self.above else self.low <= value
        under = value < self.high if self.below else value <= self.high
        return over and under and value < math.inf

    @property
    def wanted(self) -> str:
        """What a value out of range is told."""
        if self.high == math.inf:
            sign = ">" if self.above else ">="
            return f"the {self.meaning} must be a finite number {sign} {self.low:g}{self.why}."
        sign = "<" if self.below else "<="
        span = f"{self.low:g} <= {self.name} {sign} {_plainly(self.high)}"
        return (
            f"the {self.meaning} must be a number with {span}{self.why}; choose {self.name} in "
            "that range."
        )

    @property
    def span(self) -> str:
        """The range in words, and where it holds."""
        if self.high == math.inf:
            return f"{'above' if self.above else 'at least'} {self.low:g}{self.where}"
        ends = f"{self.low:g}, {_plainly(self.high)}"
        return f"in {'(' if self.above else '['}{ends}{')' if self.below else ']'}{self.where}"

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


def _listed(*declared: Any) -> dict[str, Any]:
    return {one.name: one for one in declared}


# Without forcing a breather has no phase: a = 0 is outside, but for simulations. At gamma = 1/4 the
# band [0, 2 sqrt(gamma)] reaches the drive: chi grows as (1/4 - gamma)^(-1/2), p goes to 0, and
# all curves end in one point: within 1e-5 of it the equations of NS hold to 1e-9 no longer, within
# 1e-6 Newton's iteration fails on NS and on the fold. At k = 1 the arc of multipliers is neutral
# throughout, at k = 0 the impact of site 0 degenerates.
NUMBERS: dict[str, Number] = _listed(
    Number(
        name="a", meaning="amplitude of the forcing", label="amplitude a",
        unit="d Omega^2", above=True, margin=1e-9, why="; its sign belongs in the forcing",
        window=(0.0, math.inf),
    ),
    Number(
        name="gamma", meaning="coupling",
        label="coupling \N{GREEK SMALL LETTER GAMMA}", unit="Omega^2", high=0.25, below=True,
        margin=1e-4, where=" on chain and ring",
        why=", so that the band [0, 2 sqrt(gamma)] stays below the forcing frequency 1",
    ),
    Number(
        name="k", meaning="restitution coefficient", label="restitution k", unit="1", high=1.0,
        why=" (0 sticks, 1 loses nothing)", window=(0.01, 0.999),
        rim=": at 0 and 1 curves degenerate",
    ),
    Number(
        name="damping", meaning="damping coefficient",
        label="damping", unit="Omega", default=0.0,
    ),
    Number(
        name="spring", meaning="on-site stiffness", label="spring", unit="Omega^2",
        default=0.0,
    ),
)  # fmt: skip
SMOOTH: dict[str, Number] = _listed(  # in place of k, of walls as in (21)
    Number(
        name="lam", meaning="damping of the wall",
        label="wall's damping", unit="1", high=2.0,
    ),
    Number(
        name="m", meaning="hardness of the wall", label="hardness", unit="1", low=0.5, high=1e4,
        why=" (natural in (21), here any real one)",
    ),
)  # fmt: skip
CHOICES: dict[str, Parameter] = _listed(
    Parameter(
        name="forcing", meaning="shape of the forcing", label="forcing F/a", default="-cos(t)",
        typed="F(t)/a as a formula in t, antisymmetric over half the period 2 pi.",
    ),
    Parameter(
        name="lattice", meaning="lattice", label="lattice", default="infinite chain",
        typed="ring:20, open:9, open:9:fixed, grid:5x5, grid:5x5:periodic, a stiffness matrix in a "
        ".csv, a graph in a .graphml, whose nodes may have a mass and a drive; the infinite chain "
        "unless given.",
    ),
    Parameter(
        name="site", meaning="site that impacts", label="impacts at site", default=0,
        typed="The site that impacts.",
    ),
    Parameter(
        name="walls", meaning="walls", label="walls", default="-1,1",
        typed="LOW,HIGH of all sites, or SITE:LOW,HIGH of one, once for each; a wall that is not "
        "there is none. -1,1 unless given.",
    ),
)  # fmt: skip
_DECLARED = {**NUMBERS, **SMOOTH}
NAMES = tuple(NUMBERS)  # a, gamma, k, damping, spring
NEEDED = tuple(name for name, one in NUMBERS.items() if one.default is None)
OPTIONAL = tuple(name for name in NAMES if name not in NEEDED)


def parameter(name: str, value: object, **range_: Any) -> float:
    """A parameter as a float in its range, or its sentence; some functions have another range.

    Examples
    --------
    >>> parameter("k", 1), parameter("damping", 0.5, high=1e4)
    (1.0, 0.5)
    """
    from .checks import real, shown

    declared = _DECLARED[name]
    if range_:
        declared = replace(declared, **range_)
    number = real(value)
    if declared.holds(number):
        return number
    raise BadInput(f"{name} = {shown(value)}: {declared.wanted}")


def window_of(name: str) -> tuple[float, float]:
    """Where a parameter is looked at unless a window is given; any value of one of the forcing.

    Examples
    --------
    >>> window_of("gamma"), window_of("c3")
    ((0.0, 0.2499), (-inf, inf))
    """
    if name not in NUMBERS:
        return -math.inf, math.inf
    return NUMBERS[name].window or NUMBERS[name].domain


def usual_windows() -> str:
    """Those that have two ends, in words.

    Examples
    --------
    >>> usual_windows()
    '0 to 0.2499 for gamma, 0.01 to 0.999 for k'
    """
    windows = ((name, *window_of(name)) for name in NAMES)
    return ", ".join(f"{low:g} to {high:g} for {name}" for name, low, high in windows if high < 1e9)


def table() -> Iterator[tuple[str, str, str, str, str]]:
    """Name, meaning, range or how it is typed, unit and default of each."""
    for one in (*NUMBERS.values(), *SMOOTH.values()):
        default = "" if one.default is None else f"{one.default:g}"
        yield one.name, one.meaning, one.span, one.unit, default
    for other in CHOICES.values():
        yield other.name, other.meaning, other.typed, "", str(other.default)
