"""Machine code on disk: which object file is whose, and how it is loaded.

`compiler` makes one for each kernel when the package is installed; llvmlite alone loads them:
0.4 ms each, and 0.04 s for llvmlite, where to import numba takes 0.3 s. Each is called after the
text of its kernel, this processor and this Python, so that none is ever taken for another and
several may share a tree.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable
from functools import cache, lru_cache
from importlib.util import source_hash
from pathlib import Path
from types import FunctionType
from typing import Any

Function = Callable[..., Any]
INLINED: set[Any] = set()  # code of functions that is written out where these are called

OBJECTS = Path(__file__).parent / "_objects"
COMPILE = "python -m contbreather.compiler"

# What object code may refer to and never calls, as nothing is raised and no memory asked for. It
# has to be somewhere all the same: with one name missing the loader leaves all others at 0 without
# a word. numba names them itself, but when it compiles, not when it is imported.
NEVER = (
    "numba_gil_ensure",
    "numba_gil_release",
    "numba_unpickle",
    "numba_do_raise",
    "numba_runtime_build_excinfo_struct",
    "NRT_Free",
    "NRT_MemInfo_call_dtor",
)

_ONE_AT_A_TIME = threading.RLock()  # the loader does not like company of other threads


class NotCompiled(Exception):
    """There is no machine code of a function; carries the reason."""


def code_address(name: str) -> int:
    """Load the object file of this name; the address where its code begins. `NotCompiled` says that
    there is none, or that Python lacks what it needs."""
    with _ONE_AT_A_TIME:
        return _loaded(name)


# --- their names ----------------------------------------------------------------------------------


@lru_cache(maxsize=1)
def processor() -> str:
    """Hash of what code depends on besides its text: two processors of one name may differ in what
    their hosts let through."""
    import llvmlite.binding as llvm

    cpu = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return _hashed((llvm.get_process_triple(), *cpu, llvm.llvm_version_info, sys.version_info[:2]))


@lru_cache(maxsize=256)
def file_name(function: Function, takes: str) -> str:
    """Name of the object file of a function: for which processor, and of what text as it is in
    memory, with all else its code depends on."""
    contents = [_content(part) for part in called(function)]
    # 8: count on when something else is kept, or it is compiled otherwise
    text = _hashed((8, contents, takes))
    return f"{function.__name__}-{processor()}-{text}.o"


def _hashed(content: Any) -> str:
    # as .pyc files have it: hashlib loads all of OpenSSL, a thirtieth of a first breather
    return source_hash(repr(content).encode()).hex()


def _content(function: Function) -> tuple[Any, ...]:
    """Identify what is compiled of a function: not its text, which may have been edited since, and
    with the constants that it has from other modules."""
    code, scope = function.__code__, function.__globals__
    plain = float | int | tuple
    numbers = [(name, scope[name]) for name in code.co_names if isinstance(scope.get(name), plain)]
    named = function.__qualname__, code.co_names, code.co_varnames, code in INLINED
    return (*named, code.co_code, code.co_consts, numbers)


def called(function: Function, done: dict[Function, None] | None = None) -> list[Function]:
    done = {} if done is None else done
    done[function] = None
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, FunctionType) and value not in done:
            called(value, done)
    return list(done)


# --- object files ---------------------------------------------------------------------------------


def target(**options: Any) -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    native = llvm.Target.from_triple(llvm.get_process_triple())
    return native.create_target_machine(jit=True, **options)


@cache
def _engine() -> Any:
    """Keeper of machine code: one for all of it, for to make one takes longer than to load."""
    import llvmlite.binding as llvm

    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), target())  # finds Python's own


@cache
def _loaded(name: str) -> int:
    """The address of the entry of what `compiler` made."""
    import llvmlite.binding as llvm

    try:
        entry, needs, body = OBJECTS.joinpath(name).read_bytes().split(b"\n", 2)
    except FileNotFoundError:
        raise NotCompiled(f"no {name}; {COMPILE} makes it") from None
    except OSError as error:
        raise NotCompiled(f"{error}; {COMPILE} makes another") from error
    engine = _engine()
    somewhere = ctypes.cast(ctypes.pythonapi.PyErr_Clear, ctypes.c_void_p).value
    for need in needs.decode().split():
        if llvm.address_of_symbol(need) is None:
            if need not in NEVER:
                raise NotCompiled(f"its machine code needs {need}, which this Python does not have")
            llvm.add_symbol(need, somewhere)
    engine.add_object_file(llvm.ObjectFileRef.from_data(body))
    engine.finalize_object()
    address: int = engine.get_function_address(entry.decode())
    return address
