"""Plain steps: one text, as it is and compiled, that steps as the walker does."""

from __future__ import annotations

import logging
import pickle
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather import native
from contbreather.continuation import given_loops, strider

from ..apart import ended

NEVER = 10**9
WITHIN = {"a": (0.06, 0.9)}


@pytest.fixture
def when(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Set after how many seconds code is loaded; 0: it is compiled where it is not kept."""

    def set_(seconds: float) -> None:
        monkeypatch.setattr(strider, "_LOADING", seconds)
        monkeypatch.setattr(strider, "_eager", [] if seconds else [True])
        monkeypatch.setattr(strider, "_known", {})
        monkeypatch.setattr(strider, "_spent", {})

    return set_


def closure(**given: Any) -> cb.Orbit:
    return cb.symmetric(0.5, 0.08, 0.8, **given)


def branch(free: str = "a", within: Any = WITHIN, **given: Any) -> cb.Branch:
    return cb.trace(closure(**given), free, within=within, events=(), inadmissible=True)


THIRD = cb.lattice.Fourier(cos={1: -1.0, 3: 0.4}, sin={1: 0.1})
CASES = {
    "a": {},
    "gamma": {"free": "gamma", "within": {"gamma": (0.0, 0.24)}},
    "k": {"free": "k", "within": {"k": (0.1, 1.0)}},
    "third harmonic": {"forcing": THIRD},
    "coefficient": {"free": "c3", "within": {"c3": (-1.0, 1.0)}, "forcing": THIRD},
    "other coefficient": {"free": "s1", "within": {"s1": (-0.5, 0.5)}, "forcing": THIRD},
    "ring": {"lattice": cb.Ring(6)},
}


def same(one: cb.Branch, other: cb.Branch) -> bool:
    rows = zip(one.points.rows, other.points.rows, strict=True)
    return one.stop is other.stop and all(np.array_equal(*pair) for pair in rows)


def fold_curve(events: Any = None) -> cb.Branch:
    start = cb.trace(closure(), "a", events=events, within={"a": (0, 0.9)}, inadmissible=True)
    pair, within = ("gamma", "a"), {"gamma": (0.0, 0.24), "a": (0.0, 1.0)}
    return cb.boundary(start.first("LP"), pair, within=within, events=(), inadmissible=True)


def test_compiled_steps_are_those_of_the_text_to_the_last_bit(when: Any) -> None:
    when(NEVER)
    as_it_is = [branch(**case) for case in CASES.values()]
    folds = fold_curve([cb.fold()]), fold_curve()
    assert not strider._known
    when(0)
    for one, case in zip(as_it_is, CASES.values(), strict=True):
        assert same(one, branch(**case)), case
    assert same(folds[0], fold_curve([cb.fold()]))
    assert same(folds[1], fold_curve())
    assert len(strider._known) == 3
    assert all(strider._known.values())


@pytest.mark.parametrize("name", CASES)
def test_plain_steps_are_those_of_the_walker(when: Any, name: str) -> None:
    when(NEVER)
    case = CASES[name]
    own = branch(**case)
    assert strider._spent
    problem = closure(**{key: case[key] for key in ("forcing", "lattice") if key in case}).problem
    free, within = case.get("free", "a"), case.get("within", WITHIN)
    plain = replace(problem, loops=None)
    other = cb.trace(plain, free, within=within, events=(), inadmissible=True)
    assert len(own) == len(other)
    assert own.stop is other.stop
    for column in (*own.problem.start, *own.problem.params, "arclength"):
        assert np.allclose(own[column], other[column], rtol=0, atol=2e-11), column
    assert abs(own["residual"]).max() < 1e-14


def test_a_curve_of_folds_by_null_vectors_is_the_exact_one(when: Any) -> None:
    when(NEVER)
    line = fold_curve([cb.fold()])
    assert len(line) > 10
    for a, gamma in zip(line["a"], line["gamma"], strict=True):
        smallest = cb.breathers.closure.smallest_amplitude(float(gamma), 0.8)
        assert a == pytest.approx(smallest, rel=1e-10)


def test_events_are_found_on_steps_taken_ahead(when: Any) -> None:
    when(NEVER)
    problem = closure().problem
    own = cb.trace(problem, "a", within={"a": (0.05, 0.95)})
    other = cb.trace(replace(problem, loops=None), "a", within={"a": (0.05, 0.95)})
    assert [point.label for point in own.special] == [point.label for point in other.special]
    for one, two in zip(own.special, other.special, strict=True):
        assert one["a"] == pytest.approx(two["a"], abs=1e-11)


def test_without_numba_steps_are_taken_all_the_same_and_it_is_said_once(
    when: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    when(0)

    def refuse(*_: Any) -> int:
        raise native.NotCompiled("No module named 'numba'; pip install numba")

    monkeypatch.setattr(native, "address", refuse)
    caplog.set_level(logging.INFO, "contbreather")
    lines = [branch() for _ in range(2)]
    assert same(*lines)
    said = [record for record in caplog.records if "pip install numba" in record.getMessage()]
    assert len(said) == 1


def test_a_point_of_a_stretch_is_made_when_it_is_asked_for_and_stays_the_same(when: Any) -> None:
    when(NEVER)
    line = branch()
    assert line[7] is line[7]
    assert line[-1] is line.points[len(line) - 1]
    assert line[7].z.flags.writeable is False
    assert np.array_equal([point["p"] for point in line], line["p"])
    assert np.array_equal([point.arclength for point in line], line["arclength"])
    back = line.reversed()
    assert np.array_equal(back["a"], line["a"][::-1])
    assert np.array_equal(back[3].tangent, -line[-4].tangent)
    assert pickle.loads(pickle.dumps(line)).points[7]["a"] == line[7]["a"]


SHORT = """
import itertools, sys, types
import contbreather as cb
from contbreather.continuation import strider
ticks = itertools.count()  # what is asked for the time takes a microsecond, whatever runs beside it
strider.time = types.SimpleNamespace(perf_counter=lambda: 1e-6 * next(ticks))
plain = cb.Problem(lambda x, p: [x[0] - p["m"]], {"x": 0.0}, {"m": 0.0})
cb.trace(plain, "m", within={"m": (0, 1)})
cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.4, 0.6)})
assert not {"numba", "llvmlite"} & set(sys.modules)
sys.modules["numba"] = sys.modules["llvmlite"] = None  # as where they are not installed
with strider.eagerly():
    branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.4, 0.6)})
mine = cb.Problem(lambda x, p: [x[0] - p["m"]], {"x": 0.0}, {"m": 0.0}, compiled=True)
print(len(branch) > 5, cb.trace(mine, "m", within={"m": (0, 1)})[-1]["x"])
"""


def test_what_is_short_imports_no_compiler_and_without_one_all_works_too() -> None:
    done = ended("-c", SHORT)
    assert done.stdout == "True 1.0\n", done.stderr


def test_within_a_block_code_is_wanted_at_once(when: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    when(NEVER)
    asked = []

    def refuse(function: Any, kinds: str) -> int:
        asked.append(function.__name__)
        raise native.NotCompiled("not now")

    monkeypatch.setattr(native, "address", refuse)
    branch()
    assert not asked
    with strider.eagerly():
        branch()
    assert asked == ["stride"]
    assert strider.compiled() == 0


# --- machine code -------------------------------------------------------------------------------


def test_what_is_kept_is_used_only_if_it_is_whole_and_of_this_text(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    asked = []

    def compiled(function: Any, kinds: str) -> Any:
        asked.append(function.__name__)
        return b"entry\n\nobject"

    monkeypatch.setattr(native, "_compiled", compiled)
    monkeypatch.setattr(native, "_load", lambda code: (len(code), None))
    for _ in range(2):
        monkeypatch.setattr(native, "_loaded", {})
        assert native.address(native.call, "ppp") == 13
    assert asked == ["call"]
    [file] = tmp_path.rglob("call*.o")
    file.write_bytes(file.read_bytes()[:-1])
    monkeypatch.setattr(native, "_loaded", {})
    native.address(native.call, "ppp")
    assert asked == ["call", "call"]
    native._key.cache_clear()
    monkeypatch.setattr(native.sys, "version_info", (3, 99))
    native.address(native.call, "ppp")
    assert len(asked) == 3
    native._key.cache_clear()


KEPT = """
import ctypes, math, sys
if "numba" in sys.argv:
    import numba
from contbreather import native
def cosine(z, data, out):
    out[0] = math.cos(z[0])
    return 0
numbers = (ctypes.c_double * 1)(0.0)
at = ctypes.addressof(numbers)
native.function(cosine, "ppp")(at, at, at)
print(numbers[0], "numba.core.registry" in sys.modules)
"""


def test_code_is_loaded_beside_a_numba_that_was_imported_and_has_compiled_nothing(
    tmp_path, monkeypatch
) -> None:
    """What numba has for errors has no address then, and an object without it would call 0."""
    pytest.importorskip("numba")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    said = []
    for given in ("compiled", "loaded", "numba"):
        line = [sys.executable, "-X", "faulthandler", "-c", KEPT, given]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        said.append((done.returncode, done.stdout, done.stderr))
    assert said == [(0, "1.0 True\n", ""), (0, "1.0 False\n", ""), (0, "1.0 True\n", "")]


def test_what_code_needs_is_read_off_whatever_it_is_called() -> None:
    text = """
declare i32 @"numba$x.1"(i8*)
declare double @cos(double) local_unnamed_addr
@PyExc_A = external global i8
@"a b" = private constant i8 0
define i64 @own(i64 %x) {
  call void @inner(i64 1)
"""
    assert native._NEEDED.findall(text) == ["numba$x.1", "cos", "PyExc_A"]


def test_code_that_needs_what_is_not_there_is_refused(monkeypatch) -> None:
    llvm = pytest.importorskip("llvmlite.binding")
    monkeypatch.setattr(llvm, "address_of_symbol", lambda name: None)
    with pytest.raises(native.NotCompiled, match="needs exp2, which this Python does not have"):
        native._load(b"entry\nexp2\nobject")


def test_code_goes_by_what_is_in_memory_numbers_from_elsewhere_included() -> None:
    pytest.importorskip("llvmlite")

    def stepped(z: Any, data: Any, out: Any) -> int:
        return int(z[0] + STEP)  # noqa: F821

    def key(step: float) -> str:
        return native._key(FunctionType(stepped.__code__, {"STEP": step}), "ppp")

    assert key(0.5) == key(0.5) != key(0.25)


def test_code_is_kept_where_the_user_may_write(tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(native.os, "access", lambda *_: False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert native._place() == tmp_path / "contbreather"


def test_nothing_is_kept_for_a_user_without_a_home(tmp_path, monkeypatch) -> None:
    def nobody() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(native.os, "access", lambda *_: False)
    monkeypatch.setattr(native.Path, "home", nobody)
    assert native._place() == Path(native.__file__).parent / "__pycache__"


def test_code_is_not_taken_to_a_processor_of_the_same_name_that_can_do_less(monkeypatch) -> None:
    llvm = pytest.importorskip("llvmlite.binding")

    def key(features: str) -> str:
        told = SimpleNamespace(flatten=lambda: features)
        monkeypatch.setattr(llvm, "get_host_cpu_features", lambda: told)
        native._key.cache_clear()
        return native._key(native.call, "ppp")

    assert key("+avx2,+avx512f") != key("+avx2,-avx512f")
    native._key.cache_clear()


def test_numba_that_is_switched_off_is_a_reason(tmp_path, monkeypatch) -> None:
    numba = pytest.importorskip("numba")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    monkeypatch.setattr(native, "_loaded", {})
    with pytest.raises(native.NotCompiled, match="switched off, by NUMBA_DISABLE_JIT"):
        native.address(strider.plain.settle, strider.plain.SETTLING)


# --- functions that a user gave -----------------------------------------------------------------


def cusp(x: Any, p: Any) -> Any:
    return [p["h"] + p["mu"] * x[0] - x[0] ** 3]


def cusp_problem(**given: Any) -> cb.Problem:
    return cb.Problem(cusp, {"x": 1.0}, {"mu": 1.0, "h": 0.0}, **given)


def test_a_decorated_function_is_one_that_can_be_compiled() -> None:
    numba = pytest.importorskip("numba")
    problem = cb.Problem(numba.njit(cusp), {"x": 1.0}, {"mu": 1.0, "h": 0.0})
    assert problem.compiled
    assert problem.residual is cusp
    assert not cusp_problem().compiled


def test_compiled_functions_of_a_user_give_the_points_of_plain_ones() -> None:
    lines = []
    for compiled in (False, True):
        problem = cusp_problem(compiled=compiled)
        branch = cb.trace(problem, "h", within={"x": (-2.0, 2.0)}, events=[cb.fold()])
        within = {"mu": (-1.0, 2.0)}
        lines.append((branch, cb.boundary(branch.first("LP"), ("mu", "h"), within=within)))
    for plain, own in zip(*lines, strict=True):
        assert len(plain) == len(own)
        assert [point.label for point in plain.special] == [point.label for point in own.special]
        assert np.allclose(plain["x"], own["x"], rtol=0, atol=1e-9)
        assert abs(own["residual"]).max() < 1e-12
    folds = lines[1][1]
    assert np.allclose(4 * folds["mu"] ** 3, 27 * folds["h"] ** 2, rtol=0, atol=1e-13)
    assert any(
        known and function.__name__ == "evaluate" for function, known in strider._known.items()
    )


def logarithm(x: Any, p: Any) -> Any:
    return [x[0] - np.log(p["mu"])]


def ripple(x: Any, p: Any) -> Any:
    return [p["mu"] - np.sin(400 * x[0]) / 400]


@pytest.mark.parametrize(
    ("function", "start", "mu", "within"),
    [(logarithm, 0.0, 1.0, {"mu": (1e-6, 1.0)}), (ripple, 0.0, 0.0, {"x": (-0.01, 0.01)})],
)
def test_compiled_functions_go_where_plain_ones_go_though_differences_do_not_hold(
    function: Any, start: float, mu: float, within: Any
) -> None:
    plain, own = (
        cb.trace(
            cb.Problem(function, {"x": start}, {"mu": mu}, compiled=compiled),
            "mu",
            within=within,
            events=[cb.fold()],
        )
        for compiled in (False, True)
    )
    assert (own.stop, own.began, len(own)) == (plain.stop, plain.began, len(plain))
    assert [point.label for point in own.special] == [point.label for point in plain.special]
    assert np.allclose(own["x"], plain["x"], rtol=0, atol=1e-9)
    assert np.allclose(own["mu"], plain["mu"], rtol=0, atol=1e-9)


def test_a_function_that_numba_refuses_is_taken_as_it_is_and_that_is_said_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def field(x: Any, p: Any) -> Any:
        return [x[0] - {**p}["mu"]]

    caplog.set_level(logging.INFO, "contbreather")
    problem = cb.Problem(field, {"x": 0.0}, {"mu": 0.0}, compiled=True)
    for _ in range(2):
        branch = cb.trace(problem, "mu", within={"mu": (0.0, 1.0)}, events=())
        assert branch[-1]["x"] == 1.0
    said = [one.getMessage() for one in caplog.records if "without compiled" in one.getMessage()]
    assert len(said) == 1


def test_a_function_that_means_something_else_when_it_is_compiled_is_refused(monkeypatch) -> None:
    def wrong(function: Any, kinds: str) -> Any:
        return lambda *addresses: 0  # and leaves zeros

    monkeypatch.setattr(native, "function", wrong)
    loops = strider.Loops(len, len, ())
    with pytest.raises(
        cb.BadInput, match=r"compiled, the residual .* \[0.0\]; as it is .* \[1.0\]"
    ):
        given_loops._check(loops, np.zeros(2), np.ones(1), np.ones((1, 2)))
