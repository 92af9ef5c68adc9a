"""Packages that fetch what they hold when it is asked for first, as SPEC 1 has it.

Its names stand in the `__init__.pyi` beside it, where type checkers read them, too.
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
    _former: dict[str, str]  # what is called otherwise now

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
    """Make a package one of these: it holds what its `__init__.pyi` imports, a line for each name,
    and what it was called in `former` times. Returns the names but for those of packages."""
    package = sys.modules[name]
    homes: dict[str, str] = {}
    with open(f"{package.__path__[0]}/__init__.pyi", encoding="utf-8") as lines:
        for line in lines:
            match line.split():
                case "from", home, "import", held, "as", _:
                    homes[held] = home.removeprefix(".")
    vars(package).update(_homes=homes, _former=former)
    package.__class__ = Front
    return [held for held, home in homes.items() if home]
