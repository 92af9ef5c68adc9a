"""Formulas are numbers, never programs; each is a forcing or a sentence, at once."""

from __future__ import annotations

import json
import random
import re
import sys

import numpy as np
import pytest
from scipy import special

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.lattice.forcing import even_harmonics
from tests.lattice.by_hand import slope_of

from ..apart import ended

TIMES = np.array([-30.1, -7.3, -0.2, 0.4, np.pi / 2, 1.9, 3.3, 12.0, 99.5])
WORDS = {name: getattr(np, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp")}
WORDS |= {"log": np.log, "sqrt": np.sqrt, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan}
WORDS |= {"Abs": np.abs, "abs": np.abs, "sign": np.sign, "besselj": special.jv, "pi": np.pi}
WORDS |= {"sec": lambda x: 1 / np.cos(x), "csc": lambda x: 1 / np.sin(x)}
WORDS |= {"cot": lambda x: 1 / np.tan(x)}
TWO = {"max": np.maximum, "Max": np.maximum, "min": np.minimum, "Min": np.minimum}


def by_python(text: str, t: np.ndarray, **params: float) -> np.ndarray:
    """What Python itself makes of the formula."""
    return np.asarray(
        eval(text.replace("^", "**"), {"__builtins__": {}}, WORDS | TWO | params | {"t": t})
    )


# --- values -----------------------------------------------------------------------------------


EXACT = [
    "(cos(t) + 0.3*cos(3*t))^3",
    "-(-cos(t + pi/3))*(2 - sin(2*t))**3",
    "c*sin(t - c)**3/(1 + c)",
    "cos(t)**0*cos(t)",
    "cos(t)*2**-1",
    "cos(t)*exp(0)*sqrt(4)*Abs(-3)",
    "cos(3*t/3) + cos(t*(1 + 2))",
    "cos(-5*t - 1)*cos(1)",
    "+cos(t)**99",
    "besselj(3, 2*cos(t)) - besselj(0, sin(t))*cos(t)",
    "sqrt(2 + cos(t)**2)*cos(t) - log(3 + cos(2*t))*sin(t)",
    "cos(t)/(1 + 0.4*cos(t)**2)**2.5",
    "Abs(c)*sign(-c)*cos(t)",
    "max(c, 2 + cos(2*t))*cos(t) - Min(3, Max(-2, sin(t)**2))*sin(t)**3",
    "2**cos(2*t)*cos(t)",
    "sinh(60*sin(t))",  # a high peak is no pole
    "-cos(t)/(2 + cos(t) + cos(t + 3.141592653589793))",
]
# what only cancels or turns to itself after half a period; rounding of 1001 t, of 90 cos t
TURNED = [
    "tanh(50*cos(t))",
    "atan(cos(3*t + 1))/(2 + tan(cos(t))**2)",
    "cos(t)*tanh(tan(2 + cos(2*t)/9))*Abs(1 + sin(t)**2)",
    "tanh(cos(1.5*t + -0.5*t))",
    "cos(t) + cos(2*t) - cos(2*t)",
    "cos(t) + t - t",
    "cos(t) + Abs(cos(t)) - Abs(cos(t))",
    "exp(log(2 + cos(2*t)))*cos(t)*Abs(t - 300)/(300 - t)",
    "cos(t)*(1 + 1e-13*cos(t))",
    "sinh(90*cos(t))",
    "sin(1001*t)",
]


@pytest.mark.parametrize(
    ("text", "off"), [*((text, 3e-13) for text in EXACT), *((text, 3e-11) for text in TURNED)]
)
def test_a_formula_is_what_python_makes_of_it(text: str, off: float) -> None:
    params = {"c": 0.7} if re.search(r"\bc\b", text) else {}
    forcing, exact = cb.Symbolic(text, **params), by_python(text, TIMES, **params)
    np.testing.assert_allclose(forcing.d2f(TIMES), exact, rtol=0, atol=off * np.ptp(exact))


@pytest.mark.parametrize("name", sorted(WORDS.keys() - {"pi", "besselj"}))
def test_each_function_has_the_values_and_slopes_of_its_name(name: str) -> None:
    """Differences at h = 1e-6 are good to about 1e-9."""
    h, text = 1e-6, f"{name}(c + 0.3*sin(t)**2)*cos(t)"
    forcing, up, down = (cb.Symbolic(text, c=0.4 + x) for x in (0.0, h, -h))
    exact = by_python(text, TIMES, c=0.4)
    np.testing.assert_allclose(forcing.d2f(TIMES), exact, rtol=0, atol=1e-14 * np.ptp(exact))
    slope = (up.d2f(0.7) - down.d2f(0.7)) / (2 * h)
    assert slope_of(forcing, "c", 0.7, 2) == pytest.approx(slope, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize(
    "text",
    [
        "c*cos(t)",
        "cos(t + c)**5",
        "c**2.5*cos(t)",
        "c**0*cos(t)",
        "cos(t) + (1 - c)*cos(3*t)",
        "2**c*cos(t)",
        "c**c*sin(t - c)",
        "cos(t)/(2 + c*cos(2*t))",
        "(2 + cos(2*t))**c*cos(t)",
        "besselj(1, c*cos(t))",
        "tanh(c*cos(t))*exp(c*sin(t)**2)/(1 + c)",
        "cos(t) - -c*sin(t)*sqrt(c)",
        "c*cos(t) - sin(3*t)/c + c**3*(c*cos(t) + 2*c*sin(t))",
    ],
)
def test_slope_in_a_parameter_is_its_difference_quotient(text: str) -> None:
    h, forcing = 1e-6, cb.Symbolic(text, c=0.7)
    for order, pick in enumerate(("f", "df", "d2f")):
        up, down = (getattr(forcing.at(c=0.7 + s * h), pick)(0.7) for s in (1, -1))
        assert slope_of(forcing, "c", 0.7, order) == pytest.approx((up - down) / (2 * h), abs=2e-8)


def some(depth: int, pick: random.Random) -> str:
    if not depth:
        return pick.choice(["cos(t)", "sin(3*t)", "cos(2*t)", "cos(t + 1)", "2", "c", "tan(t)"])
    one, other = some(depth - 1, pick), some(depth - 1, pick)
    name = pick.choice([*sorted(WORDS.keys() - {"pi", "besselj"}), "besselj(2, ", "besselj(3, "])
    call = f"{name}{one})" if "," in name else f"{name}({one})"
    return pick.choice(
        [call, f"({one}{pick.choice('+-*/')}{other})", f"({one})**{pick.choice('234')}"]
    )


@pytest.mark.slow
def test_what_is_taken_is_what_python_makes_of_it() -> None:
    """300 random formulas."""
    pick, t = random.Random(20), np.array([0.3, 1.1, 2.3, 4.4])
    taken = even = 0
    for _ in range(300):
        text = some(pick.randrange(1, 4), pick)
        params = {"c": 0.7} if re.search(r"\bc\b", text) else {}
        with np.errstate(all="ignore"):
            here, there = (np.broadcast_to(by_python(text, x, **params), 4) for x in (t, t + np.pi))
        try:
            drive = cb.Symbolic(text, **params)
        except BadInput:
            continue
        taken += 1
        size = np.abs(drive.d2f(2 * np.pi * np.arange(256) / 256)).max()
        np.testing.assert_allclose(drive.d2f(t), here, rtol=0, atol=2e-13 * size)
        if not params:
            even += not drive.symmetric
            assert drive.symmetric == np.allclose(here, -there, rtol=0, atol=1e-11 * size)
    assert taken > 100
    assert even > 60


# --- how small is nothing ---------------------------------------------------------------------


def test_quarter_turns_are_exact_and_the_smallest_others_are_kept() -> None:
    assert cb.Symbolic("cos(t + pi/2)").harmonics == ((1, 0.0, pytest.approx(1.0, abs=3e-16)),)
    assert cb.Symbolic("sin(3*t - pi)").harmonics == ((3, 0.0, pytest.approx(1 / 9, abs=3e-17)),)
    ((_, cosine, sine),) = cb.Symbolic("cos(t + 1e-14)").harmonics
    assert (cosine, sine) == (pytest.approx(-1.0, abs=3e-16), pytest.approx(1e-14, abs=3e-16))


def test_harmonics_are_kept_down_to_rounding() -> None:
    assert cb.Symbolic("cos(t) + 1e-15*cos(3*t)").highest == 3
    assert cb.Symbolic("cos(t) + 1e-19*cos(3*t)").highest == 1
    assert cb.Symbolic("1e6*cos(t) + 1e-13*cos(3*t)").highest == 1
    *_, (m, cosine, sine) = cb.Symbolic("tanh(cos(t) + 0.3*sin(t))").harmonics
    assert 1e-16 < m**2 * np.hypot(cosine, sine) < 1e-14


@pytest.mark.parametrize(
    ("text", "even"),
    [
        ("cos(t)*(1 + 1e-11*cos(t))", (0, 2)),
        ("cos(t) + 1e-11*cos(2*t)", (2,)),
        ("tanh(cos(t)) + 1e-11", (0,)),
        ("cos(t) + 1e-13*cos(2*t)", ()),
        ("cos(t) + e*cos(2*t)", (2,)),
    ],
)
def test_even_harmonics_are_kept_down_to_twelve_digits(text: str, even: tuple[int, ...]) -> None:
    drive = cb.Symbolic(text, **({"e": 0.0} if "+ e" in text else {}))
    assert even_harmonics(drive) == even


# --- hostile formulas -------------------------------------------------------------------------

REFUSED = {
    "9^9^9^9*cos(t)": "powers up to 99",
    "cos(t)/0": "not a finite real number",
    "cos(t)**(99*99)": "powers up to 99",
    "10**400*cos(t)": "powers up to 99",
    "cos(t)**0.5": "not a finite real number",
    "cos(t)**-3": "not resolved by 2048 harmonics",
    "((cos(t)**99)**99)**99": "not resolved by 2048 harmonics",
    "cos(9999999*t)": "not resolved by 2048 harmonics",
    "cos(1e300*t)": "not 2 pi periodic",
    "cos(1.5*t)": "not 2 pi periodic: t is the phase of the drive, and omega its frequency",
    "exp(1000*cos(t))*cos(t)": "not a finite real number at every t",
    "sinh(700*cos(t))": "reaches 5.1e[+]303, too large",
    "not cos(t)": "holds 'not cos[(]t[)]'",
    "~cos(t)": "holds '~cos[(]t[)]'",
    "cos(t) % 2": "holds 'cos[(]t[)] % 2'",
    "cos(t)//2": "no formula may",
    "cos(t)<<9**9": "no formula may",
    "True*cos(t)": "holds 'True'",
    "1j*cos(t)": "holds '1j'",
    "sin*cos(t)": "holds 'sin', which no formula may: .* each of something in parentheses",
    "cos(t=1)": "holds 'cos[(]t=1[)]'",
    "cos(*t)": r"holds '\*t'",
    "besselj(t)": "besselj takes 2 arguments, not 1",
    "besselj(cos(t), t)": "the order of besselj must be a number",
    "besselj(c, cos(t))": "the order of besselj must be a number",
    "1e308*cos(t)": "reaches 1e[+]308, too large to be computed with",
    "1e999*cos(t)": "not a finite real number",
    "1" * 400 + "*cos(t)": "not a finite real number",
    "1" * 5000 + "*cos(t)": "not a formula",
    "cos(t)/(cos(t) - cos(t))": "not a finite real number",
    "1/cos(t)": "not resolved .* a pole",
    "tanh(1e5*cos(t))": "not resolved by 2048 harmonics",
    "exp(-t/1e4)*cos(t)": "not 2 pi periodic",
    "cos(t)*sign(t + 9)": "not 2 pi periodic",
    "(1 + 1e-8*sign(t + 9))*tanh(cos(t))": "not 2 pi periodic",  # small, but no rounding
    "cos(t)**(3 + e)": "d/de of .* is not a finite real number",
    "cos(t)\0": "not a formula",
    "\ud800": "not a formula",
    "": "not a formula",
    "lambda: t": "no formula may",
    "().__class__.__bases__[0].__subclasses__()": "no formula may",
    "__import__('os').system('true')": "no formula may",
    "cos.__globals__": "no formula may",
    "[t for t in t]": "no formula may",
    "f'{t}'": "no formula may",
    "(" * 5000 + "cos(t)" + ")" * 5000: "not a formula|too large",
    "-" * 19000 + "cos(t)": "too large",
    "+".join(["cos(t)"] * 2000): "too large",
    "cos(t)+" * 10**6: "too large",
    "+".join(f"c{i}*cos(t)" for i in range(240)): "too large",
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: repr(text[:24]))
def test_hostile_formula_is_one_true_sentence(text: str) -> None:
    params = {"c": 1.0} if "c," in text else {"e": 0.0} if "+ e" in text else {}
    with pytest.raises(BadInput, match=REFUSED[text]) as caught:
        cb.Symbolic(text, **params)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("name", ["math", "numpy", "x_1", "E", "self", "text", "expression"])
def test_a_parameter_may_have_any_name_that_is_free(name: str) -> None:
    for text in (f"{name}*cos(t)", f"Abs({name})*cos(t)", f"tanh({name}*cos(t))"):
        forcing = cb.Symbolic(text, **{name: 2.0})
        assert forcing.at(**{name: 3.0}).params == {name: 3.0}
        with pytest.raises(BadInput, match=f"needs a value for {name}"):
            cb.Symbolic(text)


@pytest.mark.parametrize("size", [1e101, 1e308])
def test_forcings_too_large_to_be_computed_with_are_refused(size: float) -> None:
    t = 2 * np.pi * np.arange(16) / 16
    for make in (
        lambda: cb.Fourier(cos={1: -size}),
        lambda: cb.Samples(-size * np.cos(t)),
        lambda: cb.Symbolic("c*cos(t)", c=size),
        lambda: cb.Symbolic("tanh(cos(t))*c", c=size),
    ):
        with pytest.raises(BadInput, match=r"too large to be computed with; .* scale it down"):
            make()
    assert cb.Fourier(cos={1: -1e99}).peak() == 1e99


WATCHED = """
import json, pathlib, sys
import contbreather as cb
cb.Symbolic("besselj(1, cos(t))").f([0.0])  # and what all series are added up by
def count(frame, event, given):
    global calls
    calls += event in ("call", "c_call")
calls = 0
sys.setprofile(count)
seen, watching = set(), True
sys.addaudithook(lambda event, _: watching and seen.add(event))
most = 0
for text in json.loads(sys.stdin.read()):
    calls = 0
    try:
        cb.Symbolic(text, **({"c": 0.3} if "c" in text.replace("cos", "") else {})).peak()
    except cb.BadInput:
        pass
    most = max(most, calls)
watching = False
# not ru_maxrss: that begins with the size of the process that started this one
status = pathlib.Path("/proc/self/status").read_text().split()
memory = int(status[status.index("VmHWM:") + 1]) / 1024
print(json.dumps([sorted(seen), most, memory]))
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counts memory as Linux does")
def test_no_formula_executes_anything_or_takes_long() -> None:
    """Python tells a hook of all it compiles, executes, imports or opens."""
    pick = random.Random(159)
    texts = [text for text in REFUSED if text.isprintable()]
    texts += [some(pick.randrange(3, 6), pick) for _ in range(60)]
    done = ended("-c", WATCHED, given=json.dumps(texts))
    assert done.returncode == 0, done.stderr
    events, calls, memory = json.loads(done.stdout)
    # to a tree, which is only looked at; and arrays of numbers are handed over to be added up
    assert set(events) <= {"compile", "ctypes.addressof", "ctypes.cdata", "ctypes.cdata/buffer"}
    assert calls < 1e6  # of functions, by one formula: a third of a second
    assert memory < 500
