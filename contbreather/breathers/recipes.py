"""Equations and events of orbits in files: as conditions, a section and numbers, and made again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from contbreather.breathers.asymmetric import NAMES
from contbreather.breathers.modal_road import Modes, modal_problem
from contbreather.breathers.orbit import Orbit
from contbreather.breathers.section import Impact, Section
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


@maker("asymmetric breather")
def _asymmetric(of: Plain, start: Plain, params: Params) -> Problem:
    p, *times, c = (start[name] for name in NAMES)
    return asymmetric_problem(
        _by_waves(of, params, times, (-2.0 * p, 2.0 * p), (c,)), of["threshold"]
    )


@maker("orbit with impacts")
def _with_impacts(of: Plain, start: Plain, params: Params) -> Problem:
    values, m = list(start.values()), len(of["section"]["impacts"])
    orbit = _by_waves(of, params, values[:m], values[m : 2 * m], values[2 * m :])
    return impact_problem(orbit, of["threshold"])


def _by_waves(
    of: Plain, params: Params, times: Sequence[float], impulses: Sequence[float], offsets: Any
) -> Orbit:
    section = _section(of["section"])
    named = zip(section.impacts, times, impulses, strict=True)
    impacts = tuple(Impact(*impact, t, J) for impact, t, J in named)
    on = made(of["conditions"]).at(params)
    return Orbit(Waves(on, section, impacts, tuple(offsets)))


@maker("shooting")
def _shooting(of: Plain, start: Plain, params: Params) -> Problem:
    times, q, r = (
        [value for name, value in start.items() if name not in "qr"],
        start["q"],
        start["r"],
    )
    on = made(of["conditions"]).at(params)
    found = Modes(_section(of["section"]), np.array(times), q, r, on)
    return modal_problem(Orbit(found), of["threshold"])
