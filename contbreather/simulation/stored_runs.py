"""Simulated runs, and the equations of motions that return, as dicts and from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from contbreather.continuation import Problem
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions
from contbreather.simulation.integrator import IMPACT, REST, RunStop
from contbreather.simulation.periodic import problem_of_cycle
from contbreather.simulation.simulate import Record, Run
from contbreather.simulation.smooth import SmoothConditions, SmoothRun
from contbreather.simulation.states import State
from contbreather.storage.netcdf import check_lengths
from contbreather.storage.serialise import NotSerialisable, serialised, to_dict

Values = Mapping[str, Any]


def _to_dict(run: Run | SmoothRun) -> dict[str, Any]:
    try:
        conditions = to_dict(run.conditions)
    except NotSerialisable as error:
        raise BadInput(
            f"{error.args[0]!r} is of your own making, and a file holds numbers only: give the "
            "forcing as Fourier, Symbolic or Samples, and simulate with that"
        ) from error
    return {
        "conditions": conditions,
        "stop": run.stop.name,
        "reason": run.reason,
        "columns": {name: (*variable, {}) for name, variable in run.variables().items()},
        **({"noise": run.noise} if isinstance(run, Run) and run.noise else {}),
    }


def _shared(columns: Values, stop: str, reason: str) -> dict[str, Any]:
    """What both kinds of runs have."""
    record = None
    check_lengths(columns, ("time", "u", "v"), "states")
    if "sample_time" in columns:
        check_lengths(columns, ("sample_time", "sample_u", "sample_v"), "samples")
        sites = tuple(columns["sampled_sites"].tolist())
        record = Record(columns["sample_time"], sites, columns["sample_u"], columns["sample_v"])
    return {
        "times": columns["time"],
        "strobe": State(columns["u"], columns["v"]),
        "final": State(columns["final_u"], columns["final_v"]),
        "end": float(columns["end"]),
        "record": record,
        "stop": RunStop[stop],
        "reason": reason,
    }


def _table(columns: Values, what: str, dtype: np.dtype[Any]) -> Any:
    check_lengths(columns, [f"{what}_{name}" for name in dtype.names or ()], f"{what}s")
    table = np.empty(columns[f"{what}_time"].size, dtype)
    for name in dtype.names or ():
        table[name] = columns[f"{what}_{name}"]
    return table


@serialised("simulated run", Run, _to_dict)
def _run(columns: Values, conditions: Conditions, noise: float = 0.0, **ended: Any) -> Run:
    impacts, rests = _table(columns, "impact", IMPACT), _table(columns, "rest", REST)
    shared = _shared(columns, **ended)
    return Run(impacts=impacts, rests=rests, conditions=conditions, noise=noise, **shared)


@serialised("smooth run", SmoothRun, _to_dict)
def _smooth_run(columns: Values, conditions: Values, **ended: Any) -> SmoothRun:
    return SmoothRun(conditions=SmoothConditions(**conditions), **_shared(columns, **ended))


@serialised("returning motion")
def _motion(
    *,
    conditions: Conditions | Values,
    t0: float,
    period: int,
    start: Values,
    params: Mapping[str, float],
) -> Problem:
    on: Any = SmoothConditions(**conditions) if isinstance(conditions, Mapping) else conditions
    return problem_of_cycle(on.at(params), t0, State(start["u"], start["v"]), period)
