"""Forcings of every site alike: ``F(t) = a * shape(t)``, 2 pi periodic.

A forcing answers for ``f`` with ``f'' = F`` (eq. (5)), always at unit amplitude: the amplitude
``a`` belongs to the breather. f is F with each harmonic m divided by ``-m^2``; nothing periodic
answers a mean, which is kept beside it. Symmetric breathers need ``F(t + pi) = -F(t)``, odd
harmonics only. Whatever the forcing was given as, inside it is one trigonometric series.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import brief, flag, number, numbers, real, whole
from contbreather.errors import BadInput
from contbreather.kernels import Kernel, Matrix, Vector, inlined

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
HIGHEST = 1001  # harmonic; sixteen points to its period are looked at
LARGEST = 1e100  # coefficient; sums of their squares stay finite
EPS = float(np.finfo(float).eps)

# (m, A, B): A cos(m t) + B sin(m t), of f; a mean F0 of F, which f has none of, is (0, F0, 0)
Harmonics = tuple[tuple[int, float, float], ...]


class Forcing(Protocol):
    """Everything a breather asks of its forcing; all values are at unit amplitude.

    ``f, df, d2f, d3f`` are f and its derivatives (``d2f`` is F itself, with its mean): a float for
    a float, an array for an array. ``params`` are the forcing's own continuation parameters, `at`
    returns the forcing with some of them changed, ``slope_harmonics(name)`` is the series of the
    derivative of f in one of them.
    """

    def f(self, t: Any) -> Any: ...
    def df(self, t: Any) -> Any: ...
    def d2f(self, t: Any) -> Any: ...
    def d3f(self, t: Any) -> Any: ...
    @property
    def params(self) -> dict[str, float]: ...
    @property
    def highest(self) -> int: ...
    @property
    def harmonics(self) -> Harmonics: ...
    def at(self, **params: float) -> Forcing: ...
    def motion(self, t: float) -> tuple[float, float, float]: ...
    def slope_harmonics(self, name: str) -> Harmonics: ...
    def peak(self) -> float: ...
    def describe(self) -> str: ...
    def __hash__(self) -> int: ...


Drive = Forcing | str | Callable[[float], float]  # what `forcing_of` makes a forcing of


@inlined
def harmonic(m: float, A: float, B: float, t: float) -> tuple[float, float, float, float]:
    """``A cos mt + B sin mt`` and its first three derivatives."""
    c, s = math.cos(m * t), math.sin(m * t)
    value, slope = A * c + B * s, m * (B * c - A * s)
    return value, slope, -m * m * value, -m * m * slope


@inlined
def series_motion(harmonics: Any, t: float) -> tuple[float, float, float, float]:
    """A sum of them, of rows m, A, B."""
    f = df = d2f = d3f = 0.0
    for row in harmonics:
        u, v, w, x = harmonic(row[0], row[1], row[2], t)
        f, df, d2f, d3f = f + u, df + v, d2f + w, d3f + x
    return f, df, d2f, d3f


def series_motions(harmonics: Matrix, times: Vector, out: Matrix) -> None:
    """At each time, in columns."""
    for i in range(times.size):
        f, df, d2f, d3f = series_motion(harmonics, times[i])
        out[0, i], out[1, i], out[2, i], out[3, i] = f, df, d2f, d3f


MOTIONS = Kernel(series_motions)


class TrigonometricSeries:
    """f as a trigonometric series, with its derivatives of any order, and the mean of F."""

    __slots__ = ("harmonics", "mean", "rows", "waves")

    def __init__(self, harmonics: Harmonics) -> None:
        self.harmonics = harmonics
        self.mean = sum(A for m, A, _ in harmonics if m == 0)
        self.waves = tuple(row for row in harmonics if row[0])
        self.rows = np.array(self.waves, dtype=float).reshape(-1, 3)

    def motion(self, t: Any) -> Any:
        """Value and derivatives, at one time or many."""
        one = type(t) is float or isinstance(t, float | int)  # the first is by far the sooner
        # of more harmonics machine code beats Python, even for one time
        if one and len(self.waves) < 12:
            return series_motion(self.waves, t)
        times = np.array(t, dtype=float)
        out = np.empty((4, times.size))
        MOTIONS(self.rows, times.ravel(), out)
        return tuple(out[:, 0].tolist()) if one else out.reshape(4, *times.shape)

    def at(self, t: Any, order: int) -> Any:
        """The derivative of that order, up to the third, at one time or many."""
        return self.motion(t)[order]

    def second(self) -> TrigonometricSeries:
        """Its second derivative: F less its mean, of f."""
        return TrigonometricSeries(tuple((m, -m * m * A, -m * m * B) for m, A, B in self.waves))

    def on_grid(self, size: int) -> FloatArray:
        """Values at ``2 pi j/size``, j = 0..size-1; size exceeds twice the highest harmonic."""
        spectrum = np.zeros(size // 2 + 1, dtype=complex)
        for m, cosine, sine in self.waves:
            # irfft divides by size, and adds the conjugate at -m
            spectrum[m] = 0.5 * size * complex(cosine, -sine)
        return np.fft.irfft(spectrum, size)

    def extrema(self) -> list[float]:
        """Extrema in [-pi, pi), by Newton's method from where the slope is or comes next to zero on
        a grid."""
        slope = TrigonometricSeries(tuple((m, m * s, -m * c) for m, c, s in self.waves))
        size = 32 * max(m for m, _, _ in self.waves)
        values = slope.on_grid(size)
        small, later = np.abs(values), np.roll(values, -1)
        low = (small <= np.roll(small, 1)) & (small <= abs(later))
        start = 2.0 * math.pi * np.flatnonzero(low | (values * later <= 0.0)) / size
        extrema = (math.remainder(self._settled(phi), 2.0 * math.pi) for phi in start.tolist())
        distinct: list[float] = []
        for phi in sorted(extrema):
            if not distinct or phi - distinct[-1] > 1e-9:
                distinct.append(phi)
        return distinct

    def _settled(self, phi: float) -> float:
        """The extremum next to ``phi`` by a few Newton steps; where none is, anywhere will do."""
        x = phi
        for _ in range(8):
            _, slope, curvature, _ = self.motion(x)
            if curvature == 0.0:
                break
            x -= slope / curvature
            if abs(slope) < 1e-15 * abs(curvature):
                break
        return x if abs(x - phi) < 1.0 else phi

    def crossing(self, level: float, left: float, right: float) -> float:
        """Find where it has a value, between two neighbouring extrema."""
        rises = self.at(right, 0) > self.at(left, 0)
        # by bisection, as scipy.optimize is dear to import
        while right - left > 1e-14 * (1.0 + abs(right)):
            x = 0.5 * (left + right)
            left, right = (left, x) if (self.at(x, 0) > level) == rises else (x, right)
        # and one Newton step; next to a double root it would go astray
        height, steepness, curvature, third = self.motion(right)
        step = (height - level) / steepness if steepness else 0.0
        if abs(step) < 1e-9:
            return right - step
        # a root of third order is known to EPS^(1/3) by the level, to EPS by its inflection
        flat = right - curvature / third if third else right
        solves = abs(self.at(flat, 0) - level) <= 4.0 * EPS * (1.0 + abs(level))
        return flat if solves and abs(flat - right) < EPS**0.25 else right


class Periodic:
    """Shared by every forcing that is a series: evaluation, and the largest |f|."""

    # rms of what it leaves of samples that it was made of: no part of the drive
    residual: ClassVar[float | None] = None
    _series: TrigonometricSeries
    _slopes: Mapping[str, Harmonics] = MappingProxyType({})  # of f, by parameter

    if TYPE_CHECKING:

        def describe(self) -> str: ...
        def _with(self, params: dict[str, float]) -> Any: ...

    def f(self, t: Any) -> Any:
        return self._series.at(t, 0)

    def df(self, t: Any) -> Any:
        return self._series.at(t, 1)

    def d2f(self, t: Any) -> Any:
        return self._series.at(t, 2) + self._series.mean

    def d3f(self, t: Any) -> Any:
        return self._series.at(t, 3)

    def on_grid(self, size: int) -> FloatArray:
        """F at ``2 pi j/size``; size exceeds twice the highest harmonic."""
        return self._series.second().on_grid(size) + self._series.mean

    def motion(self, t: float) -> tuple[float, float, float]:
        """f, f' and f'' at one time."""
        f, df, d2f, _ = self._series.motion(t)
        return f, df, d2f

    @property
    def harmonics(self) -> Harmonics:
        return self._series.harmonics

    @property
    def highest(self) -> int:
        return max((m for m, a, b in self._series.harmonics if a or b), default=1)

    @property
    def symmetric(self) -> bool:
        """True where F(t + pi) = -F(t), whatever its parameters: it has odd harmonics only."""
        return not even_harmonics(self)

    @property
    def params(self) -> dict[str, float]:
        return {}

    def at(self, /, **params: float) -> Any:
        """Change some parameters of the forcing."""
        have = self.params
        if unknown := [name for name in params if name not in have]:
            raise self._unknown(unknown)
        changed = have | params
        return self if changed == have else self._with(changed)

    def slope_harmonics(self, name: str) -> Harmonics:
        """The series of the derivative of f with respect to one parameter."""
        if name not in self._slopes:
            raise self._unknown([name])
        return self._slopes[name]

    def peak(self) -> float:
        """Largest |f| at unit amplitude; ``a * peak() <= 1`` keeps the far field off its walls."""
        return peak_of(self._series.waves)

    @property
    def _remark(self) -> str:
        return "" if self.residual is None else f"  # residual {self.residual:.3g} (rms)"

    def _unknown(self, names: Sequence[str]) -> BadInput:
        have = ", ".join(self.params) or "none"
        return BadInput(
            f"unknown forcing parameter {', '.join(map(repr, names))}: "
            f"this forcing ({self.describe()}) has {have}."
        )


@lru_cache(maxsize=256)
def even_harmonics(forcing: Forcing) -> tuple[int, ...]:
    """Harmonics of F that break F(t + pi) = -F(t), 0 for a mean; those of a parameter that is 0
    just now are among them.
    """
    slopes = (row for name in forcing.params for row in forcing.slope_harmonics(name))
    return tuple(sorted({m for m, A, B in (*forcing.harmonics, *slopes) if not m % 2 and (A or B)}))


def mean_of(forcing: Forcing, by: str = "") -> float:
    """Mean of F at unit amplitude, or its derivative in a parameter."""
    return TrigonometricSeries(forcing.slope_harmonics(by) if by else forcing.harmonics).mean


def with_even(share: float, forcing: Forcing) -> Forcing:
    """A drive with so much of its even harmonics and mean."""
    if share == 1.0 or not even_harmonics(forcing):
        return forcing
    rows = [(m, A, B) if m % 2 else (m, share * A, share * B) for m, A, B in forcing.harmonics]
    if not any(A or B for _, A, B in rows):
        raise BadInput(
            f"the forcing, {forcing.describe()}, has no odd harmonics, from whose breather an "
            "orbit of all of them is found; shoot one by hand, shooting(..., sequence=...)."
        )
    return Fourier.from_response({m: A for m, A, _ in rows if A}, {m: B for m, _, B in rows if B})


def check_symmetric(forcing: Forcing) -> None:
    """`BadInput` for even harmonics or a mean, under which no orbit is its own mirror image."""
    even = even_harmonics(forcing)
    if even:
        waves = [*map(str, filter(None, even))]
        named = f"the even harmonic{'s' * (len(waves) > 1)} {', '.join(waves[:6])}"
        parts = ["a mean"] * (0 in even) + [named + ", ..." * (len(waves) > 6)] * bool(waves)
        raise BadInput(
            f"the forcing, {forcing.describe()}, has {' and '.join(parts)}: without F(t + pi) = "
            "-F(t) no orbit is its own mirror image half a period later, and there is no half "
            "section and no pitchfork; drop them, or shoot the whole period from the breather b "
            "of its odd harmonics, shooting(b, forcing=..., symmetric=False), as find_symmetric() "
            "and contbreather branch do."
        )


@lru_cache(maxsize=64)
def peak_of(harmonics: Harmonics, sign: int = 0) -> float:
    """Largest |f|, or largest value of f or -f by a sign, without a mean."""
    if len(harmonics) == 1:  # by far the most frequent
        return math.hypot(*harmonics[0][1:])
    series = TrigonometricSeries(harmonics)
    heights = [series.at(t, 0) for t in series.extrema()]
    return float(max(sign * f if sign else abs(f) for f in heights))


@dataclass(frozen=True)
class Harmonic(Periodic):
    """``F = -a cos t``, so ``f = a cos t``: the forcing of eq. (13).

    Examples
    --------
    >>> Harmonic().f(0.0), Harmonic().d2f(0.0)
    (1.0, -1.0)
    """

    _series = TrigonometricSeries(((1, 1.0, 0.0),))

    def describe(self) -> str:
        return "F = -a cos t"


@dataclass(frozen=True, init=False, repr=False)
class Fourier(Periodic):
    """A sum of harmonics: ``F/a = sum of C_m cos(m t) + S_m sin(m t)``.

    Parameters
    ----------
    cos, sin : mapping of int to float
        The coefficients of F/a; ``cos={0: ...}`` is its mean. Symmetric orbits need odd ones
        only. Their names as continuation parameters are ``c1, c3, ...`` and ``s1, s3, ...``
        (those given, zeros included): a small third harmonic can be grown from ``cos={1: -1.0,
        3: 0.0}``, an offset from ``cos={0: 0.0, 1: -1.0}``.

    Raises
    ------
    BadInput
        For an order that is none, a coefficient that is not finite, or nothing but a mean.

    Examples
    --------
    >>> Fourier(cos={1: -1.0}).f(0.0)
    1.0
    >>> Fourier.from_response(cos={1: 1.0, 3: 0.3}).params
    {'c1': -1.0, 'c3': -2.6999999999999997}
    """

    cos: tuple[tuple[int, float], ...]
    sin: tuple[tuple[int, float], ...]

    def __init__(
        self, cos: Mapping[int, float] | None = None, sin: Mapping[int, float] | None = None
    ) -> None:
        object.__setattr__(self, "cos", _coefficients("cos", cos))
        object.__setattr__(self, "sin", _coefficients("sin", sin))
        if not any(c for m, c in self.cos + self.sin if m):
            raise BadInput(
                f"the forcing is {'constant' if any(c for _, c in self.cos) else 'zero'}: give at "
                "least one coefficient of a harmonic, for example cos={1: -1.0} for F = -a cos t."
            )
        check_size(max(abs(c) for _, c in self.cos + self.sin), "the forcing")
        c, s = dict(self.cos), dict(self.sin)
        orders = sorted({*c, *s})
        # f'' = F, eq. (5): each harmonic over -m^2
        f = tuple((m, _over(m, c.get(m, 0.0)), _over(m, s.get(m, 0.0))) for m in orders)
        object.__setattr__(self, "_series", TrigonometricSeries(f))
        # f is linear in its coefficients: the slope in one is the f of that term alone
        slopes = {f"c{m}": ((m, _over(m, 1.0), 0.0),) for m in c}
        slopes |= {f"s{m}": ((m, 0.0, _over(m, 1.0)),) for m in s}
        object.__setattr__(self, "_slopes", slopes)

    @classmethod
    def from_response(
        cls, cos: Mapping[int, float] | None = None, sin: Mapping[int, float] | None = None
    ) -> Fourier:
        """Make it from the coefficients of f instead of F: F's are ``-m^2`` times those, but for a
        mean, which is that of F."""
        return cls(
            {m: (-(m**2) or 1) * c for m, c in _coefficients("cos", cos)},
            {m: -(m**2) * c for m, c in _coefficients("sin", sin)},
        )

    @classmethod
    def fit(
        cls, t: ArrayLike, F: ArrayLike, harmonics: int = 5, frequency: float | None = None, *,
        symmetric: bool = True,
    ) -> Fourier:  # fmt: skip
        """Fit harmonics to noisy samples of F, by least squares.

        Mean and even harmonics are fitted along, so that they do not pass for odd ones where
        the samples are uneven, and left out unless asked for: they count as residual. What
        noise leaves of them would take its symmetry from every orbit, and a mean may well be
        the sensor's.

        Parameters
        ----------
        t, F : array_like, shape (M,)
            Times, in any order, over at least one period, and the force at them.
        harmonics : int
            The highest harmonic: 1, 3 and 5 for 5.
        frequency : float, optional
            Periods per unit of t, hertz for seconds; the period is 2 pi without it.
        symmetric : bool
            Odd harmonics only. With False the mean and even ones are kept, ``drive.at(c0=0.0)``
            is without the mean.

        Returns
        -------
        Fourier
            With ``residual``, the root mean square of what it leaves of F.

        Raises
        ------
        BadInput
            For samples that are too few, not over a whole period, not finite, or of which the
            harmonics leave more than they explain, as of a force that is not periodic, or might
            where a part of the period has none.

        Examples
        --------
        >>> t = np.linspace(0.0, 20.0, 400)
        >>> noise = 0.01 * np.random.default_rng(1).normal(size=400)
        >>> drive = Fourier.fit(t, -np.cos(t) + noise, harmonics=1)
        >>> round(drive.params["c1"], 2), round(drive.residual, 2)
        (-1.0, 0.01)
        """
        t, F, highest = numbers("t", t), numbers("F", F), whole("harmonics", harmonics, 1)
        rate = 1.0
        if frequency is not None:
            wanted = "periods per unit of t, above 0"
            rate = 2.0 * math.pi * number("frequency", frequency, 1.0 / LARGEST, LARGEST, wanted)
        if t.ndim != 1 or t.shape != F.shape:
            raise BadInput(
                f"t and F have the shapes {t.shape} and {F.shape}: two rows of the same length "
                "were expected, times and the force at them."
            )
        if t.size <= 2 * highest + 1:
            raise BadInput(
                f"{t.size} samples: harmonics up to {highest} with a mean are {2 * highest + 1} "
                "unknowns, and more samples are needed than that; take more, or fewer harmonics."
            )
        if not np.ptp(F):
            raise BadInput(f"the force is {0.0 + F[0]:.6g} at all {F.size} times: nothing to fit.")
        # M samples at equal steps over a period span M - 1 of them
        periods = rate * np.ptp(t) / (2.0 * math.pi) * t.size / (t.size - 1)
        if periods < 1.0 - 1e-9:
            raise BadInput(
                f"the samples span {periods:.3g} of a period: at least a whole one is needed; "
                "give more of them, or `frequency=` if the period is not 2 pi."
            )
        waves = np.exp(1j * rate * np.outer(t, np.arange(highest + 1)))
        # of mean square 1 over a period
        columns = np.hstack(
            [waves.real[:, :1], 2**0.5 * waves.real[:, 1:], 2**0.5 * waves.imag[:, 1:]]
        )
        # phases are rounded, and columns that are alike differ by as much
        rounding = np.finfo(float).eps * t.size * (1.0 + highest * rate * float(abs(t).max()))
        found, _, rank, sizes = np.linalg.lstsq(columns, F, rcond=rounding)
        if rank < columns.shape[1]:
            raise BadInput(
                f"the samples do not tell harmonics up to {highest} apart: too many are at the "
                "same place of the period; take fewer harmonics, or sample between."
            )
        _refuse_gaps(rate * t, columns @ found, F, float(sizes[-1]), highest)
        found[1:] *= 2**0.5
        cos, sin = found[: highest + 1], np.append(0.0, found[highest + 1 :])
        odd = flag("symmetric", symmetric)
        some = slice(1, None, 2) if odd else slice(None)
        kept = waves.real[:, some] @ cos[some] + waves.imag[:, some] @ sin[some]
        other = f"is not periodic with {2.0 * math.pi / rate:.6g}, then give `frequency=`"
        left = _left_by(kept, F, highest, float(cos[0]), odd, other)
        orders = range(highest + 1)[some]
        drive = cls({m: cos[m] for m in orders}, {m: sin[m] for m in orders if m})
        object.__setattr__(drive, "residual", left)
        return drive

    @property
    def params(self) -> dict[str, float]:
        return {f"c{m}": v for m, v in self.cos} | {f"s{m}": v for m, v in self.sin}

    def _with(self, params: dict[str, float]) -> Fourier:
        return Fourier(
            {m: params[f"c{m}"] for m, _ in self.cos}, {m: params[f"s{m}"] for m, _ in self.sin}
        )

    def describe(self) -> str:
        terms = [f"{v:+.6g} cos {_times(m)}" if m else f"{v:+.6g}" for m, v in self.cos]
        terms += [f"{v:+.6g} sin {_times(m)}" for m, v in self.sin]
        return f"F = a ({' '.join(terms)})"

    def __repr__(self) -> str:
        return f"Fourier(cos={dict(self.cos)}, sin={dict(self.sin)}){self._remark}"


def _over(m: int, coefficient: float) -> float:
    """Coefficient of f from that of F; of a mean itself."""
    return -coefficient / m**2 if m else coefficient


def _times(m: int) -> str:
    return "t" if m == 1 else f"{m}t"


def _coefficients(kind: str, terms: Mapping[int, float] | None) -> tuple[tuple[int, float], ...]:
    if terms is None:
        return ()
    if not isinstance(terms, Mapping):
        raise BadInput(f"{kind} = {terms!r}: coefficients by harmonic were expected, {{1: -1.0}}.")
    for m, value in terms.items():
        lowest = 0 if kind == "cos" else 1
        if isinstance(m, bool) or not isinstance(m, int | np.integer) or m < lowest:
            raise BadInput(
                f"{kind} harmonic {brief(m)}: harmonics of the forcing are the whole numbers 1, 2, "
                f"3, ..., with the period 2 pi; {kind}={{1: -1.0}} is -{kind}(t), and its mean is "
                "cos={0: ...}."
            )
        if m > HIGHEST:
            raise BadInput(f"{kind} harmonic {m}: harmonics up to {HIGHEST} are resolved in time.")
        if not math.isfinite(real(value)):
            raise BadInput(
                f"{kind} harmonic {m}: its coefficient {value!r} is not a finite number."
            )
    return tuple(sorted((int(m), float(v)) for m, v in terms.items()))


def check_size(largest: float, name: str) -> None:
    """Refuse coefficients whose squares or sums would overflow, or vanish."""
    if 0.0 < largest < 1.0 / LARGEST:
        raise BadInput(
            f"{name} reaches {largest:.2g} only, too little to be computed with; the amplitude a "
            "multiplies any forcing, so scale it up."
        )
    if largest > LARGEST:
        raise BadInput(
            f"{name} reaches {largest:.2g}, too large to be computed with; the amplitude a "
            f"multiplies any forcing, so scale it down to at most {LARGEST:g}."
        )


# ---------------------------------------------------------------------------- samples


@dataclass(frozen=True, init=False, repr=False)
class Samples(Periodic):
    """F/a known on the uniform grid ``2 pi j/M``, j = 0..M-1, interpolated trigonometrically.

    Parameters
    ----------
    values : array_like, shape (M,)
        M even and at least 8; antisymmetric, ``F(t + pi) = -F(t)``, where that holds to 1e-9 of
        the largest. The upper half of the spectrum must be empty to 1e-10 of the largest
        harmonic (at least four points to the period of the highest harmonic); then F and f
        are right to about that everywhere, and to rounding for exact samples.
    harmonics : int, optional
        The highest harmonic kept, of noisy samples: odd ones up to it, at most M/4, are all that
        is left of the values, whatever else is in them: `residual` is its root mean square.
    symmetric : bool
        With `harmonics`, False: the mean and even ones are kept, too.

    Raises
    ------
    BadInput
        When not finite, zero, constant, or unresolved, or where the harmonics kept leave more than
        they explain.

    Examples
    --------
    >>> import numpy as np
    >>> t = 2 * np.pi * np.arange(16) / 16
    >>> round(Samples(-np.cos(t)).f(0.0), 14)
    1.0
    """

    values: tuple[float, ...]

    def __init__(
        self, values: ArrayLike, harmonics: int | None = None, *, symmetric: bool = True
    ) -> None:
        samples = numbers("values", values)
        if samples.ndim != 1:
            raise BadInput(f"the samples have the shape {samples.shape}: one row was expected.")
        if samples.size < 8 or samples.size % 2:
            raise BadInput(
                f"{samples.size} samples: give an even number, at least 8, on t = 2 pi j/M, "
                "so that every sample has its partner half a period later."
            )
        if harmonics is not None:
            if 4 * whole("harmonics", harmonics, 1) > samples.size:
                raise BadInput(
                    f"{samples.size} samples resolve harmonics up to {samples.size // 4}, and "
                    f"{harmonics} were asked for: sample finer, or keep fewer."
                )
            t = 2.0 * math.pi * np.arange(samples.size) / samples.size
            drive = Fourier.fit(t, samples, harmonics, symmetric=symmetric)
            object.__setattr__(self, "residual", drive.residual)
            samples = drive.on_grid(samples.size)
        object.__setattr__(self, "values", tuple(samples.tolist()))
        object.__setattr__(self, "_series", TrigonometricSeries(self._resolve(samples)))

    @staticmethod
    def _resolve(values: FloatArray) -> Harmonics:
        half, size = values.size // 2, float(np.max(np.abs(values)))
        if (values == values[0]).all():
            raise BadInput(
                f"the forcing is {'constant' if size else 'zero'}: its samples are all "
                f"{values[0]:.6g}."
            )
        check_size(size, "the forcing")
        spectrum = spectrum_of(values)
        if np.max(np.abs(values[:half] + values[half:])) <= 1e-9 * size:  # antisymmetric
            spectrum[::2] = 0.0
        sizes = abs(spectrum)
        largest, tail = sizes.max(), sizes[values.size // 4 + 1 :].max()
        if tail > 1e-10 * largest:
            raise BadInput(
                f"{values.size} samples do not resolve this forcing: harmonics above "
                f"{values.size // 4} still reach {tail / largest:.1e} of the largest, so it may be "
                "aliased; sample finer, or say with harmonics= how many are kept of noisy ones."
            )
        return response_of(spectrum, 2e-16 * largest)  # below it is rounding of the transform

    def describe(self) -> str:
        return f"F = a times {len(self.values)} samples, harmonics up to {self.highest}"

    def __repr__(self) -> str:
        return f"Samples(<{len(self.values)} values>){self._remark}"


def _refuse_gaps(phases: Any, fitted: Any, F: Any, least: float, highest: int) -> None:
    """Refuse samples that leave the force open: what a fit leaves may be larger over the period, by
    the least singular value of its columns, where no sample shows it."""
    explained, rest = float(np.std(fitted)), float(np.std(F - fitted))
    unknown = rest * F.size**0.5 / least
    if rest < explained < unknown:
        places = np.sort(phases % (2.0 * math.pi))
        gap = np.diff(places, append=places[0] + 2.0 * math.pi).max() / (2.0 * math.pi)
        raise BadInput(
            f"no samples in {gap:.2g} of the period: harmonics up to {highest} leave {rest:.3g} "
            f"elsewhere and may be off by {unknown:.3g} there, more than the {explained:.3g} that "
            "they explain; sample there, too, or take fewer harmonics."
        )


def _left_by(
    kept: FloatArray, F: FloatArray, highest: int, mean: float, odd: bool, other: str
) -> float:
    """Measure what harmonics leave of a force, rms; refuse where they explain less than that."""
    left, explained = math.sqrt(np.mean((F - kept) ** 2)), float(np.std(kept))
    if not left < explained:
        lopsided = "not antisymmetric, F(t + T/2) = -F(t), then symmetric=False, or "
        raise BadInput(
            f"{'odd ' * odd}harmonics up to {highest} leave {left:.3g} of the force, "
            f"explaining {explained:.3g} (rms; its mean is {mean:.3g}): either it {other}, or "
            f"{lopsided * odd}needs more harmonics."
        )
    return left


def spectrum_of(values: FloatArray) -> ComplexArray:
    """``C_m - i S_m`` of samples over a period, in each row, by m from 0 on."""
    spectrum: ComplexArray = np.fft.rfft(values) * (2.0 / values.shape[-1])
    spectrum[..., [0, -1]] *= 0.5  # the mean, and the fastest that the samples show
    return spectrum


def response_of(spectrum: ComplexArray, floor: float) -> Harmonics:
    """f from the harmonics of F, C - i S, without what is only rounding."""
    each = enumerate(spectrum.tolist())
    return tuple((m, _over(m, c.real), _over(m, -c.imag)) for m, c in each if abs(c) > floor)
