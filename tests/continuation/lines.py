"""Boundaries whose course is known, and what there is to meet on them.

A `Line` says where its first point is found, and all its meetings in the order of its first
parameter, each at a place that follows from its equations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from contbreather.continuation import Branch, Point, Problem, boundary, trace
from contbreather.continuation.bifurcations.maps import FixedPoint

from .zoo import ALL, Array, Known, cusp_surface, events_of, rotated, takens

Params = Mapping[str, float]
Field = Callable[[Array, Params], Sequence[Any]]
Window = Mapping[str, tuple[float, float]]

UNIT = {"b1": (-1.0, 1.0), "b2": (-1.0, 1.0)}
WIDE = {"b1": (-2.0, 2.0), "b2": (-2.0, 2.0)}
XY, XYZ = (dict.fromkeys(names, 0.0) for names in ("xy", "xyz"))


@dataclass(frozen=True, eq=False)
class Line:
    """A boundary through the point of a kind on a branch, and everything there is to find on it."""

    name: str
    problem: Problem
    free: str  # of the branch on which it begins
    kind: str
    pair: tuple[str, str]
    known: tuple[Known, ...] = ()
    within: Window | None = None  # of that branch
    window: Window | None = None
    course: Callable[[Branch], Array] | None = None  # vanishes along it
    doubtful: str = ""  # why what is not among the known might have been
    accuracy: float = 1e-12  # of its course

    @property
    def first(self) -> Point:
        within = self.within or {self.free: (-1.0, 1.0)}
        return trace(self.problem, self.free, within=within).first(self.kind)

    def from_(self, point: Point, **given: Any) -> Branch:
        window = self.window or {self.pair[0]: (-1.0, 1.0)}
        return boundary(point, self.pair, **{"within": window, **given})


@cache
def walked(line: Line) -> Branch:
    return line.from_(line.first)


def kinds(branch: Branch) -> list[str]:
    return [point.kind for point in events_of(branch)]


def at(point: Point, **values: float) -> None:
    for name, value in values.items():
        assert point[name] == pytest.approx(value, abs=1e-9), name


def flow(field: Field, start: Mapping[str, float], **params: float) -> Problem:
    return Problem(lambda u, p: np.array(field(u, p)), start, params, events=ALL)


def of_map(image: Field, start: Mapping[str, float], **params: float) -> Problem:
    return FixedPoint(lambda u, p: np.array(image(u, p)), start, params)


# --- flows ------------------------------------------------------------------------------------

TAKENS = replace(takens(), events=ALL)
BT = ("BT", {"x": 0, "y": 0, "b1": 0, "b2": 0, "a": 1, "b": 1})
TAKENS_LP = Line(
    "LP of takens", TAKENS, "b1", "LP", ("b2", "b1"), (BT,),
    window=WIDE, course=lambda line: 4 * line["b1"] - line["b2"] ** 2,
)  # fmt: skip
TAKENS_HB = Line(
    "HB of takens", TAKENS, "b1", "HB", ("b2", "b1"), (BT,),
    window=WIDE, course=lambda line: line["b1"],
)  # fmt: skip


def bautin(beside: float) -> Problem:
    """Normal form of Bautin: l1 = 2 b2, as |q| = 1 means x = sqrt(2) Re w; beside it a pair with
    real part ``b2 + beside``."""

    def field(u: Array, p: Params) -> list[Any]:
        x, y, z, w = u
        r, near = x * x + y * y, p["b2"] + beside
        grow = p["b1"] + p["b2"] * r - r * r
        return [grow * x - y, x + grow * y, near * z - 1.7 * w, 1.7 * z + near * w]

    return flow(field, dict.fromkeys("xyzw", 0.0), b1=-0.5, b2=-0.3)


def of_bautin(beside: float, *known: Known) -> Line:
    window = {"b2": (-0.5, 0.4)}
    return Line(
        f"bautin {beside:g}", bautin(beside), "b1", "HB", ("b2", "b1"), known, window=window,
        course=lambda line: line["b1"],
    )  # fmt: skip


BAUTIN = of_bautin(-0.2, ("GH", {"b1": 0, "b2": 0}), ("HH", {"b1": 0, "b2": 0.2}))
BAUTIN_AT_ONCE = of_bautin(0.0, ("HH", {"b1": 0, "b2": 0}))


def _fold_hopf(u: Array, p: Params) -> list[Any]:
    x, y, z = u
    grow = p["m2"] + z
    return [grow * x - y, x + grow * y, p["m1"] + z * z - x * x - y * y]


def of_fold_hopf(kind: str) -> Line:
    problem = flow(_fold_hopf, {"x": 0.0, "y": 0.0, "z": 0.5}, m1=-0.25, m2=0.2)
    known = ("ZH", {"z": 0, "m1": 0, "m2": 0, "omega": 1})
    within = {"m1": (-1.0, 1.0), "z": (-1.0, 1.0)}
    return Line(f"{kind} of fold-Hopf", problem, "m1", kind, ("m2", "m1"), (known,), within)


FOLD_HOPF = {kind: of_fold_hopf(kind) for kind in ("LP", "HB")}


def _two_pairs(u: Array, p: Params) -> Any:
    a, b, c, d = u
    r = np.array([a * a + b * b] * 2 + [c * c + d * d] * 2)
    linear = [p["m"] * a - b, a + p["m"] * b, p["k"] * c - 1.7 * d, 1.7 * c + p["k"] * d]
    return np.array(linear) - u * r


def symmetric_takens(u: Array, p: Params) -> list[Any]:
    x, y = u
    return [y, p["b1"] * x + p["b2"] * y - x**3 - x**2 * y]


def turning_beside_a_pitchfork(u: Array, p: Params) -> list[Any]:
    """HB at m = 0 where x = 0, at m = -l where x^2 = l."""
    x, y, z = u
    growth = p["m"] + x**2 - y**2 - z**2
    return [x * (p["l"] - x**2), growth * y - z, y + growth * z]


def _hopf_beside_a_pitchfork(x: float, l: float) -> Line:  # noqa: E741
    problem = flow(turning_beside_a_pitchfork, {**XYZ, "x": x}, l=l, m=-0.9)
    window = {"l": (-1.0, 1.0), "m": (-1.0, 1.0)}
    return Line(
        f"HB beside a pitchfork, l = {l:g}", problem, "m", "HB", ("l", "m"),
        (("HB-BP", {"l": 0, "m": 0}),), window=window,  # no ZH: the zero is no fold
    )  # fmt: skip


def _shifted(u: Array, p: Params) -> list[Any]:
    """``x = m^2`` meets ``x^2 = l - m^3 + y`` at ``l = m^3 + m^4 - y`` with y = m/(1 + x)."""
    x, y = u
    m = p["m"]
    return [(x - m**2) * (p["l"] - m**3 - x**2 + y), y * (1 + x) - m]


def _persisting(pair: tuple[str, str]) -> Line:
    def course(line: Branch) -> Array:
        m = line["m"]
        off = [line["x"] - m**2, line["l"] - (m**3 + m**4 - m / (1 + m**2)), 10 * line["split"]]
        return np.concatenate([*off, [m.min() + 1, m.max() - 1]])

    problem = flow(_shifted, {"x": 0.04, "y": 0.2 / 1.04}, l=-1.5, m=0.2)
    within, window = {"l": (-1.9, 1.0)}, {"m": (-1.0, 1.0), "l": (-3.0, 3.0)}
    return Line(
        f"BP in {pair}", problem, "l", "BP", pair, (), within, window, course, accuracy=1e-11
    )


def _transcritical(pair: tuple[str, str]) -> Line:
    problem = flow(lambda u, p: u * (p["l"] - u) + 0 * p["m"], {"x": 0.0}, l=-0.5, m=0.2)
    return Line(
        f"transcritical points in {pair}", problem, "l", "BP", pair,
        window={"m": (-1.0, 1.0), "l": (-1.0, 1.0)},
        course=lambda line: np.append(line["l"], np.ptp(line["m"]) - 2),
    )  # fmt: skip


def _of_one_equation(c: float) -> Line:
    """``m x + c x^2 - x^3``: at m = 0 for every c, where all of its derivative vanishes."""
    problem = flow(lambda u, p: p["m"] * u + p["c"] * u**2 - u**3, {"x": 0.0}, m=-1.0, c=c)
    return Line(
        f"BP of one equation, c = {c:g}", problem, "m", "BP", ("c", "m"),
        within={"m": (-2.0, 2.0)}, window={"c": (-3.0, 3.0)},
        course=lambda line: np.append(line["m"], [line[0]["c"] + 3, line[-1]["c"] - 3]),
    )  # fmt: skip


FLOWS = (
    TAKENS_LP,
    TAKENS_HB,
    Line(  # ``x' = y, y' = b1 + b2 x + x^2`` has b = 0: its double zero is no BT
        "degenerate double zero",
        flow(lambda u, p: [u[1], p["b1"] + p["b2"] * u[0] + u[0] ** 2], {"x": 1.0, "y": 0.0},
             b1=-2.0, b2=1.0),
        "b1", "LP", ("b2", "b1"), within={"b1": (-3.0, 1.0)}, window={"b2": (-2.0, 2.0)},
    ),
    Line(
        "cusp", replace(cusp_surface(-0.9, 1.0), events=ALL), "h", "LP", ("mu", "h"),
        (("CP", {"x": 0, "mu": 0, "h": 0, "c": -1}),), {"x": (-2.0, 2.0)}, {"mu": (-1.0, 2.0)},
        course=lambda line: 4 * line["mu"] ** 3 - 27 * line["h"] ** 2,
    ),
    Line(  # ``h + mu x + x^4``: where folds meet the cubic coefficient vanishes as well
        "quartic fold",
        flow(lambda u, p: p["h"] + p["mu"] * u + u**4, {"x": 1.0}, mu=1.0, h=-2.0),
        "h", "LP", ("mu", "h"), (), {"x": (-2.0, 2.0)}, {"mu": (-2.0, 2.0)},
        doubtful="touches zero",
    ),
    BAUTIN,
    BAUTIN_AT_ONCE,
    *FOLD_HOPF.values(),
    Line(  # eigenvalues 0, 1 + m and 2m - 1 on the whole fold curve: a sum vanishes at m = 0
        "neutral saddle on a fold curve",
        flow(lambda u, p: [p["h"] - u[0] ** 2, (1 + p["m"]) * u[1], (2 * p["m"] - 1) * u[2]],
             {"x": 0.5, "y": 0.0, "z": 0.0}, h=0.25, m=-0.3),
        "h", "LP", ("m", "h"), (), {"x": (-1.0, 1.0)}, {"m": (-0.4, 0.4)},
    ),
    Line(
        "two pairs", flow(_two_pairs, dict.fromkeys("abcd", 0.0), m=-0.25, k=0.2),
        "m", "HB", ("k", "m"), (("HH", {"m": 0, "k": 0}),),
    ),
    Line(  # ``+-i w`` with w through 0: a double zero with two eigenvectors is no BT
        "pair that touches zero",
        flow(lambda u, p: [p["m"] * u[0] - p["w"] * u[1] - u[0] * (u @ u),
                           p["w"] * u[0] + p["m"] * u[1] - u[1] * (u @ u)], XY, m=-0.5, w=-0.9),
        "m", "HB", ("w", "m"), course=lambda line: [line["w"][0] + 1, line["w"][-1] - 1],
        doubtful="touches zero",
    ),
    Line(  # on ``x^2 = b1`` it is ``b2 = b1``, with omega^2 = 2 b1: that only touches zero
        "other HB of a symmetric BT",
        flow(symmetric_takens, {"x": math.sqrt(0.5), "y": 0.0}, b1=0.5, b2=0.2),
        "b2", "HB", ("b1", "b2"), (("BT", {"b1": 0, "b2": 0}),), UNIT, UNIT,
        lambda line: line["b1"] - line["b2"],
    ),
    _hopf_beside_a_pitchfork(0.0, -0.5),
    _hopf_beside_a_pitchfork(math.sqrt(0.5), 0.5),
    Line(  # ``x (l + m x^2 - x^4)``: folds at l = -m^2/4 end at the quintic pitchfork l = m = 0
        "LP and BP",
        flow(lambda u, p: u * (p["l"] + p["m"] * u**2 - u**4), {"x": 1.1}, l=0.2541, m=1.0),
        "l", "LP", ("m", "l"), (("LP-BP", {"l": 0, "m": 0}),), {"l": (-1.0, 1.0), "x": (0.2, 2.0)},
        {"m": (-1.0, 1.5), "l": (-1.0, 1.0)}, lambda line: 4 * line["l"] + line["m"] ** 2,
        doubtful="the cubic coefficient vanishes as well",
    ),
    *map(_persisting, (("m", "l"), ("l", "m"))),
    _transcritical(("l", "m")),
    *map(_of_one_equation, (0.5, 0.5001)),
    Line(
        "BP of a symmetric BT", flow(symmetric_takens, XY, b1=-0.5, b2=-0.5),
        "b1", "BP", ("b2", "b1"), (("BT", {"b1": 0, "b2": 0}),), course=lambda line: line["b1"],
    ),
    Line(
        "BP and HB", flow(turning_beside_a_pitchfork, XYZ, l=-0.5, m=-0.5),
        "l", "BP", ("m", "l"), (("BP-HB", {"l": 0, "m": 0}),), course=lambda line: line["l"],
    ),
)  # fmt: skip

# --- maps -------------------------------------------------------------------------------------

PLANE = {"alpha": (-3.0, 4.0), "beta": (-2.0, 3.0)}


def henon(alpha: float, beta: float, y: float) -> Problem:
    """``x' = y, y' = alpha - beta x - y^2``."""
    return of_map(
        lambda u, p: [u[1], p["alpha"] - p["beta"] * u[0] - u[1] ** 2],
        {"x": y, "y": y}, alpha=alpha, beta=beta,
    )  # fmt: skip


def _henon(kind: str, factor: float, *known: Known) -> Line:
    return Line(
        f"{kind} of henon", henon(1.0, 0.5, 0.6), "alpha", kind, ("beta", "alpha"), known,
        {"alpha": (-3.0, 4.0), "y": (-3.0, 3.0)}, PLANE,
        lambda line: line["alpha"] - factor * (1 + line["beta"]) ** 2, accuracy=1e-10,
    )  # fmt: skip


LPPD = ("LPPD", {"alpha": 0, "beta": -1, "y": 0})
HENON = {
    "LP": _henon("LP", -0.25, LPPD, ("R1", {"alpha": -1, "beta": 1})),
    "PD": _henon("PD", 0.75, LPPD, ("R2", {"alpha": 3, "beta": 1})),
    "NS": Line(
        "NS of henon", henon(1.0, 0.5, 0.5), "beta", "NS", ("alpha", "beta"),
        tuple((kind, {"alpha": alpha, "beta": 1})
              for kind, alpha in (("R1", -1), ("R4", 0), ("R3", 1.25), ("R2", 3))),
        {"beta": (0.0, 2.0)}, PLANE,
        lambda line: np.concatenate([line["beta"] - 1, np.cos(line["angle"]) + line["y"]]),
    ),
}  # fmt: skip


def _polar(u: Array, p: Params, angle: float = 1.0) -> list[Any]:
    """``w -> exp(i angle) w (1 + m + s |w|^2 - |w|^4)``."""
    square = u[0] ** 2 + u[1] ** 2
    factor = 1 + p["m"] + p["s"] * square - square**2
    return [factor * part for part in rotated(u, angle)]


def _two_rotations(u: Array, p: Params) -> list[Any]:
    first, second = ({"m": p[name], "s": -1.0} for name in "mk")
    return _polar(u[:2], first) + _polar(u[2:], second, angle=1.7)


TWO_ROTATIONS = Line(
    "two rotations", of_map(_two_rotations, dict.fromkeys("abcd", 0.0), m=-0.25, k=0.2),
    "m", "NS", ("k", "m"), (("NSNS", {"m": 0, "k": 0}),), {"m": (-0.5, 0.5)}, {"k": (-0.5, 0.5)},
)  # fmt: skip
CHENCINER = Line(
    "NS of a normal form", of_map(_polar, XY, m=-0.3, s=-0.5), "m", "NS", ("s", "m"),
    (("CH", {"s": 0, "m": 0}),), {"m": (-0.9, 0.5)}, {"s": (-2.0, 2.0)},
)  # fmt: skip
FLIPS = Line(  # ``u -> -(1 + m) u + a u^2 - u^3`` has c = a^2 - 1 at m = 0
    "PD of a cubic map", of_map(lambda u, p: -(1 + p["m"]) * u + p["a"] * u**2 - u**3, {"x": 0.0},
                                m=-0.5, a=0.3),
    "m", "PD", ("a", "m"), (("GPD", {"a": -1}), ("GPD", {"a": 1})), {"m": (-0.9, 1.0)},
    {"a": (-2.0, 2.0)},
)  # fmt: skip


def _turning(fold: bool) -> Problem:
    """A rotation that grows with s, beside one multiplier ``1 + h`` (fold) or ``-1 - h`` (flip)."""

    def image(u: Array, p: Params) -> list[Any]:
        x, y, z = u
        square = x * x + y * y
        factor = p["s"] - square + (z if fold else 0)
        last = z + p["h"] - z * z + square if fold else -(1 + p["h"]) * z + z**3
        return [*(factor * part for part in rotated((x, y), 1.1)), last]

    start, h = {**XY, "z": 0.5 if fold else 0.0}, 0.25 if fold else -0.3
    return of_map(image, start, h=h, s=0.2)


def _pair_beside(one: str) -> tuple[Line, Line]:
    """The curve of folds or doublings, and that of the pair which is met on it."""
    problem, there = _turning(one == "LP"), {"s": 1, "h": 0}
    within = {"h": (-0.5, 0.5), "z": (-1.0, 1.0)}
    along, wide = {"h": (-0.3, 0.3)}, {"s": (0.1, 1.5)}
    more = (("CH", {}),) if one == "LP" else ()
    return (
        Line(f"{one} beside a pair", problem, "h", one, ("s", "h"), ((f"{one}NS", there),), within,
             wide),
        Line(f"pair beside a {one}", problem, "s", "NS", ("h", "s"), ((f"{one}NS", there), *more),
             wide, along),
    )  # fmt: skip


def _turning_beside_a_crossing(u: Array, p: Params) -> list[Any]:
    """``z -> (1 + h) z - z^2`` beside a rotation that grows with s."""
    x, y, z = u
    factor = p["s"] - x * x - y * y
    return [*(factor * part for part in rotated((x, y), 1.1)), (1 + p["h"]) * z - z * z]


def _pair_and_crossing(kind: str, free: str, other: str) -> Line:
    problem = of_map(_turning_beside_a_crossing, XYZ, h=-0.3, s=0.7)
    name = f"{kind}-{'NS' if kind == 'BP' else 'BP'}"
    window = {"h": (-0.5, 0.5), "s": (0.5, 1.5)}
    return Line(
        f"{kind} of {name}", problem, free, kind, (other, free), ((name, {"h": 0, "s": 1}),),
        window, window,
    )  # fmt: skip


PREY = {"p1": (0.5, 6.0), "p2": (0.06, 0.3)}


def eaten(p2: float, *, coexisting: bool = False, p1: float = 2.5) -> Problem:
    """Prey u and predators v; these die out where p2 (1 - 1/p1) = p3 = 0.1."""
    x = 0.1 / p2
    start = {"u": x, "v": (3 * (1 - x) - 1) / p2} if coexisting else {"u": 0.6, "v": 0.0}
    return of_map(
        lambda u, p: [
            p["p1"] * u[0] * (1 - u[0]) - p["p2"] * u[0] * u[1],
            (1 - p["p3"]) * u[1] + p["p2"] * u[0] * u[1],
        ],
        start, p1=3.0 if coexisting else p1, p2=p2, p3=0.1,
    )  # fmt: skip


DOUBLED_PREY = Line(
    "PD of prey alone", eaten(0.2), "p1", "PD", ("p2", "p1"), (("PD-BP", {"p2": 0.15, "p1": 3}),),
    {"p1": (1.5, 5.0)}, PREY,
)  # fmt: skip
DYING = Line(
    "BP where predators die out", eaten(0.1), "p2", "BP", ("p1", "p2"), (("BP-PD", {"p1": 3}),),
    {"p2": (0.06, 0.5)}, {"p1": (1.2, 6.0), "p2": (0.01, 1.0)},
    lambda line: line["p2"] * (1 - 1 / line["p1"]) - 0.1,
)  # fmt: skip
COEXISTING = Line(
    "PD of both", eaten(0.2, coexisting=True), "p1", "PD", ("p2", "p1"), DOUBLED_PREY.known,
    {"p1": (2.1, 5.0)}, {"p1": (2.0, 4.2), "p2": (0.1, 0.3)},
    lambda line: line["u"] * line["p2"] - 0.1,
)  # fmt: skip
MAPS = (
    *HENON.values(),
    CHENCINER,
    TWO_ROTATIONS,
    FLIPS,
    Line(
        "cusp of a map",
        of_map(lambda u, p: u + p["h"] + p["mu"] * u - u**3, {"x": -0.8}, h=0.288, mu=1.0),
        "h", "LP", ("mu", "h"), (("CP", {"x": 0, "h": 0, "mu": 0, "c": -1}),),
        {"x": (-0.9, 0.9)}, {"mu": (-0.5, 1.5)},
    ),
    *_pair_beside("LP"),
    *_pair_beside("PD"),
    _pair_and_crossing("BP", "h", "s"),
    _pair_and_crossing("NS", "s", "h"),
    Line(  # the determinant 1 + b2 - b1 is 1
        "NS that ends at a degenerate R1",
        of_map(lambda u, p: [u[0] + u[1], u[1] + p["b1"] * u[0] + p["b2"] * u[1] - u[0] ** 3
                             - u[0] ** 2 * u[1]], XY, b1=-0.5, b2=-0.7),
        "b2", "NS", ("b1", "b2"), (("R1", {"b1": 0, "b2": 0}),), {"b2": (-0.9, 0.3)}, UNIT,
        lambda line: line["b1"] - line["b2"],
    ),
    Line(  # of the business cycle (N. Kaldor, Econ. J. 50, 78, 1940), odd about its fixed point
        "NS that ends at the R1 of an odd map",
        of_map(lambda u, p: [u[0] + p["a"] * (np.arctan(u[0]) - p["s"] * u[0] - 0.7 * u[1]),
                             np.arctan(u[0]) + 0.1 * u[1]], XY, a=1.0, s=0.5),
        "a", "NS", ("a", "s"), (("R1", {"a": 81 / 70, "s": 2 / 9, "angle": 0}),), {"a": (0.5, 2)},
        {"s": (0.1, 1.0)}, lambda line: line["a"] * (0.8 - 0.1 * line["s"]) - 0.9,
    ),
    DOUBLED_PREY,
    COEXISTING,
    DYING,
    Line(
        "two doublings of one cycle",
        of_map(lambda u, p: [-(1 + p["m"]) * u[0] + u[0] ** 3,
                             -(1 + p["m"] + p["k"]) * u[1] + u[1] ** 3], XY, m=-0.5, k=-0.3),
        "m", "PD", ("k", "m"), (), {"m": (-0.9, 1.0)}, {"k": (-1.0, 1.0), "m": (-1.0, 1.0)},
        doubtful="as where two cross",
    ),
)  # fmt: skip
LINES = {line.name: line for line in (*FLOWS, *MAPS)}
