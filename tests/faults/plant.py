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
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from typing import Any

from find import PACKAGE, Fault, all_faults, clip, draw, named, planted
from record import HOME, MAP, PYTEST, PYTHON, TREE, copy, environment

STRUCTURE = ("tests/test_floors.py", "tests/test_project.py", "tests/test_import_cost.py")
READS_DEFAULTS = ("tests/test_parameters.py",)  # from the source, so that no line of it is executed
TESTS, SECONDS = 60, 120.0  # at most, for one fault
DEEP_TESTS, DEEP_SECONDS = 400, 600.0
COMPILED_SECONDS = 420.0  # compiling all loops anew comes on top
HANG, FACTOR = 60.0, 10.0


class Map:
    def __init__(self, root: Path) -> None:
        from coverage import CoverageData

        self.root, self.lock = root, threading.Lock()
        self.data = CoverageData(basename=str(MAP / "coverage.db"))
        self.data.read()
        every = json.loads((MAP / "tests.json").read_text())
        self.tests = {name: entry for name, entry in every.items() if entry["ok"]}
        self.by_context = defaultdict(set)
        for name, entry in self.tests.items():
            for one in (name, *entry["shared"]):
                self.by_context[one].add(name)
        self.lines: dict[str, dict[int, list[str]]] = {}
        paths = (root / PACKAGE).rglob("*.py")
        self.texts = {str(path.relative_to(root)): path.read_text() for path in paths}

    def stale(self) -> list[str]:
        there = {name: TREE / name for name in self.texts}
        return [
            name
            for name, text in self.texts.items()
            if not there[name].exists() or there[name].read_text() != text
        ]

    def of(self, *starts: str) -> set[str]:
        """The tests of files whose names begin so."""
        return {test for test, entry in self.tests.items() if entry["file"].startswith(starts)}

    def on(self, file: str, lines) -> set[str]:
        if file not in self.lines:
            self.lines[file] = self.data.contexts_by_lineno(str(TREE / file))
        seen = (one for line in lines for one in self.lines[file].get(line, ()))
        return {test for one in seen for test in self.by_context.get(one, ())}

    def users(self, fault: Fault) -> set[str]:
        """Tests of all lines that name what an import-time statement defines."""
        found: set[str] = set()
        for name in self.closure(fault.names):
            word = re.compile(rf"\b{re.escape(name)}\b")
            for file, text in self.texts.items():
                hits = [
                    i
                    for i, line in enumerate(text.split("\n"), 1)
                    if word.search(line) and i not in fault.lines and "import" not in line
                ]
                found |= self.on(file, hits) if file == fault.file or word.search(text) else set()
        return found

    @cached_property
    def statements(self) -> list[tuple[set[str], set[str]]]:
        """What each module-level statement makes, and of what."""
        found = []
        for one in (one for text in self.texts.values() for one in ast.parse(text).body):
            if isinstance(one, (ast.Assign, ast.AnnAssign)):
                made = {*named(*(one.targets if isinstance(one, ast.Assign) else [one.target]))}
                found.append((made, {*named(one)} - made))
        return found

    def closure(self, names: tuple[str, ...]) -> set[str]:
        """These names and all that module-level statements make of them."""
        found = set(names)
        for _ in range(4):
            for made, used in self.statements:
                found |= made if used & found else set()
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
        _, folder, *below = fault.file.split("/")
        others = {
            "plotting": ("tests/test_plotting", "tests/paper/test_figures"),
            "paper": ("tests/paper/", "tests/test_plotting"),
            "cli": ("tests/test_cli",),
        }
        return self.of(*others.get(folder, (f"tests/{folder}/",) if below else ("tests/test_",)))

    def executed(self, fault: Fault, folder: set[str]) -> set[str]:
        """The tests that execute the faulty statement, or may."""
        stem = Path(fault.file).stem.strip("_")
        if fault.how in ("import", "compiled"):
            seen = self.users(fault)
            seen |= {t for t in folder if fault.how == "compiled" or stem in self.tests[t]["file"]}
        else:
            seen = self.on(fault.file, fault.lines if fault.how == "run" else fault.body)
        # in whose file names are looked up by those that enforce the structure
        structure = set() if fault.file == f"{PACKAGE}/__init__.py" else self.of(*STRUCTURE)
        return (seen or folder) - structure

    def topical(self, fault: Fault, files: set[str]) -> set[str]:
        """The test files whose names have a word of the faulty one's."""
        stem = Path(fault.file).stem.strip("_")
        # a compiled loop is not seen to be executed: its tests are those of who calls it
        stems = self.importers(stem) if fault.how == "compiled" else {stem}
        words = [word for one in stems for word in one.split("_") if len(word) > 3] or [stem]
        words = [*(word.rstrip("s") for word in words), stem]
        return {file for file in files if any(word in Path(file).stem for word in words)}

    def choose(self, fault: Fault, deep: bool) -> list[str]:
        limit, seconds = (DEEP_TESTS, 0.6 * DEEP_SECONDS) if deep else (TESTS, 0.6 * SECONDS)
        if fault.how == "compiled":
            limit, seconds = 4 * limit, 3 * seconds  # which tests run the loop is not seen
        folder = self.topic(fault)
        seen, file = self.executed(fault, folder), {t: e["file"] for t, e in self.tests.items()}
        topical = self.topical(fault, {*file.values()})

        def near(test: str) -> bool:
            return file[test] in topical

        def quick(test: str) -> float:
            return self.tests[test]["seconds"]

        if deep:  # what a fixture or a cache computed once is credited to one test only
            seen = seen | {t for t in folder if near(t)}
            if fault.how in ("default", "import") and fault.names:
                word = re.compile("|".join(rf"\b{re.escape(n)}\b" for n in fault.names))
                wanted = {f for f in file.values() if word.search((self.root / f).read_text())}
                seen |= {t for t in file if file[t] in wanted}
        # of a condition, those that take the rarer of its ways
        ways = [self.on(fault.file, (line,)) & seen for line in fault.body if fault.how == "run"]
        rare = sorted(min((way for way in ways if way), key=len, default=set()), key=quick)
        own = sorted((t for t in seen if near(t)), key=quick)
        home = sorted((t for t in seen & folder if not near(t)), key=quick)
        # others: one of each test file, then a second of each ...
        by_file = defaultdict(list)
        for t in sorted(seen - {*own, *home}, key=quick):
            by_file[file[t]].append(t)
        spread = [t for row in zip_longest(*by_file.values()) for t in row if t is not None]
        first = []
        if fault.how in ("default", "import"):
            place = f"[{fault.file.removeprefix(PACKAGE + '/')}]"
            first = sorted(t for t in self.of(*READS_DEFAULTS) if "not_said" in t or place in t)
        pairs = [t for pair in zip_longest(home, spread) for t in pair if t]
        order = [*rare[: limit // 3], *own[: limit // 2], *pairs, *own[limit // 2 :]]
        chosen, total = first, sum(map(quick, first))
        for t in dict.fromkeys(order):
            if t not in first and len(chosen) < limit and total + quick(t) <= seconds:
                chosen.append(t)
                total += quick(t)
        return sorted(chosen or sorted(order, key=quick)[:1], key=quick)


# --- running ------------------------------------------------------------------------------------


def run(fault: Fault, tree: Path, chart: Map, deep: bool, stamp: int) -> dict[str, Any]:
    """First the tests of `choose`; where they see nothing, all others that may (`deep`)."""
    target = tree / fault.file
    original, stat = target.read_bytes(), target.stat()
    texts = {"before": clip(original, fault, None), "after": clip(original, fault, fault.text)}
    result = {**asdict(fault), **texts, "tests": 0, "caught": False, "by": None}
    began, done = time.time(), set()
    target.write_bytes(planted(tree, fault))
    os.utime(target, (10**9 + 10 * stamp, 10**9 + 10 * stamp))
    try:
        for stage in (False, True) if deep else (False,):
            with chart.lock:
                tests = [t for t in chart.choose(fault, stage) if t not in done]
            done |= set(tests)
            if tests:
                result.update(watched(tree, tests, chart, fault, stage), tests=len(done))
            if result["caught"]:
                break
    finally:
        target.write_bytes(original)
        os.utime(target, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    return {**result, "seconds": round(time.time() - began, 1)}


def watched(tree: Path, tests: list[str], chart: Map, fault: Fault, deep: bool) -> dict[str, Any]:
    """Run tests until one fails, hangs, or the time is over."""
    progress, arguments, log, temp = (
        tree.parent / f"{tree.name}.{name}" for name in ("progress", "args", "log", "tmp")
    )
    progress.write_text("")
    arguments.write_text("\n".join(tests))
    more = COMPILED_SECONDS if fault.how == "compiled" else 0.0
    budget, hang = (DEEP_SECONDS if deep else SECONDS) + more, HANG + more
    shutil.rmtree(temp, ignore_errors=True)
    temp.mkdir()
    line = [*PYTHON, *PYTEST, "-x", "-p", "watch_plugin", "--tb=line", "-rN"]
    line += [f"--basetemp={temp}/pytest", f"@{arguments}"]
    with log.open("wb") as out:
        process = subprocess.Popen(
            line, cwd=tree, env=environment(tree, PLANT_PROGRESS=str(progress), TMPDIR=str(temp)),
            stdout=out, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
    began = time.time()
    try:
        while process.poll() is None:
            time.sleep(0.1)
            starts = told(progress, "start")
            since, current = starts[-1] if starts else (began, None)
            usual = chart.tests.get(current, {}).get("seconds", 0.0)
            if time.time() - since > max(hang, FACTOR * usual):
                return {"caught": True, "by": f"{current} (hangs)"}
            if time.time() - began > budget:
                note = f"out of time after {len(starts)} of {len(tests)} tests"
                return {"caught": False, "note": note}
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        shutil.rmtree(temp, ignore_errors=True)
    if process.returncode == 0:
        return {"caught": False}
    for _, test in told(progress, "failed"):
        return {"caught": True, "by": test}
    said = log.read_text(errors="replace")[-200:]
    return {"caught": True, "by": f"pytest ends with {process.returncode}: {said}"}


def told(progress: Path, what: str) -> list[tuple[float, str]]:
    """When the tests began, or failed, and their names."""
    rows = (line.split("\t", 2) for line in progress.read_text().splitlines())
    return [(float(when), name) for event, when, name in rows if event == what]


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


def copies(root: Path, out: Path, many: int) -> list[Path]:
    """Of the checkout, as it was when this began."""
    trees = [HOME / "copies" / f"{out.stem}-{i}" for i in range(many)]
    for tree in trees:
        tree.mkdir(parents=True, exist_ok=True)
        copy(root, tree)
    return trees


def show(root: Path, faults: list[tuple[int, Fault]]) -> None:
    for i, one in faults:
        raw = (root / one.file).read_bytes()
        print(f"{i} {one.file}:{one.line} {one.kind} {one.how}")
        print(f"  - {clip(raw, one, None)}\n  + {clip(raw, one, one.text)}")


def campaign(
    faults: list[tuple[int, Fault]], trees: list[Path], chart: Map, out: Path, given: Any
) -> None:
    """Plant the faults that the file does not know yet, one in a tree at a time."""
    key = hashlib.sha256(b"".join(t.encode() for t in chart.texts.values())).hexdigest()[:12]
    known = out.read_text().splitlines() if out.exists() else []
    done, free = {json.loads(line)["index"] for line in known}, queue.SimpleQueue[Path]()
    for tree in trees:
        free.put(tree)

    def work(index: int, fault: Fault) -> dict[str, Any]:
        tree = free.get()
        try:
            row = run(fault, tree, chart, not given.quick, index + 1)
        finally:
            free.put(tree)
        return {"index": index, "seed": given.seed, "source": key, **row}

    with ThreadPoolExecutor(len(trees)) as pool:
        for one in as_completed([pool.submit(work, *one) for one in faults if one[0] not in done]):
            row = one.result()
            with out.open("a") as stream:
                stream.write(json.dumps(row) + "\n")
            what, why = "caught" if row["caught"] else "SURVIVED", row["by"] or row.get("note", "")
            print(row["index"], what, row["file"], row["line"], row["seconds"], why, flush=True)
    report(out)


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
    out = given.out or HOME / f"faults-{given.seed}.jsonl"
    root, *others = copies(Path(given.checkout).resolve(), out, given.processes)
    if given.again:
        faults = again(root, given.again)
    else:
        faults = list(enumerate(draw(root, given.seed, given.number)))
    if given.list:
        return show(root, faults)
    if given.clean:
        return clean(root, given.clean)
    chart = Map(root)
    if stale := chart.stale():
        print("the map is older than these, renew it with record.py:", *stale, file=sys.stderr)
    return campaign(faults, [root, *others], chart, out, given)


def clean(tree: Path, path: Path) -> None:
    """Any test that fails here caught nothing: it fails by itself."""
    caught = {json.loads(line)["by"] or "" for line in path.read_text().splitlines()}
    tests = sorted(by for by in caught if by.startswith("tests/") and "(hangs)" not in by)
    arguments = tree.parent / f"{tree.name}.clean"
    arguments.write_text("\n".join(tests))
    line = [*PYTHON, *PYTEST, "--tb=line", f"@{arguments}"]
    subprocess.run(line, cwd=tree, env=environment(tree, PLANT_PROGRESS=os.devnull), check=False)


def again(root: Path, path: Path) -> list[tuple[int, Fault]]:
    """The survivors of a campaign; where the source has changed, found by their line's text."""
    by_text = defaultdict(list)
    for src, faults in all_faults(root):
        for f in faults:
            by_text[f.file, f.kind, clip(src.raw, f, None), clip(src.raw, f, f.text)].append(f)
    found = []
    for r in map(json.loads, path.read_text().splitlines()):
        same = by_text.get((r["file"], r["kind"], r["before"], r["after"]))
        if same and not r["caught"]:
            found.append((r["index"], min(same, key=lambda f: abs(f.line - r["line"]))))
        elif not r["caught"]:
            print(r["index"], "is not there any more:", r["file"], r["before"], file=sys.stderr)
    return found


if __name__ == "__main__":
    main()
