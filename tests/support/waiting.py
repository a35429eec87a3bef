"""Waiting for what another thread, another process or the network does."""

from collections.abc import Callable
from threading import Event
from typing import TypeVar

from swarmwire.comms.clock import WallClock, to_ns

TIMEOUT_S = 60.0  # of a machine that is busy: whatever holds does so in milliseconds
EACH_S = 0.005

T = TypeVar("T")


def until(look: Callable[[], T], holds: Callable[[T], object] = bool) -> T:
    """What `look` returns as soon as it `holds`; AssertionError if it does not in a minute."""
    clock, pause = WallClock(), Event()
    end_ns = clock.now_ns() + to_ns(TIMEOUT_S)
    while not holds(found := look()):
        assert clock.now_ns() < end_ns, f"it did not come to hold; last seen: {found!r}"
        pause.wait(EACH_S)
    return found
