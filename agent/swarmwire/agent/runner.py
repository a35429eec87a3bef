"""The runner of an agent host: it joins a world, and carries frames between the world and `AgentHost` over zenoh.

`run_in_session` declares the runner's liveliness token, finds the world, joins, and runs an `AgentHost` to the end.
zenoh's thread puts all arrivals into one queue (`Arrivals`), and wakes the loop that also waits for the agent
processes.
"""

# zenoh's stubs leave out the return types of put, reply and close.
# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import os
import queue
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple, cast

import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.host_loop import AgentHost
from swarmwire.agent.runner_protocol import Ended, JoinOptions, RunnerProtocol
from swarmwire.comms.base.errors import BadFrame, RunnerLost
from swarmwire.comms.wire.keys import Keys, run_of
from swarmwire.comms.wire.sessions import closed_after, open_runner

JOIN_TIMEOUT_S = 60.0  # limit of each step; a world also waits 60 s for the next runner to join
POLL_S = 5.0  # interval of requests for the world's token
UNASSIGNED = ""  # robots of a runner that is lost before the assignment
TIMED_OUT = "Timeout"  # zenoh's error for a world that does not answer
NO_ANSWER = (
    f"the world did not answer to join within {JOIN_TIMEOUT_S:g} s: it stands still, or this machine is too busy"
)
NEXT_FREE = JoinOptions()  # all free robots, with the world's agents


class Arrivals:
    """The queue of arrivals at a runner: frames, changes of the world's token, and the request to leave."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[zenoh.Sample | bool | None] = queue.SimpleQueue()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK)

    def fileno(self) -> int:
        """Return the file that is readable once there are arrivals."""
        return self._wake

    def put_frame(self, frame: zenoh.Sample) -> None:
        """Add a frame of the world."""
        self._put(frame)

    def put_token(self, token: zenoh.Sample) -> None:
        """Add a change of the world's liveliness token: it appeared or vanished."""
        self._put(token.kind == zenoh.SampleKind.PUT)

    def leave(self) -> None:
        """Leave the run; may be called from a signal handler, and before the start."""
        self._put(None)

    def _put(self, arrival: zenoh.Sample | bool | None) -> None:
        self._queue.put(arrival)
        os.eventfd_write(self._wake, 1)

    def pass_on(self, protocol: RunnerProtocol, timeout_s: float | None = None) -> bytes | None:
        """Pass the next arrival to the protocol; return a frame to put, or None. queue.Empty after the time-out."""
        arrival = self._queue.get(timeout=timeout_s)
        if arrival is None:
            return protocol.leave()
        if isinstance(arrival, bool):
            protocol.world_present(arrival)
        else:
            protocol.receive_frame(arrival.payload.to_bytes())
        return None

    def pass_on_all(self, protocol: RunnerProtocol) -> list[bytes]:
        """Pass all arrivals to the protocol; return the frames to put."""
        with suppress(BlockingIOError):
            os.eventfd_read(self._wake)
        frames = [self.pass_on(protocol) for _ in range(self._queue.qsize())]
        return [data for data in frames if data is not None]

    def pass_on_frames(self, protocol: RunnerProtocol) -> None:
        """Pass all frames that have arrived to the protocol; other arrivals stay in the queue."""
        for _ in range(self._queue.qsize()):
            arrival = self._queue.get()
            if arrival is None or isinstance(arrival, bool):
                self._put(arrival)
            else:
                protocol.receive_frame(arrival.payload.to_bytes())


class ProcessPool(NamedTuple):
    """The agent processes that a runner may have, and its way to report to the user."""

    server: ForkServer
    processes: int | None = None  # None: one per robot
    report: Callable[[str], None] = lambda _: None  # prints robots that were assigned, lost and restarted


def run(endpoint: str, run_id: str, runner: str, pool: ProcessPool) -> Ended:
    """Run agents for the run at `endpoint` to its end; RunnerLost without a world, or if it assigns no robots."""
    try:
        session = open_runner(endpoint, JOIN_TIMEOUT_S)
    except zenoh.ZError as error:
        reason = str(error).split(" at ")[0]
        raise RunnerLost(
            runner, UNASSIGNED, f"no connection to its world within {JOIN_TIMEOUT_S:g} s: {reason}"
        ) from error
    with closed_after(session):
        return run_in_session(session, Keys(run_id), runner, Arrivals(), lambda: NEXT_FREE, pool)


def run_in_session(
    session: zenoh.Session,
    keys: Keys,
    runner: str,
    arrivals: Arrivals,
    options: Callable[[], JoinOptions],
    pool: ProcessPool,
) -> Ended:
    """Run the agents that a world assigns, to the end of the run; RunnerLost without a world, or without robots.

    `options` is called once the world is found.
    """
    protocol = RunnerProtocol()
    declarations = (  # zenoh undeclares objects without a reference
        session.declare_subscriber(keys.frame(runner), Callback(arrivals.put_frame, indirect=False)),
        session.liveliness().declare_token(keys.alive(runner)),
    )
    subscriber = _await_world(session, keys, arrivals, protocol)
    if subscriber is None:
        raise RunnerLost(runner, UNASSIGNED, f"there is no run {run_of(keys.world)}, or it does not let {runner} in")
    reply = _request_robots(session, keys, runner, protocol.join(options()))
    arrivals.pass_on_frames(protocol)  # frames for a lost runner of the same name
    try:
        assigned = protocol.receive_assignment(reply)
    except BadFrame as fault:
        raise RunnerLost(runner, UNASSIGNED, f"the world's answer to join is malformed: {fault}") from fault
    pool.report(f"{runner}: joined run {run_of(keys.world)} with {assigned.assignment.robots_text}")
    publisher = session.declare_publisher(
        keys.answer(runner), congestion_control=zenoh.CongestionControl.BLOCK, express=True
    )
    pool.server.load(sorted({group.agent for group in assigned.assignment.groups}))
    host = AgentHost(protocol, assigned, pool.server, pool.processes, pool.report)
    try:
        ended = host.run(arrivals, cast(Callable[[bytes], None], publisher.put))
    finally:
        host.close()
    del declarations, subscriber
    return ended


def _await_world(
    session: zenoh.Session, keys: Keys, arrivals: Arrivals, protocol: RunnerProtocol
) -> "zenoh.Subscriber[None] | None":
    """Wait for the world; return a subscriber to its token, or None if it did not appear in time.

    When very many runners join at once, zenoh sometimes does not report an existing token: the runner asks again.
    """
    for _ in range(round(JOIN_TIMEOUT_S / POLL_S)):
        subscriber = session.liveliness().declare_subscriber(
            keys.world, Callback(arrivals.put_token, indirect=False), history=True
        )
        with suppress(queue.Empty):
            while protocol.state == "searching":
                arrivals.pass_on(protocol, POLL_S)
            if protocol.next_event() == Ended("left"):
                raise KeyboardInterrupt
            return subscriber if protocol.state == "joining" else None
        subscriber.undeclare()
    return None


def _request_robots(session: zenoh.Session, keys: Keys, runner: str, request: bytes) -> bytes:
    """Return the world's reply to a request for robots; RunnerLost if it refuses, or does not answer."""
    for reply in session.get(keys.join(runner), payload=request, timeout=JOIN_TIMEOUT_S):
        if reply.ok is not None:
            return reply.ok.payload.to_bytes()
        reason = reply.err.payload.to_string() if reply.err else TIMED_OUT
        raise RunnerLost(runner, UNASSIGNED, NO_ANSWER if reason == TIMED_OUT else reason)
    raise RunnerLost(runner, UNASSIGNED, "the world did not answer to join")
