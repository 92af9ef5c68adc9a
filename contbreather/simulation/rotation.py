"""Rotation numbers of stroboscopic sections, by weighted Birkhoff averages.

The section (the state once in a period of the forcing) of a quasi-periodic motion is a closed
curve. Its rotation number is the mean turn about the middle of the curve; averaged with the weight
of `weighted_mean` it converges faster than any power of the length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import numbers
from contbreather.errors import BadInput

Array = NDArray[Any]

TURN = 2.0 * math.pi
STILL = 1e-14  # of its largest state: a section that extends no further is a point


def weighted_mean(values: Array) -> Array:
    """Birkhoff average along the first axis with the weight ``exp(-1/(x (1 - x)))``.

    On a smooth torus it converges faster than any power of the length (Das and Yorke), elsewhere
    about as the plain mean.

    Examples
    --------
    >>> turns = np.cos(0.7 * np.arange(2000.0))
    >>> abs(float(turns.mean())) > 1e-5, abs(float(weighted_mean(turns))) < 1e-14
    (True, True)
    """
    x = np.arange(1.0, len(values) + 1.0) / (len(values) + 1.0)
    weight = np.exp(-1.0 / (x * (1.0 - x)))
    return np.asarray(np.tensordot(weight / weight.sum(), values, axes=1))


@dataclass(frozen=True)
class Rotation:
    """Rotation number of a closed curve.

    Attributes
    ----------
    number : float
        Turns per period of the forcing, modulo 1 and up to sign: in [0, 1/2].
    error : float
        Difference between those of the two halves of the run.
    hole : float
        Distance of the curve from the middle it was seen to turn about, relative to its size;
        where it is small the number means nothing.
    drift : float
        By how much the size of the curve differs between the two halves, relative to it: not
        small where the motion still spirals.
    """

    number: float
    error: float
    hole: float
    drift: float


def rotation(u: ArrayLike, v: ArrayLike) -> Rotation:
    """Rotation number of a stroboscopic section, by weighted Birkhoff averages.

    The section is looked at in several planes: that in which it extends most, those of
    displacement and velocity of single sites, and that of successive states. Taken is the one
    with the widest hole in the middle, about which the turns are averaged.

    Parameters
    ----------
    u, v : array_like, shape (M, N) or (M,)
        Successive states, ``*run.strobe`` for instance, transient left out.

    Examples
    --------
    >>> t = TURN * 0.381966 * np.arange(3000)
    >>> found = rotation(np.cos(t) + 0.2 * np.cos(2 * t), np.sin(t))
    >>> round(found.number, 12)
    0.381966
    """
    x, y = numbers("u", u), numbers("v", v)
    if x.ndim not in (1, 2) or x.shape != y.shape or not x.size:
        raise BadInput(
            f"u and v are rows of states, or tables with a column for each site; shapes {x.shape} "
            f"and {y.shape} were given."
        )
    x, y = x.reshape(len(x), -1), y.reshape(len(y), -1)
    if len(x) < 20:
        raise BadInput(f"{len(x)} states are too few for a rotation number; give at least 20.")
    still = STILL * max(np.abs(x).max(initial=0.0), np.abs(y).max(initial=0.0))
    spread = [(plane, plane.std(axis=0)) for plane in _planes(x, y)]
    whitened = [plane / widths for plane, widths in spread if np.all(widths > still)]
    if not whitened:
        return Rotation(0.0, 0.0, 0.0, 0.0)
    holes = [float(radius.min() / radius.max()) for radius in (np.hypot(*p.T) for p in whitened)]
    best = int(np.argmax(holes))
    return _turns(whitened[best], holes[best])


def _planes(x: Array, y: Array) -> list[Array]:
    """Ways to look at a section, each about its middle."""
    both = np.concatenate([x, y], axis=1)
    both = both - weighted_mean(both)
    # directions in which the section extends most; more states tell them no better
    axes = np.linalg.svd(both[: min(len(both), 4000)], full_matrices=False)[2]
    widest = np.argsort(-x.std(axis=0))[:4]
    planes = [both[:, [n, x.shape[1] + n]] for n in widest]
    planes.append(np.stack([both[:-1] @ axes[0], both[1:] @ axes[0]], axis=1))
    planes.append(both @ axes[:2].T)
    return planes


def _turns(plane: Array, hole: float) -> Rotation:
    """Mean turn about the middle of a plane."""
    turns = np.diff(np.arctan2(plane[:, 1], plane[:, 0])) / TURN
    # each turn modulo 1 on the sheet around the middle of them all
    middle = np.angle(np.exp(1j * TURN * turns).mean()) / TURN
    turns = middle + (turns - middle + 0.5) % 1.0 - 0.5
    half = len(turns) // 2
    parts = (turns, turns[:half], turns[half:])
    mean, first, second = (float(weighted_mean(part)) for part in parts)
    size = np.sum(plane**2, axis=1)
    drift = abs(float(weighted_mean(size[half:]) / weighted_mean(size[:half])) - 1.0)
    return Rotation(abs(mean - round(mean)), abs(first - second), hole, drift)
