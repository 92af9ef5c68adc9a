"""What pages are found by, besides their own words: the topics that `search.js` has for them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from docutils import nodes

TOPICS: dict[str, str] = json.loads(
    re.findall(
        r"^const TOPICS = (\{.*?\});",
        Path(__file__).with_name("search.js").read_text(encoding="utf-8"),
        flags=re.MULTILINE | re.DOTALL,
    )[0]
)


def add_keywords(app: Any, document: Any) -> None:
    """A page is searched for all words at once: so it has those of its topics, too."""
    words = TOPICS.get(app.env.docname, "").split()
    if words:
        document += nodes.meta("", name="keywords", content=", ".join(words))


def setup(app: Any) -> dict[str, bool]:
    app.connect("doctree-read", add_keywords)
    return {"parallel_read_safe": True}
