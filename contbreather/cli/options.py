"""Options that several commands share, and the arguments of the library that are made of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, TypeVar
from unicodedata import normalize

from cyclopts import Parameter, validators

import contbreather as cb
from contbreather.cli.output import inform
from contbreather.errors import BadInput
from contbreather.parameters import CHOICES, NAMES, NEEDED, NUMBERS, window_of

if TYPE_CHECKING:
    from cyclopts import Token

HARMONIC: str = CHOICES["forcing"].default
Span = tuple[float, float]
T = TypeVar("T")


def whole_number(_: Any, tokens: Sequence[Token]) -> int:
    """Read a whole number as it was typed; the parser itself would round 2.5."""
    typed = tokens[0].value
    try:
        return int(typed)
    except ValueError:
        raise ValueError(f"{typed} is not a whole number") from None


Whole = Annotated[int, Parameter(converter=whole_number)]
Workers = Annotated[int, Parameter(converter=whole_number, validator=validators.Number(gte=1))]


def number_or_numbers(_: Any, tokens: Sequence[Token]) -> Any:
    """Read a number, or one for each site, apart by commas."""
    read = [float(word) for word in tokens[0].value.split(",")]
    return read if len(read) > 1 else read[0]


PerSite = Annotated[float, Parameter(converter=number_or_numbers)]


def parameter_help(name: str) -> Parameter:
    return Parameter(help={**NUMBERS, **CHOICES}[name].help)


def window_help(name: str) -> Parameter:
    number = NUMBERS[name]
    words = f"Lowest and highest {number.meaning} to look at, {_usual(name)} unless given"
    return Parameter(help=f"{words}{number.window_reason}.")


def _usual(name: str) -> str:
    low, high = window_of(name)
    return "all" if high == math.inf else f"{low:g} to {high:g}"


_WINDOWS = ", ".join(f"{_usual(name)} for {name}" for name in ("gamma", "k", "omega"))
Window = Annotated[
    Span | None, Parameter(help=f"Lowest and highest value; {_WINDOWS} unless given.")
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LatticeOptions:
    """Lattice and drive of breathers, as they were typed."""

    damping: Annotated[PerSite | None, parameter_help("damping")] = None
    spring: Annotated[PerSite | None, parameter_help("spring")] = None
    omega: Annotated[float | None, parameter_help("omega")] = None
    lattice: Annotated[str | None, parameter_help("lattice")] = None
    sites: Whole | None = None
    """A ring of so many sites in place of the infinite chain, judged by the paper's rule."""
    site: Annotated[Whole, parameter_help("site")] = CHOICES["site"].default
    walls: Annotated[
        tuple[str, ...], Parameter(allow_leading_hyphen=True), parameter_help("walls")
    ] = ()
    forcing: Annotated[str, Parameter(allow_leading_hyphen=True), parameter_help("forcing")] = (
        HARMONIC
    )
    set: tuple[str, ...] = ()
    """NAME=VALUE of a parameter in the formula."""

    @property
    def read(self) -> dict[str, str | None]:
        """File of the lattice, by its option."""
        return {"--lattice": self.lattice}

    def on(self, *free: str) -> dict[str, Any]:
        """Make lattice, forcing, site and walls, as `symmetric` takes them; letters of the forcing
        that are free and have no value begin at 1."""
        from contbreather.checks import one_of
        from contbreather.lattice.formula import forcing_of
        from contbreather.lattice.parse import lattice_by, walls_by

        lattice = lattice_by(self.lattice, self.sites)
        wanted = "NAME=VALUE was expected, for instance --set c3=2.7"
        letters = assigned("--set", self.set, _a_number, wanted)
        if letters or self.forcing.replace(" ", "") != HARMONIC:
            letters |= {name: 1.0 for name in free if name not in (*NAMES, *letters)}
        forcing, walls = forcing_of(self.forcing, **letters), walls_by(self.walls, lattice.sites)
        for name in free:
            one_of("the parameter", name, (*NAMES, *forcing.params))
        return {"lattice": lattice, "forcing": forcing, "site": self.site, "walls": walls}


@dataclass(frozen=True, kw_only=True)
class _Needed:
    a: Annotated[float | None, parameter_help("a")] = None
    gamma: Annotated[float | None, parameter_help("gamma")] = None
    k: Annotated[PerSite | None, parameter_help("k")] = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ModelOptions(LatticeOptions, _Needed):  # fields of the last base come first
    """Parameters and lattice of a breather as they were typed."""

    sites: Whole | None = None
    """Short for --lattice ring:N; of a point, that ring as well."""

    def given(self, *free: str) -> dict[str, float]:
        """Return the parameters that were given; all that are needed must be, but for free ones."""
        values = {name: getattr(self, name) for name in NAMES}
        for name in NEEDED:
            if values[name] is None and name not in free:
                number = NUMBERS[name]
                raise BadInput(f"--{name} is missing: the {number.meaning}, {number.span}")
        return {name: value for name, value in values.items() if value is not None}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Judged:
    """Rule by which finite lattices are judged; what is switched to has the paper's."""

    threshold: float | None = None
    """On finite lattices: modulus over a period beyond which it is unstable, 1.005 unless given."""

    def verge(self, lattice: Any) -> float:
        """Threshold of instability on a lattice, refused where it has none."""
        from contbreather.stability.verdict import threshold_on

        return threshold_on(lattice, self.threshold)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ZoneOptions(Judged, LatticeOptions):  # fields of the last base come first
    """Windows of zone diagrams, and the lattice of their breathers."""

    gamma_window: Annotated[Span | None, window_help("gamma")] = None
    a_window: Annotated[Span | None, window_help("a")] = None
    k_window: Annotated[Span | None, window_help("k")] = None
    omega_window: Annotated[Span | None, window_help("omega")] = None
    past_folds: bool = False
    """With the lower breathers, too, those behind a fold: all unstable, but they may exist where no
    upper one does."""

    def options(self, fixed: Mapping[str, Any]) -> dict[str, Any]:
        """Make all arguments of `zones` of it, but what is fixed; say so where a window is cut."""
        from contbreather.orbits.zone_diagram import narrowed
        from contbreather.orbits.zone_search import second_of

        typed = {name: getattr(self, f"{name}_window") for name in (*NEEDED, "omega")}
        within = {name: span for name, span in typed.items() if span}
        plane = (*within, "omega") if second_of(fixed) else (*within,)
        lattice = self.on()["lattice"]
        seen = narrowed(plane, within, lattice, {"omega": self.omega or 1.0})
        for name, window in within.items():
            (low, high), (least, most) = window, seen[name]
            if (least, most) != (low, high):
                part = f"{least:g} to {most:g}"
                inform(f"of the window {low:g} to {high:g} of {name} only {part} is looked at")
        how = {"past_folds": self.past_folds, "within": within, "threshold": self.threshold}
        own = {"damping": self.damping or 0.0, "spring": self.spring, "omega": self.omega or 1.0}
        return {**self.on(), **how, **own}


def assigned(
    option: str, typed: Iterable[str], read: Callable[[str, str], T | None], wanted: str
) -> dict[str, T]:
    """Read NAME=VALUE, each name once, as Python reads those in a formula."""
    values: dict[str, T] = {}
    for text in typed:
        name, equals, words = text.partition("=")
        value = read(name.strip(), words) if equals else None
        if value is None:
            raise BadInput(f"{option} {text!r}: {wanted}")
        name = normalize("NFKC", name.strip())
        if name in values:
            raise BadInput(
                f"{option}: {name} is given twice, {values[name]} and {value}; leave one of them"
            )
        values[name] = value
    return values


def _a_number(name: str, words: str) -> float | None:
    with suppress(ValueError):
        return float(words) if name.isidentifier() else None
    return None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class BranchWindow:
    """Parameter that varies along a branch."""

    free: Annotated[
        str, Parameter(help=f"Parameter to vary: {', '.join(NAMES)}, or one of the forcing's.")
    ]
    window: Window = None

    def within(self, where: ModelOptions) -> dict[str, Span]:
        """Window of the parameter, where it is looked at unless given."""
        return {self.free: self.window or window_of(self.free, where.omega or 1.0)}

    def problem(
        self, where: ModelOptions, judged: Judged = Judged(), root: int | None = None, *,
        switched: bool = False,
    ) -> cb.Problem:  # fmt: skip
        """Equations of a breather at the value of the free parameter, if one is given, or in its
        window, with all events; where other branches are `switched` to, on finite lattices those of
        shooting."""
        free, on, params = self.free, where.on(self.free), where.given(self.free)
        near = (params[free], params[free]) if free in params else self.within(where)[free]
        breather = cb.orbits.find_symmetric(free, near, root=root, **{**params, **on})
        if switched and breather.lattice.sites is not None:
            return cb.shooting(breather)
        return breather.problem_beyond(judged.verge(breather.lattice)).having(free)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class StepSizes:
    """Lengths of steps along a curve."""

    first: float | None = None
    """Length of the first step, 0.01 unless given."""
    smallest: float | None = None
    """Where a step would have to be shorter the curve ends, 1e-9 unless given."""
    largest: float | None = None
    """No step is longer; 0.1 unless given, on a boundary 0.02."""
    most: Whole | None = None
    """Number of steps after which the curve ends, in each direction; 2000 unless given."""

    def steps(self, **usual: Any) -> cb.Steps:
        """Make them as they were typed, the usual ones otherwise."""
        typed = {name: value for name, value in vars(self).items() if value is not None}
        return cb.Steps(**{**usual, **typed})


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Axes:
    """Columns that are drawn over each other."""

    x: str | None = None
    """Column of the figure's abscissa, the first parameter that varies unless given."""
    y: str | None = None
    """Column of its ordinate, the first unknown unless given, of a boundary the other parameter."""

    def check(self, figure: str | None) -> None:
        """Refuse columns where nothing is drawn."""
        if figure is None:
            self.refuse("nothing is drawn; name a figure, -o branch.png")

    def refuse(self, why: str) -> None:
        for option, name in vars(self).items():
            if name is not None:
                raise BadInput(f"--{option} {name}: {why}")

    def plot(self, *branches: cb.Branch) -> Any:
        return cb.plotting.plot(*branches, x=self.x, y=self.y)
