"""The operator's side of control: all robots are asked at once, and each one's reply is waited for until the end."""

# zenoh's stubs leave out the return types of some methods.
# pyright: reportUnknownMemberType=false

from collections.abc import Iterable

import zenoh

from swarmwire.comms.clock import Clock, WallClock, to_ns, to_s
from swarmwire.comms.wire.swarm_keys import SwarmKeys

ESTOP, STATUS = "estop", "status"  # what may be asked
STOPPED = "stopped"  # the reply to ESTOP
POLL_NS = to_ns(0.02)  # how often it is looked for replies, and those are asked who could not be reached before


def ask_all(
    session: zenoh.Session,
    keys: SwarmKeys,
    what: str,
    robots: Iterable[str],
    timeout_s: float,
    clock: Clock | None = None,
) -> dict[str, str | None]:
    """Each robot's reply by its name: "stopped", a JSON text, or what went wrong there; None if none came in time.

    Nobody waits for another. Links may still be on their way up: who cannot be reached is asked until the time is over.
    """
    clock = clock or WallClock()
    replies: dict[str, str | None] = dict.fromkeys(robots)
    asked: dict[str, zenoh.Handler[zenoh.Reply]] = {}
    end_ns = clock.now_ns() + to_ns(timeout_s)
    while missing := [robot for robot, reply in replies.items() if reply is None]:
        left_ns = end_ns - clock.now_ns()
        if left_ns <= 0:
            break
        for robot in missing:
            if robot not in asked:
                asked[robot] = session.get(
                    keys.control(robot), target=zenoh.QueryTarget.ALL, payload=what, timeout=to_s(left_ns)
                )
        clock.sleep_until(min(clock.now_ns() + POLL_NS, end_ns))
        for robot in missing:
            try:
                replies[robot] = _reply(asked[robot].try_recv())
            except zenoh.ZError:  # nobody answers, or not any more
                del asked[robot]
    return replies


def _reply(answer: zenoh.Reply | None) -> str | None:
    """What a robot replied, if it did; that the time is over zenoh tells as an error."""
    if answer is None:
        return None
    if answer.ok is not None:
        return answer.ok.payload.to_string()
    error = answer.err.payload.to_string() if answer.err else ""
    return None if error == "Timeout" else error
