"""Compiling what steps use before they ask for it."""

from __future__ import annotations

from contbreather.breathers.symmetric import symmetric
from contbreather.breathers.zones import zones
from contbreather.continuation import boundary, fold, trace
from contbreather.continuation.strider import compiled, eagerly
from contbreather.kernel import KERNELS


def compile_ahead() -> int:
    """Compile the steps of closure branches and of all their boundaries, about 20 s, and keep the
    code on disk: later sessions load it in 0.05 s. Without this it is compiled where it has paid.

    Returns
    -------
    int
        Of how many sets of equations, and functions beside them, there is machine code now; 0
        without numba.
    """
    with eagerly():
        zones(k=0.8, within={"gamma": (0.03, 0.1)})
        start, window = symmetric(0.5, 0.04, 0.8), {"a": (0.05, 0.5)}
        folds = trace(start, "a", within=window, events=[fold()], inadmissible=True)
        pair = {"gamma": (0.03, 0.05)}
        boundary(folds.first("LP"), ("gamma", "a"), within=pair, events=(), inadmissible=True)
    return compiled() + sum([kernel.ready() for kernel in KERNELS])
