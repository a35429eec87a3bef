"""Metrics by name (built-in, of installed packages, of users), and the selection that a run measures.

A new built-in metric is a class in a file of related metrics, and an entry in `METRICS`. Installed packages bring
metrics as entry points of the group `swarmwire.metrics`. Their names are read from the packages' metadata; a class is
imported when it is used.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, get_args

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import custom_class, entry_points_of
from swarmwire.comms.robot.bodies.tables import parse_table
from swarmwire.metrics.measures.metric import Kind, Metric, Need
from swarmwire.metrics.measures.network.age_of_information import AgeOfInformation, PeakAgeOfInformation
from swarmwire.metrics.measures.network.connectivity import (
    AlgebraicConnectivity,
    Articulation,
    ComponentCount,
    LargestComponent,
)
from swarmwire.metrics.measures.network.delivery import (
    Airtime,
    LinkPacketDeliveryRatio,
    PacketDeliveryRatio,
    Throughput,
)
from swarmwire.metrics.measures.network.fragmentation import (
    Fragmentations,
    Fragmented,
    RejoinMedian,
    RejoinWorst,
    Unrejoined,
)
from swarmwire.metrics.measures.network.latency import LatencyOnAir, LatencyToAgent
from swarmwire.metrics.measures.swarm.aggregation import AggregationHop, AggregationRatio, AggregationTime
from swarmwire.metrics.measures.swarm.contacts import CollisionRate, Collisions, MinGap, WallContacts
from swarmwire.metrics.measures.swarm.motion import Deadlocked, Oscillation, PathEfficiency
from swarmwire.metrics.measures.swarm.order import Order, OrderLocal, OrderVelocity, Speed
from swarmwire.metrics.measures.swarm.spread import Cohesion, Dispersion, NearestNeighbour, Rotation
from swarmwire.metrics.measures.task.consensus import ConsensusBias, ConsensusError
from swarmwire.metrics.measures.task.coverage import CoverageRatio, CoverageTime
from swarmwire.metrics.measures.task.target import FindTime, TargetBest, TargetMean
from swarmwire.metrics.records.run_folder.layout import TICK_COLUMNS

ENTRY_POINT_GROUP = "swarmwire.metrics"
# Pictures draw it for every run with a radio; if the run did not measure it, over the last second.
LINK_PDR = LinkPacketDeliveryRatio.name

METRICS: Mapping[str, type[Metric]] = {
    kind.name: kind
    for kind in (
        Order,
        OrderVelocity,
        ComponentCount,
        LargestComponent,
        Fragmentations,
        RejoinMedian,
        RejoinWorst,
        Unrejoined,
        AgeOfInformation,
        PeakAgeOfInformation,
        Throughput,
        Airtime,
        Collisions,
        WallContacts,
        MinGap,
        TargetBest,
        TargetMean,
        OrderLocal,
        Rotation,
        Speed,
        Cohesion,
        Dispersion,
        NearestNeighbour,
        AggregationRatio,
        AggregationHop,
        AggregationTime,
        CollisionRate,
        Deadlocked,
        Oscillation,
        PathEfficiency,
        AlgebraicConnectivity,
        Articulation,
        Fragmented,
        PacketDeliveryRatio,
        LinkPacketDeliveryRatio,
        LatencyOnAir,
        LatencyToAgent,
        FindTime,
        CoverageRatio,
        CoverageTime,
        ConsensusError,
        ConsensusBias,
    )
}


@dataclass(frozen=True)
class MetricEntry:
    """A metric that a scenario names.

    Attributes:
        key: key of the name in the scenario, for errors: "metrics.2" or "metrics.2.metric".
        spec: a name, or a class as "package.module:Class" or "/path/file.py:Class".
        params: parameters; None: the key has no parameters, and any metric of that name fits.
    """

    key: str
    spec: str
    params: Mapping[str, Any] | None


@dataclass(frozen=True)
class MetricSelection:
    """The metrics of a run, and the specs of the classes of users and packages among them."""

    metrics: tuple[Metric, ...]
    code: tuple[str, ...]


def standard_names() -> list[str]:
    """Return the names of the metrics that every run measures."""
    return [name for name, kind in METRICS.items() if kind.standard]


def resolve_metrics(metrics: Sequence[str | Metric] | None) -> list[Metric]:
    """Return the metrics of names (with default parameters) or objects; None stands for the standard ones.

    BadInput if a name is unknown or comes twice.
    """
    by_name: dict[str, Metric] = {}
    for item in standard_names() if metrics is None else metrics:
        if isinstance(item, str) and item not in METRICS:
            raise BadInput("", "metrics", f"expected some of {', '.join(METRICS)}; got {item!r}")
        metric = METRICS[item]() if isinstance(item, str) else item
        if metric.name in by_name:
            raise BadInput("", "metrics", f"{metric.name!r} is named twice")
        by_name[metric.name] = metric
    return list(by_name.values())


def select_metrics(entries: Sequence[MetricEntry], where: str, *, with_standard: bool = True) -> MetricSelection:
    """Select the standard metrics and then those of `entries`, in their order; a listed standard one is not moved.

    BadInput at an entry's key for an unknown metric, for parameters that do not fit, and for a duplicate.
    """
    by_name = {name: METRICS[name]() for name in standard_names()} if with_standard else dict[str, Metric]()
    keys: dict[str, str] = {}  # name: key of its entry
    code: list[str] = []
    for entry in entries:
        if entry.params is None and entry.spec in by_name:
            continue
        kind, custom_specs = _class_of(entry, where)
        if kind.name in keys:
            raise BadInput(where, entry.key, f"{kind.name!r} is measured already, as {keys[kind.name]} lists it")
        by_name[kind.name] = parse_table(kind, entry.params or {}, where, entry.key.removesuffix(".metric"))
        keys[kind.name] = entry.key
        code += custom_specs
    return MetricSelection(tuple(by_name.values()), tuple(code))


@dataclass(frozen=True)
class PlugIn:
    """A metric of an installed package."""

    name: str  # name in scenarios
    spec: str  # class, "package.module:Class"
    package: str  # name of the package
    twice: bool  # True if another package has a metric of this name

    def kind(self, where: str, key: str) -> type[Metric]:
        """Import the class; BadInput at `key` if this fails, if it is no metric, or if it has another name."""
        if self.twice:
            raise BadInput(where, key, f"expected one plug-in {self.name!r}; more than one package brings it")
        kind = custom_metric_class(self.spec, where, key)
        if kind.name != self.name:
            expected = f"expected {self.spec} to have the name {self.name!r} of its entry point"
            raise BadInput(where, key, f"{expected}; got {kind.name!r}")
        return kind


def plug_ins() -> dict[str, PlugIn]:
    """Return the metrics of installed packages, by name."""
    by_name: dict[str, PlugIn] = {}
    for point in entry_points_of(ENTRY_POINT_GROUP):
        package = point.dist.name if point.dist else point.module
        by_name[point.name] = PlugIn(point.name, point.value.strip(), package, twice=point.name in by_name)
    return dict(sorted(by_name.items()))


def custom_metric_class(spec: str, where: str, key: str) -> type[Metric]:
    """Return the metric class "package.module:Class" or "/path/file.py:Class"; BadInput at `key` if it is none."""
    kind = custom_class(Metric, spec, where, key)
    fault = _attribute_fault(kind)
    if fault:
        raise BadInput(where, key, f"{kind.__name__}: {fault}")
    return kind


def _attribute_fault(kind: type[Metric]) -> str | None:
    """Check the class's attributes, since no type checker may have; return the expectation that fails, or None."""
    attributes: dict[str, Any] = {
        name: getattr(kind, name, None) for name in ("name", "help", "unit", "kind", "needs", "bounds")
    }
    if not isinstance(attributes["name"], str) or not attributes["name"].isidentifier():
        return f"expected a name of letters, digits and _; got {attributes['name']!r}"
    if attributes["name"] in {*METRICS, *TICK_COLUMNS}:
        return f"expected a name that no other metric or column has; got {attributes['name']!r}"
    for text in ("help", "unit"):
        if not isinstance(attributes[text], str):
            return f"expected {text} as a text; got {attributes[text]!r}"
    if attributes["kind"] not in get_args(Kind):
        return f"expected the kind {' or '.join(get_args(Kind))}; got {attributes['kind']!r}"
    if not isinstance(attributes["needs"], tuple) or not {*attributes["needs"]} <= {*get_args(Need)}:
        return f"expected needs as a tuple of some of {', '.join(get_args(Need))}; got {attributes['needs']!r}"
    match attributes["bounds"]:
        case (int() | float() | None, int() | float() | None):
            return None
        case bounds:
            return f"expected bounds as two numbers, or None where there is none; got {bounds!r}"


def _class_of(entry: MetricEntry, where: str) -> tuple[type[Metric], list[str]]:
    """Return the class of an entry, and its spec unless the class is built-in."""
    spec = entry.spec
    if entry.params is not None and (":" in spec or spec.endswith(".py")):
        return custom_metric_class(spec, where, entry.key), [spec]
    if spec in METRICS:
        return METRICS[spec], []
    packaged = plug_ins()
    if spec in packaged:
        return packaged[spec].kind(where, entry.key), [packaged[spec].spec]
    near = "".join(f" (did you mean {name}?)" for name in get_close_matches(spec, [*METRICS, *packaged], n=1))
    expected = "expected the name of a metric, as swarmwire list metrics prints it"
    alternative = "" if entry.params is None else ", or a class as module:Class or file.py:Class"
    raise BadInput(where, entry.key, f"{expected}{near}{alternative}; got {spec!r}")
