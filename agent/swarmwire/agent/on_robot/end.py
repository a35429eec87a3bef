"""What ends the agent of a robot from outside its loop: a signal, or the loss of the guard."""

import signal
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


class End:
    """Whether the loop is to end, and why; set from any thread, once."""

    def __init__(self) -> None:
        self.reason: str | None = None

    def ask(self, reason: str) -> None:
        """End after the step that goes on; the first reason stays."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return self.reason is not None


@contextmanager
def by_signals(end: End, patient: bool) -> Generator[None]:
    """While it holds, signals ask for the end.

    Unless it is `patient`, a second Ctrl-C does what it does to any program. With a guard, which ends what does not
    end in time, signals may come twice: from the guard, and from whoever sends them to all processes, as systemd does.
    """
    before = {number: signal.getsignal(number) for number in SIGNALS}

    def ask(number: int, _: FrameType | None) -> None:
        end.ask(signal.Signals(number).name)
        if not patient:
            signal.signal(signal.SIGINT, before[signal.SIGINT])

    for number in SIGNALS:
        signal.signal(number, ask)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
