"""Numbers as they were given: checked once, where they come in."""

from __future__ import annotations

import math
from numbers import Complex, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BadInput

MOST = 2**53  # what a double still counts one by one


def real(value: object) -> float:
    """The value as a float; NaN for what is no real number.

    Text, truth values, None, complex numbers and arrays are none, though `float` would take some.

    Examples
    --------
    >>> [real(given) for given in (2, "2", True, None, [2.0], 2j)]
    [2.0, nan, nan, nan, nan, nan]
    """
    if type(value) is float:  # by far the most frequent
        return value
    if isinstance(value, str | bytes | bytearray | bool | np.bool_):
        return math.nan
    if isinstance(value, Complex) and not isinstance(value, Real):
        return math.nan
    try:
        return math.nan if np.ndim(value) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan


def number(name: str, value: object, low: float, high: float, wanted: str) -> float:
    """The value as a finite float within its range, or a sentence."""
    found = real(value)
    if low <= found <= high and math.isfinite(found):
        return found
    raise BadInput(f"{name} = {value!r}: {wanted}, a finite number, was expected.")


def whole(name: str, value: object, least: int) -> int:
    """The value as a whole number, or a sentence."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        if least <= value <= MOST:
            return int(value)
        if value > MOST:
            raise BadInput(f"{name} is above {MOST}: no computer counts that far.")
    raise BadInput(f"{name} = {value!r}: a whole number, at least {least}, was expected.")


def numbers(name: str, value: object) -> NDArray[np.float64]:
    """Real numbers as an array of any shape, or a sentence.

    Examples
    --------
    >>> numbers("u", [1, 2.5])
    array([1. , 2.5])
    """
    try:
        found = np.asarray(value)
        # objects may be Fractions, or numbers of mpmath
        found = found.astype(float) if found.dtype.kind in "iufO" else np.array(math.nan)
    except (TypeError, ValueError, OverflowError):  # rows of different lengths, for instance
        found = np.array(math.nan)
    if not np.isfinite(found).all():
        raise BadInput(f"{name} = {value!r}: finite real numbers were expected.")
    return found


def row(name: str, value: object, wanted: str) -> NDArray[np.float64]:
    """A row of finite floats, at least one, or a sentence; a number is a row of one."""
    found = np.atleast_1d(numbers(name, value))
    if found.ndim != 1 or not found.size:
        raise BadInput(f"{name} = {value!r}: {wanted}, a row of finite numbers, was expected.")
    return found


def state_rows(given: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements and velocities as two rows of finite floats of equal length, or a sentence."""
    try:
        one, other = given
        u, v = np.array(one, dtype=float), np.array(other, dtype=float)
    except (TypeError, ValueError) as error:
        raise BadInput(f"a state is a pair (u, v) of rows of numbers: {error}.") from error
    if u.ndim != 1 or u.shape != v.shape or not u.size:
        raise BadInput(
            f"a state is a pair (u, v) of rows of equal length; shapes "
            f"{u.shape} and {v.shape} were given."
        )
    for name, found in (("u", u), ("v", v)):
        bad = np.flatnonzero(~np.isfinite(found))
        if bad.size:
            raise BadInput(f"{name}[{bad[0]}] = {found[bad[0]]} of the state is not finite.")
    return u, v


def check_kind(
    given: object, kinds: type | tuple[type, ...], wanted: str, remedy: str = ""
) -> None:
    """Refuse what is of another type than was wanted."""
    if not isinstance(given, kinds):
        what = f"{wanted} was expected, got {kind_of(given)}"
        raise BadInput(f"{what}; {remedy}" if remedy else what)


def kind_of(given: object) -> str:
    """What kind of thing was given, with its article."""
    kind = type(given).__name__
    return "None" if given is None else f"{'an' if kind[0].lower() in 'aeiou' else 'a'} {kind}"
