"""Metrics: what is measured of every run."""

from abc import ABC
from math import isinf

from swarmwire.deploy.catalogue.docs import texts_of
from swarmwire.deploy.catalogue.entry import Entry, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.registry import METRICS

KINDS = {
    "level": "level: a state at each tick",
    "count": "count: what happened within a tick, added up over the run",
    "time": "time: when something happened, in s from the start of the run; none if it did not",
}


def metrics() -> list[Entry]:
    """The metrics of the registry."""
    return [_metric(kind) for kind in METRICS.values()]


def _metric(kind: type[Metric]) -> Entry:
    parameters = parameters_of_dataclass(kind)
    return Entry(
        kind="metric",
        name=kind.name,
        help=kind.help,
        facts=(
            ("in summary.json", f"metrics.{kind.name}: final, mean, min and max over the ticks"),
            ("kind", KINDS[kind.kind]),
            ("unit", kind.unit or "none"),
            ("bounds", _bounds(*kind.bounds)),
        ),
        tables=(ParameterTable("parameters", parameters),) if parameters else (),
        text=texts_of(kind, (Metric, ABC, object)),
    )


def _bounds(least: float, largest: float | None) -> str:
    if largest is not None:
        return f"{least:g} to {largest:g}"
    return "none" if isinf(least) else f"{least:g} and more"
