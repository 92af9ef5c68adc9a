"""Single faults that can be planted in a package, drawn at random.

No fault, and so never planted: arguments of max, min and their like exchanged; a tolerance (below
1e-3) twice as large, or an integer above 16 one larger (both are meant to an order of magnitude;
they are multiplied by 10^4); an index [0] made [-1]; `strict=`, decorators, annotations, sentences
of errors; `continue` where the loop's body ends anyway; what guards a division from 0 (below
1e-100); equality with a number that is no multiple of 1/4, which no float hits. Of the rest of them
three in four comparisons are turned round, one is made to hold (or not) at equality.
"""

from __future__ import annotations

import ast
import random
import re
import warnings
from bisect import bisect_right
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import Any

PACKAGE = "contbreather"

# whose arguments may be exchanged
COMMUTE = "max min maximum minimum hypot gcd array_equal allclose isclose logical_and logical_or"
COMMUTE = {*COMMUTE.split(), "multiply", "add"}

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


def named(*nodes: ast.AST | None) -> list[str]:
    """The names in some expressions."""
    walked = (n for node in nodes if node is not None for n in ast.walk(node))
    return [n.id for n in walked if isinstance(n, ast.Name)]


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
        if self.src.raw[start:end].decode() != text:
            kind = kind if self.in_default is None else "default"
            place = self.src.name, line, kind, start, end, text
            self.found.append(Fault(*place, **self.executed(line)))

    def executed(self, line: int) -> dict[str, Any]:
        """What the map is asked for tests that execute this place."""
        if self.in_default is not None:
            first, *_, last = *self.in_default.body, self.in_default.body[-1]
            body = tuple(range(first.lineno, last.end_lineno + 1))
            names = (self.in_default.name,)
            return {"lines": (line,), "how": "default", "names": names, "body": body}
        stmt, last = self.statement, self.statement.end_lineno
        inner = getattr(stmt, "body", None)
        if isinstance(inner, list) and inner:
            last = max(stmt.lineno, inner[0].lineno - 1)
        found: dict[str, Any] = {"lines": tuple(range(stmt.lineno, last + 1))}
        if isinstance(stmt, (ast.If, ast.While)):
            found["body"] = tuple(part[0].lineno for part in (stmt.body, stmt.orelse) if part)
        decorators = [self.src.text(d) for f in self.function for d in f.decorator_list]
        if any("inlined" in one for one in decorators):
            return {**found, "how": "compiled", "names": (self.function[0].name,)}
        if not self.function:
            targets = getattr(stmt, "targets", [getattr(stmt, "target", None)])
            found.update(how="import", names=tuple(named(*targets)))
        return found

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
        if kind == "compare" and len(news) == 2:
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
            self.assigned[-1] |= set(named(*node.targets))
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
        for one in node.body:
            self.visit(one)
        self.function.pop()
        self.assigned.pop()

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for one in node.body:
            self.visit(one)

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        if not {"__all__", "__slots__", "__version__"} & set(named(*node.targets)):
            self.generic_visit(node)

    def nothing(self, node: ast.AST) -> None:
        """Of a raise the sentence, its deletion is a fault above; of a string with places in it,
        these are not to be trusted before 3.12."""

    visit_Import = visit_ImportFrom = visit_Raise = visit_JoinedStr = nothing

    def visit_Return(self, node: ast.Return) -> None:
        if isinstance(node.value, (ast.Compare, ast.BoolOp)) or (
            isinstance(node.value, ast.UnaryOp) and isinstance(node.value.op, ast.Not)
        ):
            self.replace("return", node.value, f"(not ({self.src.text(node.value)}))")
        self.generic_visit(node)

    def condition(self, test: ast.expr) -> None:
        self.replace("negate", test, f"(not ({self.src.text(test)}))")

    def visit_If(self, node: ast.If | ast.While | ast.IfExp) -> None:
        if "TYPE_CHECKING" not in self.src.text(node.test):
            if not isinstance(node.test, ast.Constant):
                self.condition(node.test)
            self.generic_visit(node)

    visit_While = visit_IfExp = visit_If

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self.condition(test)
        self.generic_visit(node)

    # -- expressions ------------------------------------------------------------------------

    def visit_Compare(self, node: ast.Compare) -> None:
        left = node.left
        for op, right in zip(node.ops, node.comparators, strict=False):
            old, news = SWAP[type(op)]
            if len(news) == 2 and (between(left) or between(right)):
                news = news[:1]
            self.gap("compare", left, right, old, news)
            left = right
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in SWAP:
            self.gap("arithmetic", node.left, node.right, *SWAP[type(node.op)])
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
        swapped = called.split(".")[-1] not in COMMUTE
        for one, two in zip(node.args, node.args[1:], strict=False) if swapped else ():
            if not isinstance(one, ast.Starred) and not isinstance(two, ast.Starred):
                start, end = self.src.span(one)[0], self.src.span(two)[1]
                middle = self.src.raw[self.src.span(one)[1] : self.src.span(two)[0]].decode()
                text = self.src.text(two) + middle + self.src.text(one)
                if "#" not in middle:
                    self.add("arguments", start, end, text, one.lineno)
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
                        if by == "- 1" and self.src.text(one) == "0":
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
                if (value != 0 or "+" in new) and not (small or long or guard):
                    self.replace("constant", node, new)
        elif isinstance(value, str) and value:
            raw = self.src.text(node)
            if re.match(r"[rR]?[\"'](?![\"']{2})", raw):
                self.replace("string", node, self.altered(value))

    def altered(self, value: str) -> str:
        if re.fullmatch(r"#[0-9a-fA-F]{6}", value):
            same = len(set(value[1:])) == 1
            return repr("#8899aa" if same else "#" + value[3:] + value[1:3])
        # the end of a sentence says little: of four words and more all is taken away
        return repr("x") if len(value.split()) > 3 else repr(value + "x")


def all_faults(root: Path) -> list[tuple[Source, list[Fault]]]:
    found = []
    for path in sorted((root / PACKAGE).rglob("*.py")):
        finder = Finder(source(root, str(path.relative_to(root))))
        for one in finder.src.tree.body:
            finder.visit(one)
        if finder.found:
            found.append((finder.src, finder.found))
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
    """Whether what is planted is Python, and not the same."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            tree = ast.parse(planted(root, fault))
        except SyntaxError:
            return False
        return ast.dump(tree) != ast.dump(ast.parse((root / fault.file).read_bytes()))


def clip(raw: bytes, fault: Fault, text: str | None) -> str:
    first = raw.rfind(b"\n", 0, fault.start) + 1
    last = raw.find(b"\n", fault.end)
    middle = raw[fault.start : fault.end] if text is None else text.encode()
    return (raw[first : fault.start] + middle + raw[fault.end : last]).decode().strip()
