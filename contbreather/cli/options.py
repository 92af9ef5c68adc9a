"""Options that several commands share, and what is made of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple
from unicodedata import normalize

from cyclopts import Parameter

from contbreather.cli.lattices import lattice_by, walls_by
from contbreather.errors import BadInput

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cyclopts import Token

    from contbreather.continuation import Problem
    from contbreather.lattice import Forcing


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
        help="Short for --lattice ring:N; stable by the paper's rule.",
        converter=whole_number,
    ),
]
Threshold = Annotated[
    float | None,
    Parameter(
        help="On finite lattices: modulus over a period beyond which it is unstable, 1.005 unless "
        "given."
    ),
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
NAMES = (*PARAMETERS, "damping", "spring")
MEANING = {
    "a": "the amplitude of the forcing",
    "gamma": "the coupling, in [0, 1/4)",
    "k": "the restitution coefficient, in [0, 1]",
    "damping": "at least 0",
    "spring": "at least 0",
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
    lattice: Annotated[
        str | None,
        Parameter(
            help="ring:20, open:9, open:9:fixed, grid:5x5, grid:5x5:periodic, a stiffness matrix "
            "in a .csv, a graph in a .graphml; the infinite chain unless given."
        ),
    ] = None
    site: Annotated[
        int, Parameter(help="The site that impacts.", converter=whole_number, show_default=False)
    ] = 0
    damping: Annotated[
        float | None, Parameter(help="Linear damping of every site.", allow_leading_hyphen=True)
    ] = None
    spring: Annotated[
        float | None, Parameter(help="On-site stiffness.", allow_leading_hyphen=True)
    ] = None
    walls: Annotated[
        tuple[str, ...],
        Parameter(
            help="LOW,HIGH of all sites, or SITE:LOW,HIGH of one, once for each; a wall that is "
            "not there is none. -1,1 unless given.",
            negative="",
            allow_leading_hyphen=True,
            show_default=False,
        ),
    ] = ()
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
        """The parameters as far as they were given."""
        values = {name: getattr(self, name) for name in NAMES}
        return {name: value for name, value in values.items() if value is not None}

    def need(self, *names: str) -> dict[str, float]:
        """The values that were given, or which of these is missing."""
        for name in names:
            if name not in self.given:
                raise BadInput(f"--{name} is missing: {MEANING[name]}")
        return self.given

    def drive(self, free: tuple[str, ...] = ()) -> Forcing:
        """The forcing; letters that are free and have no value begin at 1."""
        from contbreather.lattice import Harmonic, Symbolic

        letters = dict(_assignment(text) for text in self.set)
        if self.forcing.replace(" ", "") == HARMONIC and not letters:
            return Harmonic()
        for name in free:
            if name not in NAMES:
                letters.setdefault(name, 1.0)
        return Symbolic(self.forcing, **letters)

    def on(self, sites: int | None, threshold: float | None, free: tuple[str, ...] = ()) -> On:
        """What it lives on, and is judged by."""
        from contbreather.stability.verdict import THRESHOLD

        lattice = lattice_by(self.lattice, sites)
        if threshold is not None and lattice.sites is None:
            raise BadInput(
                "--threshold needs --sites or --lattice: only finite lattices have a threshold"
            )
        more = {"site": self.site, "walls": walls_by(self.walls, lattice.sites)}
        rule = THRESHOLD if threshold is None else threshold
        return On(lattice, rule, self.drive(free), more)


class On(NamedTuple):
    """What a breather lives on: its lattice with a threshold, the forcing, site and walls."""

    lattice: Any
    threshold: float
    forcing: Forcing
    more: dict[str, Any]

    @property
    def given(self) -> dict[str, Any]:
        """As `symmetric` takes it."""
        return {"lattice": self.lattice, "forcing": self.forcing, **self.more}

    @property
    def reach(self) -> dict[str, tuple[float, float]]:
        """The domain of each parameter that has one."""
        from contbreather.breathers.symmetric import DOMAIN

        own = {"damping": (0.0, math.inf), "spring": (0.0, math.inf)}
        if getattr(self.lattice, "highest_gamma", 0.0) == math.inf:
            own["gamma"] = (0.0, math.inf)
        return {**DOMAIN, **own}

    def entry(self) -> dict[str, Any]:
        """For JSON; of the infinite chain the forcing alone."""
        about: dict[str, Any] = {"forcing": self.forcing.describe()}
        if self.lattice.sites is not None:
            about |= {"lattice": self.lattice.describe(), "sites": self.lattice.sites}
            about |= {"threshold": self.threshold, **self.more}
        return about


def _assignment(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = None
    if not equals or not name.strip().isidentifier() or number is None:
        raise BadInput(f"--set {text!r}: NAME=VALUE was wanted, for instance --set c=2.7")
    return normalize("NFKC", name.strip()), number  # as Python reads the names in a formula


def interval(
    name: str,
    window: tuple[float, float] | None,
    reach: Mapping[str, tuple[float, float]],
) -> tuple[float, float]:
    """What was typed, as far as it lies in `reach`; by default all that is looked at."""
    from contbreather.breathers.search import window_of
    from contbreather.cli.output import note

    if window is None:
        return window_of(name)
    low, high = reach.get(name, (-math.inf, math.inf))
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
    names = (*NAMES, *forcing.params)
    if name not in names:
        raise BadInput(f"unknown parameter {name!r}; there are {', '.join(names)}")
    return name


class Beginning(NamedTuple):
    """Where a branch begins: the breather, what it lives on, and the window of `free`."""

    breather: Any
    on: On
    free: str
    window: tuple[float, float]


def beginning(
    free: str | None,
    where: Where,
    window: tuple[float, float] | None,
    sites: int | None,
    threshold: float | None = None,
    root: int = 1,
) -> Beginning:
    """At the value of the free parameter if one is given, or somewhere in its window."""
    from contbreather.breathers import find_symmetric

    if free is None:
        raise BadInput("--free is missing: which parameter is to vary, a, gamma or k?")
    on = where.on(sites, threshold, (free,))
    known(free, on.forcing)
    given = where.need(*(name for name in PARAMETERS if name != free))
    span = interval(free, window, on.reach)
    near = span
    if free in given:
        near = given[free], given[free]
        if not span[0] <= near[0] <= span[1]:
            raise BadInput(
                f"{free} = {near[0]:g} is outside of the window {span[0]:g} to {span[1]:g}"
            )
    return Beginning(find_symmetric(free, near, root=root, **given, **on.given), on, free, span)


def shot(
    free: str | None, where: Where, window: tuple[float, float] | None, sites: int | None
) -> tuple[Problem, Beginning]:
    """Equations that a branch can be switched from: on finite lattices those of shooting."""
    from contbreather.breathers.search import problem_with
    from contbreather.breathers.shooting import shooting

    start = beginning(free, where, window, sites)
    if start.on.lattice.sites is None:
        return problem_with(start.breather), start
    return shooting(start.breather), start
