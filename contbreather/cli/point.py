"""`contbreather point`: one breather, its profile's height and its stability."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from contbreather.cli.options import Json, Sites, Threshold, Where, ring_of
from contbreather.cli.output import say, to_json

if TYPE_CHECKING:
    from rich.table import Table

    from contbreather.breathers import Breather


def point(
    where: Where = Where(),  # noqa: B008  # frozen
    *,
    sites: Sites = None,
    threshold: Threshold = None,
    json: Json = False,
) -> None:
    """One breather: p, phi, admissibility, stability."""
    from contbreather.breathers import symmetric_roots

    values = where.need("a", "gamma", "k")
    rule = ring_of(sites, threshold)
    first, *others = symmetric_roots(
        values["a"], values["gamma"], values["k"], forcing=where.drive()
    )
    content = _content(first, others, rule)
    if json:
        to_json(content)
        return
    say(_table(content))
    say(*_sentences(first, others, rule))


def _content(
    breather: Breather, others: list[Breather], rule: tuple[int, float] | None
) -> dict[str, Any]:
    from contbreather.stability.verdict import ChainVerdict, RingVerdict

    verdict, margins = breather.stability(), breather.admissibility()
    assert isinstance(verdict, ChainVerdict)
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
        "stable": verdict.stable,
        "unstable": verdict.unstable,
        "certain": verdict.certain,
        "over_reflecting": verdict.over_reflecting,
        "multipliers": verdict.multipliers,
        "other_roots": [{"p": other.p, "phi": other.phi} for other in others],
    }
    if rule is not None:
        sites, threshold = rule
        ring = breather.stability(sites=sites, threshold=threshold)
        assert isinstance(ring, RingVerdict)
        content["ring"] = {
            "sites": sites,
            "threshold": threshold,
            "largest": ring.largest,
            "unstable": ring.unstable,
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
    for mu in content["multipliers"]:
        table.add_row("isolated multiplier of QS", f"{mu:.12g}")
    return table


def _sentences(
    breather: Breather, others: list[Breather], rule: tuple[int, float] | None
) -> list[str]:
    lines = [breather.admissibility().reason, breather.stability().describe()]
    if rule is not None:
        lines.append(breather.stability(sites=rule[0], threshold=rule[1]).describe())
    if others:
        roots = ", ".join(f"p = {other.p:.9g}" for other in others)
        lines.append(f"further roots of (11): {roots}")
    return [f"{line[0].upper()}{line[1:].rstrip('.')}." for line in lines]
