"""The fields and buttons beside the figures; what is refused is said below its button."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import panel as pn

from contbreather.errors import BadInput
from contbreather.explorer import work
from contbreather.explorer.fields import (
    MOST,
    ErrorLabel,
    Field,
    a_count,
    a_lattice,
    a_number,
    in_rows,
    of_the_model,
    optional,
    read_all,
    tried,
)
from contbreather.explorer.session import Session
from contbreather.explorer.state import Chosen, State
from contbreather.explorer.style import CARD, FOCUSED, FORMS, WORDS
from contbreather.parameters import NEEDED, window_of

# where walks go unless a window is typed
REACH = {**{name: window_of(name) for name in NEEDED}, "a": (0.01, 1.2)}
MANY = 100_000  # periods


def card(title: str, *parts: Any, css: Iterable[str] = ()) -> Any:
    """A box with a heading."""
    head = pn.pane.HTML(f"<h2>{title}</h2>", stylesheets=[WORDS], margin=(0, 5))
    return pn.Column(
        head, *parts, sizing_mode="stretch_width", stylesheets=[CARD], css_classes=["card", *css]
    )


class Forms:
    """All of them, below each other in `view`."""

    def __init__(self, explorer: Session) -> None:
        self.explorer = explorer
        self.buttons: dict[str, Any] = {}
        self.orbit: Any = None  # the one whose parameters the fields show
        self.replaced = ""  # the file that the next press of the button replaces
        parts = (self._breather(), self._walks(), self._special(), self._run(), self._keep())
        self.view = pn.Column(
            *parts, sizing_mode="stretch_width", css_classes=["forms"], margin=0,
            stylesheets=[FORMS],
        )  # fmt: skip

    def _button(self, name: str, do: Callable[[], object], trouble: ErrorLabel, **more: Any) -> Any:
        """A button that does something, or says why not."""
        more = {"sizing_mode": "stretch_width", "margin": (3, 5), "stylesheets": [FOCUSED], **more}
        self.buttons[name] = pn.widgets.Button(label=name, **more)
        self.buttons[name].on_click(lambda _: tried(do, trouble.say))
        return self.buttons[name]

    # --- one breather -----------------------------------------------------------------------------

    def _breather(self) -> Any:
        name, value = self.explorer.state.fixed
        first = {"a": "0.5", "gamma": "0.08", "k": "0.8", "site": "0", name: f"{value:g}"}
        how = {"lattice": optional(self._lattice, ""), "site": a_count("site", 0, MOST - 1)}
        self.breather = {
            name: of_the_model(name, first.get(name, ""), how.get(name, str.strip))
            for name in (*NEEDED, "forcing", "lattice", "site", "spring", "damping", "walls")
        }
        # 1 has the largest p, admissible or not
        root = optional(a_count("root", 1, 99))
        self.breather["root"] = Field("root, by p", "", root, hint="upper")
        self.breather_trouble = ErrorLabel()
        button = self._button("Show", self._show, self.breather_trouble, color="primary")
        return card("Breather", in_rows(self.breather.values(), 2), button,
                    self.breather_trouble.view)  # fmt: skip

    def _show(self) -> None:
        typed = read_all(self.breather)
        if typed is not None:
            self.explorer.choose_typed(**typed)

    def _lattice(self, text: str) -> str:
        """As it was typed; of a lattice that a curve brought its description."""
        return text if text in self.explorer.lattices else a_lattice(text)

    # --- walks ------------------------------------------------------------------------------------

    def _walks(self) -> Any:
        self.free = pn.widgets.Select(label="in", options=list(NEEDED), sizing_mode="stretch_width")
        low, high = (f"{end:g}" for end in REACH["a"])
        self.window = {
            "low": Field("from", low, a_number("from")),
            "high": Field("to", high, a_number("to")),
        }
        self.free.param.watch(self._usual_window, "value")
        self.walk_trouble = ErrorLabel()
        button = self._button("Continue", self._walk, self.walk_trouble, color="primary")
        fields = pn.Row(self.free, *(field.view for field in self.window.values()), margin=0)
        return card("Continue from here", fields, button, self.walk_trouble.view)

    def _usual_window(self, event: Any) -> None:
        for field, end in zip(self.window.values(), REACH.get(event.new, (0.0, 1.0)), strict=True):
            field.input.value = f"{end:g}"

    def _walk(self) -> None:
        chosen, typed = self.explorer.chosen, read_all(self.window)
        if typed is not None:
            window = typed["low"], typed["high"]
            self.explorer.begin(work.traced(chosen, self.free.value, window))

    # --- special points ---------------------------------------------------------------------------

    def _special(self) -> Any:
        self.first = pn.widgets.Select(label="in", options=list(NEEDED), value="gamma", width=120)
        self.second = pn.widgets.Select(label="and", options=list(NEEDED), value="a", width=120)
        self.special_trouble = ErrorLabel()
        return card(
            "From a special point",
            self._button("Switch branch here", self._switch, self.special_trouble),
            pn.Row(self.first, self.second, margin=0),
            self._button("Trace this boundary", self._trace, self.special_trouble),
            self.special_trouble.view,
        )

    def _switch(self) -> None:
        self.explorer.begin(work.switched(self.explorer.chosen))

    def _trace(self) -> None:
        pair = self.first.value, self.second.value
        self.explorer.begin(work.bounded(self.explorer.chosen, pair, REACH))

    # --- simulation -------------------------------------------------------------------------------

    def _run(self) -> Any:
        self.length = {
            "sites": Field("ring of", "20", a_count("sites", 3, MOST)),
            "periods": Field("periods", "100", a_count("periods", 1, MANY)),
            "push": Field("push", "0.001", a_number("push", -10.0, 10.0, "a small velocity")),
        }
        self.run_trouble = ErrorLabel()
        button = self._button("Simulate from here", self._simulate, self.run_trouble)
        return card("Simulation", in_rows(self.length.values(), 3), button, self.run_trouble.view)

    def _simulate(self) -> None:
        chosen, typed = self.explorer.chosen, read_all(self.length)
        if typed is not None:
            self.explorer.begin(work.simulated(chosen, **typed, watched=self.explorer.state.sites))

    # --- what is kept -----------------------------------------------------------------------------

    def _keep(self) -> Any:
        self.file = Field("file", "run.nc", str)
        self.keep_trouble = ErrorLabel()
        self.what = pn.widgets.Select(
            label="figure", options=["zones", "branches", "motion"], width=120
        )
        self.suffix = pn.widgets.Select(label="format", options=[".pdf", ".svg", ".png"], width=90)
        self.figure = pn.widgets.FileDownload(
            callback=self._figure, filename="zones.pdf", label="Export figure",
            sizing_mode="stretch_width", margin=(3, 5), stylesheets=[FOCUSED],
        )  # fmt: skip
        self.script = pn.widgets.FileDownload(
            callback=lambda: StringIO(self.explorer.script()), filename="explored.py",
            label="Export Python code", sizing_mode="stretch_width", margin=(3, 5),
            stylesheets=[FOCUSED],
        )  # fmt: skip
        for select in (self.what, self.suffix):
            select.param.watch(self._renamed, "value")
        return card(
            "Keep",
            self.file.view,
            self._button("Save all curves", self._save, self.keep_trouble),
            pn.Row(self.what, self.suffix, margin=0),
            self.figure,
            self.script,
            self.keep_trouble.view,
        )

    def _renamed(self, _: object) -> None:
        self.figure.filename = f"{self.what.value}{self.suffix.value}"

    def _figure(self) -> BytesIO:
        try:
            drawn = BytesIO(self.explorer.figure(self.what.value, self.suffix.value))
        except BadInput as error:
            self.keep_trouble.say(str(error))
            raise
        self.keep_trouble.say("")
        return drawn

    def _save(self) -> None:
        path = self.file.get()
        if path not in ("", self.replaced) and Path(path).exists():
            self.replaced = path
            raise BadInput(f"{path} exists: press again to replace it, or name another file.")
        self.replaced = ""
        self.explorer.keep(path)

    # --- what can be done now ---------------------------------------------------------------------

    def render(self, state: State) -> None:
        """Buttons that can do something now, and the parameters that what is looked at has."""
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
        """In the fields are the parameters of what is looked at, however it was chosen."""
        orbit = chosen.orbit
        if orbit is None or orbit is self.orbit:
            return
        self.orbit = orbit
        entries = {name: getattr(orbit, name) for name in NEEDED} | self.explorer.lives_on(chosen)
        for name, value in entries.items():
            text = f"{value:.10g}" if isinstance(value, float) else str(value)
            self.breather[name].input.value = "" if value is None else text


def offered(select: Any, names: list[str], value: str | None = None) -> None:
    """What a select offers; what was selected stays where it can. Nothing is left unselected: a
    browser would select the first by itself, and say so as if a person had done it."""
    wanted = select.value if value is None else value
    if select.options != names:
        select.options = names
    select.value = wanted if wanted in names else next(iter(names), None)
