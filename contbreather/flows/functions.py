"""Functions of (t, x, p) as users write them: refusals, values at many states, and slopes."""

from __future__ import annotations

import logging
import math
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief, check_double
from ..continuation.algebra.derivatives import IMAGINARY, RELATIVE, choose, shortened
from ..continuation.algebra.newton import OUT_OF_DOMAIN, Array, Undefined
from ..errors import BadInput

Function = Callable[[Any, Any, Any], Any]  # f(t, x, p), as in scipy.integrate, with p a dict
Params = Mapping[str, Any]  # numbers; one may be complex or an array while it is differentiated

_LOG = logging.getLogger(__name__)
quiet = np.errstate(all="ignore")  # what grows without bound is seen where it is solved for
_CENTRAL = 6e-6  # of its size: the best step of a central difference, to ten digits
ROUNDING = 1e-14  # of the largest state or rate: what is less is rounding of the others
_UNSEEN = 1e-5  # of the largest: what differs by less may be rounding
_PROBED = 4  # columns at which a function is looked at before it is believed
_ASIDE = 0.017  # and how far from them, relative to their size
_HALVED = 10  # times between samples, so often, until what is left of a change is a jump


def check_function(
    name: str, function: Function, shape: tuple[int, ...] | None, t: float, x: Array, p: Params
) -> None:
    """Refuse, with a sentence, a function without values of a shape; None: a row of any length."""
    where, state, params = place(t, x, p), x.copy(), dict(p)
    try:
        returned = np.asarray(function(t, state, params))
    except KeyError as error:
        if error.args[0] in p:
            raise
        has = ", ".join(map(repr, p)) or "none"
        raise BadInput(f"{name} asks for the parameter {error}; params has {has}") from error
    except (ValueError, ArithmeticError, TypeError, IndexError) as error:
        why = f"{name} raises {type(error).__name__}: {error}"
        if isinstance(error, TypeError | IndexError) and shape == x.shape:
            why += f"; it gets the time, all states in one array ({x.size},) and a dict p"
        raise BadInput(f"{why}, {where}") from error
    if params != p or not np.array_equal(state, x):
        raise BadInput(f"{name} writes to its x or p {where}; it must leave them as they are")
    if returned.dtype.kind not in "biuf":  # complex numbers, objects as SymPy's
        raise BadInput(f"{name} returns {returned!r}; real numbers were expected, {where}")
    check_double(f"what {name} returns", returned)
    value = returned.astype(float)
    if shape == () and returned.dtype == bool:
        raise BadInput(
            f"{name} is {returned} {where}; a number was expected, positive inside and zero where "
            "the flow ends: p['s'] - x[0], not x[0] < p['s']"
        )
    if shape == () and value.size == 1:
        value = value.reshape(())
    if value.shape != shape and not (shape is None and value.ndim == 1 and value.size):
        count = "a row of numbers was" if shape is None else f"{x.size} numbers were"
        expected = count if shape != () else "a number was"
        raise BadInput(f"{name} returns shape {value.shape}; {expected} expected {where}")
    if not np.isfinite(value).all():
        raise BadInput(f"{name} is {brief(value.tolist())} {where}; finite numbers were expected")


def place(t: Any, x: NDArray[Any], p: Params | None = None) -> str:
    """Describe the place where a function was called."""
    params = "" if p is None else f", p = {brief(dict(p))}"
    return f"at t = {t:g}, x = {brief(x.tolist())}{params}"


# --- values at many states ------------------------------------------------------------------------


@dataclass(frozen=True)
class _Calling:
    """Record of a function of n states: its rows, whether it takes many states at once, and how it
    is differentiated, for each choice of parameters."""

    function: Function
    rows: int
    scalar: bool
    at_once: bool
    schemes: dict[Any, Array | None] = field(default_factory=dict)
    joined: set[tuple[str, ...]] = field(default_factory=set)  # parameters it takes as arrays
    noise: dict[Any, float] = field(default_factory=dict)  # relative, more than of rounding

    @property
    def name(self) -> str:
        return getattr(self.function, "__qualname__", brief(self.function))

    def __call__(self, t: NDArray[Any], x: NDArray[Any], p: Params) -> NDArray[Any]:
        """Evaluate at all states. Callers ignore warnings: they see NaN and infinity."""
        if self.at_once:
            try:
                returned = self.function(t, x, p)
                return rows_of([returned] if self.scalar else returned, x, self.rows)
            except Exception:  # noqa: BLE001 - the loop below finds the state and raises there
                _LOG.debug("%s raised at one of %d states", self.name, t.size)
        columns = [at_state(self.function, *at, p) for at in zip(t, x.T, strict=True)]
        return np.stack(columns, axis=-1)

    def together(self, t: NDArray[Any], x: NDArray[Any], p: Params) -> NDArray[Any]:
        """Evaluate at all states by one call: as many rows as ever."""
        returned = self.function(t, x, p)
        return rows_of([returned] if self.scalar else returned, x, self.rows)


@lru_cache
def callings(function: Function) -> dict[int, _Calling]:
    """Hold what is known of a function, by how many states there are."""
    return {}


@quiet
def values(function: Function, t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
    """Evaluate a user's function of (t, x, p) at K states, the columns of `x`: as m rows, one of a
    function that returns a number. NaN where it has no value.

    Raises `Undefined` where the function raises `ValueError` or `ArithmeticError`. Other errors are
    bugs: they pass, with a note that says for which t, x and p.
    """
    if getattr(t, "shape", None) != x.shape[1:]:
        t = np.broadcast_to(t, x.shape[1:])
    return calling(function, t, x, p)(t, x, p)


def rows_of(returned: Any, x: NDArray[Any], count: int | None = None) -> NDArray[Any]:
    """Make an array as wide as `x` of what a user's function returned for its columns; refuse one
    of another number of rows than these."""
    try:
        rows = np.asarray(returned)
        plain = rows.shape[1:] == x.shape[1:] and rows.dtype.kind in "fc"
    except ValueError:  # constants among arrays
        plain = False
    rows = rows if plain else np.stack(np.broadcast_arrays(*returned, x[0])[:-1])
    if count is not None and rows.shape != (count, x.shape[1]):
        raise ValueError(f"shape {rows.shape}")
    return rows


def at_state(function: Function, t: Any, x: NDArray[Any], p: Params) -> NDArray[Any]:
    """Evaluate a function at one state; what it raises says where."""
    try:
        return np.array(function(t, x, p), ndmin=1)
    except Exception as error:
        name = getattr(function, "__qualname__", brief(function))
        if isinstance(error, OUT_OF_DOMAIN):
            what = f"{name} raised {type(error).__name__}: {error}"
            raise Undefined(f"{what}, {place(t, x, p)}") from error
        error.add_note(f"in {name} {place(t, x, p)}")
        raise


def undecorated(function: Any) -> Any:
    """Return the function under numba.njit, which takes no dict of parameters."""
    return getattr(function, "py_func", function)


def calling(function: Function, t: NDArray[Any], x: NDArray[Any], p: Params) -> _Calling:
    """Say how a function is evaluated at many states, decided at the first of them."""
    try:
        return callings(function)[len(x)]
    except (KeyError, TypeError):  # TypeError: a function object that cannot be hashed
        how = _decide_calling(function, t.real, x.real, p)
    with suppress(TypeError):
        callings(function)[len(x)] = how
    return how


def _decide_calling(function: Function, t: Array, x: Array, p: Params) -> _Calling:
    """Compare three states one by one with all three at once."""
    t, x = np.resize(t, 3), np.take(x, np.arange(3) % t.size, axis=1)
    beside = x + offset(x)[:, None] * np.array([1.0, 1.3, 0.6])  # three different states

    def singly(x: Array) -> Array:
        return np.stack([at_state(function, *at, p) for at in zip(t, x.T, strict=True)], axis=-1)

    with np.errstate(all="ignore"):
        try:
            alone, x = singly(beside), beside
        except Undefined:  # outside of its domain
            alone = singly(x)
        scalar = np.ndim(function(t[0], x[:, 0], p)) == 0
    how = _Calling(function, len(alone), scalar, at_once=True)
    # what was written for one state may raise anything for three
    with suppress(Exception), warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("error")
        # sums over all states at once round differently
        if np.allclose(how.together(t, x, p), alone, rtol=1e-9, atol=0, equal_nan=True):
            return how
    _LOG.debug("%s takes one state at a time, which is slower", how.name)
    return replace(how, at_once=False)


def offset(x: Array) -> Array:
    """Return a short way for each entry of a state: kinks tend to lie where one starts. No two
    are alike, by which sums that vanish where all states are equal would stay rounding."""
    size = abs(x).max(axis=1)
    return _ASIDE * (1 + 0.3 * np.cos(np.arange(len(x)) ** 2)) * np.where(size, size, 1.0)


# --- their slopes ---------------------------------------------------------------------------------


def slopes(
    function: Function, t: Any, x: Array, p: Params, names: tuple[str, ...] = ()
) -> tuple[Array, Array]:
    """Evaluate a function as `values` does, and its derivatives in the state, in time and in named
    parameters, of shape (m, n + 1 + len(names), K); in the state as they were given, if they were.
    """
    given = getattr(function, "jacobian", None)
    if given is None:
        return slopes_along(function, t, x, p, names, _every_way(len(x)))
    value, inner, other = given.slopes(function, t, x, p, names)
    return value, np.concatenate([inner, other], axis=1)


_every_way = lru_cache(np.eye)


def slopes_along(
    function: Function, t: Any, x: Array, p: Params, names: tuple[str, ...], ways: Array
) -> tuple[Array, Array]:
    """Evaluate a function as `values` does, and its derivatives along ways of the state, the
    columns of an array, in time and in named parameters.

    By complex steps, exact to rounding, where the function is analytic; elsewhere by five-point
    differences, whose steps suit it. Decided beside the first states, and anew where slopes are
    not borne out: a force of contact is nowhere to be seen until there is one.
    """
    (n, width), count = ways.shape, x.shape[1]
    t = t if getattr(t, "shape", None) == (count,) else np.full(count, t, dtype=float)
    how, doubtful = calling(function, t, x, p), np.arange(count)
    analytic = getattr(function, "analytic", False)  # of formulas that is known
    if analytic or how.schemes.get(names, how) is None:
        try:
            value, slope, off = _complex_steps(how, t, x, p, names, ways, names in how.joined)
        except Exception:  # noqa: BLE001 - it may raise at one of the states alone
            how.joined.discard(names)
            value, slope, off = _complex_steps(how, t, x, p, names, ways, False)
        # beside a domain there is nothing to compare with
        doubtful = (off > how.noise.get(names, 0.0)).nonzero()[0][:_PROBED]
        # differences of terms that cancel have no digit right, nor say that
        if not doubtful.size or (analytic and np.isfinite(values(function, t, x, p)).all()):
            return value, slope

    def joined(z: NDArray[Any]) -> NDArray[Any]:  # rows of states, times, parameters (all alike)
        moved = dict(zip(names, z[n + 1 :, 0].tolist(), strict=True))
        with np.errstate(all="ignore"):
            return how(z[n], z[:n], {**p, **moved})

    named = np.array([p[name] for name in names]).reshape(-1, 1)
    z = np.vstack([x, t, np.broadcast_to(named, (named.size, count))])
    # states and the time are measured by their spread, parameters by their size, or by 1
    spread, size = np.ptp(z, axis=1), abs(z).max(axis=1)
    least = 1e-9 * size  # what varies by less is constant
    least[:n] += ROUNDING * size[:n].max()
    spread[n + 1 :] = size[n + 1 :]
    scales = np.where(spread > least, spread, 1.0)
    whole = np.eye(len(z), width + len(z) - n, width - n)
    whole[:n, :width] = ways
    if how.schemes.get(names) is None:  # nobody knows yet, or no longer
        beside = np.zeros(len(z))
        if names not in how.schemes:
            beside[:n] = offset(x)
        how.schemes[names] = _decide_scheme(joined, z[:, doubtful], beside, scales, whole)
        by = "complex steps" if how.schemes[names] is None else "differences"
        _LOG.debug("%s is differentiated by %s", how.name, by)
    if (finer := how.schemes[names]) is None:
        value, slope, off = _complex_steps(how, t, x, p, names, ways, False)
        # what is off by so little and borne out all the same is off by its own rounding, as along a
        # surface, where rates cancel
        noise = np.fmax.reduce(off, initial=0.0)
        how.noise[names] = 2 * noise if noise < _UNSEEN**2 else 0.0
        # what was written for numbers may raise anything for arrays of a parameter
        with suppress(Exception):
            again = _complex_steps(how, t, x, p, names, ways, how.at_once)[1]
            least = 1e-9 * abs(slope).max(initial=0.0)
            if how.at_once and np.allclose(again, slope, rtol=1e-9, atol=least):
                how.joined.add(names)
        return value, slope
    # truncation of order h^4 and rounding of eps/h are as large
    steps = RELATIVE * _parts(whole, np.maximum(scales[:, None], abs(z))) / finer[:, None]
    pairs = zip(whole.T[:, :, None], steps, strict=True)
    return joined(z), np.stack([shortened(joined, z, *pair, -1) for pair in pairs], axis=1)


@quiet
def _complex_steps(
    how: _Calling, t: Array, x: Array, p: Params, names: tuple[str, ...], ways: Array, joined: bool
) -> tuple[Array, Array, Array]:
    """Differentiate by one call for all ways, for the time, and for parameters that are `joined` to
    it; and measure, relative to all rates, by how much slopes along one way are at each state not
    what a central difference of the same call gives."""
    (n, count), width = x.shape, ways.shape[1]
    low, high, later = x.min(axis=1), x.max(axis=1), _CENTRAL * (t[-1] - t[0])
    step = _CENTRAL * np.maximum(high - low, _ASIDE * np.maximum(high, -low))
    parts = _parts(ways, step)
    # f(x + i h) = f + i h f' + O(h^2): no difference is taken, h^2 is nothing
    first, last = width + 1, width + 1 + len(names) * joined
    aside = np.zeros((n + 1, last + 2), complex)
    aside[:n, :width], aside[n, width] = 1j * IMAGINARY * ways, 1j * IMAGINARY
    aside[:n, -2], aside[n, -2] = ways @ parts, later
    aside[:, -1] = -aside[:, -2]
    at, times = x[:, None] + aside[:n, :, None], t + aside[n, :, None]
    moved = dict(p)
    for j, name in enumerate(names[: last - first], first):
        one_aside = np.zeros(last + 2, complex)
        one_aside[j] = 1j * IMAGINARY
        moved[name] = (p[name] + one_aside).repeat(count)
    at = at.reshape(n, -1)
    value = (how.together if joined else how)(times.ravel(), at, moved)
    value = value.reshape(how.rows, -1, count)
    slope = np.empty((how.rows, first + len(names), count))
    slope[:, :last] = value[:, :-2].imag / IMAGINARY
    # those of other parameters apart: what asks for one may expect a number. A field that writes
    # into `np.empty_like(x)` keeps what is complex of a parameter only where the state is, too
    for j, name in enumerate(names[last - first :], last):
        slope[:, j] = how(t + 0j, x + 0j, {**p, name: p[name] + 1j * IMAGINARY}).imag / IMAGINARY
    along = 2 * (parts @ slope[:, :width] + later * slope[:, width])
    off = abs(value[:, -2].real - value[:, -1].real - along)
    value = np.ascontiguousarray(value[:, 0].real)
    rates = abs(value).max(axis=1)
    size = _UNSEEN * (abs(along).max(axis=1) + _CENTRAL * _UNSEEN * rates)
    size += ROUNDING * (fastest := rates.max(initial=0.0))
    return value, slope, np.fmax.reduce(off - size[:, None], axis=0) / (fastest or 1.0)


def _parts(ways: Array, vectors: Array) -> Array:
    """How much of each way, of which none shares a row with another, is in vectors."""
    return np.asarray((ways / (ways**2).sum(axis=0)).T @ vectors)


def _decide_scheme(joined: Any, z: Array, aside: Array, scales: Array, ways: Array) -> Array | None:
    """Return None for complex steps, where they agree with differences beside each of a few
    states, or the divisors of the steps of differences."""
    finest, sizes = np.zeros(ways.shape[1]), _parts(ways, scales)
    for k in np.linspace(0, z.shape[1] - 1, min(_PROBED, z.shape[1])).astype(int):
        place = z[:, k] + aside
        parts = _parts(ways, place)
        base = place - ways @ parts  # zero where each state has its own way

        def along(parts: Array, base: Array = base) -> Array:
            return np.asarray(joined((base + ways @ parts)[:, None])[:, 0])

        with np.errstate(all="ignore"):
            rounding = ROUNDING * float(abs(along(parts)).max(initial=0.0))
            scheme = choose(along, parts, sizes, rounding)
        if isinstance(scheme, partial):  # differences
            finest = np.maximum(finest, scheme.keywords["finer"])
    return finest if finest.any() else None


# --- jumps along a motion -------------------------------------------------------------------------


@quiet
def kink(
    function: Function, motion: Callable[[Array], Array], times: Array, p: Params
) -> tuple[float, Array] | None:
    """Find where along a motion a function jumps most, or its derivative in a state or in time, or
    rises as a root does, and the state there; None where what changes does so steadily."""
    places = np.vstack([motion(times), times])
    size = abs(values(function, times, places[:-1], p)).max(initial=0.0) or 1.0
    spread = np.ptp(places, axis=1)
    steps = np.diag(_CENTRAL * spread)

    def looks(t: Array) -> Array:
        z = np.vstack([motion(t.ravel()), t.ravel()])[:, :, None]
        sides = np.concatenate([z, z + steps[:, None], z - steps[:, None]], axis=2)
        x, at = sides[:-1].reshape(len(z) - 1, -1), sides[-1].ravel()
        rows = values(function, at, x, p).reshape(-1, *t.shape, sides.shape[2]) / size
        here, up, down = np.split(rows, [1, 1 + len(z)], axis=3)
        return np.moveaxis(np.concatenate([here, (up - down) / (2 * _CENTRAL)], axis=3), 0, 2)

    # of each time between samples what changes most, and a piece on either side, within the next
    # samples: a root sets in there or just ahead, where it is steepest
    t = times[:-1] + np.diff(times) * np.arange(-1, 3)[:, None]
    t = t.clip(np.append(times[0], times[:-2]), np.append(times[2:], times[-1]))
    seen, most = looks(t), np.zeros(times.size - 1)
    # of states that hardly vary these are differences of large terms, which round
    larger = abs(places).max(axis=1) / np.where(spread, spread, math.inf)
    rounded = 4 * math.ulp(1.0) / _CENTRAL * (abs(seen[..., 1:]) @ larger).max(initial=0.0)
    for _ in range(_HALVED):
        between = (t[:-1] + t[1:]) / 2
        t = np.insert(t, [1, 2, 3], between, axis=0)
        seen = np.insert(seen, [1, 2, 3], looks(between), axis=0)
        left = abs(np.diff(seen, axis=0)).max(axis=(2, 3))
        most = np.maximum(most, left.max(axis=0))
        kept = left.argmax(axis=0).clip(1, 4) + np.arange(-1, 3)[:, None]
        t = np.take_along_axis(t, kept, axis=0)
        seen = np.take_along_axis(seen, kept[:, :, None, None], axis=0)
    # what is smooth halves each time, a root each second time; it may begin at the edge
    left = abs(np.diff(seen, axis=0)).max(axis=(0, 2, 3))
    most = np.maximum.reduce([most, np.roll(most, 1), np.roll(most, -1)])
    jump = np.where(left > 0.5 ** (_HALVED / 1.5) * most, left, 0.0)
    k = int(jump.argmax())
    found = float(t[1, k]), motion(t[1:2, k])[:, 0]
    return found if jump[k] > max(_UNSEEN, rounded) else None
