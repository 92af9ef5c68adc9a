"""README and docs: what they show is what happens.

Every Python block is executed and the output under each prompt compared, numbers to the digits
shown; so is every ``$ contbreather`` line of a console block. ``...`` stands for anything. The
blocks of a page run in order, in one namespace and in an empty directory.
"""

from __future__ import annotations

import doctest
import importlib.util
import re
import shlex
from pathlib import Path
from typing import Any

import matplotlib
import pytest
from sybil import Sybil
from sybil.evaluators.doctest import NUMBER, OutputChecker
from sybil.parsers.myst import PythonCodeBlockParser

import contbreather
from contbreather.cli import main

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
FIGURES = DOCS / "how-to" / "figures.md"
PAGES = [
    ROOT / "README.md",
    *(
        page
        for folder in (DOCS, DOCS / "how-to", DOCS / "decisions")
        for page in sorted(folder.glob("*.md"))
    ),
]
TEXT = {page: page.read_text(encoding="utf-8") for page in PAGES}
FLAGS = NUMBER | doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE

# the last of 16 digits is the machine's; of the output 13 are compared
LAST_DIGITS = re.compile(r"(\.\d{13})\d+")
CONSOLE = re.compile(r"^```console\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
# numbers below 1e-12 are rounding, which differs from machine to machine
ROUNDING = re.compile(r"-?\d+(?:\.\d+)?e-(?:1[3-9]|[2-9]\d|\d{3})")


def pages(pattern: str) -> list[Path]:
    return [page for page in PAGES if re.search(pattern, TEXT[page], flags=re.MULTILINE)]


def name_of(path: Path) -> str:
    return path.name


@pytest.fixture(autouse=True)
def empty_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")


# --- Python -------------------------------------------------------------------------------------


def carried_out(page: Path, copy: Path) -> dict[str, Any]:
    """What the blocks of a page leave, each of which gives what it shows."""
    copy.write_text(LAST_DIGITS.sub(r"\1", TEXT[page]), encoding="utf-8")
    document = Sybil([PythonCodeBlockParser(doctest_optionflags=FLAGS)]).parse(copy)
    for example in document.examples():
        example.evaluate()
    return document.namespace


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in pages("^```python$") if page != FIGURES], ids=name_of
)
def test_python_on_a_page_gives_what_it_shows(page: Path, tmp_path: Path) -> None:
    carried_out(page, tmp_path / page.name)


@pytest.mark.slow
def test_the_page_on_figures_gives_what_it_shows_and_at_last_a_finished_figure(tmp_path: Path):
    ax = carried_out(FIGURES, tmp_path / FIGURES.name)["ax"]
    ax.figure.draw_without_rendering()
    (word,), tick = ax.get_legend().get_texts(), ax.get_xticklabels()[0]
    assert word.get_fontsize() <= tick.get_fontsize()
    assert ax.get_legend().get_window_extent().y0 >= ax.bbox.y1
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$\gamma$", "$a$")


# --- commands -----------------------------------------------------------------------------------


def calm(printed: str) -> str:
    """Without what depends on the machine: rounding, and the widths of columns it changes."""
    return re.sub("([━─])+", r"\1", ROUNDING.sub("0.0", printed))


def alike(shown: str, got: str) -> bool:
    """The same lines, numbers to the digits shown."""
    shown = LAST_DIGITS.sub(r"\1", shown)
    one, other = calm(shown).strip().splitlines(), calm(got).strip().splitlines()
    check = OutputChecker().check_output
    return len(one) == len(other) and all(map(check, one, other, [FLAGS] * len(one)))


def commands(page: Path) -> list[tuple[str, str]]:
    """Each ``$ command`` of the console blocks, with what is shown under it."""
    found = []
    for block in CONSOLE.findall(TEXT[page]):
        for piece in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, shown = piece.partition("\n")
            found.append((command, shown))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("page", pages("^```console$"), ids=name_of)
def test_commands_on_a_page_print_what_it_shows(page: Path, capsys: pytest.CaptureFixture[str]):
    status = 0
    for command, shown in commands(page):
        if command == "echo $?":
            assert int(shown) == status
            continue
        program, *arguments = shlex.split(command)
        assert program == "contbreather"
        status = main(arguments)
        printed = capsys.readouterr()
        got = printed.out + printed.err
        assert alike(shown, got), f"$ {command}\n{got}"


@pytest.mark.parametrize(
    ("shown", "got"),
    [
        ("p = 0.808749", "p = 0.808752"),
        ("3 points", "4 points"),
        ("stable", "unstable"),
        ("one\ntwo", "one"),
        ("residual 1.3e-10", "residual 4.4e-10"),
    ],
)
def test_a_wrong_output_of_a_command_is_noticed(shown: str, got: str) -> None:
    assert not alike(shown, got)


@pytest.mark.parametrize(
    ("shown", "got"),
    [
        ("p = 0.808749", "p = 0.8087491299885472"),
        ("residual 1.3e-29", "residual 4.4e-16"),
        ("┏━━━┓", "┏━━━━━━┓"),
        ("... points", "57 points"),
    ],
)
def test_what_differs_between_machines_is_not(shown: str, got: str) -> None:
    assert alike(shown, got)


# --- what pages point to --------------------------------------------------------------------------


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_and_pictures_of_a_page_exist(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", TEXT[page])
    built = "auto_examples/"  # from examples/, with the site
    local = [one for one in targets if "://" not in one and not one.startswith(built)]
    assert [target for target in local if not (page.parent / target).exists()] == []


def test_tests_that_pages_name_exist() -> None:
    files = [*ROOT.glob("tests/**/test_*.py")]
    functions = re.findall(
        r"^def (test_\w+)\(", "\n".join(map(Path.read_text, files)), flags=re.MULTILINE
    )
    there = {*functions, *(file.stem for file in files)}
    assert set(re.findall(r"\btest_\w+", "\n".join(TEXT.values()))) - there == set()


def test_the_glossary_is_about_words_that_are_used() -> None:
    rows = re.findall(r"^\| ([^|]+) \|", TEXT[ROOT / "docs" / "glossary.md"], re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    package = Path(contbreather.__file__).parent
    source = "\n".join(path.read_text() for path in package.rglob("*.py"))
    assert named
    assert {name for name in named if not re.search(rf"\b{name}\b", source)} == set()


def test_every_public_name_is_on_the_page_of_the_interface() -> None:
    listed = set(re.findall(r"^\s*(?:.*:: )?(\w+)$", TEXT[ROOT / "docs" / "api.md"], re.MULTILINE))
    assert set(contbreather.__all__) - listed == set()


# --- the site ---------------------------------------------------------------------------------


def test_a_link_that_leads_nowhere_and_a_file_from_elsewhere_are_seen(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("links", DOCS / "links.py")
    assert spec is not None
    assert spec.loader is not None
    links = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(links)
    (tmp_path / "in").mkdir()
    (tmp_path / "one.html").write_text(
        '<h1 id="top-of-one">One</h1><a href="in/two.html#there">a</a><a href="#top-of-one">b</a>'
        '<a href="https://elsewhere.org/page">c</a><img src="data:image/png;base64,AA==">'
    )
    (tmp_path / "in" / "two.html").write_text('<p id="there">Two</p><a href="../one.html">a</a>')
    assert links.broken(tmp_path) == []
    (tmp_path / "three.html").write_text(
        '<a href="in/two.html#gone">a</a><a href="four.html">b</a><a href="#nothing">c</a>'
        '<script src="https://elsewhere.org/code.js"></script><img src="gone.png">'
    )
    assert [line.removeprefix("three.html ") for line in links.broken(tmp_path)] == [
        "links to #nothing, which is not there",
        "links to four.html, which is not there",
        "links to gone.png, which is not there",
        "fetches https://elsewhere.org/code.js",
        "links to in/two.html#gone, which is not there",
    ]


def test_every_page_is_in_the_contents() -> None:
    contents = TEXT[DOCS / "index.md"] + TEXT[DOCS / "decisions.md"]
    blocks = re.findall(r"```{toctree}\n(.*?)```", contents, flags=re.DOTALL)
    listed = {line for block in blocks for line in block.split() if not line.startswith(":")}
    there = {str(page.relative_to(DOCS).with_suffix("")) for page in PAGES[1:]} - {"index"}
    assert there - listed == set()


def test_each_example_is_told_in_its_place() -> None:
    story = re.search(r"STORY = \((.*?)\)", (DOCS / "conf.py").read_text(), flags=re.DOTALL)
    assert story is not None
    examples = {path.stem for path in (ROOT / "examples").glob("*.py")}
    assert set(re.findall(r'"(\w+)"', story[1])) == examples
