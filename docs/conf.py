"""How the documentation is built: ``sphinx-build docs docs/_build/html``, no network needed."""

from __future__ import annotations

import shutil
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / "examples"

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
    "sphinx-mathjax-offline",  # MathJax beside the pages: formulas need no network either
]
# What the gallery leaves beside its pages is not a page.
exclude_patterns = ["_build", "jupyter_execute", "auto_examples/*.ipynb", "**sg_execution_times*"]
suppress_warnings = ["config.cache"]  # the gallery's settings hold a function

myst_enable_extensions = ["amsmath", "dollarmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_timeout = 120
nb_execution_raise_on_error = True

autodoc_typehints = "description"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"contbreather {release}"
html_show_sourcelink = False


def saved_figures(block: Any, found: dict[str, Any], settings: dict[str, Any]) -> str:
    """Show the figures that an example saved: it writes files, as it does for everybody else."""
    from sphinx_gallery.scrapers import figure_rst

    shown = []
    for figure in sorted(Path(found["src_file"]).parent.glob("*.png")):
        shown.append(next(found["image_path_iterator"]))
        shutil.move(figure, shown[-1])
    return str(figure_rst(shown, settings["src_dir"]))


if any(EXAMPLES.glob("*.py")):  # each is run: its page shows what it really draws
    extensions.append("sphinx_gallery.gen_gallery")
    sphinx_gallery_conf = {
        "examples_dirs": str(EXAMPLES),
        "gallery_dirs": "auto_examples",
        "filename_pattern": r"\.py$",
        "image_scrapers": (saved_figures,),
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
