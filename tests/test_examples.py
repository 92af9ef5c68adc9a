"""Examples run, quietly and quickly, and write what they say.

Those that take longer than a second or two are left to the documentation, which runs all of them
for its gallery and fails where one fails, is warned or prints no number.
"""

from __future__ import annotations

import ast
import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

QUICK = ("branch", "breather", "lattice", "phi4")
HERE = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(HERE.glob("*.py"))


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"example_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    return example


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_example_runs_and_complains_of_nothing(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    made = load(HERE / f"{name}.py").main()
    out, err = capsys.readouterr()
    assert out
    assert err == ""
    assert "nan" not in out
    for file in made or ():
        assert file.stat().st_size > 0


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_tells_its_story_first(path: Path) -> None:
    """A heading and a paragraph, as the gallery of the documentation wants it."""
    story = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    assert story is not None
    title, rule, *rest = story.splitlines()
    assert set(rule) == {"="}
    assert len(rule) >= len(title)
    assert any(line.strip() for line in rest)
