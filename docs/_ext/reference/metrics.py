"""The metrics, from their registry."""

from math import isfinite

from reference.docstrings import told_of
from reference.markdown import NOTHING, code, number, sentence, table
from reference.parameters import HEAD, parameter_rows
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.registry import METRICS


def metric_table() -> str:
    """Every metric: what it is, its unit, whether it is read off or adds up, its bounds, whether it is standard."""
    head = ("metric", "what", "unit", "kind", "bounds of a tick", "standard")
    return table(head, [_row(kind) for kind in METRICS.values()])


def metric_details() -> str:
    """Every metric's formula and source as its docstring tells them, and its parameters."""
    parts: list[str] = []
    for name, kind in METRICS.items():
        parts.append(f"### {code(name)}\n\n{told_of(kind, Metric)}\n")
        rows = parameter_rows(kind)
        parts += [table(HEAD, rows)] if rows else []
    return "\n".join(parts)


def _row(kind: type[Metric]) -> tuple[str, ...]:
    standard = "yes" if kind.standard else NOTHING
    return code(kind.name), sentence(kind.help), kind.unit, kind.kind, _bounds(kind), standard


def _bounds(kind: type[Metric]) -> str:
    least, largest = kind.bounds
    if not isfinite(least):
        return NOTHING if largest is None else f"at most {number(largest)}"
    return f"at least {number(least)}" if largest is None else f"{number(least)} to {number(largest)}"
