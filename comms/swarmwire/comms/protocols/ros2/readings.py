"""Messages of batteries, photocells and iRobot's Create 3 base, and the readings in them.

A Create 3 has hazards, cliff sensors over the floor, a dock and wheels; iRobot's create3_docs (docs/api) define its
messages.
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
FLOOR = 2200.0  # intensity over a floor of shade 1, in create3_docs the intensity over a floor
CLIFF_SHADE = 0.1  # a darker floor counts as a cliff: the sensors measure reflected infrared light
TICKS_PER_TURN = 508.8  # ticks in a turn of a wheel


def charge_of(message: Any, spec: BatterySpec) -> float:
    """Return the charge, 0 to 1: `percentage`, or derived from the voltage by the spec's limits; nan without either.

    `percentage` is a share by its definition. If it is above 1, the base sends per cent, and the voltage counts.
    """
    share = float(message.percentage)
    if 0.0 <= share <= 1.0 and message.present:
        return share
    span_v = spec.full_v - spec.empty_v
    if isnan(message.voltage) or span_v <= 0.0:
        return nan
    return min(max((float(message.voltage) - spec.empty_v) / span_v, 0.0), 1.0)


def battery_state(messages: Messages, charge: float, voltage_v: float, stamp_ns: int) -> Any:
    """Return the message of a discharging battery; values that are not measured are nan, by its definition."""
    no_cells = np.empty(0, np.float32)
    return messages.make(
        BATTERY_STATE,
        messages.header(stamp_ns, ""),
        voltage_v,
        *(nan, nan, nan, nan, nan),  # temperature, current, charge in Ah, capacity, capacity when new
        charge,
        DISCHARGING,
        GOOD,
        LITHIUM_ION,
        True,  # present
        no_cells,
        no_cells,
        "",
        "",
    )


def topics_of_light(topic: str, cells: int) -> tuple[str, ...]:
    """Return the topic of each photocell; several cells have numbered topics.

    >>> topics_of_light("illuminance", 1), topics_of_light("illuminance", 2)
    (('illuminance',), ('illuminance_0', 'illuminance_1'))
    """
    return (topic,) if cells == 1 else tuple(f"{topic}_{cell}" for cell in range(cells))


def brightness_of(message: Any, full_lux: float) -> float:
    """Return the reading of a photocell, 0 dark to 1 at `full_lux` and more; 0 if the message has no valid value."""
    lux = float(message.illuminance)
    return min(lux / full_lux, 1.0) if lux > 0.0 else 0.0


def illuminance(messages: Messages, brightness: float, full_lux: float, frame: str, stamp_ns: int) -> Any:
    """Return the message of a photocell that reads `brightness`, 0 to 1."""
    return messages.make(ILLUMINANCE, messages.header(stamp_ns, frame), brightness * full_lux, 0.0)


def hazards(messages: Messages, *, pressed: bool, shade: FloatArray, stamp_ns: int) -> Any:
    """Return the hazards of a base with this bumper, and cliff sensors over floor of this shade (4,)."""
    hazard_frames = [(BUMP, BUMPER_FRAME)] if pressed else []
    hazard_frames += [(CLIFF, frame) for frame, value in zip(CLIFF_FRAMES, shade, strict=True) if value < CLIFF_SHADE]
    detections = [messages.make(HAZARD, messages.header(stamp_ns, frame), kind) for kind, frame in hazard_frames]
    return messages.make(HAZARDS, messages.header(stamp_ns, BASE_FRAME), detections)


def is_pressed(message: Any) -> bool:
    """Return True if a message of hazards has a bump."""
    return any(hazard.type == BUMP for hazard in message.detections)


def cliff_intensities(messages: Messages, shade: FloatArray, stamp_ns: int) -> Any:
    """Return the intensities of cliff sensors over floor of this shade (4,)."""
    readings = [
        messages.make(INTENSITY, messages.header(stamp_ns, frame), round(FLOOR * float(value)))
        for frame, value in zip(CLIFF_FRAMES, shade, strict=True)
    ]
    return messages.make(INTENSITIES, messages.header(stamp_ns, BASE_FRAME), readings)


def shades_of(message: Any) -> FloatArray:
    """Return the shade of the floor below each cliff sensor (4,), 0 to 1; nan for a sensor that the message lacks."""
    value = {reading.header.frame_id: reading.value for reading in message.readings}
    return np.clip(np.array([value.get(frame, np.nan) for frame in CLIFF_FRAMES]) / FLOOR, 0.0, 1.0)


def wheel_ticks(messages: Messages, travel_m: FloatArray, wheel_radius_m: float, stamp_ns: int) -> Any:
    """Return the ticks of wheels of this radius after this travel (2,), left and right, rounded down."""
    ticks = np.floor(travel_m / (2.0 * pi * wheel_radius_m) * TICKS_PER_TURN).astype(np.int64)
    return messages.make(WHEEL_TICKS, messages.header(stamp_ns, BASE_FRAME), *map(int, ticks))


def wheel_vels(messages: Messages, speed_mps: FloatArray, wheel_radius_m: float, stamp_ns: int) -> Any:
    """Return the speeds in rad/s of wheels of this radius with these speeds at the rim (2,), left and right."""
    return messages.make(WHEEL_VELS, messages.header(stamp_ns, BASE_FRAME), *map(float, speed_mps / wheel_radius_m))


def stop_status(messages: Messages, *, stopped: bool, stamp_ns: int) -> Any:
    """Return the message of a base that stands still or moves."""
    return messages.make(STOP_STATUS, messages.header(stamp_ns, BASE_FRAME), stopped)


def dock_status(messages: Messages, stamp_ns: int) -> Any:
    """Return the message of a base without a dock; no arena has one."""
    return messages.make(DOCK_STATUS, messages.header(stamp_ns, BASE_FRAME), False, False)
