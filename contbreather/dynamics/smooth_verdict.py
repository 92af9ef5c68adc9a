"""What a run on a smooth ring has come to: the verdicts of `quasiperiodic`, as far as they go here.

Smooth walls keep no list of impacts, and no exponents are computed; so a motion that neither
repeats nor turns steadily stays undecided.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from contbreather.continuation import walk
from contbreather.dynamics.energy import localisation
from contbreather.dynamics.quasiperiodic import (
    CLOSED,
    LONGEST,
    NEARBY,
    RESOLVED,
    STEADY,
    Kind,
    rotation,
)
from contbreather.dynamics.smooth import SmoothRun
from contbreather.dynamics.smooth_shooting import SmoothOrbit, smooth_orbit
from contbreather.errors import NotConverged

BROAD = 3.0  # participation ratio beyond which a state is no breather
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
    c, (u, v) = run.conditions, run.strobe
    shared: dict[str, Any] = {"a": c.a, "gamma": c.gamma, "damping": c.damping}
    seen = localisation(u, v, run.times, forcing=c.forcing, **shared)
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
    """Periodic or locked, if the last states repeat."""
    x = np.concatenate(run.strobe, axis=1)
    longest = min(LONGEST, len(x) // 3)
    gaps = np.array([np.abs(x[n:] - x[:-n])[-8:].max() for n in range(1, longest + 1)])
    n = 1 + int(np.argmax(gaps < max(CLOSED, 2.0 * gaps.min())))
    n = 1 if gaps[0] < NEARBY else n  # a spiral into a fixed point nearly closes after many
    evidence |= {"return": float(gaps[n - 1]), "periods": float(n)}
    if n == 1:
        return _near(run, evidence)
    if gaps[n - 1] > RESOLVED:
        return None
    reason = f"returns after {n} periods to {gaps[n - 1]:.1g}"
    return SmoothVerdict(Kind.LOCKED, reason, evidence)


def _near(run: SmoothRun, evidence: dict[str, float]) -> SmoothVerdict | None:
    """Next to a motion of the forcing's period: does that attract?"""
    back = f"returns to {evidence['return']:.1g} after a period"
    orbit = _orbit(run) if run.sites <= LONG else None
    if orbit is None:
        if evidence["return"] < CLOSED:
            reason = f"{back}, its multipliers were not computed"
            return SmoothVerdict(Kind.PERIODIC, reason, evidence)
        return None
    away = float(np.abs(np.subtract(run.final, orbit.state)).max())
    evidence |= {"multiplier": orbit.largest}
    reason = f"{away:.1g} from it, largest multiplier {orbit.largest:.6g}"
    if orbit.largest > 1.0 + 1e-6:
        return SmoothVerdict(Kind.UNDECIDED, f"{reason}: it repels", evidence)
    return SmoothVerdict(Kind.PERIODIC, reason, evidence)


def _orbit(run: SmoothRun) -> SmoothOrbit | None:
    """The periodic motion next to the end of a run."""
    c = run.conditions
    shared: dict[str, Any] = {"a": c.a, "gamma": c.gamma, "lam": c.lam, "m": c.m}
    shared |= {"damping": c.damping, "forcing": c.forcing, "t0": run.times[-1]}
    last = run.strobe.u[-1], run.strobe.v[-1]
    for symmetric in (True, False):
        try:
            problem, _ = smooth_orbit(last, symmetric=symmetric, **shared).solve()
        except NotConverged:
            continue
        found: SmoothOrbit = next(walk(problem, "a", events=())).solution
        if np.abs(np.subtract(last, found.state)).max() < 100.0 * NEARBY:
            return found
    return None


def _open(run: SmoothRun, evidence: dict[str, float]) -> SmoothVerdict:
    """A torus, if its rotation number converges."""
    turn = rotation(*run.strobe)
    evidence |= {"rotation": turn.number, "rotation_error": turn.error}
    words = f"rotation number {turn.number:.8f} ({turn.error:.0e})"
    if turn.error > RESOLVED or turn.hole < 1e-3 or turn.drift > STEADY:
        words += f", the section's size changes by {turn.drift:.0e}"
        return SmoothVerdict(Kind.UNDECIDED, words, evidence)
    return SmoothVerdict(Kind.QUASI_PERIODIC, words, evidence)
