"""What the README promises about setting up is what the project and its checks do."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import contbreather

from .test_floors import PACKAGE, modules, package_names

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CHECKS = (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def command(name: str) -> str:
    """The one line of the code block that follows the marker of a README command."""
    found = re.findall(rf"^<!-- command: {name} -->\n```sh\n(.*)\n```$", README, flags=re.MULTILINE)
    assert len(found) == 1
    return str(found[0])


def test_each_set_up_is_one_line_that_makes_its_environment() -> None:
    for name in ("zones", "test"):
        assert command(name).startswith("python3 -m venv .venv && .venv/bin/pip install ")


def test_first_command_draws_the_zones_and_second_runs_the_tests() -> None:
    assert command("zones").endswith("&& .venv/bin/contbreather zones")
    assert command("test").endswith(
        '-e ".[test]" && .venv/bin/python -m pytest -n auto -m "not slow"'
    )


def test_what_the_readme_s_command_leaves_out_the_checks_run() -> None:
    options = PROJECT["tool"]["pytest"]["ini_options"]
    assert [marker.split(":")[0] for marker in options["markers"]] == ["slow"]
    assert not any("slow" in one for one in options["addopts"])
    slow = ".venv/bin/python -m pytest -n auto -m slow"
    assert f"`{slow}`" in README
    assert slow.replace("-m slow", "-q -m slow") in CHECKS


def test_checks_read_the_test_command_from_the_readme(tmp_path: Path) -> None:
    """`.ci/run`'s own reading of the README gives the line that a person would copy."""
    reader = re.search(r"^readme_command\(\) \{\n.*?^\}$", CHECKS, flags=re.MULTILINE | re.DOTALL)
    assert reader
    script = f"{reader[0]}\nreadme_command test\nreadme_command zones"
    run = subprocess.run(["bash", "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert run.stdout.splitlines() == [command("test"), command("zones")]


def test_checks_can_be_executed() -> None:
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


@pytest.mark.parametrize("extra", ["test", "dev", "docs"])
def test_extra_that_the_readme_or_the_checks_name_exists(extra: str) -> None:
    assert PROJECT["project"]["optional-dependencies"][extra]


def third_party(tree: ast.Module) -> set[str]:
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(str(node.module).split(".")[0])
    return names - set(sys.stdlib_module_names) - {"contbreather"}


CALLED = {"python-flint": "flint"}  # packages that are imported by another name


@pytest.mark.slow
def test_every_package_that_is_imported_is_declared() -> None:
    project = PROJECT["project"]
    extras = (project["optional-dependencies"][name] for name in ("certified", "explorer"))
    asked = [*project["dependencies"], *(one for extra in extras for one in extra)]
    names = {re.split(r"[\[<>=~!; ]", one)[0] for one in asked}
    declared = {CALLED.get(name, name) for name in names}
    used = {name for tree in modules(PACKAGE).values() for name in third_party(tree)}
    assert {name.replace("_", "-") for name in used} <= declared


def test_typed_marker_is_there() -> None:
    assert (PACKAGE / "py.typed").exists()


def test_the_version_is_one() -> None:
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert f"version {contbreather.__version__}.\n" in (ROOT / "docs" / "citing.md").read_text(
        "utf-8"
    )
    assert "version:" not in (ROOT / "CITATION.cff").read_text("utf-8").split("\n", 1)[1]


def test_the_release_is_tested_on_the_floors_of_the_project() -> None:
    """`.ci/release`'s own reading of pyproject.toml pins every dependency and every extra."""
    script = (ROOT / ".ci" / "release").read_text("utf-8")
    reader = re.search(r"<<'PYTHON'\n(.*?)^PYTHON$", script, flags=re.MULTILINE | re.DOTALL)
    assert reader
    run = subprocess.run(
        [sys.executable, "-c", reader[1]], cwd=ROOT, capture_output=True, text=True, check=True
    )
    pinned = run.stdout.split()
    assert len(pinned) == len({line.split("==")[0] for line in pinned}), pinned
    assert {re.split("[>]", one)[0] for one in PROJECT["project"]["dependencies"]} <= {
        line.split("==")[0] for line in pinned
    }


def test_a_name_is_that_of_one_function_or_class_and_of_one_file() -> None:
    """But for commands, which bear the names of what they call, and for files of plots, which bear
    that of what they draw."""
    places: dict[str, set[str]] = {}
    folders = package_names(PACKAGE)
    for module, tree in modules(PACKAGE).items():
        _, _, part = module.partition(".")
        # a folder may bear the name of the idea that its first file holds
        if not part.startswith(("cli", "plotting")) and module not in folders:
            places.setdefault(f"{part.rpartition('.')[2]}.py", set()).add(module)
        for node in tree.body:
            named = isinstance(node, ast.FunctionDef | ast.ClassDef)
            if named and not node.name.startswith("_") and not part.startswith("cli"):
                places.setdefault(node.name, set()).add(module)
    assert not {name for name, where in places.items() if len(where) > 1}
