"""Machine code on disk: where object files are, which is whose, what is loaded, and what is begun
where there is none.

They are compiled when the package is installed (`compiler`), one for each function, and loaded by
llvmlite alone: 0.4 ms each, and 0.04 s for llvmlite, where to import numba and begin takes 0.5 s.
What is at hand is looked up once: what a process computes with never changes. Where there is
nothing for this processor, the first process to miss it starts the compiler, far behind everything
else, for later ones; nobody ever waits for it.
"""

from __future__ import annotations

import ctypes
import os
import stat
import sys
import threading
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache, lru_cache
from importlib.util import find_spec, source_hash
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

Function = Callable[..., Any]
INLINED: set[Any] = set()  # code of functions that is written out where these are called

OBJECTS = Path(__file__).parent / "_objects"  # what was compiled when the package was installed
COMPILER = (sys.executable, "-m", "contbreather.compiler")  # takes a folder; from HOME
HOME = Path(__file__).parents[1]
ASKED = "CONTBREATHER_COMPILE"  # in the environment; 0: nothing is compiled unless somebody asks

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

SEAL = 4  # bytes before the code that tell whether it is whole
_FORMAT = 7  # of what is kept, and of how it is compiled
_OTHERS = stat.S_IWGRP | stat.S_IWOTH  # who might write besides the owner
_ONE_AT_A_TIME = threading.RLock()  # neither compiler nor loader likes company of other threads
_loaded: dict[str, int] = {}  # by file: the address
_started: list[Any] = []  # the compiler, where this process has started it


class NotCompiled(Exception):
    """There is no machine code of a function; carries the reason."""


# --- what is at hand ------------------------------------------------------------------------------


def code_address(name: str) -> int:
    """Where the code in the object file of this name begins.

    Raises
    ------
    NotCompiled
        If there is none, with the reason and what is done about it.
    """
    with _ONE_AT_A_TIME:
        if name not in _loaded:
            path = at_hand().files.get(name)
            if path is None:
                raise NotCompiled(why_missing(name))
            _loaded[name] = load_object(read_object(path))
    return _loaded[name]


class AtHand(NamedTuple):
    """The object files that may be loaded, by name, and why others may not."""

    files: dict[str, Path]
    refused: tuple[str, ...]


@cache
def at_hand() -> AtHand:
    """What there is when it is asked for first: later it is the same, whatever happens on disk."""
    files: dict[str, Path] = {}
    refused = []
    for folder in (cache_directory(), OBJECTS):
        if folder is None or not folder.is_dir():
            continue
        reason = distrust(folder)
        if reason:
            refused.append(reason)
            continue
        files.update((path.name, path) for path in folder.glob("*.o"))
    return AtHand(files, tuple(refused))


def cache_directory() -> Path | None:
    """Where code is kept that was compiled later than at the installation; None without a home."""
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        if os.environ.get(name):
            return Path(os.environ[name]) / "contbreather"
    try:
        return Path.home() / ".cache" / "contbreather"
    except RuntimeError:
        return None


def distrust(path: Path) -> str:
    """Why machine code in a folder, or a file, may be another user's; empty if it is not."""
    try:
        inode = path.lstat()
    except OSError as error:
        return f"{path} cannot be looked at: {error.strerror}"
    return _distrust(path, inode)


def _distrust(path: Path, inode: os.stat_result) -> str:
    if not hasattr(os, "geteuid"):  # Windows: homes and installations are their owners'
        return ""
    if stat.S_ISLNK(inode.st_mode):
        return f"{path} is a link; machine code is taken from where it is only"
    if inode.st_uid not in (0, os.geteuid()):
        return f"{path} belongs to another user (number {inode.st_uid}); remove it"
    open_to = inode.st_mode & _OTHERS
    if open_to and not (open_to == stat.S_IWGRP and _own_group(inode.st_uid, inode.st_gid)):
        return f"others may write to {path}; chmod go-w it, or remove it"
    return ""


def _own_group(user: int, group: int) -> bool:
    """Whether a group has this user alone, as many systems make one for each."""
    import grp
    import pwd

    try:
        who, group_entry = pwd.getpwuid(user), grp.getgrgid(group)
    except KeyError:
        return False
    return (
        who.pw_gid == group
        and who.pw_name == group_entry.gr_name
        and not set(group_entry.gr_mem) - {who.pw_name}
    )


@lru_cache(maxsize=1)
def processor() -> tuple[Any, ...]:
    """What code depends on besides its text: two processors of one name may differ in what their
    hosts let through."""
    import llvmlite.binding as llvm

    cpu = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return (llvm.get_process_triple(), *cpu, llvm.llvm_version_info, sys.version_info[:2])


def file_name(function: Function, kinds: str) -> str:
    """Of the object file of a function: of all texts on one machine it begins alike."""
    begin = f"{function.__name__}.{sys.implementation.cache_tag}.{_digest(processor())[:8]}"
    return f"{begin}-{_key(function, kinds)}.o"


@lru_cache(maxsize=256)
def _key(function: Function, kinds: str) -> str:
    """A name for a function as it is in memory and for all else that its code depends on."""
    contents = [_content(part) for part in called(function)]
    return _digest((_FORMAT, contents, kinds, processor()))


def _digest(value: tuple[Any, ...]) -> str:
    # as .pyc files have it: hashlib loads all of OpenSSL, a thirtieth of a first breather
    return source_hash(repr(value).encode()).hex()


def _content(function: Function) -> tuple[Any, ...]:
    """What is compiled of a function: not its text, which may have been edited since, and with the
    constants that it has from other modules."""
    code, scope = function.__code__, function.__globals__
    plain = float | int | tuple
    numbers = [(name, scope[name]) for name in code.co_names if isinstance(scope.get(name), plain)]
    named = function.__qualname__, code.co_names, code.co_varnames, code in INLINED
    return (*named, code.co_code, code.co_consts, numbers)


def called(function: Function, done: dict[Function, None] | None = None) -> list[Function]:
    """A function and all that it calls."""
    done = {} if done is None else done
    done[function] = None
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, FunctionType) and value not in done:
            called(value, done)
    return list(done)


# --- object files ---------------------------------------------------------------------------------


def read_object(path: Path) -> bytes:
    """An object that is whole and nobody else's: half of one would end the process.

    Raises
    ------
    NotCompiled
        If it is not.
    """
    try:
        # what is looked at is what is read
        with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0)), "rb") as file:
            reason = _distrust(path, os.fstat(file.fileno()))
            text = file.read()
    except OSError as error:
        raise NotCompiled(f"{path} cannot be read: {error.strerror}; remove it") from error
    if reason:
        raise NotCompiled(reason)
    code = text[SEAL:]
    if sealed(code) != text:
        raise NotCompiled(f"{path} is not what was written there; remove it")
    return code


def unusable(path: Path) -> str:
    """Why an object cannot be loaded; empty if it can."""
    try:
        read_object(path)
    except NotCompiled as reason:
        return str(reason)
    return ""


def sealed(code: bytes) -> bytes:
    """With a checksum before it."""
    return zlib.crc32(code).to_bytes(SEAL, "little") + code


def target(**options: Any) -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    native = llvm.Target.from_triple(llvm.get_process_triple())
    return native.create_target_machine(jit=True, **options)


@cache
def _engine() -> Any:
    """What keeps machine code: one for all of it, for to make one takes longer than to load."""
    import llvmlite.binding as llvm

    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), target())  # finds Python's own


def load_object(code: bytes) -> int:
    """The address of the entry of what `compiler` made."""
    import llvmlite.binding as llvm

    name, needs, body = code.split(b"\n", 2)
    engine = _engine()
    somewhere = ctypes.cast(ctypes.pythonapi.PyErr_Clear, ctypes.c_void_p).value
    for need in needs.decode().split():
        if llvm.address_of_symbol(need) is None:
            if need not in NEVER:
                raise NotCompiled(f"its machine code needs {need}, which this Python does not have")
            llvm.add_symbol(need, somewhere)
    engine.add_object_file(llvm.ObjectFileRef.from_data(body))
    engine.finalize_object()
    address: int = engine.get_function_address(name.decode())
    return address


# --- what is not ----------------------------------------------------------------------------------


def workers_process() -> bool:
    """Whether this process works for another one."""
    module = sys.modules.get("multiprocessing.process")  # by then a worker has it
    return module is not None and module.parent_process() is not None


def why_missing(name: str) -> str:
    """Why there is no such file, and what is done about it: the compiler is started, once."""
    folder = cache_directory()
    if folder is not None and not distrust(folder):
        with suppress(OSError):
            note = folder / f"{name}.failed"
            return f"the compiler failed: {note.read_text()}; remove {note} to have it try again"
    refused = "".join(f"{reason}; " for reason in at_hand().refused)
    return f"{refused}no machine code for this processor, Python and text; {_begun()}"


@cache
def _begun() -> str:
    """What becomes of what is missing."""
    from contbreather.files import alone

    folder = cache_directory()
    if os.environ.get(ASKED) == "0":
        return f"nothing is compiled, by {ASKED}=0"
    if workers_process():
        return "worker processes compile nothing"
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return "numba is switched off, by NUMBA_DISABLE_JIT"
    if find_spec("numba") is None:
        return "there is no numba to make it with; pip install numba"
    if folder is None:
        return "without a home there is no place for it; NUMBA_CACHE_DIR names one"
    try:
        folder.mkdir(mode=0o755, parents=True, exist_ok=True)
        with (folder / "lock").open("ab") as file:
            free = alone(file.fileno())
    except OSError as error:
        return f"it cannot be kept in {folder}: {error.strerror}"
    if free:
        _start(folder)
    return f"it is being compiled, for later, into {folder}"


def _start(folder: Path) -> None:
    """The compiler, in a process that outlives this one and lets all others go first."""
    import subprocess

    nowhere: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    how = {**nowhere, "cwd": HOME, "start_new_session": True}
    with suppress(OSError):
        _started.append(subprocess.Popen([*COMPILER, str(folder.absolute()), "--behind"], **how))
