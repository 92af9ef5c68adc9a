"""One page that shows an explorer: what is clicked and typed goes there, what it says is drawn.

An explorer may have several pages at a time, and outlives them: a page that is loaded again shows
what there was. Changes come from any thread, and Bokeh's models are touched by that of the page
only, one tick later.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from html import escape
from typing import Any

import panel as pn
from bokeh.models.ui import UIElement
from bokeh.themes import Theme
from panel.io.notebook import block_comm, patch_inline_stylesheets

from contbreather.errors import ContbreatherError
from contbreather.explorer import forms, style, views
from contbreather.explorer.session import Session
from contbreather.explorer.state import PageState, told_apart, verdict_in_words, verdicts
from contbreather.orbits.zone_search import PAIRS
from contbreather.parameters import NUMBERS
from contbreather.progress import in_notebook

# what is fixed in each
PLANES = {f"{views.letter(x)}, {views.letter(y)}": name for name, (x, y) in PAIRS.items()}
TAPS = ("tap", "doubletap")  # the second of two quick clicks comes as the latter alone
NOWHERE = -1  # at no special point


class Page:
    """Figures, fields and buttons, and what they do."""

    def __init__(self, explorer: Session) -> None:
        self.explorer = explorer
        self.drawn, self.busy = PageState(), False  # what is drawn by now
        self.document: Any = pn.state.curdoc
        theme = style.DARK if pn.config.theme == "dark" else style.LIGHT
        self.zones, self.branches = views.ZonesView(theme), views.BranchView(theme)
        self.profile, self.multipliers = views.ProfileView(theme), views.MultipliersView(theme)
        self.motion, self.run = views.MotionView(theme), views.MotionView(theme)
        self.forms = forms.PageForms(explorer)
        self.moved: list[Any] = []  # widgets that persons move
        self._moves = 0
        self._zone_controls()
        self._branch_controls()
        self._words()
        self.layout = self._laid_out()
        self._quiet = self._due = False
        self.drawing = threading.RLock()
        self._later = self._in_its_thread()
        forget = explorer.listen(self._heard)
        if self._served:
            pn.state.on_session_destroyed(lambda _: forget())
        if explorer.state.plane is None:
            explorer.look_at(explorer.state.fixed[1])
        self.render()

    def _zone_controls(self) -> None:
        self.plane = pn.widgets.Select(label="plane", options=PLANES, width=90)
        self.slider = pn.widgets.FloatSlider(sizing_mode="stretch_width")
        self.zones_trouble = forms.ErrorLabel()
        self._on(self.slider, lambda value: self.explorer.look_at(round(value, 9)))
        self._on(self.plane, self._other_plane)
        for tap in TAPS:
            self.zones.figure.on_event(tap, self._zones_tapped)

    def _branch_controls(self) -> None:
        explorer = self.explorer
        self.x, self.y = (pn.widgets.Select(label=name, width=110) for name in "xy")
        self.curve = pn.widgets.Select(label="curve", width=230)
        self.label = pn.widgets.Select(label="special point", width=120)
        self.point = pn.widgets.IntSlider(label="point", width=120)
        self.shown = pn.widgets.CheckBoxGroup(
            label="curves", inline=True, sizing_mode="stretch_width", stylesheets=[style.WRAPPED]
        )
        self.remove = forms.button(
            "Remove curve", lambda: explorer.remove(self.curve.value), width=120
        )
        self.undo = forms.button("Undo", lambda: forms.tried(explorer.undo, self._tell), width=80)
        self._on(self.x, lambda x: explorer.change(axes=(x, self.y.value)))
        self._on(self.y, lambda y: explorer.change(axes=(self.x.value, y)))
        self._on(self.curve, lambda _: self._pick(0))
        self._on(self.point, self._pick)
        self._on(self.label, self._pick)
        self._on(self.shown, explorer.tick)
        for tap in TAPS:
            self.branches.figure.on_event(tap, self._branch_tapped)

    def _words(self) -> None:
        sites = ", ".join(map(str, self.explorer.state.sites))
        self.asked = {
            "sites": forms.text_field("motion of sites", sites, "around the impact"),
            "ring": forms.text_field("judge a ring of", str(self.explorer.state.ring)),
        }
        self.asked_trouble = forms.ErrorLabel()
        for field in self.asked.values():
            field.param.watch(self._asked, "value")
        self.words, self.status = forms.Words(), forms.Words()
        self.stop = forms.button(
            "Stop", self.explorer.stop, color="danger", width=90, visible=False
        )

    def _laid_out(self) -> Any:
        which = pn.FlexBox(
            self.curve, self.label, self.point, self.x, self.y, sizing_mode="stretch_width"
        )
        fields = pn.Row(*self.asked.values(), margin=0)
        parts: dict[str, tuple[Any, ...]] = {
            "zones": (
                "Zones", pn.Row(self.plane, self.slider, margin=0, sizing_mode="stretch_width"),
                self.zones.figure, self.zones_trouble.view,
            ),
            "branches": (
                "Branches", which, self.branches.figure, self.shown,
                pn.Row(self.remove, self.undo, margin=0),
            ),
            "profile": ("Profile", self.profile.figure),
            "motion": (
                "Motion over a period", fields, self.asked_trouble.view, self.motion.figure,
            ),
            "multipliers": ("Multipliers", self.multipliers.figure),
            "words": ("What it is", self.words.view),
        }  # fmt: skip
        figures = [
            forms.titled_box(title, *content, css=[name])
            for name, (title, *content) in parts.items()
        ]
        self.run_card = forms.titled_box("Simulation", self.run.figure, css=["run"])
        top = pn.Row(
            self.status.view, self.stop, sizing_mode="stretch_width", css_classes=["status"],
            stylesheets=[style.STUCK], min_height=40,
        )  # fmt: skip
        grid = pn.Column(
            top, *figures, self.run_card, self.forms.view,
            sizing_mode="stretch_width", stylesheets=[style.GRID],
        )  # fmt: skip
        return pn.Column(grid, sizing_mode="stretch_width", stylesheets=[style.OUTER], margin=0)

    def _on(self, widget: Any, do: Callable[[Any], object]) -> None:
        self.moved.append(widget)

        def changed(event: Any) -> None:
            if not self._quiet:
                forms.tried(lambda: do(event.new), self._tell)
                self._moves += 1
                if self._served and self.explorer.shared:
                    # milliseconds without a move
                    self.document.add_timeout_callback(partial(self._again, self._moves), 400)

        widget.param.watch(changed, "value")

    def _again(self, moves: int) -> None:
        """Tell the browser where its widgets are, though they have not changed: what another page
        had them changed to may have passed on its way what a person did here, and would stay there.
        Not while they move: they would be thrown back."""
        if moves == self._moves:
            for widget in self.moved:
                for model, _ in widget._models.values():
                    name = "value" if "value" in model.properties() else "active"
                    self.document.callbacks.notify_change(model, name, None, None)

    def _tell(self, trouble: str) -> None:
        if trouble:
            self.explorer.tell(trouble)

    def _other_plane(self, name: str) -> None:
        """Show the plane through what is chosen, if the slider reaches it."""
        value, (start, end, step) = NUMBERS[name].first, self.explorer.state.slider(name)
        chosen = self.explorer.state.chosen
        if chosen is not None and chosen.orbit is not None:
            value = min(max(float(getattr(chosen.orbit, name)), start), end)
        self.explorer.look_at(round(step * round(value / step), 9), fixed=name)

    def _zones_tapped(self, event: Any) -> None:
        drawn = self.explorer.state.plane
        if drawn is not None:
            place = dict(zip(drawn.pair, (event.x, event.y), strict=True))
            forms.tried(partial(self.explorer.choose_at, **place), self.zones_trouble.say)

    def _branch_tapped(self, event: Any) -> None:
        state = self.explorer.state
        nearest = self.branches.nearest(state.shown, *state.columns, (event.x, event.y))
        if nearest is not None:
            forms.tried(lambda: self.explorer.choose_point(*nearest), self._tell)

    def _pick(self, index: int) -> None:
        if self.curve.value and index != NOWHERE:
            self.explorer.choose_point(self.curve.value, index)

    def _asked(self, _: object) -> None:
        sites, ring = (field.value.replace(",", " ").split() for field in self.asked.values())
        typed = [*map(forms.number_or_text, sites)], forms.number_or_text(" ".join(ring))
        forms.tried(lambda: self.explorer.watch(*typed), self.asked_trouble.say)

    @property
    def _served(self) -> bool:
        return self.document is not None and self.document.session_context is not None

    def _heard(self, _: PageState) -> None:
        """Draw a change, in whatever thread it happened, as soon as this page may."""
        if self._later is None:
            self.render()
        elif not self._due:
            self._due = True
            self._later(self.render)

    def _in_its_thread(self) -> Callable[[Callable[[], None]], object] | None:
        """Scheduler of this page's thread; None where any will do."""
        if self._served:
            return self.document.add_next_tick_callback
        return asyncio.get_running_loop().call_soon_threadsafe if in_notebook() else None

    @contextmanager
    def _quietly(self) -> Iterator[None]:
        """Make changes that are the page's own, all at once: else Bokeh goes through all models at
        each, and a notebook has a message of each."""
        with self.drawing, ExitStack() as all_at_once:
            self._quiet = True
            all_at_once.callback(setattr, self, "_quiet", False)
            all_at_once.callback(pn.io.push_notebook, self.layout)
            for model, _ in self.layout._models.values():
                all_at_once.enter_context(model.document.models.freeze())
            all_at_once.enter_context(block_comm())
            yield

    def render(self) -> None:
        self._due = False
        busy = self.explorer.busy
        if self.explorer.state is self.drawn and busy == self.busy:
            self._render_status()  # how far work is: no reason to go through everything else
            return
        with self._quietly():
            new, old = self.explorer.state, self.drawn
            self.drawn, self.busy = new, busy
            self._render_status()
            self.forms.render(new)
            self._render_zones(new, old)
            self._render_branches(new, old)
            self._render_chosen(new, old)
            self.run_card.visible = new.run is not None
            if new.run is not None and new.run is not old.run:
                self.run.run(*new.run, new.outcome)

    def _render_status(self) -> None:
        explorer, chosen = self.explorer, self.explorer.state.chosen
        words = explorer.progress or explorer.message
        if not words and chosen is not None:
            words = chosen.title
            words += "" if chosen.orbit is None else f": {verdict_in_words(chosen.orbit)}"
        if explorer.drawing:
            words = f"{words} ({explorer.drawing})".lstrip()
        words = words or "Click into a diagram, or type the parameters of a breather."
        self.status.show(f'<div role="status" aria-live="polite">{escape(words)}</div>')
        self.stop.visible = explorer.stoppable

    def _render_zones(self, new: PageState, old: PageState) -> None:
        name, value = new.fixed
        start, end, step = new.slider(name)
        self.plane.value = name
        # what came from the browser does not go back to it rounded: it may have moved on by then
        there: Any = self.slider.value
        value = there if round(there, 9) == value else value
        end = max(end, value)  # which may have been typed
        _put(self.slider, value, label=NUMBERS[name].label, start=start, end=end, step=step)
        self.zones.title(new)
        if new.plane is None:
            return
        if new.plane is not old.plane:
            self.zones.show(new.plane)
        self.zones.boundaries(new.curves.values(), new.plane)
        self.zones.choose(new.chosen, new.plane)

    def _render_branches(self, new: PageState, old: PageState) -> None:
        (x, y), codes = new.columns, [*new.shown]
        if (new.curves, new.hidden) != (old.curves, old.hidden):
            _, self.curve.options = told_apart(new.shown)
        self.curve.value = new.listed if new.listed in codes else next(iter(codes), None)
        self.remove.disabled = not codes
        self.undo.disabled = self.explorer.busy or not self.explorer.undoes
        self.shown.options = [*new.curves]
        self.shown.value = codes
        forms.offered(self.x, new.offered or [x], x)
        forms.offered(self.y, new.offered or [y], y)
        if (new.shown, x, y) != (old.shown, *old.columns):
            self.branches.show(new.shown, x, y)
        seen = new.chosen is not None and new.chosen.curve in codes
        self.branches.choose(new.chosen if seen else None, x, y)
        self._render_place(new)

    def _render_place(self, new: PageState) -> None:
        branch, chosen = new.curves.get(self.curve.value), new.chosen
        labels = {} if branch is None else {point.title: i for i, point in views.marked(branch)}
        self.label.options = {"\N{EN DASH}": NOWHERE, **labels}
        there = chosen is not None and chosen.curve == self.curve.value
        index = chosen.index if chosen is not None and there else NOWHERE
        if branch is not None:
            _put(self.point, max(index, 0), end=max(len(branch) - 1, 1))
        self.label.value = index if index in labels.values() else NOWHERE

    def _render_chosen(self, new: PageState, old: PageState) -> None:
        wanted = new.chosen, new.sites, new.ring
        if wanted == (old.chosen, old.sites, old.ring):
            return
        self.words.show(_described(new))
        orbit = None if new.chosen is None else new.chosen.orbit
        if orbit is None:  # nothing of what was there before is of it
            for view in (self.profile, self.motion, self.multipliers):
                view.nothing()
            return
        self.profile.show(orbit)
        self.motion.show(orbit, new.sites, verdict_in_words(orbit))
        try:
            self.multipliers.show(orbit, new.ring)
        except ContbreatherError as error:
            self.multipliers.nothing(str(error))


def _put(slider: Any, value: float, **more: Any) -> None:
    """Move a slider, unless a person has just done so: Panel has that in a moment, or would drop
    it."""
    if "value" not in slider._events:
        slider.param.update(value=value, **more)


def _described(state: PageState) -> str:
    chosen = state.chosen
    if chosen is None:
        return ""
    shown = chosen.point if chosen.orbit is None else chosen.orbit
    table = "" if shown is None else shown.table().html()
    if chosen.orbit is None:
        of = "breathers between walls that came with their equations"
        sentences = [
            ("motion", f"drawn of {of}"),
            ("from here", f"continued and simulated are {of}"),
        ]
    else:
        sentences = list(verdicts(chosen.orbit, state.ring))
    items = "".join(f"<dt>{escape(h)}</dt><dd>{escape(s)}</dd>" for h, s in sentences)
    return f"<h2>{escape(chosen.title)}</h2>{table}<dl>{items}</dl>"


def in_template(explorer: Session) -> Any:
    """Page in a browser, below a heading with the switch between light and dark."""
    dark = pn.config.theme == "dark"
    other = "default" if dark else "dark"
    link = pn.pane.HTML(
        f'<a href="?theme={other}">{"light" if dark else "dark"}</a>'
        f"<script>{style.FOLLOW}{style.NAMES}</script>",
        stylesheets=[style.LINK],
        align="end",
    )  # fmt: skip
    template: Any = pn.template.BootstrapTemplate(
        title="contbreather explorer",
        theme="dark" if dark else "default",
        header=[link],
        main=[Page(explorer).layout],
    )
    # figures have colours of their own, and titles in letters of a known size
    template._design.theme.bokeh_theme = Theme(json={})
    return template


def for_notebook(explorer: Session, include: Any, exclude: Any) -> Any:
    pn.extension(inline=True)  # its scripts come from this machine, too
    page = Page(explorer)
    shown: Any = InKernel(page)
    with page.drawing:
        return shown._repr_mimebundle_(include, exclude)


class InKernel(pn.Column):
    """Page in a notebook; messages of the browser, which may come in a thread of their own, wait
    while it draws, for Panel would drop what is drawn by half."""

    def __init__(self, page: Page) -> None:
        super().__init__(page.layout, sizing_mode="stretch_width", hooks=[_styled])
        self.drawing = page.drawing

    def _on_msg(self, *message: Any) -> None:
        with self.drawing:
            super()._on_msg(*message)


def _styled(_: Any, root: Any) -> None:
    """Put styles into all models now: Panel would later, when there is a document that goes through
    all models at each change."""
    for model in root.select({"type": UIElement}):
        patch_inline_stylesheets(model)
