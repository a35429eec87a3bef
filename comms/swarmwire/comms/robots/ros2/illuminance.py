"""Illuminance messages: one photocell each."""

from typing import Any

from swarmwire.comms.robots.ros2.kinds import ILLUMINANCE
from swarmwire.comms.robots.ros2.messages import Messages

FULL_LUX = 1000.0  # that a photocell's reading of 1 stands for, unless somebody measured it


def topics_of_light(topic: str, cells: int) -> tuple[str, ...]:
    """The topic of each of some photocells: numbered, unless there is one.

    >>> topics_of_light("illuminance", 1), topics_of_light("illuminance", 2)
    (('illuminance',), ('illuminance_0', 'illuminance_1'))
    """
    return (topic,) if cells == 1 else tuple(f"{topic}_{cell}" for cell in range(cells))


def brightness_of(message: Any, full_lux: float) -> float:
    """What a photocell reads, 0 dark to 1 at `full_lux` and more; 0 if the message does not tell."""
    lux = float(message.illuminance)
    return min(lux / full_lux, 1.0) if lux > 0.0 else 0.0


def illuminance(messages: Messages, brightness: float, full_lux: float, frame: str, stamp_ns: int) -> Any:
    """The message of a photocell that reads `brightness`, 0 to 1."""
    return messages.make(ILLUMINANCE, messages.header(stamp_ns, frame), brightness * full_lux, 0.0)
