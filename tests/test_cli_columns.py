"""Every column and row that a command writes is the quantity that its name says; no name is new."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.cli import DONE
from contbreather.cli.output import to_json

from .typed import Run, table

RUN = "simulate --a 0.2 --gamma 0.04 --k 0.8 --damping 0.02 --sites 4"
ELASTIC = "simulate --a 0.2 --gamma 0.08 --k 1"  # sets out a quarter of a period late


def cells(out: str) -> dict[str, str]:
    """The rows of a table for people: words and number."""
    rows = (row.split("│") for row in out.splitlines() if row.startswith("│"))
    return {row[1].strip(): row[2].strip() for row in rows}


def column(rows: list[dict[str, str]], name: str) -> list[float]:
    return [float(row[name]) for row in rows]


# --- simulate -----------------------------------------------------------------------------------


@pytest.mark.parametrize("stream", ["", "--stream kept.nc"])
def test_every_column_of_the_impacts_is_what_it_says(run, stream: str) -> None:
    """By what impacts are: the wall at the place, the law of restitution, time and phase."""
    assert run(f"{ELASTIC} --sites 3 --periods 6 --impacts i.csv {stream}")[0] == DONE
    rows, b = table("i.csv"), cb.symmetric(0.2, 0.08, 1.0, lattice=cb.Ring(3))
    assert list(rows[0]) == [
        "time", "period", "phase", "site", "wall", "before", "after", "acceleration",
    ]  # fmt: skip
    assert len(rows) == 12
    time, before, wall = (np.array(column(rows, name)) for name in ("time", "before", "wall"))
    first = b.phi % math.pi
    first += math.pi * (first < 0.5 * math.pi)
    assert time == pytest.approx(first + math.pi * np.arange(12), abs=1e-9)
    assert column(rows, "period") == (np.floor((time - 0.5 * math.pi) / (2 * math.pi)).tolist())
    assert np.cos(column(rows, "phase")) == pytest.approx(np.cos(time), abs=1e-9)
    assert set(column(rows, "site")) == {0.0}
    assert wall.tolist() == np.sign(before).tolist()
    assert abs(before) == pytest.approx(np.full(12, b.p), abs=1e-9)
    assert column(rows, "after") == pytest.approx((-before).tolist(), abs=1e-12)
    h = 1e-4  # the velocity in the flight before the impact at b.phi
    v = [float(b.velocity(0, b.phi - i * h)) for i in (1, 2, 3)]
    bend = (2.5 * v[0] - 4 * v[1] + 1.5 * v[2]) / h
    assert abs(float(rows[0]["acceleration"])) == pytest.approx(abs(bend), abs=1e-5)


def test_table_of_a_run_gives_each_word_its_own_number(run) -> None:
    _, out, _ = run(f"{RUN} --periods 400")
    content = json.loads(run(f"{RUN} --periods 400 --json")[1])
    evidence, shown = content["verdict"]["evidence"], cells(out)
    assert content["verdict"]["kind"] == "PERIODIC"
    assert "Periodic: repeats with the forcing" in out
    assert int(shown["impacts"]) == content["impacts"]["total"] == 800
    assert int(shown["of them at site 0"]) == content["impacts"]["by_site"]["0"]
    assert shown["breather kept for"] == "to the end"
    assert float(shown["largest multiplier"]) == pytest.approx(evidence["multiplier"], rel=1e-8)
    assert float(shown["participation ratio"]) == pytest.approx(evidence["participation"], rel=1e-3)
    assert float(shown["returns after a period to"]) == pytest.approx(evidence["return"], rel=0.06)


# --- numbers that are none ------------------------------------------------------------------------


def test_what_is_not_finite_is_null_in_json_and_never_a_number(capsys) -> None:
    content = {
        "one": math.nan,
        "row": np.array([1.5, math.inf, -math.inf]),
        "pair": 1 + 2j,
        "deep": {"here": [np.float64("nan"), 0.0]},
        "whole": np.int64(3),
    }
    to_json(content)
    assert json.loads(capsys.readouterr().out) == {
        "one": None,
        "row": [1.5, None, None],
        "pair": [1.0, 2.0],
        "deep": {"here": [None, 0.0]},
        "whole": 3,
    }


# --- titles, and pictures that commands write -----------------------------------------------------


@pytest.fixture
def pictures(monkeypatch) -> list:
    """Figures that commands would have written."""
    from contbreather.plotting import canvas

    drawn: list = []

    def keep(figure, path):
        drawn.append(getattr(figure, "figure", figure).get_figure(root=True))
        return Path(path)

    monkeypatch.setattr(canvas, "save_figure", keep)
    return drawn


def test_picture_of_a_run_shows_the_last_periods_of_three_sites(run, pictures) -> None:
    """And its states once a period: those of the table."""
    assert run(f"{ELASTIC} --sites 6 --periods 20 -o p.png --csv s.csv")[0] == DONE
    motion, section, where = pictures[0].axes
    names = [text.get_text() for text in motion.get_legend().get_texts()]
    assert names == ["$u_{0}$", "$u_{1}$", "$u_{3}$"]
    rows, times = table("s.csv"), motion.get_lines()[0].get_xdata()
    assert (times[0], times[-1]) == pytest.approx((14.25, 20.25), abs=0.02)
    assert motion.get_lines()[2].get_ydata()[0] == pytest.approx(float(rows[14]["u_3"]), abs=1e-12)
    assert section.get_lines()[0].get_xdata().tolist() == column(rows[10:], "u_0")
    assert len(where.get_lines()[0].get_xdata()) == 21
    titles = ["(a) the last periods", "(b) once in a period, later half", "(c) where the energy is"]
    assert [ax.get_title(loc="left") for ax in (motion, section, where)] == titles


def data_of(ax) -> np.ndarray:
    return np.concatenate([np.stack(line.get_data(), 1) for line in ax.get_lines()])


@pytest.mark.slow
def test_picture_of_arms_lays_no_branch_that_turns_back_upon_itself(run, pictures) -> None:
    """By the asymmetry dashes of the lower breathers would lie between those beyond PF."""
    assert run("switch --free a --gamma 0.04 --k 0.8 -o s.png")[0] == DONE
    assert pictures[0].axes[1].get_ylabel() == "$t_{1}$"


@pytest.mark.parametrize(
    ("line", "x", "y", "labels"),
    [
        ("boundary PF --k 0.8", "gamma", "a", (r"$\gamma$", "$a$")),
        (
            "boundary NS --gamma 0.1 --k 0.8 --window 0.1 0.101 --y nu --x k",
            "k",
            "nu",
            ("$k$", r"$\nu$"),
        ),
    ],
)
def test_picture_of_a_curve_is_that_of_its_columns(run, pictures, line, x, y, labels):
    columns = json.loads(run(f"{line} -o b.png --json")[1])["columns"]
    (ax,) = pictures[0].axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == labels
    for place in list(zip(columns[x], columns[y], strict=True))[::5]:
        assert np.abs(data_of(ax) - place).max(axis=1).min() < 1e-9


@pytest.mark.slow
def test_picture_of_a_switch_shows_momentum_above_and_asymmetry_below(run, pictures) -> None:
    line = "switch --free a --gamma 0.04 --k 0.8 --window 0.5 0.95 -o s.png --json"
    arms = json.loads(run(line)[1])["arms"]
    above, below = pictures[0].axes
    assert [ax.get_xlabel() for ax in (above, below)] == ["$a$", "$a$"]
    assert (above.get_ylabel(), below.get_ylabel()) == ("$p$", "asymmetry")
    for arm in arms:
        end = arm["special"][-1]
        assert np.abs(data_of(above) - (end["a"], end["p"])).max(axis=1).min() < 1e-9
        there = (end["a"], end["t2"] - end["t1"] - math.pi)
        assert np.abs(data_of(below) - there).max(axis=1).min() < 1e-9
    flat = [line for line in below.get_lines() if len(line.get_xdata()) > 1]
    assert any(np.abs(line.get_ydata()).max() == 0.0 for line in flat)  # the symmetric breather


def test_arms_that_are_no_mirror_images_are_drawn_once(run, pictures) -> None:
    """Their asymmetry, here 0, tells nothing apart."""
    run("switch --free a --gamma 0.04 --k 0.8 --at GR --window 0.8 0.95 -o s.png")
    (ax,) = pictures[0].axes
    assert ax.get_ylabel() == "$p$"


def test_a_diagram_out_of_a_file_is_drawn_by_the_columns_asked_for(run, pictures) -> None:
    run("diagram --free a --gamma 0.04 --k 0.8 --window 0.76 0.8 --depth 1 --save tree.nc")
    assert run("show tree.nc --x p --y phi -o t.png")[0] == DONE
    (ax,) = pictures[0].axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$p$", r"$\varphi$")


# --- every key and heading that a program reads by name ------------------------------------------

SAID = "forcing interrupted written"
BREATHER, ARM = "p phi a gamma k", "p t1 t2 c a gamma k"
COUNTED = "unstable arclength residual"
IMPLIED = "t1 t2 c asymmetry"  # of what is symmetric
POINT = "kind label located arclength residual"
NORMAL_FORM = "criticality coefficient power"
LEFT = "a gamma k damping m noise lattice sites walls periods stop final.t final.u final.v"
LEFT += " verdict.kind verdict.motion"


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
        f"free {SAID} {branch('', f'{BREATHER} {COUNTED} {IMPLIED}', f'{BREATHER} nu')}",
        {"--csv": "label,a,gamma,k,unstable,t1,t2,c,asymmetry,arclength,residual,p,phi"},
    ),
    "boundary NS --k .8 --gamma .1 --window .1 .105": (
        f"curve pair {SAID} {branch('', f'{BREATHER} nu {COUNTED} {IMPLIED}', f'{BREATHER} nu')}",
        {"--csv": "label,a,gamma,k,unstable,t1,t2,c,asymmetry,arclength,residual,p,phi,nu"},
    ),
    "switch --free a --gamma .04 --k .8": (
        f"free {SAID} {under('at', f'{POINT} {BREATHER} {NORMAL_FORM}')}"
        f" {under('branch.columns', IMPLIED)}"
        f" {branch('branch.', f'{BREATHER} {COUNTED}', f'{BREATHER} {NORMAL_FORM} t site')}"
        f" {branch('arms[].', f'{ARM} asymmetry {COUNTED}', f'{ARM} parent t site')}"
        " arms[].label arms[].stability arms[].end arms[].image_of",
        {"--csv": "arm,label,a,gamma,k,asymmetry,unstable,arclength,residual,p,t1,t2,c"},
    ),
    "diagram --free a --gamma .04 --k .8 --a .75 --window 0.7 0.85": (
        f"free {SAID} failed left ends edges[].from edges[].to edges[].relation"
        f" branches[].label branches[].depth {under('points.*', f'{POINT} {NORMAL_FORM}')}"
        f" {under('points.*', f'{BREATHER} {ARM}')}"
        f" {branch('branches[].', f'{BREATHER} {ARM} asymmetry {COUNTED}', f'{BREATHER} {ARM}')}"
        f" {under('branches[].special[]', f'{NORMAL_FORM} parent')}",
        {"--csv": "branch,label,a,gamma,k,unstable,t1,t2,c,asymmetry,arclength,residual,p,phi"},
    ),
    "zones --k 0.8 --gamma-window 0.05 0.08": (
        f"{SAID} zones[].fixed.k zones[].pair {under('zones[].curves[]', 'curve gamma a p phi t')}"
        f" zones[].curves[].labels {under('zones[].points[]', f'{BREATHER} meeting')}"
        " zones[].regions[].verdict zones[].regions[].unstable zones[].regions[].lower"
        " zones[].regions[].beyond zones[].regions[].outline[]",
        {
            "--csv": "k,curve,gamma,a,piece,label,unstable,t1,t2,c,asymmetry,"
            "arclength,residual,p,phi,t"
        },
    ),
    "simulate --a .2 --gamma .04 --k .8 --sites 3 --periods 3": (
        f"{SAID} {LEFT} verdict.reason verdict.evidence impacts.total impacts.by_site.0 lost_after",
        {
            "--csv": "period,time,u_0,u_1,u_2,v_0,v_1,v_2",
            "--impacts": "time,period,phase,site,wall,before,after,acceleration",
        },
    ),
    "simulate --a .1 --gamma .04 --k .8 --sites 3 --periods 3 --smooth 6": (
        f"{SAID} {LEFT} verdict.reason verdict.evidence",
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
