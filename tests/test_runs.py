"""Simulated runs in files, and tables of everything that has columns."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.columns import Columns
from contbreather.simulation import Axis, Basin, Sample, periodic, simulate_smooth, sweep

from .apart import ONE_THREAD, ended

ON: dict[str, Any] = {"a": 0.5, "gamma": 0.08, "k": 0.8}
STATE = cb.symmetric(**ON).state(6)


def impacting() -> Any:
    sample = Sample((0, 2), 4)
    return cb.simulate(STATE, **ON, periods=5.5, t0=0.1, walls={2: (None, 2.0)}, sample=sample)


def smooth() -> Any:
    return simulate_smooth(STATE, a=0.5, gamma=0.08, k=0.8, m=6, periods=2)


@pytest.mark.parametrize("make", [impacting, smooth])
def test_simulated_run_comes_back_bit_by_bit(make: Callable[[], Any], tmp_path: Path) -> None:
    run = make()
    cb.save(tmp_path / "run.nc", run=run)
    again = cb.load(tmp_path / "run.nc")
    assert (type(again), repr(again)) == (type(run), repr(run))
    assert (again.conditions, again.end, again.stop) == (run.conditions, run.end, run.stop)
    for one, other in ((run.times, again.times), (run.strobe, again.strobe)):
        assert np.array_equal(one, other)
    assert np.array_equal(run.final, again.final)
    if run.record is not None:
        assert run.record.sites == again.record.sites
        assert np.array_equal(run.record.u, again.record.u)
        assert (again.impacts == run.impacts).all()
        assert again.rests.dtype == run.rests.dtype
        further = [cb.simulate(one.final, **ON, periods=1, t0=one.end) for one in (run, again)]
        assert np.array_equal(further[0].impacts, further[1].impacts)


@pytest.mark.slow
def test_motion_that_returns_comes_back_with_its_equations(tmp_path: Path) -> None:
    found = periodic(STATE, **ON, damping=0.02, symmetric=True)
    branch = cb.trace(found, "a", within={"a": (0.48, 0.52)}, events=())
    cb.save(tmp_path / "run.nc", branch)
    again = cb.load(tmp_path / "run.nc")
    assert repr(again[1].solution) == repr(branch[1].solution)
    longer = [cb.extend(one, within={"a": (0.47, 0.52)}) for one in (branch, again)]
    assert np.array_equal(longer[0]["u"], longer[1]["u"])


class Mine(cb.Harmonic):
    """Somebody's own forcing."""


def test_run_under_somebody_s_own_forcing_is_refused_in_a_sentence(tmp_path: Path) -> None:
    run = cb.simulate(STATE, **ON, forcing=Mine(), periods=1)
    with pytest.raises(cb.BadInput, match="is of your own making, and a file holds numbers only"):
        cb.save(tmp_path / "run.nc", run)
    with pytest.raises(
        cb.BadInput, match=r"'Point|a Point.* cannot be kept in a file; branches, .*zones, "
    ):
        cb.save(tmp_path / "run.nc", point=branch()[0])
    with pytest.raises(cb.BadInput, match="a Lattice cannot be kept in a file; branches, "):
        cb.save(tmp_path / "run.nc", lattice=cb.OpenChain(3))
    assert not (tmp_path / "run.nc").exists()


def branch() -> cb.Branch:
    start = cb.symmetric(0.76, 0.04, 0.8)
    return cb.trace(start, "a", within={"a": (0.74, 0.8)}, steps=cb.Steps(largest=0.05))


def shot() -> cb.Branch:
    start = cb.shooting(cb.symmetric(0.5, 0.04, 0.8), sites=4)
    return cb.trace(start, "a", within={"a": (0.5, 0.52)}, events=())


def plane() -> Basin:
    outcome = np.array([[1, 2], [3, 3]], dtype=np.int8)
    x, y = Axis("u", 0, [0.1, 0.2]), Axis("v", 1, [0.3, 0.4])
    return Basin(x, y, outcome, np.arange(4.0).reshape(2, 2) / 3, complete=True)


TABLES: dict[str, Callable[[], Columns]] = {
    "branch": branch,
    "arrays": shot,
    "diagram": lambda: cb.diagram(cb.symmetric(0.76, 0.04, 0.8), "a", within={"a": (0.74, 0.8)}),
    "zones": lambda: cb.zones(k=0.8, within={"gamma": (0.02, 0.04)}, progress=False),
    "run": impacting,
    "smooth": smooth,
    "sweep": lambda: sweep(STATE, "a", [0.5, 0.51], periods=2, gamma=0.08, k=0.8),
    "basin": plane,
}


@pytest.mark.parametrize("name", TABLES)
def test_all_that_has_columns_gives_them_as_tables(name: str, tmp_path: Path) -> None:
    value = TABLES[name]()
    frame, data = value.to_dataframe(), value.to_xarray()
    columns = value.columns()
    assert {len(column) for column in columns.values()} == {len(frame)}
    assert data.sizes
    with value.to_csv(tmp_path / "table.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head == list(frame)
    for i, own in enumerate(head):
        cells = [row[i] for row in rows]
        if frame[own].dtype.kind == "f":
            back = np.array([float(cell or "nan") for cell in cells])
            assert np.array_equal(back, frame[own].to_numpy(), equal_nan=True)
            assert all(cell in ("", repr(float(cell or "0"))) for cell in cells)
        else:
            assert cells == [str(cell) for cell in frame[own]]


def test_a_dataset_says_what_its_columns_are_of() -> None:
    assert "gamma = " in branch().to_xarray().attrs["title"]
    run = impacting()
    about = run.to_xarray().attrs
    assert (about["k"], about["forcing"]) == (run.conditions.k, run.conditions.forcing.describe())
    assert {"lam", "m"} <= {*smooth().to_xarray().attrs}


# each file in a copy of a process that has loaded what others wrote, and nothing of this package
READ_ALONE = """
import os, sys
import h5py, scipy.sparse.linalg
for name in sys.argv[1:]:
    if os.fork() == 0:
        import contbreather as cb
        found = cb.load(name)
        cb.save(name, found)
        print(type(found).__name__, *{"pandas", "xarray"} & {*sys.modules})
        break
    os.wait()
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not copied here")
def test_a_process_that_has_done_nothing_else_reads_and_writes_files_without_xarray(tmp_path: Path):
    kinds = {name: TABLES[name]() for name in ("branch", "diagram", "zones", "run", "smooth")}
    for name, value in kinds.items():
        cb.save(tmp_path / f"{name}.nc", value)
    files = [f"{name}.nc" for name in kinds]
    done = ended("-c", READ_ALONE, *files, cwd=tmp_path, env=ONE_THREAD)
    assert done.stdout.split() == [type(value).__name__ for value in kinds.values()]
    assert done.stderr == ""


def test_table_of_a_branch_has_labels_and_no_count_that_rounding_decides() -> None:
    frame = branch().to_dataframe()
    (pitchfork,) = frame.index[frame["label"] == "PF1"]
    assert np.isnan(frame["unstable"][pitchfork])
    assert frame["a"][pitchfork] == pytest.approx(0.777632426, abs=1e-9)
    assert set(frame["unstable"].dropna()) == {0, 1}
    arrays = list(shot().to_dataframe())
    first = ["label", "a", "gamma", "k", "damping", "spring", "p", "unstable", "condition"]
    assert arrays[: len(first)] == first
    assert arrays[arrays.index("t1") :][:2] == ["t1", "J1"]  # unknowns stand behind


def test_a_name_may_be_that_of_the_rows_or_of_an_argument() -> None:
    line = cb.Problem(lambda x, p: x - p["self"], {"point": 0.5}, {"self": 0.5}).at(self=0.25)
    frame = cb.trace(line, "self", within={"self": (0, 1)}).to_dataframe()
    assert frame["point"].equals(frame["self"].rename("point"))
    assert frame.index.name == "point"
