"""Results on disk while they are computed: whole at any moment, and at little cost."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation import Stop
from contbreather.continuation.branches.diagram import diagram
from contbreather.continuation.branches.switching import switch
from contbreather.continuation.walk import checkpoint
from contbreather.errors import BadInput, Interrupted

from .zoo import CUSP, logistic

FEW = cb.Steps(first=0.1, largest=0.3)


class Clock:
    """Time that goes on by `tick` whenever it is asked for."""

    def __init__(self) -> None:
        self.now, self.tick = 0.0, 1.0

    def monotonic(self) -> float:
        self.now += self.tick
        return self.now


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[], list[Any]]:
    """What is in the file after some of the writings, the first and the last among them, with a
    clock on which seconds are short."""
    monkeypatch.setattr(checkpoint, "time", Clock())
    monkeypatch.setattr(checkpoint, "EVERY", 5.0)
    monkeypatch.setattr(checkpoint, "SHARE", 1e9)
    images: list[bytes] = []
    write = checkpoint.write_results

    def looked(path: Path, named: Any, **how: Any) -> Path:
        images.append(write(path, named, **how).read_bytes())
        return path

    monkeypatch.setattr(checkpoint, "write_results", looked)

    def some() -> list[Any]:
        found: list[Any] = []
        for i in np.unique(np.linspace(0, len(images) - 1, 6).astype(int)):
            (tmp_path / "then.nc").write_bytes(images[i])
            one = cb.load(tmp_path / "then.nc")
            found.append(dict(one) if isinstance(one, cb.Run) else one)
        images.clear()
        return found

    return some


def parabola(**more: Any) -> cb.Problem:
    return cb.Problem(lambda x, p: x**2 - p["mu"], {"x": 1.0}, {"mu": 1.0}, **more)


def test_file_is_a_beginning_of_the_branch_at_any_moment(written, tmp_path):
    path = tmp_path / "run.nc"
    branch = cb.trace(
        parabola(), "mu", within={"x": (-1, 1.5)}, events=[cb.fold()], steps=FEW, save=path
    )
    found = written()
    assert len(found) > 2
    known = {point.z.tobytes() for point in branch}
    lengths = [len(one) for one in found]
    assert lengths == sorted(lengths)
    for one in found[:-1]:
        assert one.stop.name == "INTERRUPTED"
        assert {point.z.tobytes() for point in one} <= known
    assert repr(found[-1]) == repr(branch) == repr(cb.load(path))


@pytest.mark.slow
def test_longer_work_keeps_all_of_it(written: Callable[[], list[Any]], tmp_path: Path) -> None:
    """Arms beside each other, boundaries with where they come from, diagrams with their tree."""
    mine = cb.Problem(lambda x, p: x * (p["mu"] - x**2), {"x": 0.0}, {"mu": -1.0})
    asked: dict[str, Any] = {"within": {"mu": (-0.3, 0.3)}, "steps": FEW}
    axis = cb.trace(mine, "mu", within={"mu": (-1, 0.3)}, events=[cb.branch_point()])
    arms = switch(axis.first("BP"), **asked, save=tmp_path / "arms.nc")
    found = written()
    assert [list(one) for one in (found[0], found[-1])] == [["arm1"], ["arm1", "arm2"]]
    assert all(one["arm1"][0].parent.label == "BP1" for one in found)
    assert repr(found[-1]["arm2"]) == repr(arms[1])
    first = cb.trace(CUSP.problem, "h", within={"x": (-2, 2)}, events=[cb.fold()]).first("LP")
    asked = {"within": {"mu": (0.9, 1.1)}, "steps": FEW}
    line = cb.boundary(first, ("mu", "h"), **asked, save=tmp_path / "line.nc")
    found = written()
    assert all(one.origin.label == "LP1" for one in found)
    assert repr(found[-1]) == repr(line)
    asked = {"within": {"mu": (-1, 0.3)}, "steps": FEW, "events": [cb.branch_point()]}
    tree = diagram(mine, "mu", **asked, save=tmp_path / "tree.nc")
    found = written()
    counts = [len(one) for one in found]
    assert (counts[0], counts[-1], counts) == (1, len(tree), sorted(counts))
    assert all(one.interrupted for one in found[:-1])


def test_extended_branch_keeps_its_beginning(written: Callable[[], list[Any]], tmp_path: Path):
    short = cb.trace(parabola(), "mu", within={"x": (0.9, 1.1)})
    longer = cb.extend(short, within={"x": (0.5, 1.5)}, save=tmp_path / "run.nc")
    found = written()
    assert all(len(one) >= len(short) for one in found)
    assert repr(found[-1]) == repr(longer)


def test_a_closed_curve_goes_once_around_however_often_it_is_extended() -> None:
    circle = cb.Problem(lambda x, p: x**2 + p["mu"] ** 2 - 1, {"x": 1.0}, {"mu": 0.0})
    for end, most in (("last", 20), ("first", 7), ("both", 33)):
        piece = cb.trace(circle, "mu", events=[cb.fold()], steps=cb.Steps(most=most))
        while piece.stop is Stop.MOST or piece.began is Stop.MOST:
            piece = cb.extend(piece, end=end)
        assert (piece.stop, piece.began) == (Stop.CLOSED, None)
        assert sorted(round(point["mu"], 9) for point in piece.special) == [-1.0, 1.0]
        assert piece["arclength"][-1] == pytest.approx(2 * np.pi, rel=1e-3)
        assert np.array_equal(piece[0].z, piece[-1].z)
        with pytest.raises(BadInput, match="at its first point it is closed"):
            cb.extend(piece, end="first")


def test_a_closed_curve_goes_once_around_whatever_the_units_of_its_start(tmp_path: Path) -> None:
    def circle(size: float) -> cb.Problem:
        start = {"x": 0.6}, {"mu": 0.8}
        return cb.Problem(lambda x, p: x**2 + p["mu"] ** 2 - 1, *start, scales={"x": size})

    piece = cb.trace(circle(1.0), "mu", events=[cb.fold()], steps=cb.Steps(most=7))
    cb.save(tmp_path / "run.nc", piece)
    for size in (1.1, 3.0):  # the metric in which a tangent has length 1 is another
        again = cb.load(tmp_path / "run.nc", problem=circle(size))
        longer = cb.extend(again, steps=cb.Steps(most=300))
        assert (longer.stop, len(longer.special)) == (Stop.CLOSED, 2)


def test_interrupted_work_is_kept(tmp_path: Path) -> None:
    def residual(x: Any, p: Any) -> Any:
        if p["mu"] > 1.3:
            raise KeyboardInterrupt
        return x**2 - p["mu"]

    own = cb.Problem(residual, {"x": 1.0}, {"mu": 1.0})
    with pytest.raises(Interrupted) as caught:
        cb.trace(own, "mu", within={"mu": (0.5, 2.0)}, save=tmp_path / "run.nc")
    assert repr(cb.load(tmp_path / "run.nc")) == repr(caught.value.partial)


def test_a_walk_is_kept_though_a_recorded_column_of_it_raises(tmp_path: Path) -> None:
    own = replace(parabola(), record={"inverse": lambda point: 1 / 0})
    with pytest.raises(ZeroDivisionError):
        cb.trace(own, "mu", within={"x": (-1, 1.5)}, save=tmp_path / "run.nc")
    walked = cb.trace(parabola(), "mu", within={"x": (-1, 1.5)})
    np.testing.assert_array_equal(cb.load(tmp_path / "run.nc")["mu"], walked["mu"])


def test_place_that_cannot_be_written_is_refused_before_anything_is_computed(tmp_path: Path):
    def never(x: Any, p: Any) -> Any:
        raise AssertionError

    own = cb.Problem(never, {"x": 1.0}, {"mu": 1.0})
    for place, sentence in (
        (tmp_path / "nowhere" / "run.nc", "there is no directory"),
        (tmp_path, "it is a directory"),
        (3, "save takes the name of a file, 'run.nc' for instance; got 3|a number|an int"),
    ):
        with pytest.raises(BadInput, match=sentence):
            cb.trace(own, "mu", save=place)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("took", "special", "wanted"),
    [
        (0.0, 450, [3.0, 4.5, 7.5]),  # every few seconds, and at special points
        (1.0, 7, [3.0, 3.0 + 1 + 1 / checkpoint.SHARE]),  # which hurry no file beyond its share
    ],
)
def test_writing_takes_its_share_of_the_time_and_no_more(
    took: float, special: int, wanted: list[float], monkeypatch, tmp_path
) -> None:
    clock, times = Clock(), list[float]()
    clock.tick = 0.0
    monkeypatch.setattr(checkpoint, "time", clock)

    def write(path: Path, named: Any, **how: Any) -> None:
        times.append(clock.now)
        clock.now += took

    monkeypatch.setattr(checkpoint, "write_results", write)
    kept = checkpoint.Checkpoint(tmp_path / "run.nc", "branch")
    for i in range(1, int(100 * wanted[-1]) + 50):
        clock.now += 0.01
        kept.look(i % special == 0, lambda: "a piece")
    assert times == pytest.approx(wanted, abs=0.08)


# --- folders ------------------------------------------------------------------------------------


def test_what_is_kept_is_not_called_a_table(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    for wrong in (
        lambda: cb.trace(parabola(), "mu", within={"x": (0.9, 1.1)}, save=path),
        lambda: cb.save(path, cb.trace(parabola(), "mu", within={"x": (0.9, 1.1)})),
    ):
        with pytest.raises(BadInput, match=r"netCDF-4 file, call it run\.nc; tables are .* to_csv"):
            wrong()
    assert not path.exists()


def test_folder_has_what_is_in_its_files_by_name(tmp_path: Path) -> None:
    curve = cb.trace(parabola(), "mu", within={"x": (0.5, 1.5)})
    run = cb.Run(tmp_path / "study")
    assert (list(run), repr(run)) == ([], f"<Run {tmp_path / 'study'}: nothing yet>")
    run.keep(curve=curve)
    (tmp_path / "study" / "inner").mkdir()
    cb.save(tmp_path / "study" / "inner" / "two.nc", curve, other=curve)
    (tmp_path / "study" / "notes.txt").write_text("not a result")
    assert list(run) == ["curve", "inner/two/branch1", "inner/two/other"]
    assert repr(run["inner/two/other"]) == repr(curve)
    assert all(key in run for key in ("curve", "EP1", "curve/EP1"))
    assert "LP9" not in run
    assert run.get("LP9") is None
    with pytest.raises(BadInput, match=r"no 'LP9' in .*study; there are \['curve', 'inner"):
        run["LP9"]
    for number in (0, slice(2)):
        with pytest.raises(BadInput, match=r"results have names; .*study has \['curve', 'inner"):
            run[number]  # type: ignore[index]
    with pytest.raises(BadInput, match=r"'EP1' is a point of several: curve, inner/two/branch1"):
        cb.Run(tmp_path / "study")["EP1"]
    assert run["inner/two/other/EP1"].arclength == run["inner/two/other"].first("EP1").arclength
    run.keep(curve=cb.trace(parabola(), "mu", within={"x": (0.9, 1.1)}))
    assert run["curve"]["x"].max() == 1.1  # read anew, for the file has changed
    with pytest.raises(BadInput, match="is one file; a folder is expected"):
        cb.Run(tmp_path / "study" / "curve.nc").keep(more=curve)


def test_file_of_a_later_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from contbreather.storage import netcdf

    branch = cb.trace(parabola(), "mu", within={"x": (0.9, 1.1)})
    with monkeypatch.context() as patch:
        patch.setattr(netcdf, "NUMBER", netcdf.NUMBER + 1)
        cb.save(tmp_path / "new.nc", branch)
    with pytest.raises(BadInput, match=r"new.nc was written by a later version \(Python 3.*update"):
        cb.load(tmp_path / "new.nc")
    with pytest.raises(BadInput, match="a later version"):
        dict(cb.Run(tmp_path))


def test_full_disk_ends_no_run_and_loses_no_result(monkeypatch, tmp_path, caplog):
    """Nor does it touch what was there."""
    path = tmp_path / "run.nc"
    cb.save(path, cb.trace(parabola(), "mu", within={"x": (0.9, 1.1)}))
    before = path.read_bytes()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    clock = Clock()
    monkeypatch.setattr(checkpoint, "time", clock)
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(
        checkpoint.NotKept, match=r"^cannot write .*No space left on device"
    ) as caught:
        cb.trace(parabola(), "mu", within={"x": (0.5, 1.5)}, save=path)
    assert caught.value.result["x"].max() == 1.5
    assert "No space left on device; choose another place; the run goes on" in caplog.text
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_cycles_of_a_map_come_back_from_the_map(tmp_path: Path) -> None:
    """The arms of a doubling solve the equations of an iterate, which the map has."""
    start = logistic()
    tree = diagram(start, "r", within={"r": (2.4, 3.5)}, depth=2, save=tmp_path / "tree.nc")
    again = cb.load(tmp_path / "tree.nc", problem=start)
    assert [repr(branch) for branch in again] == [repr(branch) for branch in tree]
    longer = cb.extend(again[2], within={"r": (2.4, 3.55)})
    assert longer.first("PD")["r"] == pytest.approx(3.5440903596, abs=1e-9)
