"""Metrics by name. A new one is a file like `order.py` and its line here; a user's own is passed to `register`."""

from collections.abc import Sequence

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.network.age_of_information import AgeOfInformation
from swarmwire.metrics.network.connectivity import AlgebraicConnectivity, Articulation, ComponentCount, LargestComponent
from swarmwire.metrics.network.delivery import Airtime, LinkPacketDeliveryRatio, PacketDeliveryRatio, Throughput
from swarmwire.metrics.network.fragmentation import Fragmentations, Fragmented, RejoinMedian, RejoinWorst, Unrejoined
from swarmwire.metrics.network.latency import LatencyOnAir, LatencyToAgent
from swarmwire.metrics.swarm.aggregation import Aggregation, AggregationHop, AggregationTime
from swarmwire.metrics.swarm.contacts import CollisionRate, Collisions, MinGap, WallContacts
from swarmwire.metrics.swarm.motion import Deadlocked, Oscillation, PathEfficiency
from swarmwire.metrics.swarm.order import Order, OrderLocal, OrderVelocity, Speed
from swarmwire.metrics.swarm.spread import Cohesion, Dispersion, NearestNeighbour, Rotation
from swarmwire.metrics.task.consensus import ConsensusBias, ConsensusError
from swarmwire.metrics.task.coverage import Coverage, CoverageTime
from swarmwire.metrics.task.target import FindTime, TargetBest, TargetMean

LINK_PDR = LinkPacketDeliveryRatio.name  # drawn of every run with a radio: if not measured, over the last second

# By name, those of users too.
METRICS: dict[str, type[Metric]] = {
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
        Aggregation,
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
        Coverage,
        CoverageTime,
        ConsensusError,
        ConsensusBias,
    )
}


def register(kind: type[Metric]) -> type[Metric]:
    """Make a metric known by its name (also as a decorator); BadInput if the name is taken."""
    if METRICS.get(kind.name, kind) is not kind:
        raise BadInput("", f"metrics.{kind.name}", "expected a name that is not taken")
    METRICS[kind.name] = kind
    return kind


def standard() -> list[str]:
    """The names of those that are measured in every run."""
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
