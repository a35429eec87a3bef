"""A topic of every emulated ROS 2 base, and the ticks in which it has something new."""

from abc import ABC, abstractmethod
from math import floor
from typing import Any

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.robots.ros2.keys import DEFAULT_QOS, Qos
from swarmwire.comms.robots.ros2.messages import Messages

NEAR = 1e-6  # a reading that misses its time by less than this share of a period is due


class Rate:
    """The ticks in which a reading is due, as for the sensors of the world."""

    def __init__(self, rate_hz: float) -> None:
        """0: in each tick."""
        self._rate_hz = rate_hz
        self._last = -1

    def is_due(self, time_ns: int) -> bool:
        """Whether a reading is due at this time since the start of the run, which may not go back."""
        if not self._rate_hz:
            return True
        now = floor(time_ns * self._rate_hz / NS_PER_S + NEAR)
        due, self._last = now > self._last, max(now, self._last)
        return due


Fields = dict[str, FloatArray]  # "sensor.field" -> (n,) or (n, width)


class Broadcaster(ABC):
    """One topic of every base.

    Attributes:
        kind: of its messages.
        topic: its name within the namespace of a base.
        reads: the fields that it needs, or one of them.
        rate_hz: how often there is something new; 0: in each tick.
        qos: that of its publishers.
    """

    kind: str
    reads: tuple[str, ...]
    topic: str
    rate_hz: float
    qos: Qos = DEFAULT_QOS

    def is_published(self, fields: Fields) -> bool:
        """Whether there is anything to publish."""
        return any(name in fields for name in self.reads)

    def follow(self, time_ns: int, fields: Fields) -> None:
        """Take note of new readings, whether or not anybody subscribes."""
        return

    @abstractmethod
    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """The message of one base; None: its reading was lost."""
