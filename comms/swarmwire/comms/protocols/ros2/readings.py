"""Messages of batteries, photocells and iRobot's Create 3 base, and the readings in them.

A Create 3 has hazards, cliff sensors over the floor, a dock and wheels; the meaning of its messages is that of iRobot's
create3_docs (docs/api).
"""

from math import isnan, nan, pi
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.protocols.ros2.keys import BATTERY_STATE, ILLUMINANCE
from swarmwire.comms.protocols.ros2.messages import (
    DOCK_STATUS,
    HAZARD,
    HAZARDS,
    INTENSITIES,
    INTENSITY,
    STOP_STATUS,
    WHEEL_TICKS,
    WHEEL_VELS,
    Messages,
)
from swarmwire.comms.robot.sensors.simple import BatterySpec

DISCHARGING, GOOD, LITHIUM_ION = 2, 1, 2  # constants of the message
FULL_LUX = 1000.0  # default illuminance for a photocell's reading of 1
BASE_FRAME = "base_link"
BUMP, CLIFF = 1, 2  # types of hazards
BUMPER_FRAME = "bump_front_center"
CLIFF_FRAMES = ("cliff_side_left", "cliff_front_left", "cliff_front_right", "cliff_side_right")
FLOOR = 2200.0  # intensity over a floor in create3_docs; a floor of shade 1 here
CLIFF_SHADE = 0.1  # a darker floor counts as a cliff: the sensors measure reflected infrared light
TICKS_PER_TURN = 508.8  # of a wheel


def charge_of(message: Any, spec: BatterySpec) -> float:
    """The charge, 0 to 1: from `percentage`, else from the voltage between the spec's `empty_v` and `full_v`; else nan.

    `percentage` is a share by its definition. A base that sends more than 1 means per cent: then the voltage counts.
    """
    share = float(message.percentage)
    if 0.0 <= share <= 1.0 and message.present:
        return share
    span_v = spec.full_v - spec.empty_v
    if isnan(message.voltage) or span_v <= 0.0:
        return nan
    return min(max((float(message.voltage) - spec.empty_v) / span_v, 0.0), 1.0)


def battery_state(messages: Messages, charge: float, voltage_v: float, stamp_ns: int) -> Any:
    """The message of a discharging battery; values that are not measured are nan, by the message's definition."""
    none = np.empty(0, np.float32)
    return messages.make(
        BATTERY_STATE,
        messages.header(stamp_ns, ""),
        voltage_v,
        *(nan, nan, nan, nan, nan),  # temperature, current, charge in Ah, capacity, capacity when new
        charge,
        DISCHARGING,
        GOOD,
        LITHIUM_ION,
        True,  # it is there
        none,
        none,
        "",
        "",
    )


def topics_of_light(topic: str, cells: int) -> tuple[str, ...]:
    """The topic of each photocell; with more than one cell the topics are numbered.

    >>> topics_of_light("illuminance", 1), topics_of_light("illuminance", 2)
    (('illuminance',), ('illuminance_0', 'illuminance_1'))
    """
    return (topic,) if cells == 1 else tuple(f"{topic}_{cell}" for cell in range(cells))


def brightness_of(message: Any, full_lux: float) -> float:
    """The reading of a photocell, 0 dark to 1 at `full_lux` and more; 0 if the message has no valid value."""
    lux = float(message.illuminance)
    return min(lux / full_lux, 1.0) if lux > 0.0 else 0.0


def illuminance(messages: Messages, brightness: float, full_lux: float, frame: str, stamp_ns: int) -> Any:
    """The message of a photocell that reads `brightness`, 0 to 1."""
    return messages.make(ILLUMINANCE, messages.header(stamp_ns, frame), brightness * full_lux, 0.0)


def hazards(messages: Messages, *, pressed: bool, shade: FloatArray, stamp_ns: int) -> Any:
    """The hazards of a base whose bumper is pressed, and whose cliff sensors are over floor of this shade (4,)."""
    frames = [(BUMP, BUMPER_FRAME)] if pressed else []
    frames += [(CLIFF, frame) for frame, value in zip(CLIFF_FRAMES, shade, strict=True) if value < CLIFF_SHADE]
    found = [messages.make(HAZARD, messages.header(stamp_ns, frame), kind) for kind, frame in frames]
    return messages.make(HAZARDS, messages.header(stamp_ns, BASE_FRAME), found)


def is_pressed(message: Any) -> bool:
    """Whether a message of hazards has a bump."""
    return any(hazard.type == BUMP for hazard in message.detections)


def cliff_intensities(messages: Messages, shade: FloatArray, stamp_ns: int) -> Any:
    """The intensities of cliff sensors over floor of this shade (4,)."""
    readings = [
        messages.make(INTENSITY, messages.header(stamp_ns, frame), round(FLOOR * float(value)))
        for frame, value in zip(CLIFF_FRAMES, shade, strict=True)
    ]
    return messages.make(INTENSITIES, messages.header(stamp_ns, BASE_FRAME), readings)


def shades_of(message: Any) -> FloatArray:
    """The shade of the floor below each cliff sensor (4,), 0 to 1; nan for a sensor that the message does not have."""
    value = {reading.header.frame_id: reading.value for reading in message.readings}
    return np.clip(np.array([value.get(frame, np.nan) for frame in CLIFF_FRAMES]) / FLOOR, 0.0, 1.0)


def wheel_ticks(messages: Messages, travel_m: FloatArray, wheel_radius_m: float, stamp_ns: int) -> Any:
    """The ticks of wheels of this radius after this travel (2,), left and right, rounded down."""
    ticks = np.floor(travel_m / (2.0 * pi * wheel_radius_m) * TICKS_PER_TURN).astype(np.int64)
    return messages.make(WHEEL_TICKS, messages.header(stamp_ns, BASE_FRAME), *map(int, ticks))


def wheel_vels(messages: Messages, speed_mps: FloatArray, wheel_radius_m: float, stamp_ns: int) -> Any:
    """The speeds in rad/s of wheels of this radius with these speeds at the rim (2,), left and right."""
    return messages.make(WHEEL_VELS, messages.header(stamp_ns, BASE_FRAME), *map(float, speed_mps / wheel_radius_m))


def stop_status(messages: Messages, *, stopped: bool, stamp_ns: int) -> Any:
    """Whether a base stands still."""
    return messages.make(STOP_STATUS, messages.header(stamp_ns, BASE_FRAME), stopped)


def dock_status(messages: Messages, stamp_ns: int) -> Any:
    """The message of a base without a dock: no arena has one."""
    return messages.make(DOCK_STATUS, messages.header(stamp_ns, BASE_FRAME), False, False)
