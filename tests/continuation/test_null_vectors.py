"""The loops of ``(F_x + shift) v = 0, |v| = 1`` against the same in numpy and its differences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from contbreather.continuation import null_vectors
from contbreather.kernels import bound

SIXTH = tuple((k * s, s * w) for k, w in ((1, 0.75), (2, -0.15), (3, 1 / 60)) for s in (-1, 1))
UNIT = (1.0, 300.0, 0.02)  # of the unknowns


def field(x: Any, p: Any) -> Any:
    n = len(x)
    s = np.array(x) / UNIT[:n]
    return np.array([math.sin(s[i]) * p[0] + p[1] * s[i] * s[i - 1] ** 3 for i in range(n)])


def slopes_of(x: Any, p: Any) -> Any:
    n = len(x)
    s, made = np.array(x) / UNIT[:n], np.zeros((n, n + 2))
    for i in range(n):
        made[i, i] += math.cos(s[i]) * p[0] / UNIT[i] + p[1] * s[i - 1] ** 3 / UNIT[i]
        made[i, (i - 1) % n] += 3.0 * p[1] * s[i] * s[i - 1] ** 2 / UNIT[(i - 1) % n]
        made[i, n:] = math.sin(s[i]), s[i] * s[i - 1] ** 3
    return made


def loops(n: int, shift: float) -> Any:
    def evaluate(z: Any, data: Any, out: Any) -> int:
        out[:n] = field(z[:n], z[n : n + 2])
        return 0

    def derive(z: Any, data: Any, out: Any) -> int:
        out[: n * (n + 2)] = slopes_of(z[:n], z[n : n + 2]).ravel()
        return 0

    given = {"evaluate": evaluate, "derive": derive, "N": n, "SHIFT": shift}
    return bound(null_vectors.conditions, **given), bound(null_vectors.slopes, **given)


def expected(z: Any, n: int, shift: float) -> Any:
    x, v, p = z[:n], z[n : 2 * n], z[2 * n :]
    turned = slopes_of(x, p)[:, :n] @ v + shift * v
    return np.concatenate([field(x, p), turned, [v @ v - 1.0]])


@pytest.mark.parametrize("shift", [0.0, 2.0])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_conditions_and_their_slopes_are_those_of_the_equations(n: int, shift: float) -> None:
    conditions, slopes = loops(n, shift)
    width = 2 * n + 2
    for seed in range(5):
        rng = np.random.default_rng(seed)
        units = np.array([*UNIT[:n], *n * [1.0], 1.0, 1.0])
        z = units * rng.uniform(0.5, 1.5, width) * rng.choice([-1.0, 1.0], width)
        z[n : 2 * n] *= UNIT[:n] / np.linalg.norm(z[n : 2 * n] * UNIT[:n])  # as null vectors are
        work, out = z.copy(), np.full(3 * width * width + width, math.nan)
        assert conditions(work, None, out) == 0
        np.testing.assert_array_equal(work, z)
        np.testing.assert_allclose(out[: width - 1], expected(z, n, shift), rtol=1e-14, atol=1e-14)
        assert slopes(work, None, out) == 0
        np.testing.assert_array_equal(work, z)
        found = out[: (width - 1) * width].reshape(width - 1, width)
        wanted = [
            sum(w * expected(z + k * step, n, shift) for k, w in SIXTH) / step.max()
            for step in np.diag(1e-3 * units)
        ]
        size = np.maximum(abs(found).max(axis=1, keepdims=True), 1.0)
        np.testing.assert_allclose(found / size, np.transpose(wanted) / size, atol=3e-10)
