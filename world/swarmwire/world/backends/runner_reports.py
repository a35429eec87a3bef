"""Reports on the runners of a run: arrivals and departures, losses, and their health."""

from dataclasses import dataclass
from typing import Literal

from swarmwire.comms.base.sentinels import NO_TICK
from swarmwire.comms.wire.assignment import robots_text

RunnerEventKind = Literal["joined", "left", "lost", "returned", "restarted"]

# Reason of the departure of a runner whose arrival was no event.
NOT_READY = "its agents were not ready yet"


@dataclass(frozen=True)
class RunnerEvent:
    """The arrival or departure of one runner."""

    what: RunnerEventKind
    runner: str
    robots: tuple[str, ...]
    tick: int  #: the open tick, or NO_TICK before the first
    reason: str = ""  #: cause of a loss or restart, or NOT_READY

    def __str__(self) -> str:
        when = "before the first tick" if self.tick == NO_TICK else f"in tick {self.tick}"
        text = f"{self.runner} {_VERBS[self.what]} {robots_text(self.robots)} {when}"
        return text + (f": {self.reason}" if self.reason else "")


_VERBS: dict[RunnerEventKind, str] = {
    "joined": "joined with",
    "left": "left",
    "lost": "was lost with",
    "returned": "returned to",
    "restarted": "was restarted with",
}


@dataclass(frozen=True)
class RunnerHealth:
    """The state of the runners for observers: counts since the start, except present values."""

    ready: int  #: present number of runners that play their robots
    lost: int  #: runners
    late_answers: int = 0  #: answers per robot that arrived after their tick, in real time
    frames_dropped: int = 0  #: frames to runners that no agent acted on
    watchdog_stops: int = 0  #: stops of robots by the watchdog, in real time
    left: int = 0  #: runners that left
    robots_free: int = 0  #: present number of robots without a runner
    foreign: int = 0  #: ready runners that sent no hashes of their agents
    waits_s: float = 0.0  #: duration of the present wait for runners
    waits_for: str = ""  #: first runner that blocks the loop, and its robots


@dataclass(frozen=True)
class Loss:
    """A runner, or a process of an agent host, that was lost in a run that continues."""

    runner: str
    robots: str
    reason: str
    traceback: str = ""  # the traceback of a failed agent

    def __str__(self) -> str:
        return f"{self.runner}, which played {self.robots}: {self.reason}"
