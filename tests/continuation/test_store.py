"""Branches in a file: every bit comes back, the file is whole or the old one, others read it."""

from __future__ import annotations

import hashlib
import json
import math
import platform
import re
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray

from contbreather.continuation import (
    Branch,
    Point,
    Problem,
    Run,
    Stop,
    boundary,
    extend,
    fold,
    hopf,
    load,
    save,
    trace,
    user,
)
from contbreather.continuation.branches.switching import switch
from contbreather.errors import BadInput, ContbreatherError
from contbreather.storage import netcdf

from ..apart import ended
from . import zoo


def same(one: Branch, other: Branch) -> None:
    """Bit by bit, but for functions."""
    assert repr(one) == repr(other)
    assert (one.stop, one.began, one.reason) == (other.stop, other.began, other.reason)
    assert one.names == other.names
    assert one.free == other.free
    for name in one.names:
        assert np.array_equal(one[name], other[name], equal_nan=True)
        assert one[name].dtype == other[name].dtype
    for before, after in (
        *zip(one, other, strict=True),
        *zip(one.doubtful, other.doubtful, strict=True),
    ):
        same_point(before, after)


def same_point(one: Point, other: Point) -> None:
    assert np.array_equal(one.z, other.z)
    assert np.array_equal(one.tangent, other.tangent)
    for name in ("arclength", "kind", "label", "bracket", "located"):
        assert getattr(one, name) == getattr(other, name)
    assert one.residual == other.residual or np.isnan([one.residual, other.residual]).all()
    for name, value in one.detail.items():
        if isinstance(value, float | int | complex | str):
            assert other.detail[name] == value
    assert repr(one) == repr(other)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.nc"


@pytest.fixture(scope="module")
def problem() -> Problem:
    return replace(
        zoo.brusselator(),
        events=(hopf(), user("X", 1.5), user("B", 1.5)),
        record={
            "sum": lambda point: point["X"] + point["Y"],
            "values": lambda point: np.linalg.eigvals(point.jacobian()[:, :2]).astype(complex),
            "unstable": lambda point: int(point["B"] > 2),
            "stable": lambda point: point["B"] < 2,
        },
        label="Brusselator, β = B",
    )


@pytest.fixture(scope="module")
def branch(problem: Problem) -> Branch:
    return trace(problem, "B", within={"B": (0.5, 3.0)})


# --- round trips ------------------------------------------------------------------------------


# a branch point, an array, folds, closed, HB, scales
KEPT = (zoo.ARMS, zoo.BRATU, zoo.CUSP, zoo.ISOLA, zoo.LORENZ, zoo.STIFF)


@pytest.mark.slow
@pytest.mark.parametrize("case", KEPT, ids=lambda case: case.name)
def test_every_bit_comes_back(case: zoo.Case, path: Path) -> None:
    branch = case.branch
    save(path, branch)
    same(branch, load(path))
    same(branch, load(path, problem=case.problem))


def test_recorded_numbers_come_back_whatever_they_are(branch: Branch, path: Path) -> None:
    save(path, branch)
    again = load(path)
    assert again["values"].dtype == complex
    assert again["unstable"].dtype.kind == "i"
    assert again["stable"].dtype == branch["stable"].dtype == bool
    for name in branch.names:
        assert np.array_equal(branch[name], again[name])
    assert again[4]["sum"] == branch[4]["sum"]
    assert again.first("HB")["omega2"] == branch.first("HB")["omega2"]
    assert "HB1" in str(again)
    assert len(again.table().rows) == len(branch.table().rows)


def test_recorded_words_come_back_as_words(path: Path) -> None:
    words = {"side": lambda point: "über" if point["mu"] > 0.5 else ""}
    branch = line(record=words)
    save(path, branch)
    for again in (load(path), load(path, problem=branch.problem)):
        assert again["side"].tolist() == branch["side"].tolist()
    assert load(path)[-1]["side"] == "über"


@pytest.mark.parametrize("other", [1, "low", True, 1j, np.ones(2), None])
def test_none_in_a_column_is_nan_or_no_word(other: Any, path: Path) -> None:
    none = None if np.ndim(other) == 0 else [None] * 2
    start = Problem(
        lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0},
        record={"odd": lambda point: none if point["mu"] > 0.5 else other},
    )  # fmt: skip
    branch = trace(start, "mu", within={"mu": (-1, 1)}, save=path)
    late = branch["mu"] > 0.5
    for found in (load(path)["odd"], load(path, problem=branch.problem)["odd"]):
        if isinstance(other, str):
            assert found.tolist() == np.where(late, "", other).tolist()
        else:
            assert np.isnan(found[late]).all()
            assert (found[~late] == other).all() or (other is None and np.isnan(found).all())


def test_halves_are_in_a_file_as_floats(path: Path) -> None:
    """netCDF has no halves: its library ends the process that reads some."""
    branch = line(record={"half": lambda point: np.float16(point["mu"])})
    save(path, branch)
    assert np.array_equal(load(path)["half"], branch["half"])
    with h5py.File(path) as file:
        assert file["branch1/half"].dtype == np.float32


STRUCTURE = np.zeros((), [("a", "i4"), ("b", "f8")])[()]
DAY = np.datetime64("2020-01-01")


@pytest.mark.parametrize(
    ("low", "odd"),
    [(1, 2**70), (None, 2**70), (1, {"a": 1}), ("low", {"a": 1}), (DAY, DAY),
     (STRUCTURE, STRUCTURE), (np.longdouble(1), np.longdouble(1))],
)  # fmt: skip
def test_what_no_column_holds_is_refused_in_a_sentence(low: Any, odd: Any, path: Path) -> None:
    branch = line(record={"odd": lambda point: odd if point["mu"] > 0.5 else low})
    start = re.escape(repr(odd)[:25])
    with pytest.raises(BadInput, match=f"the column 'odd' has {start}.*, which no file holds"):
        save(path, branch)


def test_arrays_of_several_shapes_are_refused_in_a_sentence(path: Path) -> None:
    branch = line(record={"odd": lambda point: np.ones((2, 1 + int(point["mu"] > 0.5)))})
    assert branch["odd"][-1].shape == (2, 2)
    with pytest.raises(BadInput, match=r"(?s)'odd' has array.* all of one shape"):
        save(path, branch)


def test_what_several_recorded_numbers_look_at_is_made_once_a_point(path: Path) -> None:
    looked = []
    line = Problem(
        lambda x, p: np.array([x[0] - p["mu"]]), {"x": 0.0}, {"mu": 0.0},
        record={"square": lambda point: point.solution, "half": lambda point: point.solution / 2},
    )  # fmt: skip
    line = zoo.knowing(line, interpret=lambda point: looked.append(point["mu"]) or point["x"] ** 2)
    branch = trace(line, "mu", within={"mu": (0, 1)})
    assert len(branch) > 8
    for ask in (lambda: save(path, branch), branch.columns):
        looked.clear()
        ask()
        assert len(looked) <= len(branch)
    assert load(path)["half"] == pytest.approx(branch["mu"] ** 2 / 2, rel=1e-15)


@pytest.mark.slow
def test_several_branches_come_back_by_name(branch: Branch, path: Path) -> None:
    line = boundary(branch.first("HB"), ("A", "B"), within={"A": (0.5, 2.0)})
    arms = zoo.trace_case(zoo.ARMS, events=[fold()])
    save(path, branch, arms, hopf=line)
    found = load(path)
    assert list(found) == ["branch1", "branch2", "hopf"]
    same(branch, found["branch1"])
    same(arms, found["branch2"])
    same(line, found["hopf"])
    assert found["branch2"].doubtful[0].detail["reason"]


def test_tangents_at_a_branch_point_come_back_as_they_were(path: Path) -> None:
    cross = zoo.scalar(lambda x, p: (x - p["mu"]) * (x + 2 * p["mu"]), 0.5, {"mu": 0.5})
    branch = trace(cross, "mu", within={"mu": (-1, 1)}, events=zoo.STATIC)
    save(path, branch)
    before, after = (one.first("BP").detail["tangents"] for one in (branch, load(path)))
    assert type(before) is type(after)
    np.testing.assert_array_equal(before, after)


def test_one_point_one_side_and_trouble_come_back(path: Path) -> None:
    root = Problem(lambda u, p: u - np.sqrt(p["mu"]), {"x": 1.0}, {"mu": 1.0})
    for given in (
        trace(root, "mu", towards="down"),
        trace(root, "mu", within={"mu": (1.0, 2.0)}, towards="down"),
        zoo.trace_case(zoo.CUSP, towards="up").reversed(),
    ):
        save(path, given)
        same(given, load(path))


# --- what a loaded branch is good for ---------------------------------------------------------


def test_without_equations_a_branch_cannot_be_continued_and_says_so(branch: Branch, path: Path):
    save(path, branch)
    found = load(path)
    assert found.first("HB")["B"] == branch.first("HB")["B"]
    for attempt in (
        lambda: trace(found[3], "B"),
        lambda: boundary(found.first("HB"), ("A", "B")),
        lambda: switch(found.first("HB")),
        lambda: extend(found, within={"B": (0.5, 4.0)}),
        lambda: found[3].jacobian(),
        lambda: found[3].solution,
    ):
        with pytest.raises(ContbreatherError, match=r"without its equations; load\(path, problem="):
            attempt()


@pytest.mark.slow
def test_with_its_equations_a_branch_goes_on(branch: Branch, problem: Problem, path: Path) -> None:
    save(path, branch)
    found = load(path, problem=problem)
    on = trace(found[-1], "B", within={"B": (0.5, 4.0)}, towards="up")
    assert on["B"][-1] == 4.0
    line = boundary(found.first("HB"), ("A", "B"), within={"A": (0.5, 2.0)})
    assert abs(line["B"] - 1 - line["A"] ** 2).max() < 1e-12
    assert found.first("UZ").event is problem.events[2]
    same(branch.join(on), found.join(on))


def test_other_values_of_fixed_parameters_are_those_of_the_file(branch, problem, path):
    save(path, branch)
    found = load(path, problem=problem.at(A=7.0))
    assert (found["A"] == 1.0).all()
    assert trace(found[3], "B", within={"B": (0.5, 3.0)}).stop is Stop.BOUND


@pytest.mark.slow
def test_a_boundary_goes_on_from_a_file(path: Path) -> None:
    window = {"b2": (-1.5, 1.5)}
    events = [fold(), hopf()]
    planar = trace(zoo.takens(), "b1", within={"b1": (-1.0, 1.0)}, events=events)
    folds = boundary(planar.first("LP"), ("b2", "b1"), within=window, events=events)
    hopfs = boundary(planar.first("HB"), ("b2", "b1"), within=window, events=events)
    save(path, folds=folds, hopfs=hopfs)
    for name, before in (("folds", folds), ("hopfs", hopfs)):
        found = load(path, problem=zoo.takens())[name]
        same(before, found)
        assert found[3].base_point["x"] == before[3]["x"]
        # its conditions are those of the point that it was born from, along all of it
        assert max(abs(found.curve.equations(point.z)).max() for point in found) < 1e-9
        again = boundary(found[3], ("b2", "b1"), within=window, events=())
        exact = again["b1"] - (again["b2"] ** 2 / 4 if name == "folds" else 0)
        assert abs(exact).max() < 1e-13
    (meeting,) = [p for p in load(path, problem=zoo.takens())["folds"].special if p.kind != "EP"]
    other = boundary(meeting, ("b2", "b1"), within=window, events=())
    assert abs(other["b1"]).max() < 1e-13


def test_equations_that_do_not_fit_are_refused(branch: Branch, problem: Problem, path: Path):
    save(path, branch)
    with pytest.raises(BadInput, match=r"the problem has \['x', 'mu'\], which the file has not"):
        load(path, problem=zoo.LINE.problem)

    def off(by: float) -> Problem:
        return replace(problem, residual=lambda u, p: problem.residual(u, p) + by)

    assert isinstance(load(path, problem=off(1e-8)), Branch)  # six digits are asked for
    with pytest.raises(BadInput, match=r"do not solve this problem: residual \d[.\de]*-05|0\.0001"):
        load(path, problem=off(1e-4))
    wrong = off(1)
    with pytest.raises(BadInput, match=r"residual (0\.\d+|1); give the one that the branch"):
        load(path, problem=wrong)
    nowhere = replace(problem, residual=lambda u, p: u * np.nan)
    with pytest.raises(BadInput, match="lie outside this problem: the equations are not finite"):
        load(path, problem=nowhere)
    turned = replace(problem, start=dict(reversed(problem.start.items())))
    with pytest.raises(BadInput):
        load(path, problem=turned)


# --- the file ---------------------------------------------------------------------------------


def test_others_read_the_file_by_its_names(branch: Branch, path: Path) -> None:
    save(path, branch)
    with xarray.open_datatree(path, engine="h5netcdf") as tree:
        group = tree["branch1"]
        assert tree.attrs["Conventions"] == "CF-1.11"
        made_by = tree.attrs["made_by"].split(", ")
        assert [one.split()[0] for one in made_by] == ["Python", "contbreather", "numpy", "scipy"]
        assert made_by[::2] == [f"Python {platform.python_version()}", f"numpy {np.__version__}"]
        assert group["stable"].attrs["flag_meanings"] == "false true"
        for name in ("stable", "point_located"):
            assert (group[name].dtype, list(group[name].attrs["flag_values"])) == (np.int8, [0, 1])
        roles = {name: group[name].attrs.get("role", "") for name in group.variables}
        assert roles == dict.fromkeys(roles, "") | {
            "X": "unknown", "Y": "unknown", "A": "fixed", "B": "free",
            **dict.fromkeys(["sum", "values", "unstable", "stable"], "recorded"),
            **{name: "detail" for name in roles if name.startswith("detail_")},
        }  # fmt: skip
        assert group["X"].dims == ("point",)
        assert group["values"].dims == ("point", "values_axis1", "complex")
        assert float(group["A"]) == 1.0
        kind = group["point_kind"]
        assert kind.dtype == np.int8
        meanings = dict(
            zip(kind.attrs["flag_meanings"].split(), kind.attrs["flag_values"], strict=True)
        )
        hopfs = np.flatnonzero(kind.values == meanings["HB"])
        assert group["B"].values[hopfs] == pytest.approx([2.0], abs=1e-13)
        assert group.attrs["stop_meaning"] == Stop.BOUND.value
        assert group.attrs["free"] == "B"
        words = {number: word for word, number in meanings.items()}
        for i, point in enumerate(branch):
            assert words[int(kind.values[i])] == (point.kind or "regular")
            assert bool(group["point_located"].values[i]) == point.located
            bracket = point.bracket or (math.nan, math.nan)
            assert np.array_equal(group["point_bracket"].values[i], bracket, equal_nan=True)
            for name in ("omega2", "l1"):
                own = point.detail.get(name, math.nan)
                assert np.array_equal(group[f"detail_{name}"].values[i], own, equal_nan=True)
            assert bytes(group["detail_criticality"].values[i]).decode() == point.detail.get(
                "criticality", ""
            )


@pytest.mark.slow
def test_names_in_a_file_are_those_of_the_format(path: Path) -> None:
    """As the page on files lists them; others read by these names."""
    start = trace(zoo.CUSP.problem, "h", within={"x": (-2, 2)}, events=[fold()]).first("LP")
    line = boundary(start, ("mu", "h"), within={"mu": (0.9, 1.1)})
    save(path, line=line, arms=zoo.trace_case(zoo.ARMS, events=[fold()]))
    columns = {"arclength", "residual"} | {
        f"point_{name}" for name in ("tangent", "kind", "bracket", "located")
    }
    with xarray.open_datatree(path, engine="h5netcdf") as tree:
        assert set(tree.attrs) == {
            "format", "format_number", "Conventions", "made_by", "created", "alone",
        }  # fmt: skip
        for name, inside, own in (
            ("line", "origin", {"x", "h", "mu", "null"}),
            ("arms", "doubtful", {"x", "mu"}),
        ):
            group = tree[name]
            assert ("boundary" in group.attrs) == (name == "line")
            where_known = {"content", "label", "boundary", "reason", "began_reason"}
            assert set(group.attrs) - where_known == {"free", "stop", "stop_meaning", "began"}
            assert set(group.children) == {inside}
            known = {str(one) for one in group.dataset.variables}
            assert {one for one in known if not one.startswith("detail_")} == {
                *columns, *own, "about_in_json",
            }  # fmt: skip
            assert group.dataset["arclength"].dims == ("point",)


@pytest.mark.slow
def test_a_killed_process_leaves_the_old_file(branch: Branch, path: Path) -> None:
    save(path, branch)
    before = path.read_bytes()
    script = f"""
import os, signal
import numpy as np
import contbreather.continuation as engine
os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)
line = engine.Problem(lambda x, p: x - p["mu"], {{"x": 0.0}}, {{"mu": 0.0}})
engine.save({str(path)!r}, engine.trace(line, "mu", within={{"mu": (-1, 1)}}))
"""
    assert ended("-c", script).returncode == -9
    assert path.read_bytes() == before
    same(branch, load(path))
    save(path, branch)  # what the killed process left is in nobody's way
    same(branch, load(path))


def test_a_refused_list_shows_how_to_name_each(branch, path):
    with pytest.raises(BadInput) as refused:
        save(path, here=branch, arms=[branch, branch])
    names = eval(re.search(r"{.*}", str(refused.value)).group(), {"results": [branch, branch]})
    save(path, here=branch, **names)
    assert [*load(path)] == ["here", "arm0", "arm1"]


@pytest.mark.parametrize(
    ("attempt", "sentence"),
    [
        (lambda path, one: load(path), "cannot read .*run.nc: No such file or directory"),
        (lambda path, one: save(path.parent / "nowhere" / "x.nc", one), "no directory .*nowhere"),
        (lambda path, one: save(path.parent, one), "cannot write .*: it is a directory; name a fi"),
        (lambda path, one: save(path, [one, one]), r"got a list; those of a list are save\(path, "),
        (lambda path, one: save(path), "results with different names are expected, got none"),
        (lambda path, one: save(path, one, branch1=one), "results with different names"),
        (lambda path, one: save(path, {"x": one}), r"those of a dict are save\(path, \*\*results"),
        (lambda path, one: save(path, arms={"x": one}), r"got a dict; those of a dict are save"),
        (
            lambda path, one: Run(path.parent).keep(arms=(one, one)),
            r"got a tuple; those of a list are cb.save\(run.file\(name\), \*results\), with names ",
        ),
        (lambda path, one: save(path, 3), r"^an int cannot be kept in a file; branches.* can$"),
        *(
            (lambda path, one, given=given: load(given), r"name of|cannot read")
            for given in (3, "", None, "\0", "x" * 300)
        ),
        *(
            (
                lambda path, one, given=given: load(given),
                f"read {given}: it is not an ordinary file",
            )
            for given in ("/dev/zero", "/dev/null")
        ),
    ],
)
def test_what_cannot_be_written_or_read_is_refused(attempt, sentence, branch, path):
    with pytest.raises(BadInput, match=sentence) as caught:
        attempt(path, branch)
    assert "synchronously" not in str(caught.value)  # HDF5's word
    assert "errno" not in str(caught.value).lower()
    assert list(path.parent.iterdir()) == []


def line(*, unknown: str = "x", parameter: str = "mu", **more: Any) -> Branch:
    """The branch x = mu under any names."""
    problem = Problem(lambda u, p: u - p[parameter], {unknown: 0.0}, {parameter: 0.0}, **more)
    return trace(problem, parameter, within={parameter: (-1, 1)})


@pytest.mark.parametrize("name", ["point_kind", "point", "bracket_end", "doubtful", "x_axis1"])
def test_names_that_the_file_needs_are_refused(name: str, path: Path) -> None:
    """That of an axis beside an array that has it."""
    start = {"x": np.zeros(3), name: 0.0}
    both = trace(Problem(lambda u, p: u - p["mu"], start, {"mu": 0.0}), "mu", within={"mu": (0, 1)})
    with pytest.raises(BadInput, match=rf"{name!r} is a name that the file needs itself"):
        save(path, both)
    assert not path.exists()


@pytest.mark.parametrize(
    "name",
    ["a/b", "..", ".", "", " a", "a ", "_nc4_a", "a\nb", "\udc80", "\0", "n" * 201, "é" * 101],
)
def test_names_that_netcdf_does_not_take_are_refused(name: str, path: Path) -> None:
    for attempt in (
        lambda: save(path, line(unknown=name)),
        lambda: save(path, line(parameter=name)),
        lambda: save(path, line(record={name: lambda point: 1.0})),
        lambda: save(path, **{name: line()}),
    ):
        with pytest.raises(BadInput, match=r"cannot be the name of a (column|branch) in a file"):
            attempt()
    assert not path.exists()


@pytest.mark.parametrize(
    "name", ["a b", "β", "1", "_x", "a:b", "label", "n" * 200, "é" * 100, "detail_x"]
)
def test_any_other_name_comes_back(name: str, path: Path) -> None:
    branches = {name: line(unknown=name), "other": line(parameter=name)}
    save(path, **branches)
    found = load(path)
    assert list(found) == [*branches]
    for one, branch in branches.items():
        same(branch, found[one])


def test_a_column_that_bears_the_name_of_a_dimension_comes_back(path: Path) -> None:
    branch = line(record={"complex": lambda point: 1j, "z": lambda point: point["mu"] + 2j})
    save(path, branch)
    same(branch, load(path))


@pytest.mark.parametrize("text", ["\0", "\udc80", "β" * 99999])
def test_no_label_keeps_a_branch_from_being_saved(text: str, path: Path) -> None:
    save(path, line(label=text))
    assert load(path).problem.label == text
    assert netcdf.text("é" * 9999 + "xyz") == "é".encode() * 9999 + b"xy"  # as an attribute
    assert netcdf.text("a\0b") == rb"a\0b"


def test_kind_of_several_words_comes_back(path: Path) -> None:
    event = replace(user("x", 0.5), kind="half way")
    save(path, line(events=(event,)))
    assert [point.label for point in load(path).special] == ["EP1", "half way1", "EP2"]


# --- damage -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_every_damaged_file_is_one_sentence_before_hdf5_sees_it(path, monkeypatch):
    """A byte of HDF5's own that is wrong may hang it, one of a number may change it in silence."""
    save(path, line())
    image = path.read_bytes()
    monkeypatch.setattr(h5py.File, "__init__", lambda *_, **__: pytest.fail("HDF5 was asked"))
    damaged = [image[:-cut] + more for cut in range(1, 120) for more in (b"", image[-cut:].upper())]
    for i, at in enumerate(range(0, len(image), 199)):
        before, after = image[:at], image[at:]
        damaged += [
            before + bytes([after[0] ^ 1 << at % 8]) + after[1:],
            (before, before + b"\1more\2" + after, before + after[17:],
             before + bytes(40) + after[40:])[i % 4],
        ]  # fmt: skip
    for content in {*damaged} - {image}:
        path.write_bytes(content)
        with pytest.raises(BadInput, match=r"is damaged|lost its end|not a netCDF-4") as caught:
            load(path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    "content", [b"", b"no numbers", b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"\0" * 500]
)
def test_what_is_no_file_of_branches_is_refused(content: bytes, path: Path) -> None:
    path.write_bytes(content)
    with pytest.raises(BadInput, match=r"cannot read .*it is not a netCDF-4 file|holds nothing"):
        load(path)


@pytest.mark.slow
def test_hdf5_and_netcdf_of_others_are_refused(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(10.0)
    with pytest.raises(BadInput, match="holds nothing that `save` wrote"):
        load(path)
    xarray.Dataset({"x": ("point", [1.0])}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(BadInput, match="holds nothing that `save` wrote"):
        load(path)


def _put(name: str, values: Any) -> Callable[[h5py.File], None]:
    """A column whose axis is no dimension."""

    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = values

    return change


def _without(name: str, **other: str) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        about = json.loads(file["branch1/about_in_json"][()].tobytes())
        del about[name]
        _put("branch1/about_in_json", np.bytes_(json.dumps({**about, **other}).encode()))(file)

    return change


def changed(change: Callable[[h5py.File], None], path: Path) -> None:
    """Let somebody change a file together with its checksum."""
    path.write_bytes(path.read_bytes().partition(b"\nsha256")[0])
    with h5py.File(path, "r+") as file:
        change(file)
    image = path.read_bytes()
    sum_of_all = hashlib.sha256(image).hexdigest().encode()
    path.write_bytes(image + b"\nsha256 of all bytes before: %s\n" % sum_of_all)


def test_the_older_name_of_an_end_is_read(branch: Branch, path: Path) -> None:
    save(path, replace(branch, stop=Stop.DOMAIN))
    assert b"RIM" not in path.read_bytes()
    changed(_without("stop", stop="RIM"), path)
    assert load(path).stop is Stop.DOMAIN


@pytest.mark.parametrize(
    "change",
    [
        lambda file: file.attrs.__delitem__("format_number"),
        lambda file: file.__delitem__("branch1"),
        lambda file: file.__delitem__("branch1/about_in_json"),
        lambda file: file.__delitem__("branch1/x"),
        *map(_without, ("content", "kinds", "settings", "free")),
        _put("branch1/x", np.zeros(2)),
    ],
)
def test_what_somebody_changed_together_with_its_checksum_is_refused(change, path):
    save(path, line())
    changed(change, path)
    with pytest.raises(BadInput, match="its contents are not as `save` writes them") as refused:
        load(path)
    assert str(refused.value).count(str(path)) == 1


def test_columns_of_another_length_are_refused_by_name(path: Path) -> None:
    branch = line(record={"y": lambda point: point["mu"]})
    save(path, branch)
    image, count = path.read_bytes(), len(branch)
    for name in ("x", "mu", "y", "residual", "point_kind", "point_tangent"):
        for shape, length in (((3,), 3), ((2 * count, 3), 2 * count), ((), 1)):
            path.write_bytes(image)
            changed(_put(f"branch1/{name}", np.zeros(shape)), path)
            said = f"the column {name!r} has length {length}, and there are {count} points"
            with pytest.raises(BadInput, match=said):
                load(path)


# reads that stop among the attributes of a file, and in one of its groups
LOCKED = """
import sys, threading
import contbreather as cb
sound, *others = sys.argv[1:]
kept = []
for name in others:
    try:
        cb.load(name)
    except cb.BadInput as error:
        kept.append(error)  # with all that was going on
other = threading.Thread(target=cb.load, args=[sound])
other.start()
other.join()
print(len(kept))
"""


@pytest.mark.slow
def test_a_read_that_fails_keeps_no_other_thread_from_reading(path: Path) -> None:
    """h5py keeps its lock, one for all threads, until a group's items have been gone through."""
    places = [path, *(path.with_name(f"{name}.nc") for name in ("attributes", "group"))]
    for place in places:
        save(place, line())
    changed(lambda file: file.attrs.__setitem__("alone", [1, 2]), places[1])
    changed(_put("branch1/x", np.zeros(2)), places[2])
    done = ended("-c", LOCKED, *places, hung=60)
    assert (done.returncode, done.stdout) == (0, "2\n")


def test_a_folder_without_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    with pytest.raises(BadInput, match=f"cannot read {tmp_path}: there is no file in it"):
        load(tmp_path)


# --- places -----------------------------------------------------------------------------------


FULL = """
import resource, sys
import numpy as np
import contbreather as cb
line = cb.Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0})
branch = cb.trace(line, "mu", within={"mu": (-1, 1)})
resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))
for place in sys.argv[1:]:
    try:
        cb.save(place, branch)
    except cb.BadInput as error:
        print(error)
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of Linux")
def test_full_disk_is_a_sentence_and_keeps_the_old_file(path: Path) -> None:
    """HDF5 itself ends the interpreter where it cannot write."""
    path.write_text("old")
    done = ended("-c", FULL, path, "/dev/full")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (
        f"cannot write {path}: File too large; choose another place\n"
        "cannot write /dev/full: No space left on device; choose another place\n"
    )
    assert path.read_text() == "old"
    assert list(path.parent.iterdir()) == [path]


def test_threads_that_save_to_one_path_do_not_meet(path: Path) -> None:
    branch = line()
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda _: save(path, branch), range(16)))
    same(branch, load(path))
    assert list(path.parent.iterdir()) == [path]
