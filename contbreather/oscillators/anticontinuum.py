"""The limit without coupling: single oscillators, from which breathers are continued.

There each site oscillates by itself, or rests. Where no harmonic of the orbit is a frequency of
small oscillations its equations are regular, and it goes on to some coupling (R. S. MacKay and
S. Aubry, Nonlinearity 7, 1623, 1994). Of driven ones a code chooses attractors.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from contextlib import suppress
from operator import attrgetter
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..checks import brief, real
from ..continuation.algebra.derivatives import IMAGINARY
from ..continuation.algebra.newton import Array
from ..continuation.walk.trace import trace
from ..errors import BadInput, ContbreatherError, NoSolution, NotConverged
from ..flows.collocation import Collocation, TrajectorySegment, fitted
from ..flows.cycle_constructors import cycle
from ..flows.cycle_problem import Cycle, cycle_of
from ..flows.flow import Flow
from ..flows.functions import Function, Params
from ..flows.integrate import integrate
from ..flows.several_starts import cycles
from .oscillator_lattice import SHARE, Bounce, Oscillators, WallDistance, between_walls

_AMPLITUDES = np.geomspace(1e-3, 1e2, 600)  # among these a single oscillator is looked for
_CLOSER = 3  # times as close as 1/20 where these end: to 2e-6 of the amplitude
_NODES = 0.5 * math.pi * (np.arange(128) + 0.5) / 64  # of Gauss and Chebyshev, angles from 0 to pi
_LEVELS, _PHASES = (0.0, 0.4, 0.8, 1.1), 6  # starts, relative to where it resonates
_ESCAPED = 10.0  # relative to the same, or to what a drive in resonance leads to
_SAMPLES = 256  # of a period, among which phases are looked for
_ALIKE = 0.02  # of the same: ends that differ by less lead to one attractor
_CALM = 12.0  # over the loss: a time in which swings fall by exp(-6)
_MOST = 400  # periods after which it has settled, or never will
_VELOCITIES = (0.3, 0.6, 1.0, 1.6)  # with which a single oscillator sets out, in walls times omega
_SETTLES, _SETTLED = 60, 0.8  # periods; and the restitution up to which these do
_LEAST = 0.02  # share of the coupling from which it is walked
LITTLE = 0.05  # the share of the coupling that tells in which order several sites impact
_SHRUNK, _BEYOND = 1e-5, 0.01  # of a period; and the share where the next order is looked for
_AT_ONCE = 1e-7  # relative to the walls: what is as close to one impacts as well
_LATER = "; one drive moves all, half a period later those with -1 in the row drive= of the Lattice"

# flows, if it is not smooth, an orbit of them, and the share of the coupling at which it is one
Uncoupled = tuple[tuple[Flow, ...], tuple[TrajectorySegment, ...], float]


class SingleOscillator:
    """One site without coupling, by its potential over its mass; of each `kind` one is enough."""

    def __init__(self, chain: Oscillators, site: int, p: Params) -> None:
        self.site, self.params, self.mass = site, {**p, SHARE: 0.0}, chain.masses[site]
        # potentials, with the sign and the weight with which they act
        self.terms = [(chain.V, 1, chain.onsite[site])]
        for (ends, _), weights in chain.parts(self.params):  # the bonds that hold it even so
            column = ends[:, [site]].toarray().ravel()
            self.terms += [(chain.W, sign, weights[column == sign].sum()) for sign in (1, -1)]
        lost, drive = chain.lattice.dampings[site], chain.lattice.drive[site]
        self.kind = (self.mass, *self.terms, lost, drive)

    def __call__(self, u: Any) -> NDArray[Any]:
        p, total = self.params, 0.0 * u
        for potential, sign, weight in self.terms:
            if weight:
                total = total + weight * (potential(sign * u, p) - potential(0.0, p))
        return np.asarray(total / self.mass)

    def pull(self, u: Any) -> NDArray[Any]:
        """Its slope."""
        return np.asarray(self(u + 1j * IMAGINARY).imag / IMAGINARY)

    @np.errstate(all="ignore")
    def half_periods(self, a: Array, sign: float) -> Array:
        """Integrate from amplitudes on one side to the turning points on the other side of rest:
        with ``u = m + h cos s`` what is smooth, ``ds / sqrt(2 (V(a) - V(u)) / (h sin s)^2)``. NaN
        where there are none: forces lead back, and what is in between, as a barrier, is lower."""
        grid, level = np.append(0.0, -sign * np.geomspace(1e-4, 1e3, 4000)), self(sign * a)
        inward = sign * self.pull(sign * a) > 0
        level = np.where(inward & (level >= np.maximum.accumulate(level)), level, np.nan)
        highest = np.maximum.accumulate(self(grid))
        highest = highest[~np.isnan(highest)]  # nothing is known beyond where it has no value
        b = np.interp(level, highest, grid[: highest.size], right=np.nan)
        for _ in range(4):  # Newton's steps, from a third of a percent off
            b = b - (self(b) - level) / self.pull(b)
        middle, half = 0.5 * (sign * a + b), 0.5 * abs(sign * a - b)
        u = middle[:, None] + half[:, None] * np.cos(_NODES)
        squares = 2 * (level[:, None] - self(u)) / (half[:, None] * np.sin(_NODES)) ** 2
        return np.asarray((1 / np.sqrt(squares)).mean(axis=1) * math.pi)

    def known(self, sign: float) -> tuple[Array, Array]:
        """Amplitudes on one side and half periods, the closer together the nearer to where there
        are none, as a separatrix, at which they grow without bound."""
        a, halves = _AMPLITUDES, self.half_periods(_AMPLITUDES, sign)
        for _ in range(_CLOSER):
            ends = np.flatnonzero(np.diff(np.isfinite(halves)))
            a = np.union1d(a, np.linspace(a[ends], a[ends + 1], 20))
            halves = self.half_periods(a, sign)
        return a, halves

    def amplitudes(self, omega: float, sign: float) -> list[float]:
        """All amplitudes on one side at which it has a frequency, the smallest first: to a part in
        ten thousand, as the equations of an orbit are solved after it."""
        a, halves = self.known(sign)
        over = halves - math.pi / omega
        with np.errstate(invalid="ignore"):
            at = np.flatnonzero(over[:-1] * over[1:] <= 0)
        slopes = (over[at + 1] - over[at]) / (a[at + 1] - a[at])
        return list(a[at] - over[at] / slopes)

    @np.errstate(all="ignore")
    def amplitude(self, code: float, omega: float) -> float:
        """The amplitude that a code stands for: of 1 and -1 the smallest one, on that side; of
        others that which is nearest."""
        sign = math.copysign(1.0, code)
        a, halves = self.known(sign)
        known = math.pi / halves  # NaN where it does not come back
        if not math.isfinite(known[0]):
            raise NoSolution(f"site {self.site}: u = 0 has to be a minimum of its potential")
        if found := self.amplitudes(omega, sign):
            wanted = 0.0 if abs(code) == 1.0 else abs(code)
            return sign * min(found, key=lambda a: abs(a - wanted))
        largest = a[~np.isnan(known)].max()
        raise NoSolution(
            f"site {self.site}: alone, up to |u| = {largest:.3g}, it oscillates at "
            f"frequencies from {np.nanmin(known):.6g} to {np.nanmax(known):.6g}, not at {omega:.6g}"
        )


def coded(chain: Oscillators, code: Any) -> dict[int, Any]:
    """The sites of a code and what they do, as it was given: a dict, or a list of sites."""
    try:
        given = dict(code) if isinstance(code, Mapping) else dict.fromkeys(code, 1)
    except TypeError:
        given = {}
    known = all(isinstance(n, int | np.integer) and 0 <= n < chain.sites for n in given)
    if not given or not known:
        shape = getattr(chain.lattice, "shape", None)
        grid = f" Site (i, j) of this grid has the number {shape[1]} i + j." if shape else ""
        raise BadInput(
            f"code = {brief(code)}: a dict of sites, from 0 to {chain.sites - 1}, and 1, -1 or an "
            f"amplitude for each was expected, {{{chain.sites // 2}: 1}} for instance.{grid}"
        )
    return {int(n): value for n, value in given.items()}


def half_without_coupling(
    chain: Oscillators, code: dict[int, Any], p: Params, scheme: Collocation
) -> Uncoupled:
    """Half of the orbit that a code stands for, without coupling."""
    x = np.zeros(2 * chain.sites)
    for site, value in code.items():
        if not (math.isfinite(real(value)) and real(value)):
            raise BadInput(f"site {site}: {value!r} was given; 1, -1 or an amplitude is expected.")
        x[site] = SingleOscillator(chain, site, p).amplitude(real(value), p["omega"])
    half, without = math.pi / p["omega"], {**p, SHARE: 0.0}
    with np.errstate(all="ignore"):  # no coupling, however little, leads from beyond a pole
        known = np.isfinite(chain.energy(x, without))
    if not known:
        raise NoSolution(
            f"{brief(code)}: without coupling |u| is {abs(x).max():.6g}, which stretches a bond to "
            f"where W = {chain.W} is not finite; take an omega at which the sites swing less."
        )
    flight = fitted(scheme, 0.0, half, chain.run((0.0, half), x, without).sol)
    return (), (flight,), 0.0


def resonance(chain: Oscillators, omega: float, p: Params) -> tuple[str, bool]:
    """Say which harmonic of a frequency is nearest to the frequencies of small oscillations, or
    among them, and tell whether it is. That there is a band between them is not said: one may be
    that of a defect."""
    band = chain.frequencies(p)
    if np.isnan(band).any():
        return "at rest it is unstable there", False
    low, high = float(band[0]), float(band[-1])
    u = np.linspace(0.1, 0.4, chain.sites)  # anywhere: where forces are odd so are all harmonics
    pull, push = chain.gradient(u, p), chain.gradient(-u, p)
    odd = not chain.dissipative and abs(pull + push).max() <= 1e-12 * abs(pull).max()
    m = np.arange(1, int(high / omega) + 3, 2 if odd else 1)
    m = m if low else np.append(0, m)  # what moves freely at rest has any mean
    off = np.maximum(np.maximum(low - m * omega, m * omega - high), 0.0)
    j = int(off.argmin())
    where = "lies among" if off[j] == 0 else f"is {off[j]:.3g} off"
    name = {0: "the mean", 1: "the frequency itself"}.get(int(m[j]), f"harmonic {m[j]}")
    x, edges = m[j] * omega, f"the frequencies of small oscillations, {low:.6g} to {high:.6g}"
    if inside := bool(off[j] == 0 and m[j]):  # where it has a gap, between these
        below, above = band[band <= x][-1], band[band >= x][0]
        edges += f", between {below:.6g} and {above:.6g}"
    return f"{name}, {x:.6g}, {where} {edges}", inside


# --- driven ones ---------------------------------------------------------------------------------


def forcing_period(t: Any, x: Any, p: Params) -> Any:
    return 2 * math.pi / p["omega"]


def refuse_other_period(chain: Oscillators, p: Params) -> None:
    """Refuse a drive that is not the same after 2 pi/omega, which is the period of a breather."""
    if chain.drive is None:
        return
    period, omega = forcing_period(0.0, None, p), p["omega"]
    t = period * np.linspace(0.05, 1.0, 16)
    now, later = chain.drive(t, p), chain.drive(t + period, p)
    if abs(later - now).max() > 1e-6 * abs(now).max():
        raise BadInput(
            f"drive = {chain.drive} does not have the period of the breather, 2*pi/omega = "
            f"{period:.6g} at omega = {omega:.6g}: write its time as omega*t, 'a*cos(omega*t)' for "
            "'a*cos(t)'"
        )


def single_field(chain: Oscillators, one: SingleOscillator) -> Function:
    """The field of one site without coupling, in its position and its velocity."""
    p, rows = one.params, [one.site, chain.sites + one.site]

    def field(t: Any, x: Any, _: Params) -> Any:
        whole = np.zeros((2 * chain.sites, *x.shape[1:]), dtype=x.dtype)
        whole[rows] = x
        return chain(t, whole, p)[rows]

    return field


def attractors(chain: Oscillators, one: SingleOscillator) -> list[Cycle]:
    """Those of one site without coupling, those that swing least first: to which it settles from
    phases and amplitudes up to beyond where it resonates, or beside a free swing."""
    from scipy.integrate import solve_ivp

    p, omega, period = one.params, one.params["omega"], forcing_period(0.0, None, one.params)
    # as large as where it resonates, or as the drive takes a free mass
    drive = abs(chain.drive(np.linspace(0, period, 64), p)).max()
    right, left = (one.amplitudes(omega, sign) for sign in (1.0, -1.0))
    size, field = max(right + left, default=drive / one.mass / omega**2), single_field(chain, one)
    r, s = np.meshgrid(_LEVELS, 2 * math.pi * np.arange(_PHASES) / _PHASES)
    start = size * np.array([(r * np.cos(s)).ravel(), -omega * (r * np.sin(s)).ravel()])

    loss = chain.lattice.dampings[one.site] / one.mass * float(chain.damping(0.0, p))
    settles = loss * period * _MOST > _CALM  # others, as without damping of their own, never do
    time = period * (math.ceil(_CALM / loss / period) if settles else _MOST)
    # no swing loses more than the drive does work: up to drive / (loss omega), beside a resonance
    far = _ESCAPED * max(size, drive / one.mass / omega * time / _CALM)

    def rates(t: float, y: Array) -> Array:  # what comes too far has escaped, and stays there
        x = y.reshape(start.shape)
        return np.ravel(np.where(abs(x[0]) < far, field(t, x, p), 0.0))

    how: Any = {"t_eval": [time - period, time], "rtol": 1e-6, "atol": 1e-6 * abs(start).max()}
    late = solve_ivp(rates, (0.0, time), start.ravel(), "DOP853", **how).y
    before, ends = np.moveaxis(late.reshape(*start.shape, 2), -1, 0)
    kept = abs(ends[0]) < far
    if settles:  # then it returns: from what is in chaos, or goes round, orbits are solved in vain
        kept &= abs(ends - before).max(axis=0) < _ALIKE * size
    starts: list[Array] = []
    balanced = _balanced(chain, one, loss, right) if right else ends[:, :0]
    for x in np.hstack([ends[:, kept], balanced]).T:
        if all(abs(x - other).max() > _ALIKE * size for other in starts):
            starts.append(x)
    how = {"period": period, "collocation": Collocation(6, 6), "events": ()}
    given = [{"u": u, "v": v} for u, v in starts]
    found = [of.orbit for of in cycles(field, given, {}, **how)] if given else []
    attracting = [orbit for orbit in found if orbit and not orbit.unstable]
    # of those that move alike, as pendula that have gone round before, or as mirror images in two
    # wells, half a period later, the one nearest to rest
    apart, velocities = list[Cycle](), list[Array]()
    for orbit in sorted(attracting, key=_off_centre):
        v = orbit.states(period * np.arange(16) / 16)[1]
        if all(abs(v - other).max() > _ALIKE * abs(v).max() for other in velocities):
            apart, velocities = [*apart, orbit], [*velocities, v, -np.roll(v, 8)]
    return sorted(apart, key=_swing)


def _balanced(
    chain: Oscillators, one: SingleOscillator, loss: float, amplitudes: list[float]
) -> Array:
    """States on free swings at the frequency of the drive, at phases where its work over a period
    is what damping takes: orbits of little drive and damping are next to these, however small the
    basin of an attractor is (V. K. Melnikov)."""
    from scipy.integrate import solve_ivp

    period, shape = forcing_period(0.0, None, one.params), (2, len(amplitudes))
    t = period * np.arange(_SAMPLES) / _SAMPLES

    def rates(_: float, y: Array) -> Array:
        u, v = y.reshape(shape)
        return np.append(v, -one.pull(u))

    turned = np.append(amplitudes, np.zeros(len(amplitudes)))
    swings = solve_ivp(rates, (0.0, period), turned, "DOP853", t_eval=t, rtol=1e-6).y
    u, v = swings.reshape(*shape, _SAMPLES)
    force = chain.lattice.drive[one.site] / one.mass * (chain.drive(t, one.params) + 0.0 * t)
    work = np.array([v @ np.roll(force, -late) for late in range(_SAMPLES)])
    gains = work > loss * (v * v).sum(axis=1)
    late, i = np.nonzero(gains != np.roll(gains, -1, axis=0))
    return np.array([u[i, -late], v[i, -late]])


def _off_centre(orbit: Cycle) -> float:
    twice = orbit.max["u"] + orbit.min["u"]
    return abs(twice) - 1e-3 * twice  # of wells at both sides the right one, for all sites


def _swing(orbit: Cycle) -> float:
    return 0.5 * (orbit.max["u"] - orbit.min["u"])


def _chosen(site: int, code: Any, found: list[Cycle]) -> Cycle:
    """The attractor that a code stands for; a number: that which swings about so far."""
    if not found:
        raise NoSolution(f"site {site}: alone it has no attractor of the period of the drive.")
    if code == "high" and len(found) == 1:
        raise NoSolution(
            f"site {site}: alone it has one attractor only, with the amplitude "
            f"{_swing(found[0]):.6g}; 'high' needs two."
        )
    if code in ("low", "high"):
        return found[0 if code == "low" else -1]
    if not real(code) > 0:
        raise BadInput(
            f"site {site}: {code!r} was given; 'low', 'high' or an amplitude is expected{_LATER}"
        )
    return min(found, key=lambda orbit: abs(_swing(orbit) - real(code)))


def driven_without_coupling(
    chain: Oscillators, code: dict[int, Any], p: Params, scheme: Collocation
) -> Uncoupled:
    """The orbit that a code stands for, without coupling; sites without a code are low."""
    if chain.drive is None or chain.damping is None or not chain.damping(0.0, p) > 0:
        raise BadInput(
            "a driven lattice needs drive= and a damping above 0: without both nothing attracts; "
            "leave them both out of a conservative one"
        )
    known, orbits = dict[Any, list[Cycle]](), list[Cycle]()
    for one in (SingleOscillator(chain, n, p) for n in range(chain.sites)):
        known[one.kind] = known.get(one.kind) or attractors(chain, one)
        orbits.append(_chosen(one.site, code.get(one.site, "low"), known[one.kind]))

    def motion(t: Array) -> Array:
        return np.stack([of.states(t) for of in orbits], axis=1).reshape(2 * chain.sites, -1)

    return (), (fitted(scheme, 0.0, forcing_period(0.0, None, p), motion),), 0.0


# --- between walls -------------------------------------------------------------------------------


def between_walls_without_coupling(
    chain: Oscillators, code: dict[int, Any], given: Params, scheme: Collocation
) -> Uncoupled:
    """The orbit of which coded sites impact, without coupling: of several perhaps at once."""
    if chain.drive is None:
        raise BadInput(
            "between walls a driven lattice is needed, drive='a*cos(omega*t)' for instance: orbits "
            "of a conservative one from impact to impact are not looked for"
        )
    if any(value != 1 for value in code.values()):
        raise BadInput(f"code = {code!r}: 1 is expected for each site that impacts{_LATER}")
    p = {**given, SHARE: 0.0}
    known, orbits = dict[Any, Cycle](), dict[int, Cycle]()
    for one in (SingleOscillator(chain, n, p) for n in code):
        orbits[one.site] = known[one.kind] = known.get(one.kind) or _impacting(chain, one)
    first = orbits[next(iter(code))].flights[0]
    begin, x = first.start + 0.5 * first.duration, np.zeros(2 * chain.sites)
    # the others beside rest, whether that attracts or not; without a potential nothing holds them
    held = chain.onsite * (chain.V.given != "0")
    idle, rest = [n for n in range(chain.sites) if n not in code], dict[Any, Cycle]()
    for one in (SingleOscillator(chain, n, p) for n in idle if held[n]):
        rest[one.kind] = rest.get(one.kind) or _beside_rest(chain, one)
        x[[one.site, chain.sites + one.site]] = rest[one.kind].states(begin)
    for n, orbit in orbits.items():
        x[[n, chain.sites + n]] = orbit.states(begin)
    share = 0.0 if held[idle].all() else _LEAST
    return *_from_impact_to_impact(chain, code, p, begin, x, scheme), share


def in_another_order(
    orbit: Cycle, chain: Oscillators, sites: Collection[int], scheme: Collocation
) -> Uncoupled | None:
    """Go on where sites that impacted at once do so one after the other, as a little coupling tells
    first, or beyond where two of them come to their walls at once: flows, an orbit of them and its
    share of the coupling. None where neither is."""
    share, wall = orbit.params[SHARE], chain.walls(0.0, orbit.params)
    off = (
        abs(f.end[n]) - wall for f, at in zip(orbit.flights, met(orbit), strict=True) for n, _ in at
    )
    if max(map(abs, off)) > _AT_ONCE * wall or (share == LITTLE and len(sites) > 1):
        longest = max(orbit.flights, key=attrgetter("duration"))
        begin = longest.start + 0.5 * longest.duration
        x = orbit.states(begin)
        return *_from_impact_to_impact(chain, sites, orbit.params, begin, x, scheme), share
    shrunk = np.flatnonzero((orbit.durations <= _SHRUNK * orbit.period) & (share < 1.0))
    return (*exchanged(orbit, chain, shrunk), min(1.0, share + _BEYOND)) if shrunk.size else None


def met(orbit: Cycle) -> list[Any]:
    """The impacts that end each flow."""
    return [cast("Any", flow.reset).impacts for flow in orbit.equations.flows]


def exchanged(
    orbit: Cycle, chain: Oscillators, shrunk: Collection[int]
) -> tuple[tuple[Flow, ...], tuple[TrajectorySegment, ...]]:
    """Make the flows, and an orbit of them, with the impacts before and after each of these flows,
    which last no time, in the other order."""
    flights, impacts = [*orbit.flights], met(orbit)
    for i in shrunk:
        impacts[i - 1], impacts[i] = impacts[i], impacts[i - 1]
        bounce = Bounce(chain, impacts[i - 1])
        flights[i] = flights[i].resting(bounce(0.0, flights[i - 1].end, orbit.params))
    return between_walls(chain, impacts), tuple(flights)


def _from_impact_to_impact(
    chain: Oscillators, sites: Collection[int], p: Params, begin: float, x: Array,
    scheme: Collocation,
) -> tuple[tuple[Flow, ...], tuple[TrajectorySegment, ...]]:  # fmt: skip
    """Simulate until each of some sites was at both of its walls, and make flows of that."""
    walls = [WallDistance(chain, n, side) for n in sites for side in (1, -1)]
    n, near, period = chain.sites, _AT_ONCE * float(chain.walls(0.0, p)), 2 * math.pi / p["omega"]
    met, flights, t = list[Any](), list[TrajectorySegment](), begin
    while sum(map(len, met[1:])) < len(walls):  # the first flight begins before any impact
        run = chain.run((t, t + period), x, p, events=walls)
        begin, t, x = t, float(run.t[-1]), run.y[:, -1]
        at = [w for w in walls if w(t, x, p) < near and w.side * x[n + w.site] > 0]
        if run.status != 1 or not at:
            raise NoSolution(f"sites {(*sites,)}: from impact to impact they do not return")
        met.append(tuple((wall.site, wall.side) for wall in at))
        flights.append(fitted(scheme, begin, t - begin, run.sol))
        x = Bounce(chain, met[-1])(t, x, p)
    return between_walls(chain, met[1:]), tuple(flights[1:])


def _beside_rest(chain: Oscillators, one: SingleOscillator) -> Cycle:
    """The orbit without impacts of one site without coupling."""
    period = forcing_period(0.0, None, one.params)
    how: dict[str, Any] = {"period": period, "events": ()}
    try:
        samples = np.linspace(0, period, 9), np.zeros((2, 9))
        return cycle_of(cycle(single_field(chain, one), samples, one.params, **how))
    except NotConverged as error:
        raise NoSolution(
            f"site {one.site}: alone no orbit of the period of the drive is found beside rest"
        ) from error


def _impacting(chain: Oscillators, one: SingleOscillator) -> Cycle:
    """The impacting orbit of one site without coupling: simulated, then along the restitution."""
    p, field = one.params, single_field(chain, one)
    wall, k, period = float(chain.walls(0.0, p)), float(chain.k(0.0, p)), 2 * math.pi / p["omega"]

    def up_to(side: int) -> Flow:
        return Flow(
            field, until=lambda t, x, p: wall - side * x[0],
            reset=lambda t, x, p: [x[0], -p["k"] * x[1]],
        )  # fmt: skip

    flows, at = [up_to(1), up_to(-1)], {"k": min(k, _SETTLED)}
    how: dict[str, Any] = {"period": period, "events": (), "collocation": Collocation(6, 6)}
    for start in wall * p["omega"] * np.multiply.outer(_VELOCITIES, (0.0, 1.0)):
        with suppress(ContbreatherError):
            ran = integrate(flows, start, at, time=_SETTLES * period, tolerance=1e-9)
            late = [f for f in ran.pieces if f.number == 0 and f.t[0] > (_SETTLES - 4) * period]
            if len(late) < 3:  # an orbit from wall to wall leaves one of them once in a period
                continue
            begin = 0.5 * float(late[-2].t[0] + late[-2].t[-1])
            found = cycle(flows, dict(zip("uv", late[-2](begin), strict=True)), at, t0=begin, **how)
            twice = len(cycle_of(found).flights) == 2
            if twice and k > _SETTLED:
                found = trace(found, "k", within={"k": (0.0, k)}, towards="up")[-1].problem
            if twice and found.params["k"] == k:
                return cycle_of(found)
    raise NoSolution(
        f"site {one.site}: alone it has no orbit that impacts once on each wall in a period, and "
        f"attracts where impacts keep at most {_SETTLED:g} of their velocity"
    )
