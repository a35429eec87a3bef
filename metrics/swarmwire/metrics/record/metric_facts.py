"""What the metrics of a run say of themselves, as `run.json` keeps it, so that drawings need nobody's code."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isinf
from typing import Any

from swarmwire.metrics.metric import Metric


@dataclass(frozen=True)
class MetricFacts:
    """A metric that a run measured."""

    name: str
    help: str  # one line: formula and unit
    unit: str
    kind: str  # "level", "count" or "time"
    bounds: tuple[float | None, float | None]  # least and largest value of a tick; None: there is none


def facts_of(metric: Metric | type[Metric]) -> MetricFacts:
    """What it says of itself."""
    least, largest = (None if bound is None or isinf(bound) else float(bound) for bound in metric.bounds)
    return MetricFacts(metric.name, metric.help, metric.unit, metric.kind, (least, largest))


def facts_in(started: Mapping[str, Any]) -> tuple[MetricFacts, ...]:
    """The metrics that `run.json` lists; KeyError, TypeError or ValueError if it does not list them as a run does."""
    return tuple(_facts(item) for item in started["metrics"])


def _facts(item: Any) -> MetricFacts:
    least, largest = item["bounds"]
    return MetricFacts(item["name"], item["help"], item["unit"], item["kind"], (least, largest))
