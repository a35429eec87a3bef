"""The command that a base is to keep to: sent when it changes, and again and again, since bases time out."""

import threading
from collections.abc import Callable

from swarmwire.agent.drivers.driver import STOP, Command
from swarmwire.comms.clock import NS_PER_S, Clock

RESEND_HZ = 20  # bases stop by themselves after 0.2 s to 1 s without a command
STOPS = 3  # how often a stop is sent again: then others may drive the base


class Commander:
    """Sends commands from a thread of its own. A stop goes out at once, and no command before it is sent after it."""

    def __init__(self, send: Callable[[Command], None], clock: Clock) -> None:
        self._send, self._clock = send, clock
        self._lock = threading.Lock()
        self._command, self._left = STOP, STOPS  # what to send, and how often yet if it is a stop
        self._ended = False
        self._thread = threading.Thread(target=self._resend, name="ros2 commands", daemon=True)
        self.tell(STOP)
        self._thread.start()

    def tell(self, command: Command) -> None:
        """From now on this command; nothing happens after the end."""
        with self._lock:
            if not self._ended:
                self._command, self._left = command, STOPS
                self._send(command)

    def end(self) -> None:
        """Stop the base, and send nothing any more."""
        with self._lock:
            ended, self._ended = self._ended, True
            if not ended:
                self._send(STOP)
        self._thread.join()

    def _resend(self) -> None:
        next_ns = self._clock.now_ns()
        while True:
            next_ns = max(next_ns + NS_PER_S // RESEND_HZ, self._clock.now_ns())
            self._clock.sleep_until(next_ns)
            with self._lock:
                if self._ended:
                    return
                if self._command != STOP:
                    self._send(self._command)
                elif self._left:
                    self._left -= 1
                    self._send(STOP)
