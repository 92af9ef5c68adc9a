"""The source keeps to the floors drawn in docs/architecture.md."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

import networkx as nx
import pytest

import contbreather

PACKAGE = Path(contbreather.__file__).parent
DRAWING = Path(__file__).parents[1] / "docs" / "architecture.md"
FRONT_DESK = "contbreather"
ENGINE_MAY_LOAD = {"numpy", "scipy"}
ENGINE_MAY_LOAD_LATE = ENGINE_MAY_LOAD | {"networkx", "numba", "rich", "xarray"}


@dataclass(frozen=True)
class Import:
    """One import statement: who, whom, where, and whether it runs when the module is loaded."""

    source: str
    target: str
    line: int
    at_load: bool

    def __str__(self) -> str:
        return f"{self.source}:{self.line} imports {self.target}"


# --- reading the source ---------------------------------------------------------------------


@cache
def modules(package: Path) -> dict[str, ast.Module]:
    trees = {}
    for path in sorted(package.rglob("*.py")):
        parts = [package.name, *path.relative_to(package).with_suffix("").parts]
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        trees[name] = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    return trees


def is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def statements(node: ast.AST, at_load: bool = True) -> Iterator[tuple[ast.AST, bool]]:
    for child in ast.iter_child_nodes(node):
        late = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef) or is_type_checking(child)
        yield child, at_load
        yield from statements(child, at_load and not late)


def absolute(node: ast.ImportFrom, source: str, is_package: bool) -> str:
    if not node.level:
        return node.module or ""
    parts = source.split(".") + ([] if not is_package else [""])
    return ".".join([*parts[: -node.level], *filter(None, [node.module])])


def imports(trees: dict[str, ast.Module], packages: set[str]) -> list[Import]:
    """Every import of every module; `from package import submodule` counts as the submodule."""
    found = []
    for source, tree in trees.items():
        for node, at_load in statements(tree):
            if isinstance(node, ast.Import):
                targets = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                base = absolute(node, source, source in packages)
                inner = [f"{base}.{alias.name}" for alias in node.names]
                targets = sorted({full if full in trees else base for full in inner})
            else:
                continue
            found += [Import(source, target, node.lineno, at_load) for target in targets]
    return found


def package_names(package: Path) -> set[str]:
    return {
        ".".join([package.name, *path.parent.relative_to(package).parts])
        for path in package.rglob("__init__.py")
    }


@cache
def imports_of(package: Path) -> list[Import]:
    return imports(modules(package), package_names(package))


# --- reading the drawing --------------------------------------------------------------------


def drawn(text: str, level: str = "floor") -> dict[str, int]:
    """The floor of each name."""
    floors = {}
    for line in re.findall(rf"^{level} .*$", text, flags=re.MULTILINE):
        head, *_ = re.split(r"\s{3,}", line.removeprefix(level).strip().replace("   ", " ", 1))
        number, *names = head.split()
        floors |= dict.fromkeys(names, int(number))
    return floors


def listed(stub: Path) -> dict[str, tuple[str, str | None]]:
    """The module of each public name, and the alias that exports it, as type checkers read them."""
    body = ast.parse(stub.read_text(encoding="utf-8")).body
    found = [node for node in body if isinstance(node, ast.ImportFrom) and node.module]
    return {one.name: (node.module or "", one.asname) for node in found for one in node.names}


STUBS = sorted(PACKAGE.rglob("__init__.pyi"))
FLOORS, STOREYS = (drawn(DRAWING.read_text(encoding="utf-8"), one) for one in ("floor", "storey"))
HOUSE = f"{FRONT_DESK}.continuation."


def room(module: str) -> str:
    """The name in the drawing that a module belongs to: `contbreather.lattice.modes` -> lattice."""
    return module.split(".")[1]


def inside(module: str) -> bool:
    return module.split(".")[0] == FRONT_DESK


# --- the rules, each as the list of sentences that say where it is broken ---------------------


def upward(found: list[Import], floors: dict[str, int]) -> list[str]:
    top = max(floors.values())
    broken = []
    for one in found:
        if one.source == FRONT_DESK or not inside(one.target):
            continue
        here = floors[room(one.source)]
        there = top if one.target == FRONT_DESK else floors[room(one.target)]
        if there > here:
            broken.append(f"{one}: floor {here} reaches up to floor {there}")
    return broken


def upstairs(found: list[Import], storeys: dict[str, int]) -> list[str]:
    """Imports between modules of the engine that lead to a higher storey."""
    pairs = [
        (one, *(name.removeprefix(HOUSE).split(".")[0] for name in (one.source, one.target)))
        for one in found
        if one.source.startswith(HOUSE) and one.target.startswith(HOUSE)
    ]
    return [str(one) for one, here, there in pairs if storeys[there] > storeys[here]]


def in_circles(found: list[Import]) -> set[str]:
    """The modules that import each other in a circle, wherever their imports stand."""
    pairs = [(one.source, one.target) for one in found if inside(one.target)]
    graph = nx.DiGraph([(one, other) for one, other in pairs if FRONT_DESK not in (one, other)])
    rings = [part for part in nx.strongly_connected_components(graph) if len(part) > 1]
    return {module.removeprefix(f"{FRONT_DESK}.") for part in rings for module in part}


def outside_the_engine(found: list[Import]) -> list[str]:
    names = "continuation checks columns compiler errors files fronts kernels machine_code "
    names += "one_thread progress storage tables workers"
    own = {f"contbreather.{name}" for name in names.split()}
    broken = []
    for one in found:
        if not one.source.startswith("contbreather.continuation"):
            continue
        allowed = ENGINE_MAY_LOAD if one.at_load else ENGINE_MAY_LOAD_LATE
        if inside(one.target):
            allowed_here = ".".join(one.target.split(".")[:2]) in own
        else:
            first = one.target.split(".")[0]
            allowed_here = first in allowed or first in sys.stdlib_module_names
        if not allowed_here:
            broken.append(str(one))
    return broken


# --- the tests --------------------------------------------------------------------------------


@pytest.mark.slow
def test_no_module_imports_from_a_higher_floor() -> None:
    assert upward(imports_of(PACKAGE), FLOORS) == []


def test_no_module_of_the_engine_imports_from_a_higher_storey() -> None:
    assert upstairs(imports_of(PACKAGE), STOREYS) == []
    there = {name.removeprefix(HOUSE).split(".")[0] for name in modules(PACKAGE) if HOUSE in name}
    assert there == set(STOREYS)
    up = Import(f"{HOUSE}algebra.newton", f"{HOUSE}walk.trace", 1, at_load=True)
    assert upstairs([up], STOREYS) == [str(up)]


def test_modules_import_each_other_in_no_circle() -> None:
    """Imports inside functions and for type checkers count, too."""
    assert in_circles(imports_of(PACKAGE)) == set()


def test_modules_import_from_modules_and_not_from_package_fronts() -> None:
    found = [one for one in imports_of(PACKAGE) if FRONT_DESK not in (one.source, one.target)]
    fronts = {one.source for one in found if one.target == f"{FRONT_DESK}.fronts"}
    assert len(fronts) > 5
    assert [str(one) for one in found if one.target in fronts] == []


def test_the_engine_needs_numpy_and_scipy_only() -> None:
    assert outside_the_engine(imports_of(PACKAGE)) == []


def test_every_module_stands_on_a_drawn_floor_and_every_drawn_one_exists() -> None:
    there = {room(name) for name in modules(PACKAGE) if name != FRONT_DESK}
    assert there == set(FLOORS)


def test_a_subpackage_answers_to_its_former_name_and_says_so() -> None:
    with pytest.warns(DeprecationWarning, match="contbreather.dynamics is contbreather.simulation"):
        assert contbreather.dynamics is contbreather.simulation


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: stub.parent.name)
def test_a_type_checker_reads_the_list_that_python_reads(stub: Path) -> None:
    name = ".".join([FRONT_DESK, *stub.parent.relative_to(PACKAGE).parts])
    package, stubs = import_module(name), listed(stub)
    assert {*stubs} == set(package.__all__)
    for one, (home, alias) in stubs.items():
        assert alias == one  # or it is not exported
        assert getattr(package, one) is getattr(import_module(f"{name}.{home}"), one)


@pytest.mark.parametrize(
    ("first", "name", "known_as"),
    [
        *(("", name, f"contbreather.{name}") for name in ("orbits", "lattice.parse", "plotting")),
        # a function, and the module that it is called after
        (".orbits.zones", "orbits.zones", "zones"),
    ],
)
def test_what_a_package_holds_is_fetched_on_first_use(first: str, name: str, known_as: str) -> None:
    code = f"import contbreather{first}; print(contbreather.{name}.__name__)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == f"{known_as}\n"


def test_a_package_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ModuleNotFoundError("No module named 'numpy'", name="numpy")

    monkeypatch.setattr("contbreather.fronts.import_module", missing)
    with pytest.raises(ModuleNotFoundError, match="numpy"):
        contbreather.nothing  # noqa: B018


def test_unknown_public_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'symetric'; it has .*BadInput"):
        contbreather.symetric  # noqa: B018
    with pytest.raises(TypeError, match=r"stability is a package, no function; it has .*verdict"):
        contbreather.stability()


def test_public_names_are_listed() -> None:
    assert set(contbreather.__all__) <= set(dir(contbreather))
    others = set(dir(contbreather)) - set(contbreather.__all__)  # subpackages, and no helper
    assert others >= {"errors", "explorer", "flows", "workers"}
    packages = others - {"errors", "workers"}
    assert all(import_module(f"{FRONT_DESK}.{name}").__path__ for name in packages)
    namespace: dict[str, object] = {}
    exec("from contbreather import *", namespace)
    assert set(contbreather.__all__) <= set(namespace)


# --- the rules can fail: each on a package with one fault planted -----------------------------


FLOORS_THERE = {"errors": 0, "continuation": 1, "lattice": 2, "cli": 7}
TYPED = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from "
ENGINE, MODES, GREEN = "continuation/trace", "lattice/modes", "lattice/green"
THERE = {ENGINE: "", MODES: "from .green import g", GREEN: "import sys", "errors": ""}


@pytest.mark.parametrize(
    ("module", "text", "up", "outside", "circle"),
    [
        (ENGINE, "from contbreather.lattice import modes", 1, 1, False),
        (ENGINE, "from contbreather.lattice.modes import chi", 1, 1, False),
        (ENGINE, "import contbreather.lattice.modes", 1, 1, False),
        (ENGINE, "from ..lattice import modes", 1, 1, False),
        (ENGINE, "def late():\n    from contbreather import lattice", 1, 1, False),
        (ENGINE, f"{TYPED}..lattice.modes import chi", 1, 1, False),
        (ENGINE, "import contbreather as cb", 1, 1, False),
        (ENGINE, "from contbreather import symmetric", 1, 1, False),
        (ENGINE, "import numpy, scipy.linalg, math", 0, 0, False),
        (ENGINE, "import networkx", 0, 1, False),
        (ENGINE, "def late():\n    import networkx", 0, 0, False),
        (ENGINE, "def late():\n    import sympy", 0, 1, False),
        (MODES, "from ..errors import Bad\nfrom contbreather.continuation import a", 0, 0, False),
        (GREEN, "from . import modes", 0, 0, True),
        (GREEN, "def late():\n    from . import modes", 0, 0, True),
        (GREEN, f"{TYPED}.modes import chi", 0, 0, True),
    ],
)  # fmt: skip
def test_a_fault_that_is_planted_is_seen_and_what_is_allowed_is_not(
    tmp_path: Path, module: str, text: str, up: int, outside: int, circle: bool
) -> None:
    for name, content in {**THERE, module: text}.items():
        path = (tmp_path / FRONT_DESK).joinpath(*name.split("/")).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
        for folder in {path.parent, tmp_path / FRONT_DESK}:
            (folder / "__init__.py").touch()
    found = imports_of(tmp_path / FRONT_DESK)
    assert len(upward(found, FLOORS_THERE)) == up
    assert len(outside_the_engine(found)) == outside
    assert in_circles(found) == ({"lattice.green", "lattice.modes"} if circle else set())
