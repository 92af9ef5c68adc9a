"""Linear algebra is done by one thread, as a user runs it: with no variable that says so.

What is asked is who worked and not how long it took: the processor time of a process, less that of
the thread that computes, is what all others took.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator

import numpy as np
import pytest
import scipy.linalg  # noqa: F401 - its threads are counted as well
from threadpoolctl import OpenBLASController, ThreadpoolController, threadpool_info

import contbreather as cb
from contbreather.workers import THREADS

from .apart import ended

AS_A_USER = """
import json, time
import numpy as np, scipy.linalg
import contbreather as cb

def others():
    return time.process_time() - time.thread_time()

def idle():
    before = -1.0
    while others() - before > 1e-4:
        before = others()
        time.sleep(0.1)

n = 150
mixed = np.cos(np.arange(n * n, dtype=float).reshape(n, n) ** 1.1) / n
large = cb.Problem(
    lambda x, p: x - p["mu"] - p["nu"] * (mixed @ x**2), {"x": np.zeros(n)},
    {"mu": 0.0, "nu": 0.5}, jacobian=lambda x, p: np.eye(n) - 2 * p["nu"] * mixed * x,
    events=[cb.fold(), cb.hopf()], record={"size": lambda q: abs(q.curve.spectrum(q.z)).max()},
)
found = {}
work = {
    "trace": lambda: cb.trace(large, "mu", within={"mu": (0, 0.2)}),
    "a point of iterate": lambda: next(cb.continuation.iterate(large, "mu")),
    "solve": lambda: large.at(mu=0.3).solve(),
    "column": lambda: found["trace"]["size"],
    "extend": lambda: cb.extend(found["trace"], within={"mu": (0, 0.25)}),
    "multibreather": lambda: cb.multibreather(
        [0], a=0.6, gamma=0.03, k=0.8, damping=0.05, lattice=cb.Ring(150)
    ),
    "trace of a ring": lambda: cb.trace(
        found["multibreather"], "a", within={"a": (0.55, 0.65)}
    ),
    "stability": lambda: found["multibreather"].stability(),
    "modes": lambda: cb.OpenChain(150).spectrum,
    "motion": lambda: cb.simulation.periodic(found["multibreather"]),
    "multipliers": lambda: found["motion"].multipliers,
    "verdict": lambda: cb.simulation.judge(found["motion"].run(periods=100)),
    "rotation": lambda: cb.simulation.rotation(*np.random.default_rng(0).random((2, 500, 150))),
}
used = {}
for name, one in work.items():
    idle()
    before = others()
    found[name] = one()
    used[name] = others() - before
idle()
before = others()
np.ones((900, 900)) @ np.ones((900, 900))
used["a user's own"] = others() - before
print(json.dumps(used))
"""


@pytest.mark.slow
def test_no_other_thread_works_and_those_of_the_user_are_left_alone() -> None:
    unset = dict.fromkeys((*THREADS, "BLIS_NUM_THREADS"), "")
    run = ended("-c", AS_A_USER, env=unset)
    assert not run.returncode, run.stderr
    used = json.loads(run.stdout)
    own = used.pop("a user's own")
    assert {name: time for name, time in used.items() if time > 1e-3} == {}
    if (os.cpu_count() or 1) > 1:
        assert own > 0


@pytest.fixture
def two() -> Iterator[None]:
    """A process that may take two threads, which any of its own may change."""
    libraries = ThreadpoolController().lib_controllers
    before = [library.num_threads for library in libraries]

    def allow(numbers: list[int]) -> None:
        for library, number in zip(libraries, numbers, strict=True):
            library.set_num_threads(number)
        OpenBLASController.clear_controlling_thread()

    allow([2] * len(libraries))
    yield
    allow(before)


def threads() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def seen_by(walk) -> set[int]:
    """How many threads equations may take that are asked on the way."""
    seen = set[int]()

    def circle(x, p):
        seen.update(threads())
        return np.array([x[0] ** 2 + p["mu"] ** 2 - 1.0])

    walk(cb.Problem(circle, {"x": 1.0}, {"mu": 0.0}, events=[cb.fold()]))
    return seen


def walked(problem: cb.Problem) -> cb.Branch:
    """A few points, for each question about threads takes a hundredth of a second."""
    return cb.trace(problem, "mu", steps=cb.Steps(most=3))


def test_equations_are_asked_with_one_thread(two) -> None:
    assert seen_by(walked) == {1}
    assert threads() == {2}


def test_between_the_points_of_a_walk_by_hand_nothing_is_held(two) -> None:
    walk = cb.continuation.iterate(
        cb.Problem(lambda x, p: x - p["mu"], {"x": 0.0}, {"mu": 0.0}), "mu"
    )
    assert [threads() for _, point in zip(range(3), walk, strict=False)] == [{2}] * 3


def test_what_fails_gives_them_back(two) -> None:
    def wrong(x, p):
        raise RuntimeError("a mistake")

    with pytest.raises(RuntimeError, match="a mistake"):
        cb.trace(cb.Problem(wrong, {"x": 1.0}, {"mu": 0.0}), "mu")
    assert threads() == {2}


def test_of_two_walks_at_a_time_the_last_to_end_gives_them_back(two) -> None:
    began, goes_on, after = threading.Event(), threading.Event(), set[int]()

    def waiting(x, p):
        began.set()
        goes_on.wait()
        after.update(threads())
        return np.array([x[0] ** 2 + p["mu"] ** 2 - 1.0])

    problem = cb.Problem(waiting, {"x": 1.0}, {"mu": 0.0}, events=[])
    longer = threading.Thread(target=walked, args=(problem,), daemon=True)
    longer.start()
    began.wait()
    shorter = seen_by(walked)
    goes_on.set()
    longer.join()
    assert shorter == after == {1}
    assert threads() == {2}
