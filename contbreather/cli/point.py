"""`contbreather point`: one breather, its profile's height and its stability."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import contbreather as cb
from contbreather.cli.options import ModelArguments, ModelOptions, Whole
from contbreather.cli.output import say, sentences, to_json
from contbreather.errors import NotConverged
from contbreather.parameters import NAMES, NEEDED

if TYPE_CHECKING:
    from contbreather.tables import Sheet


def point(
    where: ModelOptions = ModelOptions(),
    *,
    root: Whole | None = None,
    certify: bool = False,
    json: bool = False,
) -> None:
    """One breather: p, phi, admissibility, stability.

    Parameters
    ----------
    root
        Which solution of (11), in order of decreasing p, where there are several; unless given the
        first that is admissible.
    certify
        Prove all of it by interval arithmetic, on the infinite chain; exit status 1 if that fails.
    json
        Print one JSON object, in full precision.
    """
    from contbreather.orbits.closed_form import rooted

    values, rule = where.need(*NEEDED), where.on()
    # of a point, --sites asks for a ring besides the infinite chain
    on = rule if where.lattice else replace(where, sites=None, threshold=None).on()
    roots: tuple[Any, ...] = cb.orbits.symmetric_roots(**{**values, **on.given})
    breather = rooted(roots, root)
    others = [other for other in roots if other is not breather]
    verdicts = _verdicts(breather, on, rule)
    content = _content(breather, on, verdicts, others, where.sites)
    proof = breather.certify() if certify else None
    if proof is not None:
        content["certificate"] = asdict(proof)
    if json:
        to_json({**content, "root": roots.index(breather) + 1})
    else:
        say(_table(breather, verdicts[0]))
        say(*_sentences(breather, verdicts, others), *([] if proof is None else [proof.describe()]))
    if proof is not None and proof.unproved:
        raise NotConverged(f"not all is proved: {'; '.join(proof.unproved)}")


def _verdicts(breather: Any, on: ModelArguments, rule: ModelArguments) -> list[Any]:
    """On its own lattice, and by the paper's rule if that was asked for besides."""
    if on.lattice.sites is not None:
        return [breather.stability(threshold=on.threshold)]
    if rule.lattice.sites is None:
        return [breather.stability()]
    ring = {"sites": rule.lattice.sites, "threshold": rule.threshold}
    return [breather.stability(), breather.stability(**ring)]


def _content(
    breather: Any, on: ModelArguments, verdicts: list[Any], others: list[Any], sites: int | None
) -> dict[str, Any]:
    verdict, margins = verdicts[0], breather.admissibility()
    # what goes through a wall is no motion of the lattice, be its linearisation what it may
    judged = margins.ok
    content: dict[str, Any] = {
        **{name: getattr(breather, name) for name in NAMES},
        **on.entry(),
        **{name: getattr(breather, name) for name in ("p", "phi", "chi")},
        "admissible": margins.ok,
        "max_neighbour": margins.max_neighbour,
        "margin": margins.margin,
        "reason": margins.reason,
        "stable": verdict.stable if judged else None,
        "unstable": verdict.unstable if judged else None,
        "other_roots": [
            {"p": other.p, "phi": other.phi, "admissible": other.admissibility().ok}
            for other in others
        ],
    }
    if on.lattice.sites is not None:
        return {**content, "largest": verdict.largest if judged else None}
    names = ("certain", "over_reflecting", "multipliers")
    content |= {name: getattr(verdict, name) for name in names}
    for ring in verdicts[1:]:
        content["ring"] = {
            "sites": sites,
            "threshold": ring.threshold,
            "largest": ring.largest,
            "unstable": ring.unstable if judged else None,
        }
    return content


def _table(breather: Any, verdict: Any) -> Sheet:
    judged = breather.lattice.sites is None and breather.admissibility().ok
    isolated = verdict.multipliers if judged else ()
    rows = [("isolated multiplier of QS", f"{mu:.12g}") for mu in isolated]
    return replace(breather.table().further(*rows), title="Symmetric breather")


def _sentences(breather: Any, verdicts: list[Any], others: list[Any]) -> list[str]:
    margins = breather.admissibility()
    lines = [margins.reason]
    if margins.ok:
        lines += [verdict.describe() for verdict in verdicts]
    else:
        lines.append("nothing is said of its stability: the lattice has no such motion")
    if others:
        roots = (
            f"p = {root.p:.9g} ({'' if root.admissibility().ok else 'not '}admissible)"
            for root in others
        )
        lines.append(f"further roots of (11): {', '.join(roots)}")
    return sentences(lines)
