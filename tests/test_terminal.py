"""What a terminal would obey does not come out of somebody else's study or file."""

from __future__ import annotations

from pathlib import Path
from unicodedata import category

import pytest

import contbreather as cb

from .typed import Run

OBEYED = "\x1b]0;mine\x07\x9b31m\x7f\u202e"
TYPED = r"\u001b]0;mine\u0007\u009b31m\u007f\u202e"  # as TOML has it
STUDY = """
title = "{}"
[chain]
lattice = "{}"
forcing = "{}"
walls = ["{}"]
parameters = {{"{}" = 1.0}}
[branch."{}"]
free = "{}"
gamma = 0.04
k = 0.8
[branch.b]
free = 'a'
gamma = 0.04
k = 0.8
over = {{"{}" = [0.1]}}
[arms.b2]
of = "{}"
at = "{}"
within = {{"{}" = [0, 1]}}
[figure."{}"]
draws = ["{}"]
file = "{}"
x = "{}"
["{}"]
"{}" = "{}"
"""


def obeyed(text: str) -> set[str]:
    return {letter for letter in text if category(letter)[0] == "C"} - {"\n"}


@pytest.mark.parametrize("where", range(STUDY.count('"{}"')))
def test_no_word_of_a_study_is_obeyed(where: int, tmp_path: Path, run: Run) -> None:
    path, how = tmp_path / "study.toml", ("", "--dry-run", "--json")[where % 3]
    words = ["a"] * STUDY.count('"{}"')
    words[where] = f"a{TYPED}"
    path.write_text(STUDY.format(*words))
    status, out, err = run(f"run {path} {how}")
    assert status == 2
    assert obeyed(out + err) == set()
    with pytest.raises(cb.BadInput) as refused:
        cb.studies.read(path)
    assert obeyed(str(refused.value)) == set()


def test_no_name_of_a_file_is_obeyed(tmp_path: Path, run: Run) -> None:
    for command in ("run", "show"):
        status, out, err = run(f"{command} '{tmp_path}/{OBEYED}.toml'")
        assert status == 2
        assert obeyed(out + err) == set()
        assert r"\x1b]0;mine\x07" in err


@pytest.mark.parametrize("how", ["", "--json"])
def test_no_word_of_a_result_is_obeyed(how: str, tmp_path: Path, run: Run) -> None:
    line = cb.Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0}, label=f"mine{OBEYED}")
    path = tmp_path / "run.nc"
    cb.save(path, cb.trace(line, "mu", within={"mu": (-1, 1)}))
    status, out, err = run(f"show {path} {how}")
    assert status == 0
    assert "mine" in out
    assert obeyed(out + err) == set()
