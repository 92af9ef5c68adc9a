"""Equations and events of orbits in files: as conditions, a section and numbers, and made again."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from contbreather.breathers.modal_road import Modes, modal_problem
from contbreather.breathers.orbit import Orbit
from contbreather.breathers.section import Section
from contbreather.breathers.symmetric import ClosedForm, symmetric_problem
from contbreather.breathers.wave_road import Waves, asymmetric_problem, impact_problem
from contbreather.continuation import Problem
from contbreather.continuation.recipes import maker
from contbreather.lattice.plain import made

Plain = Mapping[str, Any]
Params = Mapping[str, float]


def _section(of: Plain) -> Section:
    impacts = [(site, wall) for site, wall in of["impacts"]]
    return Section(impacts, of["turns"], of["sign"])  # type: ignore[arg-type]


@maker("symmetric breather")
def _symmetric(of: Plain, start: Plain, params: Params) -> Problem:
    forcing = made(of["forcing"])
    drive = forcing.at(**{name: params[name] for name in forcing.params})
    a, gamma, k = (params[name] for name in ("a", "gamma", "k"))
    found = ClosedForm(a, gamma, k, start["p"], start["phi"], drive, made(of["lattice"]))
    return symmetric_problem(Orbit(found), of["threshold"])


def _with_impacts(road_of: Any, problem: Any, of: Plain, start: Plain, params: Params) -> Problem:
    x = np.concatenate([np.ravel(value) for value in start.values()])
    found = road_of(made(of["conditions"]), _section(of["section"]), x, params)
    again: Problem = problem(Orbit(found), of["threshold"])
    return again


for kind, road_of, problem in (
    ("asymmetric breather", Waves.arm, asymmetric_problem),
    ("orbit with impacts", Waves.of, impact_problem),
    ("shooting", Modes.of, modal_problem),
):
    maker(kind)(partial(_with_impacts, road_of, problem))
