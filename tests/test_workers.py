"""Many pieces of work, by this process, by others and by executors that are given."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Future, ThreadPoolExecutor
from functools import partial
from itertools import count
from pathlib import Path
from threading import Lock
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather import workers
from contbreather.workers import Failed, processes

from .apart import begun, ended, until

each = partial(workers.each, unit="items")


def number_of_threads(item: tuple[int, Path]) -> tuple[int, int, str]:
    return item[0], os.getpid(), os.environ["OMP_NUM_THREADS"]


def process_of(_: int) -> int:
    return os.getpid()


def dies(item: tuple[int, Path]) -> int:
    """Item 3 always, item 11 the first time."""
    number, folder = item
    mark = folder / f"seen{number}"
    if number == 3 or (number == 11 and not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def refuses_odd(number: int) -> int:
    if number % 2:
        raise cb.NotConverged(f"{number} is odd")
    return number


@pytest.mark.slow
def test_results_come_in_order_from_processes_with_one_thread(tmp_path: Path) -> None:
    found = list(each(number_of_threads, [(i, tmp_path) for i in range(40)], executor=2))
    assert [number for number, _, _ in found] == list(range(40))
    assert os.getpid() not in {process for _, process, _ in found}
    assert {threads for _, _, threads in found} == {"1"}


@pytest.mark.slow
def test_what_was_lost_with_its_worker_is_done_again_and_then_is_a_failure(tmp_path: Path) -> None:
    found = list(each(dies, [(i, tmp_path) for i in range(12)], executor=2))
    assert [one for one in found if not isinstance(one, Failed)] == [*range(3), *range(4, 12)]
    assert isinstance(found[3], Failed)
    assert found[3].item == (3, tmp_path)
    assert "ended before its result, and again" in found[3].reason


def test_an_error_of_this_package_is_a_result_and_any_other_is_raised() -> None:
    found = list(each(refuses_odd, range(4), executor=1))
    assert [found[0], found[2]] == [0, 2]
    assert [found[1].reason, found[3].reason] == ["1 is odd", "3 is odd"]
    assert repr(found[1]) == "<Failed NotConverged: 1 is odd>"
    with pytest.raises(ZeroDivisionError):
        list(each(lambda number: 1 // number, [1, 0], executor=1))


@pytest.fixture
def lasting(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Have each item take so many seconds, by the clock of a machine with two cores."""

    def last(seconds: float) -> None:
        times = count()
        clock = SimpleNamespace(monotonic=lambda: seconds * next(times))
        monkeypatch.setattr(workers, "time", clock)
        monkeypatch.setattr(os, "cpu_count", lambda: 2)

    return last


def test_what_is_short_starts_no_process(monkeypatch: pytest.MonkeyPatch, lasting: Any) -> None:
    monkeypatch.setattr(workers, "processes", None)
    lasting(0.0009)
    assert list(each(lambda number: -number, range(1000))) == [-i for i in range(1000)]


def test_what_is_long_is_done_by_as_many_processes_as_there_are_cores(monkeypatch, lasting):
    lasting(0.3)
    asked: list[int] = []
    monkeypatch.setattr(workers, "processes", lambda most: asked.append(most) or processes(most))
    found = list(each(process_of, range(9)))
    assert found[0] == os.getpid()
    assert os.getpid() not in found[1:]
    assert asked == [2]


def test_what_cannot_be_sent_is_refused_in_a_sentence(lasting: Any) -> None:
    lock = Lock()
    for executor in (2, None):
        lasting(0.3)
        with pytest.raises(cb.BadInput, match=r"cannot be sent to another process: .*lock"):
            list(each(lambda number: (number, lock), range(9), executor=executor))
    with pytest.raises(cb.BadInput, match="a number of processes was expected"):
        each(refuses_odd, [1], executor="two")  # type: ignore[arg-type]
    with pytest.raises(cb.BadInput, match="executor = 0"):
        each(refuses_odd, [1], executor=0)


class Faulty(ThreadPoolExecutor):
    """Its futures end with a fault, one of so many."""

    def __init__(self, fault: BaseException, among: int = 1) -> None:
        super().__init__(2)
        self.fault, self.among, self.sent = fault, among, 0

    def submit(self, call: Callable[..., Any], *given: Any, **more: Any) -> Future[Any]:
        self.sent += 1
        if self.sent % self.among:
            return super().submit(call, *given, **more)
        lost: Future[Any] = Future()
        lost.set_exception(self.fault)
        return lost


def test_an_executor_that_is_given_is_asked_again_for_what_it_lost() -> None:
    with Faulty(BrokenExecutor("a worker was terminated abruptly"), 3) as pool:
        found = list(each(lambda number: number, range(64), executor=pool))
    kept = [one for one in found if not isinstance(one, Failed)]
    assert len(found) == 64
    assert len(kept) > 48
    assert kept == [i for i, one in enumerate(found) if not isinstance(one, Failed)]
    assert all("of the executor ended" in one.reason for one in found if isinstance(one, Failed))


SCRIPT = """
import os, time
from pathlib import Path
import contbreather as cb
from contbreather.workers import Bar, each

FOLDER = Path({folder!r})


def slow(number):
    # the signal is for workers that work: one that has yet to begin has nothing to keep
    (FOLDER / f"{{os.getpid()}}.worker").touch()
    while len(list(FOLDER.glob("*.worker"))) < 2:
        time.sleep(0.01)
    time.sleep(0 if number < 30 else 600)
    return number


if __name__ == "__main__":
    # One text with its end: Ctrl-C between a number and its newline would leave them apart.
    Bar.advance = lambda _, done: print(f"{{done}}\\n", end="", flush=True)
    try:
        # interrupted within, never beside it
        list(each(slow, range(60), unit="naps", executor=2, together=1))
    except cb.errors.Interrupted as stop:
        print(stop.partial == tuple(range(30)))
"""


@pytest.mark.slow
def test_ctrl_c_ends_workers_in_the_middle_and_keeps_what_is_done(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(folder=str(tmp_path)))
    with begun(script) as child:
        assert child.stdout is not None
        while int(child.stdout.readline()) < 30:  # in whatever order they came
            pass
        os.killpg(child.pid, signal.SIGINT)  # a terminal sends it to all of them
        out, err = child.communicate()
    assert (out.splitlines()[-1], err, child.returncode) == ("True", "", 0)


def test_functions_that_a_fresh_process_lacks_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    passing = ModuleType("passing")
    exec("def made_here(number): return number", vars(passing))
    monkeypatch.setitem(sys.modules, "passing", passing)
    with pytest.raises(cb.BadInput, match=r"a fresh process does not have it: .*'passing'"):
        list(each(passing.made_here, [1, 2], executor=2))


def test_a_loop_that_is_left_leaves_no_worker_behind() -> None:
    with processes(1) as pool:
        worker = pool.submit(os.getpid).result()
    until(lambda: not Path(f"/proc/{worker}").exists())


# --- branches and zones ---------------------------------------------------------------------------


def test_branches_over_a_grid_are_those_that_trace_finds() -> None:
    window = {"a": (0.45, 0.9)}
    starts: list[Any] = [cb.symmetric(0.5, g, k) for g in (0.02, 0.08) for k in (0.6, 0.8)]
    starts.insert(2, cb.symmetric(0.2, 0.02, 0.8))  # outside of the window
    found = list(cb.trace_many(starts, "a", within=window, executor=1))
    assert isinstance(found[2], Failed)
    with pytest.raises(cb.BadInput) as alone:
        cb.trace(starts[2], "a", within=window)
    assert found[2].reason == str(alone.value)
    for start, branch in zip(starts, found, strict=True):
        if isinstance(branch, Failed):
            continue
        own = cb.trace(start, "a", within=window)
        assert [p.label for p in branch.special] == [p.label for p in own.special]
        assert all(np.array_equal(branch[name], own[name]) for name in own.names)


@pytest.mark.slow
def test_many_zones_are_those_of_each_value() -> None:
    few = {"gamma": (0.0, 0.015)}
    drive = cb.Symbolic("cos(t) + c3*cos(3*t)", c3=0.0)
    asked = {"over": {"c3": (0.0, 0.05)}, "forcing": drive, "within": few}
    found = list(cb.zones_many([0.8, 2.0], **asked, executor=2))  # there and back by pickle
    assert [isinstance(one, Failed) for one in found] == [False, False, True, True]
    own = cb.zones(k=0.8, forcing=drive.at(c3=0.05), within=few)
    one = found[1]
    assert not isinstance(one, Failed)
    for kind in own.curves:
        for ours, line in zip(one[kind], own[kind], strict=True):
            assert all(np.array_equal(ours[name], line[name]) for name in ("gamma", "a", "p"))


def test_what_many_zones_are_over_is_checked_first() -> None:
    with pytest.raises(cb.BadInput, match="exactly one of k, gamma, a, got none"):
        cb.zones_many()
    with pytest.raises(cb.BadInput, match="no parameter 'c3' of the forcing"):
        cb.zones_many([0.8], over={"c3": [0.1]})
    with pytest.raises(cb.BadInput, match="finite real numbers"):
        cb.zones_many([0.8, float("nan")])


@pytest.mark.slow
def test_what_a_script_defines_is_sent_as_it_is_and_needs_no_guard(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import contbreather as cb\n"
        "def circle(x, p): return [x[0] ** 2 + p['h'] ** 2 - p['r']]\n"
        "starts = [\n"
        "    cb.Problem(circle, start={'x': r**0.5}, params={'h': 0.0, 'r': r},\n"
        "               record={'double': lambda point: 2 * point['x']})\n"
        "    for r in (1.0, 4.0)\n"
        "]\n"
        "for branch in cb.trace_many(starts, 'h', within={'h': (0.0, 0.6)}, executor=2):\n"
        "    print(round(branch['x'][-1], 9), round(branch['double'].max(), 9))\n"
    )
    found = ended(script)
    assert (found.stderr, found.stdout) == ("", "0.8 2.0\n1.907878403 4.0\n")


# --- what an executor raises ----------------------------------------------------------------------


class KilledWorker(Exception):
    """As a cluster has it, which is not imported for its sake."""


@pytest.mark.parametrize("lost", [BrokenExecutor(), CancelledError(), KilledWorker("twice")])
def test_what_is_lost_with_its_worker_twice_is_a_failure(lost: Exception) -> None:
    found = list(each(abs, range(3), executor=Faulty(lost)))
    assert ["of the executor ended" in one.reason for one in found] == [True, True, True]


@pytest.mark.parametrize(
    ("fault", "seen", "words"),
    [
        (TypeError("cannot pickle 'generator' object"), cb.BadInput, "cannot pickle 'generator'"),
        (OSError("no route to host"), OSError, "no route"),
        (RuntimeError("cannot schedule new futures"), RuntimeError, "new futures"),
        (KeyboardInterrupt("now"), cb.errors.Interrupted, "nothing is done yet"),
    ],
)
def test_any_other_fault_of_an_executor_is_seen(fault, seen, words) -> None:
    with pytest.raises(seen, match=words):
        list(each(abs, range(3), executor=Faulty(fault)))
