"""What is wrong is called by the name under which it was given."""

from __future__ import annotations

import inspect
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbreather as cb
import contbreather.simulation as sim
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions
from contbreather.simulation.states import conditions_of

RING = {"a": 0.5, "gamma": 0.08, "k": 0.8}
REST = np.zeros(4), np.zeros(4)
ONE = {"state": ([0.0], [0.0]), "a": 0.5, "gamma": 0.0, "k": 0.8}
CALLS: dict[str, tuple[Any, dict[str, Any]]] = {  # each as it would be answered
    "simulate": (cb.simulate, {"state": REST, "periods": 1, **RING}),
    "smooth": (sim.simulate_smooth, {"state": REST, "periods": 1, "m": 6, **RING}),
    "lattice": (cb.simulate, {"state": ([0.0] * 5, [0.0] * 5), "periods": 1, **RING,
        "lattice": cb.OpenChain(5), "walls": {2: (-0.5, 0.5), 3: (None, 0.7)}}),
    "record": (sim.record, {"path": "unused", "periods": 1, **ONE}),
    "classify": (sim.classify, ONE),
    "lyapunov": (sim.lyapunov, {"periods": 10, "state": (np.zeros(3), np.zeros(3)), **RING}),
    "sweep": (sim.sweep, {"name": "a", "values": [0.2, 0.21], "periods": 5, **ONE}),
    "periodic": (sim.periodic, ONE),
    "attraction": (sim.attraction, {"reference": ([0.0], [0.0]), "x": sim.Axis("u", 0, [0.1]),
        "y": sim.Axis("v", 0, [0.1]), "a": 0.1, "gamma": 0.0, "k": 0.8}),
    "localisation": (sim.localisation, {"u": [0.1, 0.2], "v": [0.3, 0.4], "a": 0.0, "gamma": 0.0}),
    "rotation": (sim.rotation, {"u": np.zeros(30), "v": np.zeros(30)}),
    "sample": (sim.Sample, {}),
    "axis": (sim.Axis, {"name": "u", "site": 0, "values": [0.0]}),
    "there and back": (sim.there_and_back, {}),
}  # fmt: skip
SHAPE = r"u and v must have one shape \(\.\.\., sites\)"
TABLES = "rows of states, or tables with a column for each site"


@pytest.mark.parametrize(
    ("call", "changed", "sentence"),
    [
        ("simulate", {"state": ([0.0, 1.2], [0.0, 0.0])}, r"u\[1\] = 1.2 lies outside the walls"),
        ("simulate", {"state": ([0.0, 0.2], [0.0])}, r"a pair \(u, v\) of rows of equal length"),
        ("simulate", {"state": np.zeros(3)}, r"a pair \(u, v\) .*, got array\(\[0"),
        ("simulate", {"mass": 2.0}, "^simulate .* takes a, gamma, k, .*; not known mass"),
        ("smooth", {"mass": 2.0}, "^simulate .* takes a, gamma, k, .*; not known mass"),
        ("simulate", {"state": cb.symmetric(0.5, 0.08, 0.8)}, r"no end: .* orbit\.on\(Ring\(N\)\)"),
        ("simulate", {"state": ([0.0], [math.nan])}, r"v\[0\] = nan of the state is not finite"),
        ("simulate", {"state": ([0.0], [1e9])}, "blow up the energy"),
        ("simulate", {"damping": -0.1}, "^damping = -0.1: .* 0 <= damping <= 1e4"),
        ("simulate", {"damping": 2e4}, r"^damping = 20000\.0: .* <= 1e4"),
        ("simulate", {"periods": 1e13}, r"^periods = 1(0+)\.0: a length in periods from 0 to 1e12"),
        ("simulate", {"periods": -1}, "^periods = -1"),
        ("simulate", {"k": 1.1}, "^k = 1.1: the restitution coefficient .* 0 <= k <= 1"),
        ("simulate", {"gamma": 0.25}, "^gamma = 0.25"),
        ("simulate", {"a": math.inf}, "^a = inf: the amplitude .* a finite number >= 0"),
        ("simulate", {"t0": math.nan}, "^t0 = nan"),
        ("simulate", {"sample": (0, 1)}, "a Sample was expected"),
        *(("simulate", {"noise": noise}, "^noise = ") for noise in (-1.0, math.nan)),
        ("simulate", {"noise": 0.1, "seed": -1}, "^seed = -1"),
        ("simulate", {"noise": 0.1, "sample": sim.Sample()}, "not recorded densely under noise"),
        *(
            (call, {"noise": 0.1}, r"noise = 0.1: noise is for simulate\(\) alone")
            for call in ("smooth", "record", "classify", "sweep", "attraction", "lyapunov")
        ),
        ("classify", {"noise": 0.1, "m": 6}, r"noise = 0.1: noise is for simulate\(\) alone"),
        ("smooth", {"m": 0}, "^m = 0: the hardness of the wall .* 0.5 <= m <= 1e4"),
        ("smooth", {"lam": 0.1}, "give one of them"),
        ("smooth", {"k": None}, "give one of them"),
        ("smooth", {"k": None, "lam": 2.5}, "lam = 2.5: the damping of the wall .* 0 <= lam <= 2"),
        ("smooth", {"k": -0.1}, r"k = -0\.1: the restitution coefficient .* 0 <= k <= 1"),
        ("smooth", {"periods": 1e13}, r"^periods = 1(0+)\.0: a length in periods from 0 to 1e12"),
        ("smooth", {"gamma": 0.3}, "^gamma = 0.3"),
        ("smooth", {"state": ([1.9], [0.0])}, "lies far behind the walls"),
        ("smooth", {"state": ([0.0, 1.0], [0.0])}, "rows of equal length"),
        *(
            ("smooth", {"tolerance": bad}, rf"^tolerance = {bad!r}: that of the solver")
            for bad in (-1.0, math.nan, 0.5, "x")
        ),
        ("lattice", {"state": REST}, "the state has 4 sites, the lattice .* has 5"),
        ("lattice", {"state": ([0, 0, 0.9, 0, 0], [0.0] * 5)},
         r"u\[2\] = 0.9 lies outside the walls at -0.5 and"),
        ("lattice", {"state": ([0, 0, 0, 0.9, 0], [0.0] * 5)},
         r"u\[3\] = 0.9 lies outside the walls at 0.7;"),
        ("lattice", {"walls": {-2: (None, 0.7)}, "state": ([0, 0, 0, 0.9, 0], [0.0] * 5)},
         r"u\[3\] = 0.9 lies outside the walls at 0.7;"),
        ("lattice", {"walls": {-2: (None, 0.7), 3: (-1, 1)}}, "walls of site 3 are given twice"),
        ("lattice", {"walls": {7: (-1, 1)}},
         "walls of site 7: there is no such site on the open chain"),
        ("lattice", {"walls": (1, -1)}, "two numbers low < high are expected"),
        ("lattice", {"spring": 1e9}, "spring = 1000000000.0: .* 0 <= spring <= 1e8"),
        ("lattice", {"gamma": -0.1}, "gamma = -0.1: the coupling .* 0 <= gamma <= 1e8"),
        ("lattice", {"lattice": cb.InfiniteChain()}, "a finite one is expected"),
        ("lattice", {"sample": sim.Sample((7,))}, "sample: there is no site 7 among 5"),
        ("record", {"periods": 2.5}, "^periods = 2.5"),
        ("classify", {"periods": 50}, "^periods = 50: a whole number, at least"),
        ("classify", {"settle": -1}, "^settle = -1: a whole number, at least"),
        ("lyapunov", {"count": 7}, "count = 7: 3 sites have 6 exponents"),
        ("lyapunov", {"count": 0}, "^count = 0: a whole number, at least"),
        ("lyapunov", {"periods": 9}, "^periods = 9: a whole number, at least"),
        ("lyapunov", {"settle": -1}, "^settle = -1: a whole number, at least"),
        ("lyapunov", {"seed": -1}, "^seed = -1: a whole number, at least"),
        ("sweep", {"periods": 0}, "^periods = 0"),
        ("sweep", {"name": "m"}, "no parameter 'm' to sweep; there are a, gamma, k, damping"),
        ("sweep", {"values": [0.2, math.nan]}, "finite real numbers"),
        ("sweep", {"name": "gamma", "values": [0.3]}, r"gamma = 0\.3"),
        ("periodic", {"symmetric": True, "periods": 2}, "a symmetric motion has the period 2 pi"),
        ("periodic", {"symmetric": True, "walls": (None, 1.0)}, "the walls are not symmetric"),
        ("attraction", {"x": ("u", 0)}, "an Axis"),
        ("attraction", {"site": 0.5}, r"^site = 0\.5"),
        ("attraction", {"site": 1}, "^attraction: there is no site 1 among 1"),
        ("attraction", {"x": sim.Axis("u", 7, [0.1])}, "^attraction: there is no site 7 among 1"),
        ("attraction", {"x": sim.Axis("v", -1, [0.1])}, "^both axes are v_-1: a plane has two"),
        ("attraction", {"tolerance": -1.0}, r"^tolerance = -1\.0: a distance"),
        ("attraction", {"t0": math.inf}, r"^t0 = inf: a time"),
        ("attraction", {"periods": 1}, r"^periods = 1\b"),
        ("attraction", {"executor": 0}, r"^executor = 0: a whole number, at least 1"),
        ("localisation", {"v": [0.1]}, SHAPE),
        ("localisation", {"u": 0.1, "v": 0.2}, SHAPE),
        ("localisation", {"u": np.zeros((0, 2)), "v": np.zeros((0, 2))}, SHAPE),
        ("localisation", {"t": [0.0, 1.0]}, r"t has the shape \(2,\): a time for each"),
        ("localisation", {"u": [math.nan, 0.1]}, r"^u\b"),
        ("localisation", {"v": [math.nan, 0.1]}, r"^v\b"),
        ("rotation", {"u": [math.nan, 0.1]}, r"^u\b"),
        ("rotation", {"v": [math.nan, 0.1]}, r"^v\b"),
        ("rotation", {"u": np.zeros(31)}, TABLES),
        ("rotation", {"u": np.zeros((30, 2, 1)), "v": np.zeros((30, 2, 1))}, TABLES),
        ("rotation", {"u": 0.0, "v": 0.0}, TABLES),
        ("rotation", {"u": np.zeros((30, 0)), "v": np.zeros((30, 0))}, TABLES),
        ("rotation", {"u": np.zeros(19), "v": np.zeros(19)},
         "19 states are too few for a rotation number"),
        *(
            ("sample", {"sites": sites}, "sites = ")
            for sites in ((), 5, None, "ab", (0.5,), np.array(0))
        ),
        ("sample", {"sites": (1.7,)}, r"sites = \(1\.7,\): whole numbers were expected, 1\.7"),
        *(("sample", {"per_period": count}, "^per_period = ") for count in (0, -3, 2.5, True, "8")),
        ("axis", {"name": "w"}, "the coordinate of an axis must be 'u' or 'v', got 'w'"),
        ("axis", {"site": 0.5}, r"site = 0\.5"),
        ("axis", {"values": []}, r"^values = .*: the values of an axis, a row"),
        ("axis", {"values": ["x"]}, r"^values = \['x'\]: finite real numbers were expected"),
        ("there and back", {"values": []}, r"^values = .*: the values of a sweep, a row"),
    ],
)  # fmt: skip
def test_what_cannot_be_worked_with_is_refused_in_a_sentence(call, changed, sentence) -> None:
    answer, given = CALLS[call]
    with pytest.raises(BadInput, match=sentence):
        answer(**{**given, **changed})
    assert not Path("unused").exists()


def test_what_is_missing_is_said_by_the_name_of_simulate() -> None:
    with pytest.raises(BadInput, match=r"^simulate .* takes a, gamma, k, .*; missing a, k\."):
        cb.simulate(REST, periods=1, gamma=0.1)
    for on in ({"gamma": 0.1}, {"k": 0.8}):
        with pytest.raises(BadInput, match=r"^simulate .* takes a, gamma, k, .*; missing a"):
            sim.simulate_smooth(REST, m=6, periods=1, **on)


def test_of_a_run_it_says_who_judges_it() -> None:
    run = cb.simulate(REST, periods=1, a=0.1, gamma=0.1, k=0.8)
    with pytest.raises(BadInput, match=r"got <Run of .*>: judge\(run\) says what it came to"):
        sim.classify(run)


def defaults(of: Any) -> dict[str, Any]:
    found = inspect.signature(of).parameters.values()
    return {one.name: one.default for one in found if one.default is not inspect.Parameter.empty}


def test_a_name_has_one_default_wherever_it_is_given() -> None:
    """No damping, from t = 0, driven by a cosine: what is not said is not there."""
    plain = {"t0": 0.0, "forcing": None, "sample": None, "progress": None}
    assert defaults(Conditions)["damping"] == 0.0
    seen = set()
    runs = (sim.simulate_smooth, sim.record, sim.classify, sim.sweep, sim.attraction)
    for of in (*runs, cb.simulate, sim.periodic, sim.lyapunov, sim.localisation, conditions_of):
        own = defaults(of)
        seen |= set(own)
        for name in set(own) & set(plain):
            assert own[name] == plain[name], (of.__name__, name)
    assert set(plain) <= seen
    walks = {"within": None, "towards": "both", "events": None, "steps": None, "progress": None}
    for of in (cb.trace, cb.boundary, cb.switch, cb.diagram):
        own = defaults(of)
        for name in set(own) & set(walks):
            assert own[name] == walks[name], (of.__name__, name)


def test_a_breather_with_equations_of_its_own_is_refused_with_what_moves_it() -> None:
    chain = cb.Oscillators(V="u**2/2 + u**4/4", lattice=cb.Ring(2))
    breather = cb.breather(chain, {0: 1, 1: 1}, omega=1.5)
    for given in (breather, breather.solution):
        with pytest.raises(BadInput, match=r"its own equations: cb\.integrate follows it"):
            cb.simulate(given, periods=1)
