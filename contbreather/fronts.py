"""Packages that fetch what they hold when it is asked for first, as SPEC 1 has it.

Their names stand in the `__init__.pyi` beside them, which type checkers read as well.
"""

from __future__ import annotations

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

    def __call__(self, *args: Any, **named: Any) -> Any:
        known = ", ".join(self._homes)
        raise TypeError(f"{self.__name__} is a package, no function; it has {known}")

    def __setattr__(self, name: str, value: object) -> None:
        # a module that was imported would take the place of the function that it is called after
        if not (isinstance(value, ModuleType) and self._homes.get(name)):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted(self._homes)


def front(name: str, **former: str) -> list[str]:
    """Make a package one of these, by its stub; the names in it that are no packages."""
    package, homes = sys.modules[name], dict[str, str]()
    loader: Any = package.__loader__  # who reads in an archive, too
    for line in loader.get_data(f"{package.__file__}i").decode().splitlines():
        if line.startswith("from "):  # from .module import held as held
            _, module, *_, held = line.split()
            homes[held] = module.removeprefix(".")
    vars(package).update(_homes=homes, _former=former)
    package.__class__ = Front
    return [held for held, home in homes.items() if home]
