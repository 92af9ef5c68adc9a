"""Loops compiled when the package is installed: their bits, whose they are, when they are made."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather import compiler, kernels, machine_code
from contbreather.files import alone
from contbreather.kernels import Counts, Kernel, Matrix, Vector
from contbreather.lattice.forcing import series_motions
from contbreather.lattice.modal_flow import propagators
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
def nothing_at_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """A session without any object file; the compilers that it starts."""
    started: list[Any] = []
    cached = machine_code.at_hand, machine_code._begun
    monkeypatch.setattr(machine_code, "OBJECTS", tmp_path / "none")
    monkeypatch.setattr(machine_code, "_loaded", {})
    monkeypatch.setattr(subprocess, "Popen", lambda line, **_: started.append(line))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for name in ("NUMBA_CACHE_DIR", machine_code.ASKED):
        monkeypatch.delenv(name, raising=False)
    for one in cached:
        one.cache_clear()
    yield started
    for one in cached:
        one.cache_clear()


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels that are made here are not those of the package."""
    monkeypatch.setattr(kernels, "KERNELS", [])


# --- the same bits --------------------------------------------------------------------------------

BITS = """
import hashlib, json, sys
if "plain" in sys.argv:
    sys.modules["llvmlite"] = None
import numpy as np
import contbreather as cb
def told(*tables):
    return hashlib.sha256(b"".join(np.asarray(one).tobytes() for one in tables)).hexdigest()
branch = cb.trace(cb.symmetric(0.5, 0.08, 0.8), "a", within={"a": (0.06, 0.9)}, events=(),
                  inadmissible=True)
print("branch", told(*branch.points.rows))
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
print("tangent", told(cb.simulation.variation(run), cb.simulation.variation(smooth)))
print("numba" in sys.modules, "llvmlite" in sys.modules and sys.modules["llvmlite"] is not None)
"""


def test_a_process_without_compiled_code_computes_the_same() -> None:
    """Bit for bit."""
    pytest.importorskip("numba")
    *compiled, with_code = python("-c", BITS, "code").splitlines()
    *plain, without = python("-c", BITS, "plain").splitlines()
    assert (with_code, without) == ("False True", "False False")
    assert len(plain) == 11
    assert plain == compiled


def test_a_kernel_takes_arrays_as_they_are_said_to_be() -> None:
    from contbreather.simulation.smooth_flow import RATES, SmoothParameters
    from contbreather.simulation.taylor import Harmonics

    drive, force = np.zeros(2, int), Harmonics(*np.zeros((3, 1)))
    on = SmoothParameters(0.5, 0.1, 0.1, 6.0, 0.0, 0.0, force, np.zeros((1, 3)), drive)
    if RATES.code is None:
        pytest.skip("nothing is compiled")
    with pytest.raises(TypeError, match=r"drive is int64 \(2,\); f8 with 1 axes, row by row"):
        RATES.following(np.zeros(4), on, 0, np.zeros(4))


# --- whose it is ----------------------------------------------------------------------------------


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    path = tmp_path / "one.o"
    compiler._keep(path, machine_code.sealed(b"code"))
    return path


def test_an_object_is_read_if_it_is_whole_and_nobody_else_can_write_to_it(kept: Path) -> None:
    assert machine_code.read_object(kept) == b"code"
    kept.write_bytes(kept.read_bytes()[:-1])
    with pytest.raises(NotCompiled, match="is not what was written there; remove it"):
        machine_code.read_object(kept)


def test_an_object_that_others_may_write_to_is_refused(kept: Path) -> None:
    kept.chmod(0o646)
    with pytest.raises(NotCompiled, match=r"others may write to .*one.o; chmod go-w it"):
        machine_code.read_object(kept)


def test_an_object_of_another_user_is_refused(kept: Path, monkeypatch) -> None:
    monkeypatch.setattr(machine_code.os, "geteuid", lambda: os.getuid() + 1)
    told = list(os.stat(kept))
    told[4] = 4321
    monkeypatch.setattr(machine_code.os, "fstat", lambda number: os.stat_result(told))
    with pytest.raises(NotCompiled, match=r"belongs to another user .number 4321.; remove it"):
        machine_code.read_object(kept)


def test_a_link_to_an_object_is_refused(kept: Path) -> None:
    link = kept.with_name("two.o")
    link.symlink_to(kept)
    with pytest.raises(NotCompiled, match=r"two.o cannot be read"):
        machine_code.read_object(link)
    assert "is a link" in machine_code.distrust(link)


def test_of_groups_only_that_of_the_user_alone_may_write(kept: Path, monkeypatch) -> None:
    import grp
    import pwd

    kept.chmod(0o664)
    who = SimpleNamespace(pw_gid=os.stat(kept).st_gid, pw_name="somebody")
    monkeypatch.setattr(pwd, "getpwuid", lambda user: who)
    for name, members, trusted in (
        ("somebody", [], True),
        ("somebody", ["somebody"], True),
        ("somebody", ["else"], False),
        ("staff", [], False),
    ):
        known = SimpleNamespace(gr_name=name, gr_mem=members)
        monkeypatch.setattr(grp, "getgrgid", lambda group, known=known: known)
        assert (machine_code.distrust(kept) == "") == trusted


def test_nothing_is_taken_from_a_folder_that_others_may_write_to(
    nothing_at_hand: list[Any], tmp_path: Path
) -> None:
    place = tmp_path / "contbreather"
    place.mkdir()
    place.joinpath("steps.o").write_bytes(b"anything")
    assert [*machine_code.at_hand().files] == ["steps.o"]
    place.chmod(0o777)
    assert [*machine_code.at_hand().files] == ["steps.o"]  # looked at once in a session
    machine_code.at_hand.cache_clear()
    assert not machine_code.at_hand().files
    with pytest.raises(NotCompiled, match=f"others may write to {place}; chmod go-w it"):
        kernels.address(propagators, "")


# --- what is not there ----------------------------------------------------------------------------


def test_what_is_missing_starts_one_compiler_and_the_session_stays_as_it_is(
    nothing_at_hand: list[Any], tmp_path: Path
) -> None:
    pytest.importorskip("numba")
    for function in (propagators, series_motions):
        with pytest.raises(NotCompiled, match=r"no machine code for this .* is being compiled"):
            kernels.address(function, "")
    [line] = nothing_at_hand
    assert line == [*machine_code.COMPILER, str(tmp_path / "contbreather"), "--behind"]
    name = kernels.kernel_of(propagators, "").file
    compiler._keep(tmp_path / "contbreather" / name, b"it is there now")
    with pytest.raises(NotCompiled, match="no machine code"):
        kernels.address(propagators, "")


def test_one_compiler_works_at_a_time(nothing_at_hand: list[Any], tmp_path: Path) -> None:
    pytest.importorskip("numba")
    tmp_path.joinpath("contbreather").mkdir()
    with tmp_path.joinpath("contbreather", "lock").open("ab") as file:
        assert alone(file.fileno())
        assert "is being compiled" in machine_code._begun()
    assert not nothing_at_hand


@pytest.mark.parametrize(
    ("has", "reason"),
    [
        (lambda at: at.setenv(machine_code.ASKED, "0"), "is compiled, by CONTBREATHER_COMPILE=0"),
        (lambda at: at.setenv("NUMBA_DISABLE_JIT", "1"), "switched off, by NUMBA_DISABLE_JIT"),
        (lambda at: at.setattr(machine_code, "workers_process", lambda: True), "worker processes"),
        (lambda at: at.setattr(machine_code, "find_spec", lambda name: None), "pip install numba"),
        (
            lambda at: at.setattr(machine_code, "cache_directory", lambda: None),
            "without a home there is no place",
        ),
    ],
)
def test_no_compiler_is_started_where_it_may_not_or_cannot_be(
    nothing_at_hand: list[Any], monkeypatch: pytest.MonkeyPatch, has: Any, reason: str
) -> None:
    pytest.importorskip("numba")
    has(monkeypatch)
    assert reason in machine_code._begun()
    assert not nothing_at_hand


def test_what_the_compiler_refused_is_not_tried_again(
    nothing_at_hand: list[Any], tmp_path: Path
) -> None:
    place = tmp_path / "contbreather"
    place.mkdir()
    name = kernels.kernel_of(propagators, "").file
    place.joinpath(f"{name}.failed").write_text("it was too long")
    with pytest.raises(NotCompiled, match="the compiler failed: it was too long; remove"):
        kernels.address(propagators, "")
    assert not nothing_at_hand


# --- a package with one kernel --------------------------------------------------------------------


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A source tree in which two loops alone are compiled: one, and that of a module it needs."""
    pytest.importorskip("numba")
    root = tmp_path_factory.mktemp("tree")
    unwanted = shutil.ignore_patterns("__pycache__", "_objects")
    shutil.copytree(PACKAGE, root / "contbreather", ignore=unwanted)
    text = root / "contbreather" / "kernels.py"
    one = 'TEXTS = ("contbreather.lattice.modal_flow",)'
    text.write_text(re.sub(r"(?s)^TEXTS = \(.*?^\)", one, text.read_text(), flags=re.MULTILINE))
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        if (ROOT / name).exists():
            shutil.copy(ROOT / name, root)
    return root


LATER = """
import sys, time
if "numba" in sys.argv:
    import numba
import numpy as np
from contbreather import machine_code
from contbreather.lattice.modal_flow import PROPAGATORS
before = PROPAGATORS.code is not None
end = time.monotonic() + 500
cache = machine_code.cache_directory()
while "wait" in sys.argv and time.monotonic() < end and not [*cache.glob("propagators*.o")]:
    time.sleep(0.1)
import contbreather as cb
two = cb.multibreather([0, 3], a=0.5, gamma=0.02, k=0.8, lattice=cb.Ring(12))
assert two.admissibility().ok
print(before, PROPAGATORS.code is not None, "numba" in sys.modules)
"""


def test_the_compiler_works_behind_a_session_for_the_next_one(
    scratch: Path, tmp_path: Path
) -> None:
    """The first goes on without, also when all is there; numba beside it changes nothing: what it
    has for errors is nowhere then, and an object without it would call 0."""
    own = {"PYTHONPATH": str(scratch), "XDG_CACHE_HOME": str(tmp_path), "NUMBA_CACHE_DIR": ""}
    said = [
        python("-c", LATER, how, **own, CONTBREATHER_COMPILE=asked)
        for how, asked in (("wait", ""), ("numba", "0"))
    ]
    assert said == ["False False False\n", "True True True\n"]


def test_older_texts_of_a_loop_do_not_pile_up(tmp_path: Path) -> None:
    for number in range(9):
        path = tmp_path / f"loop.cpython-399.00000000-{number}.o"
        compiler._keep(path, b"")
        os.utime(path, (number, number))
    names = [path.name[-3] for path in sorted(tmp_path.iterdir())]
    assert names == ["6", "7", "8"]


def built(root: Path, folder: Path, version: str, asked: str) -> Path:
    pytest.importorskip("hatchling")
    line = (
        "import sys; from hatchling.builders.wheel import WheelBuilder as W; "
        f"print(*W(sys.argv[1]).build(directory=sys.argv[2], versions=['{version}']))"
    )
    said = python("-c", line, str(root), str(folder), CONTBREATHER_COMPILE=asked)
    return Path(said.splitlines()[-1])


def test_a_wheel_has_objects_beside_their_source_and_says_where_it_fits(
    scratch: Path, tmp_path: Path
) -> None:
    wheel = built(scratch, tmp_path, "standard", "1")
    names = zipfile.ZipFile(wheel).namelist()
    objects = sorted(name for name in names if name.endswith(".o"))
    for name, kernel in zip(objects, ("propagators", "series_motions"), strict=True):
        assert name.startswith(f"contbreather/_objects/{kernel}.cpython-")
    assert f"cp{sys.version_info[0]}{sys.version_info[1]}" in wheel.name
    assert not wheel.name.endswith("any.whl")
    # and in the tree, which Python started there imports
    beside = scratch / "contbreather" / "_objects"
    assert sorted(path.name for path in beside.iterdir()) == [Path(name).name for name in objects]
    shutil.rmtree(beside)
    shutil.unpack_archive(wheel, tmp_path / "site", "zip")
    own = {"PYTHONPATH": str(tmp_path / "site"), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    assert python("-c", LATER, "", **own) == "True True False\n"


def test_a_wheel_without_objects_is_for_all_and_says_why(scratch: Path, tmp_path: Path) -> None:
    wheel = built(scratch, tmp_path, "standard", "0")
    assert wheel.name.endswith("-py3-none-any.whl")
    told = zipfile.ZipFile(wheel).read("contbreather/_objects/reason.txt")
    assert b"by CONTBREATHER_COMPILE=0" in told
    shutil.rmtree(scratch / "contbreather" / "_objects")


def test_what_is_in_the_tree_of_a_checkout_is_of_its_text_and_alone_there(
    scratch: Path, tmp_path: Path
) -> None:
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


def test_a_kernel_is_compiled_from_what_its_annotations_say(own: None) -> None:
    pytest.importorskip("numba")
    kernel = Kernel(doubled)
    code = compiler.object_of(kernel)
    given = np.arange(3.0), np.array([1, 0, 1]), np.eye(3), 2.0, 2, True
    address = machine_code.load_object(code)
    kernel.__dict__["code"] = kernels.callable_at(address, kernels.FRAME)
    compiled, plain = given[0].copy(), given[0].copy()
    kernel(compiled, *given[1:])
    doubled(plain, *given[1:])
    assert compiled.tolist() == plain.tolist() == [0.0, 2.0, 2.0]


def test_a_kernel_that_asks_for_memory_is_refused(own: None) -> None:
    pytest.importorskip("numba")
    with pytest.raises(NotCompiled, match=r"No implementation of function .*empty|NRT"):
        compiler.object_of(Kernel(greedy))


def test_what_code_needs_is_read_off_whatever_it_is_called() -> None:
    text = """
declare i32 @"numba$x.1"(i8*)
declare double @cos(double) local_unnamed_addr
@PyExc_A = external global i8
@"a b" = private constant i8 0
define i64 @own(i64 %x) {
  call void @inner(i64 1)
"""
    assert compiler._NEEDED.findall(text) == ["numba$x.1", "cos", "PyExc_A"]


def test_code_that_needs_what_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    llvm = pytest.importorskip("llvmlite.binding")
    monkeypatch.setattr(llvm, "address_of_symbol", lambda name: None)
    with pytest.raises(NotCompiled, match="needs exp2, which this Python does not have"):
        machine_code.load_object(b"entry\nexp2\nobject")


def test_code_goes_by_what_is_in_memory_numbers_from_elsewhere_included(own: None) -> None:
    pytest.importorskip("llvmlite")

    def stepped(z: Any, data: Any, out: Any) -> int:
        return int(z[0] + STEP)  # noqa: F821

    def name(step: float) -> str:
        return Kernel(FunctionType(stepped.__code__, {"STEP": step}), "ppp").file

    assert name(0.5) == name(0.5) != name(0.25)


@pytest.mark.parametrize("what", ["features", "name", "version"])
def test_code_is_not_taken_to_another_processor_or_python(
    own: None, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
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
    caches = machine_code.processor, machine_code._key
    for one in caches:
        one.cache_clear()
    assert kernel.file != before
    for one in caches:
        one.cache_clear()


def test_code_is_kept_where_the_user_may_write(tmp_path, monkeypatch) -> None:
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(machine_code.Path, "home", lambda: tmp_path)
    assert machine_code.cache_directory() == tmp_path / ".cache" / "contbreather"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    assert machine_code.cache_directory() == tmp_path / "other" / "contbreather"

    def nobody() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(machine_code.Path, "home", nobody)
    assert machine_code.cache_directory() is None


def test_the_version_says_more_if_it_is_asked(run: Any) -> None:
    status, out, _ = run("--version --verbose")
    assert status == 0
    assert out.startswith(f"{cb.__version__}\n")
    assert re.search(r"\d+ of \d+ loops are compiled|nothing is compiled", out)


def test_status_says_why_something_is_missing(
    nothing_at_hand: list[Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("llvmlite")
    objects = tmp_path / "installed"
    objects.mkdir()
    objects.joinpath("reason.txt").write_text("no compiler\n")
    half = objects / kernels.KERNELS[0].file
    half.write_bytes(b"half of it")
    monkeypatch.setattr(machine_code, "OBJECTS", objects)
    monkeypatch.setenv(machine_code.ASKED, "0")
    told = kernels.status()
    why = rf"{re.escape(str(half))} is not what was written there; remove it"
    begin = rf"0 of \d\d loops are compiled; {why}; when it was installed: no compiler; "
    assert re.match(begin, told)
    assert told.endswith("nothing is compiled, by CONTBREATHER_COMPILE=0")
