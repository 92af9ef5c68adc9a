"""Branches of cycles whose mesh was made finer on the way: starts, files, what is left."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import contbreather as cb
from contbreather.flows import Collocation

from .zoo import van_der_pol

FEW = Collocation(intervals=6, points=4)


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


def test_a_branch_that_gets_no_finer_mesh_says_where_it_is_too_coarse(tmp_path: Path, ring) -> None:
    """What goes on from a point keeps the mesh that it has there."""
    short = cb.trace(ring, "mu", within={"mu": (0.4, 0.6)}, events=())
    assert not short.doubtful
    longer = cb.extend(short, within={"mu": (0.4, 2.5)}, end="last")
    (place,) = longer.doubtful
    (first, *_) = (at for at in longer if at["trivial"] > 1e-4)
    assert (place.kind, place.located, place["mu"]) == ("MX", False, first["mu"])
    assert "the mesh is too coarse near t" in place.detail["reason"]
    cb.save(tmp_path / "coarse.nc", longer)
    assert cb.load(tmp_path / "coarse.nc").doubtful[0].detail == place.detail


def test_an_equilibrium_and_its_cycles_in_one_file_are_given_their_equations(
    tmp_path: Path,
) -> None:
    def f(t, x, p):
        growth = p["mu"] - x[0] ** 2 - x[1] ** 2
        return [growth * x[0] - x[1], growth * x[1] + x[0]]

    rest = cb.equilibrium(f, {"x": 0.0, "y": 0.0}, {"mu": -0.5})
    line = cb.trace(rest, "mu", within={"mu": (-0.5, 0.5)})
    (cycles,) = cb.switch(line.first("HB"), steps=cb.Steps(most=8))
    cb.save(tmp_path / "both.nc", line=line, cycles=cycles)
    for problems in ((rest, cycles[0]), (cycles[0], rest)):
        run = cb.load(tmp_path / "both.nc", problem=problems)
        again = cb.trace(run["line"][0], "mu", within={"mu": (-0.5, 0.1)})
        assert again.first("HB")["mu"] == pytest.approx(0.0, abs=1e-12)
        assert run["cycles"][-1].solution.period == pytest.approx(2 * np.pi)
    with pytest.raises(cb.BadInput, match=r"the problem has \['x', 'y'\], which the file has not"):
        cb.load(tmp_path / "both.nc", problem=rest)
