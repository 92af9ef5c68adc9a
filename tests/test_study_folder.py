"""What a study writes: in its run's folder and nowhere else, and over nothing that it did not
write itself."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import contbreather as cb
from contbreather.studies import read
from contbreather.studies import run as conduct

from .typed import Run

ONE = "[branch.b]\nfree = 'a'\ngamma = 0.02\nk = 0.8\nwindow = [0.7, 0.72]\n"
DRAWN = ONE + "[figure.f]\ndraws = ['b']\n"
PRECIOUS = b"what took a year"


@pytest.fixture
def precious(tmp_path: Path) -> Path:
    """A picture of the user's, beside the study."""
    path = tmp_path / "precious.png"
    path.write_bytes(PRECIOUS)
    return path


def study(folder: Path, text: str = DRAWN) -> Path:
    path = folder / "study.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("place", ["{there}", "../precious.png", "sub/../../precious.png",
                                   "sub/f.png", "./f.png", "~/f.png/..png/x.png"])  # fmt: skip
def test_a_figure_is_a_name_in_the_folder_of_its_run(place: str, precious: Path, run: Run):
    path = study(precious.parent, f"{DRAWN}file = '{place.format(there=precious)}'\n")
    status, out, err = run(f"run {path}")
    assert (status, out) == (2, "")
    assert "line 8, figure.f.file: a name in the folder of the results was expected" in err
    assert precious.read_bytes() == PRECIOUS
    assert sorted(item.name for item in precious.parent.iterdir()) == ["precious.png", "study.toml"]


@pytest.mark.parametrize("name", ["../precious", "/tmp/x", "a.b", "a b", "..", r"a\u001b[31m"])
@pytest.mark.parametrize(
    "text", [ONE + '[figure."{}"]\ndraws = ["b"]\n', '[zones."{}"]\nk = 0.8\n']
)
def test_names_of_figures_and_of_results_are_names(name: str, text: str, tmp_path: Path) -> None:
    with pytest.raises(cb.BadInput, match="a name of letters, digits, - and _ was expected"):
        read(study(tmp_path, text.format(name)))


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize(
    "link",
    ["f.png", "b.nc", "z.nc4", ".study", "scan", ".study/f.png", ".study/b.json",
     ".study/z.nc4"],
)  # fmt: skip
@pytest.mark.parametrize("there", [False, True])
def test_links_lead_nowhere(link: str, there: bool, again: bool, tmp_path: Path) -> None:
    """A folder that came with the study may have links in it to anything."""
    text = DRAWN + "[branch.scan]\nfree='a'\ngamma=[0.02, 0.03]\nk=0.8\n[atlas.z]\nk=0.8\n"
    path, outside = study(tmp_path, text), tmp_path / "outside"
    folder = tmp_path / "study"
    (folder / link).parent.mkdir(parents=True)
    if there and "." in link[1:]:
        outside.write_bytes(PRECIOUS)
    elif there:
        outside.mkdir()
    (folder / link).symlink_to(outside)
    with pytest.raises(cb.BadInput, match=rf"{link}.* a link to .*outside.*; results are kept in"):
        conduct(path, executor=1, again=again)
    assert [item.name for item in folder.iterdir()] == [link.partition("/")[0]]
    assert os.path.lexists(outside) == there
    if outside.is_file():
        assert outside.read_bytes() == PRECIOUS


@pytest.mark.slow
@pytest.mark.parametrize("name", ["f.png", "b.nc"])
def test_files_of_others_are_replaced_only_on_demand(name: str, tmp_path: Path) -> None:
    """Of somebody who keeps his pictures in a folder that has the name of the study."""
    path, mine = study(tmp_path), tmp_path / "study" / name
    mine.parent.mkdir()
    mine.write_bytes(PRECIOUS)
    with pytest.raises(cb.BadInput, match=rf"files that it did not write: {name}\. .*--again"):
        conduct(path, executor=1)
    assert mine.read_bytes() == PRECIOUS
    assert [item.name for item in mine.parent.iterdir()] == [name]
    report = conduct(path, executor=1, again=True)
    assert (report.failed, report.computed) == ({}, ["b"])
    assert mine.stat().st_size > 5_000
    assert conduct(path, executor=1).kept == ["b"]


@pytest.mark.slow
def test_a_figure_that_was_touched_up_since_is_left_as_it_is(tmp_path: Path) -> None:
    path = study(tmp_path)
    (drawn,) = conduct(path, executor=1).written
    first = drawn.read_bytes()
    assert conduct(path, executor=1).written == [drawn]  # its own picture it draws anew
    drawn.write_bytes(PRECIOUS)
    with pytest.raises(cb.BadInput, match=r"files that it did not write: f\.png"):
        conduct(path, executor=1)
    assert drawn.read_bytes() == PRECIOUS
    conduct(path, executor=1, again=True)
    assert drawn.read_bytes() == first


@pytest.mark.slow
def test_a_study_that_was_killed_at_any_write_goes_on(tmp_path, monkeypatch):
    """What is half done when a process dies is no file of others: each write is the last once."""
    path, replace, whole = study(tmp_path), os.replace, None
    for most in range(20):
        left = most

        def killed(*places: Path) -> None:
            nonlocal left
            if not left:
                raise KeyboardInterrupt
            left -= 1
            replace(*places)

        monkeypatch.setattr(os, "replace", killed)
        folder = tmp_path / f"after{most}"
        try:
            conduct(path, folder=folder, executor=1)
            whole = most
        except cb.errors.Interrupted:
            pass
        monkeypatch.setattr(os, "replace", replace)
        report = conduct(path, folder=folder, executor=1)
        assert report.failed == {}
        assert {item.name for item in folder.iterdir()} == {".study", "b.nc", "f.png"}
        if whole is not None:
            break
    assert whole is not None
    assert whole >= 4


DEEP = {
    "brackets": "x = " + "[" * 5_000 + "]" * 5_000,
    "tables": "[branch.b]\nk = " + "{a=" * 5_000 + "1" + "}" * 5_000,
    "dots": "[branch.b]\nk = {" + ".".join("a" * 5_000) + " = 1}",
    "dots in a list": "[zones.z]\nk = [{" + ".".join("a" * 5_000) + " = 1}]",
    "headers": "[" + ".".join("a" * 5_000) + "]",
    "digits": "[zones.z]\nk = " + "9" * 5_000,
}


@pytest.mark.parametrize("kind", DEEP)
def test_no_nesting_is_too_deep_for_a_sentence(kind: str, tmp_path: Path, run: Run) -> None:
    status, out, err = run(f"run {study(tmp_path, DEEP[kind])}")
    assert (status, out) == (2, "")
    assert err.startswith("contbreather: ")
    assert len(err) < 1_000
