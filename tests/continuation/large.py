"""Large problems with answers in closed form, each with a dense, a sparse or no Jacobian."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import block_array, csc_array, diags_array, eye_array, kron

import contbreather as cb

from . import zoo

DX, DY, A = 0.008, 0.004, 2.0


def second(n: int) -> csc_array:
    """Second differences on n inner points of the unit interval, zero at its ends."""
    ones = np.ones(n)
    return diags_array([ones[1:], -2 * ones, ones[1:]], offsets=[-1, 0, 1], format="csc") * float(
        (n + 1) ** 2
    )


def plane(m: int) -> csc_array:
    """The same on the unit square."""
    return csc_array(kron(second(m), eye_array(m)) + kron(eye_array(m), second(m)))


def _diagonal(matrix: csc_array) -> np.ndarray:
    """Where the entries of the diagonal are among all that are stored."""
    columns = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    return np.flatnonzero(matrix.indices == columns)


def bratu(laplacian: csc_array, road: str = "sparse", lam: float = 0.1) -> cb.Problem:
    """``u'' + lambda e^u = 0``."""
    n, diagonal = laplacian.shape[0], _diagonal(laplacian)

    def residual(u, p):
        return laplacian @ u + p["lam"] * np.exp(u)

    def jacobian(u, p):
        matrix = laplacian.copy()
        matrix.data[diagonal] += p["lam"] * np.exp(u)
        return matrix.toarray() if road == "dense" else matrix

    given = laplacian if road == "pattern" else jacobian
    return cb.Problem(residual, {"u": np.zeros(n)}, {"lam": lam}, jacobian=given)


def ignition(n: int) -> cb.Problem:
    plain = zoo.ignition(second(n).toarray(), u=1.5, lam=5.0, eps=0.244)
    return replace(plain, jacobian=lambda u, p: csc_array(plain.jacobian(u, p)))


def brusselator(n: int, road: str = "sparse", **params: float) -> cb.Problem:
    """Its steady state on an interval of length L, held at both ends."""
    given = {"B": 6.2, "L": 0.5, **params}
    x0, laplacian = np.concatenate([np.full(n, A), np.full(n, given["B"] / A)]), second(n)
    edge = np.zeros(n)
    edge[[0, -1]] = (n + 1) ** 2

    def residual(u, p):
        x, y = u[:n], u[n:]
        made = x * x * y - p["B"] * x
        spread = (laplacian @ x + A * edge, laplacian @ y + p["B"] / A * edge)
        return np.concatenate(
            [DX / p["L"] ** 2 * spread[0] + A - x + made, DY / p["L"] ** 2 * spread[1] - made]
        )

    def jacobian(u, p):
        x, y = u[:n], u[n:]
        along, across = diags_array(2 * x * y - p["B"]), diags_array(x * x)
        blocks = [
            [DX / p["L"] ** 2 * laplacian - eye_array(n) + along, across],
            [-along, DY / p["L"] ** 2 * laplacian - across],
        ]
        return block_array(blocks).toarray() if road == "dense" else block_array(blocks).tocsr()

    return cb.Problem(residual, {"u": x0}, given, jacobian=jacobian)


def mode(n: int, k: int) -> float:
    """The k-th eigenvalue of `second`, without its sign."""
    return 4.0 * (n + 1) ** 2 * np.sin(k * np.pi / (2 * (n + 1))) ** 2


def brusselator_hopf(n: int, k: int, B: float) -> tuple[float, float]:
    """The length at which the k-th mode oscillates at constant amplitude, and its frequency."""
    length = np.sqrt((DX + DY) * mode(n, k) / (B - 1 - A**2))
    decay = DY * mode(n, k) / length**2
    return float(length), float(np.sqrt(A**2 * B - (A**2 + decay) ** 2))


def swift_hohenberg(n: int, length: float, road: str = "sparse", **params: float) -> cb.Problem:
    """``mu u - (1 + d^2)^2 u + nu u^2 - u^3``, on an interval at whose ends u and u'' vanish."""
    inner = eye_array(n, format="csc") + second(n) / length**2
    linear = csc_array(-(inner @ inner))
    diagonal = _diagonal(linear)

    def residual(u, p):
        return linear @ u + u * (p["mu"] + u * (p["nu"] - u))

    def jacobian(u, p):
        matrix = linear.copy()
        matrix.data[diagonal] += p["mu"] + u * (2 * p["nu"] - 3 * u)
        return matrix.toarray() if road == "dense" else matrix

    start = {"u": np.zeros(n)}
    return cb.Problem(residual, start, {"mu": -0.1, "nu": 1.6, **params}, jacobian=jacobian)


def swift_hohenberg_branches(n: int, length: float, most: float) -> list[float]:
    """Where on the trivial state others set out, up to a value of mu."""
    values = sorted((1 - mode(n, k) / length**2) ** 2 for k in range(1, n + 1))
    return [float(value) for value in values if value < most]
