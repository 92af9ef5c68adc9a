"""Every example in a docstring of the engine gives what it shows."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import contbreather.continuation as engine

# types that nobody but the engine makes, and `load`, which the example of `save` shows
WITHOUT = {"Branch", "Point", "Stop", "DefiningSystem", "Seed", "load"}
MODULES = sorted(module.name for module in pkgutil.iter_modules(engine.__path__))


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name: str) -> None:
    module = importlib.import_module(f"{engine.__name__}.{name}")
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert result.failed == 0


def test_every_public_function_has_an_example() -> None:
    finder = doctest.DocTestFinder(recurse=False)
    for name in engine.__all__:
        public = getattr(engine, name)
        if callable(public) and name not in WITHOUT:
            assert any(test.examples for test in finder.find(public, name)), name
