"""BatteryState messages."""

from math import isnan, nan
from typing import Any

import numpy as np

from swarmwire.comms.robots.ros2.kinds import BATTERY_STATE
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.sheets import Battery

FRAME = ""
DISCHARGING, GOOD, LITHIUM_ION = 2, 1, 2  # constants of the message


def charge_of(message: Any, sheet: Battery) -> float:
    """The charge, 0 to 1: as told, else as the voltage lies between the sheet's when empty and when full; nan: neither.

    `percentage` is a share by its definition. A base that tells more than 1 means per cent, and 1 could be either: then
    the voltage counts.
    """
    share = float(message.percentage)
    if 0.0 <= share <= 1.0 and message.present:
        return share
    span_v = sheet.full_v - sheet.empty_v
    if isnan(message.voltage) or span_v <= 0.0:
        return nan
    return min(max((float(message.voltage) - sheet.empty_v) / span_v, 0.0), 1.0)


def battery_state(messages: Messages, charge: float, voltage_v: float, stamp_ns: int) -> Any:
    """The message of a battery that is being drained; what nobody measures is nan, as its definition wants it."""
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
