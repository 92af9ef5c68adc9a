"""Normal forms of cycles: coefficients in closed form, and on which side something is born."""

from __future__ import annotations

import math

import numpy as np
import pytest

import contbreather as cb
from contbreather.flows import Collocation

from .zoo import CASES, FHN, RADIUS, born, fitzhugh_nagumo, half_turned, told, van_der_pol

TAU = 2 * math.pi
FEW = Collocation(intervals=8)


def strip(t, x, p):
    """Around (cos t, 0) a Moebius strip whose soft direction is q' = mu q + k q^3 - q^5."""
    u, v = x[0] - np.cos(t), x[1]
    du, dv = half_turned(p["mu"], np.cos(t), np.sin(t), u, v)
    square = u**2 + v**2
    more = (1 + p["k"]) * square - square**2
    return [du + more * u - np.sin(t), dv + more * v]


def wheel(t, x, p):
    """z' = (mu + i w) z + k |z|^2 z - |z|^4 z around (cos t, 0)."""
    u, v = x[0] - np.cos(t), x[1]
    square = u**2 + v**2
    growth = p["mu"] + p["k"] * square - square**2
    return [growth * u - p["w"] * v - np.sin(t), p["w"] * u + growth * v]


def twisted(t, x, p):
    """The same turning faster further out: of d = 4 pi (k + 0.4 i) only the real part vanishes."""
    u, v = x[0] - np.cos(t), x[1]
    du, dv = wheel(t, x, p)
    return [du - 0.4 * (u**2 + v**2) * v, dv + 0.4 * (u**2 + v**2) * u]


def fork(t, x, p):
    """y' = h + m y - y^3 around sin t."""
    y = x[0] - np.sin(t)
    return [np.cos(t) + p["h"] + p["m"] * y - y**3]


def forced(f, start, params, **more):
    return cb.cycle(f, start, params, period=TAU, settle=20, collocation=FEW, **more)


def along_mu(f, k: float, w: float = 0.3) -> cb.Branch:
    """Beyond mu = 0, where a multiplier passes the unit circle."""
    problem = forced(f, {"u": 1.0, "v": 0.0}, {"mu": -0.3, "w": w, "k": k})
    return cb.trace(problem, "mu", within={"mu": (-0.4, 0.2)}, towards="up")


def again(image, names: str) -> cb.Flow:
    """A clock, and a map each time it has run down: its return map is the map."""
    clock = len(names)
    return cb.Flow(
        lambda t, x, p: [0.0 * x[0]] * clock + [-1.0],
        until=lambda t, x, p: x[clock],
        reset=lambda t, x, p: [*image(x, p), 1.0],
    )


# --- coefficients -----------------------------------------------------------------------------


@pytest.mark.parametrize("k", [-1.0, 0.5])
@pytest.mark.parametrize(("f", "kind", "name", "factor"),
                         [(strip, "PD", "c", -TAU), (wheel, "NS", "d", 2 * TAU)])  # fmt: skip
def test_a_cubic_coefficient_is_that_of_the_amplitude(f, kind, name, factor, k) -> None:
    """q' = k q^3 for a turn: q(1 + 2 pi k q^2), on a strip with the other sign; z is sqrt 2 times
    the amplitude of an eigenvector of length 1."""
    point = along_mu(f, k).first(kind)
    assert point["mu"] == pytest.approx(0, abs=1e-9)
    assert point[name] == pytest.approx(factor * k, rel=1e-8, abs=1e-8 * (kind == "NS"))
    assert point["criticality"] == ("supercritical" if k < 0 else "subcritical")


@pytest.mark.slow
def test_the_coefficient_of_a_fold_is_that_of_its_amplitude() -> None:
    """y' = -sqrt(3) y^2 for a turn."""
    branch = cb.trace(forced(fork, {"y": 1.0}, {"h": 0.0, "m": 1.0}), "h", within={"h": (-1, 1)})
    assert branch.first("LP")["b"] == pytest.approx(TAU * math.sqrt(3), rel=1e-7)


def test_a_cycle_without_forcing_has_the_same_coefficient() -> None:
    """Its period depends on the amplitude, and a perturbation along it is none."""
    assert CASES["moebius"].branch.first("PD")["c"] == pytest.approx(TAU, rel=1e-8)


@pytest.mark.slow
def test_a_torus_around_a_cycle_has_the_lyapunov_coefficient_of_the_hopf_point_it_turns() -> None:
    """Langford's equations in (r, z): Re d = l1 omega times the period of the turn."""

    def plane(t, x, p):
        return [(x[1] - 0.7) * x[0], 0.6 + x[1] - x[1] ** 3 / 3 - x[0] ** 2 * (1 + p["rho"] * x[1])]

    start = {"r": math.sqrt(RADIUS / 1.42), "z": 0.7}
    rest = cb.trace(cb.equilibrium(plane, start, {"rho": 0.6}), "rho", within={"rho": (0.5, 1)})
    hopf, torus = rest.first("HB"), CASES["langford"].branch.first("NS")
    assert torus["rho"] == pytest.approx(hopf["rho"], abs=1e-9)
    assert torus["d"].real == pytest.approx(hopf["l1"] * hopf["omega"] * TAU / 3.5, rel=1e-7)


@pytest.mark.slow
def test_a_hybrid_flow_has_the_coefficients_of_its_return_map() -> None:
    """The logistic map doubles at r = 3, with c = f''^2/4 + f'''/6 = 9."""
    flow = again(lambda x, p: [p["r"] * x[0] * (1 - x[0])], "u")
    start, window = {"u": 0.6, "s": 1.0}, {"r": (2, 3.2)}
    clock = cb.cycle([flow], start, {"r": 2.5}, settle=30.5, collocation=FEW)
    point = cb.trace(clock, "r", within=window, towards="up").first("PD")
    assert (point["r"], point["c"]) == (pytest.approx(3, abs=1e-10), pytest.approx(9, rel=1e-8))


@pytest.mark.slow
def test_a_hybrid_flow_has_the_torus_of_its_return_map() -> None:
    """The delayed logistic map turns by 60 degrees at r = 2."""

    def image(x, p):
        return [p["r"] * x[0] * (1 - x[1]), x[0]]

    flow, start = again(image, "uv"), {"u": 0.47, "v": 0.47}
    clock = cb.cycle([flow], {**start, "s": 1.0}, {"r": 1.9}, settle=80.5, collocation=FEW)
    point = cb.trace(clock, "r", within={"r": (1.8, 2.1)}, towards="up").first("NS")
    plain = cb.FixedPoint(lambda x, p: np.array(image(x, p)), start, {"r": 1.9})
    known = cb.trace(plain, "r", within={"r": (1.8, 2.1)}, towards="up").first("NS")
    assert point["angle"] == pytest.approx(math.pi / 3, abs=1e-8)
    assert point["d"] == pytest.approx(known["d"], rel=1e-7)
    assert point["criticality"] == known["criticality"] == "supercritical"


# --- sides ------------------------------------------------------------------------------------


def bounced(A: float, t: float, v: float, e: float = 0.8) -> tuple[float, float]:
    """The next impact on A sin t and the velocity after it: Newton's iteration for the flight."""
    flight = TAU
    for _ in range(8):
        gap = A * math.sin(t) + v * flight - flight**2 / 2 - A * math.sin(t + flight)
        flight -= gap / (v - flight - A * math.cos(t + flight))
    return t + flight, -e * (v - flight) + (1 + e) * A * math.cos(t + flight)


@pytest.mark.slow
def test_bounces_alternate_beyond_a_supercritical_doubling_as_far_as_it_says() -> None:
    """Simulated: its two phases part by 2 u with c u^2 = s where a multiplier is -1 - s.

    Its trace is 1 + e^2 - (1 + e)^2 sqrt(A^2 - gamma^2), its determinant e^2. Lengths are those of
    the height, the velocity and the phase."""
    point = CASES["bouncing ball"].branch.first("PD")
    assert point["criticality"] == "supercritical"
    critical, squares = point["A"], []
    for beyond in (1e-3, 2e-3):
        A, impacts = critical + beyond, [(float(point["phase"]), math.pi)]
        for _ in range(8000):
            impacts = [*impacts[-1:], bounced(A, *impacts[-1])]
        (t, v), (later, other) = impacts
        apart = (A * (math.sin(later) - math.sin(t)), other - v, later - t - TAU)
        squares.append(np.dot(apart, apart) / 4 / beyond)
    gamma = math.pi * 0.2 / 1.8
    slope = 1.8**2 * critical / math.sqrt(critical**2 - gamma**2) / (1 - 0.64)
    assert 2 * squares[0] - squares[1] == pytest.approx(slope / point["c"], rel=1e-3)


# --- curves -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("f", "on", "kind"), [(strip, "PD", "GPD"), (twisted, "NS", "CH")])
def test_where_a_coefficient_vanishes_its_curve_says_so(f, on: str, kind: str) -> None:
    window = {"k": (-0.5, 0.2), "mu": (-0.5, 0.5)}
    line = cb.boundary(along_mu(f, -0.2).first(on), ("k", "mu"), within=window, towards="up")
    assert [at.kind for at in line.special] == ["EP", kind, "EP"]
    assert line.first(kind)["k"] == pytest.approx(0, abs=1e-8)
    assert line["mu"] == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
def test_folds_of_cycles_meet_in_a_cusp() -> None:
    """4 m^3 = 27 h^2."""
    problem = forced(fork, {"y": 0.6}, {"h": 0.0, "m": 0.3})
    fold = cb.trace(problem, "h", within={"h": (-1, 0.1)}).first("LP")
    line = cb.boundary(fold, ("m", "h"), within={"m": (-1, 0.35)}, towards="down")
    assert [at.kind for at in line.special] == ["EP", "CP", "EP"]
    assert line.first("CP")["m"] == pytest.approx(0, abs=1e-7)
    assert line.first("CP")["c"] == pytest.approx(-TAU, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("off", [0, 4e-13])  # so near it rounding decides how corrections shrink
def test_folds_of_cycles_end_where_the_lyapunov_coefficient_vanishes(off: float) -> None:
    """FitzHugh and Nagumo's equations: 1 - 2 b + b^2 eps = 0."""
    at, eps = {**FHN, "a": 0.7 * (1 + off), "eps": 0.6, "I": 0.0}, (2 * 0.8 - 1) / 0.8**2
    rest = cb.equilibrium(fitzhugh_nagumo, {"v": -1.2, "w": -0.62}, at)
    cycles = born(rest, "I", (-0.5, 1), I=(0, 1))
    line = cb.boundary(cycles.first("LP"), ("eps", "I"), within={"eps": (0.5, 2)}, towards="up")
    v = -math.sqrt(1 - 0.8 * eps)
    place = {"eps": eps, "I": (v + 0.7) / 0.8 - v + v**3 / 3}
    assert [at.kind for at in line.special] == ["EP", "GH"]
    assert "the folds end at a generalised Hopf point" in line.reason
    assert told(line[-1]) == pytest.approx(place, abs=1e-7)
    for name, value in place.items():  # of the last orbit, which is off by the square of its size
        assert line[-1][name] == pytest.approx(value, abs=1e-4)


@pytest.mark.slow
def test_folds_around_a_place_where_there_is_no_field_are_followed_in_silence(capfd) -> None:
    """Of r' = r (mu - (sqrt(r^2 - 0.1) - s)^2): LAPACK wrote a line for each NaN at its mean."""

    def ring(t, u, p):
        square = u[0] ** 2 + u[1] ** 2
        growth = p["mu"] - (np.sqrt(square - 0.1) - p["s"]) ** 2
        return [growth * u[0] - u[1], growth * u[1] + u[0]]

    orbit = cb.cycle(ring, {"x": 1.3, "y": 0.0}, {"mu": 0.3, "s": 1.0}, settle=60, collocation=FEW)
    fold = cb.trace(orbit, "mu", within={"mu": (-1, 0.4)}, towards="down").first("LP")
    line = cb.boundary(fold, ("mu", "s"), within={"s": (0.9, 1.1)})
    assert line["mu"] == pytest.approx(0.0, abs=1e-9)
    assert "DLASCL" not in "".join(capfd.readouterr())


# --- what has none ----------------------------------------------------------------------------


def test_a_hopf_point_without_cubic_terms_is_degenerate() -> None:
    """At mu = 0 van der Pol's oscillator is the harmonic one."""
    rest = cb.equilibrium(van_der_pol, {"x": 0.0, "v": 0.0}, {"mu": -0.5})
    point = cb.trace(rest, "mu", within={"mu": (-1, 1)}).first("HB")
    assert (point["l1"], point["criticality"]) == (pytest.approx(0, abs=1e-15), "degenerate")


def test_where_there_is_no_normal_form_the_reason_is_given() -> None:
    """At a third of a turn the normal form is another."""
    point = along_mu(wheel, -1.0, 1 / 3).first("NS")
    assert point["criticality"].startswith("unknown: a strong resonance")


@pytest.mark.slow
def test_the_doubling_of_an_adaptive_control_system_is_the_published_one() -> None:
    """Example adaptx of MatCont's manual: Hopf point, doubling with its period, supercritical."""

    def adapt(t, x, p):
        return [x[1], x[2], -p["alpha"] * x[2] - p["beta"] * x[1] - x[0] + x[0] ** 2]

    rest = cb.equilibrium(adapt, {"x": 0.0, "y": 0.0, "z": 0.0}, {"alpha": 1.2, "beta": 1.0})
    hopf = cb.trace(rest, "alpha", within={"alpha": (0.5, 1.5)}).first("HB")
    assert hopf["alpha"] == pytest.approx(1, abs=1e-9)
    assert hopf["l1"] == pytest.approx(-0.3, abs=1e-8)
    start, params = {"x": 0.3, "y": 0.0, "z": 0.0}, {"alpha": 0.66, "beta": 1.0}
    cycles = cb.cycle(adapt, start, params, settle=200)
    point = cb.trace(cycles, "alpha", within={"alpha": (0.62, 0.7)}, towards="down").first("PD")
    assert point["alpha"] == pytest.approx(0.6303020, abs=5e-8)
    assert point["period"] == pytest.approx(6.364071, abs=5e-7)
    assert point["criticality"] == "supercritical"


@pytest.mark.slow
def test_pairs_that_a_symmetry_makes_alike_leave_the_circle_together_in_doubt() -> None:
    """Four Stuart-Landau oscillators in a ring, neighbours in antiphase. With z_j = (-1)^j w and
    m = mu - 4 K waves along the ring have the trace -2 m - 2 K q, q = -2 for two and -4 for one."""

    def ring(t, x, p):
        z, w = x[:4], x[4:]
        square = z**2 + w**2
        u, v = (np.roll(of, 1, 0) + np.roll(of, -1, 0) - 2 * of for of in (z, w))
        return np.concatenate([
            p["mu"] * z - 20 * w - square * (z - w) + 0.1 * (u + 2 * v),
            p["mu"] * w + 20 * z - square * (w + z) + 0.1 * (v - 2 * u),
        ])  # fmt: skip

    turn, signs = TAU * np.linspace(0, 1, 41), math.sqrt(0.15) * np.array([[1], [-1], [1], [-1]])
    samples = turn / 20.65, np.vstack([signs * np.cos(turn), signs * np.sin(turn)])
    cycle = cb.cycle(ring, samples, {"mu": 0.55})
    branch = cb.trace(cycle, "mu", within={"mu": (0.55, 1.0)})
    assert [point.kind for point in branch.special] == ["EP", "NS", "EP"]
    assert branch.first("NS")["mu"] == pytest.approx(0.8, abs=1e-9)
    (doubtful,) = branch.doubtful
    assert doubtful.kind == "NS"
    assert doubtful["mu"] == pytest.approx(0.6, abs=1e-6)
    assert "two NS at once" in doubtful.detail["reason"]


@pytest.mark.parametrize("intervals", [20, 60])
def test_a_period_that_doubles_without_damping_has_no_criticality(intervals):
    def pendulum(t, x, p):
        return [x[1], 0.1 - 0.5 * np.sin(x[0]) + p["F"] * np.cos(t)]

    # areas are preserved: multipliers are mu and 1/mu, and come to -1 in a pair, with one direction
    start = {"x": -0.2, "v": 0.0}, {"F": 0.74}
    orbit = cb.cycle(pendulum, *start, period=TAU, collocation=Collocation(intervals))
    doubled = cb.trace(orbit, "F", towards="up", within={"F": (0.74, 0.75)}).first("PD")
    assert abs(doubled.solution.multipliers + 1).max() < 1e-6
    assert doubled["criticality"].startswith("unknown: a double eigenvalue")
    assert "c" not in doubled.detail
