"""Numbers as they were given: checked once, where they come in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from inspect import signature
from itertools import product
from numbers import Complex, Real
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from .errors import BadInput

MOST = 2**53  # what a double still counts one by one
MANY = 100_000  # values of a parameter, and combinations of values: with zones a day of work


def brief(value: object) -> str:
    """A value as a sentence shows it, however long it is."""
    try:
        text = repr(value)
    except ValueError:  # Python does not write out integers of more than 4300 digits
        text = f"about {'-' * (value < 0)}2**{value.bit_length()}"  # type: ignore
    # more than 200 characters are no part of a sentence
    return text if len(text) <= 200 else f"{text[:200]}... ({len(text)} characters)"


def real(value: object) -> float:
    """The value as a float; NaN for what is no real number.

    Text, truth values, None, complex numbers and arrays are none, though `float` would take some.
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
    x = real(value)
    if low <= x <= high and math.isfinite(x):
        return x
    raise BadInput(f"{name} = {brief(value)}: {wanted}, a finite number, was expected.")


def flag(name: str, value: object) -> bool:
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise BadInput(f"{name} = {brief(value)}: True or False was expected.")


def one_of(name: str, value: Any, choices: Sequence[str | int]) -> Any:
    if (isinstance(value, str) or is_whole(value)) and value in choices:
        return value
    *most, last = map(repr, choices)
    raise BadInput(f"{name} must be {', '.join(most)} or {last}, got {brief(value)}")


def is_whole(value: object) -> TypeGuard[int]:
    """Tell a whole number, of numpy too, from what equals one as True does."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def whole(name: str, value: object, least: int) -> int:
    """The value as a whole number, or a sentence."""
    if is_whole(value):
        if least <= value <= MOST:
            return int(value)
        if value > MOST:
            raise BadInput(f"{name} is above {MOST}: no computer counts that far.")
    bound = f", at least {least}," if least > -MOST else ""
    raise BadInput(f"{name} = {brief(value)}: a whole number{bound} was expected.")


def numbers(name: str, value: object) -> NDArray[np.float64]:
    """Real numbers as an array of any shape, or a sentence.

    Examples
    --------
    >>> numbers("u", [1, 2.5])
    array([1. , 2.5])
    """
    try:
        array = np.asarray(value)
        # objects may be Fractions, or numbers of mpmath
        array = array.astype(float) if array.dtype.kind in "iufO" else np.array(math.nan)
    except (TypeError, ValueError, OverflowError):  # rows of different lengths, for instance
        array = np.array(math.nan)
    finite = np.isfinite(array)
    if not finite.all():
        if array.ndim:  # of many the first that is not
            at = np.argwhere(~finite)[0].tolist()
            name, value = f"{name}{at}", float(array[tuple(at)])
        raise BadInput(f"{name} = {brief(value)}: finite real numbers were expected.")
    return array


def check_call(what: str, function: Any, variable: str) -> None:
    """Refuse a function that cannot be called with a variable and parameters."""
    try:
        with suppress(ValueError):  # of a function in C nobody knows
            signature(function).bind(0.0, {})
    except TypeError as error:
        raise BadInput(
            f"{what} is called with {variable} and the dict of parameters, as "
            f"lambda {variable}, p: ...; {error}"
        ) from error


def check_double(what: str, array: NDArray[Any]) -> None:
    """Refuse numbers of single precision, as JAX makes them unless it is told otherwise."""
    if array.dtype.kind in "fc" and np.finfo(array.dtype).eps > np.finfo(float).eps:
        raise BadInput(
            f"{what} has single precision, {array.dtype}, which is too coarse for continuation; "
            "make its numbers float64 (with JAX: jax.config.update('jax_enable_x64', True))"
        )


def row(name: str, value: object, wanted: str) -> NDArray[np.float64]:
    """A row of finite floats, at least one, or a sentence; a number is a row of one."""
    entries = np.atleast_1d(numbers(name, value))
    if entries.ndim != 1 or not entries.size:
        raise BadInput(f"{name} = {brief(value)}: {wanted}, a row of finite numbers, was expected.")
    return entries


def spread(name: str, low: object, high: object, count: object) -> list[float]:
    """So many numbers from one to another, as one would write them, or a sentence before any is
    made.
    """
    ends = [number(name, end, -1e300, 1e300, "a value") for end in (low, high)]
    if not is_whole(count) or not 1 <= count <= MANY:
        raise BadInput(
            f"{name}: {brief(count)} values from {ends[0]:g} to {ends[1]:g}: a whole number from "
            f"1 to {MANY} was expected."
        )
    values = [float(f"{x:.12g}") for x in np.linspace(*ends, count)]  # type: ignore[call-overload]
    values[-1], values[0] = reversed(ends)
    steps = np.diff(values) * math.copysign(1.0, ends[1] - ends[0])
    if not (steps > 0.0).all():
        raise BadInput(
            f"{name}: there are no {count} different values from {ends[0]:g} to {ends[1]:g}."
        )
    return values


def values_by(name: str, typed: str) -> list[float]:
    """Numbers as they are typed: with commas between them, or LOW:HIGH:COUNT.

    Examples
    --------
    >>> values_by("k", "0.8,0.3:0.4:3")
    [0.8, 0.3, 0.35, 0.4]
    """
    values: list[float] = []
    for text in typed.split(","):
        try:
            low, high, count = text.split(":") if ":" in text else (text, text, "1")
            asked = float(low), float(high), int(count)
        except ValueError:
            raise BadInput(
                f"{name}: {brief(text)} is neither a number nor LOW:HIGH:COUNT, 0.5:0.9:5 for "
                "instance"
            ) from None
        values += spread(name, *asked)
    return values


def combinations(grid: Mapping[str, Sequence[float]]) -> Iterator[dict[str, float]]:
    """Each of several values with each of the others, the last ones fastest, or a sentence before
    any is made."""
    count = math.prod(map(len, grid.values()))
    if count > MANY:
        sizes = " times ".join(f"{len(values)} of {name}" for name, values in grid.items())
        raise BadInput(f"{sizes} are {count} combinations: at most {MANY} were expected.")
    return (dict(zip(grid, values, strict=True)) for values in product(*grid.values()))


def state_rows(state: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements and velocities as two rows of finite floats of equal length, or a sentence."""
    try:
        displacements, velocities = state
        u, v = np.array(displacements, dtype=float), np.array(velocities, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadInput(
            f"a state is a pair (u, v) of rows of numbers, got {brief(state)}."
        ) from error
    if u.ndim != 1 or u.shape != v.shape or not u.size:
        raise BadInput(
            f"a state is a pair (u, v) of rows of equal length; shapes "
            f"{u.shape} and {v.shape} were given."
        )
    for name, entries in (("u", u), ("v", v)):
        bad = np.flatnonzero(~np.isfinite(entries))
        if bad.size:
            raise BadInput(f"{name}[{bad[0]}] = {entries[bad[0]]} of the state is not finite.")
    return u, v


def check_kind(
    value: object, kinds: type | tuple[type, ...], wanted: str, remedy: str = ""
) -> None:
    """Refuse what is of another type than was wanted."""
    if not isinstance(value, kinds):
        sentence = f"{wanted} was expected, got {kind_of(value)}"
        raise BadInput(f"{sentence}; {remedy}" if remedy else sentence)


def kind_of(value: object) -> str:
    """Name the kind of a value, with its article; of what may be empty by now say what keeps it."""
    kind = type(value).__name__
    if isinstance(value, Iterator):
        kind += " (it gives its values once, list(...) keeps them)"
    return "None" if value is None else f"{'an' if kind[0].lower() in 'aeiou' else 'a'} {kind}"
