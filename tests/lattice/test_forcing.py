"""Every way to give a forcing ends in the same f; what drives nothing is refused."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.lattice import Fourier, Harmonic, Samples, Symbolic, forcing_of
from contbreather.lattice.forcing import peak_of
from contbreather.orbits.orbit import orbit_at
from tests.lattice.by_hand import slope_of

TWO = Fourier.from_response(cos={1: 1.0, 3: 0.3})
GRID = 2 * np.pi * np.arange(64) / 64
FORCINGS = {
    "harmonic": Harmonic(),
    "two harmonics": TWO,
    "phases": Fourier(cos={1: -1.0, 5: 0.4}, sin={1: 0.2, 3: -1.1}),
    "polynomial formula": Symbolic("-cos(t) - c*sin(t + d)**3", c=2.0, d=0.4),
    "analytic formula": Symbolic("-cos(t)/(1 + e*cos(2*t))", e=0.5),
    "bessel": Symbolic("besselj(1, x*cos(t))", x=2.5),
    "samples": Samples(-np.cos(GRID) + 0.7 * np.sin(5 * GRID)),
    "many": Fourier(cos={m: (-1.0) ** m * 0.6**m for m in range(1, 32, 2)}),
}
TIMES = np.array([-7.3, -0.2, 0.0, 0.4, 1.9, 3.3, 12.0])


@pytest.fixture(params=FORCINGS)
def forcing(request):
    return FORCINGS[request.param]


def test_each_derivative_is_the_slope_of_the_one_below(forcing):
    h = 1e-5
    for lower, upper in ((forcing.f, forcing.df), (forcing.df, forcing.d2f)):
        slope = (lower(TIMES + h) - lower(TIMES - h)) / (2 * h)
        scale = forcing.highest**2 * max(1.0, np.abs(upper(GRID)).max())
        np.testing.assert_allclose(upper(TIMES), slope, atol=1e-9 * scale)
    slope = (forcing.d2f(TIMES + h) - forcing.d2f(TIMES - h)) / (2 * h)
    np.testing.assert_allclose(
        forcing.d3f(TIMES), slope, atol=1e-8 * forcing.highest**2 * np.abs(slope).max()
    )


def test_f_is_antisymmetric_and_has_no_constant(forcing):
    scale = forcing.peak()
    for function in (forcing.f, forcing.df, forcing.d2f, forcing.d3f):
        size = max(scale, np.abs(function(GRID)).max()) * forcing.highest
        np.testing.assert_allclose(
            function(TIMES + math.pi), -function(TIMES), atol=4e-15 * size, rtol=0
        )


def test_floats_give_floats_and_agree_with_arrays(forcing):
    for function in (forcing.f, forcing.df, forcing.d2f, forcing.d3f):
        single = [function(float(t)) for t in TIMES]
        assert all(type(value) is float for value in single)
        size = np.abs(function(GRID)).max() * forcing.highest
        np.testing.assert_allclose(function(TIMES), single, rtol=0, atol=4e-15 * size)
        assert function(TIMES.reshape(1, 7)).shape == (1, 7)


def test_peak_is_the_largest_displacement_of_the_far_field(forcing):
    dense = np.abs(forcing.f(np.linspace(0.0, math.pi, 200001))).max()
    assert dense <= forcing.peak() * (1 + 1e-15)
    assert forcing.peak() == pytest.approx(dense, rel=1e-9)


def test_derivatives_in_each_own_parameter_are_finite_differences(forcing):
    h = 1e-6
    for name, value in forcing.params.items():
        up, down = forcing.at(**{name: value + h}), forcing.at(**{name: value - h})
        for order, pick in enumerate(("f", "df", "d2f")):
            slope = (getattr(up, pick)(0.7) - getattr(down, pick)(0.7)) / (2 * h)
            assert slope_of(forcing, name, 0.7, order) == pytest.approx(slope, abs=1e-7)


def test_forcings_are_values(forcing):
    assert forcing == forcing.at(**forcing.params)
    assert hash(forcing) == hash(forcing.at(**forcing.params))
    assert forcing.describe().startswith("F =")
    with pytest.raises(AttributeError):
        forcing.anything = 1


# ------------------------------------------------------------- different roads to the same f


def test_a_cosine_is_the_same_given_in_every_way():
    t = TIMES
    ways = [
        Harmonic(),
        Fourier(cos={1: -1.0}),
        Fourier.from_response(cos={1: 1.0}),
        Symbolic("-cos(t)"),
        Symbolic("-cos(t)*(sin(t)**2 + cos(t)**2)"),
        Symbolic("-b*cos(t)", b=1.0),
        Samples(-np.cos(GRID)),
        Samples(-np.cos(GRID[::4])),
    ]
    for way in ways:
        np.testing.assert_allclose(way.f(t), np.cos(t), atol=2e-15)
        np.testing.assert_allclose(way.d2f(t), -np.cos(t), atol=2e-15)
        assert way.highest == 1


@pytest.mark.parametrize("e", [0.0, 0.5, -0.8])
def test_formulas_that_are_no_polynomials_are_found_to_rounding(e):
    """f by Fourier integrals at 30 digits."""
    forcing = Symbolic("-cos(t)/(1 + e*cos(2*t))", e=e)
    with mp.workdps(30):

        def force(t):
            return -mp.cos(t) / (1 + mp.mpf(e) * mp.cos(2 * t))

        t = mp.mpf("0.7")
        # f = double integral of F: from pi/2, where both vanish by symmetry
        exact = mp.quad(lambda s: (t - s) * force(s), [mp.pi / 2, t])
        exact += (t - mp.pi / 2) * mp.quad(force, [0, mp.pi / 2])
        assert abs(forcing.f(0.7) - float(exact)) < 2e-15 * max(1, forcing.peak())
        assert abs(forcing.d2f(0.7) - float(force(0.7))) < 2e-14


def test_a_sympy_expression_is_as_good_as_its_text():
    import sympy

    t, c = sympy.symbols("t c")
    assert Symbolic(-sympy.cos(t) - c * sympy.cos(3 * t), c=2.7) == Symbolic(
        "-c*cos(3*t) - cos(t)", c=2.7
    )


@settings(max_examples=25)
@given(
    st.dictionaries(
        st.integers(0, 4).map(lambda i: 2 * i + 1), st.floats(-2, 2), min_size=1, max_size=4
    ),
    st.dictionaries(st.integers(0, 4).map(lambda i: 2 * i + 1), st.floats(-2, 2), max_size=3),
)
def test_samples_of_any_fourier_forcing_give_it_back(cos, sin):
    if max(map(abs, [*cos.values(), *sin.values()])) < 1e-3:
        cos = {1: -1.0}
    forcing = Fourier(cos, sin)
    back = Samples(forcing.d2f(GRID))
    np.testing.assert_allclose(back.f(TIMES), forcing.f(TIMES), atol=1e-13)


# ------------------------------------------------------------ even harmonics and a mean

EVEN = {
    "fourier": Fourier(cos={0: 0.3, 1: -1.0, 2: 0.2}, sin={3: 0.1, 4: -0.4}),
    "formula": Symbolic("m - cos(t) + 0.2*cos(2*t) + 0.1*sin(3*t) - 0.4*sin(4*t)", m=0.3),
    "samples": Samples(
        0.3 - np.cos(GRID) + 0.2 * np.cos(2 * GRID) + 0.1 * np.sin(3 * GRID)
        - 0.4 * np.sin(4 * GRID)
    ),
    "function": forcing_of(
        lambda t: 0.3 - math.cos(t) + 0.2 * math.cos(2 * t) + 0.1 * math.sin(3 * t)
        - 0.4 * math.sin(4 * t)
    ),
    "analytic": Symbolic("exp(e*cos(t + 1))", e=0.8),
}  # fmt: skip


@pytest.mark.parametrize("name", EVEN)
def test_even_harmonics_and_a_mean_are_kept(name):
    """d2f is F itself; f its double integral without the mean, so that f has none."""
    drive, t = EVEN[name], TIMES
    exact = np.exp(0.8 * np.cos(t + 1))
    mean = 1.1665149229  # I0(0.8)
    if name != "analytic":
        mean, exact = 0.3, 0.3 - np.cos(t) + 0.2 * np.cos(2 * t) + 0.1 * np.sin(3 * t)
        exact -= 0.4 * np.sin(4 * t)
    np.testing.assert_allclose(drive.d2f(t), exact, atol=1e-14)
    h = 1e-3
    bend = (drive.f(t + h) - 2 * drive.f(t) + drive.f(t - h)) / h**2
    np.testing.assert_allclose(bend + mean, exact, atol=1e-5)
    assert abs(np.mean(drive.f(GRID))) < 1e-15
    assert not drive.symmetric
    dense = drive.f(np.linspace(0.0, 2 * math.pi, 200001))
    assert drive.peak() == pytest.approx(abs(dense).max(), rel=1e-9)
    for sign in (1, -1):
        assert peak_of(drive.harmonics[1:], sign) == pytest.approx((sign * dense).max(), rel=1e-9)


def test_a_drive_without_even_harmonics_is_symmetric_unless_a_parameter_makes_it_lopsided(forcing):
    assert forcing.symmetric
    assert not Fourier(cos={1: -1.0, 2: 0.0}).symmetric
    assert not Fourier(cos={0: 0.0, 1: -1.0}).symmetric
    assert not Symbolic("-cos(t) + e*cos(2*t)", e=0.0).symmetric
    assert Symbolic("-cos(t)/(1 + e*cos(2*t))", e=0.0).symmetric


def test_a_mean_stays_itself_from_response_and_is_written_out():
    both = Fourier.from_response(cos={0: 0.3, 1: 1.0, 2: 0.05})
    assert both == Fourier(cos={0: 0.3, 1: -1.0, 2: -0.2})
    assert both.describe() == "F = a (+0.3 -1 cos t -0.2 cos 2t)"
    assert both.params == {"c0": 0.3, "c1": -1.0, "c2": -0.2}
    assert both.slope_harmonics("c0") == ((0, 1.0, 0.0),)


@pytest.mark.parametrize("seed", range(3))
def test_a_fit_keeps_even_harmonics_where_it_is_told_to(seed):
    t = np.random.default_rng(seed).uniform(0.0, 40.0, 300)
    drive, half = (
        Fourier.fit(t, EVEN["fourier"].d2f(t), harmonics=4, symmetric=odd) for odd in (False, True)
    )
    np.testing.assert_allclose(drive.d2f(TIMES), EVEN["fourier"].d2f(TIMES), atol=1e-12)
    assert drive.residual < 1e-12
    assert half.symmetric
    assert set(half.params) == {"c1", "c3", "s1", "s3"}
    assert half.residual == pytest.approx(math.sqrt(0.3**2 + 0.02 + 0.08), rel=0.1)
    kept = Samples(EVEN["fourier"].d2f(GRID), harmonics=4, symmetric=False)
    np.testing.assert_allclose(kept.d2f(TIMES), EVEN["fourier"].d2f(TIMES), atol=1e-13)
    assert Samples(EVEN["fourier"].d2f(GRID), harmonics=4).symmetric


def test_a_coefficient_that_is_zero_stays_a_parameter():
    forcing = Fourier(cos={1: -1.0, 3: 0.0})
    assert forcing.params == {"c1": -1.0, "c3": 0.0}
    assert forcing.highest == 1
    assert forcing.at(c3=-2.7).f(0.4) == pytest.approx(TWO.f(0.4), abs=1e-15)


# ----------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("make", "says"),
    [
        *(
            (
                lambda m=m: Fourier(cos={m: 1}),
                f"cos harmonic {m!r}: harmonics of the forcing are the whole numbers 1, 2, 3, ..., "
                "with the period 2 pi; cos={1: -1.0} is -cos",
            )
            for m in ("x", -1, 1.5, True)
        ),
        (lambda: Fourier(), "is zero"),
        (lambda: Fourier(cos={1: 0.0}), "is zero"),
        (lambda: Harmonic().at(c1=1.0), "unknown forcing parameter 'c1'.*none"),
        (lambda: Fourier(cos={0: 0.3, 1: 0.0}), "is constant"),
        (lambda: Fourier(sin={0: 0.3, 1: 1.0}), "sin harmonic 0: .* its mean is cos={0"),
        (lambda: Samples(np.full(16, 0.3)), "is constant: its samples are all 0.3"),
        (lambda: Samples(np.cos(GRID[:63])), "63 samples: give an even number"),
        (lambda: Samples([1.0, 0.0, -1.0, 0.0]), "at least 8"),
        (lambda: Samples(np.sign(np.cos(GRID + 0.01))), "do not resolve"),
        (
            lambda: Samples(np.cos(17 * GRID)),
            "do not resolve.* sample finer, or say with harmonics= how many are kept of noisy ones",
        ),
        (lambda: Samples(np.zeros(16)), "is zero"),
        (lambda: Samples([1.0] + [np.nan] * 15), r"values\[1\] = nan: finite"),
        (lambda: Samples("abc"), "values = 'abc': finite real numbers"),
        (lambda: Samples([[1.0] * 8] * 2), "one row"),
        (lambda: Symbolic("1 + 0*cos(t)"), "is constant; a breather needs"),
        *(
            (lambda m=m: Fourier(cos={1: -1.0, m: 1.0}), "harmonics up to 1001 are resolved")
            for m in (1003, 10**400 + 1)
        ),
        (lambda: Symbolic("0*cos(t)"), r"the forcing .* is zero; a breather needs"),
        (lambda: Symbolic("c*cos(t) + d*cos(t)", c=1.0, d=-1.0), "is zero at c = 1, d = -1; a"),
        (lambda: Symbolic("-c*cos(t)"), r"needs a value for c; the time is t\.$"),
        (lambda: Symbolic("cos(t)", d=1.0), r"forcing parameter d: 'cos\(t\)' has none\."),
        (
            lambda: Symbolic("b*cos(t) + c*cos(3*t)", b=1.0, c=1.0, d=1.0),
            r"unknown forcing parameter d: .* has b, c\.",
        ),
        *(
            (lambda bad=bad: Symbolic("c*cos(t)", c=bad), f"parameter c = {bad!r} is not a finite")
            for bad in (math.inf, math.nan, "x")
        ),
        *((lambda n=n: Symbolic(f"{n}*cos(t)", **{n: 1.0}), "taken") for n in ("a", "gamma", "k")),
        (lambda: Symbolic("cos(t, t)"), "cannot read"),
        (lambda: Symbolic("sin(t)*cos(t)*cos(w*t)", w=3.0), "d/dw"),
    ],
)
def test_what_cannot_drive_a_breather_is_refused_with_its_reason(make, says):
    with pytest.raises(BadInput, match=says):
        make()


def test_a_forcing_says_what_it_is() -> None:
    assert Harmonic().describe() == "F = -a cos t"
    both = Fourier(cos={1: -1.0, 3: 0.25}, sin={1: 0.5, 5: -2.0})
    assert both.describe() == "F = a (-1 cos t +0.25 cos 3t +0.5 sin t -2 sin 5t)"
    assert repr(both) == "Fourier(cos={1: -1.0, 3: 0.25}, sin={1: 0.5, 5: -2.0})"
    assert both.highest == 5
    assert both.params == {"c1": -1.0, "c3": 0.25, "s1": 0.5, "s5": -2.0}
    assert Symbolic("-c*cos(t)", c=1.5).describe() == "F = a (-c * cos(t)), c = 1.5"
    assert Fourier(cos={1: -1.0, 1001: 1e-3}).highest == 1001
    assert Harmonic().highest == 1
    assert Harmonic().params == {}
    assert Harmonic().peak() == 1.0


# ---------------------------------------------------------------------------- noisy samples

TRUE = Fourier(cos={1: -1.0, 3: 0.2}, sin={1: 0.1, 5: -0.3})


@pytest.mark.parametrize("frequency", [None, 7.3])
@pytest.mark.parametrize("seed", range(4))
def test_a_fit_finds_the_drive_to_the_standard_error_of_its_noise(seed, frequency):
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 9.7 * np.pi, 3000)  # uneven, and not over whole periods
    noise = 0.05 * rng.normal(size=phase.size)
    t = phase if frequency is None else phase / (2 * np.pi * frequency)
    drive = Fourier.fit(t, TRUE.d2f(phase) + noise, harmonics=6, frequency=frequency)
    assert set(drive.params) == {"c1", "c3", "c5", "s1", "s3", "s5"}
    error = 0.05 * math.sqrt(2 / phase.size)
    for name, value in drive.params.items():
        assert abs(value - TRUE.params.get(name, 0.0)) < 6 * error
    assert drive.residual == pytest.approx(0.05, rel=0.1)
    assert f"residual {drive.residual:.3g}" in repr(drive)


def test_a_fit_is_exact_without_noise_and_leaves_out_what_is_even():
    t = np.linspace(1.0, 14.0, 200)
    exact = Fourier.fit(t, TRUE.d2f(t))
    np.testing.assert_allclose(exact.d2f(TIMES), TRUE.d2f(TIMES), atol=1e-12)
    assert exact.residual < 1e-12
    assert Fourier.fit(GRID, TRUE.d2f(GRID)).residual < 1e-12  # one period at equal steps
    uneven = Fourier.fit(t, TRUE.d2f(t) + 0.2 + 0.1 * np.cos(2 * t))
    np.testing.assert_allclose(uneven.d2f(TIMES), TRUE.d2f(TIMES), atol=1e-12)
    assert uneven.residual == pytest.approx(
        math.sqrt(np.mean((0.2 + 0.1 * np.cos(2 * t)) ** 2)), rel=1e-9
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_fit_is_refused_where_what_it_leaves_may_be_larger_than_the_force_in_a_gap(seed):
    rng = np.random.default_rng(seed)
    for missing, refused in ((0.1, False), (0.2, False), (0.5, True)):
        t = 2 * np.pi * (rng.integers(0, 5, 300) + rng.uniform(0.0, 1.0 - missing, 300))
        # nothing is left of a force of these harmonics: they are known from any part
        np.testing.assert_allclose(
            Fourier.fit(t, TRUE.d2f(t)).d2f(TIMES), TRUE.d2f(TIMES), atol=1e-9
        )
        for more in (0.02 * rng.normal(size=t.size), 0.02 * np.cos(7 * t)):
            if refused:
                with pytest.raises(BadInput, match=f"^no samples in {missing}.* of the period: "):
                    Fourier.fit(t, TRUE.d2f(t) + more)
            else:
                fitted = Fourier.fit(t, TRUE.d2f(t) + more).d2f(TIMES)
                np.testing.assert_allclose(fitted, TRUE.d2f(TIMES), atol=0.1)


@pytest.mark.parametrize(
    ("t", "F", "more", "says"),
    [
        (GRID[:8], -np.cos(GRID[:8]), {}, "8 samples: harmonics up to 5"),
        (GRID / 2, -np.cos(GRID / 2), {}, "0.5 of a period"),
        (GRID * 3.7, -np.cos(GRID * 7.1), {}, "not periodic with 6.28319"),
        (GRID, np.cos(2 * GRID), {}, "not antisymmetric"),
        (GRID, np.zeros(64), {}, "the force is 0 at all 64 times"),
        (GRID, np.where(GRID > 1, np.nan, 1.0), {}, r"^F\[11\] = nan: finite"),
        (GRID, np.ones(63), {}, "same length"),
        (GRID[:36] * 16, np.cos(GRID[:36] * 16), {}, "same place of the period"),
        (GRID, -np.cos(GRID), {"frequency": -1.0}, "frequency"),
        (GRID, -np.cos(GRID), {"harmonics": 2.5}, "harmonics"),
    ],
)
def test_samples_that_make_no_drive_are_refused(t, F, more, says):
    with pytest.raises(BadInput, match=says):
        Fourier.fit(t, F, **more)


def test_noisy_samples_are_reduced_to_their_odd_harmonics():
    noise = 0.01 * np.random.default_rng(3).normal(size=64)
    with pytest.raises(BadInput, match="do not resolve"):
        Samples(TRUE.d2f(GRID) + noise)
    reduced = Samples(TRUE.d2f(GRID) + noise, harmonics=5)
    # at equal steps over whole periods least squares are the transform
    fitted = Fourier.fit(GRID, TRUE.d2f(GRID) + noise)
    np.testing.assert_allclose(reduced.d2f(TIMES), fitted.d2f(TIMES), atol=1e-13)
    assert reduced.residual == pytest.approx(fitted.residual, rel=1e-12)
    assert f"residual {fitted.residual:.3g}" in repr(reduced)
    assert Samples(reduced.values) == reduced
    with pytest.raises(BadInput, match="up to 16, and 17"):
        Samples(TRUE.d2f(GRID), harmonics=17)


@pytest.mark.parametrize("values", [np.cos(2 * GRID), GRID, -np.cos(1.5 * GRID)])
def test_samples_of_which_harmonics_leave_more_than_they_explain_are_refused(values):
    """An even force, a ramp, a period and a half: what rounding leaves of odd harmonics is none."""
    with pytest.raises(BadInput, match="odd harmonics up to 5 leave"):
        Samples(values, harmonics=5)


# ---------------------------------------------------------------------------- functions of t


@pytest.mark.parametrize(
    ("function", "formula"),
    [
        (lambda t: -math.cos(t), "-cos(t)"),
        (lambda t: -np.cos(t) / (1.2 + np.cos(2 * t)), "-cos(t)/(1.2 + cos(2*t))"),
    ],
)
def test_a_function_of_time_is_the_drive_of_its_formula(function, formula):
    taken, written = forcing_of(function), forcing_of(formula)
    scale = np.abs(written.d2f(TIMES)).max()
    np.testing.assert_allclose(taken.d2f(TIMES), written.d2f(TIMES), atol=3e-14 * scale)
    np.testing.assert_allclose(taken.f(TIMES), written.f(TIMES), atol=1e-14 * scale)


def test_functions_of_time_and_formulas_are_taken_wherever_a_forcing_is():
    def push(t: float) -> float:
        return -math.cos(t) - 0.3 * math.cos(3 * t)

    on = {"a": 0.5, "gamma": 0.06, "k": 0.8}
    series = Fourier(cos={1: -1.0, 3: -0.3})
    wanted = cb.symmetric(**on, forcing=series)
    shot = orbit_at(cb.shooting(wanted, sites=8)).impulses
    end = cb.simulate(wanted.state(8), **on, periods=3, forcing=series).final
    for drive in (push, "-cos(t) - 0.3*cos(3*t)"):
        assert cb.symmetric(**on, forcing=drive).p == pytest.approx(wanted.p, abs=1e-14)
        impulses = orbit_at(cb.shooting(wanted, sites=8, forcing=drive)).impulses
        np.testing.assert_allclose(impulses, shot, atol=1e-12)
        run = cb.simulate(wanted.state(8), **on, periods=3, forcing=drive)
        np.testing.assert_allclose(run.final, end, atol=1e-12)
    two = cb.multibreather([0, 4], **{**on, "gamma": 0.02}, lattice=cb.Ring(8), forcing=push)
    assert two.section.count == 2
    plane = {"gamma": (0.02, 0.03), "a": (0.3, 0.5)}
    named, plain = (cb.zones(k=0.8, within=plane, **how) for how in ({"forcing": " - cos(t)"}, {}))
    assert named.curves.keys() == plain.curves.keys()
    assert isinstance(cb.symmetric(**on, forcing="-cos(t)").forcing, Harmonic)


@pytest.mark.parametrize(
    ("function", "says"),
    [
        (lambda t: math.cos(1.1 * t), "not 2 pi periodic"),
        (lambda t: np.sign(math.sin(t)), "not resolved by 2048 harmonics"),
        (lambda t: "cos", "not a finite real number"),
        (lambda t: math.nan, "not a finite real number"),
        (lambda t: 0.0, "is zero"),
        (lambda: 0.0, "a function of t alone, a number at each: TypeError: .* 0 positional"),
        (lambda t: math.cos(t) / 0, "a number at each: ZeroDivisionError"),
    ],
)
def test_a_function_that_is_no_drive_is_refused(function, says):
    with pytest.raises(BadInput, match=says):
        forcing_of(function)
