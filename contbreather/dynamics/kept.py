"""Simulated runs and motions that return in files, and made again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from contbreather.continuation import Problem
from contbreather.continuation.contents import Said, content
from contbreather.continuation.groups import ABOUT
from contbreather.continuation.recipes import maker
from contbreather.dynamics.impacting import Record, Run
from contbreather.dynamics.returning import problem_of_cycle
from contbreather.dynamics.smooth import OWN, SmoothConditions, SmoothRun
from contbreather.dynamics.states import State
from contbreather.dynamics.stretches import IMPACT, REST, RunStop
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.plain import NotPlain, made, plain

if TYPE_CHECKING:
    from xarray import Dataset

Plain = Mapping[str, Any]


def _said(run: Run | SmoothRun) -> Said:
    try:
        conditions = plain(run.conditions)
    except NotPlain as error:
        raise BadInput(
            f"{error.args[0]!r} is of your own making, and a file holds numbers only: give the "
            "forcing as Fourier, Symbolic or Samples, and simulate with that"
        ) from error
    columns: dict[Any, Any] = dict(run.to_xarray().variables)
    truth = {name: one.astype("i1") for name, one in columns.items() if one.dtype == bool}
    return Said(
        {"conditions": conditions, "stop": run.stop.name, "reason": run.reason},
        {**columns, **truth},
        {},
    )


def _read(about: Plain, data: Dataset) -> dict[str, Any]:
    """What both kinds of runs share."""
    values = {str(name): data[name].values for name in data.variables if name != ABOUT}
    record = None
    if "sample_time" in values:
        sites = tuple(values["sampled_sites"].tolist())
        record = Record(values["sample_time"], sites, values["sample_u"], values["sample_v"])
    return {
        "times": values["time"],
        "strobe": State(values["u"], values["v"]),
        "final": State(values["final_u"], values["final_v"]),
        "end": float(values["end"]),
        "record": record,
        "stop": RunStop[about["stop"]],
        "reason": about["reason"],
    }


def _table(data: Dataset, what: str, dtype: np.dtype[Any]) -> Any:
    table = np.empty(data[f"{what}_time"].size, dtype)
    for name in dtype.names or ():
        table[name] = data[f"{what}_{name}"].values
    return table


@content(Run, "simulated run", _said)
def _impacting(about: Plain, data: Dataset, parts: Plain) -> Run:
    tables = {"impacts": _table(data, "impact", IMPACT), "rests": _table(data, "rest", REST)}
    return Run(**tables, **_read(about, data), conditions=made(about["conditions"]))


@content(SmoothRun, "smooth run", _said)
def _smooth(about: Plain, data: Dataset, parts: Plain) -> SmoothRun:
    return SmoothRun(**_read(about, data), conditions=_conditions(about["conditions"]))


def _conditions(of: Plain) -> Any:
    """Those of rigid walls, or of smooth ones."""
    if "kind" in of:
        return made(of)
    values = {name: made(of[name]) for name in (*OWN, "forcing", "lattice")}
    return SmoothConditions(**values)


@maker("returning motion")
def _motion(of: Plain, start: Plain, params: Mapping[str, float]) -> Problem:
    on: Conditions | SmoothConditions = _conditions(of["conditions"]).at(params)
    return problem_of_cycle(on, of["t0"], State(start["u"], start["v"]), of["period"])
