"""Cycles by AUTO-07p: a branch from an orbit in a table, and its curve of period doublings."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np

from .auto07p import EQUATIONS, fortran, ran, result

CONSTANTS = """\
dat='cycle'
parnames = {{{names}, 11: 'period'}}
NDIM={n}, IPS=2, IRS=0, ILP=1, ICP=['{free}', 'period'], NPAR={count}
NTST={intervals}, NCOL={points}, IAD=3, ISP=2, ISW=1, IPLT=0, NBC=0, NINT=0
NMX=1000, NPR=0, MXBF=0, IID=0, ITMX=8, ITNW=7, NWTN=3, JAC=0
EPSL=1e-9, EPSU=1e-9, EPSS=1e-7
DS={ds}, DSMIN=1e-4, DSMAX={dsmax}, IADS=1
THL={{'period': 0.0}}
UZSTOP={{'{free}': [{low}, {high}]}}
"""

# the processor's time of what AUTO runs, as ours is; the wall's is that of all that runs beside it
BRANCH = """\
import json, resource
def spent():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
run(e='cycle', c='cycle')  # compiles
clock = [spent()]
branch = run(e='cycle', c='cycle')
clock.append(spent())
"""
CURVE = """\
names = ['{free}', '{second}', 'period']
first = run(branch('PD1'), ICP=names, ISW=2, NMX=5)
clock.append(spent())
ends = {{'{second}': [{low}, {high}]}}
how = {{'ICP': names, 'ISW': 2, 'NMX': 1000, 'DSMAX': 10 * {dsmax}, 'UZSTOP': ends}}
curves = [run(first('EP'), DS=sign * {ds}, **how) for sign in (-1, 1)]
"""
SAY = """\
special = [(point['TY'], point['{free}'], point['period']) for point in branch()]
ends = [(curve()[-1]['{free}'], curve()[-1]['{second}']) for curve in {curves}]
points = len(branch[0]), [len(curve[0]) for curve in {curves}]
clock.append(spent())
print('RESULT ' + json.dumps([special, ends, points, clock], default=float))
"""


@dataclass(frozen=True)
class System:
    """Equations in Fortran, parameters in their order, and what is walked."""

    equations: str
    params: dict[str, float]
    free: str
    window: tuple[float, float]
    step: float
    curve: tuple[str, float, float] | None = None  # second parameter of the curve of PD, its window


def session(system: System, t: Any, x: Any, intervals: int, points: int) -> dict[str, Any]:
    """Compile and walk; times a point."""
    params = [f"  PAR({i})={fortran(v)}" for i, v in enumerate(system.params.values(), 1)]
    names = ", ".join(f"{i}: '{name}'" for i, name in enumerate(system.params, 1))
    low, high = system.window
    constants = CONSTANTS.format(
        names=names, n=len(x), free=system.free, count=len(system.params), intervals=intervals,
        points=points, ds=system.step, dsmax=10 * abs(system.step), low=low, high=high,
    )  # fmt: skip
    text, second, curves = BRANCH, "period", "[]"
    if system.curve is not None:
        second, low, high = system.curve
        text += CURVE.format(
            free=system.free, second=second, low=low, high=high,
            ds=system.step, dsmax=10 * abs(system.step),
        )  # fmt: skip
        curves = "curves"
    text += SAY.format(free=system.free, second=second, curves=curves)
    equations, table = f"  INTEGER :: i\n{system.equations}", io.StringIO()
    np.savetxt(table, np.vstack([t, x]).T, fmt="%.16e")
    name, _, out = ran({
        "cycle.f90": EQUATIONS.format(equations=equations, start="\n".join(params)),
        "c.cycle": constants, "session.auto": text, "cycle.dat": table.getvalue(),
    })  # fmt: skip
    special, ends, (many, along), clock = result(out)
    return {
        "name": name, "special": special, "ends": ends,
        "branch": (clock[1] - clock[0]) / many,
        "curve": (clock[-1] - clock[-2]) / sum(along) if along else None,
    }  # fmt: skip
