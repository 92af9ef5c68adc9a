"""What a person types: text fields that say beside themselves what is wrong with it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from html import escape
from typing import Any

import panel as pn
from bokeh.models.widgets import Div

from contbreather.checks import number
from contbreather.errors import BadInput, ContbreatherError
from contbreather.explorer.style import WORDS
from contbreather.lattice.parse import lattice_by
from contbreather.parameters import CHOICES, NUMBERS, OPTIONAL, parameter

Read = Callable[[str], Any]
MOST = 2000  # sites


def _float(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise BadInput(f"{text!r} is not a number; 0.5, say, is one.") from None


def a_number(name: str, low: float = -math.inf, high: float = math.inf, wanted: str = "") -> Read:
    """Text as a number in a range."""
    return lambda text: number(name, _float(text), low, high, wanted or "a value")


def a_count(name: str, least: int, most: int) -> Read:
    """Text as a whole number in a range."""

    def read(text: str) -> int:
        if not text.strip().isdecimal() or not least <= int(text) <= most:
            raise BadInput(f"{name} = {text}: a whole number from {least} to {most} was expected.")
        return int(text)

    return read


def some_sites(text: str) -> tuple[int, ...]:
    """Numbers of sites, apart by commas or blanks; at most eight."""
    words = text.replace(",", " ").split()
    try:
        sites = tuple(dict.fromkeys(int(word) for word in words))
    except ValueError:
        sites = ()
    if not 0 < len(sites) <= 8:
        raise BadInput(f"sites = {text}: one to eight whole numbers were expected, as in 0, 1, 2.")
    return sites


def a_lattice(text: str) -> str:
    """A lattice as it is typed at the command line, too; a number is a ring of so many."""
    typed = f"ring:{text.strip()}" if text.strip().isdecimal() else text.strip()
    sizes = [int(word) for word in re.findall(r"\d+", typed)]
    if math.prod(sizes) > MOST and not typed.lower().endswith((".csv", ".graphml")):
        raise BadInput(f"lattice {typed}: at most {MOST} sites are shown here.")
    try:
        lattice_by(typed)
    except BadInput as error:
        raise BadInput(str(error).removeprefix("--")) from error
    return typed


def optional(read: Read, otherwise: Any = None) -> Read:
    """The same, but nothing typed is an answer, too."""
    return lambda text: read(text) if text.strip() else otherwise


def of_the_model(name: str, value: str = "", read: Read = str.strip) -> Field:
    """The field of a parameter of the model: its label, its range, and what it is unless given."""
    if name not in NUMBERS:
        return Field(CHOICES[name].label, value, read, hint=str(CHOICES[name].default))

    def in_range(text: str) -> float:
        return parameter(name, _float(text))

    free = name in OPTIONAL
    how = optional(in_range) if free else in_range
    return Field(NUMBERS[name].label, value, how, hint="none" if free else "")


class Field:
    """A text field with its label above and, where it is refused, the reason below."""

    def __init__(self, label: str, value: str, read: Read, *, hint: str = "", **more: Any) -> None:
        self.read = read
        self.input = pn.widgets.TextInput(
            label=label, value=value, placeholder=hint, sizing_mode="stretch_width",
            margin=(2, 5), **more,
        )  # fmt: skip
        self.trouble = ErrorLabel()
        self.view = pn.Column(self.input, self.trouble.view, sizing_mode="stretch_width", margin=0)

    def get(self) -> Any:
        """What was typed, read.

        Raises
        ------
        BadInput
            If it cannot be read; the field says so.
        """
        try:
            value = self.read(self.input.value or "")
        except BadInput as error:
            self.trouble.say(str(error))
            raise
        self.trouble.say("")
        return value


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
        """Something else."""
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
    """A sentence that is not there as long as nothing is wrong; screen readers say it."""

    def say(self, sentence: str) -> None:
        """Another sentence, or none."""
        html = f'<div class="trouble" role="alert">{escape(sentence)}</div>'
        self.show(html if sentence else "")


def tried(do: Callable[[], object], say: Callable[[str], object]) -> None:
    """Do it, and say why not, or nothing."""
    try:
        do()
    except ContbreatherError as error:
        say(str(error))
    else:
        say("")


def read_all(fields: Mapping[str, Field]) -> dict[str, Any] | None:
    """All fields by name; None if any was refused, each of which says so."""
    values: dict[str, Any] = {}
    for name, field in fields.items():
        try:
            values[name] = field.get()
        except BadInput:
            continue
    return values if len(values) == len(fields) else None


def in_rows(fields: Iterable[Field], across: int) -> Any:
    """Fields in rows of so many."""
    views = [field.view for field in fields]
    rows = [pn.Row(*views[i : i + across], margin=0) for i in range(0, len(views), across)]
    return pn.Column(*rows, sizing_mode="stretch_width", margin=0)
