"""What is not said means what the documentation says."""

from __future__ import annotations

import importlib
import inspect

import pytest

# Where one name has several meanings: whose is whose, as the pages of these functions say.
WHOSE = {
    "simulation.verdict": {"settle": 4000, "periods": 4096},
    "simulation.lyapunov": {"settle": 0, "count": 2, "seed": 0},
    "simulation.attraction": {"periods": 500, "tolerance": 1e-3, "site": 0},
    "simulation.periodic": {"periods": 1, "symmetric": False},
    "diagram": {"depth": 2, "most": 100},
    "multibreathers": {"most": 3},
    "FixedPoint": {"period": 1},
    "trace": {"towards": "both"},
    "continuation.walk": {"towards": "up"},
    "boundary": {"towards": "both"},
    "Steps": {"first": 0.01, "largest": None, "smallest": 1e-9, "growth": 1.5, "most": 2000},
    "paper.figure2": {"sites": 400, "points": 100, "threshold": 1.005},
    "paper.chain_lengths": {"a": 0.2, "k": 0.8, "sites": (200, 400, 800), "threshold": 1.005},
    "plotting.plot_multipliers": {"digits": 4, "half": False},
    "plotting.plot_sweep": {"y": "p"},
    "plotting.plot_section": {"site": 0, "skip": 0},
}


@pytest.mark.parametrize("name", WHOSE)
def test_what_is_not_said_is_as_its_page_says(name: str) -> None:
    folder, _, own = name.rpartition(".")
    module = importlib.import_module(f"contbreather.{folder}" if folder else "contbreather")
    given = inspect.signature(getattr(module, own)).parameters
    for parameter, value in WHOSE[name].items():
        assert given[parameter].default == value, parameter
