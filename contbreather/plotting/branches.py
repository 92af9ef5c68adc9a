"""Branches as bifurcation diagrams: solid where stable, dashed where not, grey where nobody knows;
special points marked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import brief, check_kind
from contbreather.continuation.branches.diagram import Diagram
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.settings import MARGIN, walls_are_lifted
from contbreather.continuation.events.step_interpolant import between
from contbreather.continuation.files.resume import refined, with_columns
from contbreather.errors import BadInput
from contbreather.orbits.orbit_problem import OrbitProblem
from contbreather.orbits.section import SAME
from contbreather.plotting import canvas
from contbreather.plotting.canvas import CYCLE, GREY, Drawn

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Array = NDArray[np.float64]

STABILITY = "unstable"  # the column that counts unstable directions, if a problem records one
STABLE, UNSTABLE, BEYOND, UNKNOWN = "-", "--", ":", "-."
WORDS = {
    STABLE: "stable",
    UNSTABLE: "unstable",
    UNKNOWN: "stability not computed",
    BEYOND: "behind a wall (walls lifted)",
}
MANY = 8  # words beside points, and values in a legend with their "more": of more none is read
ROUNDING = 1e-9  # relative; what varies by less is constant
AS_LARGE = 1e-6  # relative; entries that differ by less, by what Newton leaves, are as large


class Marker(NamedTuple):
    """Special point that is marked, where, and in the colour of which branch."""

    point: Point
    branch: int
    x: float
    y: float
    colour: str


# what branches of one colour share: the kind of a boundary, nothing of a branch in one parameter;
# the values of fixed parameters that other branches have elsewhere
Group = tuple[str, tuple[tuple[str, float], ...]]

# whose a line is: with what is drawn into the same axes later its colour has a meaning
_OWNERS: WeakKeyDictionary[Artist, Branch] = WeakKeyDictionary()
KEY = "_key"  # matplotlib's label of what a legend says of colours: said anew when branches come


def plot_branches(
    *branches: Branch,
    x: str | None = None,
    y: Any = None,  # a column, or a function of a point
    ax: Axes | None = None,
    labels: bool | None = None,
    kinds: Iterable[str] | None = None,
    colours: Sequence[str] | None = None,
) -> Drawn:
    if not branches:
        raise BadInput(
            "plot needs at least one branch; those of trace_many come once, a list keeps them, and "
            "cb.load reads those in a file"
        )
    branches, y = _with_ordinate(branches, y)
    for name in (x, y):
        check_kind(name, (str, type(None)), "the name of a column")
    check_kind(labels, (bool, type(None)), "True, False or None for labels")
    x = branches[0].free if x is None else x
    y = _ordinate(branches) if y is None else y
    wanted = None if kinds is None else {*canvas.kinds_of(kinds)}
    marked = [_marked(branch, wanted) for branch in branches]
    with canvas.drawing(ax) as (drawn, axes):
        canvas.name_axes(axes, axis_title(branches[0], x), axis_title(branches[0], y))
        if ax is None:
            axes.margins(0.08)  # for the names of points at the ends
        lines = [line for line in axes.get_lines() if line in _OWNERS]
        there = {_OWNERS[line]: line.get_color() for line in lines}
        groups = _groups((*there, *branches)) if colours is None else []
        old = dict(zip(groups, there.values(), strict=False))
        key, shades = _colours(axes, branches, groups[len(there) :], colours, old)
        coloured = bool(groups) or colours is not None  # then colours say what they stand for
        styles: set[str] = set()
        marks: list[Marker] = []
        for i, (branch, points, colour) in enumerate(zip(branches, marked, shades, strict=True)):
            for side, name in enumerate(ordinates(branch, y)):
                styles |= _lines(axes, branch, (x, name), colour, coloured)
                its = [Marker(p, i, value_of(p, x), value_of(p, name), colour) for p in points]
                for mark in its:
                    _draw_marker(axes, mark)
                marks += its[: None if side == 0 else 0]  # an envelope is named at its top
        for axis, name in ((axes.xaxis, x), (axes.yaxis, y)):
            _without_offset(axis, max(np.max(b.problem.scales.get(name, 1.0)) for b in branches))
        pixel, plain = canvas.lay_out(axes), canvas.text_colour(axes)
        if not any(values for _, values in groups):  # kinds are told by words
            marks = [mark._replace(colour=plain) for mark in marks]
        words = _words(axes, pixel, marks, len(branches))
        named = len(words) <= MANY if labels is None else labels
        told = set() if named else {mark.point.kind for mark in marks} - {"EP"}
        looks = {kind: {**canvas.marker_of(kind), "color": plain} for kind in sorted(told)}
        above = _fitting_legend(drawn, pixel, key if groups else {}, styles, looks, coloured)
        if named:
            if above:  # the axes have made room for it
                canvas.lay_out(axes)
            canvas.place_words(axes, pixel, words)
    return drawn


def _with_ordinate(branches: Sequence[Branch], y: Any) -> tuple[tuple[Branch, ...], Any]:
    """Record a function of a point as a column, under its name."""
    if not callable(y):
        return (*branches,), y
    name = getattr(y, "__name__", "")
    name = name if name.isidentifier() else "y(point)"  # a lambda, say, which has none
    return tuple(with_columns(branch, **{name: y}) for branch in branches), name


def _lines(
    axes: Axes, branch: Branch, names: tuple[str, str], colour: str, coloured: bool
) -> set[str]:
    """Draw a branch, and tell in which styles; grey where colours say nothing."""
    styles, dot = set(), "." * (len(branch) == 1)  # there is no line
    for style, *line in pieces(branch, *names):
        styles.add(style)
        # two dashed lines in one place would look solid: the upper one hides the lower
        over: dict[str, Any] = {"gapcolor": axes.get_facecolor(), "zorder": 1.9}
        shade = GREY if style == UNKNOWN and not coloured else colour
        look = {} if style == STABLE else over
        (artist,) = axes.plot(*line, style, color=shade, marker=dot, **look)
        _OWNERS[artist] = branch
    return styles


def _draw_marker(axes: Axes, mark: Marker) -> None:
    kind = mark.point.kind
    edge = {"EP": "none", "MX": mark.colour}.get(kind, axes.get_facecolor())
    canvas.to_the_rim(axes.plot(
        mark.x, mark.y, **canvas.marker_of(kind), color=GREY if kind == "EP" else mark.colour,
        markeredgecolor=edge, markeredgewidth=0.5, zorder=3,
    ))  # fmt: skip


def _fitting_legend(
    drawn: Drawn, pixel: float, key: dict[Any, str], styles: set[str], looks: Any, coloured: bool
) -> float:
    """Draw a legend of as many groups as leave room for their words, or for their values; return
    its share above."""
    from matplotlib.lines import Line2D

    plain = canvas.text_colour(drawn.axes)
    unknown = plain if coloured else GREY
    if key:
        drawn.told = [one for one in drawn.told if one[0].get_label() != KEY]
    values = {("", its): colour for (_, its), colour in key.items()}  # they may tell enough
    short = values if len(values) == len(key) else key
    for most, its in [(MANY - 1, key), *((most, short) for most in range(MANY - 1, -1, -1))]:
        entries = _legend_entries(its, styles, plain, unknown, most) | looks
        handles = [Line2D([], [], **look) for look in entries.values()]
        above = canvas.fitting_legend(drawn, pixel, handles, entries, frameon=False)
        if above < 1 / 3 or not key:
            break
    return above


def _marked(branch: Branch, kinds: set[str] | None) -> list[Point]:
    """Special points to mark; where an arm sets out with the name of the point it left."""
    points = [
        replace(point, kind=point.parent.kind, label=point.parent.label) if point.parent else point
        for point in branch.special
    ]
    return [point for point in points if kinds is None or point.kind in kinds]


def _colours(
    ax: Axes, branches: Sequence[Branch], groups: Sequence[Group], given: Any, old: dict[Any, str]
) -> tuple[dict[Any, str], list[str]]:
    """Colours of groups, those that are there among them, or of families, and of each branch; no
    two values have the same one."""
    if given is not None:
        from matplotlib.colors import is_color_like

        shades = [given] if isinstance(given, str) else list(given)
        if len(shades) != len(branches) or not all(map(is_color_like, shades)):
            wanted = f"a colour for each of {len(branches)} was expected"
            raise BadInput(f"colours = {given!r}: {wanted}")
        return {}, shades
    alike: Sequence[Any] = groups or _families(branches)
    # colours go on from what the axes show already
    taken = len({line.get_color() for line in ax.get_lines() if line.get_linestyle() != "None"})
    order = [one for one in dict.fromkeys(alike) if one not in old]
    cycle = (*CYCLE[:-1], canvas.text_colour(ax))
    key: dict[Any, str] = {one: cycle[(taken + i) % len(cycle)] for i, one in enumerate(order)}
    if groups and len(order) > len(cycle):
        from matplotlib import colormaps
        from matplotlib.colors import to_hex

        order.sort()
        # its yellow is not seen on white
        shades = [to_hex(c) for c in colormaps["viridis"](np.linspace(0.0, 0.85, len(order)))]
        key = dict(zip(order, shades, strict=True))
    key = {**old, **key}
    return key, [key[one] for one in alike]


def _families(branches: Iterable[Branch]) -> list[int]:
    """Number the branches, alike the arms that leave one point: mirror images."""
    parents = [next((p.parent for p in branch.special if p.parent), None) for branch in branches]
    return [parents.index(parent) if parent else i for i, parent in enumerate(parents)]


def _groups(branches: tuple[Branch, ...]) -> list[Group]:
    """Groups of the branches, their values to six digits; none where nothing differs and no
    boundary is among them."""
    labels = [b.problem.label or ("boundary" if _is_boundary(b) else "") for b in branches]
    arms = any(point.parent for branch in branches for point in branch.special)
    told = len({*labels}) > 1 and not arms  # as breathers of other lattices
    kinds = [
        label if told or _is_boundary(b) else "" for b, label in zip(branches, labels, strict=True)
    ]
    fixed = [
        {name: x for name, x in branch.problem.params.items() if name not in branch.curve.varied}
        for branch in branches
    ]
    common = [name for name in fixed[0] if all(name in params for params in fixed)]
    differ = [name for name in common if len({params[name] for params in fixed}) > 1]
    groups = [
        (kind, tuple((name, float(f"{params[name]:.6g}")) for name in differ))
        for kind, params in zip(kinds, fixed, strict=True)
    ]
    return groups if differ or any(kinds) else []


def _is_boundary(branch: Branch) -> bool:
    return len(branch.curve.varied) > 1


def _ordinate(branches: Sequence[Branch]) -> str:
    first, problems = branches[0], [branch.problem for branch in branches]
    if _is_boundary(first):
        return first.curve.varied[1]
    if parting := _parting(branches):
        return parting
    names = [
        [*problem.shown, *(name for name in problem.start if name not in problem.internals)]
        for problem in problems
    ]
    common = [one for one in names[0] if all(one in its for its in names)] or names[0]
    # what stays as it is says nothing: between walls the largest displacement is where these are
    for name in common:
        drawn = (column_of(branch, one) for branch in branches for one in ordinates(branch, name))
        if any(np.ptp(u) > ROUNDING * abs(u).max() for u in drawn):
            return name
    return common[0]


def _parting(branches: Sequence[Branch]) -> str | None:
    """Column that tells arms apart, if there are any: mirror images have one size. Among orbits of
    other impacts, as beyond GR, neither times nor asymmetries compare."""
    families = zip(_families(branches), branches, strict=True)
    births = [[point for point in branch.special if point.parent] for branch in branches]
    if any("beyond" in point.detail for points in births for point in points):
        return None
    arms = [(i, arm) for (i, arm), born in zip(families, births, strict=True) if born]
    for name in branches[0].problem.parting if arms else ():
        if any(name not in branch.names or _upon_itself(branch, name) for branch in branches):
            continue
        spans = [(i, np.array([np.nanmin(arm[name]), np.nanmax(arm[name])])) for i, arm in arms]
        apart = (abs(u - v).max() > SAME for (i, u), (j, v) in combinations(spans, 2) if i == j)
        if all(np.ptp(span) > SAME for _, span in spans) and all(apart):
            return name
    return None


def _upon_itself(branch: Branch, name: str) -> bool:
    """Tell a branch that turns back on one level: dashes upon others are seen as a solid line."""
    steps = np.diff(branch[branch.free])
    return bool((steps < 0).any() and (steps > 0).any() and np.ptp(branch[name]) <= SAME)


def ordinates(branch: Branch, y: str) -> tuple[str, ...]:
    envelope = f"max({y})", f"min({y})"
    return envelope if y not in branch.names and {*envelope} <= {*branch.names} else (y,)


def axis_title(branch: Branch, name: str) -> str:
    array = np.ndim(branch.problem.start.get(name, 0.0)) > 0
    return f"{canvas.symbol(name)} (entry of largest size)" if array else canvas.symbol(name)


def column_of(branch: Branch, name: str) -> Array:
    """Return a column as it is drawn: of arrays the entry of largest size, with its sign."""
    values = branch[name]
    if values.dtype.kind not in "biuf":  # of complex ones only a part could be
        first = brief(values.flat[0])
        raise BadInput(f"no real numbers to draw in the column {name!r}: it has {first}")
    values = values.astype(float)
    return values if values.ndim == 1 else _largest(values.reshape(len(values), -1))


def _largest(rows: Array) -> Array:
    """First of the largest entries: those of waves are equal but for rounding, and not of one
    sign."""
    sizes = abs(rows)
    first = (sizes >= (1.0 - AS_LARGE) * sizes.max(axis=1, keepdims=True)).argmax(axis=1)
    return np.take_along_axis(rows, first[:, None], axis=1)[:, 0]


def _curve(branch: Branch, x: str, y: str) -> tuple[Array, Array]:
    """Sample both columns, also between the points; broken where one jumps."""
    from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

    columns = column_of(branch, x), column_of(branch, y)
    jumps = _jumps(branch, x, columns[0]) | _jumps(branch, y, columns[1])
    if jumps.any():
        after = 1 + np.flatnonzero(jumps)
        return np.insert(columns[0], after, np.nan), np.insert(columns[1], after, np.nan)
    along, apart = branch["arclength"], _apart(branch)
    # times and momenta of orbits are smooth; of what else is measured nobody knows
    orbits = isinstance(branch.problem, OrbitProblem) and np.isfinite(columns).all()
    solved = {x, y} <= {*branch.curve.slots}
    if apart.sum() < 2 or not (solved or orbits):
        return columns
    nodes = along[apart]
    fine = np.arange(6) / 6  # of the line between two points
    at = nodes[:-1, None] + np.diff(nodes)[:, None] * fine
    at = np.append(at.ravel(), nodes[-1])
    tangents = np.stack([point.direction for point in branch])[apart]

    def fit(name: str, column: Array) -> Any:
        slot = branch.curve.slots.get(name)
        if isinstance(slot, int):
            return CubicHermiteSpline(nodes, column[apart], tangents[:, slot])(at)
        return PchipInterpolator(nodes, column[apart])(at)  # measured: keeps between its values

    return fit(x, columns[0]), fit(y, columns[1])


def _apart(branch: Branch) -> NDArray[np.bool_]:
    """Tell which points are seen apart from the one before: a special one may sit on top of it."""
    along = branch["arclength"]
    return np.append(True, np.diff(along) > 1e-6 * float(np.ptp(along)))


def _jumps(branch: Branch, name: str, column: Array) -> NDArray[np.bool_]:
    """Find steps on which an entry of the other sign becomes the largest of an array: the column
    changes by more than any of its entries."""
    values = np.asarray(branch[name], dtype=float)
    if values.ndim == 1:
        return np.zeros(len(values) - 1, dtype=bool)
    rows = values.reshape(len(values), -1)
    change = abs(np.diff(rows, axis=0)).max(axis=1)
    small = AS_LARGE * abs(rows).max() + ROUNDING * np.max(branch.problem.scales.get(name, 1.0))
    return np.asarray(abs(np.diff(column)) > change + small)


def value_of(point: Point, name: str) -> float:
    if name in ("arclength", "residual"):
        return float(getattr(point, name))
    return float(_largest(np.reshape(point[name], (1, -1)))[0])


def _unstable(branch: Branch) -> Array:
    """For each piece between two points how much is unstable on it, NaN where nobody counted.

    At a special point the count is of a multiplier on the circle, so its neighbours decide, and
    between two special points one more that lies there.
    """
    pieces = np.full(max(len(branch) - 1, 0), np.nan)
    if STABILITY not in branch.names:
        return pieces
    unstable = np.asarray(branch[STABILITY], dtype=float)
    special = np.array([bool(point.kind) for point in branch])
    for i in range(pieces.size):
        ends = [j for j in (i, i + 1) if not special[j]]
        inside = None if ends else between(branch[i], branch[i + 1])
        counts = unstable[ends or [i, i + 1]]
        pieces[i] = np.fmax.reduce(counts) if inside is None else inside[STABILITY]
    return pieces


def _styles(branch: Branch) -> NDArray[np.str_]:
    # on boundaries rounding would decide the count
    count = np.zeros(len(branch) - 1) if _is_boundary(branch) else _unstable(branch)
    styles = np.where(np.isnan(count), UNKNOWN, np.where(count > 0, UNSTABLE, STABLE))
    if walls_are_lifted(branch.problem):
        beyond = np.asarray(branch[MARGIN]) < 0.0
        styles[beyond[1:] | beyond[:-1]] = BEYOND
    seen = np.flatnonzero(_apart(branch)[1:])
    if seen.size:  # what is too short to be seen is as what follows
        styles = styles[seen[np.searchsorted(seen, np.arange(styles.size)).clip(max=seen.size - 1)]]
    return styles


def pieces(branch: Branch, x: str, y: str) -> Iterator[tuple[str, Array, Array]]:
    """Pieces of a branch that are drawn alike: their style and both columns."""
    styles = _styles(branch)
    for name in (x, y):
        column_of(branch, name)  # once for all: slices have the columns that were computed
    cuts = [0, *(1 + np.flatnonzero(styles[1:] != styles[:-1])), len(branch) - 1]
    for start, end in pairwise(cuts):
        curve = _curve(branch[start : end + 1], x, y)
        yield str(styles[start]) if styles.size else STABLE, *curve


def _without_offset(axis: Axis, scale: float) -> None:
    """Tick labels without an offset, and a range wide enough for rounding not to show."""
    formatter: Any = axis.get_major_formatter()
    if hasattr(formatter, "set_useOffset"):
        formatter.set_useOffset(False)
    low, high = axis.get_data_interval()
    middle = 0.5 * (low + high)
    if high - low <= ROUNDING * max(abs(middle), 1e-3 * scale):
        room = 0.1 * max(abs(middle), scale)
        corners = np.array([[middle - room] * 2, [middle + room] * 2])
        level = axis is axis.axes.xaxis
        axis.axes.update_datalim(corners, updatex=level, updatey=not level)
        axis.axes.autoscale_view()


def _legend_entries(
    key: dict[Group, str], styles: set[str], plain: str, unknown: str, most: int
) -> dict[str, dict[str, Any]]:
    """Lines that say what colours and styles stand for: of many groups some, the others are in
    between."""
    count = min(len(key), most)
    shown = [list(key.items())[i] for i in np.linspace(0, len(key) - 1, count).round().astype(int)]
    entries: dict[str, dict[str, Any]] = {}
    for (kind, values), colour in shown:
        words = (f"{canvas.symbol(name)} = {x:g}" for name, x in values)
        text = ", ".join(filter(None, (kind, *words))) or "branch"
        entries[text] = {"color": colour, "label": KEY}
    if count and (left := len(key) - count):
        entries[f"and {left} more"] = {"linestyle": "none", "label": KEY}
    for style, stability in WORDS.items():
        if style in styles and styles != {STABLE}:
            colour = unknown if style == UNKNOWN else plain
            entries[stability] = {"color": colour, "linestyle": style}
    return entries


def _words(ax: Axes, pixel: float, marks: Iterable[Marker], branches: int) -> list[Any]:
    """Words beside points, as `place_words` takes them, what is special first. What is close to one
    of its kind on another branch is named with it: a pitchfork is on its branch and on both arms.
    Where they are different points, by the kind alone, for each branch numbers its own."""
    words: list[tuple[Marker, Array, str]] = []
    for mark in marks:
        kind, text = mark.point.kind, name_of(mark.point)
        if kind == "EP" and branches > 1:
            continue  # with several branches their ends are many, and say nothing: a dot is enough
        place = ax.transData.transform((mark.x, mark.y))
        for j, (other, there, name) in enumerate(words):
            # of meetings of two boundaries either may be followed
            alike = {*kind.split("-")} == {*other.point.kind.split("-")}
            away = np.hypot(*(place - there)) / pixel
            near = away < 12.0 and other.branch != mark.branch  # half a word
            if near and alike and other.colour == mark.colour:
                words[j] = other, there, name if away < 0.1 else kind
                break
        else:
            words.append((mark, place, text))
    words.sort(key=lambda word: word[0].point.kind == "EP")
    end = {"fontsize": "x-small", "color": GREY}
    return [
        (mark.x, mark.y, text, end if mark.point.kind == "EP" else {"color": mark.colour})
        for mark, _, text in words
    ]


def name_of(point: Point) -> str:
    return point.label if point.located else f"{point.label}?"


# --- arms and whole diagrams ----------------------------------------------------------------------


def plot_energy(*branches: Branch, ax: Axes | None = None) -> Drawn:
    """Energy of breathers over their frequency, with a thin line at each frequency of small
    oscillations, and, paler, where a harmonic of the frequency is one.

    Parameters
    ----------
    *branches : Branch
        Of conservative breathers, in "omega" or in "energy".
    ax : matplotlib Axes; a new figure for a journal column unless given

    Examples
    --------
    >>> import contbreather as cb
    >>> chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(3))
    >>> b = cb.breather(chain, {0: 1}, omega=1.5, params={"c": 0.05})
    >>> branch = cb.trace(b, "omega", within={"omega": (1.4, 1.6)})
    >>> print(plot_energy(branch).axes.get_xlabel())
    $\\omega$
    """
    for branch in branches:
        check_kind(branch, Branch, "a branch of breathers")
    drawn = plot_branches(*branches, x="omega", y="energy", ax=ax)
    axes, point = drawn.axes, branches[0][0]
    band = point.solution.chain.frequencies(point.params)
    left, right = axes.get_xlim()
    below, above = band[band < right][-1:], band[band > left][:1]  # the next ones are shown
    left = min([left, *(1.05 * below - 0.05 * right)])
    right = max([right, *(1.05 * above - 0.05 * left)])
    for m in range(1, int(band[-1] / max(left, 1e-3 * band[-1])) + 1):
        # a line for each of its frequencies: a span would hide gaps, as of light and heavy sites
        axes.vlines(
            band / m, 0, 1, color=GREY, alpha=1 / m, linewidth=0.3, zorder=0,
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip
    axes.set_xlim(left, right)
    return drawn


def plot_diagram(
    tree: Diagram | Branch | Sequence[Branch],
    *,
    x: str | None = None,
    y: str | Callable[[Point], float] | None = None,
    ax: Axes | None = None,
) -> Drawn:
    """Draw all branches of a diagram as `plot` does branches, also where their problems differ.

    Parameters
    ----------
    tree : Diagram, Branch, or sequence of Branch
    x : str, optional
        The free parameter unless given.
    y : str or callable, optional
        A column, or ``y(point)``, the number to draw. By default the first unknown that all
        branches have; of breathers as in `plot`. Branches without the column are left out.
    ax : matplotlib Axes; a new figure for a journal column unless given

    Raises
    ------
    BadInput
        If there is nothing to draw.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> mine = cb.Problem(lambda x, p: np.array([x[0] * (p["mu"] - x[0]**2)]),
    ...                   start={"x": 0.0}, params={"mu": -1.0})
    >>> tree = cb.diagram(mine, "mu", within={"mu": (-1, 1)}, events=[cb.branch_point()])
    >>> ax = plot_diagram(tree).axes
    >>> ax.get_xlabel(), ax.get_ylabel(), len(ax.get_lines()) >= 3
    ('$\\\\mu$', '$x$', True)
    """
    alone = isinstance(tree, Branch) or not np.iterable(tree)
    branches: list[Any] = [tree] if alone else list(tree)
    for branch in branches:
        check_kind(branch, Branch, "a diagram, or a sequence of branches,")
    if not branches:
        raise BadInput("there is no branch to draw")
    drawn, name = _with_ordinate(branches, y)
    name = _ordinate(drawn) if name is None else name
    check_kind(name, str, "the name of a column, or a function of a point,")
    drawable = [
        branch
        for branch in drawn
        if branch.problem.normed(name) or {*ordinates(branch, name)} <= {*branch.names}
    ]
    shown = [refined(branch, 60) for branch in drawable]  # points, for a smooth line
    if not shown:
        there = sorted({each for branch in drawn for each in branch.tabulated()} - {"label"})
        raise BadInput(f"no branch has a column {name!r}; there are {there}")
    return plot_branches(*shown, x=x, y=name, ax=ax)
