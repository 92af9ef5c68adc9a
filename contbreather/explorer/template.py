"""The page around an explorer in a browser: its heading, and the switch between light and dark."""

from __future__ import annotations

from typing import Any

import panel as pn

from contbreather.explorer.page import Page
from contbreather.explorer.session import Session

# the first time a page follows what the system of its reader prefers
FOLLOW = """
if (!location.search.includes("theme=") && matchMedia("(prefers-color-scheme: dark)").matches)
  location.replace("?theme=dark")
"""
# Sliders have no name for those who read by ear; they are drawn anew now and then.
NAMES = """
const name = root => {
  for (const one of root.querySelectorAll("*")) if (one.shadowRoot) {
    const handle = one.shadowRoot.querySelector(".noUi-handle")
    const title = one.shadowRoot.querySelector(".bk-slider-title")
    if (handle && title) handle.ariaLabel = title.textContent.split(":")[0]
    name(one.shadowRoot)
  }
}
setInterval(() => name(document), 1000)
"""
LINK = """
a { color: inherit; font-size: 14px; }
"""


def in_template(explorer: Session) -> Any:
    """A new page of an explorer."""
    dark = pn.config.theme == "dark"
    other = "default" if dark else "dark"
    link = pn.pane.HTML(
        f'<a href="?theme={other}">{"light" if dark else "dark"}</a>'
        f"<script>{FOLLOW}{NAMES}</script>",
        stylesheets=[LINK],
        align="end",
    )  # fmt: skip
    return pn.template.BootstrapTemplate(
        title="contbreather explorer",
        theme="dark" if dark else "default",
        header=[link],
        main=[Page(explorer).layout],
    )
