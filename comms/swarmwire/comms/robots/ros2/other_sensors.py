"""BatteryState and Illuminance messages, and the readings of batteries and photocells in them."""

from math import isnan, nan
from typing import Any

import numpy as np

from swarmwire.comms.robots.ros2.keys import BATTERY_STATE, ILLUMINANCE
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.sensors.simple import BatterySpec

FRAME = ""
DISCHARGING, GOOD, LITHIUM_ION = 2, 1, 2  # constants of the message
FULL_LUX = 1000.0  # default illuminance for a photocell's reading of 1


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
        messages.header(stamp_ns, FRAME),
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
