"""Metrics of the experiment on minimalist flocking: `aggregation_time_s` four times, each under a name of its own."""

from dataclasses import dataclass

from swarmwire.metrics.measures.swarm.aggregation import AggregationTime


@dataclass(frozen=True)
class Hop60(AggregationTime):
    """When 60 % of the robots were first in one flock of one hop: Algorithm 1 to the letter."""

    share: float = 0.6
    reading: str = "hop"
    name = "hop_60_s"


@dataclass(frozen=True)
class Hop80(AggregationTime):
    """When 80 % were."""

    share: float = 0.8
    reading: str = "hop"
    name = "hop_80_s"


@dataclass(frozen=True)
class Cluster60(AggregationTime):
    """When 60 % of the robots were first in one connected cluster."""

    share: float = 0.6
    name = "cluster_60_s"


@dataclass(frozen=True)
class Cluster80(AggregationTime):
    """When 80 % were."""

    share: float = 0.8
    name = "cluster_80_s"
