"""Dicts of values, and what the version before wrote in files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import contbreather as cb
from contbreather.continuation.walk.checkpoint import result_to_dict
from contbreather.errors import BadInput
from contbreather.runs import load
from contbreather.simulation import Sample, open_recording, record, simulate
from contbreather.storage.serialise import NotSerialisable, from_dict, to_dict

EARLIER = Path(__file__).parent / "earlier"
STATE = [0.1, 0.2, 0.3], [0.0, 0.1, 0.0]
CONDITIONS = {
    "a": 0.6, "gamma": 0.05, "k": 0.8, "damping": 0.01, "spring": 0.2,
    "lattice": cb.OpenChain(3), "walls": {0: (-1.0, 1.0), 2: (None, 1.5)},
    "forcing": cb.Fourier(cos={1: -1.0, 3: 0.1}),
}  # fmt: skip


def test_a_boundary_of_the_version_before_is_read_and_gone_on_with() -> None:
    line = load(EARLIER / "results.nc")["line"]
    assert line["a"][[0, -1]] == pytest.approx([0.7654045290241108, 0.7903678185618426], abs=0)
    assert (line.origin.label, line.origin.event.kind) == ("PF1", "PF")
    longer = cb.extend(line, within={"gamma": (0.03, 0.05)})
    fresh = cb.boundary(line.origin, ("gamma", "a"), within={"gamma": (0.03, 0.05)})
    assert longer["a"][[0, -1]] == pytest.approx(fresh["a"][[0, -1]], abs=1e-12)


def test_a_run_of_the_version_before_is_read() -> None:
    run, fresh = load(EARLIER / "results.nc")["run"], simulate(STATE, periods=5, **CONDITIONS)
    assert repr(run) == repr(fresh)
    assert run.conditions == fresh.conditions
    assert run.impacts["time"] == pytest.approx(fresh.impacts["time"], abs=1e-12)


def test_a_recording_of_the_version_before_is_refused() -> None:
    for read in (open_recording, lambda path: record(path, STATE, periods=9, **CONDITIONS)):
        with pytest.raises(BadInput, match="is a folder, as versions before recorded into"):
            read(EARLIER)


def test_all_parts_of_a_lattice_come_back_from_a_recording(tmp_path: Path) -> None:
    parts = {"stiffness": np.diag([1.0, 2.0, 3.0]), "masses": [1.0, 2.0, 4.0], "drive": [1, 0.5, 2]}
    mine = cb.Lattice(**parts, name="mine")
    record(tmp_path / "run.nc", STATE, periods=1, **CONDITIONS | {"lattice": mine})
    lattice = open_recording(tmp_path / "run.nc").conditions.lattice
    assert (lattice, lattice.name) == (mine, "mine")
    for part, wanted in parts.items():
        np.testing.assert_array_equal(getattr(lattice, part), wanted)


def test_what_somebody_has_written_has_no_dict() -> None:
    class Mine(cb.Harmonic):
        pass

    for value in (Mine(), object(), np.cos):
        with pytest.raises(NotSerialisable):
            to_dict({"forcing": value})


@pytest.mark.parametrize("value", [3, object(), {"kind": "ring"}, cb.Ring(3), cb.Harmonic()])
def test_what_has_neither_columns_nor_parts_is_no_result(value) -> None:
    with pytest.raises(NotSerialisable):
        result_to_dict(value)


def test_a_forcing_of_somebody_s_own_is_recorded_by_its_harmonics(tmp_path: Path) -> None:
    class Mine(cb.Fourier):
        pass

    own = CONDITIONS | {"forcing": Mine(cos={1: -1.0, 3: 0.1})}
    record(tmp_path / "run", STATE, periods=2, **own)
    assert record(tmp_path / "run", STATE, periods=4, **own).periods == 4
    assert open_recording(tmp_path / "run").conditions.forcing.f(0.3) == pytest.approx(
        own["forcing"].f(0.3), abs=1e-15
    )


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ({"kind": "nothing like it"}, "'nothing like it' is of no kind that is known here"),
        ({"kind": "ring", "sites": 0}, "sites = 0"),
        ({"kind": "ring"}, r"a ring of \[\] cannot be made again"),
        ({"kind": "ring", "sites": 3, "more": 1}, r"a ring of \['sites', 'more'\] cannot be made"),
        ({"kind": "held", "of": {"kind": "os.system"}, "spring": 0.1}, "'os.system' is of no kind"),
    ],
)
def test_a_dict_that_no_reader_takes_is_refused(content, sentence: str) -> None:
    with pytest.raises(BadInput, match=sentence):
        from_dict(content)


def test_columns_of_a_run_of_another_length_are_refused_by_name() -> None:
    content = to_dict(simulate(STATE, periods=9, **CONDITIONS, sample=Sample()))
    columns = {name: column[1] for name, column in content["columns"].items()}
    assert from_dict({**content, "columns": columns}).periods == 9
    for name, what in {
        "u": "10 states", "impact_site": f"{len(columns['impact_time'])} impacts",
        "rest_begins": "0 rests", "sample_v": "576 samples",
    }.items():  # fmt: skip
        said = f"the column {name!r} has length 1, and there are {what}"
        with pytest.raises(BadInput, match=said):
            from_dict({**content, "columns": {**columns, name: np.zeros((1, 3))}})


def test_a_parameter_may_be_called_kind() -> None:
    forcing = cb.Symbolic("-cos(t) - kind*cos(3*t)", kind=0.1)
    assert from_dict(to_dict(forcing)) == forcing


@pytest.mark.parametrize("content", [{}, {"r": 1}, {"kind": 3}, "mine"])
def test_what_no_file_could_read_is_refused_where_it_is_given(content) -> None:
    class Mine(cb.Problem):
        serialised = content

    with pytest.raises(cb.BadInput, match="a dict with a 'kind'"):
        Mine(lambda x, p: x - p["m"], {"x": 0.0}, {"m": 0.0})
