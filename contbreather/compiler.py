"""Compiles kernels by numba, at the installation: `python -m contbreather.compiler`.

Packages load nothing by themselves, so it takes nothing but numpy and numba: it works before what
else this package depends on is installed.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from importlib import import_module
from itertools import count
from multiprocessing import get_context
from types import FunctionType
from typing import Any

from contbreather import machine_code
from contbreather.files import write_whole
from contbreather.kernels import KERNELS, Kernel, Shape
from contbreather.machine_code import INLINED, NEVER, OBJECTS, Function, NotCompiled

TEXTS = (  # the modules with kernels, those with most code first; each imports but numpy
    "contbreather.orbits.closure_kernels",
    "contbreather.simulation.event_loop",
    "contbreather.orbits.margins",
    "contbreather.stability.bordered",
    "contbreather.stability.band_pairs",
    "contbreather.orbits.site_motion",
    "contbreather.lattice.periodic_green",
    "contbreather.simulation.smooth",
    "contbreather.lattice.modal_waves",
    "contbreather.lattice.modal_flow",
    "contbreather.lattice.forcing",
)
_KNOWN = re.compile(r"(llvm\.|_?Py).*|a?(sin|cos|tan)h?|atan2|sqrt|exp|expm1|log|pow|floor|mem\w+")
_NEEDED = re.compile(r'^(?:declare [^@]*)?@"?([^"(\s]+)"?(?:\(| = external)', re.MULTILINE)


def compile_all() -> list[str]:
    """Compile what is not there yet, kernel by kernel over the cores, and remove what is of older
    texts; why some are not compiled."""
    OBJECTS.mkdir(exist_ok=True)
    names = [*_kernels()]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        failed = [*filter(None, pool.map(compile_one, names))]
    for path in OBJECTS.glob(f"*-{machine_code.processor()}-*.o"):
        if path.name not in names:  # of an older text
            path.unlink()
    return failed


def compile_one(name: str) -> str:
    """Compile the kernel of this name, if it is not there; why not, or nothing. Kernels compiled in
    one process call the same functions."""
    path, kernel = OBJECTS / name, _kernels()[name]
    if path.exists():
        return ""
    try:
        code = object_of(kernel)
    except NotCompiled as reason:
        return f"{kernel.function.__name__}: {reason}"
    write_whole(path, lambda file: file.write(code))
    return ""


def status() -> str:
    """Say whether all kernels are compiled, where, why not, and what compiles the others."""
    try:
        names = _kernels()
    except ImportError as error:
        return f"nothing is compiled: {error}; pip install numba"
    folder = machine_code.OBJECTS
    there = sum((folder / name).exists() for name in names)
    said = f"{there} of {len(names)} loops are compiled"
    if there == len(names):
        return f"{said}, in {folder}"
    note = folder / "reason.txt"  # which the installation left
    why = f"when it was installed: {note.read_text().strip()}; " if note.exists() else ""
    return f"{said}; {why}{machine_code.COMPILE} compiles the others"


def _kernels() -> dict[str, Kernel]:
    """The kernels of all texts, by the names of their files."""
    for text in TEXTS:
        import_module(text)
    return {kernel.file: kernel for kernel in KERNELS if kernel.function.__module__ in TEXTS}


# --- one kernel -----------------------------------------------------------------------------------


def object_of(kernel: Kernel) -> bytes:
    """The name of its entry, what it needs, both with a line end, and the object code."""
    code = jitted(kernel)
    text = code.inspect_llvm()
    needs = set(_NEEDED.findall(text))
    # memory has nobody to give it, and to give it back: what asks for it is refused here
    strange = sorted(name for name in needs if not _KNOWN.fullmatch(name) and name not in NEVER)
    if strange:
        raise NotCompiled(f"{kernel.function.__name__} needs {strange} of numba")
    symbols = " ".join(sorted(name for name in needs if not name.startswith("llvm.")))
    return f"{kernel.file}\n{symbols}\n".encode() + _object(text, code.native_name, kernel.file)


def jitted(kernel: Kernel) -> Any:
    """Compile it by numba, in this process; `NotCompiled` without numba, or if it refuses."""
    try:
        from numba import cfunc, types

        signature = types.int64(types.CPointer(types.float64))
        return cfunc(signature, error_model="numpy")(_entry(kernel))
    except Exception as error:
        raise NotCompiled(" ".join(str(error).split())[:300]) from error


def _object(text: str, entry: str, name: str) -> bytes:
    """Emit object code that shows nothing but its entry, by this name: all objects are loaded into
    one place, and processes that compile number what they make alike."""
    import llvmlite.binding as llvm

    module = llvm.parse_assembly(text)
    for part in (*module.functions, *module.global_variables):
        if part.name == entry:
            part.name = name
        elif not part.is_declaration:
            part.linkage = "internal"
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = machine_code.target(
        cpu=cpu, features=features, opt=3, reloc="default", codemodel="jitdefault"
    )
    code: bytes = machine.emit_object(module)
    return code


@cache
def _twin(function: Function) -> Any:
    """The function with compiled ones in place of those it calls."""
    from numba import njit

    code, values = function.__code__, function.__globals__
    named = {name: values[name] for name in code.co_names if name in values}
    scope = {n: _twin(v) if isinstance(v, FunctionType) else v for n, v in named.items()}
    # nobody gives memory, or counts who has an array: with that left out tuples of arrays cost
    # nothing to hand over, and compile sooner
    how: dict[str, Any] = {"_nrt": False, "forceinline": code in INLINED}
    how |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return njit(error_model="numpy", **how)(FunctionType(code, scope, function.__name__))


def _entry(kernel: Kernel) -> Any:
    """A function of the address of some words, which makes numbers, arrays and tuples of them."""
    import numba
    from numba import types

    carray: Any = numba.carray  # type: ignore[attr-defined]
    scope: dict[str, Any] = {"carray": carray, "function": _twin(kernel.function)}
    scope["as_i8"] = _pointer_to(types.int64)
    lines = ["i8 = as_i8(f8)"]
    for name in ("f8", "c16", "i8", "i1"):
        scope[f"as_{name}s"] = _pointer_to(types.CPointer(getattr(types, name)))
        lines.append(f"{name}s = as_{name}s(f8)")
    words = count()
    arguments = ", ".join(_argument(shape, words, scope) for shape in kernel.takes)
    body = "\n    ".join([*lines, f"function({arguments})", "return 0"])
    exec(f"def entry(f8):\n    {body}\n", scope)
    return scope["entry"]


def _pointer_to(kind: Any) -> Any:
    """A function for kernels that takes an address for that of something of this kind."""
    from numba import types
    from numba.extending import intrinsic

    pointer = types.CPointer(kind)

    def pointed(_: Any, where: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.bitcast(args[0], context.get_value_type(pointer))

        return pointer(where), generate

    return intrinsic(pointed)


def _argument(shape: Shape, words: Iterator[int], scope: dict[str, Any]) -> str:
    """Write out as text an argument made of the next words."""
    if shape.made_by:
        scope[shape.made_by.__name__] = shape.made_by
        parts = ", ".join(_argument(part, words, scope) for part in shape.parts)
        return f"{shape.made_by.__name__}({parts})"
    first = next(words)
    if not shape.axes:
        return {"f8": f"f8[{first}]", "i8": f"i8[{first}]", "b1": f"i8[{first}] != 0"}[shape.kind]
    lengths = "".join(f"i8[{next(words)}], " for _ in range(shape.axes))
    return f"carray({shape.kind}s[{first}], ({lengths}))"


if __name__ == "__main__":
    print(*compile_all(), sep="\n")
