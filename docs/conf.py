"""How the documentation is built: ``sphinx-build docs docs/_build/html``, no network needed."""

from __future__ import annotations

from importlib.metadata import version as installed
from pathlib import Path

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
exclude_patterns = ["_build", "jupyter_execute", "**/.ipynb_checkpoints"]

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

if any(EXAMPLES.glob("*.py")):  # each is run: its page shows the figure that it really draws
    extensions.append("sphinx_gallery.gen_gallery")
    sphinx_gallery_conf = {
        "examples_dirs": str(EXAMPLES),
        "gallery_dirs": "auto_examples",
        "filename_pattern": r"\.py$",
        "download_all_examples": False,
        "show_memory": False,
    }
