"""Steps in machine code beside those of numpy: the same points."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Steps, refined
from contbreather.orbits.closure_kernels import CLOSURE, CONTACT, PAIR, SCALAR

pytestmark = pytest.mark.skipif(CLOSURE.walk.code is None, reason="nothing is compiled here")

FOURIER = cb.Fourier(cos={1: 1.0, 3: 0.1}, sin={3: 0.2})
SHORT = Steps(largest=5e-3)


def _alike(walked: Callable[[], cb.Branch], monkeypatch: pytest.MonkeyPatch) -> None:
    """By machine code, and as on a machine where nothing is compiled."""
    pieces = walked()
    for kernels in (CLOSURE, SCALAR, PAIR, CONTACT):
        monkeypatch.setattr(kernels.walk, "code", None)
    plain = walked()
    assert (pieces.stop, pieces.began) == (plain.stop, plain.began)
    assert [p.kind for p in pieces] == [p.kind for p in plain]
    for column in ("z", "tangent", "arclength"):
        ours, theirs = getattr(pieces.points, column), getattr(plain.points, column)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("free", "within", "start", "more"),
    [
        ("a", {"a": (0.05, 0.8)}, {}, {}),
        ("a", {"a": (0.05, 0.8)}, {}, {"steps": SHORT}),
        ("a", {"a": (0.05, 0.8)}, {}, {"events": (), "inadmissible": True, "steps": SHORT}),
        ("gamma", {"gamma": (0.0, 0.2)}, {}, {}),
        ("k", {"k": (0.3, 0.95)}, {}, {"steps": Steps(tolerance=1e-12)}),
        ("omega", {"omega": (0.8, 1.5)}, {}, {"steps": Steps(tolerance=1e-12)}),
        ("a", {"a": (0.05, 0.8)}, {"omega": 1.2}, {"steps": Steps(tolerance=1e-12)}),
        ("a", {"a": (0.05, 0.8)}, {"lattice": cb.Ring(20)}, {}),
        ("gamma", {"gamma": (0.0, 0.2495)}, {"lattice": cb.Ring(8)}, {}),
        ("gamma", {"gamma": (0.0, 0.2495)}, {"lattice": cb.Ring(9)}, {}),
        ("omega", {"omega": (0.8, 1.5)}, {"lattice": cb.Ring(9)}, {}),
        ("a", {"a": (0.05, 0.8)}, {"spring": 0.1}, {}),
        ("omega", {"omega": (0.8, 1.5)}, {"spring": 0.1}, {"steps": Steps(tolerance=1e-12)}),
        ("spring", {"spring": (0.0, 0.3)}, {"forcing": FOURIER}, {"steps": SHORT}),
        ("c3", {"c3": (-1.0, 1.0)}, {"forcing": FOURIER, "spring": 0.1}, {}),
        ("c3", {"c3": (-1.0, 1.0)}, {"forcing": FOURIER}, {}),
    ],
)
def test_pieces_have_the_points_of_single_steps(monkeypatch, free, within, start, more) -> None:
    start = cb.symmetric(0.5, 0.12, 0.8, **start)
    _alike(lambda: cb.trace(start, free, within=within, **more), monkeypatch)


def test_a_parameter_of_a_formula_is_none_of_a_series_whatever_it_is_called() -> None:
    def walked(name: str) -> cb.Branch:
        forcing = cb.Symbolic(f"-cos(t) - {name}*cos(3*t)", **{name: 2.7})
        found = cb.orbits.symmetric_roots(a=0.3, gamma=0.12, k=0.7, forcing=forcing)
        return cb.trace(found[2], name, within={name: (0, 4)})

    ours, theirs = walked("c3"), walked("third")
    assert [p.label for p in ours.special] == ["EP1", "LP1", "NS1", "NS2", "PF1", "EP2"]
    assert not ours.doubtful
    np.testing.assert_allclose(ours.points.z, theirs.points.z, rtol=0, atol=1e-11)


@pytest.mark.parametrize("pair", [("gamma", "a"), ("omega", "a")])
@pytest.mark.parametrize(("kind", "sites"), [("LP", 8), ("PF", 9), ("GR", 9)])
def test_boundaries_of_rings_are_those_of_single_steps(monkeypatch, kind, sites, pair) -> None:
    at = cb.trace(cb.symmetric(0.5, 0.04, 0.8, lattice=cb.Ring(sites)), "a").first(kind)
    window = {"a": (0.0, 1.0), "omega": (0.7, 1.4)}
    _alike(lambda: cb.boundary(at, pair, within={n: window[n] for n in pair if n != "gamma"}),
           monkeypatch)  # fmt: skip


@cache
def special(start: tuple[float, float, float], free: str, kind: str) -> cb.Point:
    return cb.trace(cb.symmetric(*start, forcing=FOURIER), free).first(kind)


@pytest.mark.parametrize(
    ("start", "free", "kind"),
    [
        ((0.5, 0.04, 0.8), "a", "LP"),
        ((0.5, 0.04, 0.8), "a", "PF"),
        ((0.5, 0.04, 0.8), "a", "GR"),
        ((0.2, 0.08, 0.8), "gamma", "NS"),
    ],
)
@pytest.mark.parametrize("pair", [("gamma", "a"), ("c3", "a"), ("k", "omega")])
def test_boundaries_and_places_filled_in_are_those_of_single_steps(
    monkeypatch, start, free, kind, pair
) -> None:
    at = special(start, free, kind)
    # nearer to gamma = 1/4 and k = 1 tangents of NS turn by 1e3 and 1e5 times what rounding leaves
    # in a place
    window = {"a": (0.0, 1.0), "c3": (-1.0, 1.0)} | ({"gamma": (0.0, 0.249)} if "a" in pair else {})
    window |= {"omega": (0.7, 1.4), "k": (0.0, 0.999)} if "omega" in pair else {}
    _alike(lambda: refined(cb.boundary(at, pair, within=window), 100), monkeypatch)
