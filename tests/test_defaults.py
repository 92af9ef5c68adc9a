"""What is not said means the same wherever it is not said: read off the source, like the floors."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

import contbreather

PACKAGE = Path(contbreather.__file__).parent

# Nothing that is not asked for happens: no damping, no springs, no settling, no push; the motion
# begins at t = 0, at site 0; thresholds are the paper's; walks go both ways, from rest to the end.
MEANS: dict[str, set[str]] = {
    "a": {"None", "()", "0.2"},
    "amplitude": {"0.01"},
    "arclength": {"0.0"},
    "arm": {"1"},
    "at": {"('PF',)"},
    "attempt": {"0.3"},
    "certain": {"True"},
    "closed": {"False"},
    "columns": {"None", "1"},
    "continued": {"False"},
    "cost": {"0", "5"},
    "count": {"None", "2"},
    "crossed": {"False"},
    "cut": {"False"},
    "damping": {"0.0", "None", "DAMPING"},
    "depth": {"2"},
    "digits": {"3", "4", "DIGITS"},
    "double": {"False"},
    "ends": {"''", "'free'"},
    "factor": {"1.0"},
    "finer": {"1.0"},
    "flight": {"-1"},
    "fold": {"False"},
    "free": {"'a'", "None", "()"},
    "growth": {"1.5"},
    "half": {"False"},
    "high": {"math.pi", "0.0", "math.inf"},
    "image": {"False"},
    "inadmissible": {"False"},
    "inside": {"False"},
    "interrupted": {"False"},
    "json": {"False"},
    "k": {"None", "()", "0.8"},
    "kind": {"None", "'UNDECIDED'", "''"},
    "label": {"''"},
    "legend": {"True"},
    "located": {"True"},
    "low": {"-math.pi", "-math.inf", "0.0"},
    "most": {"3", "100", "12", "50", "2000"},
    "n": {"1", "slice(None)"},
    "noise": {"0.0"},
    "nu": {"math.nan"},
    "of_all": {"(-1.0, 1.0)"},
    "one_sided": {"False"},
    "order": {"0"},
    "pair": {"('gamma', 'a')"},
    "past_folds": {"False"},
    "per_period": {"64"},
    "period": {"2.0 * math.pi", "1"},
    "periodic": {"False"},
    "periods": {"1", "200.0", "500", "None", "4096", "2400"},
    "perturb": {"0.0"},
    "points": {"100"},
    "progress": {"None"},
    "quiet": {"False"},
    "radius": {"1.0"},
    "rate": {"0.0"},
    "reach": {"math.inf", "0"},
    "reason": {"''", "'no verdict: interrupted before it was found'"},
    "residual": {"math.nan", "float('nan')"},
    "root": {"None"},
    "rows": {"1"},
    "seed": {"0"},
    "settle": {"4000", "0"},
    "sign": {"1.0"},
    "simpler": {"False"},
    "site": {"None", "0"},
    "sites": {"None", "(0,)", "(0, 1, 2)", "rule.SITES", "(200, 400, 800)", "SITES"},
    "skip": {"0"},
    "slope": {"False"},
    "smallest": {"1e-09"},
    "spare": {"False"},
    "spring": {"0.0", "None"},
    "state": {"True"},
    "style": {"'line'"},
    "symmetric": {"True", "False", "None"},
    "t": {"0.0"},
    "t0": {"0.0"},
    "terminal": {"False"},
    "threshold": {"1.005", "PAPER", "THRESHOLD", "None", "rule.THRESHOLD"},
    "time": {"math.nan"},
    "title": {"''"},
    "tolerance": {"1e-09", "1e-11", "0.001", "1e-10", "1e-08", "1e-12"},
    "towards": {"'both'", "'up'"},
    "turns": {"1"},
    "unit": {"'periods'"},
    "wall": {"None", "0"},
    "walls": {"None", "True", "()", "Walls()"},
    "weight": {"'weight'"},
    "y": {"None", "'p'"},
}


def defaults(tree: ast.Module) -> Iterator[tuple[str, str, int]]:
    """Name, default and line of each argument, and of each field of a class, that has one."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            own = [*node.args.posonlyargs, *node.args.args]
            by_place = zip(
                own[len(own) - len(node.args.defaults) :], node.args.defaults, strict=True
            )
            by_name = zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
            for one, value in (*by_place, *by_name):
                if value is not None:
                    yield one.arg, ast.unparse(value), value.lineno
        elif isinstance(node, ast.ClassDef):
            for one in node.body:
                if isinstance(one, ast.AnnAssign) and one.value is not None:
                    assert isinstance(one.target, ast.Name)
                    yield one.target.id, ast.unparse(one.value), one.lineno


SOURCES = sorted(PACKAGE.rglob("*.py"))
EVERYWHERE = Counter(
    (name, value) for path in SOURCES for name, value, _ in defaults(ast.parse(path.read_text()))
)


NAMED = (ast.Name, ast.Attribute, ast.Call, ast.Lambda)


def value_of(text: str) -> object:
    """A number, a word or several of them; the text of what is none: a constant, a call."""
    tree = ast.parse(text, mode="eval").body
    if any(isinstance(node, NAMED) for node in ast.walk(tree)):
        return text
    return eval(compile(ast.Expression(tree), "default", "eval"), {"__builtins__": {}})


def usual(name: str, value: str) -> bool:
    """Whether a default is nothing, a name, one of those above, or that of another function."""
    if isinstance(ast.parse(value, mode="eval").body, NAMED):
        return True
    own = value_of(value)
    alike = (value_of(one) for one in MEANS[name])
    return (
        own is None
        or EVERYWHERE[name, value] > 1
        or any(own == one and isinstance(own, bool) == isinstance(one, bool) for one in alike)
    )


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_name_that_is_not_given_means_what_it_means_elsewhere(path: Path) -> None:
    for name, value, line in defaults(ast.parse(path.read_text())):
        if name in MEANS and not usual(name, value):
            where = f"{path.name}:{line}: {name} = {value}"
            raise AssertionError(f"{where}; elsewhere it is one of {sorted(MEANS[name])}")


# Where one name has several meanings: whose is whose.
WHOSE = {
    "simulation.verdict": {"settle": 4000, "periods": 4096},
    "simulation.lyapunov": {"settle": 0, "count": 2, "seed": 0},
    "simulation.attraction": {"periods": 500, "tolerance": 1e-3, "site": 0},
    "simulation.periodic": {"periods": 1, "symmetric": False},
    "diagram": {"depth": 2, "most": 100},
    "multibreathers": {"most": 3},
    "FixedPoint": {"period": 1},
    "trace": {"towards": "both"},
    "continuation.walk": {"towards": "up"},
    "boundary": {"towards": "both"},
    "Steps": {"first": 0.01, "largest": None, "smallest": 1e-9, "growth": 1.5, "most": 2000},
    "paper.figure2": {"sites": 400, "points": 100, "threshold": 1.005},
    "paper.chain_lengths": {"a": 0.2, "k": 0.8, "sites": (200, 400, 800), "threshold": 1.005},
    "plotting.plot_multipliers": {"digits": 4, "half": False},
    "plotting.plot_sweep": {"y": "p"},
    "plotting.plot_section": {"site": 0, "skip": 0},
}


@pytest.mark.parametrize("name", WHOSE)
def test_what_is_not_said_is_as_its_page_says(name: str) -> None:
    import importlib
    import inspect

    folder, _, own = name.rpartition(".")
    module = importlib.import_module(f"contbreather.{folder}" if folder else "contbreather")
    given = inspect.signature(getattr(module, own)).parameters
    for parameter, value in WHOSE[name].items():
        assert given[parameter].default == value, parameter


def test_the_threshold_of_the_paper_is_the_same_everywhere() -> None:
    import importlib

    found = []
    for path in SOURCES:
        inside = path.relative_to(PACKAGE).with_suffix("").parts
        if inside[-1].startswith("__") or inside[0] == "cli":
            continue
        module = importlib.import_module(".".join(("contbreather", *inside)))
        found += [getattr(module, name) for name in ("THRESHOLD", "PAPER") if hasattr(module, name)]
    assert set(found) == {1.005}
