"""The least margin of an orbit of chain or ring from its walls, as text that can be compiled.

The same as `clearance` does, in numbers and loops: whose margin it is, and why, is asked there. A
motion is ``offset + a f(t) + sum over impacts of J h(t - t_j)``, h by the rows of `wave_table`.
"""

from __future__ import annotations

import math
from typing import Any

from contbreather.kernels import Kernel

# data: restitution, amplitude, periods n of the forcing, start of the section, its length;
# the margin of the far field, the largest |f|; how many harmonics, impacts of a period, flights of
# a section; sites that hit, and all that are looked at; points to half a period of the forcing;
K, A, N, START, LENGTH, FAR, PEAK = range(7)
HARMONICS, IMPACTS, FLIGHTS, BUSY, SITES, FINE = range(7, 13)
# then m, cosine and sine of each harmonic; time, impulse and site of each impact; for each site its
# offset, whether it is next to one that hits, and its row of the table for each impact.
FIRST = 13
# even powers of y in a row of the table; after them cos y, cos 2y, and the largest value of all
EVEN, WIDTH = 16, 19

ROUNDING = 1e-15  # of a margin
CLOSE = 1e-4  # crests this close to the highest, by a parabola on the grid, are all polished
BESIDE = 1e-4  # so close to a crest the distance over ``1 - cos`` is 0/0
STEEP = 12  # points of a grid that lie closer together, at the start of a flight
SHORT = 1e-2  # a flight this short, from a wall back to it, is a cubic: rounding would be all else
TWO_PI = 2.0 * math.pi


def margin(data: Any, table: Any, grid: Any, out: Any) -> int:
    """The least of all margins into ``out[0]``; `grid` is scratch, a number for each point, and so
    is `out`, four numbers."""
    least = data[FAR]
    for i in range(int(data[FLIGHTS])):
        least = min(least, between(data, table, grid, out, i))
    points = looks(data, data[LENGTH])
    for site in range(int(data[BUSY]), int(data[SITES])):
        if 1.0 - reach(data, table, site) < least - ROUNDING:  # else it cannot be closer
            fill(data, table, grid, site, 0, points)
            top = highest(grid, 0, points, 0.0)
            least = min(least, idle(data, table, grid, out, site, 0, points, top, 0.0))
    out[0] = least
    return 0


def looks(data: Any, length: float) -> int:
    """How many points of a grid."""
    return -math.floor(1e-9 - data[FINE] * max(1.0, length / math.pi))


def impact(data: Any, j: int) -> int:
    """Where time, impulse and site of an impact are."""
    return FIRST + 3 * int(data[HARMONICS]) + 3 * j


def place(data: Any, site: int) -> int:
    """Where the offset of a site is, and the rest after it."""
    return impact(data, int(data[IMPACTS])) + site * (2 + int(data[IMPACTS]))


def flag(data: Any, site: int) -> float:
    """Whether a site is next to one that hits."""
    return float(data[place(data, site) + 1])


def reach(data: Any, table: Any, site: int) -> float:
    """No less than the largest displacement of a site."""
    own = place(data, site)
    total = abs(data[own]) + data[A] * data[PEAK]
    for j in range(int(data[IMPACTS])):
        row = WIDTH * int(data[own + 2 + j])
        total += abs(data[impact(data, j) + 1]) * table[row + WIDTH - 1]
    return float(total)


def motion(data: Any, table: Any, out: Any, site: int, t: float) -> None:
    """Displacement, velocity and acceleration of a site into ``out[1]`` and on."""
    f = df = d2f = 0.0
    for i in range(int(data[HARMONICS])):
        m = data[FIRST + 3 * i]
        c, s = math.cos(m * t), math.sin(m * t)
        even = data[FIRST + 3 * i + 1] * c + data[FIRST + 3 * i + 2] * s
        f += even
        df += m * (data[FIRST + 3 * i + 2] * c - data[FIRST + 3 * i + 1] * s)
        d2f -= m * m * even
    own, n = place(data, site), data[N]
    u, v, w = data[own] + data[A] * f, data[A] * df, data[A] * d2f
    for j in range(int(data[IMPACTS])):
        since = (t - data[impact(data, j)]) / n
        y = math.pi - (since - TWO_PI * math.floor(since / TWO_PI))
        z, row = y * y, WIDTH * int(data[own + 2 + j])
        total = slope = bend = 0.0  # of a polynomial in z, with half its second derivative
        for i in range(EVEN - 1, -1, -1):
            bend = bend * z + slope
            slope = slope * z + total
            total = total * z + table[row + i]
        a, b, c, s = table[row + EVEN], table[row + EVEN + 1], math.cos(y), math.sin(y)
        c2, s2 = c * c - s * s, 2.0 * c * s
        J = data[impact(data, j) + 1]
        u += J * (total + a * c + b * c2)
        v += J * (a * s + 2.0 * b * s2 - 2.0 * slope * y) / n
        w += J * (2.0 * slope + 8.0 * z * bend - a * c - 4.0 * b * c2) / (n * n)
    out[1], out[2], out[3] = u, v, w


def displacement(data: Any, table: Any, site: int, t: float) -> float:
    """Of a site."""
    f = 0.0
    for i in range(int(data[HARMONICS])):
        angle = data[FIRST + 3 * i] * t
        f += data[FIRST + 3 * i + 1] * math.cos(angle) + data[FIRST + 3 * i + 2] * math.sin(angle)
    own = place(data, site)
    u = data[own] + data[A] * f
    for j in range(int(data[IMPACTS])):
        since = (t - data[impact(data, j)]) / data[N]
        y = math.pi - (since - TWO_PI * math.floor(since / TWO_PI))
        z, row = y * y, WIDTH * int(data[own + 2 + j])
        total = 0.0
        for i in range(EVEN - 1, -1, -1):
            total = total * z + table[row + i]
        c = math.cos(y)
        total += table[row + EVEN] * c + table[row + EVEN + 1] * (2.0 * c * c - 1.0)
        u += data[impact(data, j) + 1] * total
    return float(u)


# --- between the impacts of a site ----------------------------------------------------------


def between(data: Any, table: Any, grid: Any, out: Any, i: int) -> float:
    """The margin of the site of an impact up to its next one."""
    k, start, site = data[K], data[impact(data, i)], data[impact(data, i) + 2]
    length, then, period = TWO_PI * data[N], i, TWO_PI * data[N]
    for j in range(int(data[IMPACTS])):
        ahead = data[impact(data, j)] - start
        ahead -= period * math.floor(ahead / period)
        if j != i and data[impact(data, j) + 2] == site and ahead < length:
            length, then = ahead, j
    if length <= 0.0:
        return float(length)
    least, points = math.inf, looks(data, length)
    size = STEEP + points - 1
    if length > SHORT:
        for p in range(size):
            s = length * share(p, points)
            u = displacement(data, table, int(site), start + s)
            grid[p], grid[size + p] = s, (1.0 - u * u) / ((s + k) * s * (length - s))
        low, high = 0.1 * grid[0], length * (1.0 - 1e-3 / points)
        least = deepest(data, table, grid, out, 0, size, low, high, int(site), start, 0.0, length)
    speed = abs(data[impact(data, i) + 1]) / (1.0 + k)
    left = 2.0 * speed / length
    if k == 0.0:
        motion(data, table, out, int(site), start)
        left = out[3] / length * (1.0 if data[impact(data, i) + 1] > 0.0 else -1.0)
    right = 2.0 * abs(data[impact(data, then) + 1]) / (1.0 + k) / (length * (length + k))
    least = min(least, left, right)
    return float(least * scale_of(length, k))


def scale_of(length: float, k: float) -> float:
    """The denominator at mid flight, of short ones large enough for a zero to be simple."""
    length = max(length, SHORT)
    return 0.25 * length * length * (0.5 * length + k)


def share(p: int, points: int) -> float:
    """Point p of a grid between 0 and 1, finer towards the start."""
    if p < STEEP:
        return float(0.5 ** (6.0 - 0.5 * p) / points)
    return (p - STEEP + 1) / points


def deepest(
    data: Any, table: Any, grid: Any, out: Any, at: int, size: int, first: float, last: float,
    site: int, start: float, side: float, mark: float,
) -> float:  # fmt: skip
    """The least of a ratio, with every dip that may be it polished between its neighbours: places
    from ``grid[at]`` on, between two ends, then the values there. Which ratio says `polished`."""
    ratios, lowest = at + size, math.inf
    for p in range(size):
        lowest = min(lowest, grid[ratios + p])
    enough = lowest + 0.1 * max(abs(lowest), 0.1 * abs(grid[ratios + size - 1]))
    least = math.inf
    for p in range(size):
        best = grid[ratios + p]
        if best > enough or (p > 0 and best > grid[ratios + p - 1]):
            continue
        if p + 1 < size and best > grid[ratios + p + 1]:
            continue
        low = grid[at + p - 1] if p > 0 else first
        high = grid[at + p + 1] if p + 1 < size else last
        found = polished(data, table, out, site, start, side, mark, grid[at + p], best, low, high)
        least = min(least, found)
    return least


def polished(
    data: Any, table: Any, out: Any, site: int, start: float, side: float, mark: float,
    s: float, best: float, low: float, high: float,
) -> float:  # fmt: skip
    """The minimum of a ratio next to s: Newton, kept in by bisection. Without a side it is that of
    a flight of length `mark`, else that of the distance from one wall, whose crest is at `mark`."""
    k, turn = data[K], 1.0 / data[N]
    bisected = 0
    for _ in range(60):
        if bisected == 9:  # the ratio falls up to an end, which has a value of its own
            break
        motion(data, table, out, site, start + s)
        u, v, w = out[1], out[2], out[3]
        if side == 0.0:
            rest = mark - s
            n, n1, n2 = 1.0 - u * u, -2.0 * u * v, -2.0 * (u * w + v * v)
            d = (s + k) * s * rest
            d1 = (2.0 * s + k) * rest - (s + k) * s
            d2 = 2.0 * rest - 2.0 * (2.0 * s + k)
        else:
            angle = turn * (s - mark)
            n, n1, n2 = 1.0 - side * u, -side * v, -side * w
            d2 = turn * turn * math.cos(angle)
            d, d1 = 1.0 - math.cos(angle), turn * math.sin(angle)
            if abs(math.sin(0.5 * angle)) <= BESIDE:  # 0/0 but for rounding: by de l'Hospital
                n, n1, n2, d, d1, d2 = n2, 0.0, 0.0, d2, 0.0, 0.0
        best = min(best, n / d)
        tilt, bend = n1 * d - n * d1, n2 * d - n * d2
        if tilt > 0.0:
            high = s
        else:
            low = s
        last = s
        s = s - tilt / bend if bend > 0.0 else low
        if not low < s < high:
            bisected, s = bisected + 1, 0.5 * (low + high)
        if abs(s - last) <= 1e-8:
            break
    return best


# --- sites that never hit a wall ------------------------------------------------------------


def fill(data: Any, table: Any, grid: Any, site: int, at: int, points: int) -> None:
    """Displacements of a site at equal steps of the section, from ``grid[at]`` on."""
    step = data[LENGTH] / points
    for p in range(points):
        grid[at + p] = displacement(data, table, site, data[START] + step * p)


def height(u: float, side: float) -> float:
    """Towards one wall, or towards the nearer one."""
    return side * u if side != 0.0 else abs(u)


def crest(grid: Any, at: int, points: int, p: int, side: float) -> float:
    """The height of the crest at a point of the grid, by a parabola; nothing elsewhere."""
    u = height(grid[at + p], side)
    before = height(grid[at + (p - 1 if p > 0 else points - 1)], side)
    after = height(grid[at + (p + 1 if p + 1 < points else 0)], side)
    if u < before or u < after:
        return -math.inf
    bend = 2.0 * u - before - after
    return u + (after - before) * (after - before) / (8.0 * bend) if bend > 0.0 else u


def highest(grid: Any, at: int, points: int, side: float) -> float:
    """Of all crests of a site."""
    top = -math.inf
    for p in range(points):
        top = max(top, crest(grid, at, points, p, side))
    return top


def idle(
    data: Any, table: Any, grid: Any, out: Any, site: int, at: int, points: int, top: float,
    side: float,
) -> float:  # fmt: skip
    """The margin of a site that never hits, at each of its crests that may be the highest, from the
    nearer wall or from one of them."""
    step, least = data[LENGTH] / points, math.inf
    for p in range(points):
        if crest(grid, at, points, p, side) >= top - CLOSE * abs(top):
            u = climbed(data, table, out, site, data[START] + p * step, step, side)
            least = min(least, 1.0 - height(u, side))
    return least


def climbed(
    data: Any, table: Any, out: Any, site: int, t: float, step: float, side: float
) -> float:
    """Where a site is at the extremum of its motion within a step of t: Newton, kept in by
    bisection."""
    low, high = t - step, t + step
    motion(data, table, out, site, t)
    top = side > 0.0 or (side == 0.0 and out[1] > 0.0)
    for _ in range(60):
        u, v, w = out[1], out[2], out[3]
        if (v > 0.0) == top:
            low = t
        else:
            high = t
        last = t
        t = t - v / w if w != 0.0 else low
        if not low <= t <= high:
            t = 0.5 * (low + high)
        if abs(t - last) <= 1e-8:  # of second order: the next step would be rounding
            return float(u + 0.5 * v * (t - last))
        motion(data, table, out, site, t)
    return float(out[1])


# --- besides a grazing crest ----------------------------------------------------------------

ALIKE, TELLING, MIRRORED = 1e-9, 1e-12, 1e-13  # as in `clearance`


def rivals(data: Any, table: Any, grid: Any, out: Any) -> int:
    """The least of all other margins where one crest of an idle site touches a wall, each as
    ``m/(|m| + size)``, into ``out[0]``. Behind the sites in `data`: which one and when, whether the
    orbit is its own mirror image; and how much each site feels the impacts."""
    sites, busy = int(data[SITES]), int(data[BUSY])
    more = place(data, sites)
    own, felt = int(data[more]), more + 3
    size = data[felt + own]
    least = math.inf
    for i in range(int(data[FLIGHTS])):
        site = int(data[impact(data, i) + 2])
        found = between(data, table, grid, out, i)
        least = min(least, apart(found, max(size, data[felt + site])))
    points = looks(data, data[LENGTH])
    fill(data, table, grid, own, (own - busy) * points, points)
    found = others(data, table, grid, out, own, points)
    least = min(least, found)
    end = (sites - busy) * points  # what follows overwrites its grid last
    found = besides(data, table, grid, out, own, points, end)
    out[0] = min(least, found)
    return 0


def apart(found: float, size: float) -> float:
    """A margin relative to its size, where rounding does not decide its sign."""
    return 1.0 if size < TELLING else found / (abs(found) + size)


def others(data: Any, table: Any, grid: Any, out: Any, own: int, points: int) -> float:
    """The least of idle sites that are not images of this one: of all that feel the impacts more,
    and of those of the rest that may be least."""
    sites, busy = int(data[SITES]), int(data[BUSY])
    felt = place(data, sites) + 3
    size, top, least = data[felt + own], -math.inf, math.inf
    for site in range(busy, sites):
        out[4 + site] = -math.inf
        gap, near = 0.0, data[felt + site] > size or flag(data, site) > 0.0
        if site == own or not (near or reach(data, table, site) > top - CLOSE * abs(top)):
            continue
        fill(data, table, grid, site, (site - busy) * points, points)
        for p in range(points):
            here, there = (site - busy) * points + p, (own - busy) * points + p
            gap = max(gap, abs(grid[here] - grid[there]))
        if gap > ALIKE:
            out[4 + site] = highest(grid, (site - busy) * points, points, 0.0)
            if data[felt + site] <= size:
                top = max(top, out[4 + site])
    for site in range(busy, sites):
        mine = out[4 + site]
        if mine == -math.inf:
            continue
        near = data[felt + site] > size or flag(data, site) > 0.0
        if near or mine >= top - CLOSE * abs(top):
            at = (site - busy) * points
            found = idle(data, table, grid, out, site, at, points, mine, 0.0)
            least = min(least, apart(found, max(size, data[felt + site])))
    return least


def besides(data: Any, table: Any, grid: Any, out: Any, own: int, points: int, end: int) -> float:
    """The site itself: its crest divided out, and the other wall unless that is its other half."""
    sites, busy = int(data[SITES]), int(data[BUSY])
    more = place(data, sites)
    size, t, at = data[more + 3 + own], data[more + 1], (own - busy) * points
    motion(data, table, out, own, t)
    side = 1.0 if out[1] > 0.0 else -1.0
    least = math.inf
    whole = data[LENGTH] > 1.5 * math.pi * data[N]  # not half a period
    if whole:
        top = highest(grid, at, points, -side)
        found = idle(data, table, grid, out, own, at, points, top, -side)
        if data[more + 2] == 0.0 or abs(found) >= MIRRORED:
            least = apart(found, size)
    return min(least, apart(undivided(data, table, grid, out, own, side, points, at, end), size))


def undivided(
    data: Any, table: Any, grid: Any, out: Any, own: int, side: float, points: int, at: int,
    end: int,
) -> float:  # fmt: skip
    """The least distance from the wall over ``1 - cos`` of the time since its crest; places and
    ratios from ``grid[end]`` on."""
    step, period = data[LENGTH] / points, TWO_PI * data[N]
    crest_at = data[place(data, int(data[SITES])) + 1] - data[START]
    crest_at -= period * math.floor(crest_at / period)
    count, looked = 0, round(period / step)
    for p in range(looked):
        if abs(math.sin(math.pi / period * (step * p - crest_at))) > BESIDE:
            grid[end + count] = step * p
            count += 1
    for i in range(count):
        p = round(grid[end + i] / step)
        u = grid[at + p] if p < points else -grid[at + p - points]
        away = 1.0 - math.cos(TWO_PI / period * (grid[end + i] - crest_at))
        grid[end + count + i] = (1.0 - side * u) / away
    low, high = grid[end] - step, grid[end + count - 1] + step
    start = data[START]
    return deepest(data, table, grid, out, end, count, low, high, own, start, side, crest_at)


MARGIN, RIVALS = Kernel(margin, "pppp"), Kernel(rivals, "pppp")
