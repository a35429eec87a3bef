"""Ctrl-C: the first ends the run after the tick that is under way, the second at once.

A terminal that is gone (SIGHUP) asks as the first does, however often it says so: shell and system both may.
"""

import signal
import threading
from types import FrameType, TracebackType


class Interrupt:
    """While entered, SIGINT, SIGTERM and SIGHUP ask for the end of the run instead of tearing it apart.

    In the main thread only. A SIGHUP that is ignored (nohup) stays so.

    Attributes:
        asked: whether one of them came.
        hung_up: whether SIGHUP did: nobody reads what is printed.
    """

    def __init__(self) -> None:
        self.asked = self.hung_up = False
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> "Interrupt":
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._handle)
            if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
                self._before[signal.SIGHUP] = signal.signal(signal.SIGHUP, self._hang_up)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # pyright: ignore[reportArgumentType] - what signal() gave back, it takes

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True

    def _hang_up(self, number: int, frame: FrameType | None) -> None:
        self.asked = self.hung_up = True
