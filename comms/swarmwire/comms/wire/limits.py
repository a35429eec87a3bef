"""Limits of an endpoint for runners, and of a frame. Light to import, since every zenoh session needs them.

The limits bound the effect of an admitted runner on the memory of a world and on other runners: messages beyond them
are refused or dropped, and counted if they reach the world. They do not bound the runner's share of the machine: see
docs/security.md.
"""

from dataclasses import dataclass

MAX_BYTES = 64 * 1024 * 1024  # size of a frame
MAX_RESTARTS = 3  # restarts of an agent process by its host; after these, its robots are lost


@dataclass(frozen=True)
class JoinLimits:
    """Limits of one endpoint.

    Attributes:
        link_bytes: size of a message after zenoh's reassembly; zenoh drops larger messages. Twice the limit of a frame,
            so that a frame that is too large by mistake arrives and is counted.
        runners: runners of a run. A runner is a process of some 30 MB, so a few machines cannot hold more.
        robots_per_runner: robots of a runner; a frame has room for many times as many.
        waiting: answers and requests of a runner in the world's queue. The queue holds one in lockstep and a few in
            real time; a runner that sends more sends answers without a frame.
        waiting_bytes: total size of these answers and requests; a single message of any size is accepted.
        flood: dropped messages of a runner; after these it is lost, and ignored for the rest of the run. Dropping a
            message costs the world some 5 us, so an endless sender would occupy a core.
        requests: requests of a runner for session info or to join, in one run. A runner that reconnects each minute
            for a day stays below the limit.
        names: names of requesting or rate-limited runners in one run, all of which are stored; runners with further
            names are ignored. A runner that reconnects under a new name each minute stays below the limit for a month.
        join_s: time from the assignment of robots to the message that their agents are ready.
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


LIMITS = JoinLimits()  # default limits
