"""Single keys from the terminal, while a run has it; the terminal is given back as it was."""

import atexit
import os
import select
import signal
import sys
import termios
import threading
import tty
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any

POLL_S = 0.5  # how often a run in the background looks whether it has the terminal again
HIDE_CURSOR, SHOW_CURSOR = b"\x1b[?25l", b"\x1b[?25h"


class KeyListener:
    """Hands every key typed to `press`, in a thread of its own, from `start` to `stop`.

    Keys are not echoed and need no Enter; Ctrl-C and Ctrl-Z remain what they are. Without a terminal on standard input
    and output, or in the background, `start` does nothing.
    """

    def __init__(self, press: Callable[[str], None]) -> None:
        self._press = press
        self._before: list[Any] | None = None  # the terminal's attributes, while they are changed
        self._wake: tuple[int, int] | None = None  # a pipe that ends the thread
        self._handlers: dict[signal.Signals, Any] = {}
        self._suspended = False
        self._lock = threading.RLock()  # of the attributes; a signal's handler may interrupt who holds it

    @property
    def active(self) -> bool:
        """Whether keys are read."""
        return self._wake is not None

    def start(self) -> None:
        """Take the terminal, if there is one."""
        if self.active or not (os.isatty(0) and os.isatty(1) and _in_foreground()):
            return
        self._wake, self._suspended = os.pipe(), False
        atexit.register(self.stop)
        if threading.current_thread() is threading.main_thread():
            for number, handler in ((signal.SIGTSTP, self._suspend), (signal.SIGCONT, self._continue)):
                self._handlers[number] = signal.signal(number, handler)
        self._take()
        self._thread = threading.Thread(target=self._read, args=(self._wake[0],), name="keys", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Give the terminal back; safe to call more than once."""
        if self._wake is None:
            return
        self._give_back()
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._handlers.clear()
        atexit.unregister(self.stop)
        os.close(self._wake[1])
        self._thread.join()
        os.close(self._wake[0])
        self._wake = None

    def _read(self, wake: int) -> None:
        """Until the pipe is closed. In the background a read would stop the whole run, so there is none."""
        while True:
            foreground = _in_foreground()
            self._take()  # again, if the run comes back from the background
            ready, _, _ = select.select([wake, 0] if foreground else [wake], [], [], POLL_S)
            if wake in ready:
                return
            if 0 in ready and _in_foreground():
                try:
                    typed = os.read(0, 64)
                except OSError:
                    typed = b""
                if not typed:  # the terminal is gone
                    return
                if not typed.startswith(b"\x1b"):  # an arrow or the like is several characters, none of them meant
                    for key in typed.decode("utf-8", "replace"):
                        self._press(key)

    def _take(self) -> None:
        with self._lock, suppress(termios.error, OSError):  # a terminal that is gone gives no keys
            if self._before is None and not self._suspended and _in_foreground():
                self._before = termios.tcgetattr(0)
                tty.setcbreak(0, termios.TCSAFLUSH)  # what was typed before was not meant for the run
                os.write(1, HIDE_CURSOR)

    def _give_back(self) -> None:
        with self._lock, suppress(termios.error, OSError):  # or it is gone, and its attributes with it
            self._suspended = True
            before, self._before = self._before, None
            if before is not None and _in_foreground():
                termios.tcsetattr(0, termios.TCSADRAIN, before)
                os.write(1, SHOW_CURSOR)

    def _suspend(self, number: int, frame: FrameType | None) -> None:
        """Ctrl-Z: the shell gets its terminal as it was."""
        sys.stdout.flush()
        self._give_back()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)

    def _continue(self, number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGTSTP, self._suspend)
        self._suspended = False
        self._take()


def _in_foreground() -> bool:
    """Whether this process may use its terminal."""
    try:
        return os.tcgetpgrp(0) == os.getpgrp()
    except OSError:
        return False
