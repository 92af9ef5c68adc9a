"""Numbers as they were given: checked once, where they come in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Complex, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BadInput

MOST = 2**53  # what a double still counts one by one
_LONG = 200  # characters of a value in a sentence


def shown(value: object) -> str:
    """A value as a sentence shows it, however long it is.

    Examples
    --------
    >>> shown("x"), shown([1.0]), len(shown(10**5000)) < 250
    ("'x'", '[1.0]', True)
    """
    try:
        text = repr(value)
    except ValueError:  # Python does not write out integers of more than 4300 digits
        text = f"about {'-' * (value < 0)}2**{value.bit_length()}"  # type: ignore
    return text if len(text) <= _LONG else f"{text[:_LONG]}... ({len(text)} characters)"


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
    raise BadInput(f"{name} = {shown(value)}: {wanted}, a finite number, was expected.")


def flag(name: str, value: object) -> bool:
    """Yes or no, or a sentence."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise BadInput(f"{name} = {shown(value)}: True or False was expected.")


def one_of(name: str, value: Any, choices: Sequence[str | int]) -> Any:
    """One of a few words or numbers, or a sentence."""
    plain = isinstance(value, str | int | np.integer) and not isinstance(value, bool)
    if plain and value in choices:
        return value
    *most, last = map(repr, choices)
    raise BadInput(f"{name} must be {', '.join(most)} or {last}, got {shown(value)}")


def whole(name: str, value: object, least: int) -> int:
    """The value as a whole number, or a sentence."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        if least <= value <= MOST:
            return int(value)
        if value > MOST:
            raise BadInput(f"{name} is above {MOST}: no computer counts that far.")
    raise BadInput(f"{name} = {shown(value)}: a whole number, at least {least}, was expected.")


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
        raise BadInput(f"{name} = {shown(value)}: finite real numbers were expected.")
    return found


def row(name: str, value: object, wanted: str) -> NDArray[np.float64]:
    """A row of finite floats, at least one, or a sentence; a number is a row of one."""
    found = np.atleast_1d(numbers(name, value))
    if found.ndim != 1 or not found.size:
        raise BadInput(f"{name} = {shown(value)}: {wanted}, a row of finite numbers, was expected.")
    return found


def state_rows(given: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements and velocities as two rows of finite floats of equal length, or a sentence."""
    try:
        one, other = given
        u, v = np.array(one, dtype=float), np.array(other, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
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
