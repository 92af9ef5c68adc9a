"""The fields and buttons beside the figures; what is refused is said below them."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from html import escape
from io import BytesIO, StringIO
from typing import Any

import panel as pn
from bokeh.models.widgets import Div

from contbreather.errors import BadInput, ContbreatherError
from contbreather.explorer import jobs
from contbreather.explorer.session import Session
from contbreather.explorer.state import RING, Chosen, PageState
from contbreather.explorer.style import CARD, FOCUSED, FORMS, WORDS
from contbreather.orbits.zone_diagram import unit_of
from contbreather.parameters import CHOICES, NEEDED, NUMBERS, window_of

# where walks go unless a window is typed
REACH = {**{name: window_of(name) for name in (*NEEDED, "omega")}, "a": (0.01, 1.2)}
FIRST = ("Show", "Continue")  # the buttons that most begin with
TEXTS = ("forcing", "lattice", "walls", "path")  # fields of words, also where these are digits


def number_or_text(typed: str) -> Any:
    """Read a number, whole ones as such however typed ("1e5"); what is none the library refuses,
    and says what it wants."""
    with suppress(ValueError):
        value = float(typed)
        return int(value) if value.is_integer() else value
    return typed


def text_field(label: str, value: str, hint: str = "") -> Any:
    return pn.widgets.TextInput(
        label=label, value=value, placeholder=hint, sizing_mode="stretch_width", margin=(2, 5)
    )


def usual_window(name: str, orbit: Any, omega: float) -> tuple[float, float]:
    """Window of a parameter unless one is typed, in units of the frequency, walls and drive of an
    orbit, and around its own value in any case."""
    low, high = REACH.get(name, (0.0, 1.0))
    if orbit is None:
        return low, high
    unit = unit_of(name, orbit.lattice, omega)
    if name == "a":  # to beyond where the far field comes to the walls
        walls = orbit.walls.at(orbit.section.hit[0])
        unit *= max(abs(wall) for wall in walls if math.isfinite(wall)) / orbit.forcing.peak()
    value = {**orbit.forcing.params, **vars(orbit.conditions)}[name]
    if not unit * low <= value <= unit * high:
        return value - abs(value), value + abs(value)
    return unit * low, unit * high


class Words:
    """A piece of HTML, there as long as it says something.

    It is Bokeh's own: a pane of Panel fetches its style from elsewhere with each change of its
    text in a notebook. There changes of Bokeh's models have to be pushed.
    """

    def __init__(self) -> None:
        self.text = Div(
            sizing_mode="stretch_width", disable_math=True, margin=(0, 5), visible=False
        )
        self.view = pn.pane.Bokeh(self.text, stylesheets=[WORDS])
        self.html = ""

    def show(self, html: str) -> None:
        if html == self.html:
            return
        self.html, document = html, self.text.document
        if document is not None and document.session_context is not None:
            document.add_next_tick_callback(self._change)  # of a server: when that is allowed
        else:
            self._change()

    def _change(self) -> None:
        self.text.update(text=self.html, visible=bool(self.html))
        pn.io.push_notebook(self.view)


class ErrorLabel(Words):
    """Sentence that is there when something is wrong; screen readers say it."""

    def say(self, sentence: str) -> None:
        html = f'<div class="trouble" role="alert">{escape(sentence)}</div>'
        self.show(html if sentence else "")


def button(label: str, do: Callable[[], object], **look: Any) -> Any:
    made: Any = pn.widgets.Button(label=label, stylesheets=[FOCUSED], **look)
    made.on_click(lambda _: do())
    return made


def tried(do: Callable[[], object], say: Callable[[str], object]) -> None:
    try:
        do()
    except ContbreatherError as error:
        say(str(error))
    else:
        say("")


def in_rows(fields: Iterable[Any], across: int) -> Any:
    every = [*fields]
    rows = [pn.Row(*every[i : i + across], margin=0) for i in range(0, len(every), across)]
    return pn.Column(*rows, sizing_mode="stretch_width", margin=0)


# --- forms ----------------------------------------------------------------------------------------


def titled_box(title: str, *parts: Any, css: Iterable[str] = ()) -> Any:
    head = pn.pane.HTML(f"<h2>{title}</h2>", stylesheets=[WORDS], margin=(0, 5))
    return pn.Column(
        head, *parts, sizing_mode="stretch_width", stylesheets=[CARD], css_classes=["card", *css]
    )


class PageForms:
    """Cards of fields and buttons, below each other in `view`."""

    def __init__(self, explorer: Session) -> None:
        self.explorer = explorer
        self.buttons: dict[str, Any] = {}
        self.troubles: dict[str, ErrorLabel] = {}  # by the title of the card that they are on
        self.orbit: Any = None  # the one whose parameters the fields show
        self.replaced = ""  # the file that the next press of the button replaces
        parts = (self._breather(), self._walks(), self._special(), self._run(), self._keep())
        self.view = pn.Column(
            *parts, sizing_mode="stretch_width", css_classes=["forms"], margin=0,
            stylesheets=[FORMS],
        )  # fmt: skip

    def _card(self, title: str, *parts: Any) -> Any:
        """Make a card. A name, what it does and the fields that this takes are a button; below all
        of it is said why not."""
        trouble = self.troubles[title] = ErrorLabel()
        shown = [self._button(trouble, *p) if isinstance(p, tuple) else p for p in parts]
        return titled_box(title, *shown, trouble.view)

    def _button(
        self, trouble: ErrorLabel, name: str, do: Callable[..., object], fields: Mapping[str, Any]
    ) -> Any:
        color = "primary" if name in FIRST else "default"
        look = {"sizing_mode": "stretch_width", "margin": (3, 5), "color": color}

        def read_and_do() -> None:
            typed = {name: field.value.strip() for name, field in fields.items()}
            do(**{n: text if n in TEXTS else number_or_text(text) for n, text in typed.items()})

        self.buttons[name] = button(name, partial(tried, read_and_do, trouble.say), **look)
        return self.buttons[name]

    def _breather(self) -> Any:
        name, value = self.explorer.state.fixed
        first = {name: f"{NUMBERS[name].first:g}" for name in NEEDED}
        first |= {"site": str(CHOICES["site"].default), name: f"{value:g}"}
        self.breather = {name: text_field(NUMBERS[name].label, first[name]) for name in NEEDED}
        for name in ("forcing", "lattice", "site", "spring", "damping", "omega", "walls"):
            entry = CHOICES.get(name) or NUMBERS[name]
            hint = f"{entry.default:g}" if name == "omega" else str(entry.default or "none")
            self.breather[name] = text_field(entry.label, first.get(name, ""), hint)
        # 1 has the largest p, admissible or not
        self.breather["root"] = text_field("root, by p", "", "upper")
        button = "Show", self.explorer.choose_typed, self.breather
        return self._card("Breather", in_rows(self.breather.values(), 2), button)

    def _walks(self) -> Any:
        self.free = pn.widgets.Select(label="in", options=list(NEEDED), sizing_mode="stretch_width")
        self.usual = low, high = [f"{end:g}" for end in REACH["a"]]
        self.window = {"low": text_field("from", low), "high": text_field("to", high)}
        self.free.param.watch(self._usual_window, "value")
        fields = pn.Row(self.free, *self.window.values(), margin=0)

        def trace(low: float, high: float) -> None:
            self._begin(jobs.traced, self.free.value, (low, high))

        return self._card("Continue from here", fields, ("Continue", trace, self.window))

    def _begin(self, job: Callable[..., jobs.Computation], *typed: Any, **more: Any) -> None:
        self.explorer.begin(job(self.explorer.chosen, *typed, **more))

    def _usual_window(self, _: object = None) -> None:
        chosen, name = self.explorer.state.chosen, self.free.value
        orbit = None if chosen is None else chosen.orbit
        window = usual_window(name, orbit, 1.0 if orbit is None else orbit.omega)
        self.usual = [f"{end:g}" for end in window]
        for field, text in zip(self.window.values(), self.usual, strict=True):
            field.value = text

    def _special(self) -> Any:
        self.first = pn.widgets.Select(label="in", options=list(NEEDED), value="gamma", width=120)
        self.second = pn.widgets.Select(label="and", options=list(NEEDED), value="a", width=120)

        def trace() -> None:
            pair, orbit = (self.first.value, self.second.value), self.explorer.chosen.orbit
            omega = REACH["omega"][1] if "omega" in pair or orbit is None else orbit.omega
            within = {name: usual_window(name, orbit, omega) for name in pair if name in REACH}
            self._begin(jobs.bounded, pair, within)

        return self._card(
            "From a special point",
            ("Switch branch here", lambda: self._begin(jobs.switched), {}),
            pn.Row(self.first, self.second, margin=0),
            ("Trace this boundary", trace, {}),
        )

    def _run(self) -> Any:
        self.length = {
            "sites": text_field("sites", str(RING)),
            "periods": text_field("periods", "100"),
            "push": text_field("push", "1e-6"),
        }

        def simulate(**typed: Any) -> None:
            self._begin(jobs.simulated, **typed, sampled=self.explorer.state.sites)

        button = "Simulate from here", simulate, self.length
        return self._card("Simulation", in_rows(self.length.values(), 3), button)

    def _keep(self) -> Any:
        self.file = text_field("file", "run.nc")
        self.what = pn.widgets.Select(
            label="figure", options=["zones", "branches", "simulation"], width=120
        )
        self.suffix = pn.widgets.Select(label="format", options=[".pdf", ".svg", ".png"], width=90)
        look = {"sizing_mode": "stretch_width", "margin": (3, 5), "stylesheets": [FOCUSED]}
        self.figure = pn.widgets.FileDownload(
            callback=self._figure, filename="zones.pdf", label="Export figure", **look
        )
        self.script = pn.widgets.FileDownload(
            callback=lambda: StringIO(self.explorer.script()), filename="explored.py",
            label="Export Python code", **look,
        )  # fmt: skip

        def renamed(_: object) -> None:
            self.figure.filename = f"{self.what.value}{self.suffix.value}"
            self._enable_figure(self.explorer.state)

        for select in (self.what, self.suffix):
            select.param.watch(renamed, "value")
        which = pn.Row(self.what, self.suffix, margin=0)
        button = "Save all curves", self._save, {"path": self.file}
        return self._card("Keep", self.file, button, which, self.figure, self.script)

    def _enable_figure(self, state: PageState) -> None:
        """Enable its button where there is something to draw: a download has no other answer."""
        there = {
            "zones": state.plane is not None and not state.awaited,
            "branches": bool(state.shown),
            "simulation": state.run is not None,
        }
        self.figure.disabled = not there[self.what.value]

    def _figure(self) -> BytesIO:
        trouble = self.troubles["Keep"]
        try:
            figure = self.explorer.figure(self.what.value, self.suffix.value)
        except BadInput as error:
            trouble.say(str(error))
            raise  # there is no file then
        trouble.say("")
        return BytesIO(figure)

    def _save(self, path: str) -> None:
        if path not in ("", self.replaced) and os.path.exists(path):  # of any text
            self.replaced = path
            raise BadInput(f"{path} exists: press again to replace it, or name another file.")
        self.replaced = ""
        self.explorer.keep(path)

    def render(self, state: PageState) -> None:
        """Enable the buttons that can do something now, and show the parameters of what is
        chosen."""
        chosen, busy = state.chosen, self.explorer.busy
        can = {
            "Continue": chosen is not None and chosen.orbit is not None,
            "Switch branch here": chosen is not None and chosen.switches,
            "Trace this boundary": chosen is not None and chosen.traces,
            "Simulate from here": chosen is not None and chosen.orbit is not None,
            "Save all curves": bool(state.curves),
        }
        for name, possible in can.items():
            self.buttons[name].disabled = busy or not possible
        self._enable_figure(state)
        if chosen is not None:
            for select in (self.free, self.first, self.second):
                offered(select, list(chosen.free))
            if (one := self.first.value) == self.second.value:  # neither was among them
                self.second.value = next((name for name in chosen.free if name != one), one)
            self._say_where(chosen)

    def _say_where(self, chosen: Chosen) -> None:
        orbit = chosen.orbit
        if orbit is None or orbit is self.orbit:
            return
        self.orbit, sites = orbit, self.length["sites"]
        size = orbit.lattice.sites
        if size is not None or sites.disabled:  # of the infinite chain the ring that is judged
            sites.value = str(size or self.explorer.state.ring)
        sites.disabled = size is not None
        entries = {name: getattr(orbit, name) for name in NEEDED} | self.explorer.lives_on(chosen)
        for name, value in entries.items():
            text = f"{value:.10g}" if isinstance(value, float) else str(value)
            self.breather[name].value = "" if value is None else text
        if [field.value for field in self.window.values()] == self.usual:  # nothing is typed
            self._usual_window()


def offered(select: Any, names: list[str], value: str | None = None) -> None:
    """Offer names in a select, and keep what was selected where it is among them. Nothing is left
    unselected: a browser would select the first, and say so as if a person had done it."""
    wanted = select.value if value is None else value
    if select.options != names:
        select.options = names
    select.value = wanted if wanted in names else next(iter(names), None)
