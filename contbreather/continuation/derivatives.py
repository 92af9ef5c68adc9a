"""Derivatives of a residual that came without any: complex steps where they hold, else differences."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

_IMAGINARY = 1e-30  # a complex step has no cancellation, so it may be as small as this
_RELATIVE = np.finfo(float).eps ** 0.2  # best step of the five-point formula


def differences(function: Function, z: Array, *, finer: float = 1.0) -> Array:
    """Five-point central differences, one column for each entry of `z`; about 1e-12 relative.

    `finer` divides the step: two results that differ tell what the differences are worth.
    """
    columns = []
    for i in range(z.size):
        h = _RELATIVE * max(1.0, abs(z[i])) / finer
        columns.append(directional(function, z, np.eye(1, z.size, i)[0] * h) / h)
    return np.stack(columns, axis=-1)


def directional(function: Function, z: Array, step: Array) -> Array:
    """``step . grad`` of `function` at `z` by the five-point formula over ``z + {-2..2} step``."""
    near = np.asarray(function(z + step)) - np.asarray(function(z - step))
    far = np.asarray(function(z + 2 * step)) - np.asarray(function(z - 2 * step))
    return np.asarray((8 * near - far) / 12)


def complex_steps(function: Function, z: Array) -> Array:
    """Derivatives by imaginary perturbation, exact to rounding where `function` is analytic."""
    columns = []
    for i in range(z.size):
        shifted = z.astype(complex)
        shifted[i] += 1j * _IMAGINARY
        columns.append(np.imag(np.asarray(function(shifted))) / _IMAGINARY)
    return np.stack(columns, axis=-1)


def choose(function: Function, z: Array) -> Callable[[Function, Array], Array]:
    """Complex steps if they agree with differences at `z`; anything not analytic does not."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            exact = complex_steps(function, z)
    except (TypeError, ValueError, ArithmeticError, AttributeError, np.exceptions.ComplexWarning):
        return differences  # the function does not take complex numbers
    return complex_steps if agree(exact, differences(function, z)) else differences


def agree(one: Array, other: Array, tolerance: float = 1e-6) -> bool:
    """Whether two Jacobians are the same up to what differences can tell."""
    if one.shape != other.shape or not (np.isfinite(one).all() and np.isfinite(other).all()):
        return False
    return bool(
        np.abs(one - other).max(initial=0.0) <= tolerance * (1 + np.abs(other).max(initial=0.0))
    )
