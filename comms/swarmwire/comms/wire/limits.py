"""Limits of an endpoint for runners, and of a frame. Light to import: every zenoh session needs them.

The limits bound the effect of one admitted runner on the memory of a world and on the other runners: messages beyond
them are refused or dropped, and counted where they reach the world. They do not bound the runner's share of the
machine: see docs/security.md.
"""

from dataclasses import dataclass

MAX_BYTES = 64 * 1024 * 1024  # of a frame
MAX_RESTARTS = 3  # of an agent process by its host; then its robots are lost


@dataclass(frozen=True)
class JoinLimits:
    """The limits of one endpoint.

    Attributes:
        link_bytes: size of one message after zenoh's reassembly; zenoh drops a larger one. Twice the limit of a frame,
            so that a frame that is too large by mistake arrives and is counted.
        runners: runners of one run. A runner is a process of some 30 MB, so that a few machines cannot hold more.
        robots_per_runner: robots of one runner; a tick of so many fits into a frame many times.
        waiting: answers and requests of one runner in the world's queue. In lockstep the queue holds one, in real time
            a few; a runner that sends more sends answers that no frame asked for.
        waiting_bytes: bytes of these together; a single message of any size is accepted.
        flood: dropped messages of one runner; after these it is lost, and ignored for the rest of the run. To drop a
            message costs the world some 5 us, so that an endless sender would take a core.
        requests: requests for session info, or to join, of one runner in one run. A runner that comes back each minute
            for a day stays below.
        names: names of requesting or rate-limited runners in one run, each of which is stored; runners with further
            names are ignored. A runner that comes back under a new name each minute stays below for a month.
        join_s: time from the assignment of robots to the message that their agents are built.
    """

    link_bytes: int = 2 * MAX_BYTES
    runners: int = 2000
    robots_per_runner: int = 20_000
    waiting: int = 64
    waiting_bytes: int = 2 * MAX_BYTES
    flood: int = 5000
    requests: int = 2000
    names: int = 50_000
    join_s: float = 60.0


LIMITS = JoinLimits()  # the defaults
