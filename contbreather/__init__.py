"""Exact discrete breathers of an impacting chain: continued, with their true stability.

The front desk: it knows where each public name lives and fetches it on first use (PEP 562), so
that `import contbreather` costs nothing and `contbreather.symmetric` costs numpy and scipy only.

>>> import contbreather as cb
>>> cb.BadInput.__module__
'contbreather.errors'
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the same table again, for type checkers and editors; a test compares the two
    from contbreather.errors import BadInput as BadInput
    from contbreather.errors import ContbreatherError as ContbreatherError
    from contbreather.errors import NoSolution as NoSolution
    from contbreather.errors import NotConverged as NotConverged

__version__ = "0.1.0"

_HOME = {
    "BadInput": "contbreather.errors",
    "ContbreatherError": "contbreather.errors",
    "NoSolution": "contbreather.errors",
    "NotConverged": "contbreather.errors",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        message = f"module 'contbreather' has no attribute {name!r}; it has {', '.join(_HOME)}"
        raise AttributeError(message)
    from importlib import import_module

    value: object = getattr(import_module(_HOME[name]), name)
    globals()[name] = value  # from now on an ordinary attribute
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
