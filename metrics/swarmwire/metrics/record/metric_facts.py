"""What the metrics of a run say of themselves, as `run.json` keeps it, so that drawings need nobody's code."""

from dataclasses import dataclass
from math import isinf
from pathlib import Path
from typing import Any

from swarmwire.comms.parsing import from_json
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.record.names import RUN_JSON


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


def read_facts(folder: Path) -> dict[str, MetricFacts]:
    """By name, the metrics of the run of this folder; none where they were not kept, or cannot be read."""
    try:
        found: Any = from_json((folder / RUN_JSON).read_text(encoding="utf-8"))
        facts = [_facts(item) for item in found["metrics"]]
    except (OSError, ValueError, KeyError, TypeError):  # what is amiss with the file is told by those who need it
        return {}
    return {of.name: of for of in facts}


def _facts(item: Any) -> MetricFacts:
    least, largest = item["bounds"]
    return MetricFacts(item["name"], item["help"], item["unit"], item["kind"], (least, largest))
