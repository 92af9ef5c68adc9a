"""Small perturbations of a cycle, and their multipliers without a product that overflows.

A product of many matrices loses what is small beside what is large, 1e-20 beside 1. So factors
are multiplied only as long as none of them loses anything, and where several are left the product
is made triangular, factor by factor, by orthogonal iteration around the cycle.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.newton import Array, Undefined
from ..continuation.algebra.sparse import Matrix
from .equations import FlowEquations, SolvedPlace
from .functions import Params, quiet, values
from .sparse_equations import SparseFlowEquations


def multipliers(factors: Sequence[Array]) -> NDArray[np.complex128]:
    """Eigenvalues of the product of all factors, the largest first.

    They come in stacks of square ones, or of a single one between spaces of different dimension,
    each stack from the first factor to the last.
    """
    if not factors[0].shape[-1]:
        return np.empty(0, dtype=complex)
    merged = _merged(factors)
    mu = _eigenvalues(merged[0]) if len(merged) == 1 else _separated(merged)
    return np.asarray(mu[(-abs(mu)).argsort(kind="stable")], dtype=complex)


def _eigenvalues(matrix: Array) -> NDArray[np.complex128]:
    """As of `numpy.linalg.eigvals`, which takes longer to look at a small matrix than to solve."""
    from scipy.linalg import lapack

    if not np.isfinite(matrix).all():
        raise Undefined("multipliers overflow")
    real, imaginary, *_, info = lapack.dgeev(matrix, compute_vl=0, compute_vr=0)
    if info:
        raise Undefined("no eigenvalues were found")
    return np.asarray(real + 1j * imaginary)


def without_direction(
    factors: Sequence[Array], directions: Sequence[Array]
) -> tuple[list[Array], float]:
    """The factors between the complements of directions that they map into each other, and the
    multiplier of these: of an autonomous flow its velocity, and 1.

    ``directions[j]`` are where those of the stack ``factors[j]`` begin; the last one ends in the
    first.
    """
    mirrors, multiplier, rest = [_mirrors(ways) for ways in directions], 1.0, []
    for stack, before, after in zip(factors, mirrors, [*mirrors[1:], mirrors[0]], strict=True):
        beyond = np.concatenate([before[1:], after[:1]]) if len(before) > 1 else after[:1]
        turned = beyond @ stack @ before
        # direction goes to direction: below its own entry the first column is zero
        multiplier *= turned[:, 0, 0].prod()
        rest.append(turned[:, 1:, 1:])
    return rest, float(multiplier)


def without_pairs(
    stack: Array, way: Array, gradients: Sequence[Array]
) -> tuple[Array, NDArray[np.float64]]:
    """The factors of one stack without the multipliers 1 of a conservative flow, and these.

    The velocity is mapped into itself, and so is the gradient of each quantity by the transposes,
    the other way around. Of several quantities all but one have a symmetry, along which an orbit
    is shifted to another: its directions are the null vectors of what is left, less 1.
    """
    (stack,), one = without_direction([stack], [way])
    ones, left = [one], [_beyond(way, gradient) for gradient in gradients]
    while left:
        gradient, *left = left
        turned = stack.transpose(0, 2, 1)[::-1]
        (turned,), one = without_direction([turned], [np.roll(gradient[::-1], 1, axis=0)])
        stack, left = turned.transpose(0, 2, 1)[::-1], [_beyond(gradient, g) for g in left]
        ones.append(one)
    for left_over in range(len(gradients) - 1, 0, -1):
        whole = reduce(np.matmul, stack[::-1])
        shifts = [np.linalg.svd(whole - np.eye(len(whole)))[2][-left_over]]
        for factor in stack[:-1]:
            shifts.append(factor @ shifts[-1])
        (stack,), one = without_direction([stack], [np.array(shifts)])
        ones.append(one)
    return stack, np.array(ones)


def _beyond(ways: Array, vectors: Array) -> Array:
    """Vectors in the complement of directions, as `without_direction` has it."""
    return np.asarray((_mirrors(ways) @ vectors[:, :, None])[:, 1:, 0])


def _mirrors(ways: Array) -> Array:
    """The reflections between directions and the first axis."""
    sizes = np.sqrt(np.vecdot(ways, ways))
    if not np.minimum.reduce(sizes) > 0:
        raise Undefined("the vector field vanishes on the orbit: an equilibrium is on it")
    v = ways / sizes[:, None]
    # Householder's 1 - 2 v v*/|v|^2 with v = u + sign(u_1) e_1, which does not cancel
    v[:, 0] += np.copysign(1.0, v[:, 0])
    v *= np.sqrt(2 / np.vecdot(v, v))[:, None]
    return np.eye(v.shape[1]) - v[:, :, None] * v[:, None, :]


@quiet
def _merged(stacks: Sequence[Array]) -> list[Array]:
    """Fewer factors with the same product, each of them well conditioned: none overflows."""
    factors = [factor for stack in stacks for factor in _halved(stack)]
    merged = factors[:1]
    for factor in factors[1:]:
        product = factor @ merged[-1]
        # factors between spaces of different dimension must be multiplied
        square = product.shape[0] == product.shape[1] and merged[-1].shape[0] == factor.shape[0]
        if square and not _well_conditioned(product[None])[0]:
            merged.append(factor)
        else:
            merged[-1] = product
    if len(merged) > 1 and merged[0].shape[1] != merged[0].shape[0]:
        merged = [merged[0] @ merged[-1], *merged[1:-1]]
    return merged


def _halved(stack: Array) -> Array:
    """Neighbours multiplied, all pairs at once, as long as all products are well conditioned."""
    halves = [stack]
    while len(halves[-1]) > 1:
        pairs, even = halves[-1], len(halves[-1]) // 2 * 2
        half = pairs[1:even:2] @ pairs[:even:2]
        halves.append(np.concatenate([half, pairs[even:]]) if even < len(pairs) else half)
    # all of them are looked at in one call; what is left over was a product before, or is a factor
    good = _well_conditioned(np.concatenate(halves[1:] or halves))
    if good.all():
        return halves[-1]
    ends = np.cumsum([len(half) for half in halves[1:]])
    return halves[int(np.searchsorted(ends, good.argmin(), side="right"))]


def _well_conditioned(matrices: Array) -> NDArray[np.bool_]:
    """Tell which of them are; what acts on nothing is, as across an orbit of one state."""
    if not matrices.size:
        return np.ones(len(matrices), dtype=bool)
    if not np.isfinite(matrices.sum()):
        finite = np.isfinite(matrices).all(axis=(1, 2), keepdims=True)
        matrices = np.where(finite, matrices, 0.0)
    sizes = np.linalg.svd(matrices, compute_uv=False)
    # beyond a condition of 1e6 less than ten digits of the smallest singular value are left
    return np.asarray(sizes[:, 0] < 1e6 * sizes[:, -1])


def _separated(factors: Sequence[Array]) -> NDArray[np.complex128]:
    """By the triangular factors R of ``A_j Q_j = Q_{j+1} R_j``: their product is similar to that of
    the A once Q has come around to itself, but for blocks of multipliers of about one size."""
    n = len(factors[0])
    basis, sizes, cuts, worst = np.eye(n), np.zeros(n), [0], math.inf
    # where a pair is cut its halves turn into each other, by the inverse of how far it stretches
    # one of them beyond the other: up to the root of 1/eps that is told from rounding
    settled = np.finfo(float).eps ** 0.5
    for _ in range(40):  # directions so far apart settle in six
        before, rounds, earlier, was = basis, [], cuts, worst
        for factor in factors:
            basis, triangle = np.linalg.qr(factor @ basis)
            rounds.append(triangle)
        sizes = sum(np.log(np.maximum(abs(np.diag(r)), 1e-300)) for r in rounds)
        turned = before.T @ basis
        # told apart; the small ones come first where a subspace of them stays as it is
        cuts = [i for i in range(1, n) if abs(sizes[i] - sizes[i - 1]) > np.log(1e3)]
        turn = [abs(turned[i:, :i]).max() for i in cuts]
        worst = max(turn, default=0.0)
        # what would fall a thousandfold each time, and stays, is the rounding of many states; where
        # the order changes, as along a state that all but dies out, all look alike once
        stays = worst < settled and was / 10 < worst < 10 * was
        if cuts == earlier and (worst < 1e-13 or stays):
            break
    cuts = [i for i, left in zip(cuts, turn, strict=True) if left < settled]
    blocks = [slice(a, b) for a, b in itertools.pairwise([0, *cuts, n])]
    mu = []
    for block in blocks:
        product, scale = turned[block, block], 0.0
        for triangle in rounds[::-1]:
            product = product @ triangle[block, block]
            size = abs(product).max() or 1.0
            # the logarithm of what was divided out: products of many factors overflow
            product, scale = product / size, scale + np.log(size)
        with np.errstate(over="ignore", invalid="ignore"):
            mu.append(np.linalg.eigvals(product) * np.exp(scale))
    return np.concatenate(mu)


# --- of a cycle ---------------------------------------------------------------------------------


def of_cycle(
    equations: FlowEquations, x: Array, p: Params
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Compute those that are not trivial, and the trivial ones: of autonomous cycles one, and one
    more or a pair for each quantity that is conserved.

    At VI one is infinite, and what the others are is lost in the rounding of it: NaN. None is where
    what is late there is not so a turn later, as a reset forgets it, or the flow ends at a sink.
    """
    if isinstance(equations, SparseFlowEquations) and not equations.condensed:
        return equations.leading(x, p)
    factors, directions = around(equations, x, p)
    if isinstance(units := equations.units, np.ndarray):
        # by reflections what is small beside others is lost
        factors = [stack * (units / units[:, None]) for stack in factors]
        directions = [ways / units for ways in directions]
    none = np.empty(0)
    if not equations.smooth and any(np.isnan(stack).any() for stack in factors):
        lost = np.full(equations.start[0].dimension - equations.autonomous, np.nan, complex)
        turn = itertools.chain(*around(equations, x, p, at_least=True)[0])
        total = np.trace(reduce(lambda product, factor: factor @ product, turn))
        if abs(total) > np.finfo(float).eps ** -0.25:  # between 1 and 1/rate
            lost[:1] = np.inf
        return lost, none
    if not equations.autonomous:
        return multipliers(factors), none
    if equations.conservation:
        gradients = equations.conservation.gradients(equations.flights(x, p)[0].states.T, p)
        gradients = [gradient * units for gradient in gradients]
        left, ones = without_pairs(factors[0], directions[0], gradients)
        return multipliers([left]), ones
    rest, trivial = without_direction(factors, directions)
    return multipliers(rest), np.array([trivial])


def around(
    equations: FlowEquations, x: Array, p: Params, at_least: bool = False
) -> tuple[list[Array], list[Array]]:
    """Map small perturbations over each interval, in stacks, and list the velocities there; at VI
    as if the condition fell as fast as can be told from rest."""
    place = equations.linearised(x, p)
    # the velocities where they begin, in stacks of those of one shape as the factors
    ways = equations.velocities(x, p)
    factors: list[Array] = []
    directions: list[Array] = []
    for i, (flow, way) in enumerate(zip(equations.flows, ways, strict=True)):
        stacks = [ends := equations.transition(i, place)]
        if flow.reset or flow.until:
            last = _saltation(equations, place, i, ways, at_least) @ ends[-1:]
            alike = last.shape[1] == last.shape[2]
            stacks = [np.concatenate([ends[:-1], last])] if alike else [ends[:-1], last]
        factors += stacks
        directions += [way] if len(stacks) == 1 else [way[:-1], way[-1:]]
    return factors, directions


def _saltation(
    equations: FlowEquations, place: SolvedPlace, i: int, ways: Sequence[Array], at_least: bool
) -> Array:
    """Map small perturbations across the end of a flow: by the reset, and by how much longer the
    one flow lasts and the next one shorter; NaN at VI, or as with the least rate."""
    piece, n = place.linear[i], place.flights[i].dimension
    whole = np.eye(n, n + 1) if piece.reset is None else piece.reset
    reset = whole[:, :n]
    if piece.condition is None:
        return reset
    after = ways[(i + 1) % len(ways)][0]
    before, rate = _pace(equations, place, i)
    # S = R_x + (f_after - R_x f_before - R_t) h_x / (h_x f_before + h_t)
    jump = after - reset @ before - whole[:, n]
    gate, waits = piece.condition[0, :n], piece.condition[0, n]
    fastest = abs(ways[i]).max(axis=0)
    # S has entries of 1/rate, in units of the fastest change, and a determinant that has none: the
    # rounding of the square of these
    least = np.finfo(float).eps ** 0.5 * (abs(gate) @ fastest + abs(waits))
    if abs(rate) <= least:
        rate = least if at_least else math.nan
    return np.asarray(reset + np.outer(jump, gate) / rate)


def _pace(equations: FlowEquations, place: SolvedPlace, i: int) -> tuple[Array, float]:
    """The velocity where a condition ends a flow, and how fast that changes: ``h_x f + h_t``."""
    flight, condition = place.flights[i], place.linear[i].condition
    assert condition is not None
    f = values(equations.flows[i].f, flight.last, flight.end[:, None], place.params)[:, 0]
    return f, float(condition[0, : f.size] @ f + condition[0, f.size])


def paces(equations: FlowEquations, x: Array, p: Params) -> dict[int, tuple[float, float]]:
    """Evaluate by flow how fast its condition falls where it ends it, zero where it grazes; and
    that relative to how fast it may change along its flow."""
    place, ways, rates = equations.linearised(x, p), equations.velocities(x, p), {}
    for i, (flight, piece) in enumerate(zip(place.flights, place.linear, strict=True)):
        if piece.condition is not None:
            gate, waits = np.split(abs(piece.condition[0]), [flight.dimension])
            fastest = abs(ways[i]).max(axis=0)
            rate = _pace(equations, place, i)[1]
            rates[i] = -rate, abs(rate) / (gate @ fastest + waits[0])
    return rates


def closing_matrix(equations: FlowEquations, matrix: Matrix, mu: complex) -> Matrix:
    """The square derivative whose null vectors are perturbations that have grown by mu after
    the cycle; of an autonomous one as they come back to a section across it.

    With M of the whole turn and f the velocity where it begins, ``M f = f``, its determinant is
    that of

        | M - mu  f |
        |  e^T    0 |

    with e along f, which is ``-det(M - mu) e.f / (1 - mu)``: the trivial multiplier is taken out,
    and where another one joins it, at a fold, 1 is a simple zero.
    """
    layout = equations.layout
    square = matrix[:, : layout.size].astype(type(mu))
    sparse = not isinstance(square, np.ndarray)
    square = square.tolil() if sparse else square.copy()
    start = layout.nodes[0][0]
    for row in start:  # the first state is mu times as far off as where all ends
        square[row, row] += mu - 1
    endless = [i for i, flow in enumerate(equations.flows) if flow.until is None]
    for i in endless if equations.autonomous else ():
        square[layout.lengths[i]] = 0.0
        if i == endless[-1]:  # its length is free, and brings back to the section
            back = square[layout.last, layout.lengths[i]]
            # with its largest entry 1: beside an equilibrium, where f^T vanishes as well, |f|^2 is
            # as small as what a pair is off mu by
            square[layout.lengths[i], start] = back.T / (abs(back).max() or 1.0)
        else:
            square[layout.lengths[i], layout.lengths[i]] = 1.0
    if equations.phased:
        square[-1, -1] = 1 - mu
    for level, unfolded in zip(layout.levels, layout.lambdas, strict=True):
        # along a perturbation nothing that is conserved changes: the unfolding brings back to that
        square[level, level] = 0.0
        square[unfolded] = 0.0
        square[unfolded, level] = 1.0
    return square.tocsc() if sparse else square
