"""What a type checker sees of the installed package, as a user's script does."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import contbreather

ROOT = Path(__file__).parents[1]
HOME = Path(contbreather.__file__).parents[1]
SUBPACKAGES = ("orbits", "certified", "continuation", "simulation", "lattice", "paper", "plotting")
# the types of others are theirs: to read them all takes three times as long
SETTINGS = """
[mypy]
strict = true
follow_imports = silent
[mypy-numpy.*,scipy.*,matplotlib.*,flint.*,IPython.*,xarray.*,networkx.*,sympy.*,shapely.*,pydantic.*,rich.*,cyclopts.*]
follow_imports = skip
follow_imports_for_stubs = true
"""
IMPORTS = "import contbreather as cb\nimport numpy as np\nfrom numpy.typing import NDArray\n"
STORY = """
b = cb.symmetric(a=0.5, gamma=0.08, k=0.8)
branch: cb.Branch = cb.trace(b, "a", within={"a": (0.05, 1.2)}, towards="both")
point: cb.continuation.Point = branch.first("PF")
line: cb.Branch = cb.boundary(point, ("gamma", "a"), within={"gamma": (0.0, 0.24)})
arms: tuple[cb.Branch, ...] = cb.switch(point)
verdict: bool | None = b.stability().stable
proof: bool | None = b.certify().exists
covered = cb.certified.certify(branch).covered[0].low


def square(x: NDArray[np.float64], p: dict[str, float]) -> list[float]:
    return [p["mu"] - x[0] ** 2]


def area(p: dict[str, float]) -> float:
    return p["side"] ** 2


tied = cb.Problem(square, {"x": 1.0}, {"mu": 1.0}).tied({"mu": area}, side=1.0)
mapped = cb.FixedPoint(square, {"x": 1.0}, {"mu": 1.0}, jacobian=square)
cycle = cb.cycle(lambda t, x, p: x, {"x": 1.0}, {"side": 1.0}, period=area)
"""


@pytest.mark.slow
def test_a_user_s_script_sees_a_type_under_every_public_name(tmp_path: Path) -> None:
    assert importlib.util.find_spec("mypy"), "mypy is not installed; pip install -e '.[test]' does"
    public = [*contbreather.__all__]
    for name in (*SUBPACKAGES, "stability"):
        inner = getattr(contbreather, name)
        public += [f"{name}.{one}" for one in inner.__all__]
    shown = "".join(f"reveal_type(cb.{name})\n" for name in public)
    script = tmp_path / "script.py"
    script.write_text(f"{IMPORTS}{STORY}{shown}", encoding="utf-8")
    # mypy finds what is installed by itself, a checkout on PYTHONPATH only if it is told
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if "site-packages" not in HOME.parts:
        env["MYPYPATH"] = str(HOME)
    (tmp_path / "mypy.ini").write_text(SETTINGS, encoding="utf-8")
    line = [sys.executable, "-m", "mypy"]
    line += ["--cache-dir", str(ROOT / ".mypy_cache" / "scripts"), script.name]
    run = subprocess.run(line, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    seen = re.findall(r'Revealed type is "(.*)"', run.stdout)
    assert len(seen) == len(public)
    assert [name for name, type_ in zip(public, seen, strict=True) if type_ == "Any"] == []
