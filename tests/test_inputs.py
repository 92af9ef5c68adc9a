"""What is no number, no forcing, no lattice and no branch is refused by a sentence of our own."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.closed_form import ClosedForm

HERE = {"a": 0.5, "gamma": 0.04, "k": 0.8}
NO_NUMBERS: tuple[Any, ...] = (
    "1", "x", b"1", None, True, np.bool_(True), float("nan"), float("inf"), 1j, 1 + 0j, [], [0.5],
    {}, np.array([0.5, 0.6]), 10**400, object(),
)  # fmt: skip


@pytest.fixture(scope="module")
def breather() -> cb.Orbit:
    return cb.symmetric(**HERE)


@pytest.fixture(scope="module")
def branch(breather: cb.Orbit) -> cb.Branch:
    return cb.trace(breather, "a", within={"a": (0.4, 0.9)})


SHORT = cb.Steps(most=2)


def entries(b: cb.Orbit) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Public entries with what is well for each of their numbers."""
    state = b.state(6)
    ring: dict[str, Any] = {"state": state, **HERE}

    def run(**numbers: Any) -> Any:
        return cb.simulate(**{**ring, "periods": 1, **numbers})

    def smooth(**numbers: Any) -> Any:
        return cb.simulation.simulate_smooth(**{**ring, "periods": 1, "m": 6, **numbers})

    def window(low: Any, high: Any) -> Any:
        return cb.trace(b, "a", within={"a": (low, high)}, steps=SHORT)

    def mine(x: Any, mu: Any) -> Any:
        return cb.Problem(lambda x, p: np.array([x[0] - p["mu"]]), {"x": x}, {"mu": mu})

    def rule(threshold: Any) -> Any:
        ring = cb.symmetric(**HERE, lattice=cb.Ring(6))
        return cb.trace(ring, "a", events=[cb.neimark_sacker(threshold=threshold)], steps=SHORT)

    return {
        "symmetric": (cb.symmetric, dict(HERE)),
        "closed form": (ClosedForm, {**HERE, "p": b.p, "phi": b.phi}),
        "ring": (cb.Ring, {"sites": 6}),
        "verdict": (lambda threshold: b.stability(6, threshold), {"threshold": 1.005}),
        "place": (b.displacement, {"n": 0, "t": 0.1}),
        "zones": (lambda k: cb.zones(k=k), {"k": -1.0}),
        "steps": (cb.Steps, {"first": 0.01, "largest": 0.1, "most": 10, "tolerance": 1e-9}),
        "window": (window, {"low": 0.4, "high": 0.6}),
        "problem": (mine, {"x": 0.0, "mu": 0.0}),
        "level": (lambda value: cb.user("a", value), {"value": 0.1}),
        "rule": (rule, {"threshold": 1.1}),
        "fourier": (lambda c: cb.Fourier(cos={1: c}), {"c": -1.0}),
        "simulate": (run, {**HERE, "periods": 1, "damping": 0.0, "t0": 0.0}),
        "smooth": (smooth, {"a": 0.5, "gamma": 0.04, "k": 0.8, "m": 6, "damping": 0.0}),
        "sample": (lambda n: cb.simulation.Sample((0,), n), {"n": 20}),
        "axis": (lambda site: cb.simulation.Axis("u", site, [0.0]), {"site": 0}),
    }


@pytest.mark.slow
def test_what_is_no_number_is_refused_at_every_entry(breather: cb.Orbit) -> None:
    """Each number of each entry is replaced in turn by three things that are none."""
    rng = random.Random(5)
    answered = []
    for name, (call, good) in entries(breather).items():
        for argument in good:
            for bad in rng.sample(NO_NUMBERS, 3):
                try:
                    call(**{**good, argument: bad})
                except cb.errors.ContbreatherError as error:
                    assert str(error)  # noqa: PT017
                else:
                    answered.append((name, argument, bad))
    # times and unknowns may be arrays, a window open to one side, and None is "unless given"
    welcome = {("place", "t"), ("window", "high"), ("verdict", "threshold"), ("problem", "x")}
    welcome |= {("zones", "k")}  # an array of them gives several diagrams
    answered = [entry for entry in answered if entry != ("rule", "threshold", None)]
    assert [entry for entry in answered if entry[:2] not in welcome] == []


@pytest.mark.parametrize("lattice", [None, cb.InfiniteChain(), cb.Ring(6), cb.OpenChain(5)])
@pytest.mark.parametrize("name", ["damping", "spring", "site"])
def test_zones_name_what_is_no_number(name: str, lattice: Any) -> None:
    for bad in NO_NUMBERS:
        if name == "spring" and bad is None:  # unless given
            continue
        with pytest.raises(cb.BadInput, match=rf"^{name} (= |is above)"):
            cb.zones(k=0.8, lattice=lattice, **{name: bad})


@pytest.mark.parametrize("late", [1e16, -1e16, 1e300, 6.3e12])
def test_a_time_too_late_to_tell_an_impact_by_is_refused(late, breather, tmp_path):
    """There neighbouring numbers are milliseconds apart, later on periods."""
    state = breather.state(6)
    on: dict[str, Any] = {**HERE, "t0": late}
    simulation = cb.simulation
    calls: dict[str, Callable[[], Any]] = {
        "simulate": lambda: cb.simulate(state, periods=1, **on),
        "an orbit": lambda: cb.simulate(breather.on(cb.Ring(6)), periods=1, t0=late),
        "smooth": lambda: simulation.simulate_smooth(state, periods=1, m=6, **on),
        "record": lambda: simulation.record(tmp_path / "run.nc", state, periods=1, **on),
        "periodic": lambda: simulation.periodic(state, **on),
        "classify": lambda: simulation.classify(state, **on),
        "sweep": lambda: simulation.sweep(state, "a", [0.5], periods=1, gamma=0.04, k=0.8, t0=late),
    }
    for call in calls.values():
        with pytest.raises(cb.BadInput, match=r"^t0 = .* within 1e\+12 periods of 0"):
            call()
    assert not list(tmp_path.iterdir())
    run = cb.simulate(state, periods=2, **{**on, "t0": 6.2e12})
    assert run.periods == 2


ODD: tuple[Any, ...] = (
    *NO_NUMBERS, -1, 0, "", 1e300, ("a",), [[1], [2, 3]], {"a": 1}, np.array(3.0),
)  # fmt: skip


def options(b: cb.Orbit) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Public entries with what is well for their options."""
    window, few = {"a": (0.45, 0.55)}, cb.Steps(most=1)
    walk = {"within": window, "towards": "up", "events": None, "steps": few, "progress": None,
            "along": None, "inadmissible": False}  # fmt: skip
    branch = cb.trace(b, "a", within={"a": (0.45, 0.9)})
    point, along = branch.first("PF"), {"events": None, "steps": few, "progress": None}
    run = cb.simulate(b.state(4), **HERE, periods=1)

    def traced(start: Any = b, free: Any = "a", **more: Any) -> Any:
        return cb.trace(start, free, **more)

    def followed(start: Any = point, pair: Any = ("gamma", "a"), **more: Any) -> Any:
        return cb.boundary(start, pair, **{"towards": "up", **more})

    def solved(residual: Any = lambda x, p: x - p["mu"], **more: Any) -> Any:
        return cb.trace(cb.Problem(residual, {"x": 0.0}, {"mu": 0.0}, **more), "mu", steps=few)

    def cycle(map_: Any = lambda x, p: p["r"] * x * (1.0 - x), **more: Any) -> Any:
        return cb.trace(cb.FixedPoint(map_, {"x": 0.6}, {"r": 2.5}, **more), "r", steps=few)

    return {
        "trace": (traced, {"start": b, "free": "a", **walk}),
        "boundary": (followed, {"start": point, "pair": ("gamma", "a"), **along}),
        "switch": (cb.switch, {"point": point, **along}),
        "extend": (cb.extend, {"branch": branch, "end": "last", "steps": few}),
        "problem": (solved, {"jacobian": None}),
        "problem by name": (solved, {what: {} for what in ("record", "domain", "scales")}),
        "map": (cycle, dict.fromkeys(("jacobian", "events", "record", "domain", "scales"))),
        "user": (cb.user, {"name": "a", "value": 0.5, "terminal": False}),
        "open chain": (cb.OpenChain, {"sites": 3, "ends": "free", "masses": None}),
        "grid": (cb.Grid, {"rows": 2, "columns": 2, "periodic": False}),
        "lattice": (cb.Lattice, {"stiffness": [[1.0]], "masses": None, "drive": None}),
        "samples": (cb.Samples, {"values": [-1.0, 0.0, 1.0, 0.0]}),
        "simulate": (cb.simulate, {"state": b.state(4), **HERE, "periods": 1, "progress": None}),
        "multipliers": (b.multipliers, {"half": False}),
        "peak": (cb.orbits.neighbour_peak, {"orbit": b, "n": 1}),
        "branch": (branch.first, {"kind": "PF"}),
        "column": (point.__getitem__, {"name": "a"}),
        "impacts": (run.at_site, {"n": 0, "wall": 1}),
        "chain": (cb.InfiniteChain().chi, {"gamma": 0.1}),
        "axis": (cb.simulation.Axis, {"name": "u", "site": 0, "values": [0.0]}),
    }


def test_whatever_is_given_comes_to_an_answer_or_to_a_sentence(breather: cb.Orbit) -> None:
    """Each argument of each entry is replaced in turn by three odd things."""
    rng = random.Random(10)
    for name, (call, good) in options(breather).items():
        for argument in good:
            for odd in rng.sample(ODD, 3):
                try:
                    call(**{**good, argument: odd})
                except cb.errors.ContbreatherError as error:
                    assert 10 < len(str(error)) < 2000, (name, argument)  # noqa: PT017


# --- figures ------------------------------------------------------------------------------------


PLOTS = ("plot", "plot_diagram", "plot_zones", "plot_motion", "plot_section", "plot_localisation",
         "plot_sweep", "plot_basin", "plot_multipliers")  # fmt: skip


@pytest.mark.parametrize("name", PLOTS)
def test_what_cannot_be_drawn_is_refused(name: str) -> None:
    with pytest.raises(cb.BadInput, match="was expected, got an int"):
        getattr(cb.plotting, name)(3)
