"""Octave, and so MATLAB, reads the numbers of a run by the names that the page on files gives."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import contbreather as cb

READ = """
pkg load netcdf
info = ncinfo('run.nc');
kind = ncread('run.nc', '/arm/point_kind');
printf("%s ", info.Groups.Name, ncreadatt('run.nc', '/arm/point_kind', 'flag_meanings'));
printf("%s\\n", ncreadatt('run.nc', '/arm', 'label'));
for name = {'a', 'p', 'unstable', 'residual'}
  printf("%.17g ", ncread('run.nc', ['/arm/' name{1}])); printf("\\n");
end
about = jsondecode(ncread('run.nc', '/arm/about_in_json')');
printf("%s %d %d\\n", about.free{1}, size(ncread('run.nc', '/arm/point_tangent')));
printf("%d ", sum(kind > 0), ncread('run.nc', '/simulated/impact_site'));
"""


def octave() -> str | None:
    """The program, if it is here and has its package for netCDF."""
    found = shutil.which("octave-cli")
    command = [found or "", "--quiet", "--no-gui", "--eval", "pkg load netcdf"]
    return found if found and subprocess.run(command, capture_output=True).returncode == 0 else None


@pytest.mark.slow
def test_octave_reads_every_number_by_its_name(tmp_path: Path) -> None:
    program = octave()
    if program is None:
        pytest.skip("octave with its package netcdf is not installed (apt install octave-netcdf)")
    branch = cb.trace(cb.symmetric(0.76, 0.04, 0.8), "a", within={"a": (0.74, 0.8)})
    arm = cb.switch(branch.first("PF"), within={"a": (0.74, 0.8)})[0]
    state = branch[0].state(sites=4)
    simulated = cb.simulate(state, a=0.74, gamma=0.04, k=0.8, periods=2)
    cb.save(tmp_path / "run.nc", arm=arm, simulated=simulated)
    (tmp_path / "read.m").write_text(READ)
    done = subprocess.run(
        [program, "--quiet", "--no-gui", "read.m"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout, done.stderr
    words, *columns, about, counts = done.stdout.splitlines()
    assert words == "arm simulated regular EP asymmetric breather"
    for name, column in zip(("a", "p", "unstable", "residual"), columns, strict=True):
        assert np.array_equal(np.array(column.split(), dtype=float), arm[name])
    assert about == f"a {arm[0].z.size} {len(arm)}"
    sites = simulated.impacts["site"].tolist()
    assert [int(n) for n in counts.split()] == [len(arm.special), *sites]
