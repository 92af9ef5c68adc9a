"""What a program reads by name: every key of every command's JSON, every heading of its tables."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from .typed import Run

SAID = "forcing interrupted written"
BREATHER, ARM = "p phi a gamma k", "p t1 t2 c a gamma k"
COUNTED = "unstable arclength residual"
POINT = "kind label located arclength residual"
NORMAL_FORM = "criticality coefficient"
RUN = "a gamma k damping m noise lattice sites periods stop final.t final.u final.v verdict.kind"
RUN += " verdict.motion"


def under(place: str, names: str) -> str:
    return " ".join(f"{place}.{name}" for name in names.split())


def branch(place: str, columns: str, special: str) -> str:
    ends = " ".join(f"{place}{name}" for name in ("doubtful", "ends"))
    return " ".join(
        [ends, under(f"{place}columns", columns), under(f"{place}special[]", f"{POINT} {special}")]
    )


def paths(content: Any, at: str = "") -> Iterator[str]:
    """The way to every leaf; what is named by labels, as points of a diagram are, is ``*``."""
    if isinstance(content, dict) and content:
        labels = at == "points"
        for name, value in content.items():
            own = "*" if labels else name
            yield from paths(value, f"{at}.{own}" if at else own)
    elif isinstance(content, list) and any(isinstance(one, dict | list) for one in content):
        for one in content:
            yield from paths(one, f"{at}[]")
    else:
        yield at


COMMANDS = {
    "point --a .5 --gamma .08 --k .8 --sites 12": (
        f"{BREATHER} chi damping spring forcing root admissible max_neighbour margin reason stable"
        " unstable certain over_reflecting multipliers other_roots[].p other_roots[].phi"
        " other_roots[].admissible"
        " ring.sites ring.threshold ring.largest ring.unstable",
        {},
    ),
    "branch --free gamma --a 0.2 --k .8 --window 0.09 0.1": (
        f"free {SAID} {branch('', f'{BREATHER} {COUNTED}', f'{BREATHER} nu')}",
        {"--csv": "a,gamma,k,unstable,arclength,residual,p,phi,label"},
    ),
    "boundary NS --k .8 --gamma .1 --window .1 .105": (
        f"curve pair {SAID} {branch('', f'{BREATHER} nu {COUNTED}', f'{BREATHER} nu')}",
        {"--csv": "a,gamma,k,unstable,arclength,residual,p,phi,nu,label"},
    ),
    "switch --free a --gamma .04 --k .8": (
        f"free {SAID} {under('at', f'{POINT} {BREATHER} {NORMAL_FORM}')}"
        f" {branch('branch.', f'{BREATHER} {COUNTED}', f'{BREATHER} {NORMAL_FORM} t site')}"
        f" {branch('arms[].', f'{ARM} asymmetry {COUNTED}', f'{ARM} parent t')}"
        " arms[].label arms[].stability arms[].end arms[].image_of",
        {"--csv": "arm,a,gamma,k,asymmetry,unstable,arclength,residual,p,t1,t2,c,label"},
    ),
    "diagram --free a --gamma .04 --k .8 --a .75 --window 0.7 0.85": (
        f"free {SAID} failed left edges[].from edges[].to edges[].relation"
        f" branches[].label branches[].depth {under('points.*', f'{POINT} {NORMAL_FORM}')}"
        f" {under('points.*', f'{BREATHER} {ARM}')}"
        f" {branch('branches[].', f'{BREATHER} {ARM} asymmetry {COUNTED}', f'{BREATHER} {ARM}')}"
        f" {under('branches[].special[]', f'{NORMAL_FORM} parent')}",
        {"--csv": "branch,a,gamma,k,unstable,arclength,residual,p,phi,asymmetry,t1,t2,c,label"},
    ),
    "zones --k 0.8 --gamma-window 0.05 0.08": (
        f"{SAID} zones[].fixed.k zones[].pair {under('zones[].curves[]', 'curve gamma a p phi t')}"
        f" zones[].curves[].labels {under('zones[].points[]', f'{BREATHER} meeting')}"
        " zones[].regions[].verdict zones[].regions[].unstable zones[].regions[].lower"
        " zones[].regions[].outline[]",
        {"--csv": "k,curve,gamma,a,piece,label,unstable,arclength,residual,p,phi,t"},
    ),
    "simulate --a .2 --gamma .04 --k .8 --sites 3 --periods 3": (
        f"{SAID} {RUN} verdict.reason verdict.evidence impacts.total impacts.by_site.0 lost_after",
        {
            "--csv": "period,time,u_0,u_1,u_2,v_0,v_1,v_2",
            "--impacts": "time,period,phase,site,wall,before,after,acceleration",
        },
    ),
    "simulate --a .1 --gamma .04 --k .8 --sites 3 --periods 3 --smooth 6": (
        f"{SAID} {RUN} verdict.reason verdict.evidence",
        {"--csv": "period,time,u_0,u_1,u_2,v_0,v_1,v_2"},
    ),
    "figure 3": (
        "figure caption interrupted written rows[].panel rows[].a rows[].gamma rows[].k"
        " rows[].half_re rows[].half_im rows[].full_re rows[].full_im rows[].modulus",
        {"--csv": "panel,a,gamma,k,half_re,half_im,full_re,full_im,modulus"},
    ),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_name_in_what_a_command_leaves_is_known(run: Run, command: str) -> None:
    names, tables = COMMANDS[command]
    files = {option: f"{option[2:]}.csv" for option in tables}
    asked = " ".join(f"{option} {path}" for option, path in files.items())
    status, out, _ = run(f"{command} --json {asked}")
    assert status == 0
    assert set(paths(json.loads(out))) == set(names.split())
    for option, heading in tables.items():
        assert Path(files[option]).read_text().splitlines()[0] == heading
