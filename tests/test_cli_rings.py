"""`--sites` of branch, boundary and zones: all of it is about the ring that was asked for."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.cli import DONE

RING = "--sites 20 --threshold 1.02"


@pytest.fixture
def run(run):
    """The same, on a ring."""
    return lambda line: run(f"{line} {RING}")


def column(content: dict[str, Any], name: str) -> np.ndarray:
    return np.array(content["columns"][name])


def on_ring(a: float, gamma: float) -> cb.Orbit:
    return cb.symmetric(a, gamma, 0.8, lattice=cb.Ring(20))


def test_branch_is_of_the_ring_in_every_column_and_label(run) -> None:
    line = "branch --free gamma --a 0.3 --k 0.8 --window 0 0.15"
    content = json.loads(run(f"{line} --json")[1])
    assert (content["sites"], content["threshold"]) == (20, 1.02)
    gamma, p, counts = (column(content, name) for name in ("gamma", "p", "unstable"))
    (place,) = (one["gamma"] for one in content["special"] if one["kind"] == "NS")
    for i in range(0, gamma.size, 3):
        breather = on_ring(0.3, float(gamma[i]))
        verdict = breather.stability(threshold=1.02)
        assert p[i] == pytest.approx(breather.p, abs=1e-12)
        assert counts[i] == verdict.unstable or abs(gamma[i] - place) < 1e-9
        assert (verdict.unstable > 0) == (gamma[i] > place) or abs(gamma[i] - place) < 1e-9
    assert "ring of 20, threshold 1.02" in run(line)[1]


def test_boundary_is_of_the_ring(run) -> None:
    content = json.loads(run("boundary NS --gamma 0.05 --k 0.8 --json")[1])
    assert (content["sites"], content["threshold"]) == (20, 1.02)
    for a, gamma in list(zip(column(content, "a"), column(content, "gamma"), strict=True))[::20]:
        largest = on_ring(float(a), float(gamma)).stability().largest
        assert largest == pytest.approx(1.02, abs=1e-9)
    assert "ring of 20, threshold 1.02" in run("boundary PF --gamma 0.05 --k 0.8")[1]


def test_zones_are_of_the_ring(run) -> None:
    status, out, _ = run("zones --k 0.8 --gamma-window 0.03 0.06 --a-window 0.2 0.5 --json")
    content = json.loads(out)
    assert status == DONE
    assert (content["sites"], content["threshold"]) == (20, 1.02)
    lines = [one for one in content["zones"][0]["curves"] if one["curve"] == "NS"]
    assert lines
    for line in lines:
        middle = len(line["a"]) // 2
        largest = on_ring(line["a"][middle], line["gamma"][middle]).stability().largest
        assert largest == pytest.approx(1.02, abs=1e-9)
