"""What a run on a smooth ring has come to: the verdicts of `quasiperiodic`, as far as they go here.

Smooth walls keep no list of impacts, and an exponent is computed only of what turns steadily; so
a motion that neither repeats nor turns steadily stays undecided.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from contbreather.dynamics.energy import localised
from contbreather.dynamics.quasiperiodic import (
    CLOSED,
    LONGEST,
    NEARBY,
    POSITIVE,
    RESOLVED,
    STEADY,
    Kind,
    rational,
    rotation,
)
from contbreather.dynamics.returning import closing
from contbreather.dynamics.smooth import SmoothRun
from contbreather.dynamics.states import PERIOD, State
from contbreather.dynamics.tangent import variation, weighted_mean
from contbreather.errors import NotConverged

BROAD = 3.0  # participation ratio beyond which a state is no breather
SEEN = 300  # periods over which an exponent is averaged
FLAT = 1e-5  # an exponent that is zero, to what the integration and so many periods tell
LONG = 60  # sites; multipliers of a longer smooth ring take minutes


class SmoothVerdict(NamedTuple):
    """What a motion is, one sentence why, and the numbers."""

    kind: Kind
    reason: str
    evidence: dict[str, float]


def judge_smooth(run: SmoothRun) -> SmoothVerdict:
    """The verdict on a smooth run that has settled.

    Examples
    --------
    >>> from contbreather.breathers import symmetric
    >>> from contbreather.dynamics import simulate_smooth
    >>> b = symmetric(a=0.1, gamma=0.05, k=0.8)
    >>> shared = {"a": 0.1, "gamma": 0.05, "k": 0.8, "damping": 0.02, "m": 6}
    >>> settled = simulate_smooth(b.state(6), periods=200, **shared).final
    >>> judge_smooth(simulate_smooth(settled, periods=50, **shared)).kind.name
    'PERIODIC'
    """
    u, v = run.strobe
    seen = localised(u, v, run.times, run.conditions)
    evidence = {
        "participation": float(seen.participation.mean()),
        "spread": float(max(np.ptp(u, axis=1).max(), np.ptp(v, axis=1).max())),
    }
    if run.sites > 1 and evidence["spread"] < 1e-6:
        reason = f"all {run.sites} sites are within {evidence['spread']:.1g} of each other"
        return SmoothVerdict(Kind.SYNCHRONISED, reason, evidence)
    if run.sites > 2 and evidence["participation"] > BROAD:
        reason = f"participation ratio {evidence['participation']:.1f} of {run.sites}"
        return SmoothVerdict(Kind.DELOCALISED, reason, evidence)
    return _closed(run, evidence) or _open(run, evidence)


def _closed(run: SmoothRun, evidence: dict[str, float]) -> SmoothVerdict | None:
    """Periodic or locked, if the last states repeat and Newton's method closes the orbit."""
    x = np.concatenate(run.strobe, axis=1)
    longest = min(LONGEST, len(x) // 3)
    gaps = np.array([np.abs(x[n:] - x[:-n])[-8:].max() for n in range(1, longest + 1)])
    n = 1 + int(np.argmax(gaps < max(CLOSED, 2.0 * gaps.min())))
    n = 1 if gaps[0] < NEARBY else n  # a spiral into a fixed point nearly closes after many
    gap = float(gaps[n - 1])
    evidence |= {"return": gap, "periods": float(n)}
    if gap > (100.0 * NEARBY if n == 1 else RESOLVED):
        return None
    after = "a period" if n == 1 else f"{n} periods"
    if run.sites > LONG:
        reason = f"returns to {gap:.1g} after {after}, its multipliers were not computed"
        kind = Kind.PERIODIC if n == 1 else Kind.UNDECIDED
        return SmoothVerdict(kind, reason, evidence) if gap < CLOSED else None
    orbit = _orbit(run, n)
    if orbit is None:
        reason = f"returns to {gap:.1g} after {after}, but Newton's method finds no closed orbit"
        return SmoothVerdict(Kind.UNDECIDED, reason, evidence) if gap < CLOSED else None
    away, largest = orbit
    evidence |= {"multiplier": largest}
    reason = f"{away:.1g} from it, largest multiplier {largest:.6g}"
    if largest > 1.0 + 1e-6:
        return SmoothVerdict(Kind.UNDECIDED, f"{reason}: it repels", evidence)
    kind = Kind.PERIODIC if n == 1 else Kind.LOCKED
    return SmoothVerdict(kind, reason if n == 1 else f"after {n} periods, {reason}", evidence)


def _orbit(run: SmoothRun, periods: int) -> tuple[float, float] | None:
    """How far the motion of that many periods is from the end of a run; its largest multiplier."""
    last = State(run.strobe.u[-1], run.strobe.v[-1])
    try:
        found = closing(last, run.conditions, periods=periods, t0=float(run.times[-1]))
    except (NotConverged, ArithmeticError):
        return None
    away = float(np.abs(np.subtract(last, found.state)).max())
    return (away, found.largest) if away < 100.0 * NEARBY else None


def _open(run: SmoothRun, evidence: dict[str, float]) -> SmoothVerdict:
    """A torus, if its rotation number converges and no exponent is positive; or chaos."""
    turn = rotation(*run.strobe)
    evidence |= {"rotation": turn.number, "rotation_error": turn.error}
    words = f"rotation number {turn.number:.8f} ({turn.error:.0e})"
    if turn.error > RESOLVED or turn.hole < 1e-3 or turn.drift > STEADY:
        words += f", the section's size changes by {turn.drift:.0e}"
        return SmoothVerdict(Kind.UNDECIDED, words, evidence)
    exponent, error = _exponent(run)
    evidence |= {"exponent": exponent, "exponent_error": error}
    words += f", largest exponent {exponent:.2g} ({error:.0e})"
    kind, bands = Kind.QUASI_PERIODIC, rational(turn.number)
    if exponent > max(5.0 * error, POSITIVE):
        kind = Kind.CHAOTIC
    elif abs(exponent) > max(5.0 * error, FLAT) or error > (FLAT if bands else POSITIVE):
        kind = Kind.UNDECIDED
    return SmoothVerdict(kind, words, evidence)


def _exponent(run: SmoothRun) -> tuple[float, float]:
    """The largest exponent along the last periods of a run, and how well halves agree on it."""
    column = np.random.default_rng(0).normal(size=(2 * run.sites, 1))
    sizes = []
    for j in range(max(0, run.periods - SEEN), run.periods):
        first = State(run.strobe.u[j : j + 1], run.strobe.v[j : j + 1])
        own = replace(run, times=run.times[j : j + 1], strobe=first, end=float(run.times[j + 1]))
        column = variation(own, column / np.linalg.norm(column))
        sizes.append(np.log(np.linalg.norm(column)) / PERIOD)
    rates = np.array(sizes[len(sizes) // 4 :])  # the first ones turn it where it grows most
    half = len(rates) // 2
    early, late = weighted_mean(rates[:half]), weighted_mean(rates[half:])
    return float(weighted_mean(rates)), float(abs(early - late))
