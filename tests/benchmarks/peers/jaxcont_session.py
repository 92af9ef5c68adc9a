"""JaxCont (PyPI jaxcont): continuation as a compiled JAX loop. Run by the interpreter that has it.

Prints one line of JSON. Times a point are those of a second, already compiled call; the whole
session, taken from outside, has the compilations. The number of steps is an argument of the
compiled loop, which always makes all of them: it is set to what the curve needs.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import closure
import jax
import jax.numpy as jnp
import jaxcont as jc

jax.config.update("jax_enable_x64", True)
Q = closure.restitution(closure.K)


def chi(gamma: Any) -> Any:
    tail = 0.0
    for coefficient in reversed(closure.CHI_SERIES):
        tail = tail * gamma + coefficient
    return 4 / jnp.pi / jnp.sqrt(1 - 4 * gamma) + tail


def two_parameters(u: Any, params: Any, _: Any) -> Any:
    a, gamma = params[0], params[1]
    return jnp.array([u[0] * chi(gamma) + a * jnp.cos(u[1]) - 1, -a * jnp.sin(u[1]) - u[0] * Q])


def one_parameter(u: Any, a: Any, _: Any) -> Any:
    return two_parameters(u, (a, closure.GAMMA), None)


def settings(step: float, most: int) -> Any:
    return jc.ContinuationPar(
        ds=step,
        ds_min=1e-8,
        ds_max=step,
        max_steps=most,
        adaptive=False,
        newton_tol=1e-9,
        compute_stability=False,
    )


def run(problem: Any, span: tuple[float, float], how: Any, events: tuple[Any, ...] = ()) -> Any:
    begin = time.perf_counter()
    found = jc.continuation(problem, p_span=span, settings=how, events=list(events))
    jax.block_until_ready(found.branch.states)
    return found, time.perf_counter() - begin


def main() -> None:
    step = closure.branch_length(closure.GAMMA, closure.K) / closure.POINTS
    how = settings(step, closure.POINTS)
    problem = jc.bif_problem(one_parameter, u0=jnp.array(closure.start()), p0=1.0)
    run(problem, (1.0, 0.0), how)
    branch, branch_seconds = run(problem, (1.0, 0.0), how)
    fold = run(problem, (1.0, 0.0), how, (jc.Fold(),))[0].events[0]
    seed = jnp.array([fold.p, closure.GAMMA])
    folds = jc.fold_curve_problem(two_parameters, fold.u, seed, free=1, tol=1e-9)
    curve: list[tuple[float, float]] = []
    curve_seconds = 0.0
    for end, most in ((0.0, 130), (closure.GAMMA_END, 575)):
        span = (closure.GAMMA, end)
        run(folds, span, settings(closure.FOLD_STEP, most))
        part, seconds = run(folds, span, settings(closure.FOLD_STEP, most))
        curve_seconds += seconds
        a, gamma = part.branch.states[:, 2].tolist(), part.branch.params.tolist()
        curve += list(zip(a, gamma, strict=True))
    data = {
        "name": f"JaxCont {version('jaxcont')}",
        "branch_points": branch.branch.n_valid,
        "branch_seconds": branch_seconds,
        "fold": float(fold.p),
        "curve": curve,
        "curve_seconds": curve_seconds,
    }
    print("RESULT " + json.dumps(data))


if __name__ == "__main__":
    main()
