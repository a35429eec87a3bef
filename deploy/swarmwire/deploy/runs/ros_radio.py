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

    BadInput for types that are unknown. The topics end with the gateways and sources.
    """
    followed = [source for source in sources if isinstance(source, Ros2Source)]
    groups = [group for group in served.groups if isinstance(group.gateway, Ros2Gateway)] if served else []
    if scenario.radio is None or not (followed or groups):
        return None
    behind = {row for group in groups for row in group.rows.tolist()}
    followed = [source for source in followed if behind.isdisjoint(source.rows)]
    rows = [*behind, *(row for source in followed for row in source.rows)]
    radio = RosRadio(scenario, static.robot_names, sorted(rows), clock)
    for group in groups:
        if isinstance(group.gateway, Ros2Gateway):
            group.gateway.join(radio, int(group.rows[0]))
    for source in followed:
        source.join(radio)
    return radio
