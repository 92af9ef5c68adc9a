"""How the documentation is built: ``sphinx-build docs docs/_build/html``, no network needed."""

from __future__ import annotations

import logging
import re
import shutil
import sys
import warnings
from contextlib import ExitStack
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

from matplotlib import pyplot
from sphinx.errors import ExtensionError

from contbreather.parameters import table

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / "examples"
sys.path.insert(0, str(HERE))
# a theme's package has all loggers speak: the examples print what is worth it
logging.getLogger("contbreather").setLevel(logging.WARNING)

project = "contbreather"
author = "the contbreather authors"
copyright = "2026, the contbreather authors"
release = version = installed("contbreather")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "links",  # these two are beside this file
    "topics",
    "sphinx-mathjax-offline",  # MathJax beside the pages: formulas need no network either
]
# What the gallery leaves beside its pages is not a page.
exclude_patterns = ["_build", "jupyter_execute", "auto_examples/*.ipynb", "**sg_execution_times*"]
suppress_warnings = ["config.cache"]  # the gallery's settings hold functions

myst_enable_extensions = ["amsmath", "dollarmath", "deflist", "substitution"]
HEAD = ("name", "what it is", "range, or how it is typed", "unit", "unless given")
ROWS = [HEAD, ("---",) * len(HEAD), *table()]
myst_substitutions = {"parameters": "\n".join(f"| {' | '.join(row)} |" for row in ROWS)}
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_timeout = 120
nb_execution_raise_on_error = True

templates_path = ["_templates"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"contbreather {release}"
html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_search_scorer = str(HERE / "search.js")


def saved_figures(block: Any, found: dict[str, Any], settings: dict[str, Any]) -> str:
    """Show the figures that an example saved: it writes files, as it does for everybody else."""
    from sphinx_gallery.scrapers import figure_rst

    shown = []
    for figure in sorted(Path(found["src_file"]).parent.glob("*.png")):
        shown.append(next(found["image_path_iterator"]))
        shutil.move(figure, shown[-1])
    return str(figure_rst(shown, settings["src_dir"]))


WARNED = ExitStack()


def warnings_are_errors(settings: dict[str, Any], name: str, when: str) -> None:
    """Fail an example that is warned, but for what other packages deprecate among themselves, and
    of figures that those before it left."""
    if when == "after":
        WARNED.close()
        pyplot.close("all")
        return
    WARNED.enter_context(warnings.catch_warnings())
    warnings.simplefilter("error")
    for later in (DeprecationWarning, PendingDeprecationWarning, FutureWarning):
        warnings.simplefilter("default", later)


PRINTED = re.compile(r"^ \.\. code-block:: none\n((?:\n| .*\n)+)", flags=re.MULTILINE)


def numbers_are_numbers(app: Any, page: str, source: list[str]) -> None:
    """Fail where an example prints nothing, or what is no number."""
    folder, _, name = page.rpartition("/")
    told = "".join(PRINTED.findall(source[0]))
    if folder == "auto_examples" and name in STORY and (not told or "nan" in told):
        raise ExtensionError(f"{page} prints {told!r}")


STORY = (
    "breather", "branch", "zones", "switching", "beyond_grazing", "lattice", "disorder",
    "measurement", "shooting", "simulate", "smooth_walls", "your_own_problem", "henon", "lorenz",
    "pendulum", "bouncing_ball", "impact_oscillator", "stick_slip", "backbone", "brusselator",
    "henon_heiles", "oscillators", "phi4", "driven_pendula",
)  # fmt: skip


class InTheOrderOfTheStory:
    """Each example builds on those before it; one that is not named comes last."""

    def __init__(self, folder: str) -> None:
        pass

    def __call__(self, name: str) -> tuple[int, str]:
        stem = Path(name).stem
        return (STORY.index(stem) if stem in STORY else len(STORY), stem)


if any(EXAMPLES.glob("*.py")):  # each is run: its page shows what it really draws
    extensions.append("sphinx_gallery.gen_gallery")
    sphinx_gallery_conf = {
        "examples_dirs": str(EXAMPLES),
        "gallery_dirs": "auto_examples",
        "filename_pattern": r"\.py$",
        "image_scrapers": (saved_figures,),
        "reset_modules": ("matplotlib", warnings_are_errors),
        "reset_modules_order": "both",
        "within_subsection_order": InTheOrderOfTheStory,
        "thumbnail_size": (400, 400),
        "download_all_examples": False,
        "show_memory": False,
    }


def bars_are_bars(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """``|mu|`` in a docstring is a modulus, not a substitution."""
    for i, line in enumerate(lines):
        parts = line.split("``")
        parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
        lines[i] = "``".join(parts)


def setup(app: Any) -> None:
    app.connect("autodoc-process-docstring", bars_are_bars)
    app.connect("source-read", numbers_are_numbers)
