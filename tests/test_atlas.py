"""Atlases: the points of many zone diagrams, their surfaces, and the command that makes them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import contbreather as cb
from contbreather.orbits.atlas import save_atlas, words
from contbreather.plotting import plot_atlas
from contbreather.plotting import zones as zones_drawn

from .typed import Run

FEW = {"gamma": (0.0, 0.02)}
DRIVE = cb.Symbolic("cos(t) + c3*cos(3*t)", c3=0.0)


@pytest.fixture(scope="module")
def found() -> Any:
    return cb.atlas(k=[0.8, 2.0], c3=(0.0, 0.01), forcing=DRIVE, within=FEW, executor=1)


def test_an_atlas_has_the_points_of_each_diagram_in_order(found: Any) -> None:
    own = cb.zones(k=0.8, forcing=DRIVE.at(c3=0.01), within=FEW)
    here = found.isel(point=(found.k == 0.8) & (found.c3 == 0.01))
    assert np.unique(here.slice).tolist() == [1]
    for name in ("gamma", "a", "p", "phi"):
        assert np.array_equal(here[name], np.concatenate([branch[name] for _, branch in own]))
    kinds = [kind for kind, branch in own for _ in branch]
    assert words(here, "kind") == kinds
    lengths = [int((here.curve == number).sum()) for number in np.unique(here.curve)]
    assert lengths == [len(branch) for _, branch in own]


def test_values_without_a_diagram_are_listed_with_the_reason(found: Any) -> None:
    assert found.failed_k.to_numpy().tolist() == [2.0, 2.0]
    assert found.failed_c3.to_numpy().tolist() == [0.0, 0.01]
    assert all("0 <= k <= 1" in reason for reason in found.reason.to_numpy())
    with pytest.raises(cb.BadInput, match="0 <= k <= 1"):
        cb.atlas(k=[2.0], executor=1)


def test_where_limits_meet_an_atlas_says_which() -> None:
    whole = cb.atlas(k=0.8, within={"gamma": (0.1, 0.14)}, executor=1)
    at = {word: i for i, word in enumerate(words(whole, "meeting")) if word}
    assert at.keys() == {"LP-NS", "NS-LP"}  # elsewhere none
    assert whole.gamma.to_numpy()[at["NS-LP"]] == pytest.approx(0.125220720183, abs=1e-12)
    assert words(whole, "kind")[at["NS-LP"]] == "NS"
    assert {
        name: of.attrs["long_name"] for name, of in whole.items() if "long_name" in of.attrs
    } == {
        "kind": "which limit of the breather the point is on",
        "meeting": "the limits that meet there",
        "curve": "number of the curve, its points in order along it",
        "slice": "number of the diagram",
    }


def test_an_atlas_out_of_a_file_is_drawn_as_the_one_that_was_written(found: Any, tmp_path: Path):
    path = save_atlas(tmp_path / "atlas.nc", found)
    for one in (found, *found.variables.values()):
        assert not any(isinstance(value, bytes) for value in one.attrs.values())
    with xarray.open_dataset(path, engine="h5netcdf", decode_cf=False) as again:
        assert np.array_equal(again.a, found.a)
        assert words(again, "kind") == words(found, "kind")
        assert again.attrs == found.attrs
        assert [
            one.tobytes().decode().rstrip("\0") for one in again.reason.to_numpy()
        ] == found.reason.to_numpy().tolist()
        for one in (found, again):
            axes = plot_atlas(one, over="c3", at={"k": 0.8}, kinds=["LP"]).axes
            assert len(axes.lines) == 2  # one for each c3
            assert len(axes.collections) == 1  # and the surface between them
            line = np.array(axes.lines[1].get_data_3d())
            here = (found.c3 == 0.01) & (found.kind == 0)
            assert np.array_equal(line[2], found.a.to_numpy()[here])
            assert set(line[1]) == {0.01}


def test_the_legend_says_which_limits_are_curves_alone(found: Any) -> None:
    def legend(atlas: Any, **at: Any) -> list[str]:
        shown = plot_atlas(atlas, over="c3", at={"k": 0.8}, kinds=["LP", "GR"]).axes
        return [text.get_text() for text in shown.get_legend().get_texts()]

    assert legend(found) == ["fold (LP)", "grazing (GR)"]
    grazing = (found.kind == 1) & (found.k == 0.8)
    torn = found.isel(point=~(grazing & (found.c3 == 0.01)))
    assert legend(torn) == ["fold (LP)", "grazing (GR), curves alone"]
    third = torn.assign(c3=torn.c3 + 0.02, curve=torn.curve + 100)
    assert legend(xarray.concat([found, third], "point", data_vars="minimal")) == [
        "fold (LP)", "grazing (GR), partly curves alone",
    ]  # fmt: skip


def test_what_an_atlas_is_drawn_over_has_to_be_clear(found: Any) -> None:
    both = found.assign(k=found.k + found.c3)
    with pytest.raises(cb.BadInput, match="k and c3 have several values: say over which"):
        plot_atlas(both)
    with pytest.raises(
        cb.BadInput, match=r"k has several values: say at which .* at=\{'k': \.\.\.\}"
    ):
        plot_atlas(both, over="c3")  # two diagrams of another k were one picture
    with pytest.raises(cb.BadInput, match=r"at c3 = 0\.5: the atlas has \[0\.0, 0\.01\]"):
        plot_atlas(found, at={"c3": 0.5})
    with pytest.raises(cb.BadInput, match=r"a kind must be 'LP', .* got 'PD'"):
        plot_atlas(found, at={"c3": 0.0}, kinds=["PD"])
    with pytest.raises(cb.BadInput, match=r"kinds = 3: several were expected"):
        plot_atlas(found, kinds=3)  # type: ignore[arg-type]
    once = plot_atlas(found, over="c3", at={"k": 0.8}, kinds=iter(["LP"])).axes
    assert [text.get_text() for text in once.get_legend().get_texts()] == ["fold (LP)"]
    branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.4, 0.6)})
    for other in (3, branch, branch.to_xarray()):  # a branch has a reason, too
        with pytest.raises(cb.BadInput, match="an atlas was expected"):
            plot_atlas(other)  # type: ignore[arg-type]


def test_an_interrupted_atlas_says_so_in_its_file(found: Any, monkeypatch: Any, tmp_path: Path):
    """As its picture and its tables do: values that were not come to are in no column."""
    assert "interrupted" not in found.attrs
    first, *_ = cb.zones_many([0.8], within=FEW, executor=1)

    def stopped(*given: Any, **more: Any) -> Any:
        yield first
        raise KeyboardInterrupt

    monkeypatch.setattr("contbreather.orbits.atlas.zones_many", stopped)
    with pytest.raises(cb.errors.Interrupted) as stop:
        cb.atlas(k=[0.8, 0.7, 0.6], within=FEW)
    path = save_atlas(tmp_path / "part.nc", stop.value.partial)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.attrs["interrupted"] == "after 1 of 3 diagrams"


@pytest.mark.slow
def test_the_command_writes_data_and_a_picture(run: Run) -> None:
    line = "atlas --k 0.8:0.8:1,2 --gamma-window 0 0.01 --workers 1 --save atlas.nc"
    status, out, _ = run(f"{line} --json --csv atlas.csv -o atlas.png")
    content = json.loads(out)
    assert (status, content["interrupted"]) == (0, False)
    assert Path("atlas.png").stat().st_size > 10_000
    assert np.unique(content["atlas"]["k"]).tolist() == [0.8]
    assert content["failed"][0]["failed_k"] == 2.0
    with xarray.open_dataset("atlas.nc", engine="h5netcdf", decode_cf=False) as data:
        assert data.a.to_numpy().tolist() == content["atlas"]["a"]
    assert "atlas.nc is an atlas: xarray.open_dataset reads it" in run("show atlas.nc")[2]
    assert Path("atlas.csv").read_text().count("\n") == 1 + len(content["atlas"]["a"])


@pytest.mark.slow
def test_atlases_are_of_damped_finite_lattices(run: Run) -> None:
    """Curves, file and JSON are of the lattice that was typed."""
    on = "--lattice open:3 --site 1 --damping 0.02 --gamma-window 0.03 0.0301"
    line = f"atlas --k 0.8 {on} --a-window 0.755 0.765 --workers 1 --save a.nc --json"
    content = json.loads(run(line)[1])
    found, model = content["atlas"], {"lattice": cb.OpenChain(3), "site": 1, "damping": 0.02}
    assert {*found["kind"]} == {"PF"}
    assert [content[n] for n in ("lattice", "site", "damping")] == [
        model["lattice"].describe(), 1, 0.02,
    ]  # fmt: skip
    for i in (0, -1):
        fork = cb.symmetric(found["a"][i], found["gamma"][i], 0.8, **model)
        assert fork.phi == pytest.approx(found["phi"][i], abs=1e-9)
        assert abs(fork.multipliers(half=True) - 1.0).min() < 1e-7
    with xarray.open_dataset("a.nc", engine="h5netcdf", decode_cf=False) as data:
        assert (data.attrs["damping"], data.attrs["lattice"]) == (0.02, content["lattice"])


def test_an_atlas_says_of_which_walls_threshold_and_frequency_it_is() -> None:
    """Another wall, threshold or omega is another atlas: by its attributes it is no other one."""
    own = {"lattice": cb.OpenChain(3), "site": 1, "damping": 0.02, "threshold": 1.0}
    within = {"gamma": (0.03, 0.0301), "a": (1.2 * 0.755, 1.2 * 0.765)}
    scaled = cb.atlas(k=0.8, within=within, executor=1, walls=(-1.2, 1.2), **own)
    assert (scaled.attrs["walls"], scaled.attrs["threshold"]) == ("-1.2,1.2", 1.0)
    within = {"gamma": (0.12, 0.1204), "a": (4 * 0.7, 4 * 0.8)}
    fast = cb.atlas(k=0.8, within=within, executor=1, omega=2.0)
    assert fast.attrs["omega"] == 2.0
    assert fast.attrs.keys().isdisjoint({"walls", "threshold"})  # the infinite chain has neither


def test_an_atlas_without_a_curve_is_refused() -> None:
    with pytest.raises(cb.BadInput, match="no curve passes the window"):
        cb.atlas(k=0.8, within={"gamma": (0.03, 0.031), "a": (0.5, 0.51)}, executor=1)


@pytest.mark.slow
def test_the_command_says_how_many_diagrams_there_are_and_which_are_missing(run):
    status, out, _ = run("atlas --k 0.8,2,0.7 --gamma-window 0 0.01 --workers 1 --save a.nc")
    first, missing, wrote = out.splitlines()
    assert (status, wrote) == (0, "Wrote a.nc.")
    with xarray.open_dataset("a.nc", engine="h5netcdf", decode_cf=False) as data:
        kinds = words(data, "kind")
    parts = (f"{kinds.count(kind)} points of {kind}" for kind in ("LP", "GR", "PF"))
    assert first == f"2 diagrams: {', '.join(parts)}."
    assert missing.startswith("No diagram at k = 2: k = 2.0: the restitution coefficient")
    assert missing.endswith("choose k in that range.")
    out = run("atlas --k 0.8 --gamma-window 0 0.01 --workers 1")[1]
    assert out.startswith("1 diagram: ")
    assert out.endswith("Wrote atlas.nc.\nWrote atlas.png.\n")
    assert Path("atlas.png").read_bytes().startswith(b"\x89PNG")


def test_surfaces_are_spanned_between_the_nearest_curves_whichever_way_they_run(found: Any) -> None:
    t = np.linspace(0.0, 1.0, 5) ** 2  # uneven, and in other units
    flat, high = (np.stack([0.1 * t, 0.0 * t, y + 0.0 * t], axis=1) for y in (0.0, 1.0))
    up = np.array([0.0, 0.1, 0.1])
    other = [high[::-1] + up, flat + up]
    spans = zones_drawn._strips([flat, high], other)
    assert zones_drawn._strips(other, [flat]) == []  # to one curve from two there is none
    for (one, its), own in zip(spans, (flat, high), strict=True):
        wanted = np.stack([np.linspace(0.0, 0.1, 60), np.zeros(60), np.full(60, own[0, 2])], 1)
        np.testing.assert_allclose(one, wanted, atol=1e-12)
        np.testing.assert_allclose(its, wanted + up, atol=1e-12)
    axes = plot_atlas(found, over="c3", at={"k": 0.8}).axes
    assert [getattr(axes, f"get_{one}label")() for one in "xyz"] == [r"$\gamma$", r"$c_{3}$", "$a$"]
    assert [one.get_alpha() for one in axes.collections] == [0.25] * 3


def test_an_atlas_is_known_by_its_attribute(found: Any, run: Any) -> None:
    path = save_atlas("atlas.nc", found)
    with pytest.raises(cb.BadInput, match=r"atlas\.nc is an atlas: xarray\.open_dataset reads it"):
        cb.load(path)
    cb.save("other.nc", cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", within={"a": (0.6, 0.7)}))
    assert [*cb.Run(".")] == ["other"]
    whole = path.read_bytes()
    for damaged in (whole[:-1], whole[:500] + b"~" + whole[501:]):
        path.write_bytes(damaged)
        assert re.search("lost its end|is damaged", run("show atlas.nc")[2])


def test_a_result_may_have_the_name_of_an_atlas(run: Any) -> None:
    branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", within={"a": (0.69, 0.71)})
    cb.save("run.nc", **{"atlas of contbreather": branch})
    status, out, _ = run("show run.nc")
    assert (status, "symmetric breather" in out) == (0, True)
