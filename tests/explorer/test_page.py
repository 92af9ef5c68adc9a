"""A page without a browser: what it shows, what its widgets do, what it refuses and where."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bokeh.events import DoubleTap, Tap

import contbreather as cb
from contbreather.errors import BadInput
from contbreather.explorer import Explorer, session
from contbreather.explorer.forms import usual_window
from contbreather.explorer.page import Page
from contbreather.explorer.state import Chosen, point_of
from contbreather.explorer.views import letter

from ..apart import HUNG


def opened(diagram: cb.orbits.Zones) -> Iterator[Page]:
    """A page whose first zones, which all pages begin with, are there."""

    def zones(**on: Any) -> Any:
        on.pop("progress")
        return diagram if on == {"k": 0.8, "forcing": None} else cb.zones(**on)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "zones", zones)
        explorer = Explorer()
        page = Page(explorer)
        assert explorer.wait(HUNG)
        yield page
        explorer.stop()


page = pytest.fixture(opened)
one_page = pytest.fixture(opened, scope="module")


def tap(drawn: Any, x: float, y: float, *, twice: bool = False) -> None:
    """Click into a figure, as Bokeh tells of it: the second of two quick clicks is an event of its
    own."""
    drawn._trigger_event((DoubleTap if twice else Tap)(drawn, x=x, y=y))


@pytest.fixture
def bare(one_page: Page) -> Page:
    """One page for tests that continue nothing and leave its fields as they were."""
    one_page.explorer.change(chosen=None)
    return one_page


def test_a_pair_of_parameters_is_two_when_another_problem_had_neither(bare: Page) -> None:
    line = cb.Problem(lambda x, p: np.array([p["mu"] - p["nu"] * x[0] ** 2]), {"x": 1.0},
                      {"mu": 1.0, "nu": 1.0})  # fmt: skip
    fold = cb.trace(line, "mu", within={"x": (-1, 1)}, events=[cb.fold()]).first("LP")
    bare.explorer.choose(Chosen("line.first('LP')", None, fold))
    bare.explorer.choose(Chosen("b", cb.symmetric(0.5, 0.05, 0.8)))
    assert (bare.forms.first.value, bare.forms.second.value) == ("a", "gamma")


@pytest.mark.slow
def test_windows_are_in_units_of_the_frequency_the_walls_and_the_drive(page: Page) -> None:
    """At twice the frequency amplitudes are four times as large: a boundary was refused there, its
    start outside of a window that nobody could widen."""
    page.explorer.choose_typed(a=2.0, gamma=0.2, k=0.7, forcing="", omega=2.0)
    page.render()
    assert [field.value for field in page.forms.window.values()] == ["0.04", "4.8"]
    press(page, "Continue")
    branch = page.explorer.state.curves["branch1"]
    assert [point.label for point in branch.special][-2:] == ["PF1", "GR1"]
    fork = next(i for i, point in enumerate(branch) if point.label == "PF1")
    page.explorer.choose_point("branch1", fork)
    press(page, "Trace this boundary")
    meeting = cb.boundary(branch.first("PF"), ("gamma", "a")).special[-1]
    assert page.explorer.state.curves["line2"][-1]["a"] == pytest.approx(meeting["a"])
    held = {"lattice": cb.Ring(3), "walls": (-2, 2), "forcing": "-cos(3*t)"}
    reach = usual_window("a", cb.symmetric(12.0, 0.05, 0.7, **held), 1.0)
    assert reach == pytest.approx((0.18, 21.6))


def test_figures_that_are_not_there_are_not_exported(bare: Page) -> None:
    """A download that is refused leaves an error of the server behind."""
    for what, grey in {"branches": True, "simulation": True, "zones": False}.items():
        bare.forms.what.value = what
        assert bare.forms.figure.disabled is grey


def press(page: Page, name: str) -> None:
    """Press a button and wait for what it began."""
    button = page.forms.buttons[name]
    assert not button.disabled
    button.clicks += 1
    assert page.explorer.wait(HUNG)


def sentence(trouble: Any) -> str:
    assert trouble.text.visible == bool(trouble.text.text)
    return str(trouble.text.text)


def test_a_click_into_the_zones_shows_that_breather(bare: Page) -> None:
    tap(bare.zones.figure, 0.08, 0.4)
    tap(bare.zones.figure, 0.08, 0.5, twice=True)
    assert '>p</th><td style="text-align:left">0.808749129989</td>' in bare.words.text.text
    assert bare.zones.here.data == {"x": [0.08], "y": [0.5]}
    assert bare.profile.sites.data["n"].size == 21
    assert bare.motion.lines.data["site"] == ["site 0", "site 1", "site 2"]
    assert bare.multipliers.dots.data["x"].size == 800


def test_a_click_where_nothing_is_says_so_below_the_figure(bare: Page) -> None:
    tap(bare.zones.figure, 0.08, 0.001)
    assert "smallest" in sentence(bare.zones_trouble)
    tap(bare.zones.figure, 0.08, 0.5)
    assert sentence(bare.zones_trouble) == ""


@pytest.mark.slow
def test_what_the_library_refuses_stands_below_the_button(bare: Page) -> None:
    for name, typed, words in (
        ("a", "half", "a = &#x27;half&#x27;: the amplitude of the forcing must be a finite"),
        ("a", "<script>", "a = &#x27;&lt;script&gt;&#x27;: "),  # text, and no markup
        ("root", "1.5", "root 1.5: the solutions of (11) are"),
        ("walls", "low", "walls low: LOW,HIGH"),
        ("gamma", "0.3", "0 &lt;= gamma &lt; 1/4"),
        ("lattice", "grid:100000x100000", "at most 10000 sites"),
        ("lattice", "open:2001", "2001 sites: at most 2000 sites"),
        ("forcing", "__import__('os')", "which no formula may"),
    ):
        field = bare.forms.breather[name]
        before, field.value = field.value, typed
        press(bare, "Show")
        assert words in sentence(bare.forms.troubles["Breather"])
        assert bare.explorer.state.chosen is None
        field.value = before


def test_a_story_with_the_buttons(page: Page) -> None:
    off = [name for name, one in page.forms.buttons.items() if one.disabled]
    assert set(off) == {
        "Continue", "Switch branch here", "Trace this boundary", "Simulate from here",
        "Save all curves",
    }  # fmt: skip
    for name, value in (("a", "0.7"), ("gamma", "0.04")):
        page.forms.breather[name].value = value
    press(page, "Show")
    press(page, "Continue")
    assert page.curve.value == "branch1"
    assert [text for text in page.branches.special.data["text"] if text][1:] == [
        "LP1",
        "PF1",
        "GR1",
    ]
    page.label.value = page.label.options["PF1"]
    assert page.explorer.chosen.code == "branch1.first('PF1')"
    assert page.branches.here.data["x"] == [pytest.approx(0.777632425944)]
    assert page.forms.breather["a"].value == "0.7776324259"
    press(page, "Switch branch here")
    page.forms.free.value = "gamma"
    press(page, "Trace this boundary")
    assert page.shown.options == ["branch1", "arms2[0]", "arms2[1]", "line3"]
    assert len(page.zones.traced.data["xs"]) == 1
    page.forms.length["periods"].value = "3.0"
    press(page, "Simulate from here")
    assert page.run_card.visible
    assert page.run.figure.title.text.strip().startswith("run4: 3 periods, 6 impacts")
    assert "periods=3, " in page.explorer.script()
    assert page.explorer.message.startswith("3 periods on the ring of 400")


@pytest.mark.slow
def test_a_click_beside_a_branch_takes_its_nearest_point(page: Page) -> None:
    press(page, "Show")
    press(page, "Continue")
    branch = page.explorer.state.curves["branch1"]
    wanted = next(i for i, point in enumerate(branch) if not point.kind and i > 8)
    x, y = branch["a"][wanted], branch["p"][wanted]
    for i, twice in ((3, False), (wanted, True)):  # the second of two quick clicks counts, too
        tap(page.branches.figure, branch["a"][i], branch["p"][i], twice=twice)
        assert page.explorer.chosen.code == f"branch1[{i}]"
    tap(page.branches.figure, x + 1e-4, y - 1e-4)
    assert page.explorer.chosen.code == f"branch1[{wanted}]"
    assert page.point.value == wanted
    page.point.value = wanted + 1
    assert page.explorer.chosen.code == f"branch1[{wanted + 1}]"


def test_sites_and_ring_are_typed_and_refused_in_place(page: Page) -> None:
    press(page, "Show")
    page.asked["ring"].value = "30"  # of sites around the impact
    assert page.multipliers.dots.data["x"].size == 60
    page.asked["sites"].value = "0 5"
    page.asked["ring"].value = "50"
    assert page.motion.lines.data["site"] == ["site 0", "site 5"]
    assert page.multipliers.dots.data["x"].size == 100
    page.asked["sites"].value = "0, x"
    assert "sites = &#x27;x&#x27;: a whole number" in sentence(page.asked_trouble)
    page.asked["ring"].value, page.asked["sites"].value = "2001", "0 5"
    assert "at most 2000 sites" in sentence(page.asked_trouble)
    assert page.explorer.state.sites == (0, 5)
    page.asked["ring"].value, page.asked["sites"].value = "50", ""
    assert page.motion.lines.data["site"] == ["site 0", "site 1", "site 2"]
    assert not sentence(page.asked_trouble)


def test_a_page_that_is_loaded_again_shows_what_there_was(page: Page) -> None:
    press(page, "Show")
    press(page, "Continue")
    page.point.value = 3
    again = Page(page.explorer)
    assert again.words.text.text == page.words.text.text
    assert again.point.value == 3
    assert again.branches.special.data["text"] == page.branches.special.data["text"]
    assert page.explorer.chosen.code == "branch1[3]"  # the new page has chosen nothing itself


@pytest.mark.slow
def test_a_notebook_shows_the_same_page(bare: Page) -> None:
    bundle, _ = bare.explorer._repr_mimebundle_()
    assert "text/html" in bundle
    assert "Neimark" in bundle["text/html"]
    assert "cdn." not in bundle["text/html"]  # nothing is fetched from elsewhere


def typed(page: Page, **texts: str) -> None:
    """Type into the fields of the breather, and have it shown."""
    for name, text in texts.items():
        page.forms.breather[name].value = text
    show(page)


def show(page: Page) -> None:
    """Press the button, and do without zones that take long."""
    page.forms.buttons["Show"].clicks += 1
    if page.forms.breather["lattice"].value:
        page.explorer.stop()
        assert page.explorer.wait(HUNG)
        page.explorer.tell("")  # not that they were stopped
    assert page.explorer.wait(HUNG)


@pytest.mark.parametrize(
    ("texts", "given"),
    [
        ({"spring": "0.1"}, {"spring": 0.1}),
        (
            {"lattice": "open:9", "site": "4", "damping": "0.02"},
            {"lattice": cb.OpenChain(9), "site": 4, "damping": 0.02},
        ),
        (
            {"lattice": "open:3:masses=1,1.1,1"},
            {"lattice": cb.OpenChain(3, masses=[1, 1.1, 1])},
        ),
        (
            {"lattice": "12", "walls": "-0.9,0.9 3:none,none"},
            {
                "lattice": cb.Ring(12),
                "walls": dict.fromkeys(range(12), (-0.9, 0.9)) | {3: (None, None)},
            },
        ),
    ],
)  # fmt: skip
def test_lattice_springs_and_walls_are_typed(page: Page, texts: Any, given: Any) -> None:
    """Breathers, branches and zones are of what was typed; on the infinite chain zones have none
    of it."""
    page.explorer.watch((0,), 20)
    typed(page, **texts)
    script = page.explorer.script().replace("cb.zones(", "dict(")
    (made,) = (line for line in script.splitlines() if line.startswith("zones = "))
    of = eval(made.removeprefix("zones = "), {"cb": cb})
    assert of == {"k": 0.8, **(given if "lattice" in given else {})}
    wanted = cb.symmetric(a=0.5, gamma=0.08, k=0.8, **given)
    chosen = page.explorer.chosen
    assert chosen.orbit.p == wanted.p
    assert eval(chosen.code, {"cb": cb}).p == wanted.p
    press(page, "Continue")
    upper = page.explorer.state.curves["branch1"]["p"].argmax()
    page.point.value = int(upper)
    fields = {name: field.value for name, field in page.forms.breather.items()}
    assert fields["lattice"].removeprefix("ring:") == texts.get("lattice", "").removeprefix("ring:")
    show(page)
    again = page.explorer.chosen.orbit.p
    assert again == pytest.approx(page.explorer.state.curves["branch1"]["p"][upper], rel=1e-7)


def test_a_file_that_exists_is_replaced_at_the_second_press_only(page: Page, tmp_path: Any) -> None:
    path = tmp_path / "run.nc"
    path.write_text("of last week")
    press(page, "Show")
    press(page, "Continue")
    page.forms.file.value = ""
    press(page, "Save all curves")
    assert "the name of the file" in sentence(page.forms.troubles["Keep"])
    page.forms.file.value = "n" * 300
    press(page, "Save all curves")
    assert "File name too long" in page.status.html + sentence(page.forms.troubles["Keep"])
    page.forms.file.value = str(path)
    press(page, "Save all curves")
    assert "press again to replace it" in sentence(page.forms.troubles["Keep"])
    assert path.read_text() == "of last week"
    press(page, "Save all curves")
    assert sentence(page.forms.troubles["Keep"]) == ""
    assert cb.load(path)["branch1"].names
    press(page, "Save all curves")  # and is asked about again the next time
    assert "press again" in sentence(page.forms.troubles["Keep"])


@pytest.mark.slow
def test_other_ranges_are_those_of_the_library_which_says_so(bare: Page) -> None:
    press(bare, "Show")
    window, length = bare.forms.window, bare.forms.length
    for field, text, button, said in (
        (window["low"], "1.3", "Continue", "is empty: (1.3, 1.2)"),
        (length["sites"], "2001", "Simulate from here", "at most 2000 sites"),
        (length["sites"], "0", "Simulate from here", "sites = 0: a whole number"),
        (length["periods"], "1000000000", "Simulate from here", "shorten it"),
        (length["push"], "nan", "Simulate from here", "push = nan: a change of velocity"),
    ):
        before, field.value = field.value, text
        press(bare, button)
        troubles = [sentence(trouble) for trouble in bare.forms.troubles.values()]
        assert any(said in text for text in (*troubles, bare.status.html))
        field.value = before
    press(bare, "Show")


def test_another_plane_is_that_through_what_is_looked_at(page: Page) -> None:
    tap(page.zones.figure, 0.12, 0.5)
    page.plane.value = "gamma"
    assert page.explorer.state.fixed == ("gamma", 0.12)
    assert (page.slider.label, page.slider.value) == ("coupling \N{GREEK SMALL LETTER GAMMA}", 0.12)
    assert page.explorer.wait(HUNG)
    page.render()
    axes = page.zones.figure.xaxis.axis_label, page.zones.figure.yaxis.axis_label
    assert axes == ("k", "a")
    assert page.zones.here.data == {"x": [0.8], "y": [0.5]}
    assert page.explorer.state.plane.pair == axes
    tap(page.zones.figure, 0.7, 0.5)
    assert page.explorer.chosen.code == "cb.symmetric(a=0.5, gamma=0.12, k=0.7)"
    assert "\nzones = cb.zones(gamma=0.12)\n" in page.explorer.script()


def test_a_value_of_the_slider_is_not_sent_back_rounded(page: Page) -> None:
    """It would pull the slider back to where it was when a key is held."""
    page.slider.value = sent = 0.7000000000000001
    assert page.explorer.state.fixed == ("k", 0.7)
    assert page.slider.value == sent
    page.explorer.look_at(0.8)
    assert page.slider.value == 0.8


def test_a_simulation_is_judged_and_a_long_lattice_is_not(page: Page) -> None:
    tap(page.zones.figure, 0.104, 0.2)
    for name, value in (("sites", "20"), ("periods", "200"), ("push", "0.001")):
        page.forms.length[name].value = value
    press(page, "Simulate from here")
    assert "delocalised: there is no breather" in page.run.figure.title.text
    page.forms.length["sites"].value, page.forms.length["periods"].value = "301", "1"
    press(page, "Simulate from here")
    assert "delocalised" not in page.run.figure.title.text


def test_less_than_a_period_is_simulated_and_not_drawn(page: Page) -> None:
    tap(page.zones.figure, 0.08, 0.5)
    for periods in ("0", "0.5"):
        page.forms.length["periods"].value = periods
        press(page, "Simulate from here")
        assert not page.explorer.busy
        assert "done in" in page.explorer.message
        assert page.explorer.state.run is None


def test_of_curves_of_two_problems_those_are_drawn_that_were_ticked_last() -> None:
    breathers = cb.trace(cb.symmetric(a=0.5, gamma=0.04, k=0.8), "a", within={"a": (0.4, 0.6)})
    square = cb.Problem(lambda x, p: np.array([x[0] ** 2 - p["mu"]]), {"x": 1.0}, {"mu": 1.0})
    explorer = Explorer(breathers, cb.trace(square, "mu", within={"mu": (0.5, 2.0)}))
    page = Page(explorer)
    for ticked, wanted in (
        (["given2"], (["given2"], "mu", "x")), (["given1", "given2"], (["given1"], "a", "p")),
        (["given1", "given2"], (["given2"], "mu", "x")), ([], ([], "a", "p")),
        (["given1"], (["given1"], "a", "p")),
    ):  # fmt: skip
        assert explorer.wait(HUNG)  # what a thread draws is not to pass this on its way
        page.shown.value = ticked
        codes = page.branches.key.data["word"][: len(wanted[0])]
        assert (codes, page.x.value, page.y.value) == wanted
        agree(page)


def test_where_an_impact_vanishes_all_else_is_drawn_and_why_no_multipliers(page: Page) -> None:
    tap(page.zones.figure, 0.08, 0.1)
    press(page, "Continue")
    page.label.value = page.label.options["VI1"]
    assert max(page.profile.sites.data["high"]) == pytest.approx(1.0)
    assert "VI1 on branch1" in page.words.text.text
    assert page.multipliers.dots.data["x"] == []
    why = "ring of 400: nothing is said of stability where an impact vanishes"
    assert page.multipliers.figure.title.text.strip().replace("\n", " ") == why
    with pytest.raises(BadInput, match=why):
        cb.plotting.plot_multipliers(page.explorer.chosen.point)


def test_undo_goes_back_to_the_breather_from_which_the_curve_went(page: Page) -> None:
    tap(page.zones.figure, 0.08, 0.1)
    press(page, "Continue")
    page.label.value = page.label.options["LP1"]
    page.undo.clicks += 1
    assert "branch1 is taken back." in page.status.text.text
    assert page.explorer.chosen.code == "cb.symmetric(a=0.1, gamma=0.08, k=0.8)"
    assert "here = cb.symmetric(a=0.1, gamma=0.08, k=0.8)" in page.explorer.script()
    assert page.forms.breather["a"].value == "0.1"
    assert not any(page.forms.buttons[name].disabled for name in ("Continue", "Simulate from here"))
    assert (page.label.options, page.branches.here.data["x"]) == ({"\N{EN DASH}": -1}, [])


def test_without_a_breather_nothing_of_an_earlier_one_is_left(bare: Page) -> None:
    tap(bare.zones.figure, 0.08, 0.1)
    bare.explorer.change(chosen=None)
    for data in (bare.profile.sites.data, bare.motion.lines.data, bare.multipliers.dots.data):
        assert not any(map(len, data.values()))
    assert bare.words.text.text == ""


def test_where_nothing_can_be_continued_the_page_says_why(bare: Page, tmp_path: Path) -> None:
    square = cb.Problem(lambda x, p: x * x - p["m"], start={"x": 1.0}, params={"m": 1.0})
    cb.save(tmp_path / "run.nc", cb.trace(square, "m", within={"m": (0.5, 2.0)}))
    bare.explorer.choose(point_of("mine", cb.load(tmp_path / "run.nc"), 1))
    for name in ("Continue", "Simulate from here"):
        assert bare.forms.buttons[name].disabled
    assert "continued and simulated are breathers between walls that" in bare.words.text.text


def test_the_curve_that_came_last_is_listed_by_what_it_is(page: Page) -> None:
    for gamma in (0.08, 0.07):
        tap(page.zones.figure, gamma, 0.1)
        press(page, "Continue")
    assert page.curve.options == {
        "branch1: gamma = 0.08": "branch1", "branch2: gamma = 0.07": "branch2",
    }  # fmt: skip
    page.explorer.choose_point("branch1", 3)
    press(page, "Continue")
    assert page.curve.value == "branch3"
    page.label.value = page.label.options["LP1"]
    assert page.explorer.chosen.code == "branch3.first('LP1')"


def test_zones_of_another_lattice_than_that_of_the_breather_say_so(page: Page) -> None:
    tap(page.zones.figure, 0.08, 0.1)
    assert "chosen" not in page.zones.figure.title.text
    on_ring = page.explorer.chosen.orbit.on(cb.Ring(12))
    page.explorer.choose(Chosen("...", on_ring))
    assert page.zones.figure.title.text.strip() == "infinite chain, k = 0.8; chosen: ring of 12"


def test_stable_is_said_of_a_lattice_that_is_named_beside_it(page: Page) -> None:
    """The chain may be stable where a ring is not, for on that waves come back."""
    for lattice, on in (("", "infinite chain"), ("ring:12", "ring of 12")):
        typed(page, lattice=lattice)
        word = "stable" if page.explorer.chosen.orbit.stability().stable else "unstable"
        said = f"{word} on the {on}"
        assert page.motion.figure.title.text.strip().startswith(said)
        assert said in page.status.text.text
    assert word == "unstable"


@pytest.mark.parametrize(
    ("texts", "on"),
    [
        ({}, cb.Ring(400)),
        ({"lattice": "open:9", "site": "4", "damping": "0.02", "gamma": "0.03"}, cb.OpenChain(9)),
    ],
)
def test_a_simulation_as_it_is_offered_confirms_the_verdict(page: Page, texts: Any, on: Any):
    """On the lattice that is judged, damped as is set; the push is small and stays so."""
    typed(page, **texts)
    orbit = page.explorer.chosen.orbit
    press(page, "Simulate from here")
    _, run = page.explorer.state.run
    there = orbit.on(on)
    assert there.stability().stable
    assert run.conditions == there.conditions
    push = float(page.forms.length["push"].value)
    away = np.abs(run.strobe.u - there.state()[0]).max(axis=1)
    assert away.max() < 10.0 * push
    assert away[-1] < push
    said = page.run.figure.title.text.replace("\n", " ")
    assert f"{away[-1]:.2g} from the breather" in said
    assert page.forms.length["sites"].value == str(on.sites)
    assert page.forms.length["sites"].disabled == (orbit.lattice.sites is not None)


def agree(page: Page) -> None:
    """Menus, ticks and the picture say the same."""
    figure, state = page.branches.figure, page.explorer.state
    ticked = page.shown.value
    assert len({*page.branches.lines.data["colour"]}) == len(ticked)
    assert page.branches.key.data["word"][: len(ticked)] == ticked
    assert [*page.curve.options.values()] == ticked
    for menu, axis in ((page.x, figure.xaxis), (page.y, figure.yaxis)):
        assert menu.value in menu.options
        assert axis.axis_label == letter(menu.value)
        assert all(menu.value in state.curves[code].names for code in ticked)


@pytest.mark.slow
def test_menus_ticks_and_picture_agree_whatever_is_clicked(page: Page) -> None:
    typed(page, a="0.7", gamma="0.04")
    press(page, "Continue")
    page.y.value = "phi"
    agree(page)
    page.label.value = page.label.options["PF1"]
    press(page, "Switch branch here")  # its arms have no phi
    agree(page)
    assert page.shown.value == ["branch1", "arms2[0]", "arms2[1]"]
    for ticked in (["branch1"], ["arms2[1]"], [], ["arms2[0]"], ["branch1", "arms2[0]"]):
        page.shown.value = ticked
        agree(page)
        for name in page.y.options[:-1:3]:
            page.y.value = name
            agree(page)
        page.shown.value = ["branch1", "arms2[0]", "arms2[1]"]
        agree(page)
    press(page, "Trace this boundary")
    agree(page)
    page.undo.clicks += 1
    agree(page)


@pytest.mark.slow
def test_a_fork_is_drawn_by_a_size_first_and_by_what_all_its_curves_have() -> None:
    """A size is the ordinate, also on finite lattices, whose first unknown is a time."""
    on = {"lattice": cb.Ring(5), "damping": 0.02}
    finite = cb.trace(cb.symmetric(a=0.5, gamma=0.04, k=0.8, **on), "a", within={"a": (0.4, 0.6)})
    chain = cb.trace(cb.symmetric(a=0.5, gamma=0.04, k=0.8), "a", within={"a": (0.4, 0.6)})
    for curves in ((finite,), (chain, finite), (finite, chain)):
        page = Page(Explorer(*curves))
        agree(page)
        assert (page.x.value, page.y.value) == ("a", "p")
        shared = set.intersection(*({*curve.names} for curve in curves))
        assert {"a", "p", "unstable"} <= {*page.y.options} <= shared


@pytest.mark.slow
def test_breathers_of_oscillators_are_drawn_by_their_size_not_a_fixed_parameter() -> None:
    chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(3))
    b = cb.breather(chain, {0: 1}, omega=1.5, params={"c": 0.05})
    family = cb.trace(b, "omega", within={"omega": (1.4, 1.6)}, events=(), steps=cb.Steps(most=3))
    page = Page(Explorer(family))
    assert (page.x.value, page.y.value) == ("omega", "max|u|")
    page.explorer.choose_point("given1", 1)
    assert "between walls" in page.words.html
