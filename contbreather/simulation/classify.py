"""Kinds of motion in the end, on rigid and smooth walls: verdicts, with their evidence."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind, whole
from contbreather.errors import BadInput, NotConverged
from contbreather.one_thread import one_thread
from contbreather.simulation.integrator import RunStop
from contbreather.simulation.measures import exponents, forced, localised, rotation
from contbreather.simulation.periodic import PeriodicMotion, closing
from contbreather.simulation.simulate import SimulationRun, SmoothRun, completed, let_go
from contbreather.simulation.states import ModelParameters, State, start_of
from contbreather.tables import HtmlRepr, Sheet

Array = NDArray[Any]
Finding = tuple["Kind", str]
Ran = SimulationRun | SmoothRun

LONGEST = 64  # periods after which a motion may close to count as periodic or locked
CLOSED = 1e-9  # how well it must close
NEARBY = 1e-3  # so close to returning that Newton's method is asked
POSITIVE = 1e-3  # an exponent that is chaos, if it is known so well
BROAD = 3.0  # participation ratio beyond which a state on smooth walls is no breather, and
# on rigid ones, under noise, for each site that hits regularly
LONG = 60  # sites; multipliers of a longer lattice with smooth walls take minutes


class Kind(enum.Enum):
    """Kind of motion in the end; the value is the sentence a user reads."""

    PERIODIC = "periodic: repeats with the forcing"
    LOCKED = "locked: periodic after several periods of the forcing"
    QUASI_PERIODIC = "quasi-periodic: a torus with a rotation number of its own"
    CHAOTIC = "chaotic: nearby motions separate exponentially"
    DELOCALISED = "delocalised: there is no breather, the motion is all over the lattice"
    NOISY = "noisy: the breather is there, kicked all the time"
    SYNCHRONISED = "synchronised: the breather is lost, all sites move together"
    UNDECIDED = "undecided: has not settled; let it run longer"


@dataclass(frozen=True, repr=False)
class Classification(HtmlRepr):
    """Verdict on a motion, and the numbers it rests on.

    Attributes
    ----------
    kind : Kind
    reason : str
        One sentence of evidence.
    evidence : dict
        ``participation`` (mean over the observed part), ``spread`` (largest deviation from unison),
        ``aside`` (from the forced motion), ``impacting`` (how many sites hit a rigid wall) and, as
        far as they were needed, ``return`` (distance after the best number of periods),
        ``periods``, ``multiplier`` (largest modulus), ``exponent``, ``exponent_error``,
        ``frequencies`` (exponents that are zero), ``rotation``, ``rotation_error``, ``p``, ``q``.
    run : Run or SmoothRun
        The observed part, after settling.
    motion : Kind
        Where the breather is lost to impacts everywhere, what that motion is: periodic, locked,
        quasi-periodic, chaotic or undecided. Else `kind`, also of long lattices with smooth walls.
    """

    kind: Kind
    reason: str
    evidence: Mapping[str, float]
    run: SimulationRun | SmoothRun
    motion: Kind

    def table(self) -> Sheet:
        return Sheet.of([("verdict", self.kind.name.lower()), *in_words(self.evidence)])

    def __str__(self) -> str:
        return f"{self.kind.value}; {self.reason}"

    def __repr__(self) -> str:
        return f"<{self}>"


WORDS = {
    "participation": ("participation ratio", "{:.4g}"),
    "multiplier": ("largest multiplier", "{:.9g}"),
    "rotation": ("rotation number", "{:.10f}"),
    "rotation_error": ("its error", "{:.0e}"),
    "exponent": ("largest Lyapunov exponent", "{:.3g}"),
    "exponent_error": ("its error", "{:.0e}"),
}


def in_words(evidence: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Evidence of a verdict, for people: names and numbers."""
    if "return" in evidence:
        yield f"returns {_after(int(evidence['periods']))} to", f"{evidence['return']:.2g}"
    for name, (words, shape) in WORDS.items():
        if name in evidence:
            yield words, shape.format(evidence[name])


def _after(periods: int) -> str:
    return "after a period" if periods == 1 else f"after {periods} periods"


def classify(
    state: Any,
    *,
    settle: int = 4000,
    periods: int = 4096,
    m: float | None = None,
    t0: float = 0.0,
    **on: Unpack[ModelParameters],
) -> Classification:
    """Let a lattice settle, watch it, and say what its motion is.

    Parameters
    ----------
    state, t0, on
        As in `simulate`.
    settle, periods : int
        Periods to let pass, and to watch, at least 100: the weaker the attraction, the more are
        needed.
    m : float, optional
        On smooth walls (21) of this hardness instead of rigid ones.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> b = symmetric(a=0.3, gamma=0.05, k=0.8)
    >>> found = classify(b.state(8), a=0.3, gamma=0.05, k=0.8, damping=0.05, periods=200)
    >>> found.kind.name, round(found.evidence["multiplier"], 3)
    ('PERIODIC', 0.876)
    """
    if isinstance(state, SimulationRun | SmoothRun):
        raise BadInput(f"a state was expected, got {state!r}: judge(run) says what it came to.")
    start, conditions = start_of(state, m, t0, **on)
    length = whole("periods", periods, 100)  # fewer say nothing
    run = completed(let_go(start, conditions, periods=whole("settle", settle, 0), t0=t0))
    if run.stop is RunStop.DONE:
        run = completed(let_go(run.final, conditions, periods=length, t0=t0))
    if run.stop is not RunStop.DONE:
        return Classification(Kind.UNDECIDED, run.reason, {}, run, Kind.UNDECIDED)
    return judge(run)


@one_thread
def judge(run: SimulationRun | SmoothRun) -> Classification:
    """The verdict on a run that has settled; see `classify`.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> from contbreather.simulation import simulate_smooth
    >>> b = symmetric(a=0.1, gamma=0.05, k=0.8)
    >>> shared = {"a": 0.1, "gamma": 0.05, "k": 0.8, "damping": 0.02, "m": 6}
    >>> settled = simulate_smooth(b.state(6), periods=200, **shared).final
    >>> judge(simulate_smooth(settled, periods=50, **shared)).kind.name
    'PERIODIC'
    """
    check_kind(run, (SimulationRun, SmoothRun), "a run of simulate")
    if len(run.times) < 2:
        raise BadInput("a verdict is about whole periods; the run has none.")
    evidence = _where(run)
    if isinstance(run, SimulationRun) and run.noise:
        kicked, reason = _kicked(run, evidence)
        reason = f"{reason}, under noise of strength {run.noise:g}"
        return Classification(kicked, reason, evidence, run, Kind.NOISY)
    kind, reason = _lost(run, evidence) or (None, "")
    long = isinstance(run, SmoothRun) and run.sites > LONG
    if kind is Kind.SYNCHRONISED or (kind is not None and long):
        return Classification(kind, reason, evidence, run, kind)
    closed, repelling = _closed(run, evidence)
    motion, why = closed or _open(run, evidence, repelling, lost=kind is not None)
    # where it comes back those that hit, or have the energy, are breathers of several sites
    several = evidence.get("impacting", evidence["participation"]) <= run.sites // 2
    if kind is None or (closed and several):
        return Classification(motion, why, evidence, run, motion)
    return Classification(kind, f"{reason}; {motion.name.lower()}, {why}", evidence, run, motion)


def _where(run: Ran) -> dict[str, float]:
    u, v = run.strobe
    on, late = run.conditions, run.since(run.periods // 2)
    seen = localised(u, v, run.times, on)
    off, quick = (np.abs(x - forced(on, late.times, r)) for r, x in enumerate(late.strobe))
    evidence = {
        "participation": float(seen.participation.mean()),
        "spread": float(max(np.ptp(u, axis=1).max(), np.ptp(v, axis=1).max())),
        "aside": float(max(off.max(), quick.max())),
    }
    if isinstance(run, SimulationRun):
        evidence["impacting"] = float(len(np.unique(late.impacts["site"])))
    return evidence


def _lost(run: Ran, evidence: dict[str, float]) -> Finding | None:
    """No breather any more: nobody hits, all move alike, or impacts (on smooth walls, which do not
    count them, the energy) are all over the lattice."""
    sites, impacting = run.sites, evidence.get("impacting")
    if impacting == 0.0:
        reason = f"no impacts; every site within {evidence['aside']:.2g} of the forced motion"
        return Kind.SYNCHRONISED, reason
    # far above rounding; a breather differs by order 1 from the sites far from it
    if sites > 1 and evidence["spread"] < 1e-6:
        reason = f"all {sites} sites are within {evidence['spread']:.1g} of each other"
        return Kind.SYNCHRONISED, reason
    ratio = f"participation ratio {evidence['participation']:.1f}"
    if impacting is None and sites > 2 and evidence["participation"] > BROAD:
        return Kind.DELOCALISED, f"{ratio} of {sites}"
    if impacting is not None and sites > 2 and impacting > max(2, sites // 4):
        return Kind.DELOCALISED, f"{impacting:.0f} of {sites} sites hit their walls, {ratio}"
    return None


def _kicked(run: SimulationRun, evidence: dict[str, float]) -> Finding:
    """Under noise any site may hit now and then: a breather's few hit regularly, and have most of
    the energy."""
    late, sites = run.since(run.periods // 2), run.sites
    hits = np.unique(late.impacts[["site", "period"]])
    # a site that hits in every second period, but for some, is one that hits regularly
    regular = int(np.sum(np.bincount(hits["site"]) > 0.4 * late.periods))
    ratio = f"participation ratio {evidence['participation']:.1f}"
    words = f"{regular} of {sites} sites hit their walls regularly, {ratio}"
    if evidence["participation"] <= BROAD * regular and regular <= max(2, sites // 4):
        return Kind.NOISY, words
    common = max(np.abs(forced(run.conditions, late.times, order)).max() for order in (0, 1))
    # noise may kick sites away from the forced motion by this part of it
    if not regular and evidence["aside"] < 0.1 * common:
        reason = f"no site hits regularly; each within {evidence['aside']:.2g} of the forced motion"
        return Kind.SYNCHRONISED, reason
    return Kind.DELOCALISED, words


def _closed(run: Ran, evidence: dict[str, float]) -> tuple[Finding | None, PeriodicMotion | None]:
    """Periodic or locked: Newton's method finds a motion that closes next to the run's end.

    Where that motion repels and the run is still beside it, it is given back too: a run returns to
    it for as long as rounding takes to grow, and is none the less about to leave.
    """
    n, gaps = _returns(run)
    gap = float(gaps[n - 1])
    evidence |= {"return": gap, "periods": float(n)}
    if isinstance(run, SmoothRun) and run.sites > LONG:
        reason = f"returns to {gap:.1g} {_after(n)}, its multipliers were not computed"
        kind = Kind.PERIODIC if n == 1 else Kind.UNDECIDED
        return ((kind, reason) if gap < CLOSED else None), None
    repelling = None
    # beyond 1 rounding, or the integration, may take a multiplier by so much
    slack = 1e-6 if isinstance(run, SmoothRun) else 1e-7
    # a spiral into a fixed point nearly closes after many numbers of periods: ask for 1 first
    for candidate in dict.fromkeys((1, n)):
        if gaps[candidate - 1] >= NEARBY:
            continue
        try:
            how: dict[str, Any] = {"periods": candidate, "t0": float(run.times[0])}
            motion = closing(_last(run), run.conditions, **how)
        except NotConverged:
            continue
        if _distance(run, motion) >= 10.0 * NEARBY:
            continue
        if motion.largest < 1.0 + slack:
            return _periodic(run, evidence, motion), None
        if repelling is None and _leaving(run, motion):
            repelling = motion
    if gap > CLOSED:
        return None, repelling
    if repelling is not None:
        return (Kind.UNDECIDED, _repels(run, evidence, repelling)), repelling
    reason = f"returns after {n} to {gap:.1g}, but Newton's method finds no closed orbit"
    return (Kind.UNDECIDED, reason), None


def _returns(run: Ran) -> tuple[int, Array]:
    """After how many periods a run comes back best, and how close after each number of them."""
    x = np.concatenate(run.strobe, axis=1)
    longest = max(1, min(LONGEST, len(x) // 3))
    # the last eight states, each against that so many periods before: chance returns one, not eight
    gaps = np.array(
        [np.abs(x[-1 - n :: -1][:8] - x[: n - 1 : -1][:8]).max() for n in range(1, longest + 1)]
    )
    # the shortest of those that are as good as the best: its multiples return as well
    return 1 + int(np.argmax(gaps < max(CLOSED, 2.0 * gaps.min()))), gaps


def _last(run: Ran) -> State:
    """The last state once in a period, at the phase of the first one."""
    return State(run.strobe.u[-1], run.strobe.v[-1])


def _distance(run: Ran, motion: PeriodicMotion) -> float:
    return float(np.abs(np.subtract(_last(run), motion.state)).max())


def _leaving(run: Ran, motion: PeriodicMotion) -> bool:
    """Say if a run has been beside a motion that repels all the time, and no longer than it can.

    A chaotic band passes by such motions again and again, or is narrow and stays beside one for
    ever: neither starts within rounding of it and moves away.
    """
    n = motion.periods
    states = np.concatenate(run.strobe, axis=1)[-1::-n]
    away = np.abs(states - np.concatenate(motion.state)).max(axis=1)
    # from rounding eps on, a distance grows to order 1 within log(1/eps)/log(largest) periods
    beside = bool(away.max() < 10.0 * NEARBY)
    return beside and len(away) * math.log(motion.largest) < -math.log(np.finfo(float).eps)


def _repels(run: Ran, evidence: dict[str, float], motion: PeriodicMotion) -> str:
    evidence["multiplier"] = motion.largest
    return (
        f"{_distance(run, motion):.1g} from a motion that repeats {_after(motion.periods)}, "
        f"largest multiplier {motion.largest:.6g}: it repels, and the run has not left it yet"
    )


def _periodic(run: Ran, evidence: dict[str, float], orbit: PeriodicMotion) -> Finding:
    x = np.concatenate(completed(orbit.run()).strobe, axis=1)
    gaps = np.abs(x[1:] - x[0]).max(axis=1)
    # it may close after fewer periods than were asked for; Newton's method stops at steps of 1e-9,
    # and what is left of it grows along the orbit
    n = 1 + int(np.argmax(gaps < 1e-7))
    evidence |= {"periods": float(n), "multiplier": orbit.largest ** (n / orbit.periods)}
    reason = f"{_distance(run, orbit):.1g} from it, largest multiplier {evidence['multiplier']:.6g}"
    if n == 1:
        return Kind.PERIODIC, reason
    p = round(rotation(*run.strobe).number * n)
    evidence |= {"p": float(p), "q": float(n)}
    return Kind.LOCKED, f"{p}:{n}, {reason}"


def _open(
    run: Ran, evidence: dict[str, float], repelling: PeriodicMotion | None, *, lost: bool
) -> Finding:
    """Not closed: chaos, or a torus, by its turns and its exponents from its end on; of a motion
    with impacts all over the lattice, each of them slow, by one exponent over fewer periods."""
    # directions that shrink slowly take as long to find as the motion to settle
    count, length, settle = min(3, 2 * run.sites), run.periods, max(300, run.periods)
    if isinstance(run, SmoothRun):
        count, length, settle = 1, 200, 50  # periods, of which each takes long
    elif lost:
        count, length, settle = 1, min(length, 400), 100
    turn, t0 = rotation(*run.strobe), float(run.times[0])
    found = exponents(_last(run), run.conditions, length, count, settle=settle, t0=t0)
    exponent, error = float(found.exponents[0]), float(found.error[0])
    # zero where it cannot be told from it, known where halves of the run agree on it
    neutral = 1e-5 if isinstance(run, SmoothRun) else 1e-6
    small = np.abs(found.exponents) < np.maximum(5.0 * found.error, neutral)
    frequencies = int(np.sum(small & (found.error < neutral)))
    evidence |= {"rotation": turn.number, "rotation_error": turn.error, "exponent": exponent,
                 "exponent_error": error, "frequencies": float(frequencies)}  # fmt: skip
    words = f"largest exponent {exponent:.2g} ({error:.0e})"
    # beside a motion that repels a positive exponent is no chaos, but that motion's own
    if repelling is None and exponent > max(5.0 * error, POSITIVE):
        return Kind.CHAOTIC, words
    turns = f"rotation number {turn.number:.10f} ({turn.error:.0e})"
    # of a torus two halves of a run agree so well on the rotation number, and on the size
    steady = turn.error <= 1e-6 and turn.hole >= 1e-3 and turn.drift <= 1e-4
    if not steady:
        turns = f"{turns}, the section's size changes by {turn.drift:.0e}"
    # bands visited in turn, of chaos or a long period, have a rational number as sharp as that of a
    # locked motion, but for the rounding of a long mean: no sign of a torus
    q = np.arange(1, LONGEST + 1)
    rational = (np.abs(turn.number - np.round(turn.number * q) / q) < 1e-7).any()
    if not (steady and small[0] and error <= (neutral if rational else POSITIVE)):
        open_ = f"{turns}, {words}" if repelling is None else _repels(run, evidence, repelling)
        return Kind.UNDECIDED, open_
    if frequencies > 1:
        words += (
            f"; {frequencies} exponents are zero: a torus of {frequencies} frequencies beside 1"
        )
    return Kind.QUASI_PERIODIC, f"{turns}, {words}"
