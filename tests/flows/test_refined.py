"""Branches of cycles whose mesh was made finer on the way: starts, files, what is left."""

from __future__ import annotations

from pathlib import Path

import pytest

import contbreather as cb
from contbreather.flows import Collocation

FEW = Collocation(intervals=6, points=4)


def van_der_pol(t, x, p):
    return [x[1], p["mu"] * (1 - x[0] ** 2) * x[1] - x[0]]


@pytest.fixture(scope="module")
def ring() -> cb.Problem:
    return cb.cycle(van_der_pol, {"x": 2.0, "v": 0.0}, {"mu": 0.5}, settle=50, collocation=FEW)


@pytest.fixture(scope="module")
def refined(ring) -> cb.Branch:
    branch = cb.trace(ring, "mu", within={"mu": (0.5, 1.5)}, towards="up")
    assert branch["mesh"].shape[1] > FEW.intervals
    return branch


def test_a_branch_on_a_finer_mesh_begins_at_the_parameter_that_was_given(refined) -> None:
    assert refined[0]["mu"] == 0.5


def test_a_branch_on_a_finer_mesh_gets_its_equations_back_from_a_file(
    tmp_path: Path, ring, refined
) -> None:
    cb.save(tmp_path / "ring.nc", refined)
    again = cb.load(tmp_path / "ring.nc", problem=ring)
    assert again[-1].solution.period == refined[-1].solution.period
    longer = cb.extend(again, within={"mu": (0.5, 1.6)})
    assert longer[-1]["mu"] == 1.6
    other = cb.cycle(van_der_pol, {"x": 2.0, "v": 0.0}, {"mu": 0.5}, settle=50)
    with pytest.raises(cb.BadInput, match=r"'orbit' has shape \(\d+,\) in the file, \(40,\) in"):
        cb.load(tmp_path / "ring.nc", problem=other)
