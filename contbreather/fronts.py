"""Packages that fetch what they hold when it is asked for first, as SPEC 1 has it.

A package lists its names here; type checkers read them in the `__init__.pyi` beside it.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
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

    def __call__(self, *args: Any, **named: Any) -> Any:
        known = ", ".join(self._homes)
        raise TypeError(f"{self.__name__} is a package, no function; it has {known}")

    def __setattr__(self, name: str, value: object) -> None:
        # a module that was imported would take the place of the function that it is called after
        if not (isinstance(value, ModuleType) and self._homes.get(name)):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted(self._homes)


def front(name: str, modules: Mapping[str, str], **former: str) -> list[str]:
    """Make a package one of these: `modules` have the names that are fetched from each, and "" its
    own packages. Returns the names."""
    package = sys.modules[name]
    homes = {held: module for module, names in modules.items() for held in names.split()}
    vars(package).update(_homes=homes, _former=former)
    package.__class__ = Front
    return [held for held, home in homes.items() if home]
