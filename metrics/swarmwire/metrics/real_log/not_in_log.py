"""Which metrics a log of real robots cannot tell, and what it lacks for them."""

from swarmwire.metrics.metric import Metric
from swarmwire.metrics.registry import METRICS

CONTACTS = "contacts are not in the log"
RANGE = "a real network knows no range, so there is no radio graph in the log"
AIRTIME = "times on air are not in the log"
WORLD = "world"  # a robot's kind of radio
ON_AIR = "the robots' radio was that of a run, whose latencies robots know to the agent alone: see latency_agent"
POSES = "poses are not in the log: no tracker"
OWN = "a metric of users' own may rest on poses, which are not in the log"

LACKING: dict[str, str] = {
    "collisions": CONTACTS,
    "wall_contacts": CONTACTS,
    "collision_rate": CONTACTS,
    "components": RANGE,
    "largest_component": RANGE,
    "fragmentations": RANGE,
    "fragmented": RANGE,
    "rejoin_median": RANGE,
    "rejoin_worst": RANGE,
    "unrejoined": RANGE,
    "algebraic_connectivity": RANGE,
    "articulation": RANGE,
    "airtime": AIRTIME,
}
WITHOUT_POSES = frozenset(
    {
        "age_of_information",
        "throughput",
        "pdr",
        "link_pdr",
        "latency_air",
        "latency_agent",
        "oscillation",
        "consensus_error",
        "consensus_bias",
    }
)  # the only ones that a log without poses tells


def why_not(metric: Metric, *, has_poses: bool, has_air: bool = False) -> str | None:
    """What the log lacks for this metric; None: nothing. `has_air`: packets went over a run's radio."""
    if has_air and metric.name == "latency_air":
        return ON_AIR
    if metric.name in LACKING:
        return LACKING[metric.name]
    if has_poses or metric.name in WITHOUT_POSES:
        return None
    return POSES if metric.name in METRICS else OWN
