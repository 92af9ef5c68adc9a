"""What is wrong is called by the name under which it was given."""

from __future__ import annotations

import inspect
import math
from typing import Any

import pytest

import contbreather as cb
from contbreather.dynamics import (
    attraction,
    localisation,
    lyapunov,
    periodic,
    record,
    simulate_smooth,
    sweep,
    verdict,
)
from contbreather.errors import BadInput

STATE = cb.symmetric(0.2, 0.04, 0.8).state(4)
SET = {"a": 0.2, "gamma": 0.04, "k": 0.8}


def run(kind: str, folder: Any, **given: Any) -> Any:
    settings = {**SET, **given}
    if kind == "simulate":
        return cb.simulate(STATE, **{"periods": 1, **settings})
    if kind == "smooth":
        return simulate_smooth(STATE, **{"periods": 1, "m": 6, **settings})
    if kind == "record":
        return record(folder / "run", STATE, **{"periods": 1, **settings})
    if kind == "verdict":
        return verdict(STATE, **settings)
    return sweep(STATE, "a", [0.2, 0.21], **{"periods": 1, **settings})


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        ("simulate", "damping", -0.1),
        ("simulate", "damping", math.nan),
        ("simulate", "periods", -1.0),
        ("simulate", "gamma", 0.3),
        ("simulate", "k", 1.2),
        ("simulate", "a", math.inf),
        ("simulate", "t0", math.nan),
        ("smooth", "damping", -0.1),
        ("smooth", "m", 0.1),
        ("smooth", "periods", -1.0),
        ("record", "periods", 2.5),
        ("record", "periods", -1),
        ("verdict", "periods", 50),
        ("verdict", "settle", -1),
        ("sweep", "periods", 0),
    ],
)
def test_a_wrong_number_is_named_with_its_value(kind, name, value, tmp_path) -> None:
    with pytest.raises(BadInput, match=rf"^{name} = {value!r}\b"):
        run(kind, tmp_path, **{name: value})


def defaults(of: Any) -> dict[str, Any]:
    found = inspect.signature(of).parameters.values()
    return {one.name: one.default for one in found if one.default is not inspect.Parameter.empty}


def test_a_name_has_one_default_wherever_it_is_given() -> None:
    """No damping, from t = 0, driven by a cosine: what is not said is not there."""
    plain = {"damping": 0.0, "t0": 0.0, "forcing": None, "sample": None, "progress": None}
    seen = set()
    makers = (cb.simulate, simulate_smooth, record, verdict, sweep, attraction, periodic, lyapunov,
              localisation)  # fmt: skip
    for of in makers:
        own = defaults(of)
        seen |= set(own)
        for name in set(own) & set(plain):
            assert own[name] == plain[name], (of.__name__, name)
    assert set(plain) <= seen
    walks = {"within": None, "towards": "both", "events": None, "steps": None, "progress": None}
    for of in (cb.trace, cb.boundary, cb.switch, cb.diagram):
        own = defaults(of)
        for name in set(own) & set(walks):
            assert own[name] == walks[name], (of.__name__, name)
