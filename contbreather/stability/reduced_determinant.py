"""Multipliers of a large finite lattice next to a circle, without an eigenproblem.

A perturbation that grows by mu over a section is known from what it is at the impacts,
``x_i = sum over j of G_ij(mu) (S_j - 1) x_j``, where G sums over all modes what a kick at impact j
still is at impact i after this section and all before it. With ``P_ij`` the flight of a mode from
the one to the other, Q that of the whole section, ``t`` its trace and ``e`` its determinant,

    ``G_ij = sum over modes of P_ij (mu - Q)^-1 (mu for i after j, else 1)``,
    ``(mu - Q)^-1 = (mu - adj Q)/(mu^2 - t mu + e)``,

so that ``D(mu) = det(1 - G(mu) (S - 1))``, 2m x 2m for m impacts, has the multipliers for its zeros
and those without impacts, on the unit circle or inside it, for its poles. As D -> 1 far away, the
number outside a circle is its winding number there; those next to it are where Newton's
method leads from the places on it at which D is least. Each mode costs two numbers a place:
of 400 sites the first pair to pass a circle is known after a fiftieth of what all multipliers take.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.modal_flow import ModalPropagator, free_multipliers
from contbreather.stability.pairs import REAL
from contbreather.stability.zeros import distinct, newton, refined

Array = NDArray[Any]

EVEN = 32  # places on half a circle besides those next to the poles
STARTS = 12  # of Newton's method: the places at which a zero looks nearest
STEPS = 6  # of Newton's method
WIDER = 12  # circles farther out that are tried where too many are beyond the first
SLOPE = 1e-6  # half the step of a difference in mu
ROUGH = 1e-10  # Newton's last step in mu
APART = 1e-8  # zeros closer than that are one
FAR = 1e6  # multiplier beyond which an impact has all but lost its velocity
MOST = 2**13  # places on a circle
CLOSE = 1e-7  # of a place on the real axis: the next one where signs are looked at
CLOSER = 12  # times that a dip between such places is looked at with a quarter of their distance
FOURTHS = np.array([0.25, 0.5, 0.75])
FLAT = 2.0  # a dip from this many times its depth has been seen to the bottom


class NearestMultipliers(NamedTuple):
    """What is known of multipliers next to a circle."""

    zeros: Array  # in the upper half plane, as many as were found
    outside: int  # how many are outside, pairs and real ones


class ReducedDeterminant:
    """D of a section, from its flights (one more than impacts) and its impacts."""

    def __init__(
        self,
        z: Array,
        damping: float,
        length: float,
        turns: tuple[ModalPropagator, ...],
        blows: Any,
    ) -> None:
        self.loss = math.exp(-damping * length)
        self.poles = free_multipliers(z, damping, length)[0]
        m, flights = len(blows), [_matrix(turn) for turn in turns]
        whole = _after(flights)
        back = np.array([[whole[1, 1], -whole[0, 1]], [-whole[1, 0], whole[0, 0]]])
        weights = np.empty((2, m, 2, m, 2, z.size))
        for i in range(m):
            for j in range(m):
                passed = flights[j + 1 : i + 1] if i > j else flights[j + 1 :] + flights[: i + 1]
                P = _after(passed) * (blows[i].shape * blows[j].kick)
                kicked = np.eye(2) - blows[j].saltation
                for which, propagator in enumerate((P, _after([back, P]))):
                    weights[which, i, :, j] = np.einsum("abk,bc->ack", propagator, kicked)
        later = np.zeros((m, 2, m, 2), dtype=bool)
        later[:] = np.tri(m, k=-1, dtype=bool)[:, None, :, None]
        self.later, self.one = np.flatnonzero(later), np.eye(2 * m)
        self.trace = whole[0, 0] + whole[1, 1]
        self.weights = weights.reshape(-1, z.size).T

    def D(self, mu: Array) -> Array:
        """At some mu, shape (n,)."""
        s = mu + self.loss / mu
        x, y = s.real[:, None] - self.trace, s.imag[:, None]
        size = x * x + y * y
        sums = (x / size) @ self.weights - 1j * ((y / size) @ self.weights)
        half = sums.shape[1] // 2
        matrix = sums[:, :half] - sums[:, half:] / mu[:, None]
        matrix[:, self.later] *= mu[:, None]
        matrix = matrix.reshape(-1, *self.one.shape) + self.one
        if len(self.one) == 2:
            (a, b), (c, d) = matrix.transpose(1, 2, 0)
            return np.asarray(a * d - b * c)
        return np.asarray(np.linalg.det(matrix))

    def beyond(self, place: float) -> int:
        """How many real multipliers are farther out than a place on the real axis off all poles,
        on its side."""
        beside = np.append(0.0, np.geomspace(CLOSE, FAR, 199))  # poles are next to the place
        x = place * (1.0 + beside)
        D = self.D(x + 0j).real
        for _ in range(CLOSER):
            dips = _dips(D)
            if not dips.size:
                break
            cells = np.concatenate([dips - 1, dips])
            more = (x[cells] + FOURTHS[:, None] * (x[cells + 1] - x[cells])).ravel()
            x, first = np.unique(np.append(x, more), return_index=True)
            D = np.append(D, self.D(more + 0j).real)[first]
        signs = D > 0.0
        return int(np.count_nonzero(signs[1:] != signs[:-1]))

    def outermost(self, radius: float) -> float | None:
        """By how much the first pair has left a circle around all poles, negative where none has;
        if they are far inside, where the poles are. None where that cannot be told."""
        floor = float(abs(self.poles).max()) / radius - 1.0
        gap = low = radius - 1.0
        high, beyond = 0.0, 0  # nothing is beyond the one, so many pairs are beyond the other
        for _ in range(WIDER):
            nearest = self.around(1.0 + gap)
            if nearest is None:
                return None
            moduli = abs(nearest.zeros)
            pairs = (nearest.outside - self.beyond(1.0 + gap)) // 2 if nearest.outside else 0
            wanted, place = (pairs, gap) if pairs or not beyond else (beyond, low)
            if np.count_nonzero(moduli > 1.0 + place) == wanted:
                return max(float(moduli.max(initial=0.0)) / radius - 1.0, floor)
            if pairs:  # so many that not all were found
                low, beyond = gap, pairs
            else:
                high = gap
            gap = math.sqrt(low * high) if high else 2.0 * gap
        return None

    def around(self, radius: float) -> NearestMultipliers | None:
        """What is next to a circle around all poles."""
        x, D, enough = refined(
            self.places, lambda x: radius * np.exp(1j * x), self.D, 0.0, most=MOST
        )
        if not (enough and math.isfinite(abs(D).sum())):
            return None
        turning = float(np.angle(D[1:] * D[:-1].conj()).sum())
        mu = radius * np.exp(1j * x)
        with np.errstate(divide="ignore", invalid="ignore"):  # the pole at an angle of 0 is twice
            step = abs(0.5 * (D[1:] + D[:-1]) * np.diff(mu) / np.diff(D))
        dips = np.flatnonzero((step[1:-1] <= step[:-2]) & (step[1:-1] <= step[2:])) + 1
        starts = mu[dips[np.argsort(step[dips])[:STARTS]]]
        return NearestMultipliers(self._zeros(starts), round(-turning / math.pi))

    @cached_property
    def places(self) -> Array:
        """Angles of a circle to look at first."""
        x = np.concatenate([abs(np.angle(self.poles)), np.linspace(0.0, math.pi, EVEN + 1)])
        x.sort()
        return np.sort(np.concatenate([x, 0.5 * (x[1:] + x[:-1])]))

    def _zeros(self, mu: Array) -> Array:
        """What Newton's method finds in the upper half plane, each once."""

        def step(mu: Array) -> Array:
            at, after, before = self.D(np.concatenate([mu, mu + SLOPE, mu - SLOPE])).reshape(3, -1)
            move = 2.0 * SLOPE * at / (after - before)
            return np.where(abs(move) < 1.0, move, math.nan)

        zeros = newton(step, mu, STEPS, ROUGH)
        return distinct(zeros[zeros.imag > REAL], APART)


def _dips(D: Array) -> Array:
    """Where it comes so close to zero, of one sign, that two zeros may be between two places."""
    size, sign = abs(D), D > 0.0
    low, high = np.minimum(size[:-2], size[2:]), np.maximum(size[:-2], size[2:])
    alike = (sign[1:-1] == sign[:-2]) & (sign[1:-1] == sign[2:])
    return np.flatnonzero(alike & (size[1:-1] <= low) & (high > FLAT * size[1:-1])) + 1


def _matrix(turn: ModalPropagator) -> Array:
    return np.array([[turn.cosine, turn.reach], [-turn.pull, turn.swing]])


def _after(flights: list[Array]) -> Array:
    """One flight of every mode after the other, shape (2, 2, K)."""
    whole = flights[0]
    for flight in flights[1:]:
        whole = np.einsum("abk,bck->ack", flight, whole)
    return np.asarray(whole)
