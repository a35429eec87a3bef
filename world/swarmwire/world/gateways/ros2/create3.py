"""The topics of emulated Create 3 bases that follow from their bumper, their cliff sensors and their dock."""

from typing import Any

import numpy as np

from swarmwire.comms.robots.ros2.keys import Qos
from swarmwire.comms.robots.ros2.messages import DOCK_STATUS, HAZARDS, INTENSITIES, Messages
from swarmwire.comms.robots.ros2.readings import cliff_intensities, dock_status, hazards
from swarmwire.world.gateways.ros2.broadcaster import Broadcaster, Fields

STATUS_RATE_HZ = 1.0  # of the dock
HAZARD_QOS = Qos(depth=5)  # create3_sim: hazards_vector_publisher.cpp


class HazardBroadcaster(Broadcaster):
    """`bumper` and `ground` as HazardDetectionVector, in each tick; a lost reading is no hazard."""

    kind = HAZARDS
    reads = ("bumper.pressed", "ground.shade")
    topic = "hazard_detection"
    rate_hz = 0.0
    qos = HAZARD_QOS

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any:
        """As `Broadcaster.message`."""
        pressed = bool(fields["bumper.pressed"][base] > 0.0)
        return hazards(messages, pressed=pressed, shade=fields["ground.shade"][base], stamp_ns=stamp_ns)


class CliffBroadcaster(Broadcaster):
    """`ground` as IrIntensityVector."""

    kind = INTENSITIES
    reads = ("ground.shade",)
    topic = "cliff_intensity"

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """As `Broadcaster.message`."""
        shade = fields["ground.shade"][base]
        return None if np.isnan(shade).any() else cliff_intensities(messages, shade, stamp_ns)


class DockBroadcaster(Broadcaster):
    """`dock_status` of a base that has no dock."""

    kind = DOCK_STATUS
    reads = ()
    topic = "dock_status"
    rate_hz = STATUS_RATE_HZ

    def is_published(self, fields: Fields) -> bool:
        """As `Broadcaster.is_published`."""
        return True

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any:
        """As `Broadcaster.message`."""
        return dock_status(messages, stamp_ns)
