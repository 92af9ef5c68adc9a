"""Hot loops are compiled by numba, once: the machine code is kept on disk between sessions.

Only modules that hold compiled loops import this one, and they are imported where they run:
`import contbreather` and everything on a branch stay free of numba.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def _digest() -> str:
    """A name for the present text of all compiled loops together."""
    texts = (path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
    loops = (text for text in texts if b"\n@compiled" in text or b"\n@inlined" in text)
    return hashlib.sha256(b"".join(loops)).hexdigest()


TEXT = _digest()[:12]


def compiled(function: Callable[P, R], *, inline: bool = False) -> Callable[P, R]:
    """`numba.njit`, cached, with IEEE arithmetic as written: the same input, the same bits.

    numba keeps a function as long as its own file is unchanged, even if one that it calls in
    another file is not, and would go on with the old one. It names what it keeps by the qualified
    name; with the text of all loops in that name, nothing stale is ever found.

    Where there is no directory to keep it in (a read-only package and no home, as in containers),
    it is compiled anew in each session; NUMBA_CACHE_DIR names another place.
    """
    function.__qualname__ = f"{function.__qualname__}_{TEXT}"
    how: dict[str, Any] = {"forceinline": True} if inline else {}
    try:
        made = njit(cache=True, error_model="numpy", **how)(function)
    except RuntimeError:  # "no locator available"
        made = njit(error_model="numpy", **how)(function)
    return cast("Callable[P, R]", made)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """The same, written out where it is called: tuples of many arrays are dear to hand over."""
    return compiled(function, inline=True)
