"""How the runners of a run are doing, for whoever looks on."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RunnerHealth:
    """Counts since the start, but `ready`: now."""

    ready: int  # runners that play their robots
    lost: int  # runners
    late_answers: int = 0  # after their own tick, one per robot; in real time
    frames_dropped: int = 0  # to runners, never acted on
    watchdog_stops: int = 0  # of robots; in real time
    left: int = 0  # runners that said so
    robots_free: int = 0  # that no agent plays now
    foreign: int = 0  # of those that are ready: with code of their own, of which they told nothing
    waits_s: float = 0.0  # how long the run has been waiting for runners by now
    waits_for: str = ""  # the first that it waits for, and its robots
