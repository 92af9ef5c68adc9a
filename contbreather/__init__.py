"""Exact discrete breathers of an impacting chain: continued, with their true stability.

The front desk: what is listed in `__init__.pyi` is fetched on first use (SPEC 1), so that
`import contbreather` costs nothing and `contbreather.symmetric` costs numpy alone. All
else is in the subpackages, which are fetched on first use as well.

>>> import contbreather as cb
>>> cb.BadInput.__module__, cb.simulation.sweep.__name__
('contbreather.errors', 'sweep')
"""

from __future__ import annotations

from importlib import import_module
from warnings import warn

from lazy_loader import attach_stub

from .display import HtmlRepr

__version__ = "0.1.0"
_fetch, _, _names = attach_stub(__name__, __file__)
__all__ = [*_names]
_SUBPACKAGES = (
    "certified", "continuation", "lattice", "orbits", "paper", "plotting", "simulation",
    "stability", "studies",
)  # fmt: skip
_RENAMED = {"breathers": "orbits", "dynamics": "simulation"}


def __getattr__(name: str) -> object:
    if name in _names:
        return _fetch(name)
    if name in _RENAMED:
        warn(f"contbreather.{name} is contbreather.{_RENAMED[name]} now", DeprecationWarning, 2)
        name = _RENAMED[name]
    inner = f"{__name__}.{name}"
    try:
        return import_module(inner)
    except ModuleNotFoundError as error:
        if error.name != inner:
            raise
    raise AttributeError(
        f"module {__name__!r} has no attribute {name!r}; it has {', '.join(_names)}, and more in "
        f"its subpackages {', '.join(_SUBPACKAGES)}"
    )


def _card(value: object) -> str:
    """A value as a notebook shows it; what draws it is loaded then."""
    return str(import_module(f"{__name__}.plotting.cards").card(value))


HtmlRepr.painter = _card


def __dir__() -> list[str]:
    return sorted([*__all__, *_SUBPACKAGES])
