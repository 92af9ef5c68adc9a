"""A name that is written once is read by nobody: a misspelling, unless another package reads it."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import contbreather

PACKAGE = Path(contbreather.__file__).parent
ROOT = Path(__file__).resolve().parents[1]
PLACES = (PACKAGE, *(ROOT / name for name in ("docs", "tests", "examples")))
WORD = re.compile(r"#[0-9A-Fa-f]{6}\b|(?<![#\w])[A-Za-z_]\w*")

# What stands in one place only, by who reads it there.
ONCE = {
    "colours": "#17405a #274B63 #2CC295 #343a40 #4d3320 #777777 #868e96 #8a9097 #A8D8F5 #BFDDF2"
    " #E29DC3 #F2B84B #dddddd #dee2e6 #e9ecef #f5f5f5 #ffffff",
    "python and the system": "NFKC NUMBA_NUM_THREADS __args__ _inheriting win32 xb"
    " O_NOFOLLOW _max_workers backslashreplace pthread_sigmask",
    "numba": "NRT_Free numba_do_raise numba_gil_ensure numba_gil_release numba_unpickle"
    " DISABLE_JIT NRT_MemInfo_call_dtor no_cfunc_wrapper no_cpython_wrapper"
    " forceinline numba_runtime_build_excinfo_struct jitdefault",
    "numpy and scipy": "COLAMD LM MMD_AT_PLUS_A NATURAL bc bck jab jbc kia kiajb kiajc kij kja kjb"
    " xyz",
    "netCDF and HDF5": "_nc4_ long_name",
    "matplotlib": "Creator butt mplstyle mutation_scale ffpi ffpii viridis",
    "panel, bokeh and browsers": "Available Py box_zoom danger dashdot diamond localhost"
    " inverted_triangle pan synchronous top_right triangle wheel_zoom",
    "others": "KilledWorker extra_forbidden forbid free_symbols markdown mem sig value_error xx",
    "columns and letters": "aeiou exact_c mean_10 rigid_mean_0",
}


def names(tree: ast.Module) -> Iterator[str]:
    """The words of all strings of up to three, but for docstrings and parts of longer ones."""
    blocks = (ast.Module, ast.ClassDef, ast.FunctionDef)
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, blocks) and node.body]
    parts = {id(body[0].value) for body in bodies if isinstance(body[0], ast.Expr)}
    parts |= {
        id(p) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for p in node.values
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and id(node) not in parts:
            text = node.value if isinstance(node.value, str) else ""
            yield from WORD.findall(text) if len(text.split()) <= 3 else ()


def test_every_name_is_spelled_alike_in_two_places() -> None:
    """Keys, labels, columns, options: written and read, tested, or described; in what is left those
    that other packages read. Who adds one that is only theirs enters it above."""
    texts = {
        path: path.read_text(encoding="utf-8")
        for place in PLACES
        for path in sorted(place.rglob("*"))
        if path.suffix in (".py", ".pyi", ".md") and "faults" not in path.parts
    }
    del texts[ROOT / "tests" / Path(__file__).name]
    count = Counter(word for text in texts.values() for word in WORD.findall(text))
    once = {
        word
        for path, text in texts.items()
        if path.suffix == ".py" and PACKAGE in path.parents
        for word in names(ast.parse(text))
        if count[word] < 2
    }
    assert not once - {word for words in ONCE.values() for word in words.split()}
