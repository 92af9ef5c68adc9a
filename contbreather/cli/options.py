"""Options that several commands share, and what is made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any
from unicodedata import normalize

from cyclopts import Parameter

from contbreather.errors import BadInput

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cyclopts import Token

    from contbreather.breathers import Breather
    from contbreather.continuation import Problem
    from contbreather.lattice import Forcing, Lattice


def whole_number(_: Any, tokens: Sequence[Token]) -> int:
    """A whole number as it was typed; the parser itself would round 2.5."""
    typed = tokens[0].value
    try:
        return int(typed)
    except ValueError:
        raise ValueError(f"{typed} is no whole number") from None


Json = Annotated[
    bool,
    Parameter(
        name="--json",
        negative="",
        help="Print one JSON object, in full precision.",
        show_default=False,
    ),
]
Csv = Annotated[
    str | None, Parameter(name="--csv", help="Write the numbers to this file, in full precision.")
]
Output = Annotated[
    str | None, Parameter(name=["--output", "-o"], help="Draw to this file: .png, .pdf or .svg.")
]
Sites = Annotated[
    int | None,
    Parameter(
        help="Also judge stability on a ring of so many sites, as the paper does.",
        converter=whole_number,
    ),
]
RingSites = Annotated[
    int | None,
    Parameter(
        help="A ring of so many sites in place of the infinite chain, stable by the paper's rule.",
        converter=whole_number,
    ),
]
Threshold = Annotated[
    float | None,
    Parameter(help="With --sites: modulus over a period beyond which it is unstable, 1.005 else."),
]
Window = Annotated[
    tuple[float, float] | None,
    Parameter(
        negative="",
        help="Lowest and highest value; 0 to 0.2499 for gamma, 0.01 to 0.999 for k unless given.",
        allow_leading_hyphen=True,
    ),
]

Root = Annotated[
    int,
    Parameter(
        help="Which solution of (11), by falling p, where there are several.",
        converter=whole_number,
    ),
]

HARMONIC = "-cos(t)"
ROUND = 1e-6  # a window that is wider than its parameter's by less is as good as the same
PARAMETERS = ("a", "gamma", "k")
MEANING = {
    "a": "the amplitude of the forcing",
    "gamma": "the coupling, in [0, 1/4)",
    "k": "the restitution coefficient, in [0, 1]",
}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Where:
    """Parameters of a breather as they were typed; those that were not are None."""

    a: Annotated[
        float | None, Parameter(help="Amplitude of the forcing.", allow_leading_hyphen=True)
    ] = None
    gamma: Annotated[
        float | None, Parameter(help="Coupling, in [0, 1/4).", allow_leading_hyphen=True)
    ] = None
    k: Annotated[
        float | None, Parameter(help="Restitution, in [0, 1].", allow_leading_hyphen=True)
    ] = None
    forcing: Annotated[
        str,
        Parameter(
            help="F(t)/a as a formula in t, antisymmetric over half the period 2 pi.",
            allow_leading_hyphen=True,
        ),
    ] = HARMONIC
    set: Annotated[
        tuple[str, ...],
        Parameter(
            help="NAME=VALUE of another letter in the formula.", negative="", show_default=False
        ),
    ] = ()

    @property
    def given(self) -> dict[str, float]:
        """a, gamma and k as far as they were given."""
        values = {name: getattr(self, name) for name in PARAMETERS}
        return {name: value for name, value in values.items() if value is not None}

    def need(self, *names: str) -> dict[str, float]:
        """The values of these, or say which is missing."""
        for name in names:
            if name not in self.given:
                raise BadInput(f"--{name} is missing: {MEANING[name]}")
        return {name: self.given[name] for name in names}

    def drive(self, free: tuple[str, ...] = ()) -> Forcing:
        """The forcing; letters that are free and have no value begin at 1."""
        from contbreather.lattice import Harmonic, Symbolic

        letters = dict(_assignment(text) for text in self.set)
        if self.forcing.replace(" ", "") == HARMONIC and not letters:
            return Harmonic()
        for name in free:
            if name not in PARAMETERS:
                letters.setdefault(name, 1.0)
        return Symbolic(self.forcing, **letters)


def _assignment(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = None
    if not equals or not name.strip().isidentifier() or number is None:
        raise BadInput(f"--set {text!r}: NAME=VALUE was wanted, for instance --set c=2.7")
    return normalize("NFKC", name.strip()), number  # as Python reads the names in a formula


def ring_of(sites: int | None, threshold: float | None) -> tuple[int, float] | None:
    """Sites and threshold of the paper's rule, if it was asked for."""
    if sites is None and threshold is None:
        return None
    if sites is None:
        raise BadInput("--threshold needs --sites: only on a ring is there a threshold")
    return sites, 1.005 if threshold is None else threshold


def lattice_by(sites: int | None, threshold: float | None) -> tuple[Lattice, float]:
    """The chain that was asked for, and the threshold of the paper's rule."""
    from contbreather.breathers.problem import PAPER
    from contbreather.lattice import InfiniteChain, Ring

    rule = ring_of(sites, threshold)
    return (InfiniteChain(), PAPER) if rule is None else (Ring(rule[0]), rule[1])


def lattice_entry(lattice: Lattice, threshold: float) -> dict[str, Any]:
    """The chain for JSON; nothing for the infinite one."""
    return {} if lattice.sites is None else {"sites": lattice.sites, "threshold": threshold}


def interval(
    name: str,
    window: tuple[float, float] | None,
    reach: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[float, float]:
    """The window of a parameter: what was typed, as far as it lies in `reach`, its domain else."""
    import math

    from contbreather.breathers.problem import DOMAIN
    from contbreather.breathers.zones import WINDOWS
    from contbreather.cli.output import note

    endless = (-math.inf, math.inf)
    if window is None:
        return WINDOWS.get(name, endless)
    low, high = (DOMAIN if reach is None else reach).get(name, endless)
    if not all(math.isfinite(bound) for bound in window) or not window[0] < window[1]:
        raise BadInput(
            f"window {window[0]:g} {window[1]:g} of {name}: two finite numbers were wanted, the "
            "smaller first"
        )
    inside = max(low, window[0]), min(high, window[1])
    if not inside[0] < inside[1]:
        raise BadInput(
            f"the window {window[0]:g} to {window[1]:g} contains no breather: {name} is "
            f"{MEANING.get(name, 'outside of it')}"
        )
    if max(abs(inside[0] - window[0]), abs(inside[1] - window[1])) > ROUND:
        note(
            f"of the window {window[0]:g} to {window[1]:g} of {name} only {inside[0]:g} to "
            f"{inside[1]:g} is looked at: {name} is {MEANING.get(name, 'bounded')}"
        )
    return inside


def known(name: str, forcing: Forcing) -> str:
    """The name of a parameter, or which there are."""
    names = (*PARAMETERS, *forcing.params)
    if name not in names:
        raise BadInput(f"unknown parameter {name!r}; there are {', '.join(names)}")
    return name


def check_values(values: dict[str, float]) -> None:
    """Refuse what no breather can have, before one is looked for."""
    from contbreather.lattice import check_gamma
    from contbreather.lattice.conditions import check_amplitude, restitution_ratio

    checks = {"a": check_amplitude, "gamma": check_gamma, "k": restitution_ratio}
    for name, value in values.items():
        checks[name](value)


def rooted(found: Sequence[Breather], root: int) -> Breather:
    """The solution with that number, or which there are."""
    if not 1 <= root <= len(found):
        there = ", ".join(f"{i}: p = {one.p:.9g}" for i, one in enumerate(found, start=1))
        raise BadInput(f"--root {root}: the solutions of (11) are {there}; choose one of them")
    return found[root - 1]


def first_in(
    free: str,
    window: tuple[float, float],
    values: dict[str, float],
    forcing: Forcing,
    *,
    root: int = 1,
    lattice: Lattice | None = None,
) -> Breather:
    """An admissible breather somewhere in the window of the free parameter.

    Raises
    ------
    BadInput
        If there is none, with the reason at the last place that was looked at.
    """
    from contbreather.breathers import symmetric_roots
    from contbreather.errors import NoSolution

    reason = ""
    for value in _places(free, window, values, forcing):
        own = {**values, free: value}
        drive = forcing.at(**{free: value}) if free in forcing.params else forcing
        try:
            found = symmetric_roots(
                own["a"], own["gamma"], own["k"], forcing=drive, lattice=lattice
            )
        except NoSolution as error:
            reason = str(error)
            continue
        try:
            breather = rooted(found, root)
        except BadInput as error:
            reason = f"at {free} = {value:.6g} {error}"
            continue
        verdict = breather.admissibility()
        if verdict.ok:
            return breather
        reason = f"at {free} = {value:.6g} {verdict.reason}"
    fixed = ", ".join(f"{name} = {value:g}" for name, value in values.items() if name != free)
    raise BadInput(
        f"no breather with {fixed} for {free} between {window[0]:g} and {window[1]:g}: {reason}"
    )


def _places(
    free: str, window: tuple[float, float], values: dict[str, float], forcing: Forcing
) -> list[float]:
    """Where to look for a breather in a window: first next to the fold, then evenly spread."""
    import numpy as np

    from contbreather.breathers import smallest_amplitude

    low, high = window
    if free == "a":
        fold = smallest_amplitude(values["gamma"], values["k"], forcing)
        high = min(high, max(1.0, 2.0 * low))
        near = [factor * fold for factor in (1.5, 1.1, 1.01) if low <= factor * fold <= high]
    else:
        near = [values[free]] if free in values else []
        low, high = max(low, -10.0), min(high, 10.0)
    spread = np.linspace(low, high, 41)[[*range(1, 41, 2), *range(0, 41, 2)]].tolist()
    return [value for value in (*near, *spread) if free != "a" or value > 0.0]


def start_in(
    free: str | None, where: Where, window: tuple[float, float] | None, sites: int | None
) -> tuple[Breather | Problem, str, tuple[float, float]]:
    """Where a branch begins: a breather, on a ring the orbit that was shot from it.

    Returns
    -------
    start, forcing, window
        The forcing as a sentence, the window within the domain.
    """
    if free is None:
        raise BadInput("--free is missing: which parameter is to vary, a, gamma or k?")
    forcing = where.drive((free,))
    known(free, forcing)
    fixed = where.need(*(name for name in PARAMETERS if name != free))
    span = interval(free, window)
    start = first_in(free, around(free, where.given.get(free), span), fixed, forcing)
    if sites is None:
        return start, forcing.describe(), span
    from contbreather.breathers.shooting import shooting

    return shooting(start, sites=sites), forcing.describe(), span


def around(free: str, start: float | None, span: tuple[float, float]) -> tuple[float, float]:
    """Where to look for a start: at the value that was given, else in the whole window."""
    if start is None:
        return span
    if not span[0] <= start <= span[1]:
        raise BadInput(f"{free} = {start:g} is outside of the window {span[0]:g} to {span[1]:g}")
    return start, start
