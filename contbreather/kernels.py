"""Hot loops, which are compiled: functions like any other, which as they are give the same bits,
only some hundred times slower. `machine_code` finds what `compiler` has made of them.
"""

from __future__ import annotations

import ctypes
import logging
import struct
from collections.abc import Callable, Iterable
from functools import cache, cached_property, lru_cache
from typing import Annotated, Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from contbreather import machine_code
from contbreather.machine_code import INLINED, Function, NotCompiled

T = TypeVar("T")

# What kernels take, besides float, int, bool and NamedTuples of all these.
Vector = Annotated[NDArray[np.float64], "f8", 1]
Matrix = Annotated[NDArray[np.float64], "f8", 2]
Cube = Annotated[NDArray[np.float64], "f8", 3]
ComplexVector = Annotated[NDArray[np.complex128], "c16", 1]
ComplexMatrix = Annotated[NDArray[np.complex128], "c16", 2]
Counts = Annotated[NDArray[np.int64], "i8", 1]
Table = Annotated[NDArray[np.int64], "i8", 2]
Signs = Annotated[NDArray[np.int8], "i1", 1]

KERNELS: list[Kernel] = []  # all that were imported
FIXED: set[Any] = set()


class Kernel:
    """A function that is compiled when the package is installed.

    Parameters
    ----------
    function : callable
        Its arguments are annotated as above. Its globals are constants, `math`, NamedTuples, and
        functions like it; it returns nothing and asks for no memory, and neither it nor what it
        calls raises anything.
    long : bool, optional
        A call takes so long that other threads have the interpreter in the meantime.

    Examples
    --------
    >>> from contbreather.orbits import margins
    >>> margins.MARGINS.function is margins.margins_along
    True
    """

    def __init__(self, function: Function, *, long: bool = False) -> None:
        self.function, self.long = function, long
        KERNELS.append(self)

    def __repr__(self) -> str:
        return f"<Kernel {self.function.__name__}>"

    @cached_property
    def takes(self) -> tuple[Shape, ...]:
        """Arguments, as they are handed over in words."""
        return _shapes(self.function)

    @property
    def file(self) -> str:
        return machine_code.file_name(self.function, " ".join(map(str, self.takes)))

    @cached_property
    def code(self) -> Function | None:
        """The machine code, to be called with an address; None where there is none."""
        try:
            at = machine_code.code_address(self.file)
        except (NotCompiled, ImportError) as reason:
            _say(str(reason))
            return None
        # most calls are too short to be worth handing the interpreter to other threads
        kind = ctypes.CFUNCTYPE if self.long else ctypes.PYFUNCTYPE
        return kind(ctypes.c_int64, ctypes.c_void_p)(at)

    def __call__(self, *values: Any) -> None:
        """By machine code, or as it is: the same bits."""
        if self.code is None:
            self.as_it_is(*values)
        else:
            frame = self.framed(values)  # has a name: without one it is gone before the call
            self.code(_begin(frame))

    def as_it_is(self, *values: Any) -> None:
        with np.errstate(all="ignore"):  # machine code goes on with an infinity
            self.function(*values)

    def framed(self, values: Iterable[Any]) -> NDArray[np.float64]:
        """Arguments in words of eight bytes."""
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
        """Bind all arguments but the first, a number: these are looked up once."""
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


def inlined(function: Function) -> Function:
    """Written out where it is called: tuples of many arrays are dear to hand over."""
    INLINED.add(function.__code__)
    return function


def fixed(kind: T) -> T:
    """A NamedTuple whose makers hand the same one over many times: looked up once."""
    FIXED.add(kind)
    return kind


@cache
def _say(reason: str) -> None:
    logging.getLogger("contbreather").info("goes on without compiled code: %s", reason)


# --- arrays and tuples as numbers -----------------------------------------------------------------


class Shape(NamedTuple):
    """Kind of an argument: a number f8, i8 or b1, an array of `axes`, or a tuple of `parts`."""

    name: str
    kind: str
    axes: int = 0
    parts: tuple[Any, ...] = ()
    made_by: Any = None

    def __str__(self) -> str:
        inner = f"({' '.join(map(str, self.parts))})" if self.made_by else self.kind
        return f"{self.name}:{inner}{self.axes or ''}"


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


@lru_cache(maxsize=64)
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
        entry = _words_of[id(value)] = value, _reader(shape.parts)(*value)
    return entry[1]
