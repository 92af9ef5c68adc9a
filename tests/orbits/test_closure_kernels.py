"""Steps in machine code beside those of numpy: the same points."""

from __future__ import annotations

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Steps
from contbreather.continuation.stepper import Stepper
from contbreather.orbits.closure_kernels import WALK

pytestmark = pytest.mark.skipif(WALK.code is None, reason="nothing is compiled here")

FOURIER = cb.Fourier(cos={1: 1.0, 3: 0.1}, sin={3: 0.2})
SHORT = Steps(largest=5e-3)


@pytest.mark.parametrize(
    ("free", "within", "start", "more"),
    [
        ("a", {"a": (0.05, 0.8)}, {}, {}),
        ("a", {"a": (0.05, 0.8)}, {}, {"steps": SHORT}),
        ("a", {"a": (0.05, 0.8)}, {}, {"events": (), "inadmissible": True, "steps": SHORT}),
        ("gamma", {"gamma": (0.0, 0.2)}, {}, {}),
        ("k", {"k": (0.3, 0.95)}, {}, {"steps": Steps(tolerance=1e-12)}),
        ("a", {"a": (0.05, 0.8)}, {"lattice": cb.Ring(20)}, {}),
        ("c3", {"c3": (-1.0, 1.0)}, {"forcing": FOURIER}, {}),
    ],
)
def test_pieces_have_the_points_of_single_steps(monkeypatch, free, within, start, more) -> None:
    def walked() -> cb.Branch:
        return cb.trace(cb.symmetric(0.5, 0.12, 0.8, **start), free, within=within, **more)

    monkeypatch.setattr(Stepper, "_pieces", lambda stepper: None)
    plain = walked()
    monkeypatch.undo()
    calls = []
    together = Stepper._many
    monkeypatch.setattr(Stepper, "_many", lambda *given: calls.append(1) or together(*given))
    pieces = walked()
    assert calls
    assert (pieces.stop, pieces.began) == (plain.stop, plain.began)
    assert [p.kind for p in pieces] == [p.kind for p in plain]
    for column in ("z", "tangent", "arclength"):
        ours, theirs = getattr(pieces.points, column), getattr(plain.points, column)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12)
