"""Machine code of functions that are written in numbers, loops and pointers alone.

Such a function runs as it is, with lists for its pointers; compiled, the same text gives the same
bits some hundred times faster. numba compiles it once, in seconds, and the object code is kept on
disk. Loading that takes llvmlite alone, 0.05 s: to import numba and begin takes ten times as long.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import re
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any

from contbreather.errors import BadInput
from contbreather.files import write_whole

Function = Callable[..., Any]

# What object code may refer to: mathematics, and Python itself. What numba has for errors is never
# called, as nothing is raised, but has to be somewhere: with one name missing the loader leaves
# all others at 0 without a word. numba names them itself, but when it compiles, not when it is
# imported.
_KNOWN = re.compile(r"(llvm\.|_?Py).*|a?(sin|cos|tan)h?|atan2|sqrt|exp|log|pow|floor|mem\w+")
_NEVER = (
    "numba_gil_ensure",
    "numba_gil_release",
    "numba_unpickle",
    "numba_do_raise",
    "numba_runtime_build_excinfo_struct",
    "NRT_Free",
)

_FORMAT = 2  # of what is kept, and of how it is compiled
_NEEDED = re.compile(r'^(?:declare [^@]*)?@"?([^"(\s]+)"?(?:\(| = external)', re.MULTILINE)

_ONE_AT_A_TIME = threading.RLock()  # neither compiler nor loader likes company of other threads
_loaded: dict[str, tuple[int, Any]] = {}  # by key: the address, and what keeps it alive


def workers_process() -> bool:
    """Whether this process works for another one: then there is much to do, and what is kept is
    loaded at once."""
    known = sys.modules.get("multiprocessing.process")  # by then a worker has it
    return known is not None and known.parent_process() is not None


class NotCompiled(Exception):
    """There is no machine code of a function; carries the reason."""


def call(function: Function, one: Any, two: Any, three: Any) -> int:
    """Call a function of three pointers that was handed over; compiled, by its address."""
    answer: int = function(one, two, three)
    return answer


@lru_cache(maxsize=256)
def bound(function: Function, **names: Any) -> Function:
    """A function with other globals, also in what it calls in its module; the same each time."""
    return _bound(function, tuple(names.items()), {})


def _bound(function: Function, names: Any, done: dict[Any, Any]) -> Any:
    if function not in done:
        known = function.__globals__
        text = "_".join(getattr(value, "__qualname__", str(value)) for _, value in names)
        scope = {name: known[name] for name in function.__code__.co_names if name in known}
        made = FunctionType(function.__code__, scope, f"{function.__name__}_{text}")
        made.__module__, made.__qualname__ = function.__module__, f"{function.__qualname__}_{text}"
        done[function] = made
        for name, value in scope.items():
            if isinstance(value, FunctionType) and value.__module__ == function.__module__:
                scope[name] = _bound(value, names, done)
        scope.update({name: value for name, value in names if name in scope})
    return done[function]


def is_kept(function: Function, kinds: str) -> bool:
    """Whether its machine code is at hand or on disk."""
    try:
        return _key(function, kinds) in _loaded or _file(function, kinds).exists()
    except ImportError:
        return False


def address(function: Function, kinds: str) -> int:
    """Where the machine code of a function begins.

    Parameters
    ----------
    function : callable
        Its globals are constants, `math`, `call`, and functions of its own module like it; returns
        an int.
    kinds : str
        A letter for each argument: p a pointer to floats, i an int, f a function to `call`.

    Raises
    ------
    NotCompiled
        Without llvmlite, or where the function is not kept and there is no numba, or it refuses.
    """
    try:
        key = _key(function, kinds)
    except ImportError as error:
        raise NotCompiled(f"{error}; pip install numba") from error
    with _ONE_AT_A_TIME:
        if key not in _loaded:
            _loaded[key] = _had(function, kinds)
    return _loaded[key][0]


def _had(function: Function, kinds: str) -> tuple[int, Any]:
    """The address, and what keeps it alive: compiled for this session, loaded, or compiled and
    kept."""
    if _is_foreign(function):
        made = _made(function, kinds)
        return made.address, (made, function)
    path = _file(function, kinds)
    code = _read(path)
    if code is None:
        code = _compiled(function, kinds)
        _keep(path, hashlib.sha256(code).digest() + code)
    return _load(code)


def function(function: Function, kinds: str) -> Callable[..., int]:
    """The machine code of a function to be called with addresses and whole numbers."""
    numbers = [ctypes.c_int64 if kind == "i" else ctypes.c_void_p for kind in kinds]
    # not CFUNCTYPE: such a call is too short to be worth handing the interpreter to other threads
    return ctypes.PYFUNCTYPE(ctypes.c_int64, *numbers)(address(function, kinds))


@lru_cache(maxsize=64)
def _key(function: Function, kinds: str) -> str:
    """A name for a function as it is in memory and for all else that its code depends on."""
    import llvmlite.binding as llvm

    if _is_foreign(function):  # which may be defined anew: good for this session
        return f"{id(function)} {kinds}"
    made = [_content(one) for one in _called(function, {})]
    # two machines with processors of one name may differ in what their hosts let through
    cpu = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = (llvm.get_process_triple(), *cpu, llvm.llvm_version_info)
    about = repr((_FORMAT, made, kinds, sys.version_info[:2], machine))
    return hashlib.sha256(about.encode()).hexdigest()


def _content(function: Function) -> tuple[Any, ...]:
    """What is compiled of a function: not its text, which may have been edited since, and with the
    constants that it has from other modules."""
    code, known = function.__code__, function.__globals__
    plain = float | int | tuple
    numbers = [(name, known[name]) for name in code.co_names if isinstance(known.get(name), plain)]
    named = function.__qualname__, code.co_names, code.co_varnames
    return (*named, code.co_code, code.co_consts, numbers)


def _is_foreign(function: Function) -> bool:
    """Whether it was decorated with `numba.njit`, or calls what was."""
    if hasattr(function, "py_func"):
        return True
    names = ((one, name) for one in _called(function, {}) for name in one.__code__.co_names)
    return any(hasattr(one.__globals__.get(name), "py_func") for one, name in names)


def _called(function: Function, done: dict[Any, None]) -> list[Function]:
    """A function and all that it calls."""
    done[function] = None
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, FunctionType) and value not in done:
            _called(value, done)
    return list(done)


def _place() -> Path:
    """Where code is kept: where numba would, beside the source, or where the user may write."""
    named = os.environ.get("NUMBA_CACHE_DIR")
    beside = Path(__file__).parent / "__pycache__"
    if named:
        return Path(named) / "contbreather"
    if os.access(beside if beside.exists() else beside.parent, os.W_OK):
        return beside
    home = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        return (Path(home) if home else Path.home() / ".cache") / "contbreather"
    except RuntimeError:  # a user without a home, as in a container: nothing is kept
        return beside


def _file(function: Function, kinds: str) -> Path:
    tag = f"{function.__name__}.{sys.implementation.cache_tag}"
    return _place() / f"{tag}-{_key(function, kinds)[:16]}.o"


def _keep(path: Path, text: bytes) -> None:
    """Write it in place of what was compiled of older texts."""
    with suppress(BadInput, OSError):  # nowhere to keep it: compiled in each session
        path.parent.mkdir(parents=True, exist_ok=True)
        for old in path.parent.glob(f"{path.name.partition('-')[0]}-*.o"):
            old.unlink()
        write_whole(path, lambda file: file.write(text))


def _read(path: Path) -> bytes | None:
    """What is kept, if it is whole: half an object would end the process."""
    try:
        text = path.read_bytes()
    except OSError:
        return None
    code = text[32:]
    return code if code and hashlib.sha256(code).digest() == text[:32] else None


# --- with numba ---------------------------------------------------------------------------------


def _made(function: Function, kinds: str) -> Any:
    try:
        from numba import cfunc, config, types
    except ImportError as error:
        raise NotCompiled(f"{error}; pip install numba") from error
    if getattr(config, "DISABLE_JIT", 0):
        raise NotCompiled("numba is switched off, by NUMBA_DISABLE_JIT")
    letters = {"p": types.CPointer(types.float64), "i": types.int64, "f": types.int64}
    signature = types.int64(*(letters[kind] for kind in kinds))
    plain = getattr(function, "py_func", None) or _twin(function, {}).py_func
    try:
        return cfunc(signature, error_model="numpy")(plain)
    except Exception as error:
        raise NotCompiled(" ".join(str(error).split())[:300]) from error


def _compiled(function: Function, kinds: str) -> bytes:
    """The name of its entry, what it needs, both with a line end, and the object code."""
    made = _made(function, kinds)
    text = made.inspect_llvm()
    needs = set(_NEEDED.findall(text))
    strange = sorted(one for one in needs if not _KNOWN.fullmatch(one) and one not in _NEVER)
    if strange:
        raise NotCompiled(f"{function.__name__} needs {strange} of numba")
    named = " ".join(sorted(one for one in needs if not one.startswith("llvm.")))
    return f"{made.native_name}\n{named}\n".encode() + _object(text)


def _twin(function: Function, done: dict[int, Any]) -> Any:
    """The function with compiled ones in place of those it calls; `call` takes an address."""
    from numba import njit

    if id(function) not in done:
        known = function.__globals__
        names = [name for name in function.__code__.co_names if name in known]
        scope = {name: known[name] for name in names}
        copy = FunctionType(function.__code__, scope, function.__name__)
        done[id(function)] = njit(error_model="numpy")(copy)
        for name in names:
            if known[name] is call:
                scope[name] = _by_address()
            elif isinstance(known[name], FunctionType):
                scope[name] = _twin(known[name], done)
    return done[id(function)]


@lru_cache(maxsize=1)
def _by_address() -> Any:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def by_address(context: Any, where: Any, one: Any, two: Any, three: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            kind = ir.FunctionType(ir.IntType(64), [one.type for one in args[1:]])
            return builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])

        pointer = types.CPointer(types.float64)
        return types.int64(types.int64, pointer, pointer, pointer), generate

    return by_address


# --- with llvmlite ------------------------------------------------------------------------------


def _target(**options: Any) -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(jit=True, **options)


def _object(text: str) -> bytes:
    import llvmlite.binding as llvm

    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = _target(cpu=cpu, features=features, opt=3, reloc="default", codemodel="jitdefault")
    made: bytes = machine.emit_object(llvm.parse_assembly(text))
    return made


def _load(code: bytes) -> tuple[int, Any]:
    import llvmlite.binding as llvm

    name, needs, body = code.split(b"\n", 2)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())  # finds what Python has
    somewhere = ctypes.cast(ctypes.pythonapi.PyErr_Clear, ctypes.c_void_p).value
    for need in needs.decode().split():
        if llvm.address_of_symbol(need) is None:
            if need not in _NEVER:
                raise NotCompiled(f"its machine code needs {need}, which this Python does not have")
            llvm.add_symbol(need, somewhere)
    engine.add_object_file(llvm.ObjectFileRef.from_data(body))
    engine.finalize_object()
    return engine.get_function_address(name.decode()), engine
