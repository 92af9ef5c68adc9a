"""Compiles kernels by numba: all of them, side by side, at the installation or behind a session;
and functions of a user, at once.

    python -m contbreather.compiler FOLDER [--behind]

Packages load nothing by themselves, so it takes nothing but numpy and numba: it works before what
else this package depends on is installed, and begins at once.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from importlib import import_module
from itertools import count, groupby
from pathlib import Path
from types import FunctionType
from typing import Any

from contbreather import kernels, machine_code
from contbreather.files import alone, write_whole
from contbreather.kernels import Kernel, Shape, call
from contbreather.machine_code import INLINED, NEVER, NotCompiled

KEPT = 3  # texts of a kernel on one machine: as many checkouts do not drive each other's code out
BEHIND = 19  # of `nice`
_KNOWN = re.compile(r"(llvm\.|_?Py).*|a?(sin|cos|tan)h?|atan2|sqrt|exp|log|pow|floor|mem\w+")
_NEEDED = re.compile(r'^(?:declare [^@]*)?@"?([^"(\s]+)"?(?:\(| = external)', re.MULTILINE)

_made: dict[tuple[Any, str], Any] = {}  # in this session, by function and kinds


# --- one kernel -----------------------------------------------------------------------------------


def compiled_address(function: Callable[..., Any], kinds: str) -> int:
    """Where its machine code begins: what is at hand, or what is compiled for this session.

    Raises
    ------
    NotCompiled
        Without numba, or if it refuses.
    """
    if not kernels.is_foreign(function):
        try:
            return kernels.address(function, kinds)
        except NotCompiled:
            pass
    if (function, kinds) not in _made:
        _made[function, kinds] = jitted(kernels.kernel_of(function, kinds))
    pointer: int = _made[function, kinds].address
    return pointer


def jitted(kernel: Kernel) -> Any:
    """What numba makes of it, in this process.

    Raises
    ------
    NotCompiled
        Without numba, or if it refuses.
    """
    try:
        from numba import cfunc, config, types
    except ImportError as error:
        raise NotCompiled(f"{error}; pip install numba") from error
    if getattr(config, "DISABLE_JIT", 0):
        raise NotCompiled("numba is switched off, by NUMBA_DISABLE_JIT")
    try:
        pointers = len(kernel.kinds or kernels.FRAME) * [types.CPointer(types.float64)]
        signature = types.int64(*pointers)
        if kernel.takes:
            plain = _entry(kernel)
        else:
            plain = getattr(kernel.function, "py_func", None) or _twin(kernel.function).py_func
        return cfunc(signature, error_model="numpy")(plain)
    except Exception as error:
        raise NotCompiled(" ".join(str(error).split())[:300]) from error


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
    name = kernel.file
    return f"{name}\n{symbols}\n".encode() + _object(text, code.native_name, name)


def _object(text: str, entry: str, name: str) -> bytes:
    """With nothing that others see but its entry, by this name: all objects are loaded into one
    place, and processes that compile number what they make alike."""
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


_TWINS: dict[Any, Any] = {}


def _twin(function: Callable[..., Any]) -> Any:
    """The function with compiled ones in place of those it calls; `call` takes an address."""
    from numba import njit

    if function not in _TWINS:
        values = function.__globals__
        names = [name for name in function.__code__.co_names if name in values]
        scope = {name: values[name] for name in names}
        copy = FunctionType(function.__code__, scope, function.__name__)
        # nobody gives memory, or counts who has an array: with that left out tuples of arrays cost
        # nothing to hand over, and compile sooner
        how: dict[str, Any] = {"_nrt": False, "forceinline": function.__code__ in INLINED}
        how |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        _TWINS[function] = njit(error_model="numpy", **how)(copy)
        for name in names:
            if values[name] is call:
                scope[name] = _by_address()
            elif isinstance(values[name], FunctionType):
                scope[name] = _twin(values[name])
    return _TWINS[function]


@lru_cache(maxsize=1)
def _by_address() -> Any:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def by_address(context: Any, where: Any, z: Any, data: Any, out: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            arrays = zip(signature.args[1:], args[1:], strict=True)
            at = [context.make_array(kind)(context, builder, value).data for kind, value in arrays]
            kind = ir.FunctionType(ir.IntType(64), [pointer.type for pointer in at])
            return builder.call(builder.inttoptr(args[0], kind.as_pointer()), at)

        return types.int64(types.int64, z, data, out), generate

    return by_address


def _entry(kernel: Kernel) -> Any:
    """A function of the address of some words, which makes numbers, arrays and tuples of them."""
    import numba
    from numba import types

    carray: Any = numba.carray  # type: ignore[attr-defined]
    scope: dict[str, Any] = {"carray": carray, "function": _twin(kernel.function)}
    scope["as_i8"] = pointer_to(types.int64)
    for name in ("f8", "i8", "i1"):
        scope[f"as_{name}s"] = pointer_to(types.CPointer(getattr(types, name)))
    words = count()
    arguments = ", ".join(_argument(shape, words, scope) for shape in kernel.takes)
    taken, call = "f8", f"function({arguments}); return 0"
    if kernel.data is not None:
        taken, call = "z, f8, out", f"return function(z, data({arguments}), out)"
        scope["data"] = kernel.data
    kinds = "i8, f8s, i8s, i1s = as_i8(f8), as_f8s(f8), as_i8s(f8), as_i1s(f8)"
    exec(f"def entry({taken}):\n    {kinds}\n    {call}\n", scope)
    return scope["entry"]


def pointer_to(kind: Any) -> Any:
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
    """What an argument is made of, from the next words on, as text."""
    if shape.made_by:
        scope[shape.made_by.__name__] = shape.made_by
        parts = ", ".join(_argument(part, words, scope) for part in shape.parts)
        return f"{shape.made_by.__name__}({parts})"
    first = next(words)
    if not shape.axes:
        return f"f8[{first}]" if shape.kind == "f8" else _whole(shape, first)
    lengths = "".join(f"i8[{next(words)}], " for _ in range(shape.axes))
    return f"carray({shape.kind}s[{first}], ({lengths}))"


def _whole(shape: Shape, word: int) -> str:
    return f"i8[{word}] != 0" if shape.kind == "b1" else f"i8[{word}]"


# --- all of them ----------------------------------------------------------------------------------


def compile_into(folder: Path, *, processes: int = 1) -> dict[str, str]:
    """Compile what is not there yet; why some kernels are not compiled, by name.

    Several processes each take the next group of kernels that nobody has; kernels in one module
    call the same functions, which are compiled once for all of them.
    """
    with tempfile.TemporaryDirectory() as claims:
        line = [*machine_code.COMPILER, str(folder.absolute()), "--claims", claims]
        others = [subprocess.Popen(line, cwd=machine_code.HOME) for _ in range(processes - 1)]
        try:
            _work(folder, Path(claims))
        finally:
            for process in others:
                process.wait()
    return {name: folder.joinpath(f"{name}.failed").read_text() for name in _missing(folder)[1]}


def _missing(folder: Path) -> tuple[dict[str, Kernel], list[str]]:
    """The kernels that have no object file there, by its name; and those that failed."""
    for text in kernels.TEXTS:
        import_module(text)
    names = {kernel.file: kernel for kernel in kernels.KERNELS}
    # what was installed serves a session, but is not what an installation looks for
    stored = machine_code.at_hand().files if folder == machine_code.cache_directory() else {}
    lacks = {
        name: kernel
        for name, kernel in names.items()
        if name not in stored and not (folder / name).exists()
    }
    return lacks, [name for name in lacks if (folder / f"{name}.failed").exists()]


def _work(folder: Path, claims: Path) -> None:
    for module, group in _groups(_missing(folder)[0]):
        if _claimed(claims / module):
            for name, kernel in group.items():
                _compile(folder / name, kernel)


def _claimed(path: Path) -> bool:
    try:
        path.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def _groups(lacking: Mapping[str, Kernel]) -> list[tuple[str, dict[str, Kernel]]]:
    """By modules, those with most code first."""

    def module(item: tuple[str, Kernel]) -> str:
        return item[1].function.__module__

    def size(group: tuple[str, dict[str, Kernel]]) -> int:
        parts = {
            part for kernel in group[1].values() for part in machine_code.called(kernel.function)
        }
        return -sum(len(part.__code__.co_code) for part in parts)

    rows = groupby(sorted(lacking.items(), key=module), key=module)
    return sorted(((name, dict(group)) for name, group in rows), key=size)


def _compile(path: Path, kernel: Kernel) -> None:
    try:
        code = object_of(kernel)
    except NotCompiled as reason:
        _keep(path.with_name(f"{path.name}.failed"), str(reason).encode())
    else:
        _keep(path, machine_code.sealed(code))


def _keep(path: Path, text: bytes) -> None:
    """Write it beside the latest few of other texts, and for nobody else to change."""
    begin = path.name.partition("-")[0]
    others = sorted(path.parent.glob(f"{begin}-*"), key=_age, reverse=True)
    for old in others[KEPT - 1 :]:
        old.unlink(missing_ok=True)
    write_whole(path, lambda file: file.write(text))
    path.chmod(0o644)


def _age(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:  # somebody else has removed it
        return 0.0


# --- as a script ----------------------------------------------------------------------------------


def main(arguments: list[str]) -> None:
    folder, how = Path(arguments[0]), arguments[1:]
    folder.mkdir(mode=0o755, parents=True, exist_ok=True)
    if how[:1] == ["--claims"]:
        _work(folder, Path(how[1]))
    elif how == ["--behind"]:
        _behind(folder)
    else:
        for name, reason in compile_into(folder, processes=os.cpu_count() or 1).items():
            print(f"{name}: {reason}")


def _behind(folder: Path) -> None:
    """All in this process, after all other processes, unless one is at it already."""
    if hasattr(os, "nice"):
        os.nice(BEHIND)
    with (folder / "lock").open("ab") as file:
        if alone(file.fileno()):
            compile_into(folder)


if __name__ == "__main__":
    main(sys.argv[1:])
