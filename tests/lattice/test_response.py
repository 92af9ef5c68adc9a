"""Answers of lattices to impulses that recur: by closed forms, by modes, against dense matrices."""

from __future__ import annotations

import math
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from scipy.linalg import expm

from contbreather.errors import BadInput
from contbreather.lattice import Harmonic, InfiniteChain, Ring
from contbreather.lattice.finite import Grid, Lattice, OpenChain, stiffness_of
from contbreather.lattice.response import (
    ModalResponse,
    Response,
    UniformResponse,
)
from contbreather.orbits.orbit_equations import answers_of, resonant_modes
from contbreather.orbits.section import Section
from tests.stability.by_hand import slope

TIED = OpenChain(6, ends="fixed")


MASSES = Lattice.from_graph(nx.path_graph(5), masses=[1, 2, 0.5, 1, 3])


def modal(lattice, held, hits, turns=1, sign=1, resonant=()) -> ModalResponse:
    return ModalResponse(lattice, Harmonic(), *held, hits, turns, sign, resonant)


def recurring(of: Response, hit: int, since: float) -> np.ndarray:
    """Displacements and velocities of all sites after an impulse that recurs with the sign of the
    section, by dense matrices: nothing holds the lattice where it is, so springs must."""
    lattice = of.lattice
    one, masses = np.eye(lattice.sites), lattice.masses
    A = of.gamma * stiffness_of(lattice).toarray() / masses[:, None] + of.spring * one
    flow = np.block([[0 * one, one], [-A, -of.damping * one]])
    kick = np.concatenate([0 * one[hit], one[hit]])
    # x+ = sign M x+ + kick: after each section as after the last, but for its sign
    start = np.linalg.solve(np.eye(len(flow)) - of.sign * expm(flow * of.length), kick)
    return expm(flow * since) @ start


HELD = [(0.1, 0.3, 0.0), (0.1, 0.3, 0.2), (0.2, 0.16, 0.8), (0.05, 0.01, 2.5)]


@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize(("turns", "sign"), [(1, 1), (1, -1), (2, 1), (3, -1)])
@pytest.mark.parametrize("lattice", [MASSES, TIED, Grid(2, 3), Ring(7), Ring(1)], ids=repr)
def test_modes_answer_as_dense_matrices_do(lattice, turns, sign, held) -> None:
    hit = lattice.sites // 2
    of = modal(lattice, held, (hit,), turns, sign)
    for since in (0.0, 0.4, 0.7 * of.length):
        wanted = recurring(of, hit, since)
        if sign > 0:  # less the static push of a mean impulse, 1 a section
            A = held[0] * stiffness_of(lattice).toarray() / lattice.masses[:, None]
            push = np.eye(lattice.sites)[hit] / of.length
            wanted[: lattice.sites] -= np.linalg.solve(A + held[1] * np.eye(lattice.sites), push)
        found = np.array([of.at(n, np.array([since]))[:2, 0] for n in range(lattice.sites)])
        assert found.T.ravel() == pytest.approx(wanted, abs=1e-11)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("gamma", [0.0, 1e-9, 0.05, 0.2])
@pytest.mark.parametrize("sites", [1, 2, 9, 20])
def test_a_ring_by_its_modes_is_its_closed_form(sites, gamma, sign) -> None:
    ring, hits = Ring(sites), (0,) * 3
    closed = answers_of(ring, Harmonic(), (gamma, 0.0, 0.0), hits, 1, sign)
    assert isinstance(closed, UniformResponse)
    own, times = modal(ring, (gamma, 0.0, 0.0), hits, 1, sign), np.array([0.3, 1.0, 2.9])
    for by in ("", "gamma") if gamma > 1e-6 else ("",):
        wanted = closed.interactions(times, by)
        assert own.interactions(times, by)[:3] == pytest.approx(wanted[:3], abs=3e-13)
    assert own.links() == pytest.approx(closed.links(), abs=1e-14)


@pytest.mark.parametrize("hits", [(0, 3), (1, 4, 5)])
@pytest.mark.parametrize("gamma", [0.0, 0.1])
def test_a_ring_at_rest_is_straight_between_sites_that_are_held(hits, gamma) -> None:
    ring, sites = Ring(8), np.arange(8)
    closed, own = (kind(ring, Harmonic(), gamma, 0.0, 0.0, hits, 1, 1)
                   for kind in (UniformResponse, ModalResponse))  # fmt: skip
    assert own.profile(sites) == pytest.approx(closed.profile(sites), abs=1e-14)
    for by in ("", "gamma"):
        assert own.links(by) == pytest.approx(closed.links(by), abs=1e-14)
    assert closed.profile(np.array(hits)) == pytest.approx(np.eye(len(hits)), abs=1e-14)


@pytest.mark.parametrize("name", ["gamma", "spring", "damping"])
@pytest.mark.parametrize("held", [*HELD, (0.1, 0.0, 0.0), (0.1, 0.0, 0.3)])
@pytest.mark.parametrize("sign", [1, -1])
def test_derivatives_in_what_holds_the_lattice(sign, held, name) -> None:
    times, hits = np.array([0.3, 1.7, 2.0]), (1, 3, 1)
    place = ("gamma", "spring", "damping").index(name)

    def moved(h: float) -> ModalResponse:
        return modal(MASSES, (*held[:place], held[place] + h, *held[place + 1 :]), hits, 1, sign)

    step = 1e-5
    for wanted, found in (
        (slope(lambda h: moved(h).interactions(times)[:3], step),
         moved(0.0).interactions(times, name)[:3]),
        (slope(lambda h: moved(h).profile(0), step), moved(0.0).profile_slope(name, 0)),
        (slope(lambda h: moved(h).links(), step),
         moved(0.0).links(name) if name != "damping" else np.zeros((2, 2))),
    ):  # fmt: skip
        assert found == pytest.approx(wanted, abs=1e-8 * (1.0 + abs(wanted).max()))


def test_a_mode_whose_amplitude_is_an_unknown_answers_without_its_harmonic() -> None:
    """The whole answer is what is left and the mode as far as impulses drive it."""
    ring, hits, T = Ring(6), (0, 2), 4.0 * math.pi
    held, times, J = (0.0626, 0.0, 0.01), np.array([0.4, 5.0]), np.array([1.0, -0.7])
    resonant = resonant_modes(ring, Section(((0, 1), (2, 1)), 2), *held[:2])
    assert resonant
    without, whole = modal(ring, held, hits, 2, 1, resonant), modal(ring, held, hits, 2)
    assert without.length == T
    driven = J @ without.swing(hits, times)[0]
    amplitudes = np.linalg.solve(without.gaps(), driven)
    for site in range(6):
        for t in (0.1, 3.0, 11.0):
            swing = without.swing((site,), np.array([t]))[:, 0] @ amplitudes
            left = without.at(site, t - times)[:4] @ J
            assert left + swing == pytest.approx(whole.at(site, t - times) @ J, abs=1e-11)


def test_on_a_harmonic_the_rest_of_an_answer_is_finite_and_the_whole_is_refused() -> None:
    ring = Ring(8)
    resonant = resonant_modes(ring, Section(((0, 1),), 2), 0.0625, 0.0)
    assert any(w == 0.5 for _, w in resonant)
    without = modal(ring, (0.0625, 0.0, 0.0), (0,), 2, 1, resonant)
    assert np.isfinite(without.interactions(np.zeros(1))).all()
    with pytest.raises(BadInput, match=r"0\.5 times the frequency of the drive is in resonance"):
        modal(ring, (0.0625, 0.0, 0.0), (0,), 2).interactions(np.zeros(1))


def test_no_mode_of_a_chain_or_a_ring_without_springs_comes_to_the_drive() -> None:
    section = Section(((0, 1),))
    assert resonant_modes(InfiniteChain(), section, 0.2, 0.0) == ()
    for sign in (1, -1):
        assert resonant_modes(Ring(40), replace(section, sign=sign), 0.2499, 0.0) == ()
    assert resonant_modes(OpenChain(9), section, 0.2, 0.0)


def test_the_last_impact_goes_on_after_the_first_of_the_next_section() -> None:
    """Where sites that are coupled change the order in which they are hit the third derivative
    jumps; within one section they do so at their times alone."""
    for of in (modal(OpenChain(2), (0.1, 0.0, 0.0), (0, 1)),
               answers_of(Ring(3), Harmonic(), (0.1, 0.0, 0.0), (0, 1), 1, 1)):  # fmt: skip
        jerks = [
            of.interactions(np.array([0.0, of.length + off]))[3, 1, 0] for off in (-1e-7, 1e-7)
        ]
        assert jerks[0] == pytest.approx(jerks[1], abs=1e-6)
        within = [of.interactions(np.array([0.0, off]))[3, 1, 0] for off in (-1e-7, 1e-7)]
        assert abs(within[1] - within[0]) == pytest.approx(0.1, abs=1e-6)
