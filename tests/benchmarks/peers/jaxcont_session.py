"""JaxCont (PyPI jaxcont): continuation as a compiled JAX loop. Run by the interpreter that has it.

Prints one line of JSON. A plain `continuation` call compiles its loop anew each time (0.6 to 1.3 s
here); wrapped in `jax.jit` as a whole, as done below, it compiles once, and the times a point are
those of the second call. The whole session, taken from outside, has the compilations. The compiled
loop always makes all the steps that it is given: their number is set to what the curve needs.
"""

from __future__ import annotations

import dataclasses
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


def compiled(problem: Any, span: tuple[float, float], how: Any) -> tuple[Any, float]:
    """The branch, and the seconds of a second call of the compiled walk."""
    walk = jax.jit(lambda p: jc.continuation(p, p_span=span, settings=how).branch)
    jax.block_until_ready(walk(problem).states)
    begin = time.perf_counter()
    branch = jax.block_until_ready(walk(problem))
    return branch, time.perf_counter() - begin


def main() -> None:
    step = closure.branch_length(closure.GAMMA, closure.K) / closure.POINTS
    how = settings(step, closure.POINTS)
    problem = jc.bif_problem(one_parameter, u0=jnp.array(closure.start()), p0=1.0)
    branch, branch_seconds = compiled(problem, (1.0, 0.0), how)
    coarse = dataclasses.replace(how, ds=0.01, ds_max=0.05, max_steps=200, adaptive=True)
    found = jc.continuation(problem, p_span=(1.0, 0.0), settings=coarse, events=[jc.Fold()])
    hit = found.events[0]  # located to an absolute 1e-6, hence once more:
    u, fold, _, _ = jc.fold_point(one_parameter, hit.u, hit.p, tol=1e-12)
    seed = jnp.array([fold, closure.GAMMA])
    folds = jc.fold_curve_problem(two_parameters, u, seed, free=1, tol=1e-9)
    curve: list[tuple[float, float]] = []
    curve_seconds = 0.0
    for end, most in ((0.0, 130), (closure.GAMMA_END, 575)):
        part, seconds = compiled(folds, (closure.GAMMA, end), settings(closure.FOLD_STEP, most))
        curve_seconds += seconds
        a, gamma = part.states[part.valid, 2].tolist(), part.params[part.valid].tolist()
        curve += list(zip(a, gamma, strict=True))
    data = {
        "name": f"JaxCont {version('jaxcont')}",
        "branch_points": int(branch.valid.sum()),
        "branch_seconds": branch_seconds,
        "fold": float(fold),
        "curve": curve,
        "curve_seconds": curve_seconds,
    }
    print("RESULT " + json.dumps(data))


if __name__ == "__main__":
    main()
