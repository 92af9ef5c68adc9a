"""What is proved is so, what is wrong is refused, and what is not proved is said."""

from __future__ import annotations

import importlib
import json
import math
import random
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace

import mpmath
import pytest
from flint import arb

import contbreather as cb
import contbreather.certified
from contbreather.certified import Interval, certify, winding
from contbreather.certified.proofs import certify_curve, certify_point
from contbreather.orbits import Orbit, orbit_of
from contbreather.stability.one_impact import HalfMap
from tests.lattice.by_hand import MEANS, ring_mean

from ..typed import Run


def breathers(seed: int, *, admissible: bool = True) -> Iterator[Orbit]:
    """At random in the zones of existence, or outside of them."""
    rng = random.Random(seed)
    while True:
        a, gamma, k = rng.uniform(0.02, 1), rng.uniform(0, 0.245), rng.uniform(0.02, 1)
        try:
            b = cb.symmetric(a=a, gamma=gamma, k=k, root=1)
        except cb.NoSolution:
            continue
        if b.admissibility().ok == admissible:
            yield b


def test_a_hundred_random_breathers_are_proved() -> None:
    for b, _ in zip(breathers(1), range(100), strict=False):
        proof = certify(b)
        assert proof, proof
        assert proof.unproved == ()
        assert proof.unstable == b.stability().unstable
        assert max(x.width for x in proof.enclosure.values()) < 1e-14
        assert b.p in widened(proof.enclosure["p"])
        assert b.entries[0] in widened(proof.enclosure["b"])


def widened(x: Interval) -> Interval:
    return Interval(x.low - 1e-13, x.high + 1e-13)


def wrong(b: Orbit, rng: random.Random) -> Orbit:
    """The same, a little beside."""
    by, times = rng.choice([-1, 1]) * 10 ** rng.uniform(-7.5, -2), b.times
    grown = 1.0 + by if (later := rng.random() < 0.5) else 1.0
    return orbit_of(b.conditions, b.section, times + (0.0 if later else by), b.impulses * grown)


def test_a_hundred_wrong_points_are_refused() -> None:
    rng = random.Random(2)
    for b, _ in zip(breathers(3), range(100), strict=False):
        proof = certify(wrong(b, rng))
        assert proof.exists is False, proof
        assert not proof
        assert not proof.unique
        assert "does not exist within 1e-08" in proof.describe()


def test_the_phase_that_is_printed_in_13_is_refused() -> None:
    b = cb.symmetric(a=0.5, gamma=0.12, k=0.4)
    printed = -math.asin(b.p * (1 - b.k) / (1 + b.k) / b.a)
    assert certify(orbit_of(b.conditions, b.section, [printed], b.impulses)).exists is False


def test_what_goes_through_a_wall_is_proved_to() -> None:
    for b, _ in zip(breathers(4, admissible=False), range(40), strict=False):
        proof = certify(b)
        assert (proof.exists, proof.admissible, bool(proof)) == (True, False, False), proof


@pytest.mark.parametrize(
    ("a", "gamma", "k"), [(0.8, 0.0, 0.017), (0.8, 0.01, 0.01), (0.99, 0.0, 0.056)]
)
def test_a_site_that_meets_its_own_wall_again_is_refused(a: float, gamma: float, k: float) -> None:
    b = cb.symmetric(a=a, gamma=gamma, k=k, root=1)
    margins = b.admissibility()
    assert (margins.ok, margins.site) == (False, 0)
    proof = certify(b)
    assert proof.admissible is False
    assert proof.reason.startswith("site 0 between its impacts")
    assert proof.unstable is None


@pytest.mark.parametrize(("a", "k"), [(0.8, 0.019), (0.99, 0.0563), (0.6, 0.0)])
def test_a_site_that_just_leaves_its_wall_is_proved_to(a: float, k: float) -> None:
    assert certify(cb.symmetric(a=a, gamma=0.0, k=k)).admissible


def test_a_far_field_beyond_the_walls_is_refused() -> None:
    b = cb.symmetric(a=1.02, gamma=0.02, k=0.8)
    proof = certify(b)
    assert proof.admissible is False
    assert "the far field goes through a wall" in proof.describe().lower()


def test_a_random_number_of_multipliers_is_that_of_the_signs() -> None:
    """The winding number, which needs no lemma, and (T16), which needs one."""
    rng = random.Random(6)
    for _ in range(300):
        gamma, k, b = rng.uniform(0, 0.249), rng.uniform(0, 0.99), rng.gauss(0, 1)
        unstable, _ = winding.count(arb(gamma), arb(k), arb(b))
        assert unstable == HalfMap(gamma, k, b).count().count, (gamma, k, b)


def test_a_multiplier_on_the_circle_is_not_counted(in_a: cb.Branch) -> None:
    proof = certify(in_a.first("PF").solution)
    assert proof
    assert proof.unstable is None
    assert "on the band" in proof.unproved[0]


# --- special points -----------------------------------------------------------------------------


def test_pitchfork_and_fold_are_enclosed_in_a_few_ulps(in_a: cb.Branch) -> None:
    with mpmath.workdps(30):
        chi, sigma = (ring_mean(MEANS[name], mpmath.mpf(0.04), 80) for name in ("chi", "sigma"))
        q = (1 - mpmath.mpf(0.8)) / (1 + mpmath.mpf(0.8))
        pitchfork = mpmath.sqrt(q**2 + 4 * sigma**2) / (chi - 2 * sigma)
        fold = q / mpmath.sqrt(chi**2 + q**2)
        for kind, exact in (("PF", pitchfork), ("LP", fold)):
            proof = certify(in_a.first(kind))
            assert proof
            assert proof.kind == kind
            low, high = proof.enclosure["a"]
            assert mpmath.mpf(low) <= exact <= mpmath.mpf(high)
            assert high - low < 1e-15
            assert proof.conditions == {"gamma": 0.04, "k": 0.8}


def test_a_pitchfork_that_is_none_is_refused(in_a: cb.Branch) -> None:
    point = in_a.first("PF")
    beside = certify_point(
        {"gamma": 0.04, "k": 0.8}, {"p": point["p"], "phi": point["phi"], "a": 0.777}, "PF", 1e-8
    )
    assert beside.exists is False
    fold = certify(replace(point, kind="LP"))
    assert fold.exists is False
    assert "a fold of breathers does not exist" in fold.describe()


def test_on_a_boundary_one_parameter_stays_what_it_is(in_a: cb.Branch) -> None:
    within = {"gamma": (0.03, 0.05), "a": (0.0, 1.0)}
    line = cb.boundary(in_a.first("PF"), ("gamma", "a"), within=within)
    proof = certify(line[3])
    assert proof
    assert line[3]["gamma"] in widened(proof.enclosure["gamma"])
    assert proof.conditions["a"] == line[3]["a"]
    with pytest.raises(cb.BadInput, match="of a boundary take its points"):
        certify(line)


# --- branches -----------------------------------------------------------------------------------


def test_ends_that_differ_are_printed_differently() -> None:
    low, high = 0.1196343, 0.1196343 + 3e-13
    assert Interval(low, high).text == "[0.1196343, 0.1196343000003]"
    assert Interval(0.02, 0.03).text == "[0.02, 0.03]"
    assert Interval(0.3, 0.3).text == "[0.3, 0.3]"


@pytest.mark.slow
def test_the_branch_at_half_the_amplitude_is_proved_where_it_exists() -> None:
    b = cb.symmetric(a=0.5, gamma=0.0, k=0.8)
    branch = cb.trace(b, "gamma", within={"gamma": (0.0, 0.24)}, towards="up")
    proof = certify(branch)
    end, loss = branch.first("GR")["gamma"], branch.first("NS")["gamma"]
    ((low, high),) = proof.covered
    assert proof.connected
    assert low == 0.0
    assert end - 2e-9 < high <= end
    (stable,), (unstable,) = proof.counted(0), proof.counted(2)
    assert stable.low == 0.0
    assert stable.high < loss < unstable.low < stable.high + 3e-5
    assert unstable.high == high
    gaps = (
        (stable.high, unstable.low, "how many multipliers are outside the circle: D may vanish"),
        (high, end, "whether breathers are admissible: site 1 comes too close to a wall"),
    )
    for said, (first, last, why) in zip(proof.unproved, gaps, strict=True):
        place, sentence = said.removeprefix("for gamma in [").split("], ")
        assert [float(x) for x in place.split(", ")] == pytest.approx([first, last], abs=2e-9)
        assert sentence.startswith(why)
    for gamma in (end + 1e-6, 0.21, 0.24):
        assert certify(cb.symmetric(a=0.5, gamma=gamma, k=0.8, root=1)).admissible is False


def test_a_branch_is_proved_around_its_fold() -> None:
    b = cb.symmetric(a=0.1, gamma=0.04, k=0.8)
    branch = cb.trace(b, "a", within={"a": (0.05, 0.2)}, towards="both")
    proof = certify(branch)
    assert proof.connected
    assert all(tile.admissible for tile in proof.tiles)
    assert {tile.along for tile in proof.tiles} == {"phi", "a"}
    assert abs(certify(branch.first("LP")).enclosure["a"].low - proof.covered[0].low) < 3e-12


def test_a_branch_through_a_wrong_point_is_not_said_to_be_one_curve() -> None:
    places = [(b.p, b.phi, a) for a in (0.2, 0.21, 0.22) for b in [cb.symmetric(a, 0.04, 0.8)]]
    given = {"gamma": 0.04, "k": 0.8}
    assert certify_curve(given, "a", places).connected
    places[1] = (places[1][0], places[1][1] + 1e-9, places[1][2])
    assert not certify_curve(given, "a", places).connected


def test_a_tile_in_k_and_in_a_harmonic_is_proved_too() -> None:
    forcing = cb.Fourier(cos={1: -1.0, 3: -0.5}, sin={3: 0.2})
    b = cb.symmetric(a=0.4, gamma=0.06, k=0.7, forcing=forcing)
    assert certify(b)
    for free, within in (("k", (0.7, 0.75)), ("c3", (-0.5, -0.45))):
        proof = certify(cb.trace(b, free, within={free: within}, towards="up"))
        assert proof.connected
        assert proof.unproved == ()
        assert proof.covered == (within,)


# --- what it is not about -----------------------------------------------------------------------


def _line() -> cb.Branch:
    mine = cb.Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0})
    return cb.trace(mine, "mu", within={"mu": (0.0, 0.1)})


def _tied() -> cb.Branch:
    half = cb.symmetric(0.7, 0.04, 0.8).problem.tied({"a": lambda p: 2 * p["a"]}, a=0.35)
    return cb.trace(half, "a", within={"a": (0.3, 0.4)})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda _: cb.symmetric(0.5, 0.05, 0.8).on(cb.Ring(20)), "ring of 20.*: take it to"),
        (lambda _: cb.symmetric(0.5, 0.05, 0.8, spring=0.2), "spring = 0.2.*: begin without"),
        (
            lambda _: cb.symmetric(0.5, 0.05, 0.8, forcing="-cos(t)-cos(3*t)/9"),
            "give the harmonics by Fourier",
        ),
        (lambda branch: cb.switch(branch.first("PF"))[0][3], "symmetric breathers with"),
        (lambda _: cb.symmetric(0.5, 0.05, 0.8, lattice=cb.OpenChain(5)), "open chain with"),
        (lambda _: 3, "takes a breather, a point or a branch"),
        (lambda _: _line(), "takes a breather, a point or a branch"),
        (lambda _: _line()[0], "takes a breather, a point or a branch"),
        (lambda _: _tied(), "not in tied ones"),
        (lambda _: _tied().first("PF"), "not in tied ones"),
    ],
    ids=[
        "ring",
        "spring",
        "formula",
        "arm",
        "open",
        "number",
        "own branch",
        "own point",
        "tied",
        "tied point",
    ],
)
def test_others_are_refused_in_a_sentence(
    make: Callable[[cb.Branch], object], words: str, in_a: cb.Branch
) -> None:
    with pytest.raises(cb.BadInput, match=words):
        certify(make(in_a))


def test_without_python_flint_a_sentence_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    b = cb.symmetric(0.5, 0.05, 0.8)
    for name in [name for name in sys.modules if name.startswith("contbreather.certified")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(cb.BadInput, match=r"pip install 'contbreather\[certified\]'"):
        b.certify()
    monkeypatch.undo()
    importlib.import_module("contbreather.certified")


# --- the command --------------------------------------------------------------------------------


def test_the_command_proves_a_point(run: Run) -> None:
    status, out, err = run("point --a 0.5 --gamma 0.08 --k 0.8 --certify --json")
    proof = json.loads(out)["certificate"]
    assert (status, err) == (0, "")
    assert (proof["exists"], proof["admissible"], proof["unstable"]) == (True, True, 0)
    low, high = proof["enclosure"]["p"]
    assert low <= json.loads(out)["p"] <= high
    status, out, _ = run("point --a 0.5 --gamma 0.08 --k 0.8 --certify")
    assert status == 0
    assert re.search("exists +│ +yes .*the only one within +│ +0.3 ", out, re.DOTALL)


def test_the_command_says_what_it_cannot_prove(run: Run) -> None:
    status, out, err = run("point --a 0.7776324259443297 --gamma 0.04 --k 0.8 --certify --json")
    assert status == 1
    assert json.loads(out)["certificate"]["unstable"] is None
    assert "how many multipliers are outside the circle" in err
    status, _, err = run("point --a 0.5 --gamma 0.04 --k 0.8 --lattice ring:20 --certify")
    assert status == 2
    assert "infinite chain" in err
