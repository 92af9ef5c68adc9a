"""Machine code of hot loops: functions like any other, which as they are give the same bits, only
some hundred times slower.

They are compiled when the package is installed (`compiler`), an object file each, and loaded by
llvmlite alone: 0.4 ms each, and 0.04 s for llvmlite, where to import numba and begin takes 0.5 s.
What is at hand is looked up once: what a process computes with never changes. Where there is
nothing for this processor, the first process to miss it starts the compiler, far behind everything
else, for later ones; nobody ever waits for it.
"""

from __future__ import annotations

import ctypes
import os
import stat
import struct
import sys
import threading
import zlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, cached_property, lru_cache
from importlib import import_module
from importlib.util import find_spec, source_hash
from pathlib import Path
from types import FunctionType
from typing import Annotated, Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

Function = Callable[..., Any]
T = TypeVar("T")

# What kernels take, besides float, int, bool and NamedTuples of all these.
Vector = Annotated[NDArray[np.float64], "f8", 1]
Matrix = Annotated[NDArray[np.float64], "f8", 2]
Cube = Annotated[NDArray[np.float64], "f8", 3]
Counts = Annotated[NDArray[np.int64], "i8", 1]
Table = Annotated[NDArray[np.int64], "i8", 2]
Signs = Annotated[NDArray[np.int8], "i1", 1]

OBJECTS = Path(__file__).parent / "_objects"  # what was compiled when the package was installed
COMPILER = (sys.executable, "-m", "contbreather.compiler")  # takes a folder; from HOME
HOME = Path(__file__).parents[1]
ASKED = "CONTBREATHER_COMPILE"  # in the environment; 0: nothing is compiled unless somebody asks
TEXTS = (  # the modules with kernels, each to be imported with nothing but numpy
    "contbreather.continuation.step",
    "contbreather.lattice.periodic_green",
    "contbreather.lattice.modal_flow",
    "contbreather.stability.band_pairs",
    "contbreather.stability.bordered",
    "contbreather.orbits.closure_kernels",
    "contbreather.orbits.margins",
    "contbreather.simulation.event_loop",
    "contbreather.simulation.smooth_flow",
)

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
_FORMAT = 6  # of what is kept, and of how it is compiled
_OTHERS = stat.S_IWGRP | stat.S_IWOTH  # who might write besides the owner
_ONE_AT_A_TIME = threading.RLock()  # neither compiler nor loader likes company of other threads
_loaded: dict[str, int] = {}  # by file: the address
_started: list[Any] = []  # the compiler, where this process has started it


class NotCompiled(Exception):
    """There is no machine code of a function; carries the reason."""


# --- functions that are compiled ------------------------------------------------------------------

KERNELS: list[Kernel] = []  # all there are


class Kernel:
    """A function that is compiled when the package is installed.

    Parameters
    ----------
    function : callable
        Its globals are constants, `math`, NamedTuples, `call`, and functions like it; it asks for
        no memory, and neither it nor what it calls raises anything.
    kinds : str, optional
        A letter p for each argument, where all are pointers to floats, as of functions to `call`;
        it returns an int. Unless given, arguments are those of the annotations, and it returns
        nothing.
    long : bool, optional
        A call takes so long that other threads have the interpreter in the meantime.

    Examples
    --------
    >>> from contbreather.orbits import margins
    >>> margins.MARGINS.function is margins.margins_along
    True
    """

    def __init__(self, function: Function, kinds: str = "", *, long: bool = False) -> None:
        self.function, self.kinds, self.long = function, kinds, long
        KERNELS.append(self)

    def __repr__(self) -> str:
        return f"<Kernel {self.function.__name__}>"

    @cached_property
    def takes(self) -> tuple[Shape, ...]:
        """What its arguments are, if the annotations say so."""
        return () if self.kinds else _shapes(self.function)

    @cached_property
    def signature(self) -> str:
        return self.kinds or " ".join(map(str, self.takes))

    @cached_property
    def code(self) -> Function | None:
        """The machine code, to be called with addresses; None where there is none."""
        try:
            return callable_at(_address(self), self.kinds or FRAME, self.long)
        except NotCompiled as reason:
            _say(str(reason))
            return None

    def __call__(self, *values: Any) -> None:
        """By machine code, or as it is: the same bits."""
        if self.code is None:
            self.as_it_is(*values)
        else:
            self.run(self.code, values)

    def as_it_is(self, *values: Any) -> None:
        with np.errstate(all="ignore"):  # machine code goes on with an infinity
            self.function(*values)

    def run(self, code: Function, values: Iterable[Any]) -> None:
        """By machine code of it."""
        frame = self._framed(values)
        code(*len(FRAME) * [_begin(frame)])

    def _framed(self, values: Iterable[Any]) -> NDArray[np.float64]:
        """Its arguments in words of eight bytes."""
        words = self._reader(*values)
        frame = np.empty(len(words))
        self._struct.pack_into(frame.data, 0, *words)
        return frame

    @cached_property
    def _reader(self) -> Callable[..., list[Any]]:
        return _reader(self.takes)

    @cached_property
    def _struct(self) -> struct.Struct:
        return struct.Struct("".join(map(_letters, self.takes)))

    def following(self, *values: Any) -> Callable[[float], None]:
        """The same, of its first argument, a number, with all others given: these are looked up
        once."""
        code = self.code
        if code is None:
            return lambda first: self.as_it_is(first, *values)
        frame = self._framed((0.0, *values))
        at = len(FRAME) * [_begin(frame)]

        def go(first: float, keep: Any = values) -> None:  # the arrays, whose addresses are known
            frame[0] = first
            code(*at)

        return go


def listed(kinds: str, *functions: Function) -> None:
    """Have them compiled with the package: for those that are handed over, not called by name."""
    for function in functions:
        Kernel(function, kinds)


def call(function: Any, z: Any, data: Any, out: Any) -> int:
    """Call a function of three arrays that was handed over; compiled, by its address, of pointers
    to their beginnings."""
    answer: int = function(z, data, out)
    return answer


def inlined(function: Function) -> Function:
    """Written out where it is called: tuples of many arrays are dear to hand over."""
    INLINED.add(function.__code__)
    return function


INLINED: set[Any] = set()


def fixed(kind: T) -> T:
    """A NamedTuple whose makers hand the same one over many times: looked up once."""
    FIXED.add(kind)
    return kind


FIXED: set[Any] = set()


@lru_cache(maxsize=256)
def bound(function: Function, **names: Any) -> Function:
    """A function with other globals, also in what it calls in its module; the same each time."""
    return _bound(function, tuple(names.items()), {})


def _bound(function: Function, names: Any, done: dict[Any, Any]) -> Any:
    if function not in done:
        values = function.__globals__
        text = "_".join(getattr(value, "__qualname__", str(value)) for _, value in names)
        scope = {name: values[name] for name in function.__code__.co_names if name in values}
        copy = FunctionType(function.__code__, scope, f"{function.__name__}_{text}")
        copy.__module__, copy.__qualname__ = function.__module__, f"{function.__qualname__}_{text}"
        done[function] = copy
        for name, value in scope.items():
            if isinstance(value, FunctionType) and value.__module__ == function.__module__:
                scope[name] = _bound(value, names, done)
        scope.update({name: value for name, value in names if name in scope})
    return done[function]


# --- arrays and tuples as numbers -----------------------------------------------------------------


class Shape(NamedTuple):
    """What an argument is: a number f8, i8 or b1, an array of `axes`, or a tuple of `parts`."""

    name: str
    kind: str
    axes: int = 0
    parts: tuple[Any, ...] = ()
    made_by: Any = None

    def __str__(self) -> str:
        inner = f"({' '.join(map(str, self.parts))})" if self.made_by else self.kind
        return f"{self.name}:{inner}{self.axes or ''}"


FRAME = 5 * "p"  # one address, of words that are i8, f8, and addresses of f8, i8 and i1
_PLAIN = {float: "f8", int: "i8", bool: "b1"}


@cache  # kernels have tuples in common
def _shapes(annotated: Any) -> tuple[Shape, ...]:
    hints = get_type_hints(annotated, include_extras=True)
    hints.pop("return", None)
    return tuple(_shape(name, hint) for name, hint in hints.items())


def _shape(name: str, hint: Any) -> Shape:
    if hint in _PLAIN:
        return Shape(name, _PLAIN[hint])
    if hasattr(hint, "__metadata__"):
        return Shape(name, *hint.__metadata__)
    return Shape(name, "", parts=_shapes(hint), made_by=hint)


def _letters(shape: Shape) -> str:
    """One for each of its words, for `struct`."""
    if shape.made_by:
        return "".join(map(_letters, shape.parts))
    return (1 + shape.axes) * "q" if shape.axes or shape.kind != "f8" else "d"


def _reader(shapes: tuple[Shape, ...]) -> Callable[..., list[Any]]:
    """Words of arguments, numbers, and of arrays addresses and lengths: written out as one list, as
    a loop over them takes longer than many a kernel."""
    scope: dict[str, Any] = {"array": _of_array, "fixed": _of_fixed}
    words = ", ".join(_reading(shape, shape.name, scope) for shape in shapes)
    names = ", ".join(shape.name for shape in shapes)
    reader: Callable[..., list[Any]] = eval(f"lambda {names}: [{words}]", scope)
    return reader


def _reading(shape: Shape, path: str, scope: dict[str, Any]) -> str:
    scope[name := f"shape{len(scope)}"] = shape
    if shape.axes:
        return f"*array({path}, {name})"
    if shape.made_by in FIXED:
        return f"*fixed({path}, {name})"
    if shape.made_by:
        return ", ".join(_reading(part, f"{path}.{part.name}", scope) for part in shape.parts)
    return path


def _of_array(array: NDArray[Any], shape: Shape) -> tuple[int, ...]:
    lengths = array.shape
    if len(lengths) != shape.axes or array.dtype != shape.kind or not array.flags.c_contiguous:
        raise TypeError(
            f"{shape.name} is {array.dtype} {lengths}; {shape.kind} with {shape.axes} axes, row by "
            "row, was expected"
        )
    return _begin(array), *lengths


# sooner than by `array.ctypes`, and half of that was to look them up
_address_of, _view = ctypes.addressof, ctypes.c_char.from_buffer


def _begin(array: NDArray[Any]) -> int:
    if not array.size:
        return 0
    try:
        return _address_of(_view(array))  # type: ignore[arg-type]
    except TypeError:  # not to be written to
        return array.ctypes.data


_words_of: dict[int, tuple[Any, list[Any]]] = {}  # by where a tuple is, as long as it is here


def _of_fixed(value: Any, shape: Shape) -> list[Any]:
    entry = _words_of.get(id(value))
    if entry is None:
        if len(_words_of) >= 64:
            _words_of.clear()
        entry = _words_of[id(value)] = value, _reader_of(shape.parts)(*value)
    return entry[1]


_reader_of = lru_cache(maxsize=64)(_reader)


# --- what is at hand ------------------------------------------------------------------------------


def address(function: Function, kinds: str) -> int:
    """Where the machine code of a function begins, by the kinds of its arguments.

    Raises
    ------
    NotCompiled
        If there is none, with the reason.
    """
    return _address(kernel_of(function, kinds))


def callable_at(address: int, kinds: str, long: bool = False) -> Callable[..., int]:
    """Machine code, to be called with addresses."""
    pointers = len(kinds) * [ctypes.c_void_p]
    # most calls are too short to be worth handing the interpreter to other threads
    kind = ctypes.CFUNCTYPE if long else ctypes.PYFUNCTYPE
    return kind(ctypes.c_int64, *pointers)(address)


def kernel_of(function: Function, kinds: str) -> Kernel:
    for kernel in KERNELS:
        if kernel.function is function and kernel.kinds == kinds:
            return kernel
    unlisted = object.__new__(Kernel)
    unlisted.function, unlisted.kinds = function, kinds
    return unlisted


def _address(kernel: Kernel) -> int:
    try:
        name = file_name(kernel)
    except ImportError as error:
        raise NotCompiled(f"{error}; pip install numba") from error
    with _ONE_AT_A_TIME:
        if name not in _loaded:
            path = at_hand().files.get(name)
            if path is None:
                raise NotCompiled(_missing(kernel, name))
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
    for folder in (place(), OBJECTS):
        if folder is None or not folder.is_dir():
            continue
        reason = distrust(folder)
        if reason:
            refused.append(reason)
            continue
        files.update((path.name, path) for path in folder.glob("*.o"))
    return AtHand(files, tuple(refused))


def place() -> Path | None:
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


def file_name(kernel: Kernel) -> str:
    """Of its object file: of all texts on one machine it begins alike."""
    begin = f"{kernel.function.__name__}.{sys.implementation.cache_tag}.{_digest(processor())[:8]}"
    return f"{begin}-{_key(kernel.function, kernel.signature)}.o"


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


def is_foreign(function: Function) -> bool:
    """Whether it was decorated with `numba.njit`, or calls what was."""
    if hasattr(function, "py_func"):
        return True
    names = ((part, name) for part in called(function) for name in part.__code__.co_names)
    return any(hasattr(part.__globals__.get(name), "py_func") for part, name in names)


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


def _missing(kernel: Kernel, name: str) -> str:
    """Why there is no such file, and what is done about it: the compiler is started, once."""
    if kernel not in KERNELS:
        return f"{kernel.function.__name__} is not among what is compiled with the package"
    folder = place()
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

    folder = place()
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


@cache
def _say(reason: str) -> None:
    import logging  # dear to import

    logging.getLogger("contbreather").info("goes on without compiled code: %s", reason)


def status() -> str:
    """Whether all of it is compiled, where it is, and why not."""
    for text in TEXTS:
        import_module(text)
    try:
        names = [file_name(kernel) for kernel in KERNELS]
    except ImportError as error:
        return f"nothing is compiled: {error}; pip install numba"
    files = at_hand().files
    have = [files[name] for name in names if name in files]
    folders = ", ".join(sorted({str(path.parent) for path in have}))
    head = f"{len(have)} of {len(names)} loops are compiled" + (f", in {folders}" if have else "")
    lines = [head, *(reason for path in have for reason in [_unusable(path)] if reason)]
    if len(have) < len(names):
        note = OBJECTS / "reason.txt"  # which the installation left
        lines += [f"when it was installed: {note.read_text().strip()}"] if note.exists() else []
        lacks = next(kernel for kernel in KERNELS if file_name(kernel) not in files)
        lines.append(_missing(lacks, file_name(lacks)))
    return "; ".join(lines)


def _unusable(path: Path) -> str:
    try:
        read_object(path)
    except NotCompiled as reason:
        return str(reason)
    return ""
