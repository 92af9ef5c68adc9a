"""Packages that fetch what they hold when it is asked for first, as SPEC 1 has it.

What a package holds its own text says, in imports for type checkers, and is read there: one list.
"""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from types import ModuleType
from typing import Any
from warnings import warn


class Front(ModuleType):
    """A package whose names, and modules, are fetched on first use."""

    _homes: dict[str, str]  # the module of each name; none of what is a package
    _former: dict[str, str]  # what its packages are called now

    def __getattr__(self, name: str) -> Any:
        if name in self._former:
            before, name = name, self._former[name]
            now = f"{self.__name__}.{before} is {self.__name__}.{name} now"
            warn(now, DeprecationWarning, stacklevel=2)
        home = self._homes.get(name)
        path = f"{self.__name__}.{home or name}"
        try:
            module = import_module(path)
        except ModuleNotFoundError as error:
            if home or error.name != path:
                raise
            known = ", ".join(self._homes)
            message = f"module {self.__name__!r} has no attribute {name!r}; it has {known}"
            raise AttributeError(message) from None
        self.__dict__[name] = value = getattr(module, name) if home else module
        return value

    def __setattr__(self, name: str, value: object) -> None:
        # a module that was imported would take the place of the function that it is called after
        if not (isinstance(value, ModuleType) and self._homes.get(name)):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted(self._homes)


def front(name: str, **former: str) -> list[str]:
    """Make a package one of these; its names."""
    package = sys.modules[name]
    text = package.__loader__.get_data(package.__file__)  # type: ignore[union-attr]
    held = next(node for node in ast.parse(text).body if isinstance(node, ast.If))
    imports = [node for node in held.body if isinstance(node, ast.ImportFrom)]
    homes = {alias.name: node.module or "" for node in imports for alias in node.names}
    vars(package).update(_homes=homes, _former=former)
    package.__class__ = Front
    return [name for name, home in homes.items() if home]
