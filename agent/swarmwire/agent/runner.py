"""A runner: a process that runs the agents of some robots of a world, over zenoh, in lockstep or in real time.

`RunnerProtocol` decides, `RunnerAgents` acts; this adapter carries the bytes. `play` declares the runner's liveliness
token, finds the world, joins, and answers frames until the end. zenoh's thread puts all that arrives into one queue
(`Arrivals`): there is no Python thread per subscription, so a runner stays small.
"""

# zenoh's stubs leave out the return types of put, reply and close.
# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import queue
from collections.abc import Callable
from contextlib import suppress

import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.runner_agents import RunnerAgents
from swarmwire.agent.runner_protocol import Assigned, Ended, Event, JoinOptions, RunnerProtocol
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import BadFrame, RunnerLost
from swarmwire.comms.wire.keys import Keys, run_of
from swarmwire.comms.wire.sessions import closed_after, open_runner

JOIN_TIMEOUT_S = 60.0  # of each step: as long as a world waits for the next runner to join
POLL_S = 5.0  # for the world's token
FAREWELL_TIMEOUT_S = 3.0
NO_ROBOTS = ""
TIMED_OUT = "Timeout"  # zenoh's error for a world that does not answer
NO_ANSWER = (
    f"the world did not answer to join within {JOIN_TIMEOUT_S:g} s: it stands still, or this machine is too busy"
)
NEXT_FREE = JoinOptions()  # the next free part, with the world's agents


class Arrivals:
    """All that arrives at a runner, in its order: frames, changes of the world's token, and the request to leave."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[zenoh.Sample | bool | None] = queue.SimpleQueue()
        self.put_frame = self._queue.put

    def put_token(self, token: zenoh.Sample) -> None:
        """Add that the world's liveliness token appeared or vanished."""
        self._queue.put(token.kind == zenoh.SampleKind.PUT)

    def leave(self) -> None:
        """Leave the run; may be called from a signal handler, and before the start."""
        self._queue.put(None)

    def empty(self) -> bool:
        """Whether nothing waits for the protocol."""
        return self._queue.empty()

    def pass_on(self, protocol: RunnerProtocol, timeout_s: float | None = None) -> bytes | None:
        """Pass the next arrival to the protocol: a frame to put, or None. queue.Empty after the time-out."""
        arrived = self._queue.get(timeout=timeout_s)
        if arrived is None:
            return protocol.leave()
        if isinstance(arrived, bool):
            protocol.world_present(arrived)
        else:
            protocol.receive_frame(arrived.payload.to_bytes())
        return None

    def pass_on_frames(self, protocol: RunnerProtocol) -> None:
        """Pass all frames that have arrived to the protocol; the rest stays."""
        for _ in range(self._queue.qsize()):
            arrived = self._queue.get()
            if arrived is None or isinstance(arrived, bool):
                self._queue.put(arrived)
            else:
                protocol.receive_frame(arrived.payload.to_bytes())


def run(endpoint: str, run_id: str, runner: str, joined: Callable[[Assignment], None] = lambda _: None) -> Ended:
    """Run robots of the run at `endpoint` to its end; RunnerLost without a world, or if it assigns no robots."""
    try:
        session = open_runner(endpoint, JOIN_TIMEOUT_S)
    except zenoh.ZError as error:
        reason = str(error).split(" at ")[0]
        raise RunnerLost(
            runner, NO_ROBOTS, f"no connection to its world within {JOIN_TIMEOUT_S:g} s: {reason}"
        ) from error
    with closed_after(session):
        return play(session, Keys(run_id), runner, Arrivals(), lambda: NEXT_FREE, joined)


def play(
    session: zenoh.Session,
    keys: Keys,
    runner: str,
    arrivals: Arrivals,
    options: Callable[[], JoinOptions],
    joined: Callable[[Assignment], None] = lambda _: None,
) -> Ended:
    """Run robots of a run. `options` is called once its world is there, `joined` when it has assigned robots.

    RunnerLost without a world, or if it assigns no robots.
    """
    protocol = RunnerProtocol()
    declared = (  # zenoh undeclares objects without a reference
        session.declare_subscriber(keys.frame(runner), Callback(arrivals.put_frame, indirect=False)),
        session.liveliness().declare_token(keys.alive(runner)),
    )
    watched = _watched_world(session, keys, arrivals, protocol)
    if watched is None:
        raise RunnerLost(runner, NO_ROBOTS, f"there is no run {run_of(keys.world)}, or it does not let {runner} in")
    reply = _request_robots(session, keys, runner, protocol.join(options()))
    arrivals.pass_on_frames(protocol)  # they were for a lost runner of the same name
    try:
        assigned = protocol.receive_assignment(reply)
    except BadFrame as fault:
        raise RunnerLost(runner, NO_ROBOTS, f"the world's answer to join is none: {fault}") from fault
    joined(assigned.assignment)
    publisher = session.declare_publisher(
        keys.answer(runner), congestion_control=zenoh.CongestionControl.BLOCK, express=True
    )
    ended = _play_to_end(protocol, assigned, arrivals, publisher)
    del declared, watched
    return ended


def _play_to_end(protocol: RunnerProtocol, assigned: Assigned, arrivals: Arrivals, publisher: zenoh.Publisher) -> Ended:
    agents = RunnerAgents(protocol, assigned)
    event: Assigned | Event | None = assigned
    while not isinstance(event, Ended):
        data = _next_arrival(protocol, arrivals) if event is None else agents.handle(event)
        if data is not None:
            publisher.put(data)
        event = protocol.next_event() if arrivals.empty() else None
    return event


def _next_arrival(protocol: RunnerProtocol, arrivals: Arrivals) -> bytes | None:
    """Pass on the next arrival: a frame to put, or None."""
    try:
        return arrivals.pass_on(protocol, FAREWELL_TIMEOUT_S if protocol.state == "leaving" else None)
    except queue.Empty:
        return protocol.leave()  # again: the world does not confirm


def _watched_world(
    session: zenoh.Session, keys: Keys, arrivals: Arrivals, protocol: RunnerProtocol
) -> "zenoh.Subscriber[None] | None":
    """A subscriber to the world's token, once it is there; None if it did not appear in time.

    When very many runners join at once, zenoh sometimes does not report an existing token: the runner asks again.
    """
    for _ in range(round(JOIN_TIMEOUT_S / POLL_S)):
        watched = session.liveliness().declare_subscriber(
            keys.world, Callback(arrivals.put_token, indirect=False), history=True
        )
        with suppress(queue.Empty):
            while protocol.state == "searching":
                arrivals.pass_on(protocol, POLL_S)
            if protocol.next_event() == Ended("left"):
                raise KeyboardInterrupt
            return watched if protocol.state == "joining" else None
        watched.undeclare()
    return None


def _request_robots(session: zenoh.Session, keys: Keys, runner: str, request: bytes) -> bytes:
    """The world's reply to a request for robots; RunnerLost if it refuses, or does not answer."""
    for reply in session.get(keys.join(runner), payload=request, timeout=JOIN_TIMEOUT_S):
        if reply.ok is not None:
            return reply.ok.payload.to_bytes()
        why = reply.err.payload.to_string() if reply.err else TIMED_OUT
        raise RunnerLost(runner, NO_ROBOTS, NO_ANSWER if why == TIMED_OUT else why)
    raise RunnerLost(runner, NO_ROBOTS, "the world did not answer to join")
