"""Messages of iRobot's Create 3 base: hazards, the floor below its cliff sensors, its dock and its wheels.

Their meaning is that of iRobot's create3_docs (docs/api).
"""

from math import pi
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.robots.ros2.definitions import (
    DOCK_STATUS,
    HAZARD,
    HAZARDS,
    INTENSITIES,
    INTENSITY,
    STOP_STATUS,
    WHEEL_TICKS,
    WHEEL_VELS,
)
from swarmwire.comms.robots.ros2.messages import Messages

FRAME = "base_link"
BUMP, CLIFF = 1, 2  # types of hazards
BUMPER_FRAME = "bump_front_center"
CLIFF_FRAMES = ("cliff_side_left", "cliff_front_left", "cliff_front_right", "cliff_side_right")
FLOOR = 2200.0  # intensity over a floor in create3_docs; a floor of shade 1 here
CLIFF_SHADE = 0.1  # a darker floor counts as a cliff: the sensors measure reflected infrared light
TICKS_PER_TURN = 508.8  # of a wheel


def hazards(messages: Messages, *, pressed: bool, shade: FloatArray, stamp_ns: int) -> Any:
    """The hazards of a base whose bumper is pressed, and whose cliff sensors are over floor of this shade (4,)."""
    frames = [(BUMP, BUMPER_FRAME)] if pressed else []
    frames += [(CLIFF, frame) for frame, value in zip(CLIFF_FRAMES, shade, strict=True) if value < CLIFF_SHADE]
    found = [messages.make(HAZARD, messages.header(stamp_ns, frame), kind) for kind, frame in frames]
    return messages.make(HAZARDS, messages.header(stamp_ns, FRAME), found)


def is_pressed(message: Any) -> bool:
    """Whether a message of hazards has a bump."""
    return any(hazard.type == BUMP for hazard in message.detections)


def cliff_intensities(messages: Messages, shade: FloatArray, stamp_ns: int) -> Any:
    """The intensities of cliff sensors over floor of this shade (4,)."""
    readings = [
        messages.make(INTENSITY, messages.header(stamp_ns, frame), round(FLOOR * float(value)))
        for frame, value in zip(CLIFF_FRAMES, shade, strict=True)
    ]
    return messages.make(INTENSITIES, messages.header(stamp_ns, FRAME), readings)


def shades_of(message: Any) -> FloatArray:
    """The shade of the floor below each cliff sensor (4,), 0 to 1; nan for a sensor that the message does not have."""
    value = {reading.header.frame_id: reading.value for reading in message.readings}
    return np.clip(np.array([value.get(frame, np.nan) for frame in CLIFF_FRAMES]) / FLOOR, 0.0, 1.0)


def wheel_ticks(messages: Messages, travel_m: FloatArray, wheel_radius_m: float, stamp_ns: int) -> Any:
    """The ticks of wheels of this radius after this travel (2,), left and right, rounded down."""
    ticks = np.floor(travel_m / (2.0 * pi * wheel_radius_m) * TICKS_PER_TURN).astype(np.int64)
    return messages.make(WHEEL_TICKS, messages.header(stamp_ns, FRAME), *map(int, ticks))


def wheel_vels(messages: Messages, speed_mps: FloatArray, wheel_radius_m: float, stamp_ns: int) -> Any:
    """The speeds in rad/s of wheels of this radius with these speeds at the rim (2,), left and right."""
    return messages.make(WHEEL_VELS, messages.header(stamp_ns, FRAME), *map(float, speed_mps / wheel_radius_m))


def stop_status(messages: Messages, *, stopped: bool, stamp_ns: int) -> Any:
    """Whether a base stands still."""
    return messages.make(STOP_STATUS, messages.header(stamp_ns, FRAME), stopped)


def dock_status(messages: Messages, stamp_ns: int) -> Any:
    """The message of a base without a dock: no arena has one."""
    return messages.make(DOCK_STATUS, messages.header(stamp_ns, FRAME), False, False)
