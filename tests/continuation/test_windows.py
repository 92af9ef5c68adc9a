"""The window of an array unknown is one of its norm."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb

ROOTS = np.arange(1.0, 13.0)


def cubes(**more: object) -> cb.Problem:
    """``u_i = (i mu)^(1/3)``."""
    return cb.Problem(
        lambda u, p: u**3 - p["mu"] * ROOTS,
        {"u": np.cbrt(ROOTS)},
        {"mu": 1.0},
        **more,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("largest", [0.05, 0.5, 5.0])
def test_a_branch_ends_exactly_where_the_norm_does(largest: float) -> None:
    steps = cb.Steps(largest=largest)
    branch = cb.trace(cubes(), "mu", within={"u": (1, 10)}, steps=steps)
    norms = np.linalg.norm(branch["u"], axis=1)
    assert norms[[0, -1]] == pytest.approx([1, 10], rel=1e-15)
    assert norms[1:-1].min() > 1
    assert norms[1:-1].max() < 10
    unit = np.linalg.norm(np.cbrt(ROOTS))
    assert branch["mu"][[0, -1]] == pytest.approx([unit**-3, (10 / unit) ** 3], rel=1e-12)
    assert branch.stop is branch.began is cb.continuation.Stop.BOUND


def test_a_norm_that_peaks_beyond_its_window_within_a_step_is_seen() -> None:
    arch = cb.Problem(
        lambda u, p: np.array([u[0] - 3 * np.cos(p["h"]), u[1]]),
        {"u": np.array([3 * np.cos(-1.0), 0.0])},
        {"h": -1.0},
    )
    branch = cb.trace(arch, "h", within={"u": (0, 2.9999)}, towards="up")
    assert branch[-1]["h"] == pytest.approx(-np.arccos(2.9999 / 3), abs=1e-12)


def test_the_domain_of_an_array_is_one_of_its_norm_too() -> None:
    branch = cb.trace(cubes(domain={"u": (0, 9)}), "mu", within={"mu": (0.5, 1e4)}, towards="up")
    assert branch.reason == "the domain of u ends at 9"
    assert np.linalg.norm(branch[-1]["u"]) == pytest.approx(9, rel=1e-15)
