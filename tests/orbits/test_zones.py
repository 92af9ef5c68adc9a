"""Zone diagrams: complete, exact, and found without a seed for any restitution."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import shapely

import contbreather as cb
from contbreather.orbits.closure import smallest_amplitude
from contbreather.orbits.zone_diagram import regions
from contbreather.stability import ns_points
from tests.campaigns import existence

from .by_hand import distance

CHAIN = cb.InfiniteChain()
KS = (0.001, 0.05, 0.4, 0.8, 0.99)


@lru_cache(maxsize=8)
def zones(k: float) -> cb.orbits.Zones:
    return cb.zones(k=k)


WELLS = cb.Fourier(cos={1: -1.0, 3: -2.7})  # up to four breathers at one point


@pytest.mark.slow
@pytest.mark.parametrize("k", KS)
def test_every_curve_has_its_points_and_solves_its_equations(k: float) -> None:
    for _, branch in zones(k):
        assert len(branch) >= 60
        assert branch["residual"].max() < 1e-12
        assert not branch.stop.failed
        assert branch.began is None or not branch.began.failed
        assert branch.doubtful == ()


@pytest.mark.parametrize("k", KS)
def test_lower_limit_is_eq_14_all_along(k: float) -> None:
    (line,) = zones(k).curves["LP"]
    wanted = [smallest_amplitude(gamma, k) for gamma in line["gamma"]]
    np.testing.assert_allclose(line["a"], wanted, rtol=1e-10)
    assert line["gamma"].min() == 0
    assert line["gamma"].max() == 0.2499


@pytest.mark.parametrize("k", [0.4, 0.8, 0.99])
def test_pitchfork_line_is_the_closed_form_up_to_its_meeting_with_grazing(k: float) -> None:
    (line,) = zones(k).curves["PF"]
    q = (1 - k) / (1 + k)
    chi = np.array([CHAIN.chi(gamma) for gamma in line["gamma"]])
    sigma = np.array([CHAIN.sigma(gamma) for gamma in line["gamma"]])
    p = 1 / (chi - 2 * sigma)
    np.testing.assert_allclose(line["p"], p, rtol=1e-11)
    np.testing.assert_allclose(line["a"], p * np.sqrt(q**2 + 4 * sigma**2), rtol=1e-11)
    assert [point.kind for point in line.special] == ["EP", "PF-GR"]
    assert line["gamma"].min() == 0


def test_no_pitchfork_where_there_is_none() -> None:
    """At k = 0.05 it would need a = 1.18 > 1 at gamma = 0."""
    q = 0.95 / 1.05
    assert 2 * math.sqrt(4 + (math.pi * q) ** 2) / (math.pi**2 - 4) > 1
    assert zones(0.05).curves["PF"] == ()


@pytest.mark.parametrize("k", KS)
def test_neimark_sacker_line_is_complete(k: float) -> None:
    """Second way: all NS points at a coupling are roots in one variable with an explicit b, and
    b tells the amplitude. Each of them that is a breather must lie on the traced curve."""
    lines = zones(k).curves["NS"]
    assert len(lines) == 1
    (line,) = lines
    order = np.argsort(line["arclength"])
    gamma, a = line["gamma"][order], line["a"][order]
    seen = 0
    for coupling in np.linspace(0.0203, 0.2453, 91):  # off the comb, so that no node is hit
        crossings = _crossings(gamma, a, coupling)
        wanted = [_amplitude(coupling, k, root.b) for root in ns_points(coupling, k)]
        wanted = [value for value in wanted if value is not None]
        assert len(crossings) == len(wanted), f"gamma = {coupling}"
        assert np.allclose(sorted(crossings), sorted(wanted), atol=2e-3)
        seen += len(wanted)
    assert seen >= 2


def _crossings(gamma: np.ndarray, a: np.ndarray, coupling: float) -> list[float]:
    i = np.flatnonzero((gamma[1:] - coupling) * (gamma[:-1] - coupling) < 0)
    u = (coupling - gamma[i]) / (gamma[i + 1] - gamma[i])
    return list(a[i] + u * (a[i + 1] - a[i]))


def _amplitude(gamma: float, k: float, b: float) -> float | None:
    """a of the admissible breather on the upper branch with this b, by (13) turned round:
    b = (1+k)^2 (p (chi - eta) - 1)/(2p), and (1 - p chi)^2 + p^2 q^2 = a^2."""
    chi, eta, q = CHAIN.chi(gamma), CHAIN.eta(gamma), (1 - k) / (1 + k)
    p = 1 / (chi - eta - 2 * b / (1 + k) ** 2)
    if p <= chi / (chi**2 + q**2):
        return None  # behind the fold
    a = math.hypot(1 - p * chi, p * q)
    if not smallest_amplitude(gamma, k) < a < 1:
        return None
    breather = cb.symmetric(a, gamma, k)
    return a if abs(breather.p - p) < 1e-9 and breather.admissibility().ok else None


@pytest.mark.parametrize("k", KS)
def test_upper_limit_is_where_admissibility_ends(k: float) -> None:
    for line in zones(k).curves["GR"]:
        for point in list(line)[5:-5:7]:
            gamma, a = point["gamma"], point["a"]
            inside = cb.symmetric(a * (1 - 1e-5), gamma, k, root=1).admissibility()
            outside = cb.symmetric(a * (1 + 1e-5), gamma, k, root=1).admissibility()
            assert inside.ok
            assert not outside.ok


def test_meetings_are_seen_from_both_curves_at_the_same_place() -> None:
    diagram = zones(0.8)
    for one, other in (("PF", "GR"), ("NS", "GR"), ("NS", "LP")):
        first = diagram[one][0].first(f"{one}-{other}")
        second = diagram[other][0].first(f"{other}-{one}")
        assert first["gamma"] == pytest.approx(second["gamma"], abs=1e-10)
        assert first["a"] == pytest.approx(second["a"], abs=1e-10)


def test_meetings_of_a_diagram_are_listed_once() -> None:
    kinds = [point.kind for point in zones(0.8).special]
    assert sorted(kinds) == ["NS-GR", "NS-LP", "PF-GR"]
    with pytest.raises(cb.BadInput, match="no curves"):
        zones(0.8)["HB"]


def test_for_small_k_site_zero_takes_over_the_upper_limit() -> None:
    centre, neighbour = zones(0.05).curves["GR"]
    assert centre[1].solution.admissibility().site == 0
    assert neighbour[-2].solution.admissibility().site == 1
    assert centre[-1]["a"] == pytest.approx(neighbour[0]["a"], abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("plane", [{"gamma": 0.1}, {"a": 0.2}])
def test_other_planes_show_the_same_points(plane: dict[str, float]) -> None:
    ((name, value),) = plane.items()
    diagram = cb.zones(**plane)
    k = 0.8
    here = diagram.curves["NS"][0]
    there = zones(k).curves["NS"][0]
    other = "a" if name == "gamma" else "gamma"
    mine = _crossings(here["k"], here[other], k)
    theirs = _crossings(there[name], there[other], value)
    assert mine
    for crossing in mine:
        assert min(abs(crossing - wanted) for wanted in theirs) < 2e-3
    (fold,) = diagram["LP"]
    folds = map(smallest_amplitude, *(np.broadcast_to(fold[n], len(fold)) for n in ("gamma", "k")))
    np.testing.assert_allclose(fold["a"], [*folds], rtol=1e-10)


@pytest.mark.slow
def test_a_curve_narrower_than_the_comb_is_found_between_its_meetings() -> None:
    found = cb.zones(k=0.3, lattice=cb.Ring(8), within={"gamma": (0.24, 0.2499)})
    (line,) = found["NS"]
    assert np.ptp(line["gamma"]) < 1e-5
    assert sorted(point.kind for point in line.special) == ["NS-GR", "NS-LP"]
    for other in ("LP", "GR"):
        there = found[other][0].first(f"{other}-NS")
        here = line.first(f"NS-{other}")
        assert there["a"] == pytest.approx(here["a"], abs=1e-9)
        assert there["gamma"] == pytest.approx(here["gamma"], abs=1e-9)


@pytest.mark.slow
def test_a_curve_from_meeting_to_meeting_next_to_one_gamma_is_found() -> None:
    """At a resonance of a ring three folds meet NS at one gamma, and the curve between two of them
    is 2e-5 wide."""
    forcing = cb.Fourier(cos={1: -1.0, 3: -0.51}, sin={3: 0.257})
    window = {"gamma": (0.244, 0.2475), "a": (0.005, 0.06)}
    found = cb.zones(k=0.826, lattice=cb.Ring(14), forcing=forcing, within=window)
    met = [p["a"] for fold in found["LP"] for p in fold.special if p.kind == "LP-NS"]
    ends = [p["a"] for line in found["NS"] for p in line.special if p.kind == "NS-LP"]
    assert len(met) == 3
    assert min(met) == pytest.approx(min(ends), rel=1e-9)


def test_a_curve_that_passes_between_two_values_of_the_comb_is_found_at_the_edges() -> None:
    """LP from omega = 2.117 on, by eq. (14) and in units of omega, and PF below gamma = 0.007."""
    (fold,) = cb.zones(k=0.65, a=0.6)["LP"]
    unit = fold["omega"] ** 2
    own = [smallest_amplitude(gamma, 0.65) for gamma in fold["gamma"] / unit]
    np.testing.assert_allclose(own * unit, 0.6, rtol=1e-11)
    assert fold["gamma"][[0, -1]].tolist() == [0.0, 0.2499]
    (line,) = cb.zones(k=0.8, within={"a": (0.695, 0.705), "gamma": (0.0, 0.1)})["PF"]
    sigma, chi = ([f(x) for x in line["gamma"]] for f in (CHAIN.sigma, CHAIN.chi))
    own = np.hypot(1 / 9, 2 * np.array(sigma)) / (np.array(chi) - 2 * np.array(sigma))
    np.testing.assert_allclose(line["a"], own, rtol=1e-11)
    np.testing.assert_allclose(line["a"][[0, -1]], [0.695, 0.705], rtol=1e-11)


@pytest.mark.slow
def test_couplings_above_a_quarter_have_a_plane_of_omega() -> None:
    """At omega = 1, which is in the comb, the drive is in the band: no breather, no refusal."""
    diagram = cb.zones(k=0.8, gamma=0.3)
    assert diagram.unstable(1.0, 0.5) is None
    assert {*diagram.meetings()} == {"NS-LP", "NS-GR", "PF-GR"}


def test_windows_narrow_the_search_and_empty_ones_are_refused() -> None:
    narrow = cb.zones(k=0.8, within={"gamma": (0.0, 0.05)})
    assert narrow.curves["LP"][0]["gamma"].max() == 0.05
    assert narrow.curves["NS"] == ()
    with pytest.raises(cb.BadInput, match="no breather"):
        cb.zones(k=0.8, within={"a": (0.0, 0.0001), "gamma": (0.0, 0.1)})
    with pytest.raises(cb.BadInput, match="leaves nothing"):
        cb.zones(k=0.8, within={"gamma": (0.3, 0.4)})


@pytest.mark.slow
def test_all_sheets_of_a_forcing_with_several_breathers(several: cb.orbits.Zones) -> None:
    """Every event on the branch through every admissible root lies on a curve of the diagram."""
    gamma, seen = 0.12, list[cb.continuation.Point]()
    for a in np.linspace(0.05, 0.7, 5):
        for root in cb.orbits.symmetric_roots(a, gamma, 0.8, forcing=WELLS):
            passed = {round(point["p"], 6) for point in seen}
            if not root.admissibility().ok:
                continue
            for point in cb.trace(root, "a").special:
                kind, p = point.kind, point["p"]
                if kind in ("LP", "PF", "NS", "GR") and p > 1e-9 and round(p, 6) not in passed:
                    seen.append(point)
    assert len(seen) >= 7
    for point in seen:
        assert distance(several[point.kind], point, "gamma", "a", "p") < 1e-3, point


@pytest.fixture(scope="module")
def several() -> cb.orbits.Zones:
    return cb.zones(k=0.8, forcing=WELLS, within={"gamma": (0.1, 0.21)}, past_folds=True)


@pytest.mark.parametrize("gamma", [0.005, 0.03])
def test_weakly_coupled_chains_lose_stability_only_where_impacts_are_all_but_elastic(gamma: float):
    """The curve lies beyond k = 0.97, and the counts on both sides of it differ by a pair."""
    (line,) = cb.zones(gamma=gamma)["NS"]
    assert line["k"].min() > 0.97
    point = line[len(line) // 2]
    counts = {
        cb.symmetric(point["a"], gamma, point["k"] + shift).stability().unstable
        for shift in (-1e-6, 1e-6)
    }
    assert len(counts) == 2
    assert max(counts) - min(counts) == 2


@pytest.mark.parametrize("a", [0.97, 0.98, 0.99])
def test_the_limit_goes_on_with_site_zero_in_the_plane_of_k_and_gamma(a: float) -> None:
    diagram = cb.zones(a=a)
    assert len(diagram["GR"]) == 2
    (corner,) = [point for point in diagram.special if point.kind == "GR-GR"]
    sites = set()
    for line in diagram["GR"]:
        margins = line[len(line) // 2].solution.admissibility()
        assert abs(margins.margin) < 1e-9
        sites.add(margins.site)
    assert sites == {0, 1}
    at_corner = corner.solution.admissibility()
    assert at_corner.centre == pytest.approx(0.0, abs=1e-9)
    assert at_corner.neighbours == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "plane", [{"k": 0.05}, {"k": 0.8, "forcing": WELLS, "within": {"gamma": (0.0, 0.04)}}]
)
def test_rows_in_closed_form_show_what_walks_along_them_do(plane: dict[str, Any]) -> None:
    rows, walks = cb.zones(**plane), cb.zones(**plane, past_folds=True)  # which are walked along
    for kind, lines in rows.curves.items():
        assert len(lines) == len(walks.curves[kind])
        nodes = [np.column_stack([line[name] for name in rows.pair]) for line in walks.curves[kind]]
        for line in lines:
            points = shapely.points(*(line[name] for name in rows.pair))
            # to their chords; walks go on behind the fold
            assert shapely.distance(points, shapely.MultiLineString(nodes)).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("k", "forcing", "curves"),
    [
        (0.678213865, cb.Fourier(cos={1: -1.0, 3: -0.61}), {"NS": 2}),
        (0.967845122, cb.Fourier(cos={1: -1.0, 3: -0.59}), {"NS": 2}),
        # a limit of admissible breathers that goes on behind the fold
        (0.07079299464436603, cb.Fourier(
            cos={1: -1.0, 3: -0.800199979361005, 5: 0.5480289365334847},
            sin={3: -0.8762287207172476}), {"NS": 2, "GR": 3}),
    ],
)  # fmt: skip
def test_curves_of_upper_breathers_are_followed_up_to_the_fold_alone(k, forcing, curves):
    diagram = cb.zones(k=k, forcing=forcing)
    assert {kind: len(diagram[kind]) for kind in curves} == curves
    inner = [point.solution for kind in curves for line in diagram[kind] for point in line[5:-5:10]]
    assert {orbit.representation.family for orbit in inner} == {"upper"}


def test_a_curve_knows_the_point_that_it_set_out_from_as_one_of_a_branch_does() -> None:
    origin = zones(0.8).curves["PF"][0].origin
    place = {name: origin[name] for name in ("a", "gamma", "k")}
    window = {"a": (place["a"] - 0.1, place["a"] + 0.1)}
    known = cb.trace(cb.symmetric(**place), "a", within=window).first("PF")
    assert (origin.kind, origin.label) == ("PF", "PF1")
    assert origin.z == pytest.approx(known.z, abs=1e-11)
    assert origin.tangent == pytest.approx(known.tangent, abs=1e-9)
    assert origin.detail["criticality"] == known.detail["criticality"]
    assert origin.detail["coefficient"] == pytest.approx(known.detail["coefficient"], rel=1e-7)


# --- interruption ---------------------------------------------------------------------------------


class Impatient(cb.InfiniteChain):
    """The chain, and Ctrl-C at one of the questions it is asked."""

    def __init__(self, after: int) -> None:
        super().__init__()
        self.left = after

    def mean(self, gamma: float, name: str) -> float:
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        return super().mean(gamma, name)


@pytest.mark.slow
def test_work_is_bounded() -> None:
    """Questions to the chain for a whole diagram, not seconds."""
    chain = Impatient(10**9)
    cb.zones(k=0.6, lattice=chain)
    assert 10**9 - chain.left < 9000


@pytest.mark.parametrize("after", [1, 1000, 2000])
def test_an_interrupted_zone_diagram_is_marked_and_has_no_curve_twice(after: int) -> None:
    with pytest.raises(cb.errors.Interrupted) as stop:
        cb.zones(k=0.8, lattice=Impatient(after), within={"gamma": (0.02, 0.1)})
    kept = stop.value.partial
    assert (kept is None) == (after == 1)
    if kept is not None:
        assert kept.interrupted
        assert "interrupted" in repr(kept)
        assert any(kept.curves.values())
        assert all(len(branches) <= 1 for branches in kept.curves.values())


@pytest.mark.slow
def test_several_values_give_several_diagrams_of_which_an_interruption_keeps_the_finished() -> None:
    plane = {"gamma": (0.02, 0.06), "a": (0.3, 0.9)}
    chain = Impatient(10**9)
    one, other = cb.zones(k=[0.8, 0.4], within=plane, lattice=chain)
    assert (one.fixed, other.fixed) == (("k", 0.8), ("k", 0.4))
    assert [one.interrupted, other.interrupted] == [False, False]
    with pytest.raises(cb.errors.Interrupted) as stop:
        cb.zones(k=[0.8, 0.4], within=plane, lattice=Impatient(10**9 - chain.left - 100))
    kept = stop.value.partial
    assert [each.interrupted for each in kept] == [False, True]
    assert [len(branch) for _, branch in kept[0]] == [len(branch) for _, branch in one]


def test_zones_next_to_no_restitution_are_drawn() -> None:
    """There Newton's iteration fails between some points of a curve, which are left out."""
    found = cb.zones(k=1e-9, within={"gamma": (0.0, 0.05)})
    assert len(found["LP"]) == 1
    assert all(point.residual < 1e-9 for branch in found["LP"] for point in branch)


def test_zones_next_to_elastic_impacts_are_drawn_under_any_forcing() -> None:
    """A step beyond a row is beyond a pole there, where a would be negative."""
    drive = (
        "-cos(t) + 0.19023250707535766*sin(t) - 0.07676185187332951*cos(3*t)"
        " - 0.16304005530883525*cos(5*t)"
    )
    (fold,) = cb.zones(k=0.999, forcing=drive, within={"gamma": (0.0, 0.2499)})["LP"]
    for a, gamma in zip(fold["a"][::20], fold["gamma"][::20], strict=True):
        cb.symmetric(a * (1 + 1e-9), gamma, 0.999, forcing=drive)
        with pytest.raises(cb.NoSolution):
            cb.symmetric(a * (1 - 1e-9), gamma, 0.999, forcing=drive)


@pytest.mark.parametrize("shown", [True, False])
def test_zones_show_their_progress_only_where_it_is_asked_for(shown, capsys, monkeypatch):
    from contbreather import progress

    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress, "INTERVAL", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    found = cb.zones(k=0.8, within={"gamma": (0.1, 0.102), "a": (0.05, 0.06)}, progress=shown)
    assert len(found["LP"]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    # of the whole search; the walks that it is made of, in a, are not shown one by one
    assert ("points, gamma = " in captured.err) == shown
    assert "points, a = " not in captured.err
    assert (captured.err == "") == (not shown)


# --- existence ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("forcing", "close"),
    [(cb.Fourier(cos={1: -1, 3: 0.0}), 1e-9), (cb.Symbolic("-cos(t)-c3*cos(3*t)", c3=1e-9), 1e-7)],
)
def test_one_harmonic_is_one_harmonic_however_it_is_written(forcing, close: float) -> None:
    """Several harmonics made it a diagram of both families, whatever their size."""
    within = {"gamma": (0.1, 0.2)}
    none, tiny = cb.zones(k=0.8, within=within), cb.zones(k=0.8, forcing=forcing, within=within)
    assert not none.past_folds
    assert [len(line) for _, line in none] == [len(line) for _, line in tiny]
    for (_, one), (_, two) in zip(none, tiny, strict=True):
        np.testing.assert_allclose(one["a"], two["a"], rtol=close)
    assert [one.verdict for one in none.regions] == [one.verdict for one in tiny.regions]
    assert none.families == tiny.families == ("upper",)


def around(regions: tuple[cb.orbits.Region, ...], x: float, y: float) -> cb.orbits.Region:
    """The region that a place is in."""
    (found,) = (
        one
        for one in regions
        if shapely.Polygon(one.outline, one.holes).contains(shapely.Point(x, y))
    )
    return found


def test_where_no_upper_breather_is_a_region_says_that_a_lower_one_is() -> None:
    region = around(zones(0.8).regions, 0.197, 0.789)
    lower = cb.orbits.symmetric_roots(region.y, region.x, 0.8)[-1]
    assert lower.admissibility().ok
    assert region.counts == (None,) * 5
    assert region.lower[0] == lower.p
    words = f"no upper breather; a lower one, p = {lower.p:.6g}, is admissible"
    assert words in repr(region)
    assert any(words in told for told in zones(0.8).sentences())
    below = around(zones(0.8).regions, 0.0144, 0.035)
    assert below.describe() == "no upper breather, nor a lower one at any of 5 places"


@pytest.mark.slow
def test_a_diagram_of_both_families_ends_where_impacts_vanish() -> None:
    within = {"gamma": (0.15, 0.22), "a": (0.3, 2.0)}
    both = cb.zones(k=0.8, within=within, past_folds=True)
    assert both.families == ("upper", "lower")
    assert both.ceiling == 1.0
    assert around(both.regions, 0.197, 0.789).counts == (1,) * 5  # one multiplier below -1
    assert both.box()[1][1] == 1.0
    assert both.unstable(0.197, 0.999) == 1
    assert both.unstable(0.197, 1.001) is None
    assert list(both.sentences()) == []
    low = cb.zones(k=0.8, within={**within, "a": (0.3, 0.7)}, past_folds=True)
    assert low.ceiling is None


@pytest.mark.parametrize(
    ("gamma", "a", "within", "past_folds"),
    [
        (0.2318, 0.4973, {"gamma": (0.231, 0.233), "a": (0.25, 0.6)}, False),
        (0.2318, 0.4973, {"gamma": (0.231, 0.233), "a": (0.25, 0.6)}, True),
        (0.0505, 0.9738, {"gamma": (0.05, 0.051), "a": (0.85, 1.0)}, False),
    ],
)
def test_on_a_ring_none_says_that_there_is_no_breather_of_the_families_drawn(
    gamma: float, a: float, within: dict[str, tuple[float, float]], past_folds: bool
) -> None:
    """At both places there is a lower breather alone."""
    diagram = cb.zones(k=0.975, lattice=cb.Ring(33), within=within, past_folds=past_folds)
    region = around(diagram.regions_of((within["gamma"], within["a"])), gamma, a)
    if past_folds:
        assert region.verdict == "US"
    else:
        assert region.counts == (None,) * 5
        assert None not in region.lower


@pytest.mark.slow
def test_a_sheet_between_two_amplitudes_of_the_comb_is_found_next_to_its_fold() -> None:
    forcing = cb.Fourier(cos={1: -1.0, 5: -2.6852264924}, sin={5: 3.0800950413})
    diagram = cb.zones(k=0.073, forcing=forcing, within={"gamma": (0.24, 0.2499)})
    assert any(one.representation.family == "upper" for one in diagram.breathers(0.2474, 0.4))
    assert around(diagram.regions, 0.2474, 0.4).verdict == "US"


@pytest.mark.slow
def test_regions_of_a_random_diagram_say_what_a_direct_search_finds() -> None:
    counts = existence.one(5, seed=1, places=30)
    assert counts["places"] == 30
    assert counts["lower said"] > 0
    assert not set(counts) & {"disagree", "mixed", "misjudged", "lower unsaid"}


def test_a_region_is_shown_in_a_line_with_its_verdict() -> None:
    across = [np.array([[0.0, 0.0], [2.0, 4.0]])]
    above, below = sorted(
        regions(across, ((0.0, 2.0), (0.0, 4.0)), lambda x, y: 2 if y > 2 * x else None),
        key=lambda region: region.x,
    )
    x, y = (f"{value:.6g}" for value in (above.x, above.y))
    assert repr(above) == f"<Region US around ({x}, {y}), 3 corners>"
    assert repr(below).startswith("<Region no verdict around (")
    assert repr(below).endswith("3 corners: no breather>")
    assert above.counts == (2,) * 5
    assert above.room == pytest.approx(1.0 - math.sqrt(0.5), abs=5e-3)  # of a right triangle
    assert above.y > 2 * above.x
    assert below.y < 2 * below.x


@pytest.mark.slow
def test_regions_go_on_to_the_edge_of_the_search_where_no_curve_does() -> None:
    """At a = 0.59 no fold reaches gamma = 0, and NS ends at k = 0.999 above it; of the window of
    the couplings only NS is seen, which spans a part of those of k."""
    place = cb.symmetric(a=0.59, gamma=0.005, k=0.5)
    assert place.admissibility().ok
    assert place.stability().stable
    assert around(cb.zones(a=0.59).regions, place.k, place.gamma).verdict == "S"
    narrow = cb.zones(a=0.59, within={"gamma": (0.03, 0.15)})
    assert around(narrow.regions, 0.1, 0.1).verdict == "S"


def test_zones_without_a_curve_say_that_there_is_nothing_to_draw() -> None:
    empty = cb.zones(k=0.8, within={"a": (0.3, 0.301), "gamma": (0.0, 0.05)})
    assert empty.regions == empty.regions_of(((0.0, 0.2), (0.0, 1.0))) == ()
    with pytest.raises(cb.BadInput, match="this zone diagram has no curve"):
        empty.unstable(0.1, 0.5)
    with pytest.raises(
        cb.BadInput, match="no curves, so there is nothing to draw; widen the window"
    ):
        empty.box()
