"""Loops compiled when the package is installed: their bits, whose they are, when they are made."""

from __future__ import annotations

import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather import compiler, kernels, machine_code
from contbreather.kernels import Counts, Kernel, Matrix, Vector
from contbreather.machine_code import NotCompiled

ROOT = Path(__file__).parents[1]
PACKAGE = Path(kernels.__file__).parent


def python(*line: str, **environment: str) -> str:
    """What a process of its own prints."""
    done = subprocess.run(
        [sys.executable, "-P", *line],  # not what is in this directory
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels that are made here are not those of the package."""
    monkeypatch.setattr(kernels, "KERNELS", [])
    monkeypatch.setattr(compiler, "KERNELS", [])


# --- the same bits --------------------------------------------------------------------------------

BITS = """
import hashlib, json, sys
if "plain" in sys.argv:
    sys.modules["llvmlite"] = None
import numpy as np
import contbreather as cb
def told(*tables):
    return hashlib.sha256(b"".join(np.asarray(one).tobytes() for one in tables)).hexdigest()
zones = cb.zones(k=0.8, within={"gamma": (0.05, 0.055)})
for kind, lines in zones.curves.items():
    for line in lines:
        print(kind, [point.label for point in line.special], line.stop)
        print(json.dumps([line["a"].tolist(), line["gamma"].tolist()]))
u, v = np.random.default_rng(1).uniform(-0.9, 0.9, (2, 8))
where = {"a": 0.5, "gamma": 0.08, "k": 0.3, "damping": 0.01, "spring": 0.1}
sites = cb.simulation.Sample(sites=[0], per_period=8)
for on in ({}, {"lattice": cb.OpenChain(8), "k": 0.0}):
    run = cb.simulate((u, v), periods=2, sample=sites, **{**where, **on})
    print("run", told(run.final.u, run.impacts, run.rests, run.record.u))
smooth = cb.simulation.simulate_smooth((0.3 * u[:3], v[:3]), a=0.5, gamma=0.08, k=0.8, m=20,
                                             periods=1)
print("smooth", told(smooth.final.u))
kicks = [(2, 0.0, 0.9), (0, 1.1, -0.4), (3, 3.0, 0.9)]
map = cb.stability.chain_map.OrbitMap(0.06, 0.8, kicks)
print("count", map.count(), map.crosses(-1.0), map.pairs(), map.nearest(), map.on_circle(0.3))
for spring in (0.0, 0.3):
    for gamma, k in ((0.07, 0.8), (0.0699, 0.781762044709733), (0.0668, 0.8), (1e-6, 0.9)):
        half = cb.stability.one_impact.HalfMap(gamma, k, 0.5, cb.InfiniteChain(spring))
        print("half", half.window, half.gradient((spring + 1.7 * gamma) ** 0.5))
print("tangent", told(cb.simulation.variation(run), cb.simulation.variation(smooth)))
print("numba" in sys.modules, "llvmlite" in sys.modules and sys.modules["llvmlite"] is not None)
"""


@pytest.mark.slow
def test_a_process_without_compiled_code_computes_the_same() -> None:
    """Bit for bit, but for places of curves: plain steps add up their terms in another order."""
    pytest.importorskip("numba")
    *compiled, with_code = python("-c", BITS, "code").splitlines()
    *plain, without = python("-c", BITS, "plain").splitlines()
    assert (with_code, without) == ("False True", "False False")
    assert len(plain) == 19
    for ours, theirs in zip(compiled, plain, strict=True):
        if ours.startswith("["):
            np.testing.assert_allclose(json.loads(ours), json.loads(theirs), rtol=0, atol=1e-12)
        else:
            assert ours == theirs


def test_what_a_kernel_is_given_stays_until_it_returns(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its words were given back before the call, and what another thread made stood there."""

    def total(left: float, right: float) -> None:
        """No kernel of the package: it is not called."""

    kernel, seen = Kernel(total), list[float]()
    kernels.KERNELS.remove(kernel)

    def code(at: int) -> None:
        others = [np.full(2, -1.0) for _ in range(99)]
        seen.extend((ctypes.c_double * len(others[0])).from_address(at))

    monkeypatch.setattr(kernel, "code", code)
    kernel(3.0, 4.0)
    assert seen == [3.0, 4.0]


def test_a_kernel_takes_arrays_as_they_are_said_to_be() -> None:
    from contbreather.simulation.smooth import RATES, SmoothParameters

    drive, force = np.zeros(2, int), np.zeros((1, 3))
    on = SmoothParameters(0.5, 0.1, 0.1, 6.0, 0.0, 0.0, force, np.zeros((1, 3)), drive)
    if RATES.code is None:
        pytest.skip("nothing is compiled")
    with pytest.raises(TypeError, match=r"drive is int64 \(2,\); f8 with 1 axes, row by row"):
        RATES.following(np.zeros(4), on, 0, np.zeros(4))


def test_what_is_compiled_at_installation_needs_numpy_alone() -> None:
    """The build environment has the build's requirements, scipy is none of them."""
    without = "import sys; sys.modules['scipy'] = None; from importlib import import_module as load"
    texts = (
        "from contbreather.compiler import TEXTS; print(*(load(text).__name__ for text in TEXTS))"
    )
    assert python("-c", f"{without}; {texts}").split() == [*compiler.TEXTS]


# --- a package with one kernel --------------------------------------------------------------------


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A source tree in which two loops alone are compiled: one, and that of a module it needs."""
    pytest.importorskip("numba")
    root = tmp_path_factory.mktemp("tree")
    unwanted = shutil.ignore_patterns("__pycache__", "_objects")
    shutil.copytree(PACKAGE, root / "contbreather", ignore=unwanted)
    text = root / "contbreather" / "compiler.py"
    one = 'TEXTS = ("contbreather.lattice.modal_flow",)'
    text.write_text(re.sub(r"(?s)^TEXTS = \(.*?^\)", one, text.read_text(), flags=re.MULTILINE))
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        if (ROOT / name).exists():
            shutil.copy(ROOT / name, root)
    return root


LATER = """
import sys
if "numba" in sys.argv:
    import numba
import contbreather as cb
from contbreather.lattice.modal_flow import PROPAGATORS
end = cb.symmetric(a=0.5, gamma=0.02, k=0.8, lattice=cb.OpenChain(3), site=0)
assert end.stability().unstable == 2
print(PROPAGATORS.code is not None, "numba" in sys.modules)
"""


def built(root: Path, folder: Path, version: str, asked: str) -> Path:
    pytest.importorskip("hatchling")
    line = (
        "import sys; from hatchling.builders.wheel import WheelBuilder as W; "
        f"print(*W(sys.argv[1]).build(directory=sys.argv[2], versions=['{version}']))"
    )
    said = python("-c", line, str(root), str(folder), CONTBREATHER_COMPILE=asked)
    return Path(said.splitlines()[-1])


@pytest.mark.slow
def test_a_wheel_has_objects_beside_their_source_and_says_where_it_fits(scratch, tmp_path):
    wheel = built(scratch, tmp_path, "standard", "1")
    names = zipfile.ZipFile(wheel).namelist()
    objects = sorted(name for name in names if name.endswith(".o"))
    assert [name.partition("-")[0] for name in objects] == ["contbreather/_objects/propagators"]
    assert f"cp{sys.version_info[0]}{sys.version_info[1]}" in wheel.name
    assert not wheel.name.endswith("any.whl")
    # and in the tree, which Python started there imports
    beside = scratch / "contbreather" / "_objects"
    assert sorted(path.name for path in beside.iterdir()) == [Path(name).name for name in objects]
    shutil.rmtree(beside)
    shutil.unpack_archive(wheel, tmp_path / "site", "zip")
    own = {"PYTHONPATH": str(tmp_path / "site")}
    assert python("-c", LATER, "", **own) == "True False\n"
    # numba beside it has errors of its own names, which objects without it have nowhere
    assert python("-c", LATER, "numba", **own) == "True True\n"


def test_a_wheel_without_objects_is_for_all_and_says_why(scratch: Path, tmp_path: Path) -> None:
    wheel = built(scratch, tmp_path, "standard", "0")
    assert wheel.name.endswith("-py3-none-any.whl")
    told = zipfile.ZipFile(wheel).read("contbreather/_objects/reason.txt")
    assert b"by CONTBREATHER_COMPILE=0" in told
    shutil.rmtree(scratch / "contbreather" / "_objects")


def test_what_is_in_the_tree_of_a_checkout_is_of_its_text_and_alone_there(scratch, tmp_path):
    beside = scratch / "contbreather" / "_objects"
    beside.mkdir()
    beside.joinpath("older.o").touch()
    pytest.importorskip("hatchling")
    line = (
        "import sys, hatch_build; hook = hatch_build.CompileHook(sys.argv[1], {}, *3 * [None], "
        "'wheel'); made = {'artifacts': []}; hook.initialize('editable', made); print(made)"
    )
    path = os.pathsep.join(filter(None, [str(scratch), os.environ.get("PYTHONPATH")]))
    said = python("-c", line, str(scratch), PYTHONPATH=path, CONTBREATHER_COMPILE="0")
    assert said.splitlines()[-1] == "{'artifacts': []}"
    assert [path.name for path in beside.iterdir()] == ["reason.txt"]
    shutil.rmtree(beside)


# --- what is compiled -----------------------------------------------------------------------------


def doubled(x: Vector, counts: Counts, table: Matrix, by: float, to: int, also: bool) -> None:
    for i in range(to):
        x[i] = by * x[i] + table[i, counts[i]] * also


def greedy(x: Vector) -> None:
    x[0] = np.empty(3)[0]


@pytest.mark.slow
def test_the_compiler_removes_what_is_of_an_older_text_and_leaves_what_others_made(
    scratch: Path, tmp_path: Path
) -> None:
    tree = tmp_path / "tree"
    shutil.copytree(scratch, tree)
    beside = tree / "contbreather" / "_objects"
    shutil.rmtree(beside, ignore_errors=True)
    line = "-m", "contbreather.compiler"
    python(*line, PYTHONPATH=str(tree))
    (made,) = beside.glob("propagators-*.o")
    name, processor, text = made.stem.split("-")
    older = made.with_name(f"{name}-{processor}-{text[::-1]}.o")
    gone = made.with_name(f"removed-{processor}-{text}.o")
    elsewhere = made.with_name(f"{name}-{processor[::-1]}-{text}.o")
    for one in (older, gone, elsewhere):
        one.touch()
    python(*line, PYTHONPATH=str(tree))
    assert sorted(beside.iterdir()) == sorted([made, elsewhere])


def test_a_kernel_that_asks_for_memory_is_refused(own: None) -> None:
    pytest.importorskip("numba")
    with pytest.raises(NotCompiled, match=r"No implementation of function .*empty|NRT"):
        compiler.object_of(Kernel(greedy))


def test_code_goes_by_what_is_in_memory_numbers_from_elsewhere_included(own: None) -> None:
    pytest.importorskip("llvmlite")

    def stepped(z: Vector) -> None:
        z[0] = STEP  # noqa: F821

    def name(step: float) -> str:
        return machine_code.file_name(FunctionType(stepped.__code__, {"STEP": step}), "z:f81")

    assert name(0.5) == name(0.5) != name(0.25)


@pytest.fixture
def fresh() -> Iterator[Callable[[], None]]:
    """Forget what is known of the processor, now and in the end."""

    def forget() -> None:
        for one in (machine_code.processor, machine_code.file_name):
            one.cache_clear()

    yield forget
    forget()


@pytest.mark.parametrize("what", ["features", "name", "version"])
def test_code_is_not_taken_to_another_processor_or_python(own, monkeypatch, fresh, what):
    """Also one of the same name that can do less."""
    llvm = pytest.importorskip("llvmlite.binding")
    kernel = Kernel(doubled)
    before = kernel.file
    if what == "features":
        less = SimpleNamespace(flatten=lambda: "+avx2,-avx512f")
        monkeypatch.setattr(llvm, "get_host_cpu_features", lambda: less)
    elif what == "name":
        monkeypatch.setattr(llvm, "get_host_cpu_name", lambda: "i386")
    else:
        monkeypatch.setattr(machine_code.sys, "version_info", (3, 99))
    fresh()
    assert kernel.file != before


def test_the_version_says_more_if_it_is_asked(run: Any) -> None:
    status, out, _ = run("--version --verbose")
    assert status == 0
    assert out.startswith(f"{cb.__version__}\n")
    assert re.search(r"\d+ of \d+ loops are compiled|nothing is compiled", out)


def test_on_another_processor_the_version_says_what_to_do(run, monkeypatch, fresh):
    llvm = pytest.importorskip("llvmlite.binding")
    monkeypatch.setattr(llvm, "get_host_cpu_name", lambda: "i386")
    fresh()
    _, out, _ = run("--version --verbose")
    assert re.search(r"\n0 of \d+ loops are compiled; python -m contbreather\.compiler ", out)


def test_status_says_why_something_is_missing(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    pytest.importorskip("llvmlite")
    tmp_path.joinpath("reason.txt").write_text("no compiler\n")
    monkeypatch.setattr(machine_code, "OBJECTS", tmp_path)
    began = r"0 of \d\d loops are compiled; when it was installed: no compiler; python -m"
    assert re.match(began, compiler.status())
