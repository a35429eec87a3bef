"""An agent host: it runs agents of some robots of a world in processes of their own, in lockstep or in real time.

To the world it is one runner: `RunnerProtocol` decides, and this adapter carries the bytes over one zenoh session.
`play` declares the runner's liveliness token, finds the world, joins, has its `AgentProcesses` act, and answers.
zenoh's thread puts all that arrives into one queue (`Arrivals`), and wakes the loop that also waits for the processes.
"""

# zenoh's stubs leave out the return types of put, reply and close.
# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import os
import queue
import select
from collections.abc import Callable
from contextlib import closing, suppress
from typing import cast

import numpy as np
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.host_processes import AgentProcess, AgentProcesses, Lost, ProcessAnswer
from swarmwire.agent.process_answers import in_order
from swarmwire.agent.runner_protocol import (
    WITH_ROBOTS,
    Assigned,
    Ended,
    JoinOptions,
    PacketsBetween,
    PacketsReceived,
    RunnerProtocol,
    Tick,
)
from swarmwire.comms.base.clock import WallClock, to_ns, to_s
from swarmwire.comms.base.errors import BadFrame, RunnerLost
from swarmwire.comms.wire.keys import Keys, run_of
from swarmwire.comms.wire.sessions import closed_after, open_runner

JOIN_TIMEOUT_S = 60.0  # of each step: as long as a world waits for the next runner to join
POLL_S = 5.0  # for the world's token
CHECK_S = 0.5  # between two checks of the processes' time
FAREWELL_TIMEOUT_S = 3.0  # for the world to confirm that the runner leaves
NO_ROBOTS = ""
TIMED_OUT = "Timeout"  # zenoh's error for a world that does not answer
NO_ANSWER = (
    f"the world did not answer to join within {JOIN_TIMEOUT_S:g} s: it stands still, or this machine is too busy"
)
NEXT_FREE = JoinOptions()  # all free robots, with the world's agents


class Arrivals:
    """All that arrives at a runner, in its order: frames, changes of the world's token, and the request to leave."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[zenoh.Sample | bool | None] = queue.SimpleQueue()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK)

    def fileno(self) -> int:
        """The file that is readable once something has arrived."""
        return self._wake

    def put_frame(self, frame: zenoh.Sample) -> None:
        """Add a frame of the world."""
        self._put(frame)

    def put_token(self, token: zenoh.Sample) -> None:
        """Add that the world's liveliness token appeared or vanished."""
        self._put(token.kind == zenoh.SampleKind.PUT)

    def leave(self) -> None:
        """Leave the run; may be called from a signal handler, and before the start."""
        self._put(None)

    def _put(self, arrival: zenoh.Sample | bool | None) -> None:
        self._queue.put(arrival)
        os.eventfd_write(self._wake, 1)

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

    def pass_on_all(self, protocol: RunnerProtocol) -> list[bytes]:
        """Pass all arrivals to the protocol: the frames to put."""
        with suppress(BlockingIOError):
            os.eventfd_read(self._wake)
        out = [self.pass_on(protocol) for _ in range(self._queue.qsize())]
        return [data for data in out if data is not None]

    def pass_on_frames(self, protocol: RunnerProtocol) -> None:
        """Pass all frames that have arrived to the protocol; the rest stays."""
        for _ in range(self._queue.qsize()):
            arrived = self._queue.get()
            if arrived is None or isinstance(arrived, bool):
                self._put(arrived)
            else:
                protocol.receive_frame(arrived.payload.to_bytes())


def run(
    endpoint: str,
    run_id: str,
    runner: str,
    server: ForkServer,
    processes: int | None = None,
) -> Ended:
    """Run robots of the run at `endpoint` to its end; RunnerLost without a world, or if it assigns no robots."""
    try:
        session = open_runner(endpoint, JOIN_TIMEOUT_S)
    except zenoh.ZError as error:
        reason = str(error).split(" at ")[0]
        raise RunnerLost(
            runner, NO_ROBOTS, f"no connection to its world within {JOIN_TIMEOUT_S:g} s: {reason}"
        ) from error
    with closed_after(session):
        return play(session, Keys(run_id), runner, Arrivals(), lambda: NEXT_FREE, server, processes)


def play(
    session: zenoh.Session,
    keys: Keys,
    runner: str,
    arrivals: Arrivals,
    options: Callable[[], JoinOptions],
    server: ForkServer,
    processes: int | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Ended:
    """Run robots of a run in so many processes; None: one per robot.

    `options` is called once its world is there. `say` gets messages for the user: its robots, and those that it loses.

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
    say(f"{runner}: joined run {run_of(keys.world)} with {assigned.assignment.robots_text}")
    publisher = session.declare_publisher(
        keys.answer(runner), congestion_control=zenoh.CongestionControl.BLOCK, express=True
    )
    server.load(sorted({group.agent for group in assigned.assignment.groups}))
    host = AgentHost(protocol, assigned, server, processes, say)
    try:
        ended = host.play(arrivals, cast(Callable[[bytes], None], publisher.put))
    finally:
        host.close()
    del declared, watched
    return ended


class AgentHost:
    """The processes of a host, and the frames that it owes to the world."""

    def __init__(
        self,
        protocol: RunnerProtocol,
        assigned: Assigned,
        server: ForkServer,
        processes: int | None,
        say: Callable[[str], None],
    ) -> None:
        self._protocol, self._clock, self._say = protocol, WallClock(), say
        robots = sum(len(group.rows) for group in assigned.assignment.groups)
        count, now_ns = processes or robots, self._clock.now_ns()
        self._processes = AgentProcesses(server, assigned.assignment, count, assigned.memory, assigned.layouts, now_ns)
        self._restarts = assigned.memory is not None  # the world lets runners take lost robots over
        self._timeout_ns = to_ns(assigned.timeout_s)
        self._within_ns = None if assigned.answer_within_s is None else to_ns(assigned.answer_within_s)
        self._tick: Tick | None = None  # that is open
        self._opened_ns = 0
        self._asked: set[AgentProcess] = set()  # processes whose answer to it is missing
        self._answers: list[ProcessAnswer] = []  # to it

    def close(self) -> None:
        """End the processes."""
        self._processes.close()

    def play(self, arrivals: Arrivals, put: Callable[[bytes], object]) -> Ended:
        """Answer the world until the end."""
        stays_until_ns = 0  # once it leaves
        with closing(select.epoll()) as files:
            for file in (arrivals.fileno(), self._processes.fileno()):
                files.register(file, select.EPOLLIN)
            while True:
                if self._protocol.state != "leaving":
                    stays_until_ns = self._clock.now_ns() + to_ns(FAREWELL_TIMEOUT_S)
                elif self._clock.now_ns() > stays_until_ns:
                    self._protocol.leave()  # the world does not confirm it
                readable = {file for file, _ in files.poll(self._wait_s())}
                if arrivals.fileno() in readable:
                    for data in arrivals.pass_on_all(self._protocol):
                        put(data)
                for data in self._read() + self._check_time():
                    put(data)
                while (event := self._protocol.next_event()) is not None:
                    if isinstance(event, Ended):
                        return event
                    self._act(event)
                    for data in self._complete():
                        put(data)

    def _wait_s(self) -> float:
        """The time until something has to be checked."""
        if self._within_ns is None or not self._asked or self._protocol.state != "acting":
            return CHECK_S
        return max(0.0, min(CHECK_S, to_s(self._opened_ns + self._within_ns - self._clock.now_ns())))

    def _act(self, event: Tick | PacketsReceived | PacketsBetween) -> None:
        now_ns = self._clock.now_ns()
        match event:
            case Tick(tick, readings, received, tx_status):
                self._tick, self._answers, self._opened_ns = event, [], now_ns
                self._asked = set(self._processes.tick(tick, now_ns, readings, received, tx_status))
            case PacketsReceived(received, tx_status, tick, at_ns):
                self._processes.packets(tick, at_ns, now_ns, received, tx_status)
            case PacketsBetween():  # the processes have the packets already
                pass

    def _read(self) -> list[bytes]:
        """Take in what the processes sent: frames for the world."""
        out: list[bytes] = []
        for event in self._processes.events(self._clock.now_ns()):
            if self._protocol.state not in WITH_ROBOTS:  # the world has ended this runner, or it leaves
                continue
            match event:
                case ProcessAnswer():
                    out += self._answered(event)
                case Lost():
                    out.append(self._lost(event))
        if self._protocol.state == "joined" and self._processes.are_ready:
            out.append(self._protocol.ready(len(self._processes)))
        return out + self._complete()

    def _answered(self, answer: ProcessAnswer) -> list[bytes]:
        if (
            answer.process in self._asked
            and self._tick is not None
            and answer.tick == self._tick.tick
            and answer.is_step
        ):
            self._asked.discard(answer.process)
            self._answers.append(answer)
            return []
        actions, memory, lost = self._processes.read([answer])
        if lost:
            return [self._lost(of) for of in lost]
        if answer.is_step:  # of an earlier tick, in real time
            return [self._protocol.answer_late(answer.tick, actions, memory)]
        return [self._protocol.send(answer.tick, actions.sent)] if len(actions.sent) else []

    def _lost(self, lost: Lost) -> bytes:
        process, reason, failed, traceback, is_own_end = lost
        self._asked.discard(process)
        self._answers = [answer for answer in self._answers if answer.process is not process]
        if is_own_end and self._restarts and self._processes.restart(process, self._clock.now_ns()):
            return self._restarted(process, reason)
        self._say(f"lost {process.assignment.robots_text}: {reason}" + (f"\n{traceback.rstrip()}" if traceback else ""))
        return self._protocol.lose(process.rows, str(process.number), reason, failed, traceback)

    def _restarted(self, process: AgentProcess, reason: str) -> bytes:
        """The open tick goes to the process again: its memory is from before it."""
        self._say(f"restarted {process.assignment.robots_text}: {reason}")
        if self._tick is not None:
            tick, readings, received, tx_status = self._tick
            now_ns = self._clock.now_ns()
            self._asked |= set(self._processes.tick(tick, now_ns, readings, received, tx_status, process))
        return self._protocol.restart(process.rows, str(process.number), reason)

    def _check_time(self) -> list[bytes]:
        """Lose processes that are silent; in real time, leave out those that are late."""
        now_ns, out = self._clock.now_ns(), list[bytes]()
        if self._protocol.state not in WITH_ROBOTS:
            return out
        for process in self._processes.silent(now_ns, self._timeout_ns):
            out.append(self._lost(self._processes.lose(process, f"no answer for {to_s(self._timeout_ns):g} s")))
        if self._within_ns is not None and now_ns - self._opened_ns >= self._within_ns:
            self._asked.clear()
        return out + self._complete()

    def _complete(self) -> list[bytes]:
        """The answer to the open tick, once no process is missing, after the losses of processes at fault."""
        if self._tick is None or self._asked or not self._processes or self._protocol.state != "acting":
            return []
        actions, memory, lost = self._processes.read(self._answers)
        out = [self._lost(of) for of in lost]
        if not self._processes:
            return out
        wanted = np.concatenate([np.empty(0, np.int64), *(group.rows for group in self._tick.readings.values())])
        self._tick = None
        return [*out, self._protocol.answer(in_order(actions, wanted), memory)]


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
