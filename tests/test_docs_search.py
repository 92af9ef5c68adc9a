"""What people type into the search of the documentation leads to the page that answers it.

The pages are built without the interface and the tutorials, which take minutes, and asked in a
browser by Sphinx's own search with the site's scorer.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from .explorer.test_browser import FLAGS, chromium

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:.*myst_parser.*"),  # it is older than Sphinx
]
DOCS = Path(__file__).parents[1] / "docs"
# as if the page had been opened with the question
ASKED = """q => {
  history.replaceState(null, "", "?q=" + encodeURIComponent(q))
  return Search._performSearch(...Search._parseQuery(q)).reverse().map(found => found[0])
}"""

QUESTIONS = {
    "damping": "how-to/damped-ring",
    "how to plot zones": "how-to/figures",
    "export csv": "files",
    "save a branch": "files",
    "read results in matlab": "files",
    "period doubling": "switching",
    "limit cycle of an ode": "cycles",
    "random initial state": "simulation",
    "breather on a ring": "lattices",
    "network of springs": "how-to/own-lattice",
    "run in parallel": "many",
    "interrupted study": "studies",
    "hopf point": "your-own-problem",
    "floquet multipliers": "shooting",
    "install": "start",
    "coming from auto": "coming-from",
    "json output": "command-line",
    "proof": "certified",
    "fixed points of a map": "maps",
    "figure for a paper": "how-to/figures",
    "web browser": "explorer",
    "step size": "your-own-problem",
    "sliding": "cycles",
    "how to cite": "citing",
}


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """What is found for a question, the best page first."""
    pytest.importorskip("myst_parser", reason="what builds the documentation is not installed")
    path = chromium()
    from playwright.sync_api import sync_playwright
    from sphinx.application import Sphinx

    site = tmp_path_factory.mktemp("site")
    settings = {
        "extensions": ["myst_parser", "topics"],
        "html_theme": "basic",
        "html_search_scorer": str(DOCS / "search.js"),
        "exclude_patterns": ["_build", "api.md", "auto_examples", "generated"],
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(DOCS), *sys.path])
        Sphinx(
            DOCS, None, site, site / "read", "html", confoverrides=settings,
            status=None, warning=io.StringIO(),
        ).build()  # fmt: skip
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=path, args=FLAGS)
        page = browser.new_page()
        page.goto((site / "search.html").as_uri())
        page.wait_for_function("Search.hasIndex()")
        yield partial(page.evaluate, ASKED)
        browser.close()


def test_the_first_page_found_answers_the_question(asked: Any) -> None:
    assert {question: (asked(question) or [""])[0] for question in QUESTIONS} == QUESTIONS


def test_what_was_changed_and_why_comes_last(asked: Any) -> None:
    pages = asked("damping")
    history = [page.startswith(("decisions", "changelog", "architecture")) for page in pages]
    assert any(history)
    assert history == sorted(history)
