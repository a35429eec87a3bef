"""What a run takes from others at most; all beyond it is refused or dropped, and counted where it reaches the world.

They bound what one runner that is admitted can do to the memory of a world and to the other runners. They do not bound
its share of the machine: docs/security.md says what that means.
"""

from dataclasses import dataclass

from swarmwire.comms.wire.frames import MOST_BYTES


@dataclass(frozen=True)
class Limits:
    """The limits of one endpoint.

    Attributes:
        link_bytes: of one message, as zenoh puts it together again from its parts; a larger one vanishes there. Twice
            what a frame may have, so that a frame that is too large by mistake arrives, and is counted.
        runners: of one run. A runner is a process with some 30 MB, so that more do not fit on a few machines.
        robots_per_runner: that one runner may play; a tick of so many fits into a frame many times.
        waiting: answers and requests of one runner that wait for the world. In lockstep one is there at a time, in
            real time a few; a runner that sends more is ahead of anything that it was asked.
        waiting_bytes: of these together; one is taken, however large.
        flood: that may be dropped of one runner; then it is lost, and heard no more in this run. Even to drop a message
            costs the world some 5 us, so that one that never stops would take a core.
        requests: to be told of the run, or to join it, that one runner may make in one run. A runner that comes back
            each minute for a day stays below.
        names: of runners that ask for something or send too much, in one run, each of which is remembered; beyond them
            nobody new is heard. A runner that comes back under a new name each minute stays below for a month.
        join_s: from the assignment of robots to the word that their agents are built.
    """

    link_bytes: int = 2 * MOST_BYTES
    runners: int = 2000
    robots_per_runner: int = 20_000
    waiting: int = 64
    waiting_bytes: int = 2 * MOST_BYTES
    flood: int = 5000
    requests: int = 2000
    names: int = 50_000
    join_s: float = 60.0


LIMITS = Limits()  # of every world that is not told others
