"""Hot loops, which are compiled: functions like any other, which as they are give the same bits,
only some hundred times slower. Where their machine code is `machine_code` knows.
"""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable, Iterable
from functools import cache, cached_property, lru_cache
from importlib import import_module
from types import FunctionType
from typing import Annotated, Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from contbreather import machine_code
from contbreather.machine_code import INLINED, Function, NotCompiled, at_hand

T = TypeVar("T")

# What kernels take, besides float, int, bool and NamedTuples of all these.
Vector = Annotated[NDArray[np.float64], "f8", 1]
Matrix = Annotated[NDArray[np.float64], "f8", 2]
Cube = Annotated[NDArray[np.float64], "f8", 3]
Counts = Annotated[NDArray[np.int64], "i8", 1]
Table = Annotated[NDArray[np.int64], "i8", 2]
Signs = Annotated[NDArray[np.int8], "i1", 1]

TEXTS = (  # the modules with kernels, each to be imported with nothing but numpy
    "contbreather.lattice.forcing",
    "contbreather.lattice.periodic_green",
    "contbreather.lattice.modal_flow",
    "contbreather.stability.band_pairs",
    "contbreather.stability.bordered",
    "contbreather.orbits.margins",
    "contbreather.orbits.site_motion",
    "contbreather.simulation.event_loop",
    "contbreather.simulation.smooth_flow",
)

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
    data : type, optional
        The NamedTuple that a function to `call` takes between two pointers.
    long : bool, optional
        A call takes so long that other threads have the interpreter in the meantime.

    Examples
    --------
    >>> from contbreather.orbits import margins
    >>> margins.MARGINS.function is margins.margins_along
    True
    """

    def __init__(
        self, function: Function, kinds: str = "", *, data: Any = None, long: bool = False
    ) -> None:
        self.function, self.kinds, self.data, self.long = function, kinds, data, long
        KERNELS.append(self)

    def __repr__(self) -> str:
        return f"<Kernel {self.function.__name__}>"

    @cached_property
    def takes(self) -> tuple[Shape, ...]:
        """What is handed over in words: its arguments, or the parts of its data."""
        annotated = self.data if self.kinds else self.function
        return () if annotated is None else _shapes(annotated)

    @cached_property
    def signature(self) -> str:
        return " ".join([self.kinds, *map(str, self.takes)])

    @property
    def file(self) -> str:
        """The name of its object file."""
        return machine_code.file_name(self.function, self.signature)

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
        frame = self.framed(values)
        code(_begin(frame))

    def framed(self, values: Iterable[Any]) -> NDArray[np.float64]:
        """What it takes in words of eight bytes."""
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
        frame = self.framed((0.0, *values))
        at = _begin(frame)

        # `keep`: the arrays, whose addresses are known
        def call_code(first: float, keep: Any = values) -> None:
            frame[0] = first
            code(at)

        return call_code


EQUATIONS = "ppp"  # kinds of functions to `call`


def listed(data: Any, *functions: Function) -> None:
    """Have them compiled with the package: for those that are handed over, not called by name."""
    for function in functions:
        Kernel(inlined(function), EQUATIONS, data=data)


def call(function: Any, z: Any, data: Any, out: Any) -> int:
    """Call a function that was handed over, of two arrays and what it asks for besides; compiled,
    by its address, of pointers to their beginnings and to the words of what it asks for."""
    answer: int = function(z, data, out)
    return answer


def inlined(function: Function) -> Function:
    """Written out where it is called: tuples of many arrays are dear to hand over."""
    INLINED.add(function.__code__)
    return function


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


FRAME = "p"  # where there are words that are i8, f8, and addresses of f8, i8 and i1
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


# --- their machine code ---------------------------------------------------------------------------


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
    unlisted.function, unlisted.kinds, unlisted.data = function, kinds, None
    return unlisted


def _address(kernel: Kernel) -> int:
    try:
        name = kernel.file
    except ImportError as error:
        raise NotCompiled(f"{error}; pip install numba") from error
    if kernel not in KERNELS and name not in at_hand().files:
        told = f"{kernel.function.__name__} is not among what is compiled with the package"
        raise NotCompiled(told)
    return machine_code.code_address(name)


def is_foreign(function: Function) -> bool:
    """Whether it was decorated with `numba.njit`, or calls what was."""
    if hasattr(function, "py_func"):
        return True
    names = (
        (part, name) for part in machine_code.called(function) for name in part.__code__.co_names
    )
    return any(hasattr(part.__globals__.get(name), "py_func") for part, name in names)


@cache
def _say(reason: str) -> None:
    import logging  # dear to import

    logging.getLogger("contbreather").info("goes on without compiled code: %s", reason)


def status() -> str:
    """Whether all of it is compiled, where it is, and why not."""
    for text in TEXTS:
        import_module(text)
    try:
        names = [kernel.file for kernel in KERNELS]
    except ImportError as error:
        return f"nothing is compiled: {error}; pip install numba"
    files = at_hand().files
    found = {name: machine_code.unusable(files[name]) for name in names if name in files}
    have = [files[name] for name, reason in found.items() if not reason]
    folders = ", ".join(sorted({str(path.parent) for path in have}))
    head = f"{len(have)} of {len(names)} loops are compiled" + (f", in {folders}" if have else "")
    lines = [head, *filter(None, found.values())]
    if len(found) < len(names):
        note = machine_code.OBJECTS / "reason.txt"  # which the installation left
        lines += [f"when it was installed: {note.read_text().strip()}"] if note.exists() else []
        lines.append(machine_code.why_missing(next(name for name in names if name not in files)))
    return "; ".join(lines)
