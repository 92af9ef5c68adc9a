"""Every example in a docstring gives what it shows, and the engine's public functions have one."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import contbreather
import contbreather.continuation as engine

# types that nobody but the engine makes, and `load`, which the example of `save` shows
WITHOUT = {"Branch", "Point", "Stop", "DefiningSystem", "Seed", "load"}
# half a minute of simulations: tests/paper/test_time_series.py has the numbers that these show
FIGURES = "contbreather.paper.time_series"
MODULES = [one.name for one in pkgutil.walk_packages(contbreather.__path__, "contbreather.")]
MODULES.remove(FIGURES)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if ".paper." in name else ()) for name in MODULES],
)
def test_examples_run(name: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert not doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS).failed


def test_every_public_function_has_an_example() -> None:
    finder = doctest.DocTestFinder(recurse=False)
    for name in engine.__all__:
        public = getattr(engine, name)
        if callable(public) and name not in WITHOUT:
            assert any(test.examples for test in finder.find(public, name)), name
