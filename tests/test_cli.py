"""What a person types: the numbers of the library, one sentence for everything that is refused."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
from contextlib import chdir, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

import contbreather as cb
from contbreather import cli
from contbreather.cli import BAD_INPUT, DONE, FAILED
from contbreather.parameters import NUMBERS, window_of

from .typed import Run, strict, table

POINT = "point --a 0.5 --gamma 0.12 --k 0.4"
BRANCH = "branch --free a --gamma 0.1 --k 0.8"
TWO_HARMONICS = "-cos(t) - 2.7*cos(3*t)"


def test_bugs_are_not_hidden(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("contbreather.orbits.symmetric_roots", Mock(side_effect=KeyError("bug")))
    with pytest.raises(KeyError):
        run(POINT)


# --- point --------------------------------------------------------------------------------------


def test_point_gives_the_library_s_numbers_to_the_last_digit(run: Run) -> None:
    status, out, err = run(f"{POINT} --json")
    content, b = strict(out), cb.symmetric(0.5, 0.12, 0.4)
    assert (status, err) == (DONE, "")
    assert out.count("\n") == 1
    wanted = {"a": b.a, "gamma": b.gamma, "k": b.k, "p": b.p, "phi": b.phi, "chi": b.chi}
    assert {name: content[name] for name in wanted} == wanted
    assert content["max_neighbour"] == b.admissibility().max_neighbour
    verdict = b.stability()
    assert (content["admissible"], content["stable"], content["unstable"]) == (True, True, 0)
    assert content["over_reflecting"] == verdict.over_reflecting
    assert "ring" not in content


def test_point_on_a_ring_follows_the_paper_s_rule(run: Run) -> None:
    line = "point --a 0.2 --gamma 0.11 --k 0.8 --json --sites 40"
    ring = strict(run(f"{line} --threshold 1.02")[1])["ring"]
    full = np.abs(cb.symmetric(0.2, 0.11, 0.8).multipliers(sites=40))
    assert (ring["sites"], ring["threshold"]) == (40, 1.02)
    assert ring["largest"] == pytest.approx(full.max(), abs=1e-13)
    assert ring["unstable"] == np.sum(full > 1.02)
    assert strict(run(line)[1])["ring"]["threshold"] == 1.005


def test_nothing_is_said_of_the_stability_of_what_is_no_breather(run: Run) -> None:
    """Its multipliers are inside the circle, but the chain has no such motion."""
    assert cb.symmetric(0.9, 0.1, 0.8, root=1).stability().unstable == 0
    line = "point --a 0.9 --gamma 0.1 --k 0.8 --sites 40 --root 1"
    out = run(line)[1]
    assert "stable" not in out.replace("stability", "")
    assert "No breather: site 1 reaches |u| = 1." in out
    assert "Nothing is said of its stability" in out
    content = strict(run(f"{line} --json")[1])
    assert (content["stable"], content["unstable"], content["admissible"]) == (None, None, False)
    assert content["max_neighbour"] > 1
    assert content["ring"]["unstable"] is None
    assert "(15) is broken" in content["reason"]


def test_any_root_can_be_asked_for(run: Run) -> None:
    place = f"--a 0.3 --gamma 0.12 --k 0.7 --forcing {TWO_HARMONICS!r} --json"
    roots = cb.orbits.symmetric_roots(0.3, 0.12, 0.7, forcing=cb.Symbolic(TWO_HARMONICS))
    assert len(roots) == 4
    for number, root in enumerate(roots, start=1):
        content = strict(run(f"point {place} --root {number}")[1])
        assert (content["root"], content["p"], content["phi"]) == (number, root.p, root.phi)
        assert [one["p"] for one in content["other_roots"]] == [
            other.p for other in roots if other is not root
        ]


def test_the_point_is_the_root_that_is_admissible(run: Run) -> None:
    line = "point --a 0.79 --gamma 0.2 --k 0.8"
    upper, lower = cb.orbits.symmetric_roots(0.79, 0.2, 0.8)
    content = strict(run(f"{line} --json")[1])
    assert (content["root"], content["p"], content["admissible"]) == (2, lower.p, True)
    (other,) = content["other_roots"]
    assert (other["p"], other["admissible"]) == (upper.p, False)
    assert "Further roots of (11): p = 0.566994652 (not admissible)." in run(line)[1]


@pytest.mark.slow
def test_zones_of_both_families_are_drawn_when_asked_for(run: Run) -> None:
    line = "zones --k 0.8 --gamma-window 0.15 0.2 --a-window 0.3 1.2"
    assert "a lower one, p = " in run(f"{line} --csv zones.csv")[1]
    told = strict(run(f"{line} --json")[1])["zones"][0]["regions"]
    assert any(p is not None for region in told for p in region["lower"])
    assert "a lower one" not in run(f"{line} --past-folds --csv zones.csv")[1]
    told = strict(run(f"{line} --past-folds --json")[1])["zones"][0]["regions"]
    assert {region["verdict"] for region in told} == {"US"}


@pytest.mark.slow
def test_zones_say_what_is_beyond_grazing_when_asked(run: Run) -> None:
    line = "zones --k 0.8 --gamma-window 0.15 0.2 --a-window 0.3 1.2 --beyond --json"
    told = strict(run(line)[1])["zones"][0]["regions"]
    words = {words for region in told for words in region["beyond"]}
    assert words == {"", "3 sites impact: unstable"}


def test_branch_starts_at_the_root_that_was_asked_for(run: Run) -> None:
    line = "branch --free gamma --a 0.5 --k 0.8 --gamma 0.1 --json"
    for number, root in enumerate(cb.orbits.symmetric_roots(0.5, 0.1, 0.8), start=1):
        columns = strict(run(f"{line} --root {number}")[1])["columns"]
        nearest = min(abs(np.array(columns["gamma"]) - 0.1))
        here = int(np.argmin(abs(np.array(columns["gamma"]) - 0.1)))
        assert nearest < 1e-12
        assert columns["p"][here] == pytest.approx(root.p, abs=1e-12)


# --- branch -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("k", "label", "sentence"),
    [
        (0.01, "VI1", r"the impact of site 0 itself vanishes, at velocity \de-1\d"),
        (0.01, "GR1", r"site 0 between its impacts is at u = -?1 at t = "),
    ],
)
def test_an_end_says_what_grazed(run: Run, k: float, label: str, sentence: str) -> None:
    out = run(f"branch --free a --gamma 0.1 --k {k}")[1]
    ended = "began" if label == "VI1" else "ended"
    assert re.search(
        rf"^{label}: {ended} at a terminal event \({sentence}", out, flags=re.MULTILINE
    )


def test_where_two_graze_both_are_named(run: Run) -> None:
    """Checked by the profile: both sites are on a wall at the times that are said."""
    line = "boundary GR --k 0.05"
    content = strict(run(f"{line} --json")[1])
    point = next(point for point in content["special"] if point["kind"] == "GR-GR")
    (sentence,) = [end for end in content["ends"] if end.startswith("GR-GR1")]
    found = re.findall(r"site (\d) at t = (\S+)", sentence)
    assert [site for site, _ in found] == ["1", "0"]
    assert sentence.endswith("graze at once)")
    breather = cb.symmetric(point["a"], point["gamma"], 0.05)
    for site, time in found:
        assert abs(breather.displacement(int(site), float(time))) == pytest.approx(1.0, abs=1e-8)


@pytest.mark.slow
def test_tables_fit_terminals_of_80_columns(tmp_path: Path) -> None:
    """A real terminal, of 80 columns: each number is whole, and right to its last digit."""
    command = f"stty cols 80; {sys.executable} -m contbreather boundary NS --k 0.8"
    package = Path(cb.__file__).parents[1]
    done = subprocess.run(
        ["script", "-qec", command, "/dev/null"],
        env={**os.environ, "PYTHONPATH": str(package), "TERM": "dumb"},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "\N{HORIZONTAL ELLIPSIS}" not in done.stdout
    row = next(line for line in done.stdout.splitlines() if "NS-LP1" in line)
    gamma, a = (cell.strip() for cell in row.split("│")[2:4])
    assert (len(gamma) >= 6, float(gamma)) == (True, pytest.approx(0.125220720183, rel=1e-4))
    assert float(a) == pytest.approx(0.0527199073812, rel=1e-4)


def test_branch_in_the_restitution_finds_a_start_by_itself(run) -> None:
    special = strict(run("branch --free k --a 0.2 --gamma 0.0969709466 --json")[1])["special"]
    assert [point["k"] for point in special if point["kind"] == "NS"] == pytest.approx(
        [0.8], abs=1e-7
    )


def test_branch_in_a_letter_of_the_forcing(run: Run) -> None:
    line = "branch --free c --a 0.3 --gamma 0.12 --k 0.7"
    formula = "--forcing '-cos(t) - c*cos(3*t)' --window 0 2.7 --json"
    content = strict(run(f"{line} {formula}")[1])
    columns = content["columns"]
    assert content["forcing"] == "F = a (-cos(t) - c * cos(3 * t))"  # one value of c says nothing
    assert columns["c"][-1] == 2.7
    assert columns["p"][-1] == pytest.approx(0.669089966883616, abs=1e-12)


@pytest.mark.slow
def test_a_branch_as_a_table_is_that_of_the_library(run: Run) -> None:
    """With all digits, and no count at a fold nor where multipliers mean nothing."""
    content = strict(run(f"{BRANCH} --csv b.csv -o b.pdf --save b.nc --json")[1])
    assert content["written"] == ["b.nc", "b.csv", "b.pdf"]
    assert Path("b.csv").read_text() == cb.load("b.nc").to_csv("own.csv").read_text()
    counts = {row["label"]: row["unstable"] for row in table("b.csv")}
    assert (counts["VI1"], counts["LP1"], counts["GR1"]) == ("", "", "0.0")
    in_rows = ["" if count is None else str(count) for count in content["columns"]["unstable"]]
    assert in_rows == [row["unstable"] for row in table("b.csv")]
    assert {*counts} == {"", *(point["label"] for point in content["special"])}
    assert Path("b.pdf").read_bytes().startswith(b"%PDF")


# --- boundary -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "pair", "fixed"),
    [
        ("LP", ("gamma", "a"), "k=0.8"),
        ("pf", ("k", "gamma"), "a=0.8"),
        ("NS", ("gamma", "a"), "k=0.8"),
        ("GR", ("k", "a"), "gamma=0.04"),
    ],
)
def test_boundary_of_each_kind_in_any_pair_is_the_library_s(run: Run, kind, pair, fixed) -> None:
    name, _, value = fixed.partition("=")
    line = f"boundary {kind} --pair {' '.join(pair)} --{fixed} --json"
    columns = strict(run(line)[1])["columns"]
    within = {free: window_of(free) for free in pair}
    seed = cb.orbits.find_event(kind.upper(), pair, within=within, **{name: float(value)})
    own = cb.boundary(seed, pair, within=within, steps=cb.Steps(largest=0.02))
    assert {free: columns[free] for free in pair} == {free: own[free].tolist() for free in pair}


@pytest.mark.slow
def test_doublings_are_found_on_an_arm(run: Run) -> None:
    content = strict(run("boundary pd --k 0.95 --json")[1])
    ends = {point["label"]: (point["gamma"], point["a"]) for point in content["special"]}
    assert ends["EP1"] == pytest.approx((0.0, 0.9050853098), abs=1e-9)
    assert ends["PD-GR1"] == pytest.approx((0.0130085246, 0.954578604), abs=1e-9)


@pytest.mark.parametrize(
    ("walk", "line", "shown", "stop"),
    [
        ("trace", BRANCH, "label", cb.continuation.Stop.NO_CONVERGENCE),
        ("trace", f"{BRANCH} --json", '"columns": {"a": [', cb.continuation.Stop.DOMAIN),
        ("boundary", "boundary PF --k 0.8", "label", cb.continuation.Stop.DOMAIN),
    ],
)
def test_what_ends_in_mx_is_shown_and_has_status_1(
    run: Run, monkeypatch: pytest.MonkeyPatch,
    walk: str, line: str, shown: str, stop: cb.continuation.Stop,
) -> None:  # fmt: skip
    whole = getattr(cb.continuation, walk)

    def broken(*args: Any, **kwargs: Any) -> Any:
        return replace(whole(*args, **kwargs), stop=stop, reason="too sharp")

    monkeypatch.setattr(cb.continuation, walk, broken)
    status, out, err = run(line)
    assert (status, shown in out) == (FAILED, True)
    assert re.search("broke off.*too sharp", err)


# --- zones --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """`contbreather zones` as a person runs it for the first time, in an empty directory."""
    folder, out = tmp_path_factory.mktemp("bare"), io.StringIO()
    with chdir(folder), redirect_stdout(out):
        assert cli.main(["zones"]) == DONE
    return folder, out.getvalue()


def test_bare_zones_writes_a_figure_and_a_table(bare) -> None:
    folder, out = bare
    assert {path.name for path in folder.iterdir()} == {"zones.png", "zones.csv"}
    assert (folder / "zones.png").read_bytes().startswith(b"\x89PNG")
    assert "Wrote zones.png." in out
    for meeting in ("PF-GR", "NS-GR", "NS-LP"):
        assert out.count(meeting) == 2  # once for each k
    found = {(float(row["k"]), row["curve"]) for row in table(folder / "zones.csv")}
    assert found == {(k, kind) for k in (0.8, 0.4) for kind in ("LP", "GR", "PF", "NS")}


@pytest.mark.slow
def test_zones_print_for_programs_without_writing(run: Run) -> None:
    line = "zones --k 0.8 --gamma-window 0.05 0.08 --json"
    content = strict(run(line)[1])
    assert list(Path().iterdir()) == []
    (diagram,) = content["zones"]
    assert diagram["fixed"] == {"k": 0.8}
    assert diagram["pair"] == ["gamma", "a"]
    (meeting,) = diagram["points"]
    assert meeting["meeting"] == "PF-GR"
    own = cb.zones(k=0.8, within={"gamma": (0.05, 0.08)})
    assert [meeting[name] for name in ("gamma", "a")] == [own.special[0][n] for n in ("gamma", "a")]
    verdicts = {region["verdict"]: region["unstable"] for region in diagram["regions"]}
    assert verdicts["S"] == [0, 0, 0, 0, 0]
    assert all(count >= 1 for count in verdicts["US"])
    assert all(len(corner) == 2 for corner in diagram["regions"][0]["outline"])
    pf = next(curve for curve in diagram["curves"] if curve["curve"] == "PF")
    assert pf["a"] == own.curves["PF"][0]["a"].tolist()


@pytest.mark.slow
def test_zones_in_planes_of_the_frequency_are_those_of_the_library(run: Run) -> None:
    window = {"omega": (0.7, 1.0)}
    status, out, _ = run("zones --k 0.8 --gamma 0.05 --omega-window 0.7 1 --json")
    (diagram,) = strict(out)["zones"]
    assert (status, diagram["pair"]) == (DONE, ["omega", "a"])
    assert diagram["fixed"] == {"k": 0.8, "gamma": 0.05}
    own = cb.zones(k=0.8, gamma=0.05, within=window)
    for kind, branch in own:
        drawn = next(curve for curve in diagram["curves"] if curve["curve"] == kind)
        assert drawn["omega"] == branch["omega"].tolist()
        assert drawn["a"] == branch["a"].tolist()
    status, _, err = run("zones --k 0.8 --gamma 0.05 --gamma 0.06")
    assert (status, "--gamma: one value is expected in planes of omega" in err) == (BAD_INPUT, True)


def test_the_table_of_zones_is_that_of_the_library(run: Run) -> None:
    """With the parameter of the forcing in it, and the counts."""
    line = "zones --k 0.8 --gamma-window 0.04 0.042 --csv z.csv --save z.nc"
    assert run(f"{line} --forcing '-cos(t) + c3*cos(3*t)' --set c3=0.1")[0] == DONE
    (kept,) = cb.load("z.nc").values()
    assert Path("z.csv").read_text() == kept.to_csv("own.csv").read_text()
    rows = table(Path("z.csv"))
    assert {row["c3"] for row in rows} == {"0.1"}
    assert {row["unstable"] for row in rows} == {"1.0", ""}  # empty where curves meet


@pytest.mark.slow
def test_a_window_that_is_cut_says_so(run: Run) -> None:
    line = "zones --k 0.8 --gamma-window 0.2 0.3 --json"
    status, out, err = run(line)
    assert status == DONE
    assert "only 0.2 to 0.2499 is looked at" in err
    assert max(max(c["gamma"]) for c in strict(out)["zones"][0]["curves"]) <= 0.2499
    assert run(line.replace("0.3", "0.24"))[2] == ""
    status, out, err = run(f"{line} --omega 2")  # where couplings are up to 4 times as large
    assert (status, err) == (DONE, "")
    assert max(max(c["gamma"]) for c in strict(out)["zones"][0]["curves"]) == 0.3
    assert "is looked at" not in run(line.replace("0.3", "0.1"))[2]  # of one that is refused


def test_without_meetings_there_is_a_sentence_and_no_empty_table(run: Run) -> None:
    out = run("zones --a 0.3 --gamma-window 0.05 0.1 --csv z.csv")[1]
    assert out.startswith("No two curves meet there.\nPoints on the curves at a = 0.3: LP ")
    assert "┃" not in out


@pytest.mark.slow
def test_help_shows_a_default_that_says_something(run: Run) -> None:
    """0 does; that something is not asked for, not given or empty does not."""
    shown = set[str]()
    for command in ("point", "branch", "zones", "simulate", "figure"):
        words = re.sub(r"[│\s]+", " ", run(f"{command} --help")[1])
        shown.update(re.findall(r"\[default: ?(.*?)\]", words))
    assert shown == {"-cos(t)", "0", "0.0", "200.0", "both"}


def test_help_names_every_parameter_that_may_vary(run: Run) -> None:
    for command in ("branch", "switch", "diagram"):
        words = re.sub(r"[│\s]+", " ", run(f"{command} --help")[1])
        assert f"Parameter to vary: {', '.join(NUMBERS)}, or one of the forcing's." in words
        assert "0.1 to 3 for omega unless given." in words


# --- figure and the rest ------------------------------------------------------------------------


@pytest.mark.slow
def test_figure_writes_its_picture_and_says_what_is_exact(run: Run) -> None:
    status, out, _ = run("figure 4")
    assert status == DONE
    assert Path("figure4.png").read_bytes().startswith(b"\x89PNG")
    assert "infinite chain (exact)" in " ".join(out.split())
    assert "Wrote figure4.png." in out


def test_help_and_version_are_quick_for_they_load_no_numerics() -> None:
    code = (
        "import sys; from contbreather.cli import main; status = main(['branch', '--help']);"
        "heavy = {'numpy', 'scipy', 'matplotlib', 'sympy'} & set(sys.modules);"
        "sys.exit(status or (f'loaded {heavy}' if heavy else 0))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == DONE, done.stderr
    assert "--free" in done.stdout


def test_version_is_the_package_s(run: Run) -> None:
    assert run("--version")[:2] == (DONE, f"{cb.__version__}\n")
