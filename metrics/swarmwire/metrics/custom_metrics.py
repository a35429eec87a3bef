"""Metrics of the user's own at the door: a class that a scenario or a package names, fit to be measured."""

from typing import Any, get_args

from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import custom_class
from swarmwire.metrics.metric import Kind, Metric
from swarmwire.metrics.registry import METRICS
from swarmwire.metrics.run_folder.ticks import KEYS, MOVABLE, RADIO, ROBOT_COLUMNS, SIDEWAYS, VALUE

COLUMNS = {*KEYS, *ROBOT_COLUMNS, SIDEWAYS, VALUE, *MOVABLE, *RADIO}  # of the table of ticks, where each has one, too


def own_kind(spec: str, where: str, key: str) -> type[Metric]:
    """The metric's class that "package.module:Class" or "/path/file.py:Class" names; else BadInput at `key`."""
    kind = custom_class(Metric, spec, where, key)
    fault = _fault(kind)
    if fault:
        raise BadInput(where, key, f"{kind.__name__}: {fault}")
    return kind


def _fault(kind: type[Metric]) -> str | None:
    """What was expected of the class, whose attributes no type checker looked at; None if all is well."""
    of: dict[str, Any] = {name: getattr(kind, name, None) for name in ("name", "help", "unit", "kind", "bounds")}
    if not isinstance(of["name"], str) or not of["name"].isidentifier():
        return f"expected a name of letters, digits and _; got {of['name']!r}"
    if of["name"] in {*METRICS, *COLUMNS}:
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
