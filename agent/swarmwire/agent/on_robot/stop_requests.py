"""Emergency stops that another process of this machine asks for, by a signal: heeded by a thread of its own."""

import os
import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.agent.on_robot.robot_lock import ASKS_BY, OUT_OF_REACH, STOPPED

END = b"\0"  # no signal has this number


@contextmanager
def stop_requests(estop: Callable[[], None], tell: Callable[[str], None]) -> Generator[None]:
    """While it holds, the signal calls `estop`, and `tell` is told how that went.

    The interpreter writes the numbers of signals into a pipe at once, whatever the main thread is busy with; a driver
    that is stopped in the midst of a command to it, by the thread that gave it, could wait for itself for ever.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)

    def heed() -> None:
        while (numbers := os.read(reader, 64)) and END not in numbers:
            if ASKS_BY in numbers:
                try:
                    estop()
                except DriverLost:
                    tell(OUT_OF_REACH)
                else:
                    tell(STOPPED)

    before = signal.signal(ASKS_BY, _nothing), signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    thread = threading.Thread(target=heed, name="stop requests", daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before[1])
        # One that comes too late must not do what it does by default, which is to kill.
        signal.signal(ASKS_BY, signal.SIG_IGN if before[0] in (None, signal.SIG_DFL) else before[0])
        os.write(writer, END)
        thread.join()
        os.close(reader)
        os.close(writer)


def _nothing(_: int, __: FrameType | None) -> None:
    """What the signal does besides: without a handler it kills."""
