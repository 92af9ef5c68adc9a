"""The fields and buttons beside the figures; what is refused is said below them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from html import escape
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import panel as pn
from bokeh.models.widgets import Div

from contbreather.errors import BadInput, ContbreatherError
from contbreather.explorer import jobs
from contbreather.explorer.session import Session
from contbreather.explorer.state import RING, Chosen, PageState
from contbreather.explorer.style import CARD, FOCUSED, FORMS, WORDS
from contbreather.parameters import CHOICES, NEEDED, NUMBERS, window_of

Read = Callable[[str], Any]
# where walks go unless a window is typed
REACH = {**{name: window_of(name) for name in NEEDED}, "a": (0.01, 1.2)}
FIRST = ("Show", "Continue")  # the buttons that most begin with


def a_number(text: str) -> float:
    """Read a number; what it may be the library says."""
    try:
        return float(text)
    except ValueError:
        raise BadInput(f"{text!r} is not a number; 0.5, say, is one.") from None


def a_count(text: str) -> int:
    """Read a whole number; what it may be the library says."""
    try:
        return int(text)
    except ValueError:
        raise BadInput(f"{text!r} is not a whole number; 12, say, is one.") from None


def some_sites(text: str) -> tuple[int, ...]:
    return tuple(dict.fromkeys(map(a_count, text.replace(",", " ").split())))


def optional(read: Read) -> Read:
    return lambda text: read(text) if text.strip() else None


class Field:
    """Text field with its label above and, where it is refused, the reason below."""

    def __init__(self, label: str, value: str, read: Read, *, hint: str = "") -> None:
        self.read = read
        self.input = pn.widgets.TextInput(
            label=label, value=value, placeholder=hint, sizing_mode="stretch_width", margin=(2, 5)
        )
        self.trouble = ErrorLabel()
        self.view = pn.Column(self.input, self.trouble.view, sizing_mode="stretch_width", margin=0)

    @classmethod
    def of_the_model(cls, name: str, value: str, read: Read = str.strip) -> Field:
        """Field of a parameter of the model, by its label and default."""
        if name not in NUMBERS:
            return cls(CHOICES[name].label, value, read, hint=str(CHOICES[name].default))
        if name in NEEDED:
            return cls(NUMBERS[name].label, value, a_number)
        return cls(NUMBERS[name].label, value, optional(a_number), hint="none")


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


def read_all(fields: Mapping[str, Field]) -> dict[str, Any] | None:
    """Read fields by name; None if any was refused, each of which says so."""
    values: dict[str, Any] = {}
    for name, field in fields.items():

        def read(name: str = name, field: Field = field) -> None:
            values[name] = field.read(field.input.value or "")

        tried(read, field.trouble.say)
    return values if len(values) == len(fields) else None


def in_rows(fields: Iterable[Field], across: int) -> Any:
    views = [field.view for field in fields]
    rows = [pn.Row(*views[i : i + across], margin=0) for i in range(0, len(views), across)]
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
        self, trouble: ErrorLabel, name: str, do: Callable[..., object], fields: Mapping[str, Field]
    ) -> Any:
        def read_and_do() -> None:
            typed = read_all(fields)
            if typed is not None:
                do(**typed)

        color = "primary" if name in FIRST else "default"
        look = {"sizing_mode": "stretch_width", "margin": (3, 5), "color": color}
        self.buttons[name] = button(name, lambda: tried(read_and_do, trouble.say), **look)
        return self.buttons[name]

    def _breather(self) -> Any:
        name, value = self.explorer.state.fixed
        first = {name: f"{NUMBERS[name].first:g}" for name in NEEDED}
        first |= {"site": str(CHOICES["site"].default), name: f"{value:g}"}
        names = (*NEEDED, "forcing", "lattice", "site", "spring", "damping", "omega", "walls")
        readers: dict[str, Read] = {"site": a_count}
        self.breather = {
            name: Field.of_the_model(name, first.get(name, ""), readers.get(name, str.strip))
            for name in names
        }
        # 1 has the largest p, admissible or not
        self.breather["root"] = Field("root, by p", "", optional(a_count), hint="upper")
        button = "Show", self.explorer.choose_typed, self.breather
        return self._card("Breather", in_rows(self.breather.values(), 2), button)

    def _walks(self) -> Any:
        self.free = pn.widgets.Select(label="in", options=list(NEEDED), sizing_mode="stretch_width")
        low, high = (f"{end:g}" for end in REACH["a"])
        self.window = {"low": Field("from", low, a_number), "high": Field("to", high, a_number)}
        self.free.param.watch(self._usual_window, "value")
        fields = pn.Row(self.free, *(field.view for field in self.window.values()), margin=0)

        def trace(low: float, high: float) -> None:
            self._begin(jobs.traced, self.free.value, (low, high))

        return self._card("Continue from here", fields, ("Continue", trace, self.window))

    def _begin(self, job: Callable[..., jobs.Computation], *typed: Any, **more: Any) -> None:
        self.explorer.begin(job(self.explorer.chosen, *typed, **more))

    def _usual_window(self, event: Any) -> None:
        for field, end in zip(self.window.values(), REACH.get(event.new, (0.0, 1.0)), strict=True):
            field.input.value = f"{end:g}"

    def _special(self) -> Any:
        self.first = pn.widgets.Select(label="in", options=list(NEEDED), value="gamma", width=120)
        self.second = pn.widgets.Select(label="and", options=list(NEEDED), value="a", width=120)

        def trace() -> None:
            self._begin(jobs.bounded, (self.first.value, self.second.value), REACH)

        return self._card(
            "From a special point",
            ("Switch branch here", lambda: self._begin(jobs.switched), {}),
            pn.Row(self.first, self.second, margin=0),
            ("Trace this boundary", trace, {}),
        )

    def _run(self) -> Any:
        self.length = {
            "sites": Field("sites", str(RING), a_count),
            "periods": Field("periods", "100", a_count),
            "push": Field("push", "1e-6", a_number),
        }

        def simulate(**typed: Any) -> None:
            self._begin(jobs.simulated, **typed, sampled=self.explorer.state.sites)

        button = "Simulate from here", simulate, self.length
        return self._card("Simulation", in_rows(self.length.values(), 3), button)

    def _keep(self) -> Any:
        self.file = Field("file", "run.nc", str)
        self.what = pn.widgets.Select(
            label="figure", options=["zones", "branches", "motion"], width=120
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

        for select in (self.what, self.suffix):
            select.param.watch(renamed, "value")
        which = pn.Row(self.what, self.suffix, margin=0)
        button = "Save all curves", self._save, {"path": self.file}
        return self._card("Keep", self.file.view, button, which, self.figure, self.script)

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
        if path not in ("", self.replaced) and Path(path).exists():
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
        if chosen is not None:
            for select in (self.free, self.first, self.second):
                offered(select, list(chosen.free))
            self._say_where(chosen)

    def _say_where(self, chosen: Chosen) -> None:
        orbit = chosen.orbit
        if orbit is None or orbit is self.orbit:
            return
        self.orbit, sites = orbit, self.length["sites"].input
        size = orbit.lattice.sites
        if size is not None or sites.disabled:  # of the infinite chain the ring that is judged
            sites.value = str(size or self.explorer.state.ring)
        sites.disabled = size is not None
        entries = {name: getattr(orbit, name) for name in NEEDED} | self.explorer.lives_on(chosen)
        for name, value in entries.items():
            text = f"{value:.10g}" if isinstance(value, float) else str(value)
            self.breather[name].input.value = "" if value is None else text


def offered(select: Any, names: list[str], value: str | None = None) -> None:
    """Offer names in a select, and keep what was selected where it is among them. Nothing is left
    unselected: a browser would select the first, and say so as if a person had done it."""
    wanted = select.value if value is None else value
    if select.options != names:
        select.options = names
    select.value = wanted if wanted in names else next(iter(names), None)
