"""`import contbreather` loads what its first use needs and nothing more.

Time depends on the machine and is measured by tests/benchmarks; what is loaded does not.
"""

from __future__ import annotations

import subprocess
import sys

SHOWING = ("matplotlib", "sympy", "networkx", "rich", "cyclopts")
HEAVY = (*SHOWING, "numba", "xarray", "h5netcdf", "pandas")
BREATHER = "import contbreather as cb; b = cb.symmetric(a=0.5, gamma=0.08, k=0.8); "
MOST = 29  # of our modules, for a breather
WALKS = ("trace", "boundary", "diagram", "zones")
FIRST_USE = ("symmetric", *WALKS, "plot", "InfiniteChain", "Problem")


def modules_of(statement: str) -> set[str]:
    """Names in `sys.modules` of a fresh interpreter after `statement`."""
    code = f"{statement}\nimport sys\nprint(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def loaded_by(statement: str) -> set[str]:
    """The packages of these."""
    return {name.split(".")[0] for name in modules_of(statement)}


def test_import_alone_loads_nothing_else() -> None:
    # what the interpreter itself loads at its start (editable installs, .pth files) is not ours
    own = loaded_by("import contbreather") - loaded_by("import __future__, typing")
    assert own - sys.stdlib_module_names == {"contbreather"}


def test_first_use_loads_no_heavy_package() -> None:
    used = "; ".join(f"contbreather.{name}" for name in FIRST_USE)
    assert loaded_by(f"import contbreather; {used}").isdisjoint(HEAVY)


def test_the_first_breather_and_its_verdicts_load_numpy_and_no_other_package() -> None:
    # importing scipy.special, scipy.optimize and scipy.linalg takes twice as long as all of this
    loaded = loaded_by(
        f"{BREATHER} b.stability().over_reflecting; b.admissibility(); b.displacement(1, 0.3)"
    )
    assert loaded.isdisjoint({"scipy", *HEAVY})
    assert "email" not in loaded  # by which importlib.metadata reads what is installed


def test_a_breather_is_a_value_which_loads_nothing_that_continues_it() -> None:
    loaded = modules_of(f"{BREATHER} b.admissibility(); b.displacement(1, 0.3)")
    own = {name for name in loaded if name.startswith("contbreather")}
    rooms = {name.split(".")[1] for name in own if "." in name}
    assert rooms.isdisjoint({"continuation", "stability", "simulation", "flows", "plotting"})
    assert len(own) <= MOST


def test_heavy_packages_would_be_noticed() -> None:
    assert "networkx" in loaded_by("import networkx")
