"""After a build: what a page points to is there, and no page fetches anything from elsewhere."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

LOADS = {"img": "src", "script": "src", "link": "href", "source": "src", "iframe": "src"}


class Page(HTMLParser):
    """The names a page has, the places it links to, and the files it needs to be shown."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.links: set[str] = set()
        self.needs: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attrs if value}
        self.names |= {given[name] for name in ("id", "name") if name in given}
        # from its source an object leads back to one of its names, not always the one shown
        if tag == "a" and "href" in given and "viewcode-back" not in given.get("class", ""):
            self.links.add(given["href"])
        if LOADS.get(tag) in given:
            self.needs.add(given[LOADS[tag]])


def broken(root: Path) -> list[str]:
    """Each link of a site that leads nowhere, and each file that it would fetch."""
    pages = {path.resolve(): Page(path) for path in sorted(root.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        for target in sorted(page.links | page.needs):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                fetched = target in page.needs and parts.scheme != "data"
                found += [f"{path.name} fetches {target}"] if fetched else []
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            place = unquote(parts.fragment)
            unknown = place and there in pages and place not in pages[there].names
            if not there.exists() or unknown:
                found.append(f"{path.name} links to {target}, which is not there")
    return found


def check(app: Any, failed: Exception | None) -> None:
    from sphinx.util import logging

    if failed is None and app.builder.format == "html":
        for line in broken(Path(app.outdir)):
            logging.getLogger(__name__).warning(line, type="links")


def setup(app: Any) -> dict[str, bool]:
    app.connect("build-finished", check, priority=900)  # after those who copy files
    return {"parallel_read_safe": True}
