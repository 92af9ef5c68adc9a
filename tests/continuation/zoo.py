"""Problems with known answers. Every test of the engine that can takes all of them.

A `Case` knows all its special points, in the order in which a walk from the low end to the high
end meets them, from a road that is not the engine's: a formula, or 30 digits of mpmath.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from contbreather.continuation import (
    Branch,
    Event,
    Point,
    Problem,
    Steps,
    Stop,
    branch_point,
    fold,
    hopf,
    trace,
)
from contbreather.continuation.bifurcations.maps import FixedPoint

Array = NDArray[np.float64]
Known = tuple[str, Mapping[str, float]]  # kind, and values by name

STATIC = (fold(), branch_point())
ALL = (fold(), branch_point(), hopf())


@dataclass(frozen=True)
class Case:
    """A curve and everything there is to find on it."""

    name: str
    problem: Problem
    free: str
    known: tuple[Known, ...]
    within: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    events: tuple[Event, ...] = ALL
    accuracy: float = 1e-12
    largest: float = 0.1  # steps at which the curve is walked; tests take other sizes too
    stop: Stop = Stop.BOUND

    @cached_property
    def branch(self) -> Branch:
        """The whole curve with steps of its size."""
        return trace_case(self)


# --- one unknown ------------------------------------------------------------------------------


def scalar(
    equation: Callable[[Array, Mapping[str, float]], float],
    x: float,
    params: Mapping[str, float],
    **given: object,
) -> Problem:
    """A problem with one unknown ``x``."""
    return Problem(lambda u, p: np.array([equation(u[0], p)]), {"x": x}, params, **given)


def rotated(u: Sequence[Any], angle: float) -> list[Any]:
    """A vector of the plane turned by an angle, in a map of anybody."""
    (x, y), c, s = u, math.cos(angle), math.sin(angle)
    return [c * x - s * y, s * x + c * y]


def knowing(problem: Problem, **methods: Callable[..., object]) -> Problem:
    """The same equations in a class of their own, which has these methods."""
    derived = type("Mine", (Problem,), {n: staticmethod(method) for n, method in methods.items()})
    return derived(**{own.name: getattr(problem, own.name) for own in fields(Problem)})


CIRCLE = Case(
    "circle",
    scalar(lambda x, p: x**2 + p["mu"] ** 2 - 1, 1.0, {"mu": 0.0}),
    "mu",
    (("LP", {"x": 0.0, "mu": -1.0}), ("LP", {"x": 0.0, "mu": 1.0})),
    stop=Stop.CLOSED,
)


def cusp_surface(x: float, mu: float) -> Problem:
    """``h + mu x - x^3``, started on its surface."""
    return scalar(lambda x, p: p["h"] + p["mu"] * x - x**3, x, {"mu": mu, "h": x**3 - mu * x})


TIP = 1 / math.sqrt(3)  # of its folds for mu = 1
CUSP = Case(
    "cusp",
    cusp_surface(-0.9, 1.0),
    "h",
    (("LP", {"x": -TIP, "h": 2 * TIP**3}), ("LP", {"x": TIP, "h": -2 * TIP**3})),
    within={"x": (-2.0, 2.0)},
)

ISOLA = Case(  # with X = x^2, L = l^2: L = 1 - X -+ sqrt(0.8 - 4X), folds where X = 0
    "isola",
    scalar(
        lambda x, p: (p["l"] ** 2 + x**2) ** 2 - 2 * (p["l"] ** 2 - x**2) + 0.2,
        0.3,
        {"l": math.sqrt(1 - 0.09 + math.sqrt(0.8 - 0.36))},
    ),
    "l",
    (
        ("LP", {"x": 0.0, "l": math.sqrt(1 - math.sqrt(0.8))}),
        ("LP", {"x": 0.0, "l": math.sqrt(1 + math.sqrt(0.8))}),
    ),
    stop=Stop.CLOSED,
)


def crowded(eps: float) -> Case:
    """``x (l - x^3 + eps x) = 0`` on its second factor: two folds around a branch point."""
    x = math.sqrt(eps / 3)
    high = 2 * x**3
    return Case(
        f"crowded {eps:g}",
        scalar(lambda x, p: x * (p["l"] - x**3 + eps * x), 1.0, {"l": 1 - eps}),
        "l",
        (("LP", {"x": -x, "l": high}), ("BP", {"x": 0.0, "l": 0.0}), ("LP", {"x": x, "l": -high})),
        within={"x": (-1.0, 1.0)},
    )


PITCHFORK = Case(
    "pitchfork, on the axis",
    scalar(lambda x, p: x * (p["mu"] - x**2), 0.0, {"mu": -0.7}),
    "mu",
    (("BP", {"x": 0.0, "mu": 0.0}),),
    within={"mu": (-1.0, 1.0)},
)

ARMS = Case(
    "pitchfork, on the arms",
    scalar(lambda x, p: x * (p["mu"] - x**2), -0.8, {"mu": 0.64}),
    "mu",
    (("BP", {"x": 0.0, "mu": 0.0}),),
    within={"x": (-1.0, 1.0)},
)

TRANSCRITICAL = Case(
    "transcritical",
    scalar(lambda x, p: x * (p["mu"] - x) * (2 + x), -0.5, {"mu": -0.5}),
    "mu",
    (("BP", {"x": 0.0, "mu": 0.0}),),
    within={"mu": (-1.0, 1.0)},
)


def imperfect(h: float) -> tuple[Case, Case]:
    """``x (mu - x^2) + h = 0``: two curves that no longer cross, a fold on one of them."""
    equation = scalar(lambda x, p: x * (p["mu"] - x**2) + p["h"], 1.0, {"mu": 1 - h, "h": h})
    x = -((h / 2) ** (1 / 3))
    return (
        Case(f"imperfect {h:g}, above", equation, "mu", (), within={"mu": (-1.0, 1.5)}),
        Case(
            f"imperfect {h:g}, below",
            equation.at(x=-1.0, mu=1 + h),
            "mu",
            (("LP", {"x": x, "mu": 3 * x * x}),),
            within={"x": (-1.2, 1.0), "mu": (-2.0, 1.5)},
        ),
    )


def circle_on_axis(x: float, p: Mapping[str, float]) -> float:
    """``x (x^2 + mu^2 - 1)``: a circle across the axis."""
    return x * (x**2 + p["mu"] ** 2 - 1)


LINE = Case(
    "line",
    scalar(lambda x, p: x - 2 * p["mu"], 0.0, {"mu": 0.0}),
    "mu",
    (),
    within={"mu": (-1.0, 1.0)},
)


def logistic(x: float = 0.6, r: float = 2.5, **more: Any) -> Problem:
    return FixedPoint(lambda x, p: p["r"] * x * (1 - x), {"x": x}, {"r": r}, **more)


STIFF = Case(  # the cusp again, its unknown in millions and its parameter in millionths
    "stiffly scaled",
    scalar(
        lambda x, p: 1e6 * p["h"] + 1e-6 * x - (1e-6 * x) ** 3,
        -0.9e6,
        {"h": 1e-6 * (0.9 - 0.9**3)},
        scales={"x": 1e6, "h": 1e-6},
    ),
    "h",
    tuple((k, {"x": 1e6 * at["x"], "h": 1e-6 * at["h"]}) for k, at in CUSP.known),
    within={"x": (-2e6, 2e6)},
)

# --- several unknowns -------------------------------------------------------------------------


def brusselator() -> Problem:
    def residual(u: Array, p: Mapping[str, float]) -> Array:
        x, y = u
        return np.array([p["A"] - (p["B"] + 1) * x + x * x * y, p["B"] * x - x * x * y])

    return Problem(residual, {"X": 1.0, "Y": 1.0}, {"A": 1.0, "B": 1.0})


BRUSSELATOR = Case(
    "brusselator",
    brusselator(),
    "B",
    (("HB", {"X": 1.0, "Y": 2.0, "B": 2.0}),),
    within={"B": (0.1, 5.0)},
)


def _lorenz() -> Case:
    s, b = 10.0, 8 / 3

    def residual(u: Array, p: Mapping[str, float]) -> Array:
        x, y, z = u
        return np.array([s * (y - x), x * (p["r"] - z) - y, x * y - b * z])

    x = math.sqrt(b * 19)
    r = s * (s + b + 3) / (s - b - 1)
    there = math.sqrt(b * (r - 1))
    return Case(
        "lorenz",
        Problem(residual, {"x": x, "y": x, "z": 19.0}, {"r": 20.0}),
        "r",
        (
            ("HB", {"x": -there, "z": r - 1, "r": r}),
            ("BP", {"x": 0.0, "y": 0.0, "z": 0.0, "r": 1.0}),
            ("HB", {"x": there, "z": r - 1, "r": r}),
        ),
        within={"x": (-9.0, 9.0)},
        largest=0.5,
    )


LORENZ = _lorenz()

NEUTRAL_SADDLE = Case(  # eigenvalues 1 + m and 2m - 1 add up to nothing at m = 0, and are real
    "neutral saddle",
    Problem(
        lambda u, p: np.array(
            [(1 + p["m"]) * u[0] + u[1] ** 2, (2 * p["m"] - 1) * u[1] + u[0] ** 2]
        ),
        {"x": 0.0, "y": 0.0},
        {"m": -0.3},
    ),
    "m",
    (),
    within={"m": (-0.4, 0.4)},
)


def takens() -> Problem:
    """Normal form of Bogdanov and Takens; LP on ``b1 = b2^2/4``, HB on ``b1 = 0, b2 < 0``."""

    def residual(u: Array, p: Mapping[str, float]) -> Array:
        x, y = u
        return np.array([y, p["b1"] + p["b2"] * x + x * x + x * y])

    x = 0.5 + math.sqrt(0.25 + 0.05)  # of b1 - x + x^2 = 0
    return Problem(residual, {"x": x, "y": 0.0}, {"b1": -0.05, "b2": -1.0})


TAKENS = Case(
    "takens",
    takens(),
    "b1",
    (("LP", {"x": 0.5, "b1": 0.25}), ("HB", {"x": 0.0, "b1": 0.0})),
    within={"b1": (-1.0, 1.0)},
)


# --- Bratu: u'' + lam exp(u) = 0 ----------------------------------------------------------------


@cache
def bratu_fold() -> float:
    """``lam = 8 theta^2 / cosh(theta)^2`` is largest where ``theta tanh(theta) = 1``."""
    with mpmath.workdps(30):
        theta = mpmath.findroot(lambda t: t * mpmath.tanh(t) - 1, 1.2)
        return float(8 * theta**2 / mpmath.cosh(theta) ** 2)


def chebyshev(n: int) -> Array:
    """Second derivative on the inner Chebyshev nodes of (0, 1)."""
    x = np.cos(np.pi * np.arange(n + 1) / n)
    ends = np.r_[2.0, np.ones(n - 1), 2.0] * (-1.0) ** np.arange(n + 1)
    first = np.outer(ends, 1 / ends) / (x[:, None] - x + np.eye(n + 1))
    first -= np.diag(first.sum(axis=1))
    return 4 * (first @ first)[1:-1, 1:-1]


def bratu(second: Array, **given: object) -> Problem:
    def residual(u: Array, p: Mapping[str, float]) -> Array:
        return second @ u + p["lam"] * np.exp(u)

    return Problem(residual, {"u": np.zeros(len(second))}, {"lam": 0.0}, **given)


def ignition(
    second: Array, weights: Array | float = 1.0, unit: float = 1.0, **start: Any
) -> Problem:
    """``u'' + lam exp(u / (1 + eps u))`` with u = unit v: its two folds meet."""

    def residual(v: Array, p: Mapping[str, float]) -> Array:
        u = unit * v
        return weights * (second @ u + p["lam"] * np.exp(u / (1 + p["eps"] * u)))

    def jacobian(v: Array, p: Mapping[str, float]) -> Array:
        inner = 1 + p["eps"] * unit * v
        slope = second + np.diag(p["lam"] * np.exp(unit * v / inner) / inner**2)
        return unit * np.reshape(weights, (-1, 1)) * slope

    params = {"lam": 0.0, "eps": 0.0, **start}
    u = {"u": np.full(len(second), params.pop("u", 0.0) / unit)}
    return Problem(residual, u, params, jacobian=jacobian, scales={"u": 1 / unit})


BRATU = Case(  # far up, beyond this window, 20 nodes no longer resolve the solution
    "bratu",
    bratu(chebyshev(20)).at(lam=1.0),
    "lam",
    (("LP", {"lam": bratu_fold()}),),
    within={"lam": (1.0, 5.0)},
    accuracy=1e-10,
    largest=0.3,
)


# --- all of them ------------------------------------------------------------------------------

SMALL = (
    CIRCLE,
    CUSP,
    ISOLA,
    crowded(1e-2),
    crowded(1e-4),
    PITCHFORK,
    ARMS,
    TRANSCRITICAL,
    *imperfect(1e-2),
    *imperfect(1e-5),
    LINE,
    STIFF,
    BRUSSELATOR,
    LORENZ,
    NEUTRAL_SADDLE,
    TAKENS,
)
ZOO = (*SMALL, BRATU)


def trace_case(case: Case, scale: float = 1.0, first: float = 0.1, **given: Any) -> Branch:
    """The whole curve of a case, with steps `scale` times as long as usual."""
    largest = case.largest * scale
    how = {
        "within": case.within,
        "events": case.events,
        "steps": Steps(first=first * largest, largest=largest, most=20000),
    }
    return trace(given.pop("start", case.problem), case.free, **{**how, **given})


@dataclass
class Counted:
    """A residual that counts its calls, and does what Ctrl-C does at one of them."""

    residual: Callable[..., Array]
    calls: int = 0
    interrupted: float = math.inf

    def __call__(self, x: Array, params: Mapping[str, float]) -> Array:
        self.calls += 1
        if self.calls == self.interrupted:
            raise KeyboardInterrupt
        return self.residual(x, params)


def counted(problem: Problem) -> tuple[Problem, Counted]:
    counter = Counted(problem.residual)
    return replace(problem, residual=counter), counter


def printed(thing: Any, width: int = 200) -> str:
    """What a console without colours shows."""
    console = Console(file=io.StringIO(), width=width)
    console.print(thing)
    return console.file.getvalue()


def events_of(branch: Branch) -> list[Point]:
    """The special points without the ends."""
    return [point for point in branch.special if point.kind not in ("EP", "MX")]


def wrong(case: Case, branch: Branch) -> str:
    """What a branch of the whole curve has too much, too little or too far off: empty if nothing.

    A curve may be walked either way, a closed one from anywhere on it.
    """
    found = events_of(branch)
    turns = range(max(len(found), 1)) if case.stop is Stop.CLOSED else (0,)
    orders = [[*one[i:], *one[:i]] for one in (found, found[::-1]) for i in turns]
    misses = [_misses(case, order) for order in orders]
    if branch.stop is not case.stop:
        return f"{branch!r} stops otherwise"
    return "" if "" in misses else min(misses, key=len)


def _misses(case: Case, found: Sequence[Point]) -> str:
    kinds, wanted = [point.kind for point in found], [kind for kind, _ in case.known]
    if kinds != wanted:
        return f"found {kinds}, wanted {wanted}"
    for point, (_, values) in zip(found, case.known, strict=True):
        for name, value in values.items():
            size = max(case.problem.scales.get(name, 1.0), abs(value))
            if not abs(point[name] - value) <= case.accuracy * size:
                return f"{point!r}: {name} is off by {point[name] - value:.2g}"
    return ""
