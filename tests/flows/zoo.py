"""Systems whose special points, periods and multipliers are known without this package.

Each `Case` says what is walked, which special points its branch has (all of them: others are false)
and what holds along it, and where that is from: a closed form, derived beside it, or the roots of
one in elementary functions. Nothing here is computed by the package.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve
from scipy.special import ellipk, mathieu_a, mathieu_b

import contbreather as cb
from contbreather.flows import Collocation

Pairs = Iterable[tuple[Any, Any]]  # what is found, what is known


@dataclass(frozen=True)
class Case:
    """What is walked, and what is known of it.

    `special` holds kind and value of the free parameter of all special points; `along` gives, for a
    point of the branch, pairs of what is found and what is known.
    """

    name: str
    problem: Callable[[], cb.Problem]
    free: str
    window: tuple[float, float]
    special: tuple[tuple[str, float], ...] = ()
    along: Callable[[Any], Pairs] | None = None
    tolerance: float = 1e-8

    @cached_property
    def branch(self) -> cb.Branch:
        within = {self.free: self.window}
        return cb.trace(self.problem(), self.free, within=within, towards="both")


CASES: dict[str, Case] = {}


def enter(name: str, problem: Callable[[], cb.Problem], *known: Any, **more: Any) -> None:
    CASES[name] = Case(name, cache(problem), *known, **more)


def rest(f: Any, start: Mapping[str, float], params: Mapping[str, float], **more: Any) -> Any:
    return lambda: cb.equilibrium(f, dict(start), dict(params), **more)


def cycle(flows: Any, start: Mapping[str, float], params: Mapping[str, float], **more: Any) -> Any:
    return lambda: cb.cycle(flows, start=dict(start), params=dict(params), **more)


def told(end: Any) -> dict[str, float]:
    """Place that the last orbit of a curve of folds tells of its generalised Hopf point."""
    pairs = (part.split(" = ") for part in end.detail["said"].split(", ")[1:])
    return {name: float(value) for name, value in pairs}


def born(rest: Any, free: str, window: tuple[float, float], **within: Any) -> cb.Branch:
    """The cycles that leave the Hopf point of an equilibrium, within its window or these."""
    hopf = cb.trace(rest, free, within={free: window}).first("HB")
    (cycles,) = cb.switch(hopf, within=within or {free: window})
    return cycles


def across(
    start: cb.Problem, free: str, kind: str, within: Any, **how: Any
) -> tuple[cb.Point, cb.Branch]:
    """Where a branch ends, and the one that sets out there."""
    place = cb.trace(start, free, within=within, **how).first(kind)
    (arm,) = cb.switch(place, within=within)
    return place, arm


# --- equilibria -----------------------------------------------------------------------------------


def lorenz(t: Any, x: Any, p: Any) -> Any:
    s, r, b = p["s"], p["r"], p["b"]
    return [s * (x[1] - x[0]), x[0] * (r - x[2]) - x[1], x[0] * x[1] - b * x[2]]


# Lorenz: r = s (s + b + 3) / (s - b - 1) = 470/19, from l^3 + (s + b + 1) l^2 + b (s + r) l +
# 2 s b (r - 1) = (l^2 + w^2) (l + s + b + 1).
LORENZ = {"s": 10.0, "b": 8 / 3}
enter(
    "lorenz",
    rest(lorenz, {"x": 6.0, "y": 6.0, "z": 14.0}, {**LORENZ, "r": 15.0}),
    "r", (1.5, 30.0), (("HB", 470 / 19),),
    lambda at: [(at["x"] ** 2, 8 / 3 * (at["r"] - 1)), (at["z"], at["r"] - 1)],
)  # fmt: skip
enter(
    "lorenz, origin",
    rest(lorenz, {"x": 0.0, "y": 0.0, "z": 0.0}, {**LORENZ, "r": 0.5}),
    "r", (0.1, 3.0), (("BP", 1.0),),
)  # fmt: skip


# FitzHugh-Nagumo: trace 1 - v^2 - eps b = 0; then w = (v + a)/b and I = w - v + v^3/3.
def fitzhugh_nagumo(t: Any, x: Any, p: Any) -> Any:
    v, w = x
    return [v - v**3 / 3 - w + p["I"], p["eps"] * (v + p["a"] - p["b"] * w)]


FHN = {"a": 0.7, "b": 0.8, "eps": 0.08}
enter(
    "fitzhugh-nagumo",
    rest(fitzhugh_nagumo, {"v": -1.2, "w": -0.62}, {**FHN, "I": 0.0}),
    "I", (-0.5, 2.5),
    tuple(
        ("HB", (v + 0.7) / 0.8 - v + v**3 / 3)
        for v in (-math.sqrt(1 - 0.064), math.sqrt(1 - 0.064))
    ),
)  # fmt: skip


def hindmarsh_rose(t: Any, x: Any, p: Any) -> Any:
    x, y, z = x
    return [y - x**3 + 3 * x**2 + p["I"] - z, 1 - 5 * x**2 - y, p["r"] * (4 * (x + 1.6) - z)]


def hindmarsh_rose_hopf(r: float) -> tuple[float, ...]:
    """Routh-Hurwitz: of l^3 + c2 l^2 + c1 l + c0 with f = 3 x^2 - 6 x, c2 = 1 + r + f,
    c1 = r + (1 + r) f + 10 x + 4 r, c0 = r f + 10 r x + 4 r, it is c2 c1 = c0 with c1 > 0."""
    f, x = np.poly1d([3.0, -6.0, 0.0]), np.poly1d([1.0, 0.0])
    c2, c1, c0 = 1 + r + f, r + (1 + r) * f + 10 * x + 4 * r, r * f + 10 * r * x + 4 * r
    roots = [u.real for u in (c2 * c1 - c0).roots if abs(u.imag) < 1e-9 and c1(u.real) > 0]
    # on the curve of equilibria I = -y + x^3 - 3 x^2 + z
    return tuple(sorted(-1 + 5 * u**2 + u**3 - 3 * u**2 + 4 * (u + 1.6) for u in roots))


enter(
    "hindmarsh-rose",
    # the cycles that are born there contract as exp(-13.7 t) while they take 119
    rest(hindmarsh_rose, {"x": -1.3, "y": -7.5, "z": 1.2}, {"I": 0.0, "r": 0.01},
         collocation=Collocation(intervals=60)),
    "I", (-1.0, 30.0), tuple(("HB", current) for current in hindmarsh_rose_hopf(0.01)),
)  # fmt: skip

EQUILIBRIA = tuple(CASES)


# --- limit cycles ---------------------------------------------------------------------------------


# Stuart-Landau: z' = (mu + i w) z - (1 + i c) |z|^2 z has |z|^2 = mu, period 2 pi / (w - c mu).
def stuart_landau(t: Any, x: Any, p: Any) -> Any:
    r2 = x[0] ** 2 + x[1] ** 2
    turning = p["w"] - p["c"] * r2
    return [(p["mu"] - r2) * x[0] - turning * x[1], turning * x[0] + (p["mu"] - r2) * x[1]]


def along_stuart_landau(at: Any) -> Pairs:
    period = 2 * np.pi / (1 - 0.5 * at["mu"])
    return [
        (at["period"], period),
        (at["max(x)"], math.sqrt(at["mu"])),
        (at["min(y)"], -math.sqrt(at["mu"])),
        (at.solution.others, [math.exp(-2 * at["mu"] * period)]),
        (at.solution.trivial, 1.0),
    ]


enter(
    "stuart-landau",
    cycle(stuart_landau, {"x": 0.7, "y": 0.0}, {"mu": 0.5, "w": 1.0, "c": 0.5}, settle=30),
    "mu", (0.1, 1.2), (), along_stuart_landau, tolerance=1e-9,
)  # fmt: skip


# Bautin: r' = r (mu + s r^2 - r^4) has a fold of cycles at mu = -s^2/4, r^2 = s/2.
def bautin(t: Any, x: Any, p: Any) -> Any:
    r2 = x[0] ** 2 + x[1] ** 2
    growth = p["mu"] + p["s"] * r2 - r2**2
    return [growth * x[0] - x[1], x[0] + growth * x[1]]


def along_bautin(at: Any) -> Pairs:
    r2 = at["max(x)"] ** 2
    multiplier = math.exp(2 * np.pi * (2 * r2 - 4 * r2**2))
    return [(r2**2 - r2, at["mu"]), (at["period"], 2 * np.pi), (at.solution.others, [multiplier])]


enter(
    "bautin",
    cycle(bautin, {"x": 0.94, "y": 0.0}, {"mu": -0.1, "s": 1.0}, settle=30),
    "mu", (-0.4, -0.05), (("LP", -0.25),), along_bautin,
)  # fmt: skip


# A pitchfork of cycles: on r = 1, z' = mu z - z^3.
enter(
    "pitchfork of cycles",
    cycle(
        lambda t, x, p: [
            x[0] * (1 - x[0] ** 2 - x[1] ** 2) - x[1],
            x[0] + x[1] * (1 - x[0] ** 2 - x[1] ** 2),
            x[2] * (p["mu"] - x[2] ** 2),
        ],
        {"x": 1.0, "y": 0.0, "z": 0.0}, {"mu": -0.3}, settle=20,
    ),
    "mu", (-0.5, 0.5), (("BP", 0.0),),
    lambda at: [(at["period"], 2 * np.pi),
                (sorted(at.solution.others.real),
                 sorted([math.exp(2 * np.pi * at["mu"]), math.exp(-4 * np.pi)]))],
)  # fmt: skip


def half_turned(mu: Any, cosine: Any, sine: Any, u: Any, v: Any) -> tuple[Any, Any]:
    """q' = diag(mu, -1) q - |q|^2 q seen from axes that turn half as fast as the angle whose cosine
    and sine are given: a Moebius strip, so that q = 0 has multipliers -exp(2 pi mu), -exp(-2 pi).
    """
    even, odd, square = (mu - 1) / 2, (mu + 1) / 2, u**2 + v**2
    return (
        (even + odd * cosine - square) * u + (odd * sine - 0.5) * v,
        (odd * sine + 0.5) * u + (even - odd * cosine - square) * v,
    )


def moebius(t: Any, x: Any, p: Any) -> Any:
    """Around the circle r = 1, z = 0, which is run through with unit speed."""
    r = np.sqrt(x[0] ** 2 + x[1] ** 2)
    cosine, sine = x[0] / r, x[1] / r
    outwards, upwards = half_turned(p["mu"], cosine, sine, r - 1, x[2])
    return [outwards * cosine - x[1], outwards * sine + x[0], upwards]


def along_moebius(at: Any) -> Pairs:
    wanted = [-math.exp(2 * np.pi * at["mu"]), -math.exp(-2 * np.pi)]
    return [(np.sort(at.solution.others.real), np.sort(wanted))]


enter(
    "moebius",
    cycle(moebius, {"x": 1.0, "y": 0.0, "z": 0.0}, {"mu": -0.3}, settle=20),
    "mu", (-0.5, 0.5), (("PD", 0.0),), along_moebius,
)  # fmt: skip


# Langford's torus without its asymmetric term: z = 0.7 and r^2 = R/(1 + 0.7 rho), R = l + 0.7 -
# 0.343/3, l = 0.6; in (r, z) the trace 0.51 - rho r^2 vanishes at rho = 0.51/(R - 0.357), with the
# determinant 2 R: the multipliers are exp((trace/2 +- i sqrt(2 R - trace^2/4)) 2 pi / 3.5).
def langford(t: Any, x: Any, p: Any) -> Any:
    r2 = x[0] ** 2 + x[1] ** 2
    return [
        (x[2] - 0.7) * x[0] - 3.5 * x[1],
        3.5 * x[0] + (x[2] - 0.7) * x[1],
        p["l"] + x[2] - x[2] ** 3 / 3 - r2 * (1 + p["rho"] * x[2]),
    ]


RADIUS = 1.3 - 0.343 / 3


def along_langford(at: Any) -> Pairs:
    r2 = RADIUS / (1 + 0.7 * at["rho"])
    half = (0.51 - at["rho"] * r2) / 2
    pair = np.exp((half + 1j * math.sqrt(2 * RADIUS - half**2)) * 2 * np.pi / 3.5)
    found = at.solution.others
    angle = [(at["angle"], abs(np.angle(pair)))] if at.kind == "NS" else []
    return [(at["max(x)"], math.sqrt(r2)), (found[found.imag > 0], [pair]), *angle]


enter(
    "langford",
    cycle(langford, {"x": 0.9, "y": 0.0, "z": 0.7}, {"rho": 1.0, "l": 0.6}, settle=60),
    "rho", (0.3, 1.2), (("NS", 0.51 / (RADIUS - 0.357)),), along_langford,
)  # fmt: skip


def van_der_pol(t: Any, x: Any, p: Any) -> Any:
    return [x[1], p["mu"] * (1 - x[0] ** 2) * x[1] - x[0]]


def roessler(t: Any, x: Any, p: Any) -> Any:
    return [-x[1] - x[2], x[0] + p["a"] * x[1], p["b"] + x[2] * (x[0] - p["c"])]


BAND = {"a": 0.2, "b": 0.2}

# Roessler's first doubling, by Newton's iteration on the state, the period and det(M + 1) = 0 with
# the variational equations integrated by scipy's DOP853 to 2e-14.
enter(
    "roessler",
    cycle(
        roessler, {"x": -1.0, "y": -3.0, "z": 0.05}, {**BAND, "c": 2.5}, settle=120,
    ),
    "c", (2.0, 3.2), (("PD", 2.8324450278),),
    lambda at: [(at["period"], 5.769820016506)] if at.kind == "PD" else [],
)  # fmt: skip


# --- forced responses, of known autonomous systems seen from moving axes --------------------------

# y = x + sin t of x' = mu - x^2: a fold at 0, multipliers exp(-4 pi x), x = +- sqrt mu.
enter(
    "forced fold",
    cycle(
        lambda t, x, p: [p["mu"] - (x[0] - np.sin(t)) ** 2 + np.cos(t)],
        {"y": 0.5}, {"mu": 0.25}, period=2 * np.pi, settle=20,
    ),
    "mu", (-0.5, 0.3), (("LP", 0.0),),
    lambda at: [((at["max(y)"] - 1) ** 2, at["mu"]),
                (np.log(at.solution.others.real), [-4 * np.pi * (at["max(y)"] - 1)])],
)  # fmt: skip


def forced_moebius(t: Any, x: Any, p: Any) -> Any:
    """Half-turned axes around the point (cos t, 0)."""
    du, dv = half_turned(p["mu"], np.cos(t), np.sin(t), x[0] - np.cos(t), x[1])
    return [du - np.sin(t), dv]


enter(
    "forced doubling",
    cycle(forced_moebius, {"u": 1.0, "v": 0.0}, {"mu": -0.3}, period=2 * np.pi, settle=20),
    "mu", (-0.5, 0.5), (("PD", 0.0),), along_moebius,
)  # fmt: skip


def forced_torus(t: Any, x: Any, p: Any) -> Any:
    """z' = (mu + i w) z - |z|^2 z around (cos t, 0): multipliers exp(2 pi (mu +- i w))."""
    u, v = x[0] - np.cos(t), x[1]
    growth = p["mu"] - u**2 - v**2
    return [growth * u - p["w"] * v - np.sin(t), p["w"] * u + growth * v]


def along_torus(at: Any) -> Pairs:
    wanted = np.exp(2 * np.pi * (at["mu"] + 0.3j))
    found = at.solution.others
    return [(found[found.imag > 0], [wanted])]


enter(
    "forced torus",
    cycle(
        forced_torus, {"u": 1.0, "v": 0.0}, {"mu": -0.3, "w": 0.3}, period=2 * np.pi, settle=20
    ),
    "mu", (-0.5, 0.5), (("NS", 0.0),), along_torus,
)  # fmt: skip


# A linear oscillator beside a wall at 1, which it grazes where its amplitude
# F / |1 - w^2 + 2 i c w| is 1: the branch ends. Its multipliers are
# exp((-c +- i sqrt(1 - c^2)) 2 pi/w).
def linear(t: Any, x: Any, p: Any) -> Any:
    return [x[1], p["F"] * np.cos(p["w"] * t) - x[0] - 2 * p["c"] * x[1]]


def turn(p: Any) -> Any:
    return 2 * np.pi / p["w"]


def along_linear(at: Any) -> Pairs:
    gain = 1 / abs(1 - at["w"] ** 2 + 0.2j * at["w"])
    pair = np.exp((-0.1 + 1j * math.sqrt(0.99)) * 2 * np.pi / at["w"])
    found = at.solution.others
    return [(at["max(x)"], at["F"] * gain), (abs(found), [abs(pair)] * 2),
            (found.sum(), 2 * pair.real)]  # fmt: skip


enter(
    "linear beside a wall",
    cycle(
        cb.Flow(linear, walls=(lambda t, x, p: 1 - x[0],)),
        {"x": 0.0, "v": 0.0}, {"F": 0.5, "w": 1.5, "c": 0.1}, period=turn, settle=100,
    ),
    "F", (0.2, 3.0), (("GR", abs(1 - 1.5**2 + 0.3j)),), along_linear,
)  # fmt: skip

# Mathieu's equation with q = 1, at rest: the two ends of its second gap.
enter(
    "mathieu",
    cycle(
        lambda t, x, p: [x[1], -(p["a"] - 2 * np.cos(2 * t)) * x[0]],
        {"x": 0.0, "v": 0.0}, {"a": 3.0}, period=np.pi,
    ),
    "a", (2.5, 6.0), (("BP", mathieu_b(2, 1)), ("BP", mathieu_a(2, 1))),
    lambda at: [(at.solution.others.prod(), 1.0)],
)  # fmt: skip

# A pendulum whose pivot is shaken, hanging at rest: where the variational equations, integrated by
# scipy's DOP853 to 2e-14, have det(M + 1) = 0.
enter(
    "shaken pendulum",
    cycle(
        lambda t, x, p: [x[1], -0.1 * x[1] - (1 + p["A"] * np.cos(2 * t)) * np.sin(x[0])],
        {"x": 0.0, "v": 0.0}, {"A": 0.05}, period=np.pi,
    ),
    "A", (0.0, 1.0), (("PD", 0.200109342149),),
)  # fmt: skip


# --- hybrid ---------------------------------------------------------------------------------------


# A ball on a table, one bounce a period: it leaves with pi and returns with -pi, so that
# A cos(phase) = C = pi (1 - e)/(1 + e). With S = A sin(phase) the map of phase and velocity has
# determinant e^2 and trace 1 + e^2 - (1 + e)^2 S: a fold at S = 0, a doubling at
# S = 2 (1 + e^2)/(1 + e)^2.
TABLE = cb.Flow(
    lambda t, x, p: [x[1], -1.0],
    until=lambda t, x, p: x[0] - p["A"] * np.sin(t),
    reset=lambda t, x, p: [
        p["A"] * np.sin(t), -p["e"] * x[1] + (1 + p["e"]) * p["A"] * np.cos(t)
    ],
)  # fmt: skip
FOLD_OF_BALL, S_OF_DOUBLING = math.pi * 0.2 / 1.8, 2 * 1.64 / 1.8**2


def along_ball(at: Any) -> Pairs:
    S = at["A"] * math.sin(at.solution.times[0])
    product, total = 0.64, 1.64 - 1.8**2 * S
    found = at.solution.others
    return [(found.prod(), product), (found.sum(), total)]


enter(
    "bouncing ball",
    cycle(
        [TABLE], {"y": 0.5, "v": 3.1}, {"A": 0.6, "e": 0.8}, period=2 * np.pi, t0=0.9, settle=100
    ),
    "A", (0.3, 1.2),
    (("LP", FOLD_OF_BALL), ("PD", math.hypot(FOLD_OF_BALL, S_OF_DOUBLING))), along_ball,
    tolerance=1e-10,
)  # fmt: skip

# A neuron that is set back: T = log(I/(I - 1)).
enter(
    "integrate and fire",
    cycle(
        cb.Flow(lambda t, x, p: [p["I"] - x[0]], until=lambda t, x, p: 1 - x[0],
                reset=lambda t, x, p: [0.0]),
        {"v": 0.0}, {"I": 1.5},
    ),
    "I", (1.05, 3.0), (),
    lambda at: [(at["period"], math.log(at["I"] / (at["I"] - 1)))],
)  # fmt: skip


# v' = I - v up to 1 + K sin(2 pi t), I = 1.65, one spike a period: K sin(phase) = D with D =
# I (1 - 1/e) - 1, a fold at K = D. On both sides it touches v in between, where both are equal with
# equal slopes: on one of them just before it rises as fast as v at the spike itself, which would be
# VI, K^2 = D^2 + (I/e)^2/(2 pi)^2, for an orbit that had not met it yet.
def grazing_threshold(current: float, near: tuple[float, float, float]) -> float:
    turns = 2 * math.pi

    def touching(z: Any) -> Any:
        K, phase, after = z
        return [
            K * math.sin(phase) - (current * (1 - math.exp(-1)) - 1),
            1 + K * math.sin(phase + turns * after) - current * (1 - math.exp(-after)),
            turns * K * math.cos(phase + turns * after) - current * math.exp(-after),
        ]

    return float(fsolve(touching, near, xtol=1e-12)[0])


D_OF_THRESHOLD = 1.65 * (1 - math.exp(-1)) - 1


def along_threshold(at: Any) -> Pairs:
    sine = D_OF_THRESHOLD / at["K"]
    cosine = math.cos(2 * math.pi * at.solution.times[0])
    rate, slope = 1.65 * math.exp(-1), 2 * math.pi * at["K"] * cosine
    return [(cosine**2, 1 - sine**2), (1 / at.solution.others, [(rate - slope) / rate])]


enter(
    "moving threshold",
    cycle(
        cb.Flow(lambda t, x, p: [p["I"] - x[0]], reset=lambda t, x, p: [0.0],
                until=lambda t, x, p: 1 + p["K"] * np.sin(2 * np.pi * t) - x[0]),
        {"v": 0.0}, {"I": 1.65, "K": 0.1}, period=1.0, t0=0.4, settle=30,
    ),
    "K", (0.02, 0.8),
    (("GR", grazing_threshold(1.65, (0.58, 3.07, 0.31))), ("LP", D_OF_THRESHOLD),
     ("GR", grazing_threshold(1.65, (0.103, 0.43, 0.935)))),
    along_threshold,
)  # fmt: skip


# Dry friction on a belt that moves with V: stuck until the spring pulls with F, then slipping with
# z = x - F + d V, z'' - d z' + z = 0, z = d V and z' = V, until z' = V again.
def friction(sign: int) -> Any:
    def f(t: Any, x: Any, p: Any) -> Any:
        return [x[1], -x[0] - sign * p["F"] + p["d"] * (x[1] - p["V"])]

    return f


STICK_SLIP = cb.Filippov(friction(1), friction(-1), lambda t, x, p: x[1] - p["V"])


def slips(d: float, V: float = 1.0, F: float = 1.0) -> tuple[float, float]:
    """How long it slips, and where it sticks again."""
    matrix, start = np.array([[0.0, 1.0], [-1.0, d]]), np.array([d * V, V])
    slip = brentq(lambda t: (expm(matrix * t) @ start)[1] - V, 3.5, 6.25, xtol=1e-15)
    return slip, (expm(matrix * slip) @ start)[0] + F - d * V


def stick_slip_period(d: float, V: float = 1.0, F: float = 1.0) -> float:
    slip, landed = slips(d, V, F)
    return slip + (F - landed) / V


def sticks_until(V: float = 1.0, F: float = 1.0) -> float:
    """From here on it lands where the spring pulls more than friction can hold: it crosses."""
    return brentq(lambda d: slips(d, V, F)[1] + F, 0.1, 0.5, xtol=1e-15)


enter(
    "stick-slip",
    cycle(STICK_SLIP, {"x": 0.0, "v": 0.5}, {"F": 1.0, "V": 1.0, "d": 0.1}, settle=40),
    "d", (0.02, 0.6), (("SL", sticks_until()),),
    lambda at: [(at["period"], stick_slip_period(at["d"]))],
)  # fmt: skip

# A rimless wheel, half an angle 0.3 between its spokes, down a slope g: each step gains 4 sin(0.3)
# sin(g) in the square of the speed, each impact leaves cos(0.6) of the speed.
enter(
    "rimless wheel",
    cycle(
        cb.Flow(lambda t, x, p: [x[1], np.sin(x[0])],
                until=lambda t, x, p: p["g"] + 0.3 - x[0],
                reset=lambda t, x, p: [x[0] - 0.6, math.cos(0.6) * x[1]]),
        {"a": -0.15, "w": 0.6}, {"g": 0.15}, settle=30,
    ),
    "g", (0.06, 0.3), (),
    lambda at: [(at["max(w)"] ** 2, 4 * math.sin(0.3) * math.sin(at["g"]) / math.sin(0.6) ** 2),
                (max(at.solution.others.real), math.cos(0.6) ** 2)],
)  # fmt: skip


def kicked(force: Any, loss: Any, kick: Any) -> list[cb.Flow]:
    """x'' = force, through x = 0 upwards with a kick: a clock."""

    def f(t: Any, x: Any, p: Any) -> Any:
        return [x[1], force(x, p)]

    return [
        cb.Flow(f, until=lambda t, x, p: x[0]),
        cb.Flow(
            f, until=lambda t, x, p: -x[0], reset=lambda t, x, p: [x[0], loss * x[1] + kick(p)]
        ),
    ]


# A pendulum that loses half its speed there and gains J: v = 2 J, so the period is that of a free
# motion with that speed at rest position.
enter(
    "pendulum clock",
    cycle(
        kicked(lambda x, p: -np.sin(x[0]), 0.5, lambda p: p["J"]),
        {"x": 0.1, "v": 1.0}, {"J": 0.5}, settle=60,
    ),
    "J", (0.3, 0.9), (),
    lambda at: [(at["period"], 4 * ellipk(at["J"] ** 2)), (max(at.solution.others.real), 0.5)],
)  # fmt: skip


# A piecewise linear van der Pol oscillator: damping -2 a within |x| < 1, 2 b outside; half an orbit
# begins at x = 1 with v, is outside until x = 1 again, inside until x = -1, and is mirrored.
def along_bilinear(at: Any) -> Pairs:
    outside, inside = np.array([[0.0, 1], [-1, -2 * at["b"]]]), np.array([[0.0, 1], [-1, 0.2]])
    (first, second), v = at.solution.durations, at.solution.states(at.solution.times[0])[1]
    middle = expm(outside * first) @ [1, v]
    return [(middle[0], 1.0), (expm(inside * second) @ middle, [-1, -v])]


enter(
    "bilinear oscillator",
    cycle(
        [cb.Flow(lambda t, x, p: [x[1], -x[0] - 2 * p["b"] * x[1]],
                 until=lambda t, x, p: x[0] - 1),
         cb.Flow(lambda t, x, p: [x[1], -x[0] + 0.2 * x[1]],
                 until=lambda t, x, p: x[0] + 1, reset=lambda t, x, p: [-x[0], -x[1]])],
        {"x": 1.0, "v": 1.5}, {"b": 0.3}, settle=80,
    ),
    "b", (0.15, 0.9), (), along_bilinear,
)  # fmt: skip


# A damped oscillator that hits a wall at x = 1 once a period 2 pi/w and keeps e of its speed.
# Between impacts it is linear, X1 - Xp = E (X0 - Xp) with Xp the forced response at the impact, so
# that Xp is linear in the speed v of the rebound; its amplitude, F times the gain, is a quadratic
# in v: a fold where both solutions meet, no impact (v = 0) where the amplitude is 1.
@dataclass(frozen=True)
class Impacting:
    w: float
    c: float = 0.05
    e: float = 0.7

    @property
    def turn(self) -> Any:
        return expm(np.array([[0.0, 1.0], [-1.0, -2 * self.c]]) * 2 * np.pi / self.w)

    @property
    def response(self) -> tuple[Any, Any]:
        """Xp = (1, 0) + v times this slope, both with the velocity in units of w."""
        slope = np.linalg.solve(np.eye(2) - self.turn, [0.0, 1 / self.e] + self.turn @ [0.0, 1.0])
        return np.array([1.0, 0.0]), slope * [1.0, 1 / self.w]

    @property
    def touching(self) -> float:
        """The force with amplitude 1."""
        return abs(1 - self.w**2 + 2j * self.c * self.w)

    @property
    def fold(self) -> float:
        a, b = self.response
        return self.touching * math.sqrt(a @ a - (a @ b) ** 2 / (b @ b))

    def rebounds(self, F: float) -> list[float]:
        a, b = self.response
        roots = np.roots([b @ b, 2 * a @ b, a @ a - (F / self.touching) ** 2])
        return sorted(float(v.real) for v in roots if abs(v.imag) < 1e-6)

    def matrix(self, v: float) -> Any:
        """Of the map over a period, from just after an impact to just after the next."""
        a, b = self.response
        xp, vp = (a + v * b) * [1.0, self.w]
        force = (1 - self.w**2) * xp + 2 * self.c * vp
        before = np.array([v / self.e, force - 1 - 2 * self.c * v / self.e])
        after = np.array([-v, force - 1 + 2 * self.c * v])
        reset = np.diag([1.0, -self.e])
        return (reset + np.outer(after - reset @ before, [1.0, 0.0]) / before[0]) @ self.turn

    def doubling(self, low: float, high: float) -> float:
        def least(F: float) -> float:
            return float(np.linalg.det(self.matrix(self.rebounds(F)[-1]) + np.eye(2)))

        return brentq(least, low, high, xtol=1e-14)

    def along(self, at: Any) -> Pairs:
        v = -at.solution.states(at.solution.times[0])[1]
        known = min(self.rebounds(at["F"]), key=lambda one: abs(one - v))
        pairs = [(v, known)]
        if v > 1e-3:  # without bound where v = 0
            pairs.append((at.solution.others.sum() * v, np.trace(self.matrix(v)) * v))
        return pairs

    @property
    def flow(self) -> cb.Flow:
        return cb.Flow(
            lambda t, x, p: [
                x[1], p["F"] * np.cos(p["w"] * t) - x[0] - 2 * self.c * x[1]
            ],
            until=lambda t, x, p: 1 - x[0], reset=lambda t, x, p: [x[0], -self.e * x[1]],
        )  # fmt: skip


FAST, SLOW = Impacting(1.5), Impacting(0.9)
enter(
    "impact oscillator, fold",
    cycle(FAST.flow, {"x": 0.9, "v": -2.0}, {"F": 1.0, "w": 1.5}, period=turn, settle=80),
    "F", (0.3, 1.35), (("LP", FAST.fold), ("VI", FAST.touching)), FAST.along,
)  # fmt: skip
enter(
    "impact oscillator, doubling",
    cycle(SLOW.flow, {"x": 0.9, "v": -1.0}, {"F": 1.0, "w": 0.9}, period=turn, settle=80),
    "F", (0.1, 1.2), (("PD", SLOW.doubling(0.3, 0.6)), ("VI", SLOW.touching)), SLOW.along,
)  # fmt: skip


# A damped rotor at rest that is kicked by K sin x: det = q = exp(-g), trace = 1 + q + K (1 - q)/g.
LOSS = math.exp(-0.3)
enter(
    "kicked rotor",
    cycle(
        [cb.Flow(lambda t, x, p: [x[1], -0.3 * x[1]],
                 reset=lambda t, x, p: [x[0], x[1] + p["K"] * np.sin(x[0])])],
        {"x": 0.0, "v": 0.0}, {"K": -1.0}, period=1.0,
    ),
    "K", (-4.5, 0.5), (("PD", -2 * 0.3 * (1 + LOSS) / (1 - LOSS)), ("BP", 0.0)),
    lambda at: [(at.solution.others.sum(), 1 + LOSS + at["K"] * (1 - LOSS) / 0.3)],
)  # fmt: skip

# Predators y of a pest x, released each T = 2: without pests the mean of y is p/(d T), and these
# grow where that is less than their rate 1.
enter(
    "pest control",
    cycle(
        cb.Flow(lambda t, x, p: [x[0] * (1 - x[0] - x[1]), x[1] * (0.5 * x[0] - 0.5)], at=0,
                reset=lambda t, x, p: [x[0], x[1] + p["p"]]),
        {"x": 0.0, "y": 1.0}, {"p": 2.0}, period=2.0, settle=40,
    ),
    "p", (0.1, 3.0), (("BP", 1.0),),
    lambda at: [(at["max(y)"], at["p"] / (1 - math.exp(-1))),
                (np.sort(at.solution.others.real),
                 np.sort([math.exp(-1), math.exp(2 * (1 - at["p"]))]))],
)  # fmt: skip


# A ball in a box that is shaken by A sin t, between walls at +-1: each in turn is hit at a phase
# with A cos = -k (1 + A sin), k = 2 (1 - e)/(pi (1 + e)), so A is at least k/sqrt(1 + k^2); half a
# period later with det = e^2, trace = 2 e - ((1 + e) pi)^2/4 A sin/(1 + A sin), which is -(1 + e^2)
# where A sin = 4/(pi^2 - 4): the symmetry is lost.
def shaken(side: int) -> cb.Flow:
    return cb.Flow(
        lambda t, x, p: [x[1], 0.0],
        until=lambda t, x, p: 1 + side * (p["A"] * np.sin(t) - x[0]),
        reset=lambda t, x, p: [x[0], -0.6 * x[1] + 1.6 * p["A"] * np.cos(t)],
    )


K_OF_BOX, SINE_OF_BOX = 2 * 0.4 / (1.6 * math.pi), 4 / (math.pi**2 - 4)
enter(
    "ball in a box",
    cycle(
        [shaken(-1), shaken(1)], {"x": 0.9, "v": -0.7}, {"A": 0.5}, period=2 * np.pi, t0=3.0,
        settle=80,
    ),
    "A", (0.1, 1.2),
    (("LP", K_OF_BOX / math.hypot(1, K_OF_BOX)), ("VI", 1.0),
     ("BP", math.hypot(SINE_OF_BOX, K_OF_BOX * (1 + SINE_OF_BOX)))),
)  # fmt: skip


# The simplest walker of Garcia, Chatterjee, Ruina & Coleman (1998), through the mid-stance, where
# both legs are in line, and on to its next heel strike: its doubling, at a slope of 0.015, by
# Newton's iteration on det(M + 1) = 0 with the variational equations integrated by scipy's DOP853.
def walk(t: Any, x: Any, p: Any) -> Any:
    leg, swing, rate, swinging = x
    fall = np.sin(leg - p["g"])
    return [rate, swinging, fall,
            fall + (rate**2 - np.cos(leg - p["g"])) * np.sin(swing)]  # fmt: skip


def strike(t: Any, x: Any, p: Any) -> Any:
    kept = np.cos(2 * x[0])
    return [-x[0], -2 * x[0], kept * x[2], kept * (1 - kept) * x[2]]


enter(
    "simplest walker",
    cycle(
        [cb.Flow(walk, until=lambda t, x, p: x[1] - 2 * x[0]),
         cb.Flow(walk, until=lambda t, x, p: 2 * x[0] - x[1], reset=strike)],
        {"leg": 0.2003109, "swing": 0.4006218, "u": -0.1998325, "w": -0.0158230}, {"g": 0.009},
    ),
    "g", (0.004, 0.018), (("PD", 0.015088437941),),
    lambda at: [(at["period"], 3.91240921248)] if at.kind == "PD" else [],
)  # fmt: skip


# --- curves in two parameters ---------------------------------------------------------------------


@dataclass(frozen=True)
class Curve:
    """Where a special point of a case goes when a second parameter is free, too."""

    case: str
    kind: str
    names: tuple[str, str]
    window: Mapping[str, tuple[float, float]]
    known: Callable[[Any], tuple[float, float]]
    most: int = 5  # steps to each side


def doubling_of_ball(e: float) -> float:
    return math.hypot(math.pi * (1 - e) / (1 + e), 2 * (1 + e**2) / (1 + e) ** 2)


CURVES = [
    Curve("lorenz", "HB", ("r", "s"), {"s": (6, 20), "r": (15, 40)},
          lambda at: (at["r"], at["s"] * (at["s"] + 17 / 3) / (at["s"] - 11 / 3))),
    Curve("bouncing ball", "LP", ("A", "e"), {"e": (0.4, 0.95), "A": (0, 2)},
          lambda at: (at["A"], math.pi * (1 - at["e"]) / (1 + at["e"]))),
    Curve("bouncing ball", "PD", ("A", "e"), {"e": (0.4, 0.95), "A": (0, 3)},
          lambda at: (at["A"], doubling_of_ball(at["e"]))),
    Curve("langford", "NS", ("rho", "l"), {"l": (0.4, 0.9), "rho": (0.2, 2)},
          lambda at: (at["rho"] * (at["l"] + 0.7 - 0.343 / 3 - 0.357), 0.51)),
    Curve("linear beside a wall", "GR", ("F", "w"), {"w": (0.8, 1.8), "F": (0, 4)},
          lambda at: (at["F"], abs(1 - at["w"] ** 2 + 0.2j * at["w"]))),
    Curve("impact oscillator, fold", "LP", ("F", "w"), {"w": (1.4, 1.7), "F": (0, 4)},
          lambda at: (at["F"], Impacting(at["w"]).fold)),
    Curve("impact oscillator, fold", "VI", ("F", "w"), {"w": (1.5, 1.7), "F": (0, 4)},
          lambda at: (at["F"], Impacting(at["w"]).touching)),
]  # fmt: skip
