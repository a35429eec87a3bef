"""Metrics by name: swarmwire's, those of installed packages and those of users; and which of them a run measures.

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

GROUP = "swarmwire.metrics"  # of entry points
LINK_PDR = LinkPacketDeliveryRatio.name  # drawn of every run with a radio: if not measured, over the last second

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
        key: of the name in the scenario, for errors: "metrics.2" or "metrics.2.metric".
        spec: a name, or a class as "package.module:Class" or "/path/file.py:Class".
        params: its parameters; None: the place takes none, and any metric of that name will do.
    """

    key: str
    spec: str
    params: Mapping[str, Any] | None


@dataclass(frozen=True)
class MetricSelection:
    """The metrics of a run, and the specs of the classes of users and packages among them."""

    metrics: tuple[Metric, ...]
    code: tuple[str, ...]


def standard() -> list[str]:
    """The names of the metrics that every run measures."""
    return [name for name, kind in METRICS.items() if kind.standard]


def chosen(metrics: Sequence[str | Metric] | None) -> list[Metric]:
    """The metrics asked for, by name (with its default parameters) or as they are; None: the standard ones.

    BadInput if a name is unknown or comes twice.
    """
    found: dict[str, Metric] = {}
    for item in standard() if metrics is None else metrics:
        if isinstance(item, str) and item not in METRICS:
            raise BadInput("", "metrics", f"expected some of {', '.join(METRICS)}; got {item!r}")
        metric = METRICS[item]() if isinstance(item, str) else item
        if metric.name in found:
            raise BadInput("", "metrics", f"{metric.name!r} is named twice")
        found[metric.name] = metric
    return list(found.values())


def select_metrics(entries: Sequence[MetricEntry], where: str, *, with_standard: bool = True) -> MetricSelection:
    """The standard metrics and then those of `entries`, in their order; a listed standard one keeps its place.

    BadInput at an entry's key for what is no metric, for parameters that do not fit, and for what is listed twice.
    """
    found = {name: METRICS[name]() for name in standard()} if with_standard else dict[str, Metric]()
    keys: dict[str, str] = {}  # by name: where it was listed
    code: list[str] = []
    for entry in entries:
        if entry.params is None and entry.spec in found:
            continue
        kind, own = _class_of(entry, where)
        if kind.name in keys:
            raise BadInput(where, entry.key, f"{kind.name!r} is measured already, as {keys[kind.name]} lists it")
        found[kind.name] = parse_table(kind, entry.params or {}, where, entry.key.removesuffix(".metric"))
        keys[kind.name] = entry.key
        code += own
    return MetricSelection(tuple(found.values()), tuple(code))


@dataclass(frozen=True)
class PlugIn:
    """A metric that a package brings."""

    name: str  # as a scenario lists it
    spec: str  # its class, "package.module:Class"
    package: str  # that brings it
    twice: bool  # another package brings one of this name

    def kind(self, where: str, key: str) -> type[Metric]:
        """The class, fit to be measured; BadInput at `key` if it does not import, is no metric, or has another name."""
        if self.twice:
            raise BadInput(where, key, f"expected one plug-in {self.name!r}; more than one package brings it")
        kind = custom_metric_class(self.spec, where, key)
        if kind.name != self.name:
            expected = f"expected {self.spec} to have the name {self.name!r} of its entry point"
            raise BadInput(where, key, f"{expected}; got {kind.name!r}")
        return kind


def plug_ins() -> dict[str, PlugIn]:
    """The metrics of installed packages, by name."""
    found: dict[str, PlugIn] = {}
    for point in entry_points_of(GROUP):
        found[point.name] = PlugIn(
            point.name, point.value.strip(), point.dist.name if point.dist else point.module, twice=point.name in found
        )
    return dict(sorted(found.items()))


def custom_metric_class(spec: str, where: str, key: str) -> type[Metric]:
    """The metric's class that "package.module:Class" or "/path/file.py:Class" names; else BadInput at `key`."""
    kind = custom_class(Metric, spec, where, key)
    fault = _attribute_fault(kind)
    if fault:
        raise BadInput(where, key, f"{kind.__name__}: {fault}")
    return kind


def _attribute_fault(kind: type[Metric]) -> str | None:
    """What was expected of the class, whose attributes no type checker looked at; None if all is well."""
    of: dict[str, Any] = {
        name: getattr(kind, name, None) for name in ("name", "help", "unit", "kind", "needs", "bounds")
    }
    if not isinstance(of["name"], str) or not of["name"].isidentifier():
        return f"expected a name of letters, digits and _; got {of['name']!r}"
    if of["name"] in {*METRICS, *TICK_COLUMNS}:
        return f"expected a name that is not taken; got {of['name']!r}"
    for text in ("help", "unit"):
        if not isinstance(of[text], str):
            return f"expected {text} as a text; got {of[text]!r}"
    if of["kind"] not in get_args(Kind):
        return f"expected the kind {' or '.join(get_args(Kind))}; got {of['kind']!r}"
    if not isinstance(of["needs"], tuple) or not {*of["needs"]} <= {*get_args(Need)}:
        return f"expected needs as a tuple of some of {', '.join(get_args(Need))}; got {of['needs']!r}"
    match of["bounds"]:
        case (int() | float() | None, int() | float() | None):
            return None
        case other:
            return f"expected bounds as two numbers, or None where there is none; got {other!r}"


def _class_of(entry: MetricEntry, where: str) -> tuple[type[Metric], list[str]]:
    """The class of an entry, and its spec unless the class is of swarmwire's."""
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
    a_class = "" if entry.params is None else ", or a class as module:Class or file.py:Class"
    raise BadInput(where, entry.key, f"{expected}{near}{a_class}; got {spec!r}")
