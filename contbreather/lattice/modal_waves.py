"""Answers of modes to recurring impulses and their slopes, as sums of waves: text for kernels.

What they are says `contbreather.lattice.response`. A mode ``z`` away from everything answers with
``Re A exp(l s)`` of both its roots l, with D their difference and ``E = exp(l T)``:

    ``A = sign/(D (1 - e E))``,  ``dl/dz = -sign/D``,  ``dA/dz = A (2/D^2 + e T E l'/(1 - e E))``,

and the derivative of ``A l^n exp(l s)`` in z is ``(A' l^n + A l' (s l^n + n l^(n-1))) exp(l s)``.
A mode that drifts, is critically damped or has an amplitude among the unknowns is the mean of such
waves over a circle around z. The slope in the damping is the velocity of that in z.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contbreather.kernels import ComplexMatrix, Counts, Cube, Kernel, Matrix, Vector, inlined
from contbreather.lattice.periodic_green import section_length, sections_between

CLOSE = 0.05  # of the distance to the next harmonic, z from 0 or from critical damping
RADIUS = 0.1  # of that distance: 16 places on the circle are exact to 0.1^16
MOST = 18  # waves of a mode: 8 places with their conjugates, two waves each, and its harmonic
RATE, SIZE, GROWTH, DRIFT = range(4)  # l, A, A', A l' of each wave
VALUE, BY_GAMMA, BY_SPRING, BY_DAMPING = 0, 4, 7, 10  # first rows of interactions: orders 0, 1, ...


class Recurring(NamedTuple):
    """Impulses that recur after a section."""

    turns: float
    half: bool  # with the other sign, after half a period


class ModeWaves(NamedTuple):
    """ModeWaves of all modes, one mode after the other."""

    parts: ComplexMatrix  # RATE.. of each wave
    modes: Counts  # whose it is
    level: Matrix  # constant of each mode, and its slope
    apart: Vector  # in z, of each mode from the next harmonic
    filled: Counts  # number of all waves


class HeldModes(NamedTuple):
    """Modes of a lattice, and the harmonics that are taken out of each: of most none, 0."""

    lam: Vector
    swings: Vector
    gamma: float
    spring: float
    damping: float
    circles: bool  # take means over circles for all modes: slopes then are waves of the same rates


def find_waves(of: HeldModes, on: Recurring, out: ModeWaves) -> None:
    """Waves of modes ``z = gamma lam + spring``."""
    out.filled[0], T, damping, swings = 0, section_length(on), of.damping, of.swings
    for k in range(of.lam.size):
        z = of.gamma * of.lam[k] + of.spring
        apart = out.apart[k] = harmonic_gap(z, swings[k], damping, on)
        slow = of.circles or abs(z - 0.25 * damping * damping) < CLOSE * apart or swings[k] > 0.0
        if not on.half:
            slow = slow or abs(z) < CLOSE * apart
        out.level[k, 0] = out.level[k, 1] = 0.0
        if not slow:
            swinging = z > 0.25 * damping * damping  # both waves are one, and its conjugate
            add_waves(out, k, complex(z, 0.0), damping, on, 2.0 if swinging else 1.0, 0j, 0j)
            if not on.half:
                out.level[k, 0], out.level[k, 1] = -1.0 / (z * T), 1.0 / (z * z * T)
            continue
        for p in range(8):
            angle = math.pi * (p + 0.5) / 8.0
            step = RADIUS * apart * complex(math.cos(angle), math.sin(angle))
            place, share = z + step, 0.125 / step  # with its conjugate: real parts
            add_waves(out, k, place, damping, on, 0.0, 0.125 + 0j, share)
            if not on.half:
                out.level[k, 0] -= (0.125 / (place * T)).real
                out.level[k, 1] -= (share / (place * T)).real
        if swings[k] > 0.0:
            for side in range(2):
                rate = complex(0.0, swings[k] if side == 0 else -swings[k])
                harmonic = harmonic_slope = 0j
                for p in range(8):
                    angle = math.pi * (p + 0.5) / 8.0
                    step = RADIUS * apart * complex(math.cos(angle), math.sin(angle))
                    gap = z + step - swings[k] * swings[k] + rate * damping
                    harmonic -= 0.125 / (T * gap)
                    harmonic_slope -= 0.125 / (step * T * gap)
                add(out, k, rate, harmonic, harmonic_slope, 0j)


@inlined
def harmonic_gap(z: float, swing: float, damping: float, on: Recurring) -> float:
    """Distance of z from the harmonics of the orbit; that of 0 is taken out, and so is a swing."""
    first = 1.0 / on.turns
    step = 2.0 * first if on.half else first
    near, apart = max(0.0, math.floor((math.sqrt(abs(z)) - first) / step + 0.5)), math.inf
    for i in range(3):
        w = first + step * (near + i - 1.0)
        taken = swing > 0.0 and abs(w - swing) < 0.25 * step
        if w >= 0.5 * first and not taken:
            real, loss = z - w * w, damping * w
            apart = min(apart, math.sqrt(real * real + loss * loss))
    return apart


@inlined
def add_waves(
    out: ModeWaves, k: int, z: complex, damping: float, on: Recurring, times: float, share: complex,
    by_share: complex,
) -> None:  # fmt: skip
    """Waves of a mode, two or, with 2 times the one, its real half; or their shares of a mean."""
    T = section_length(on)
    root = complex_root(z - 0.25 * damping * damping)
    D = 2j * root
    for side in range(1 if times == 2.0 else 2):
        sign = 1.0 - 2.0 * side
        rate = sign * 1j * root - 0.5 * damping
        if on.half:
            E = exponential(rate * T)
            rest, slope = 1.0 + E, -E
        else:
            less = grown_by(rate * T)
            rest, slope = -less, less + 1.0
        size, bend = sign / (D * rest), -sign / D
        if times > 0.0:
            growth = size * (2.0 / (D * D) + T * slope * bend / rest)
            add(out, k, rate, times * size, times * growth, times * size * bend)
        else:
            add(out, k, rate, share * size, by_share * size, 0j)


@inlined
def add(
    out: ModeWaves, k: int, rate: complex, size: complex, growth: complex, drift: complex
) -> None:
    n = out.filled[0]
    out.modes[n], out.filled[0] = k, n + 1
    out.parts[RATE, n], out.parts[SIZE, n] = rate, size
    out.parts[GROWTH, n], out.parts[DRIFT, n] = growth, drift


@inlined
def exponential(x: complex) -> complex:
    size = math.exp(x.real)
    return complex(size * math.cos(x.imag), size * math.sin(x.imag))


@inlined
def grown_by(x: complex) -> complex:
    """exp(x) - 1, without cancellation."""
    size, sine = math.exp(x.real), math.sin(0.5 * x.imag)
    less = 2.0 * math.exp(0.5 * x.real) * math.sinh(0.5 * x.real)
    return complex(less - 2.0 * size * sine * sine, size * math.sin(x.imag))


@inlined
def complex_root(x: complex) -> complex:
    size = abs(x.real)
    if x.imag != 0.0:  # squares of small numbers vanish
        size = math.sqrt(x.real * x.real + x.imag * x.imag)
    half = math.sqrt(0.5 * (size + abs(x.real)))
    if half == 0.0:
        return 0j
    if x.real >= 0.0:
        return complex(half, 0.5 * x.imag / half)
    return complex(0.5 * abs(x.imag) / half, half if x.imag >= 0.0 else -half)


def modal_interactions(
    of: ModeWaves, lam: Vector, weights: Cube, on: Recurring, damping: float, times: Vector,
    out: Cube,
) -> None:  # fmt: skip
    """Answers of each impact's site to each impact, ``[VALUE + order, i, j]``, order 0 to 3, and
    their slopes in gamma, spring and damping, to order 2, see `sections_between`; of an impact to
    itself the mean velocity, and the acceleration just before."""
    T, slope = section_length(on), 0.0
    for i in range(times.size):
        for j in range(times.size):
            for row in range(out.shape[0]):
                out[row, i, j] = 0.0
            past = sections_between(on, times[i] - times[j])
            s = times[i] - times[j] - T * past
            sign = -1.0 if on.half and past % 2 != 0 else 1.0
            for k in range(lam.size):
                weight = weights[i, j, k]
                out[VALUE, i, j] += weight * of.level[k, 0]
                out[BY_GAMMA, i, j] += weight * lam[k] * of.level[k, 1]
                out[BY_SPRING, i, j] += weight * of.level[k, 1]
            for n in range(of.filled[0]):
                k = of.modes[n]
                weight = sign * weights[i, j, k]
                rate = of.parts[RATE, n]
                wave = weight * exponential(rate * s)
                size, growth = wave * of.parts[SIZE, n], wave * of.parts[GROWTH, n]
                drift = wave * of.parts[DRIFT, n]
                power, less = 1.0 + 0j, 0j  # l^order and its derivative in l
                for order in range(4):
                    out[VALUE + order, i, j] += (size * power).real
                    slope = ((growth + drift * s) * power + drift * less).real
                    if order < 3:
                        out[BY_GAMMA + order, i, j] += lam[k] * slope
                        out[BY_SPRING + order, i, j] += slope
                    if order > 0:
                        out[BY_DAMPING + order - 1, i, j] += slope
                    power, less = power * rate, power + less * rate
        # u' jumps by 1 at an impulse, and the damping brakes it by that much
        out[VALUE + 1, i, i] -= 0.5
        out[VALUE + 2, i, i] += damping
        out[BY_DAMPING + 2, i, i] += 1.0


def driven_motion(of: HeldModes, drive: Matrix, times: Vector, out: Matrix) -> None:
    """Forced motion of each impact's site at unit amplitude, and its slopes, in the same rows: by
    rows of lam, m, push and limit for each mode and harmonic, then its shape at each impact. NaN
    where a driven mode answers a harmonic beyond all bounds."""
    for i in range(times.size):
        for row in range(out.shape[0]):
            out[row, i] = 0.0
        for p in range(drive.shape[0]):
            lam, m = drive[p, 0], drive[p, 1]
            gap = complex(of.gamma * lam + of.spring - m * m, m * of.damping)
            if abs(gap.real) + abs(gap.imag) <= drive[p, 4]:
                out[VALUE, i] = math.nan
                continue
            wave = drive[p, 5 + i] * exponential(complex(0.0, m * times[i]))
            answer = wave * complex(drive[p, 2], drive[p, 3]) / gap
            slope, power = -answer / gap, 1.0 + 0j
            for order in range(4):
                out[VALUE + order, i] += (answer * power).real
                if order < 3:
                    out[BY_GAMMA + order, i] += lam * (slope * power).real
                    out[BY_SPRING + order, i] += (slope * power).real
                if order > 0:
                    out[BY_DAMPING + order - 1, i] += (slope * power).real
                power *= complex(0.0, m)


def modal_place(
    of: HeldModes, weights: Cube, on: Recurring, drive: Matrix, times: Vector, waves: ModeWaves,
    out: Cube, forced: Matrix,
) -> None:  # fmt: skip
    """All that equations of an orbit ask of the lattice at the impacts."""
    find_waves(of, on, waves)
    modal_interactions(waves, of.lam, weights, on, of.damping, times, out)
    driven_motion(of, drive, times, forced)


WAVES, MODAL_PLACE = Kernel(find_waves), Kernel(modal_place)
