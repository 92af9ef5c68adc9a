"""Ctrl-C: one ends the whole call, and what is handed over says that it is cut short."""

from __future__ import annotations

import signal
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import contbreather.simulation as sim
from contbreather.cli import INTERRUPTED, main
from contbreather.errors import deferred
from contbreather.orbits import symmetric
from contbreather.paper import figure6, figure7, figure8
from contbreather.simulation.classify import judge

from ..apart import begun, until, workers_of

SET = {"a": 0.2, "gamma": 0.08, "k": 0.8, "damping": 0.02}
STATE = symmetric(0.2, 0.08, 0.8).state(6)


@pytest.fixture
def ctrl_c(monkeypatch):
    """After so many calls of the loops that simulate, one Ctrl-C, and never another."""

    def after(count: int) -> list[str]:
        seen: list[str] = []

        def counting(name, call):
            def called(*args, **kwargs):
                seen.append(name)
                if len(seen) == count + 1:
                    raise KeyboardInterrupt
                return call(*args, **kwargs)

            return called

        for owner, name in (
            (sim.integrator.EventDriven, "advance"),
            (sim.smooth.SmoothIntegrator, "advance"),
        ):
            monkeypatch.setattr(owner, name, counting(name, getattr(owner, name)))
        return seen

    return after


CALLS = {
    "classify": lambda: sim.classify(STATE, settle=300, periods=300, **SET),
    "figure 6": figure6,
    "figure 7": figure7,
    "figure 8": figure8,
}


@pytest.mark.parametrize("count", [0, 2, 7])
@pytest.mark.parametrize("call", CALLS)
def test_ctrl_c_in_an_inner_simulation_ends_the_call_around_it(ctrl_c, call, count):
    seen = ctrl_c(count)
    with pytest.raises(KeyboardInterrupt):
        CALLS[call]()
    assert len(seen) == count + 1


def test_ctrl_c_while_judging_a_finished_run_gives_no_verdict(ctrl_c):
    run = sim.simulate(STATE, periods=200, **SET)
    ctrl_c(1)
    with pytest.raises(KeyboardInterrupt):
        judge(run)


@pytest.mark.parametrize("count", [3, 40])
def test_interrupted_figure_says_so_and_leaves_no_file(
    ctrl_c, count, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    ctrl_c(count)
    assert main(["figure", "6", "--csv", "rows.csv"]) == INTERRUPTED
    assert capsys.readouterr() == ("", "contbreather: interrupted\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("run", [sim.simulate, partial(sim.simulate_smooth, m=6)])
def test_ctrl_c_keeps_the_periods_that_are_completed(ctrl_c, run):
    ctrl_c(2)
    cut = run(STATE, periods=1000, **SET)
    assert cut.stop is sim.RunStop.INTERRUPTED
    assert 0 < cut.periods < 1000
    assert np.array_equal(cut.final.u, cut.strobe.u[-1])
    assert np.array_equal(cut.strobe, run(STATE, periods=cut.periods, **SET).strobe)


@pytest.mark.parametrize("run", [sim.simulate, partial(sim.simulate_smooth, m=6)])
def test_ctrl_c_in_the_fraction_at_the_end_keeps_all_whole_periods(ctrl_c, run):
    whole = run(STATE, periods=4, **SET)
    ctrl_c(4 if isinstance(run, partial) else 1)  # smooth runs go period by period
    cut = run(STATE, periods=4.5, **SET)
    assert cut.stop is sim.RunStop.INTERRUPTED
    assert (cut.periods, cut.end) == (4, whole.end)
    assert np.array_equal(cut.final, whole.final)


def test_interrupted_sweep_has_the_values_done_and_says_so(ctrl_c):
    ctrl_c(2)
    found = sim.sweep(STATE, "a", [0.2, 0.19, 0.18, 0.17], periods=4, **SET)
    assert (found.stop, found.value.tolist()) == (sim.RunStop.INTERRUPTED, [0.2, 0.19])


def test_start_that_was_interrupted_has_no_outcome(ctrl_c):
    u, v = sim.Axis("u", 0, [0.1]), sim.Axis("v", 0, [0.0, 0.1, 0.2])
    ctrl_c(2)
    with ThreadPoolExecutor(1) as one:
        basin = sim.attraction(STATE, u, v, periods=20, executor=one, **SET)
    assert not basin.complete
    assert "cut short" in repr(basin)
    assert int(np.sum(basin.outcome == sim.Outcome.PENDING)) >= 1
    assert sim.Outcome.SPREAD not in basin.outcome


BASIN = """
import os, time
from pathlib import Path
import numpy as np
from contbreather.lattice import Harmonic
from contbreather.orbits import symmetric
from contbreather.simulation import Axis, attraction
def begins(folder):
    Path(folder, f"{os.getpid()}.begun").write_text(str(time.process_time()))
    return Harmonic()
class Told(Harmonic):  # by a worker that has loaded all that it needs
    def __reduce__(self):
        return begins, (os.getcwd(),)
state = symmetric(0.2, 0.08, 0.8).state(40)
u, v = (Axis(name, 0, np.linspace(-0.9, 0.9, 2000)) for name in "uv")
on = {"a": 0.2, "gamma": 0.08, "k": 0.8, "forcing": Told()}
found = attraction(state, u, v, periods=2000, executor=2, **on)
print(found.complete, (found.outcome == -1).any())
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up there")
def test_ctrl_c_ends_a_basin_with_workers_that_are_in_the_middle_of_a_row(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(BASIN)

    def busy(number, work):
        told = tmp_path / f"{number}.begun"
        return told.exists() and work > float(told.read_text() or "inf") + 0.2

    with begun(script, cwd=tmp_path) as child:
        until(lambda: sum(busy(*one) for one in workers_of(child.pid).items()) == 2)
        child.send_signal(signal.SIGINT)
        out, err = child.communicate()
    assert (out, child.returncode) == ("False True\n", 0), err


@pytest.mark.slow
@pytest.mark.apart
def test_ctrl_c_waits_for_the_end_of_compiled_code_and_is_not_lost(monkeypatch):
    """A real signal, within a block and at any moment of the compiled solver and what it calls."""
    done = []

    def block():
        with deferred():
            signal.raise_signal(signal.SIGINT)
            done.append("the rest of the block")

    with pytest.raises(KeyboardInterrupt):
        block()
    assert done
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    advance = sim.smooth.SmoothIntegrator.advance
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    for delay in np.linspace(0.005, 0.06, 12):

        def winds_the_alarm(flight, periods, first, delay=delay, **more):
            if first == 0:  # before that there is nothing to interrupt
                signal.setitimer(signal.ITIMER_REAL, delay)
            return advance(flight, periods, first, **more)

        monkeypatch.setattr(sim.smooth.SmoothIntegrator, "advance", winds_the_alarm)
        run = sim.simulate_smooth(STATE, m=6, periods=10**7, **SET)  # as long as it takes to come
        assert run.stop is sim.RunStop.INTERRUPTED
        assert np.array_equal(run.final.u, run.strobe.u[-1])
