"""`contbreather point`: one breather, its profile's height and its stability."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from contbreather.cli.options import Json, Root, Sites, Threshold, Where, ring_of, rooted
from contbreather.cli.output import say, to_json

if TYPE_CHECKING:
    from rich.table import Table

    from contbreather.breathers import Breather


def point(
    where: Where = Where(),
    *,
    root: Root = 1,
    sites: Sites = None,
    threshold: Threshold = None,
    json: Json = False,
) -> None:
    """One breather: p, phi, admissibility, stability."""
    from contbreather.breathers import symmetric_roots

    values = where.need("a", "gamma", "k")
    rule = ring_of(sites, threshold)
    found = symmetric_roots(values["a"], values["gamma"], values["k"], forcing=where.drive())
    breather = rooted(found, root)
    others = [other for other in found if other is not breather]
    content = _content(breather, others, rule)
    if json:
        to_json({**content, "root": root})
        return
    say(_table(content))
    say(*_sentences(breather, others, rule))


def _content(
    breather: Breather, others: list[Breather], rule: tuple[int, float] | None
) -> dict[str, Any]:
    verdict, margins = breather.stability(), breather.admissibility()
    content: dict[str, Any] = {
        "a": breather.a,
        "gamma": breather.gamma,
        "k": breather.k,
        "forcing": breather.forcing.describe(),
        "p": breather.p,
        "phi": breather.phi,
        "chi": breather.chi,
        "admissible": margins.ok,
        "max_neighbour": margins.max_neighbour,
        "margin": margins.margin,
        "reason": margins.reason,
        # what goes through a wall is no motion of the chain, be its linearisation what it may
        "stable": verdict.stable if margins.ok else None,
        "unstable": verdict.unstable if margins.ok else None,
        "certain": verdict.certain,
        "over_reflecting": verdict.over_reflecting,
        "multipliers": verdict.multipliers,
        "other_roots": [{"p": other.p, "phi": other.phi} for other in others],
    }
    if rule is not None:
        sites, threshold = rule
        ring = breather.stability(sites=sites, threshold=threshold)
        content["ring"] = {
            "sites": sites,
            "threshold": threshold,
            "largest": ring.largest,
            "unstable": ring.unstable if margins.ok else None,
        }
    return content


def _table(content: dict[str, Any]) -> Table:
    from rich.table import Table

    table = Table(title="Symmetric breather", title_justify="left", show_header=False)
    table.add_column()
    table.add_column(justify="right")
    for name in ("a", "gamma", "k", "p", "phi", "chi"):
        table.add_row(name, f"{content[name]:.15g}")
    table.add_row("max |u_1|", f"{content['max_neighbour']:.15g}")
    for mu in content["multipliers"] if content["admissible"] else ():
        table.add_row("isolated multiplier of QS", f"{mu:.12g}")
    return table


def _sentences(
    breather: Breather, others: list[Breather], rule: tuple[int, float] | None
) -> list[str]:
    margins = breather.admissibility()
    lines = [margins.reason]
    if margins.ok:
        lines.append(breather.stability().describe())
        if rule is not None:
            lines.append(breather.stability(sites=rule[0], threshold=rule[1]).describe())
    else:
        lines.append("nothing is said of its stability: the chain has no such motion")
    if others:
        roots = ", ".join(f"p = {other.p:.9g}" for other in others)
        lines.append(f"further roots of (11): {roots}")
    return [f"{line[0].upper()}{line[1:].rstrip('.')}." for line in lines]
