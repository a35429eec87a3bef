"""Metrics of the user's own at the door: the classes that a scenario names, fit to be measured beside the others."""

from collections.abc import Sequence
from typing import Any, get_args

from swarmwire.comms.bodies.tables import built
from swarmwire.comms.errors import BadInput
from swarmwire.comms.own_class import own_class
from swarmwire.metrics.metric import Kind, Metric
from swarmwire.metrics.record.tick_columns import KEYS, MOVABLE, RADIO, ROBOT_COLUMNS, SIDEWAYS, VALUE
from swarmwire.metrics.registry import DELIVERY, METRICS

COLUMNS = {*KEYS, *ROBOT_COLUMNS, SIDEWAYS, VALUE, *MOVABLE, *RADIO}  # of the table of ticks, where each has one, too


def own_metrics(specs: Sequence[str], where: str) -> list[Metric]:
    """A metric of each class, "package.module:Class" or "/path/file.py:Class"; BadInput names `metrics.<place>`."""
    taken, found = {*METRICS, *COLUMNS, DELIVERY}, list[Metric]()
    for place, spec in enumerate(specs):
        key = f"metrics.{place}"
        kind = own_class(Metric, spec, where, key)
        fault = _fault(kind, taken)
        if fault:
            raise BadInput(where, key, f"{kind.__name__}: {fault}")
        found.append(built(kind, {}, where, key))
        taken.add(kind.name)
    return found


def _fault(kind: type[Metric], taken: set[str]) -> str | None:
    """What was expected of the class, whose attributes no type checker looked at; None if all is well."""
    of: dict[str, Any] = {name: getattr(kind, name, None) for name in ("name", "help", "unit", "kind", "bounds")}
    if not isinstance(of["name"], str) or not of["name"].isidentifier():
        return f"expected a name of letters, digits and _; got {of['name']!r}"
    if of["name"] in taken:
        return f"expected a name that is not taken; got {of['name']!r}"
    for text in ("help", "unit"):
        if not isinstance(of[text], str):
            return f"expected {text} as a text; got {of[text]!r}"
    if of["kind"] not in get_args(Kind):
        return f"expected the kind {' or '.join(get_args(Kind))}; got {of['kind']!r}"
    match of["bounds"]:
        case (int() | float(), int() | float() | None):
            return None
        case other:
            return f"expected bounds as a number, and a number or None; got {other!r}"
