"""What runs leave behind: every variable by its name, every row in its period, room for all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.simulation import Sample, simulate, simulate_smooth

ON = {"a": 0.5, "gamma": 0.08, "k": 0.8}
STATE = cb.symmetric(**ON).state(3)
COLUMNS = {
    "impact": ["time", "period", "phase", "site", "wall", "before", "after", "acceleration"],
    "rest": ["time", "period", "phase", "site", "wall", "begins"],
}


@pytest.mark.parametrize("walls", ["rigid", "smooth"])
def test_a_run_has_these_variables_and_no_others(walls: str) -> None:
    sample, t0 = Sample((0, 2), 8), 0.5
    make: Any = simulate if walls == "rigid" else lambda *a, **b: simulate_smooth(*a, m=6, **b)
    run = make(STATE, periods=2.5, t0=t0, sample=sample, damping=0.1, **ON)
    found = {name: (one.dims, one.values) for name, one in run.to_xarray().variables.items()}
    sampled, both = ("sample", "sampled_site"), ("strobe", "site")
    wanted: dict[str, Any] = {
        "time": (("strobe",), t0 + 2 * np.pi * np.arange(3)),
        "u": (both, run.strobe.u),
        "v": (both, run.strobe.v),
        "final_u": (("site",), run.final.u),
        "final_v": (("site",), run.final.v),
        "end": ((), t0 + 5 * np.pi),
        "sample_time": (("sample",), t0 + np.pi / 4 * np.arange(16)),
        "sampled_sites": (("sampled_site",), [0, 2]),
        "sample_u": (sampled, run.record.u),
        "sample_v": (sampled, run.record.v),
    }
    for what, names in COLUMNS.items() if walls == "rigid" else ():
        table = {"impact": run.impacts, "rest": run.rests}[what]
        assert list(table.dtype.names) == names
        wanted |= {f"{what}_{name}": ((what,), table[name]) for name in names}
    assert set(found) == set(wanted)
    for name, (dims, values) in wanted.items():
        assert found[name][0] == dims, name
        assert np.allclose(found[name][1], values, rtol=0, atol=1e-12), name
    plain = make(STATE, periods=1, damping=0.1, **ON).to_xarray()
    assert set(plain.variables) == {name for name in wanted if not name.startswith("sample")}


def test_every_impact_is_in_the_period_of_its_time() -> None:
    """Over more of them than a log has room for at first."""
    t0 = 0.3
    run = simulate(STATE, periods=500, t0=t0, damping=0.1, **ON)
    since = run.impacts["time"] - t0
    assert len(since) > 512
    assert (np.diff(since) >= 0).all()
    assert np.array_equal(run.impacts["period"], np.floor(since / (2 * np.pi)))
    phase = np.exp(1j * run.impacts["phase"]) * np.exp(-1j * run.impacts["time"])
    assert abs(phase - 1).max() < 1e-11
