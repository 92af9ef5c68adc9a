"""The model's parameters are declared once: what is made of the list says the same everywhere."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
from typing import Any

import pytest

import contbreather as cb
from contbreather.cli import main
from contbreather.errors import BadInput
from contbreather.explorer.forms import PageForms
from contbreather.explorer.session import Session
from contbreather.lattice.conditions import Conditions
from contbreather.parameters import (
    CHOICES,
    NAMES,
    NEEDED,
    NUMBERS,
    SMOOTH,
    parameter,
    table,
    window_of,
)
from contbreather.studies.schema import BranchTask, Chain

DECLARED = {**NUMBERS, **CHOICES}


def test_conditions_are_what_is_declared_in_this_order_with_these_defaults() -> None:
    fields = {one.name: one for one in dataclasses.fields(Conditions)}
    assert tuple(name for name in fields if name in NAMES) == NAMES
    assert set(fields) == {*DECLARED, "restitution"} - {"site"}
    assert {n for n in NAMES if fields[n].default is dataclasses.MISSING} == {*NEEDED}
    assert all(fields[n].default == NUMBERS[n].default for n in NAMES if n not in NEEDED)


def test_the_library_the_command_line_studies_and_the_explorer_have_them_all(capsys):
    assert set(inspect.signature(cb.symmetric).parameters) == {*DECLARED, "root"}
    assert main(["point", "--help"]) == 0
    said = " ".join(re.sub("[│╭╮╰╯─]", " ", capsys.readouterr().out).split())
    for name, one in DECLARED.items():
        assert f"--{name}" in said
        assert " ".join(one.help.split()) in said
    assert {*Chain.model_fields, *BranchTask.model_fields} >= {*DECLARED}
    assert set(PageForms(Session()).breather) == {*DECLARED, "root"}
    assert {row[0] for row in table()} == {*DECLARED, *SMOOTH}


def test_the_explorer_begins_with_an_admissible_breather_that_its_sliders_reach() -> None:
    first = {name: NUMBERS[name].first for name in NEEDED}
    assert cb.symmetric(**first).admissibility().ok
    assert Session().state.fixed == ("k", first["k"])
    typed = PageForms(Session()).breather
    assert {name: float(typed[name].value) for name in NEEDED} == first
    for name in NEEDED:
        low, high, step = NUMBERS[name].slider
        assert all(map(NUMBERS[name].holds, (low, high)))
        assert low <= first[name] <= high
        assert 0.0 < step < high - low


@pytest.mark.parametrize("name", NAMES)
def test_what_is_in_the_range_is_taken_and_what_is_not_is_told_it(name: str) -> None:
    low, high = NUMBERS[name].domain
    for value in (low, min(high, 7.0)):
        assert parameter(name, value) == value
    for value in (low - 1.0, high + 1.0, math.nan, math.inf, "x", None, 1j):
        with pytest.raises(BadInput, match=rf"^{name} = .*: the {NUMBERS[name].meaning} must be"):
            parameter(name, value)


def test_the_coupling_has_one_limit() -> None:
    """1/4, where the band reaches the drive; curves end a margin before."""
    top = math.nextafter(0.25, 0.0)
    assert cb.symmetric(a=0.5, gamma=top, k=0.8).gamma == top
    with pytest.raises(BadInput, match="0 <= gamma < 1/4"):
        cb.symmetric(a=0.5, gamma=0.25, k=0.8)
    with pytest.raises(BadInput, match="0 <= gamma < 1/4"):
        cb.simulate(([0.1, 0.0], [0.0, 0.0]), a=0.5, gamma=0.25, k=0.8, periods=1)
    on: dict[str, Any] = {"a": 0.5, "gamma": 0.1, "k": 0.8}
    for orbit in (
        cb.symmetric(**on),
        cb.symmetric(**on, lattice=cb.Ring(6)),
        cb.symmetric(**on, lattice=cb.Ring(6), damping=0.01),
        cb.multibreather([0, 3], **on, lattice=cb.Ring(8)),
    ):
        assert orbit.problem.domain["gamma"][1] == window_of("gamma")[1]
    arm, _ = cb.switch(cb.trace(cb.symmetric(a=0.6, gamma=0.03, k=0.8), "a").first("PF"))
    assert arm[0].problem.domain["gamma"] == window_of("gamma")
