"""The topics of ROS 2 that cross the radio of a run: checked with the plan, open as long as the run."""

from collections.abc import Sequence

from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.deploy.runs.gateways.serving import Served
from swarmwire.world.gateways.ros2 import Ros2Gateway
from swarmwire.world.gateways.ros2.radio import RosRadio
from swarmwire.world.motion.live import LiveSource
from swarmwire.world.motion.ros2 import Ros2Source
from swarmwire.world.scenario.motion import Ros2Motion
from swarmwire.world.scenario.scenario import Scenario


def check_relay(scenario: Scenario, gateways: Sequence[str]) -> None:
    """Raise BadInput for a relay without robots that have topics; `gateways` are the kinds of gateways."""
    has_motion = any(isinstance(table.motion, Ros2Motion) for table in scenario.robots.values())
    if scenario.ros2.relay.topics and not has_motion and "ros2" not in gateways:
        expected = 'expected robots with topics: --gateway ros2, or a group with motion = { source = "ros2" }'
        raise BadInput(scenario.source, "ros2.relay.topics", expected)


def open_ros_radio(
    scenario: Scenario, static: Static, served: Served | None, sources: Sequence[LiveSource], clock: DatedClock
) -> RosRadio | None:
    """Return the topics on the radio of all robots that have topics; None without such robots, or without a radio.

    BadInput for types that are unknown, and for too many topics. The topics end with the gateways and sources.
    """
    followed = [source for source in sources if isinstance(source, Ros2Source)]
    gateways = [
        (group.rows.tolist(), group.gateway)
        for group in (served.groups if served else ())
        if isinstance(group.gateway, Ros2Gateway)
    ]
    if scenario.radio is None or not (followed or gateways):
        return None
    namespaces: dict[int, str] = {}
    for rows, gateway in gateways:
        namespaces |= dict(zip(rows, gateway.namespaces, strict=True))
    followed = [source for source in followed if namespaces.keys().isdisjoint(source.rows)]
    for source in followed:
        namespaces |= dict(zip(source.rows, source.namespaces, strict=True))
    rows_of: dict[str, int] = {}
    for row, namespace in namespaces.items():
        if (other := rows_of.setdefault(namespace, row)) != row:
            names = f"{static.robot_names[other]} and {static.robot_names[row]}"
            raise BadInput(scenario.source, "ros2.relay", f"expected namespaces that differ: {names} have {namespace}")
    radio = RosRadio(scenario, static.robot_names, namespaces, clock)
    for rows, gateway in gateways:
        gateway.join(radio, rows[0])
    for source in followed:
        source.join(radio)
    return radio
