"""Zeros of analytic functions: counted by the turning on a curve, found by Newton's method; and
multipliers of a finite lattice next to a circle, what events of real ones and of pairs test."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import NotConverged
from contbreather.tables import HtmlRepr, Sheet, yes_or_no

Array = NDArray[Any]

TURN = 0.6  # largest step between neighbouring samples, relative to their modulus
DEPTH = 40  # halvings of one interval
MOST = 2**12  # samples of one piece: one that asks for more has a zero on it, or is rounding


@dataclass(frozen=True)
class Count(HtmlRepr):
    """Multipliers strictly outside the unit circle: a count, and how sure it is.

    ``distance`` is the smallest of what vanishes where a multiplier is on the circle, relative to
    the size of its terms, at ``mu = exp(i pi nu)``. Where it is below rounding, a multiplier sits
    there: the parameters are a bifurcation, and ``certain`` is False; so it is next to
    gamma = 1/4. ``pairs`` is half the count without the two whose presence signs on the real axis
    betray, one above 1 and one below -1: it changes where complex pairs cross the circle, and
    nowhere else on it.
    """

    count: int
    certain: bool
    distance: float
    nu: float
    pairs: int

    def __int__(self) -> int:
        return self.count

    def table(self) -> Sheet:
        """The count, how sure it is, and where a multiplier is closest to the circle."""
        return Sheet.of([
            ("multipliers outside", self.count), ("complex pairs of them", self.pairs),
            ("certain", yes_or_no(self.certain)), ("least modulus", self.distance),
            ("at nu", self.nu),
        ])  # fmt: skip


def steep(F: Array, floor: float) -> Array:
    """Intervals on which F moves by much of its modulus, above the floor; and those beside."""
    size = np.abs(F)
    # a chord of 0.6 |F| turns by asin(0.6) = 0.64 at most: no winding is missed between samples
    moves = np.abs(F[1:] - F[:-1]) > TURN * np.minimum(size[1:], size[:-1])
    moves &= np.maximum(size[1:], size[:-1]) > floor
    wide = moves.copy()
    wide[1:] |= moves[:-1]
    wide[:-1] |= moves[1:]
    return wide


def refined_samples(
    x: Array,
    place: Callable[[Array], Array],
    value: Callable[[Array], Array],
    floor: float,
    most: int = MOST,
) -> tuple[Array, Array, bool]:
    """Samples put closer wherever the function moves by much of its modulus, unless that is nothing
    but rounding, below the floor: about a zero on the circle itself. With several sites F has more
    rounding than its terms tell, so that the samples are bounded as well; were they enough?"""
    F = value(place(x))
    for _ in range(DEPTH):
        i = np.flatnonzero(steep(F, floor) & (x[1:] - x[:-1] > 1e-13))
        if i.size == 0:
            break
        if x.size + i.size > most:
            return x, F, False
        between = 0.5 * (x[i] + x[i + 1])
        x, F = np.insert(x, i + 1, between), np.insert(F, i + 1, value(place(between)))
    return x, F, True


def newton_from_all(
    step: Callable[[Array], Array],
    x: Array,
    steps: int,
    rough: float,
    longest: float = math.inf,
    within: Callable[[Array], Array] = np.asarray,
    unit: Callable[[Array], Any] = lambda x: 1.0,
) -> Array:
    """Run Newton's method from all these starts at once; zeros come with repetitions.

    A start is done with a step below `rough`, and lost where a step is not finite. Longer steps
    than `longest` are shortened: a start stays in its own neighbourhood. `within` brings places
    back to where they are looked for, and drops those that are too far off. Both lengths are in
    units that may depend on the place.
    """
    zeros: list[Array] = []
    for _ in range(steps):
        with np.errstate(all="ignore"):
            move = step(x)
            size = np.abs(move)
        done = size < rough * unit(x)
        zeros.append(within(x[done] - move[done]))
        going = ~done & np.isfinite(move)
        far = size[going] / (longest * unit(x[going]))
        x = within(x[going] - move[going] / np.maximum(1.0, far))
        if x.size == 0:
            break
    return np.concatenate(zeros)


def distinct(x: Array, apart: float | Array) -> Array:
    """Each once, in their order."""
    kept: list[complex] = []
    for root, least in zip(x.tolist(), np.broadcast_to(apart, x.shape).tolist(), strict=True):
        if all(abs(root - other) > least for other in kept):
            kept.append(root)
    return np.array(kept, dtype=complex)


def highest(f: Callable[[Array], Array], low: float, high: float) -> tuple[float, float]:
    """Maximum of a function between two places: where, and its value."""
    for _ in range(5):  # each grid is 32 times finer: to 1e-8, which a maximum feels as 1e-16
        x = np.linspace(low, high, 65)
        values = f(x)
        top = int(values.argmax())
        low, high = x[max(top - 1, 0)], x[min(top + 1, 64)]
    return float(x[top]), float(values[top])


def as_counted(
    wanted: Any, look: Callable[[int], Array], rounds: Iterable[int], slack: float = 0, at: str = ""
) -> Array:
    """The multipliers outside the unit circle that Newton's method finds, largest first: held to
    the winding number, as many as that says, and each round looked for from more starts."""
    mu = np.empty(0, dtype=complex)
    for more in rounds:
        if wanted.count:
            mu = look(more)
        # those on the circle to within rounding are outside only if the winding number says so
        if mu.size >= wanted.count and np.all(np.abs(mu[wanted.count :]) < 1.0 + slack):
            return mu[: wanted.count]
    if not wanted.certain:  # one of them sits on the circle to within rounding
        return mu
    raise NotConverged(
        f"{at}the winding number says {wanted.count} multipliers outside the unit circle, "
        f"Newton's method found {mu.size}: {mu}.",
        residual=wanted.distance,
    )


def multipliers_of(nu: Array) -> Array:
    """``exp(i pi nu)`` with 0 <= Re nu <= 1, the largest first, complex ones with conjugates."""
    nu = nu[np.argsort(nu.imag, kind="stable")]
    for axis in (0.0, 1.0):  # real ones exactly on the real axis
        nu = np.where(np.abs(nu.real - axis) < 1e-9, axis + 1j * nu.imag, nu)
    twice = np.where((nu.real == 0.0) | (nu.real == 1.0), 1, 2)  # a real one stands alone
    mu = np.repeat(np.exp(1j * math.pi * nu), twice)
    second = np.cumsum(twice)[twice == 2] - 1
    mu[second] = mu[second].conj()
    real = np.repeat(twice == 1, twice)
    mu[real] = mu[real].real
    return mu


# --- multipliers of a finite lattice --------------------------------------------------------------

REAL = 1e-8  # a multiplier with a smaller imaginary part counts as real


def beyond(mu: Array, place: float) -> int:
    """Count the real multipliers farther out than a place on the real axis, on its side."""
    real = mu[mu.imag == 0.0].real
    return int(np.count_nonzero(real > place if place > 0.0 else real < place))


def outermost(mu: Array, radius: float = 1.0) -> float:
    """By how much the first pair has left a circle, -1 if there is none: for rings."""
    return float(np.abs(upper(mu)).max(initial=0.0)) / radius - 1.0


def passing(mu: Array, radius: float = 1.0) -> tuple[float, int]:
    """Distance of the nearest pair from a circle, signed by the parity of those outside; these."""
    off = np.abs(upper(mu)) / radius - 1.0
    outside = int(np.count_nonzero(off > 0.0))
    return (-1.0) ** outside * float(abs(off).min(initial=1.0)), outside


def upper(mu: Array) -> Array:
    """Complex ones in the upper half plane; those of modes without impacts never leave."""
    return np.asarray(mu[mu.imag > REAL])


def nearest_pair(mu: Array, radius: float = math.inf) -> float:
    """Angle, over pi, of the pair nearest to a circle, the farthest out unless given; or NaN."""
    pairs = upper(mu)
    size = abs(pairs)
    first = (abs(size - radius) if radius < math.inf else -size).argmin() if pairs.size else None
    return math.nan if first is None else float(np.angle(pairs[first])) / math.pi
