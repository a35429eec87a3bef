"""How a robot that was lost is found again: tried with pauses that grow, until it answers or nobody wants it."""

from collections.abc import Callable

from swarmwire.agent.drivers.driver import Driver, DriverLost
from swarmwire.agent.on_robot.end import End
from swarmwire.comms.clock import Clock, to_ns

FIRST_PAUSE_NS, LONGEST_PAUSE_NS = to_ns(0.2), to_ns(2.0)


def reconnect(driver: Driver, clock: Clock, end: End, meanwhile: Callable[[], None]) -> bool:
    """Open the driver, motors off first of all; False if the end came before. `meanwhile` is called several times."""
    pause_ns = FIRST_PAUSE_NS
    while _paused(pause_ns, clock, end, meanwhile):
        try:
            driver.open()
            driver.stop()
        except DriverLost:
            pause_ns = min(2 * pause_ns, LONGEST_PAUSE_NS)
        else:
            return True
    return False


def _paused(pause_ns: int, clock: Clock, end: End, meanwhile: Callable[[], None]) -> bool:
    """Whether the pause is over, rather than the end there."""
    until_ns = clock.now_ns() + pause_ns
    while not end and (left_ns := until_ns - clock.now_ns()) > 0:
        meanwhile()
        clock.sleep_until(clock.now_ns() + min(left_ns, FIRST_PAUSE_NS))
    return not end
