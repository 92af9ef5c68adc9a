"""AUTO-07p, with gfortran: equations in Fortran, driven by its script.

The one that is built in $AUTO_DIR, or the Debian package auto-07p. Its own command-line interface
runs the session, with Debian's Python: under a recent numpy the packaged interface fails when it
reads a solution back (an array compared with an empty list).
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from ..measure import Absent, process
from . import closure

EQUATIONS = """\
SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)
  IMPLICIT NONE
  INTEGER, INTENT(IN) :: NDIM, ICP(*), IJAC
  DOUBLE PRECISION, INTENT(IN) :: U(NDIM), PAR(*)
  DOUBLE PRECISION, INTENT(OUT) :: F(NDIM)
  DOUBLE PRECISION, INTENT(INOUT) :: DFDU(NDIM,NDIM), DFDP(NDIM,*)
{equations}
END SUBROUTINE
SUBROUTINE STPNT(NDIM,U,PAR,T)
  IMPLICIT NONE
  INTEGER, INTENT(IN) :: NDIM
  DOUBLE PRECISION, INTENT(INOUT) :: U(NDIM), PAR(*)
  DOUBLE PRECISION, INTENT(IN) :: T
{start}
END SUBROUTINE
SUBROUTINE BCND
END SUBROUTINE
SUBROUTINE ICND
END SUBROUTINE
SUBROUTINE FOPT
END SUBROUTINE
SUBROUTINE PVLS
END SUBROUTINE
"""

CLOSURE = """\
  DOUBLE PRECISION :: a, g, q, chi
  a = PAR(1); g = PAR(2); q = (1 - PAR(3))/(1 + PAR(3))
{chi}
  F(1) = U(1)*chi + a*COS(U(2)) - 1
  F(2) = -a*SIN(U(2)) - U(1)*q"""

START = """\
  PAR(1:3) = (/ 1D0, {gamma}, {k} /)
  U = (/ {p}, {phi} /)"""

CONSTANTS = """\
unames = {{1: 'p', 2: 'phi'}}
parnames = {{1: 'a', 2: 'gamma', 3: 'k'}}
NDIM=2, IPS=0, IRS=0, ILP=0, ICP=['a'], NPAR=3
NTST=5, NCOL=4, IAD=0, ISP=0, ISW=1, IPLT=0, NBC=0, NINT=0
NMX=4000, NPR=0, MXBF=0, IID=0, ITMX=8, ITNW=7, NWTN=3, JAC=0
EPSL=1e-9, EPSU=1e-9, EPSS=1e-9
DS=-{step}, DSMIN=1e-8, DSMAX={step}, IADS=0
UZSTOP={{'a': 1.0000001}}
"""

SESSION = """\
import json
branch = run(e='breather', c='breather')
coarse = run(e='breather', c='breather', ILP=1, IADS=1, DS=-0.01, DSMIN=1e-6, DSMAX=0.05)
lp = coarse('LP1')
ends = {{'gamma': [0.0, {end}]}}
folds = [run(lp, ICP=['a', 'gamma'], ISW=2, DS=ds, DSMAX={step}, UZSTOP=ends)
         for ds in (-{step}, {step})]
curve = [(a, g) for f in folds for a, g in zip(f[0]['a'], f[0]['gamma'])]
data = {{'points': len(branch[0]), 'lp': lp['a'], 'curve': curve}}
print('RESULT ' + json.dumps(data, default=float))
"""


def fortran(value: float) -> str:
    return f"{value:.17e}".replace("e", "D")


def files() -> dict[str, str]:
    horner = [f"  chi = {fortran(closure.CHI_SERIES[-1])}"]
    horner += [f"  chi = chi*g + {fortran(c)}" for c in reversed(closure.CHI_SERIES[:-1])]
    horner += [f"  chi = chi + {fortran(4 / closure.math.pi)}/SQRT(1 - 4*g)"]
    p, phi = closure.start()
    numbers = {"gamma": closure.GAMMA, "k": closure.K, "p": p, "phi": phi}
    start = START.format(**{name: fortran(value) for name, value in numbers.items()})
    step = closure.branch_length(closure.GAMMA, closure.K) / closure.POINTS
    return {
        "breather.f90": EQUATIONS.format(
            equations=CLOSURE.format(chi="\n".join(horner)), start=start
        ),
        "c.breather": CONSTANTS.format(step=step),
        "session.auto": SESSION.format(end=closure.GAMMA_END, step=closure.FOLD_STEP),
    }


def program() -> tuple[str, dict[str, str], str]:
    """What runs the session, its environment, and its version."""
    built = os.environ.get("AUTO_DIR")
    path = {"PATH": "/usr/bin:/bin"}
    if built:
        python = f"{Path(sys.executable).parent}:{path['PATH']}"
        return f"{built}/bin/auto", {"PATH": python, "AUTO_DIR": built}, "built here"
    _, out = process(["dpkg-query", "-W", "-f", "${Version}", "auto-07p"])
    return "auto-07p", path, out.strip()


def ran(files: dict[str, str]) -> tuple[str, float, str]:
    """What AUTO is called, how long its session takes, and what that prints."""
    if shutil.which("gfortran") is None:
        raise Absent("no gfortran here (Debian: apt install auto-07p gfortran)")
    run, env, version = program()
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            Path(folder, name).write_text(text, encoding="ascii")
        seconds, out = process([run, "session.auto"], cwd=Path(folder), env=env)
    return f"AUTO-07p {version}", seconds, out


def result(out: str) -> Any:
    return json.loads(re.findall(r"^RESULT (.*)$", out, flags=re.MULTILINE)[0])


def session() -> dict[str, Any]:
    """Compile, branch, fold, fold curve; times a point are those that AUTO itself prints."""
    name, seconds, out = ran(files())
    printed = [float(value) for value in re.findall(r"Total Time\s+(\S+)", out)]
    data = result(out)
    return {
        "name": name,
        "branch_points": data["points"],
        "branch_seconds": printed[0],
        "fold": data["lp"],
        "curve": data["curve"],
        "curve_seconds": sum(printed[2:]),
        "session_seconds": seconds,
    }
