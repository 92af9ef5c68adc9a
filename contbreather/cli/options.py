"""Options that several commands share, and what is made of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar
from unicodedata import normalize

from cyclopts import Parameter

import contbreather as cb
from contbreather.cli.output import OWN, inform, model_entry
from contbreather.errors import BadInput
from contbreather.parameters import CHOICES, NAMES, NEEDED, NUMBERS, window_of

if TYPE_CHECKING:
    from cyclopts import Token

HARMONIC: str = CHOICES["forcing"].default
Span = tuple[float, float]
T = TypeVar("T")
ROUND = 1e-6  # a window that is wider than its parameter's by less is as good as the same


def whole_number(_: Any, tokens: Sequence[Token]) -> int:
    """A whole number as it was typed; the parser itself would round 2.5."""
    typed = tokens[0].value
    try:
        return int(typed)
    except ValueError:
        raise ValueError(f"{typed} is not a whole number") from None


def some_workers(kind: Any, tokens: Sequence[Token]) -> int:
    """How many processes."""
    if (count := whole_number(kind, tokens)) < 1:
        raise ValueError(f"{count}: at least one process was expected")
    return count


Whole = Annotated[int, Parameter(converter=whole_number)]
Workers = Annotated[int, Parameter(converter=some_workers)]


def parameter_help(name: str) -> Parameter:
    """What help says of a parameter of the model."""
    return Parameter(help={**NUMBERS, **CHOICES}[name].help)


def looked_at(name: str) -> Parameter:
    """What help says of its window."""
    number = NUMBERS[name]
    words = f"Lowest and highest {number.meaning} to look at, {_usual(name)} unless given"
    return Parameter(help=f"{words}{number.window_reason}.")


def _usual(name: str) -> str:
    low, high = window_of(name)
    return "all" if high == math.inf else f"{low:g} to {high:g}"


_WINDOWS = f"{_usual('gamma')} for gamma, {_usual('k')} for k"
Window = Annotated[
    Span | None, Parameter(help=f"Lowest and highest value; {_WINDOWS} unless given.")
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LatticeOptions:
    """What breathers live on, and what drives them, as it was typed.

    Parameters
    ----------
    sites
        A ring of so many sites in place of the infinite chain, judged by the paper's rule.
    threshold
        On finite lattices: modulus over a period beyond which it is unstable, 1.005 unless given.
    set
        NAME=VALUE of a parameter in the formula.
    """

    damping: Annotated[float | None, parameter_help("damping")] = None
    spring: Annotated[float | None, parameter_help("spring")] = None
    lattice: Annotated[str | None, parameter_help("lattice")] = None
    sites: Whole | None = None
    threshold: float | None = None
    site: Annotated[Whole, parameter_help("site")] = CHOICES["site"].default
    walls: Annotated[
        tuple[str, ...], Parameter(allow_leading_hyphen=True), parameter_help("walls")
    ] = ()
    forcing: Annotated[str, Parameter(allow_leading_hyphen=True), parameter_help("forcing")] = (
        HARMONIC
    )
    set: tuple[str, ...] = ()

    @property
    def read(self) -> dict[str, str | None]:
        """The file that the lattice is in."""
        return {"--lattice": self.lattice}

    def on(self, *free: str) -> ModelArguments:
        """What it lives on, and is judged by; letters of the forcing that are free and have no
        value begin at 1."""
        from contbreather.lattice.formula import forcing_of
        from contbreather.lattice.parse import lattice_by, walls_by
        from contbreather.stability.verdict import THRESHOLD

        lattice = lattice_by(self.lattice, self.sites)
        if self.threshold is not None and lattice.sites is None:
            raise BadInput(
                "--threshold needs --sites or --lattice: only finite lattices have a threshold"
            )
        wanted = "NAME=VALUE was expected, for instance --set c3=2.7"
        letters = assigned("--set", self.set, _a_number, wanted)
        if letters or self.forcing.replace(" ", "") != HARMONIC:
            letters |= {name: 1.0 for name in free if name not in (*NAMES, *letters)}
        forcing = forcing_of(self.forcing, **letters)
        names = (*NAMES, *forcing.params)
        for name in free:
            if name not in names:
                raise BadInput(f"unknown parameter {name!r}; there are {', '.join(names)}")
        threshold = THRESHOLD if self.threshold is None else self.threshold
        walls = walls_by(self.walls, lattice.sites)
        given = {"lattice": lattice, "forcing": forcing, "site": self.site, "walls": walls}
        return ModelArguments(lattice, threshold, given)


@dataclass(frozen=True, kw_only=True)
class _Needed:
    a: Annotated[float | None, parameter_help("a")] = None
    gamma: Annotated[float | None, parameter_help("gamma")] = None
    k: Annotated[float | None, parameter_help("k")] = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ModelOptions(LatticeOptions, _Needed):  # fields of the last base come first
    """Parameters and lattice of a breather as they were typed.

    Parameters
    ----------
    sites
        Short for --lattice ring:N; of a point, that ring as well.
    """

    @property
    def given(self) -> dict[str, float]:
        """The parameters as far as they were given."""
        values = {name: getattr(self, name) for name in NAMES}
        return {name: value for name, value in values.items() if value is not None}

    def need(self, *names: str) -> dict[str, float]:
        """The values that were given, or which of these is missing."""
        for name in names:
            if name not in self.given:
                raise BadInput(f"--{name} is missing: {_meaning(name)}")
        return self.given


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ZoneOptions(LatticeOptions):
    """Windows of zone diagrams, and what their breathers live on.

    Parameters
    ----------
    past_folds
        With the lower breathers, too, those behind a fold: all unstable, but they may exist where
        no upper one does.
    """

    gamma_window: Annotated[Span | None, looked_at("gamma")] = None
    a_window: Annotated[Span | None, looked_at("a")] = None
    k_window: Annotated[Span | None, looked_at("k")] = None
    past_folds: bool = False

    @property
    def within(self) -> dict[str, Span]:
        """The windows that were given."""
        typed = {name: getattr(self, f"{name}_window") for name in NEEDED}
        reach = {name: window_of(name) for name in NEEDED}
        return {name: typed_interval(name, span, reach) for name, span in typed.items() if span}

    def options(self, on: ModelArguments) -> dict[str, Any]:
        """All of it as `zones` takes it."""
        losses = {"damping": self.damping or 0.0, "spring": self.spring}
        how = {"past_folds": self.past_folds, "within": self.within, "threshold": self.threshold}
        return {**on.given, **how, **losses}


class ModelArguments(NamedTuple):
    """What a breather lives on: its lattice with a threshold, and all as `symmetric` takes it."""

    lattice: Any
    threshold: float
    given: dict[str, Any]

    @property
    def reach(self) -> dict[str, Span]:
        """The domain of each parameter that has one."""
        reach = {name: number.domain for name, number in NUMBERS.items()}
        if getattr(self.lattice, "highest_gamma", 0.0) == math.inf:
            reach["gamma"] = (0.0, math.inf)
        return reach

    def entry(self) -> dict[str, Any]:
        """For JSON."""
        from contbreather.lattice.conditions import Walls

        given, walls = self.given, Walls.given(self.given["walls"])
        return model_entry(given["forcing"], self.lattice, self.threshold, given["site"], walls)


def assigned(
    option: str, typed: Iterable[str], read: Callable[[str, str], T | None], wanted: str
) -> dict[str, T]:
    """What was typed as NAME=VALUE, each name once, as Python reads those in a formula."""
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


def _meaning(name: str) -> str:
    return f"the {NUMBERS[name].meaning}, {NUMBERS[name].span}" if name in NUMBERS else "bounded"


def typed_interval(name: str, window: Span | None, reach: Mapping[str, Span]) -> Span:
    """What was typed, as far as it lies in `reach`; by default all that is looked at."""
    if window is None:
        return window_of(name)
    low, high = reach.get(name, (-math.inf, math.inf))
    typed = f"{window[0]:g} to {window[1]:g}"
    if not all(math.isfinite(bound) for bound in window) or not window[0] < window[1]:
        raise BadInput(
            f"window {typed} of {name}: two finite numbers were expected, the smaller first"
        )
    inside = max(low, window[0]), min(high, window[1])
    meaning = _meaning(name)
    if not inside[0] < inside[1]:
        raise BadInput(f"the window {typed} contains no breather: {name} is {meaning}")
    if max(abs(inside[0] - window[0]), abs(inside[1] - window[1])) > ROUND:
        inform(
            f"of the window {typed} of {name} only {inside[0]:g} to {inside[1]:g} is looked at: "
            f"{name} is {meaning}"
        )
    return inside


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class BranchWindow:
    """What varies along a branch.

    Parameters
    ----------
    free
        Parameter to vary: a, gamma, k, damping, spring, or one of the forcing's.
    """

    free: str | None = None
    window: Window = None

    def start(self, where: ModelOptions, root: int | None = None) -> Start:
        """A breather at the value of the free parameter, if one is given, or in its window."""
        if self.free is None:
            raise BadInput("--free is missing: which parameter is to vary, a for instance?")
        free, on = self.free, where.on(self.free)
        params = where.need(*(name for name in NEEDED if name != free))
        span = typed_interval(free, self.window, on.reach)
        near = (params[free], params[free]) if free in params else span
        if not span[0] <= near[0] <= near[1] <= span[1]:
            raise BadInput(
                f"{free} = {near[0]:g} is outside of the window {span[0]:g} to {span[1]:g}"
            )
        breather = cb.orbits.find_symmetric(free, near, root=root, **{**params, **on.given})
        return Start(breather, on, free, {free: span})


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class StepSizes:
    """How long steps along a curve may be.

    Parameters
    ----------
    first
        Length of the first step, 0.01 unless given.
    smallest
        Where a step would have to be shorter the curve ends, 1e-9 unless given.
    largest
        No step is longer; 0.1 unless given, on a boundary 0.02.
    most
        Number of steps after which the curve ends, in each direction; 2000 unless given.
    """

    first: float | None = None
    smallest: float | None = None
    largest: float | None = None
    most: Whole | None = None

    def steps(self, **usual: Any) -> cb.Steps:
        """As they were typed, the usual ones otherwise."""
        typed = {name: value for name, value in vars(self).items() if value is not None}
        return cb.Steps(**{**usual, **typed})


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Axes:
    """What is drawn over what.

    Parameters
    ----------
    x
        Column of the figure's abscissa, the first parameter that varies unless given.
    y
        Column of its ordinate, the first unknown unless given, of a boundary the other parameter.
    """

    x: str | None = None
    y: str | None = None

    def check(self, figure: str | None, problem: cb.Problem | None = None, *more: str) -> None:
        """Refuse columns that a curve of the problem will not have, before it is computed."""
        for option, name in vars(self).items():
            if name is None:
                continue
            if figure is None:
                raise BadInput(f"--{option} {name}: nothing is drawn; name a figure, -o branch.png")
            if problem is None or problem.normed(name):
                continue
            names = (*problem.names, *problem.record, *more, *OWN)
            if name not in names:
                raise BadInput(f"--{option}: no column {name!r}; there are {', '.join(names)}")

    def plot(self, *branches: cb.Branch) -> Any:
        """The figure."""
        return cb.plotting.plot(*branches, x=self.x, y=self.y)


class Start(NamedTuple):
    """Where a branch begins: the breather, what it lives on, what varies, and its window."""

    breather: Any
    on: ModelArguments
    free: str
    within: dict[str, Span]

    @property
    def problem(self) -> cb.Problem:
        """Its equations, with all events."""
        from contbreather.orbits.start_search import problem_with

        return problem_with(self.breather, self.free, threshold=self.on.threshold)

    @property
    def shot(self) -> cb.Problem:
        """Equations that can be switched from: on finite lattices those of shooting."""
        from contbreather.stability.verdict import THRESHOLD

        if self.on.threshold != THRESHOLD:
            raise BadInput(
                f"--threshold {self.on.threshold:g}: branches that are switched to are judged by "
                f"the paper's {THRESHOLD}; leave it out"
            )
        return self.problem if self.on.lattice.sites is None else cb.shooting(self.breather)
