"""The explorer in a real browser, clicked and typed through as a person would."""

from __future__ import annotations

import re
import shutil
import signal
from collections.abc import Iterator
from colorsys import rgb_to_hsv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb

from ..apart import HUNG, begun

pytestmark = pytest.mark.slow
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update",
]  # fmt: skip


def chromium() -> str:
    """Where it is, or why these tests are left out."""
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
    if found is None:
        pytest.skip("no chromium is installed (apt-get install chromium)")
    return found


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of an explorer with a server of its own, which lasts as long as it is needed."""
    chromium()
    explore, folder = ("-m", "contbreather", "explore", "--headless"), tmp_path_factory.mktemp("in")
    with begun(*explore, cwd=folder, hung=10 * HUNG) as process:
        assert process.stdout is not None
        yield process.stdout.readline().split()[4]
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    path = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        one = play.chromium.launch(executable_path=path, args=FLAGS, timeout=1e3 * HUNG)
        yield one
        one.close()


WIDE = {"width": 1280, "height": 1000}
MAIN = "(document.querySelector('#main'))"
# of the zone diagram, which is drawn on a canvas
TITLE = """() => {
  for (const one of globalThis.Bokeh?.documents ?? [])
    for (const model of one._all_models.values())
      if (model.type == "Title" && /^\\s*(infinite chain, k = |no diagram)/.test(model.text))
        return model.text.trim()
  return ""
}"""
# what has the focus, inside of shadow roots too
FOCUSED = """() => {
  let one = document.activeElement
  while (one?.shadowRoot?.activeElement) one = one.shadowRoot.activeElement
  return one ? (one.innerText || one.name || one.tagName).trim() : ""
}"""
# how the focus is seen: a button has an outline, or a shadow around it
RING = """() => {
  let one = document.activeElement
  while (one?.shadowRoot?.activeElement) one = one.shadowRoot.activeElement
  const style = getComputedStyle(one)
  return one.tagName != "BUTTON" || style.outlineStyle != "none" || style.boxShadow != "none"
}"""


class Tab:
    """A page of the browser of somebody who prefers the dark, with all that it asked for and
    complained of."""

    def __init__(self, page: Any, address: str) -> None:
        self.page = page
        self.page.set_default_timeout(1e3 * HUNG)
        self.asked: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._heard)
        self.page.goto(address)
        self.page.wait_for_url("**/?theme=dark")
        self.page.wait_for_function(f"({TITLE})().startsWith('infinite chain, k = ')")
        self.page.wait_for_function("globalThis.Bokeh?.documents?.[0]?.is_idle")

    def _heard(self, message: Any) -> None:
        if message.type == "error":
            self.complaints.append(message.text)

    def colour(self, of: Any, what: str = "color") -> tuple[int, ...]:
        """Red, green and blue of something, as it is drawn."""
        drawn = of.evaluate(f"one => getComputedStyle(one).{what}")
        return tuple(map(int, re.findall(r"\d+", drawn)[:3]))

    def press(self, name: str) -> None:
        """Press a button as soon as it can be."""
        self.page.get_by_role("button", name=name, exact=True).click()

    def field(self, label: str) -> Any:
        return self.page.get_by_label(label, exact=True).first

    def reads(self, words: str) -> None:
        """Wait until it is somewhere on the page."""
        self.page.get_by_text(words).first.wait_for()

    def curve(self, name: str) -> None:
        """Wait until there is a curve of that name."""
        self.page.get_by_role("checkbox", name=name, exact=True).wait_for()

    def tap(self, card: str, x: float, y: float) -> None:
        """Click into a figure, by parts of its box."""
        box = self.page.locator(f".{card} .bk-Figure").bounding_box()
        self.page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


@dataclass(frozen=True)
class Story:
    """What a person did first of all, and took away."""

    saved: str
    script: str
    figure: str


@pytest.fixture(scope="module")
def told(browser: Any, address: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """One page for all tests, which may come in any order: that with a story on it."""
    page = browser.new_page(color_scheme="dark", viewport=WIDE)
    tab = Tab(page, address)
    yield tab, story(tab, tmp_path_factory.mktemp("taken") / "explored.py")
    assert tab.complaints == []
    page.close()


@pytest.fixture
def tab(told: tuple[Tab, Story]) -> Tab:
    return told[0]


def story(tab: Tab, script: Path) -> Story:
    tab.tap("zones", 0.35, 0.4)
    tab.reads("own lattice")
    tab.field("amplitude a").fill("0.7")
    tab.field("coupling γ").fill("0.04")
    tab.press("Show")
    tab.reads("symmetric(a=0.7, gamma=0.04, k=0.8)")
    tab.press("Continue")
    label = tab.field("special point")
    label.locator("option", has_text="PF1").wait_for(state="attached")
    label.select_option("PF1")
    tab.reads("PF1 on branch1")
    tab.press("Switch branch here")
    tab.curve("arms2[1]")
    tab.press("Trace this boundary")
    tab.curve("line3")
    tab.tap("branches", 0.9, 0.35)
    tab.press("Simulate from here")
    tab.page.locator(".run").wait_for()
    tab.press("Save all curves")
    tab.reads("Wrote /")
    with tab.page.expect_download() as one:
        tab.page.get_by_text("Export Python code").click()
    one.value.save_as(script)
    with tab.page.expect_download() as other:
        tab.page.get_by_text("Export figure").click()
    saved = re.search(r"Wrote (/\S+)\.", tab.page.get_by_text("Wrote /").inner_text())
    assert saved
    return Story(saved[1], script.read_text("utf-8"), other.value.suggested_filename)


def test_nothing_is_asked_for_elsewhere(tab: Tab, address: str) -> None:
    tab.reads("Zones")
    own = (address, address.replace("http", "ws"), "data:", "blob:")
    assert [url for url in tab.asked if not url.startswith(own)] == []


def test_a_whole_story(told: tuple[Tab, Story]) -> None:
    """It is clicked through when the page is opened; the script makes what was saved."""
    taken = told[1]
    lines = [line for line in taken.script.splitlines() if "save_figure" not in line]
    made: dict[str, Any] = {}
    exec("\n".join(line for line in lines if not line.startswith("zones =")), made)
    saved = cb.load(taken.saved)
    np.testing.assert_array_equal(saved["branch1"]["p"], made["branch1"]["p"])
    np.testing.assert_array_equal(saved["arms2_1"]["t1"], made["arms2"][1]["t1"])
    assert taken.figure == "zones.pdf"


def test_long_work_shows_how_far_it_is_and_is_stopped(tab: Tab) -> None:
    tab.press("Show")
    tab.field("periods").fill("40000")
    tab.field("sites").fill("200")
    tab.press("Simulate from here")
    tab.reads("of 40000 periods")
    tab.press("Stop")
    tab.reads("stopped; what was done is kept")


# moves the slider, and tells from then on where it has been
SLIDE = """to => {
  const all = [...Bokeh.documents[0]._all_models.values()]
  const slider = all.find(one => one.type == "Slider" && one.title.startsWith("restitution"))
  globalThis.been = []
  slider.properties.value.change.connect(() => been.push(slider.value))
  slider.value = to
}"""


def test_of_two_tabs_that_move_a_slider_at_once_both_show_the_last(tab, browser, address):
    """What one is told by the server passes on its way what is done there."""
    page = browser.new_page(color_scheme="dark", viewport=WIDE)
    late: list[Any] | None = None

    def pass_on(line: Any) -> None:
        def heard(message: Any) -> None:
            line.send(message) if late is None else late.append((line, message))

        line.connect_to_server().on_message(heard)

    page.route_web_socket("**/ws*", pass_on)
    other = Tab(page, f"{address}?theme=dark")  # where the first one was sent
    late = []
    tab.page.evaluate(SLIDE, 0.61)
    while not any("0.61" in str(message) for _, message in late):
        page.wait_for_timeout(10)
    page.evaluate(SLIDE, 0.66)
    tab.page.wait_for_function("been.at(-1) == 0.66")
    for line, message in late:
        line.send(message)
    late = None
    page.wait_for_function("been.includes(0.61) && been.at(-1) == 0.66")
    assert tab.page.evaluate("been") == [0.61, 0.66]
    page.close()
    assert other.complaints == []


def test_bad_input_is_refused_below_the_button(tab: Tab) -> None:
    tab.field("amplitude a").fill("much")
    tab.press("Show")
    tab.reads("a = 'much': the amplitude")
    said = tab.page.get_by_text("a = 'much': the amplitude")
    hue, saturation, _ = rgb_to_hsv(*tab.colour(said))
    assert min(hue, 1 - hue) < 1 / 24  # red on dark paper is a lighter one
    assert saturation > 0.4
    tab.field("amplitude a").fill("0.5")
    tab.press("Show")
    tab.page.get_by_text("a = 'much': the amplitude").wait_for(state="hidden")


def test_all_is_done_without_a_mouse(tab: Tab) -> None:
    tab.press("Show")
    tab.press("Continue")
    tab.page.get_by_role("checkbox", name="branch").first.wait_for()  # there is a curve to save
    keys = tab.page.keyboard
    tab.page.get_by_role("slider").first.focus()
    before = tab.page.evaluate(TITLE)
    keys.press("ArrowLeft")
    tab.page.wait_for_function(f"before => ({TITLE})() != before", arg=before)
    tab.field("amplitude a").focus()
    wanted, names = {"Show", "Continue", "Simulate from here", "Save all curves"}, []
    while not wanted <= {*names}:
        keys.press("Tab")
        names.append(tab.page.evaluate(FOCUSED))
        assert tab.page.evaluate(RING), f"{names[-1]} has the focus, and nobody sees it"
        assert len(names) < 60, names


# Whether nothing is cut off at the side.
FITS = "(one => one.scrollWidth <= one.clientWidth)" + MAIN


def test_it_fits_its_window_wide_and_narrow(tab: Tab) -> None:
    """Also with more curves than have room for their boxes beside each other."""
    boxes = tab.page.get_by_role("checkbox")
    tab.press("Show")
    while (count := boxes.count()) < 9:
        tab.press("Continue")
        boxes.nth(count).wait_for()
    assert tab.page.evaluate(FITS)
    tab.page.set_viewport_size({"width": 700, "height": 1000})
    tab.page.wait_for_function(f"(one => one.scrollHeight > 2000){MAIN}")  # below each other
    tab.page.wait_for_function(FITS)  # figures take their new width one after the other
    tab.page.set_viewport_size(WIDE)


def test_who_prefers_the_dark_is_given_it(tab: Tab) -> None:
    tab.page.get_by_role("link", name="light").wait_for()
    assert sum(tab.colour(tab.page.locator("body"), "backgroundColor")) < 3 * 64


# of the titles of all figures
TYPE = """() => [...Bokeh.documents[0]._all_models.values()]
  .filter(one => one.type == "Title").map(one => one.text_font_size)"""


def test_titles_on_dark_paper_are_in_the_type_by_which_their_lines_are_broken(tab: Tab) -> None:
    assert {*tab.page.evaluate(TYPE)} == {"13px"}
