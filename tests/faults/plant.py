"""Plant single faults in a package and see which the tests catch.

    python tests/faults/plant.py CHECKOUT --seed 1 --number 300 [--processes 2] [--quick]
    python plant.py CHECKOUT --list --seed 1 --number 20       # show the faults, run nothing
    python plant.py CHECKOUT --again FILE --out FILE2           # the survivors of FILE, once more
    python plant.py --report FILE
    python plant.py CHECKOUT --clean FILE    # the tests that caught something, without any fault

Needs `coverage` and the map that `python record.py CHECKOUT` makes (which test executes which
line); map and copies are kept in PLANT_HOME.  One fault at
a time, in a private copy; resumes where FILE ends.  Tests that run: those that execute the faulty
statement, those of the file's own topic first, others spread over all test files, quickest first;
of defaults and strings those that read them from the source, too.
What 60 of them, or 120 s, do not catch gets up to 400 more and 600 s, unless --quick.  A test that
takes more than ten times as long as usual (at least 60 s) hangs: caught.

No fault, and so never planted: arguments of max, min and their like exchanged; a tolerance (below
1e-3) twice as large, or an integer above 16 one larger (both are meant to an order of magnitude;
they are multiplied by 10^4); an index [0] made [-1]; `strict=`, decorators, annotations, sentences
of errors; `continue` where the loop's body ends anyway; what guards a division from 0 (below
1e-100); equality with a number that is no multiple of 1/4, which no float hits. Of the rest of them
three in four comparisons are turned round, one is made to hold (or not) at equality.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from bisect import bisect_right
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import accumulate, zip_longest
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from record import HOME, MAP, TREE, copy, environment  # noqa: E402

PACKAGE = "contbreather"
STRUCTURE = ("tests/test_floors.py", "tests/test_project.py", "tests/test_import_cost.py")
READS_DEFAULTS = ("tests/test_parameters.py",)  # from the source, so that no line of it is executed
TESTS, SECONDS = 60, 120.0  # at most, for one fault
DEEP_TESTS, DEEP_SECONDS = 400, 600.0
COMPILED_SECONDS = 420.0  # compiling all loops anew comes on top
HANG, FACTOR = 60.0, 10.0

COMMUTE = {
    "max",
    "min",
    "maximum",
    "minimum",
    "hypot",
    "gcd",
    "array_equal",
    "allclose",
    "isclose",
    "logical_and",
    "logical_or",
    "multiply",
    "add",
}
ALL = False  # faults of earlier campaigns too

SWAP = {
    ast.Lt: ("<", (">", "<=")),
    ast.LtE: ("<=", (">=", "<")),
    ast.Gt: (">", ("<", ">=")),
    ast.GtE: (">=", ("<=", ">")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
}
ARITHMETIC = {
    ast.Add: ("+", ("-",)),
    ast.Sub: ("-", ("+",)),
    ast.Mult: ("*", ("/",)),
    ast.Div: ("/", ("*",)),
    ast.Pow: ("**", ("*",)),
    ast.FloorDiv: ("//", ("/",)),
    ast.Mod: ("%", ("//",)),
}


@dataclass
class Fault:
    file: str
    line: int
    kind: str
    start: int  # bytes in the file
    end: int
    text: str
    lines: tuple[int, ...] = ()  # of the statement, for the map
    how: str = "run"  # "import": executed at import only; "compiled": not seen by coverage
    names: tuple[str, ...] = ()  # what an import-time statement defines
    body: tuple[int, ...] = ()  # of the function whose default it is


@dataclass
class Source:
    name: str
    raw: bytes
    tree: ast.Module
    starts: list[int] = field(default_factory=list)

    def at(self, line: int, column: int) -> int:
        return self.starts[line - 1] + column

    def span(self, node: ast.AST) -> tuple[int, int]:
        return self.at(node.lineno, node.col_offset), self.at(node.end_lineno, node.end_col_offset)

    def text(self, node: ast.AST) -> str:
        start, end = self.span(node)
        return self.raw[start:end].decode()


def source(root: Path, name: str) -> Source:
    raw = (root / name).read_bytes()
    starts = [0, *accumulate(len(line) for line in raw.splitlines(keepends=True))]
    return Source(name, raw, ast.parse(raw), starts)


def tails(body: list[ast.stmt]) -> list[ast.stmt]:
    """The statements after which a body is at its end."""
    last = body[-1]
    inner = [getattr(last, name, []) for name in ("body", "orelse", "finalbody")]
    inner += [handler.body for handler in getattr(last, "handlers", [])]
    if isinstance(last, (ast.If, ast.With, ast.Try)):
        return [one for part in inner if part for one in tails(part)]
    return [last]


def between(node: ast.AST) -> bool:
    """Whether this is a number that no float is by more than chance, as 1e-9 or 1.0 + 1e-6."""
    number = (ast.Constant, ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop)
    if any(not isinstance(one, number) for one in ast.walk(node)):
        return False
    value = eval(compile(ast.Expression(node), "number", "eval"))
    return isinstance(value, float) and not (4 * value).is_integer()


class Finder(ast.NodeVisitor):
    """All faults of one file."""

    def __init__(self, src: Source) -> None:
        self.src, self.found = src, []
        self.statement: ast.stmt | None = None
        self.function: list[ast.FunctionDef] = []
        self.assigned: list[set[str]] = []
        self.in_default: ast.FunctionDef | None = None
        loops = (n for n in ast.walk(src.tree) if isinstance(n, (ast.For, ast.While)))
        self.idle = {id(last) for loop in loops for last in tails(loop.body)}

    # -- keeping places ---------------------------------------------------------------------

    def add(self, kind: str, start: int, end: int, text: str, line: int) -> None:
        stmt = self.statement
        if self.in_default is not None:
            f = self.in_default
            body = tuple(range(f.body[0].lineno, f.body[-1].end_lineno + 1))
            fault = Fault(
                self.src.name,
                line,
                "default",
                start,
                end,
                text,
                (line,),
                "default",
                (f.name,),
                body,
            )
        else:
            last = stmt.end_lineno
            inner = getattr(stmt, "body", None)
            if isinstance(inner, list) and inner:
                last = max(stmt.lineno, inner[0].lineno - 1)
            lines = tuple(range(stmt.lineno, last + 1))
            names = ()
            how = "run" if self.function else "import"
            if how == "import":
                targets = (
                    stmt.targets
                    if isinstance(stmt, ast.Assign)
                    else [getattr(stmt, "target", None)]
                )
                names = tuple(
                    n.id
                    for t in targets
                    if t is not None
                    for n in ast.walk(t)
                    if isinstance(n, ast.Name)
                )
            if any(
                any(word in self.src.text(d) for word in ("compiled", "inlined", "njit"))
                for f in self.function
                for d in f.decorator_list
            ):
                how, names = "compiled", (self.function[0].name,)
            branches = ()
            if isinstance(stmt, (ast.If, ast.While)):
                branches = tuple(part[0].lineno for part in (stmt.body, stmt.orelse) if part)
            fault = Fault(self.src.name, line, kind, start, end, text, lines, how, names, branches)
        before = self.src.raw[start:end].decode()
        if before != text:
            self.found.append(fault)

    def replace(self, kind: str, node: ast.AST, text: str) -> None:
        start, end = self.src.span(node)
        self.add(kind, start, end, text, node.lineno)

    def gap(
        self, kind: str, left: ast.AST, right: ast.AST, old: str, news: tuple[str, ...]
    ) -> None:
        """Replace an operator between two nodes."""
        start, end = self.src.span(left)[1], self.src.span(right)[0]
        between = re.sub(rb"#[^\n]*", lambda m: b" " * len(m[0]), self.src.raw[start:end]).decode()
        pattern = re.escape(old).replace(r"\ ", r"\s+")
        hit = re.search(rf"\b{pattern}\b" if old[0].isalpha() else pattern, between)
        if hit is None:
            return
        at = start + len(between[: hit.start()].encode())
        line = bisect_right(self.src.starts, at)
        if kind == "compare" and len(news) == 2 and not ALL:
            news = (news[0], news[0], news[0], news[1])  # drawn by these odds
        for new in news:
            self.add(kind, at, at + len(hit[0].encode()), new, line)

    # -- statements -------------------------------------------------------------------------

    def visit(self, node: ast.AST) -> None:
        if isinstance(node, ast.stmt):
            old, self.statement = self.statement, node
            self.delete(node)
            super().visit(node)
            self.statement = old
        else:
            super().visit(node)

    def delete(self, node: ast.stmt) -> None:
        if not self.function:
            return
        gone = isinstance(node, (ast.AugAssign, ast.Raise, ast.Continue, ast.Break))
        gone = gone and not (isinstance(node, ast.Continue) and id(node) in self.idle)
        if isinstance(node, ast.Expr):
            gone = not isinstance(node.value, (ast.Constant, ast.Yield, ast.YieldFrom))
        elif isinstance(node, ast.Assign):
            t = node.targets[0]
            gone = isinstance(t, (ast.Attribute, ast.Subscript)) or (
                isinstance(t, ast.Name) and t.id in self.assigned[-1]
            )
        if isinstance(node, ast.Assign):
            for t in node.targets:
                self.assigned[-1] |= {n.id for n in ast.walk(t) if isinstance(n, ast.Name)}
        if gone:
            self.replace("delete", node, "pass")

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        arguments = node.args
        for one in [*arguments.defaults, *(d for d in arguments.kw_defaults if d is not None)]:
            old, self.in_default = self.in_default, node
            self.visit(one)
            self.in_default = old
        self.function.append(node)
        self.assigned.append({a.arg for a in [*arguments.args, *arguments.kwonlyargs]})
        for i, one in enumerate(node.body):
            doc = i == 0 and isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant)
            if not doc:
                self.visit(one)
        self.function.pop()
        self.assigned.pop()

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for one in node.body:
            if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant)):
                self.visit(one)

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Import(self, node: ast.AST) -> None:
        pass

    visit_ImportFrom = visit_Import

    def visit_Assign(self, node: ast.Assign) -> None:
        if any(
            isinstance(t, ast.Name) and t.id in ("__all__", "__slots__", "__version__")
            for t in node.targets
        ):
            return
        self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        pass  # the sentence; the deletion of the whole is a fault above

    def visit_Return(self, node: ast.Return) -> None:
        if isinstance(node.value, (ast.Compare, ast.BoolOp)) or (
            isinstance(node.value, ast.UnaryOp) and isinstance(node.value.op, ast.Not)
        ):
            self.replace("return", node.value, f"(not ({self.src.text(node.value)}))")
        self.generic_visit(node)

    def condition(self, test: ast.expr) -> None:
        self.replace("negate", test, f"(not ({self.src.text(test)}))")

    def visit_If(self, node: ast.If) -> None:
        if "TYPE_CHECKING" in self.src.text(node.test):
            return
        self.condition(node.test)
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        if not isinstance(node.test, ast.Constant):
            self.condition(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self.condition(node.test)
        self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self.condition(test)
        self.generic_visit(node)

    # -- expressions ------------------------------------------------------------------------

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        pass  # places inside are not to be trusted before 3.12

    def visit_Compare(self, node: ast.Compare) -> None:
        left = node.left
        for op, right in zip(node.ops, node.comparators, strict=False):
            old, news = SWAP[type(op)]
            if not ALL and len(news) == 2 and (between(left) or between(right)):
                news = news[:1]
            self.gap("compare", left, right, old, news)
            left = right
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in ARITHMETIC:
            old, news = ARITHMETIC[type(node.op)]
            self.gap("arithmetic", node.left, node.right, old, news)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.gap("boolean", left, right, old, (new,))
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        called = self.src.text(node.func)
        if called.split(".")[-1] in ("cast", "TypeVar", "ParamSpec"):
            return
        swapped = ALL or called.split(".")[-1] not in COMMUTE
        for one, two in zip(node.args, node.args[1:], strict=False) if swapped else ():
            if not isinstance(one, ast.Starred) and not isinstance(two, ast.Starred):
                start, end = self.src.span(one)[0], self.src.span(two)[1]
                middle = self.src.raw[self.src.span(one)[1] : self.src.span(two)[0]].decode()
                if "#" not in middle:
                    self.add(
                        "arguments",
                        start,
                        end,
                        self.src.text(two) + middle + self.src.text(one),
                        one.lineno,
                    )
        self.visit(node.func)
        for one in node.args:
            self.visit(one)
        for keyword in node.keywords:
            if keyword.arg not in ("strict", "help", "stacklevel"):
                self.visit(keyword.value)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        for part in parts:
            ends = [part.lower, part.upper] if isinstance(part, ast.Slice) else [part]
            for one in ends:
                number = isinstance(one, ast.Constant) and type(one.value) is int
                minus = isinstance(one, ast.UnaryOp) and isinstance(one.operand, ast.Constant)
                if one is not None and (isinstance(part, ast.Slice) or number or minus):
                    for by in ("+ 1", "- 1"):
                        if by == "- 1" and self.src.text(one) == "0" and not ALL:
                            continue
                        self.replace("index", one, f"({self.src.text(one)}) {by}")
                else:
                    self.visit(one) if one is not None else None
        self.visit(node.value)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if value is True or value is False:
            self.replace("constant", node, str(not value))
        elif isinstance(value, (int, float)):
            text = self.src.text(node)
            for new in (f"(2 * {text})", f"({text} * 10000)", f"({text} + 1)", f"(-{text})"):
                small = "2 *" in new and abs(value) < 1e-3
                long = "+ 1" in new and isinstance(value, int) and value > 16
                guard = 0 < abs(value) < 1e-100
                if (value != 0 or "+" in new) and (ALL or not (small or long or guard)):
                    self.replace("constant", node, new)
        elif isinstance(value, str) and value:
            raw = self.src.text(node)
            if re.match(r"[rR]?[\"'](?![\"']{2})", raw):
                self.replace("string", node, self.altered(value))

    def altered(self, value: str) -> str:
        if re.fullmatch(r"#[0-9a-fA-F]{6}", value):
            return (
                repr("#" + value[3:] + value[1:3]) if len(set(value[1:])) > 1 else repr("#8899aa")
            )
        # the end of a sentence says little: of four words and more all is taken away
        return repr("x") if len(value.split()) > 3 else repr(value + "x")


def all_faults(root: Path) -> list[Source, list[Fault]]:
    found = []
    for path in sorted((root / PACKAGE).rglob("*.py")):
        src = source(root, str(path.relative_to(root)))
        finder = Finder(src)
        for one in src.tree.body:
            doc = isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant)
            if not doc:
                finder.visit(one)
        if finder.found:
            found.append((src, finder.found))
    return found


def draw(root: Path, seed: int, number: int) -> list[Fault]:
    """The first `number` of a random sequence: files by their lines, then a line, then a fault."""
    rng = random.Random(seed)
    files = all_faults(root)
    weights = [len(src.raw.splitlines()) for src, _ in files]
    chosen, seen = [], set()
    while len(chosen) < number:
        ((_, faults),) = rng.choices(files, weights)
        by_line = defaultdict(lambda: defaultdict(list))
        for one in faults:
            by_line[one.line][one.kind].append(one)
        kinds = by_line[rng.choice(sorted(by_line))]
        fault = rng.choice(kinds[rng.choice(sorted(kinds))])
        key = (fault.file, fault.start, fault.end, fault.text)
        if key not in seen and compiles(root, fault):
            seen.add(key)
            chosen.append(fault)
    return chosen


def planted(root: Path, fault: Fault) -> bytes:
    raw = (root / fault.file).read_bytes()
    return raw[: fault.start] + fault.text.encode() + raw[fault.end :]


def compiles(root: Path, fault: Fault) -> bool:
    import warnings

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.dump(ast.parse(planted(root, fault))) != ast.dump(
                ast.parse((root / fault.file).read_bytes())
            )
    except SyntaxError:
        return False


# --- which tests see it -------------------------------------------------------------------------


class Map:
    def __init__(self, root: Path) -> None:
        from coverage import CoverageData

        self.root = root
        self.data = CoverageData(basename=str(MAP / "coverage.db"))
        self.data.read()
        every = json.loads((MAP / "tests.json").read_text())
        self.tests = {k: v for k, v in every.items() if v["ok"]}
        self.structure = {k for k, v in every.items() if v["file"].startswith(STRUCTURE)}
        self.by_context = defaultdict(set)
        for name, entry in self.tests.items():
            self.by_context[name].add(name)
            for one in entry["shared"]:
                self.by_context[one].add(name)
        self.lines: dict[str, dict[int, list[str]]] = {}
        self.texts = {
            str(p.relative_to(root)): p.read_text() for p in (root / PACKAGE).rglob("*.py")
        }

    def stale(self) -> list[str]:
        return [
            name
            for name, text in self.texts.items()
            if not (TREE / name).exists() or (TREE / name).read_text() != text
        ]

    def on(self, file: str, lines) -> set[str]:
        if file not in self.lines:
            self.lines[file] = self.data.contexts_by_lineno(str(TREE / file))
        known = self.lines[file]
        return {
            t for line in lines for c in known.get(line, ()) for t in self.by_context.get(c, ())
        }

    def users(self, fault: Fault) -> set[str]:
        """Tests of all lines that name what an import-time statement defines."""
        found: set[str] = set()
        for name in self.closure(fault.names):
            for file, text in self.texts.items():
                if file != fault.file and not re.search(rf"\b{re.escape(name)}\b", text):
                    continue
                hits = [
                    i
                    for i, line in enumerate(text.split("\n"), 1)
                    if re.search(rf"\b{re.escape(name)}\b", line)
                    and i not in fault.lines
                    and "import" not in line
                ]
                found |= self.on(file, hits)
        return found

    def closure(self, names: tuple[str, ...]) -> set[str]:
        """These names and all that module-level statements make of them."""
        if not hasattr(self, "statements"):
            self.statements = []
            for text in self.texts.values():
                for one in ast.parse(text).body:
                    if isinstance(one, (ast.Assign, ast.AnnAssign)):
                        targets = one.targets if isinstance(one, ast.Assign) else [one.target]
                        made = {
                            n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)
                        }
                        used = {n.id for n in ast.walk(one) if isinstance(n, ast.Name)} - made
                        self.statements.append((made, used))
        found = set(names)
        for _ in range(4):
            for made, used in self.statements:
                if used & found:
                    found |= made
        return found

    def importers(self, stem: str) -> set[str]:
        """The names of a module, of those that import it, and of those that import these."""
        found = {stem}
        for _ in range(2):
            line = re.compile(rf"from [\w.]*\b({'|'.join(found)}) import")
            found |= {Path(file).stem for file, text in self.texts.items() if line.search(text)}
        return found

    def topic(self, fault: Fault) -> set[str]:
        """The tests of the folder (or the topic) of the faulty file."""
        parts = fault.file.split("/")[1:]
        folder = parts[0]
        starts = {
            "plotting": ("tests/test_plotting", "tests/paper/test_figures"),
            "cli": ("tests/test_cli",),
        }.get(folder, (f"tests/{folder}/",))
        if len(parts) == 1:
            starts = ("tests/test_",)
        found = {t for t, e in self.tests.items() if e["file"].startswith(starts)}
        if folder == "plotting" or folder == "paper":
            found |= {
                t for t, e in self.tests.items() if e["file"].startswith("tests/test_plotting")
            }
        return found

    def choose(self, fault: Fault, deep: bool) -> list[str]:
        limit, seconds = (DEEP_TESTS, 0.6 * DEEP_SECONDS) if deep else (TESTS, 0.6 * SECONDS)
        seen = self.on(fault.file, fault.lines) if fault.how == "run" else set()
        if fault.how == "default":
            seen = self.on(fault.file, fault.body)
        read = {
            t
            for t, e in self.tests.items()
            if e["file"].startswith(READS_DEFAULTS)
            and ("not_said" in t or f"[{fault.file.removeprefix(PACKAGE + '/')}]" in t)
        }
        folder = self.topic(fault)
        if fault.how == "compiled":
            limit, seconds = 4 * limit, 3 * seconds  # which tests run the loop is not seen
        if fault.how in ("import", "compiled"):
            seen = self.users(fault)
            stem = Path(fault.file).stem.strip("_")
            seen |= {t for t in folder if fault.how == "compiled" or stem in self.tests[t]["file"]}
        if not seen:
            seen = folder
        if fault.file != f"{PACKAGE}/__init__.py":  # whose names are looked up there
            seen = seen - self.structure
        stem = Path(fault.file).stem.strip("_")
        # a compiled loop is not seen to be executed: its tests are those of who calls it
        stems = self.importers(stem) if fault.how == "compiled" else {stem}
        words = [word for one in stems for word in one.split("_") if len(word) > 3] or [stem]
        files = {e["file"]: Path(e["file"]).stem for e in self.tests.values()}
        topical = {
            f for f, own in files.items() if any(w.rstrip("s") in own for w in words) or stem in own
        }
        near = lambda t: self.tests[t]["file"] in topical  # noqa: E731
        quick = lambda t: self.tests[t]["seconds"]  # noqa: E731
        if deep:  # what a fixture or a cache computed once is credited to one test only
            seen = seen | {t for t in folder if near(t)}
            if fault.how in ("default", "import") and fault.names:
                named = re.compile("|".join(rf"\b{re.escape(n)}\b" for n in fault.names))
                wanted = {f for f in files if named.search((self.root / f).read_text())}
                seen |= {t for t, e in self.tests.items() if e["file"] in wanted}
        # of a condition, those that take the rarer of its ways
        ways = (
            [self.on(fault.file, (line,)) & seen for line in fault.body]
            if fault.how == "run"
            else []
        )
        rare = min((way for way in ways if way), key=len, default=set())
        own = sorted((t for t in seen if near(t)), key=quick)
        home = sorted((t for t in seen & folder if not near(t)), key=quick)
        # others: one of each test file, then a second of each ...
        by_file = defaultdict(list)
        for t in sorted(seen - set(own) - set(home), key=quick):
            by_file[self.tests[t]["file"]].append(t)
        spread = [t for row in zip_longest(*by_file.values()) for t in row if t is not None]
        order = own[: limit // 2] + [t for pair in zip_longest(home, spread) for t in pair if t]
        order += own[limit // 2 :]
        first = sorted(read) if fault.how in ("default", "import") else []
        order = list(dict.fromkeys([*first, *sorted(rare, key=quick)[: limit // 3], *order]))
        chosen, total = [], 0.0
        for t in order:
            if t in first or (len(chosen) < limit and total + quick(t) <= seconds):
                chosen.append(t)
                total += quick(t)
        if not chosen and order:
            chosen = [min(order, key=quick)]
        return sorted(chosen, key=quick)


# --- running ------------------------------------------------------------------------------------


def run(fault: Fault, tree: Path, chart: Map, deep: bool, stamp: int) -> dict:
    """First the tests of `choose`; where they see nothing, all others that may (`deep`)."""
    target = tree / fault.file
    original, stat = target.read_bytes(), target.stat()
    result = {
        "file": fault.file,
        "line": fault.line,
        "kind": fault.kind,
        "how": fault.how,
        "before": clip(original, fault, None),
        "after": clip(original, fault, fault.text),
        "start": fault.start,
        "end": fault.end,
        "text": fault.text,
        "tests": 0,
        "caught": False,
        "by": None,
    }
    began, done = time.time(), set()
    target.write_bytes(planted(tree, fault))
    os.utime(target, (10**9 + 10 * stamp, 10**9 + 10 * stamp))
    try:
        for stage in (False, True) if deep else (False,):
            tests = [t for t in chart.choose(fault, stage) if t not in done]
            if not tests:
                continue
            done |= set(tests)
            result.update(watched(tree, tests, chart, fault, stage), tests=len(done))
            if result["caught"]:
                break
    finally:
        target.write_bytes(original)
        os.utime(target, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    return {**result, "seconds": round(time.time() - began, 1)}


def clip(raw: bytes, fault: Fault, text: str | None) -> str:
    first = raw.rfind(b"\n", 0, fault.start) + 1
    last = raw.find(b"\n", fault.end)
    middle = raw[fault.start : fault.end] if text is None else text.encode()
    return (raw[first : fault.start] + middle + raw[fault.end : last]).decode().strip()


def watched(tree: Path, tests: list[str], chart: Map, fault: Fault, deep: bool) -> dict:
    progress = tree.parent / f"{tree.name}.progress"
    progress.write_text("")
    arguments = tree.parent / f"{tree.name}.args"
    arguments.write_text("\n".join(tests))
    budget = DEEP_SECONDS if deep else SECONDS
    hang = HANG
    if fault.how == "compiled" or any(
        b"@compiled" in (tree / fault.file).read_bytes() for _ in (0,)
    ):
        budget, hang = budget + COMPILED_SECONDS, HANG + COMPILED_SECONDS
    temp = tree.parent / f"{tree.name}.tmp"
    shutil.rmtree(temp, ignore_errors=True)
    temp.mkdir()
    line = [
        "nice",
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "watch_plugin",
        "--tb=line",
        "-rN",
        f"--basetemp={temp}/pytest",
        f"@{arguments}",
    ]
    env = environment(tree, PLANT_PROGRESS=str(progress), TMPDIR=str(temp))
    log = (tree.parent / f"{tree.name}.log").open("wb")
    process = subprocess.Popen(
        line,
        cwd=tree,
        env=env,
        stdout=log,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        start_new_session=True,
    )
    began = time.time()
    try:
        while process.poll() is None:
            time.sleep(0.1)
            now = time.time()
            current, since = None, began
            lines = progress.read_text().splitlines()
            for one in reversed(lines):
                what, when, name = one.split("\t", 2)
                if what == "start":
                    current, since = name, float(when)
                    break
            usual = chart.tests.get(current, {}).get("seconds", 0.0)
            if now - since > max(hang, FACTOR * usual):
                kill(process)
                return {"caught": True, "by": f"{current} (hangs)"}
            if now - began > budget:
                kill(process)
                done = sum(one.startswith("start") for one in lines)
                return {"caught": False, "note": f"out of time after {done} of {len(tests)} tests"}
    finally:
        kill(process)
        log.close()
        shutil.rmtree(temp, ignore_errors=True)
    failed = [
        one.split("\t", 2)[2]
        for one in progress.read_text().splitlines()
        if one.startswith("failed")
    ]
    if process.returncode == 0:
        return {"caught": False}
    if failed:
        return {"caught": True, "by": failed[0]}
    output = (tree.parent / f"{tree.name}.log").read_text(errors="replace")
    if process.returncode in (3, 4) or process.returncode < 0 or process.returncode > 5:
        return {"caught": True, "by": f"pytest ends with {process.returncode}: {output[-200:]}"}
    return {"caught": True, "by": f"status {process.returncode}: {output[-200:]}"}


def kill(process: subprocess.Popen) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def report(path: Path) -> None:
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    caught = [r for r in rows if r["caught"]]
    print(f"{len(caught)} of {len(rows)} caught, {100 * len(caught) / max(len(rows), 1):.1f} %")
    for r in rows:
        if not r["caught"]:
            print(
                f"\n{r['index']:4d} {r['file']}:{r['line']}  {r['kind']}  "
                f"({r['tests']} tests {r.get('note', '')})"
                f"\n     - {r['before']}\n     + {r['after']}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("checkout", nargs="?")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=100)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--quick", action="store_true", help="60 tests and 120 s at most")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--again", type=Path)
    parser.add_argument("--report", type=Path)
    parser.add_argument("--clean", type=Path)
    given = parser.parse_args()
    if given.report:
        return report(given.report)
    root = Path(given.checkout).resolve()
    out = given.out or HOME / f"faults-{given.seed}.jsonl"
    trees = []
    for i in range(given.processes):
        tree = HOME / "copies" / f"{out.stem}-{i}"
        tree.mkdir(parents=True, exist_ok=True)
        copy(root, tree)
        trees.append(tree)
    root = trees[0]  # as it was when this began
    if given.again:
        faults = again(root, given.again)
    else:
        faults = list(enumerate(draw(root, given.seed, given.number)))
    if given.list:
        for i, one in faults:
            raw = (root / one.file).read_bytes()
            print(
                f"{i} {one.file}:{one.line} {one.kind} {one.how}\n"
                f"  - {clip(raw, one, None)}\n  + {clip(raw, one, one.text)}"
            )
        return None
    chart = Map(root)
    if stale := chart.stale():
        print("the map is older than these, renew it with record.py:", *stale, file=sys.stderr)
    if given.clean:
        return clean(trees[0], given.clean)
    key = hashlib.sha256(b"".join(t.encode() for t in chart.texts.values())).hexdigest()[:12]
    done = set()
    if out.exists():
        done = {json.loads(line)["index"] for line in out.read_text().splitlines()}
    todo = [one for one in faults if one[0] not in done]
    lock, lock_map = threading.Lock(), threading.Lock()
    real = chart.choose

    def choose(fault, deep):
        with lock_map:
            return real(fault, deep)

    chart.choose = choose

    def work(tree: Path) -> None:
        while True:
            with lock:
                if not todo:
                    return
                index, fault = todo.pop(0)
            row = {
                "index": index,
                "seed": given.seed,
                "source": key,
                **run(fault, tree, chart, not given.quick, index + 1),
            }
            with lock:
                with out.open("a") as stream:
                    stream.write(json.dumps(row) + "\n")
                print(
                    index,
                    "caught" if row["caught"] else "SURVIVED",
                    row["file"],
                    row["line"],
                    row["seconds"],
                    row["by"] or row.get("note", ""),
                    flush=True,
                )

    threads = [threading.Thread(target=work, args=(tree,)) for tree in trees]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    report(out)
    return None


def clean(tree: Path, path: Path) -> None:
    """Any test that fails here caught nothing: it fails by itself."""
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    tests = sorted(
        {
            r["by"]
            for r in rows
            if r["caught"] and r["by"] and r["by"].startswith("tests/") and "(hangs)" not in r["by"]
        }
    )
    arguments = tree.parent / f"{tree.name}.clean"
    arguments.write_text("\n".join(tests))
    env = environment(tree, PLANT_PROGRESS=os.devnull)
    subprocess.run(
        [
            "nice",
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "--tb=line",
            f"@{arguments}",
        ],
        cwd=tree,
        env=env,
        check=False,
    )


def again(root: Path, path: Path) -> list[tuple[int, Fault]]:
    """The survivors of a campaign; where the source has changed, found by their line's text."""
    global ALL
    ALL = True
    known = {(f.file, f.start, f.end, f.text): f for _, fs in all_faults(root) for f in fs}
    by_text = defaultdict(list)
    for f in known.values():
        raw = (root / f.file).read_bytes()
        by_text[f.file, f.kind, clip(raw, f, None), clip(raw, f, f.text)].append(f)
    found = []
    for line in path.read_text().splitlines():
        r = json.loads(line)
        if r["caught"]:
            continue
        same = by_text.get((r["file"], r["kind"], r["before"], r["after"]))
        if same:
            found.append((r["index"], min(same, key=lambda f: abs(f.line - r["line"]))))
        else:
            print(r["index"], "is not there any more:", r["file"], r["before"], file=sys.stderr)
    return found


if __name__ == "__main__":
    main()
