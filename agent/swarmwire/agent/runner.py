"""A runner: a process that runs the agents of some robots of a world, over zenoh, in lockstep or in real time.

A runner joins (the world assigns robots), declares its liveliness token, makes the agents and sends "ready". Then it
answers each `tick` frame with one `actions` frame until the world sends "end" or is gone, or until it is asked to
leave, which it announces. In real time `packets` frames may arrive between ticks: agents that define `on_receive`
answer with a `sent` frame, and for all others the packets wait for the tick. Where the world keeps memory, each answer
carries the memory of the robots.

The network thread puts all that arrives into one queue (`TickInbox`): there is no Python thread per subscription, so a
runner stays small.
"""

# zenoh's stubs leave out the return types of put, reply and close.
# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import math
import queue
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.agent import NoAgent, load_agent
from swarmwire.agent.host import AgentExecutor, layout_of
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import AgentFailed, BadFrame, RunnerLost
from swarmwire.comms.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.tick_io import Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import Memory, decode_memory
from swarmwire.comms.wire.join import JoinRequest, versioned
from swarmwire.comms.wire.keys import Keys, run_of
from swarmwire.comms.wire.sessions import closed_after, open_runner
from swarmwire.comms.wire.tick_frames import check_rows, decode_packets, decode_tick, encode_actions, encode_sent

JOIN_TIMEOUT_S = 60.0  # of each step: as long as a world waits for the next runner to join
POLL_S = 5.0  # for the world's token
FAREWELL_TIMEOUT_S = 3.0
NO_ROBOTS = ""
TIMED_OUT = "Timeout"  # zenoh's error for a world that does not answer
NO_ANSWER = (
    f"the world did not answer to join within {JOIN_TIMEOUT_S:g} s: it stands still, or this machine is too busy"
)


class Ended(NamedTuple):
    """The end of a runner: the run is over, it left, the world removed it, or the world is gone."""

    how: Literal["over", "left", "let go", "gone"]
    why: str = ""  # the world's reason, if it removed the runner


@dataclass(frozen=True)
class Asked:
    """A runner's request to join, and its own agents."""

    request: JoinRequest = field(default_factory=JoinRequest)
    agents: Mapping[str, str] = field(default_factory=dict[str, str])  # spec by group, in place of the world's


NEXT_FREE = Asked()  # the next free part, with the world's agents


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
        return play(session, Keys(run_id), runner, TickInbox(), lambda: NEXT_FREE, joined)


def play(
    session: zenoh.Session,
    keys: Keys,
    runner: str,
    inbox: "TickInbox",
    asked: Callable[[], Asked],
    joined: Callable[[Assignment], None] = lambda _: None,
) -> Ended:
    """Run robots of a run. `asked` is called once its world is there, `joined` when it has assigned robots.

    RunnerLost without a world, or if it assigns no robots.
    """
    declared = (  # zenoh undeclares objects without a reference
        session.declare_subscriber(keys.frame(runner), Callback(inbox.put_frame, indirect=False)),
        session.liveliness().declare_token(keys.alive(runner)),
    )
    watched = _watched_world(session, keys, inbox)
    if watched is None:
        raise RunnerLost(runner, NO_ROBOTS, f"there is no run {run_of(keys.world)}, or it does not let {runner} in")
    assignment, memory = _join(session, keys, runner, asked())
    inbox.forget_frames()
    joined(assignment)
    answer = session.declare_publisher(
        keys.answer(runner), congestion_control=zenoh.CongestionControl.BLOCK, express=True
    )
    for data in answers(assignment, memory, inbox):
        answer.put(data)
    if inbox.ended.how == "left":
        answer.put(frames.encode("leave", -1, {}))
        inbox.wait_for_farewell()  # the world must read this before the runner's token vanishes, as below
    del declared, watched
    return inbox.ended


class TickInbox:
    """The queue of a runner, filled by the network thread: frames of the world, and changes of its token.

    Attributes:
        dropped: frames that were malformed or out of order, or replaced by a newer tick before they were acted on.
        missed: `packets` frames that never arrived.
        ended: how the run ended; meaningless before.
    """

    def __init__(self) -> None:
        self._arrived: queue.SimpleQueue[zenoh.Sample | bool | None] = queue.SimpleQueue()
        self.put_frame = self._arrived.put
        self.dropped = self.missed = 0
        self._next_packets = 0  # the number of the next frame with packets
        self.ended = Ended("gone")

    def leave(self) -> None:
        """Leave the run; may be called from a signal handler, and before the start."""
        self._arrived.put(None)

    def put_token(self, token: zenoh.Sample) -> None:
        """The world's liveliness token appeared or vanished."""
        self._arrived.put(token.kind == zenoh.SampleKind.PUT)

    def wait_for_world(self, timeout_s: float) -> bool | None:
        """True if the world's token appeared, False if it vanished, None at a timeout. A world declares it last."""
        try:
            while not isinstance(arrived := self._arrived.get(timeout=timeout_s), bool):
                if arrived is None:
                    raise KeyboardInterrupt
                self.dropped += 1
        except queue.Empty:
            return None
        return arrived

    def forget_frames(self) -> None:
        """Drop the frames from before the assignment: they were for a lost runner of the same name."""
        for _ in range(self._arrived.qsize()):
            arrived = self._arrived.get()
            if arrived is None or isinstance(arrived, bool):
                self._arrived.put(arrived)
            else:
                self.dropped += 1

    def ticks(
        self,
        assignment: Assignment,
        receive: Callable[[ReceivedPackets, TxStatuses], None] = lambda _received, _tx_status: None,
    ) -> Iterator[tuple[int, Readings, ReceivedPackets, TxStatuses] | tuple[int, int]]:
        """The newest tick's inputs, each time, until the world sends "end" or is gone; in lockstep there is only one.

        Packets between ticks go to `receive`; unless a newer tick has arrived, their tick and time are yielded.
        """
        measures, rows = assignment.measures or (), {group.name: group.rows for group in assignment.groups}
        every = math.gcd(*(group.act_every_ticks for group in assignment.groups))
        newest: tuple[int, Readings, ReceivedPackets, TxStatuses] | None = None
        between: tuple[int, int] | None = None
        tick = -1
        while True:
            if newest is not None and self._arrived.empty():
                yield newest
                newest = between = None
            if between is not None and self._arrived.empty():
                yield between
                between = None
            arrived = self._arrived.get()
            if arrived is None:
                self.ended = Ended("left")
                return
            if isinstance(arrived, bool):
                if not arrived:
                    self.ended = Ended("gone")
                    return
                continue
            try:
                frame = frames.decode(arrived.payload.to_bytes())
                if frame.kind == "end":
                    self.ended = _end(frame)
                    return
                if frame.kind == "packets":
                    at_ns, number, received, tx_status = decode_packets(frame, measures)
                    self.missed += max(0, number - self._next_packets)
                    self._next_packets = number + 1
                    receive(received, tx_status)
                    between = frame.tick, at_ns
                    continue
                if frame.kind != "tick" or frame.tick <= tick or frame.tick % every:
                    raise BadFrame("wrong_tick", f"{frame.kind} {frame.tick}")
                readings, received, tx_status = decode_tick(frame, measures, rows.keys())
                check_rows(readings, received, rows)
            except BadFrame:
                self.dropped += 1
                continue
            self.dropped += newest is not None
            newest, tick = (frame.tick, readings, received, tx_status), frame.tick

    def wait_for_farewell(self) -> None:
        """Wait, for a short time, until the world confirms that the runner left, or is gone."""
        with suppress(queue.Empty, BadFrame):
            while arrived := self._arrived.get(timeout=FAREWELL_TIMEOUT_S):
                if not isinstance(arrived, bool) and frames.decode(arrived.payload.to_bytes()).kind == "end":
                    return


def _watched_world(session: zenoh.Session, keys: Keys, inbox: TickInbox) -> "zenoh.Subscriber[None] | None":
    """A subscriber to the world's token, once it is there; None if it did not appear in time.

    When very many runners join at once, zenoh sometimes does not report an existing token: the runner asks again.
    """
    for _ in range(round(JOIN_TIMEOUT_S / POLL_S)):
        watched = session.liveliness().declare_subscriber(
            keys.world, Callback(inbox.put_token, indirect=False), history=True
        )
        present = inbox.wait_for_world(POLL_S)
        if present is not None:
            return watched if present else None
        watched.undeclare()
    return None


def _end(frame: frames.Frame) -> Ended:
    why = frame.values.get("why")
    return Ended("let go", why) if isinstance(why, str) else Ended("over")


def _join(session: zenoh.Session, keys: Keys, runner: str, asked: Asked) -> tuple[Assignment, Memory | None]:
    """The robots that the world assigns, and their memory; None: the world keeps no memory."""
    for reply in session.get(keys.join(runner), payload=asked.request.encode(), timeout=JOIN_TIMEOUT_S):
        if reply.ok is None:
            why = reply.err.payload.to_string() if reply.err else TIMED_OUT
            raise RunnerLost(runner, NO_ROBOTS, NO_ANSWER if why == TIMED_OUT else why)
        try:
            return assigned_robots(reply.ok.payload.to_bytes(), asked.agents)
        except BadFrame as fault:
            raise RunnerLost(runner, NO_ROBOTS, f"the world's answer to join is none: {fault}") from fault
    raise RunnerLost(runner, NO_ROBOTS, "the world did not answer to join")


def assigned_robots(data: bytes, agents: Mapping[str, str] = NEXT_FREE.agents) -> tuple[Assignment, Memory | None]:
    """The robots that a world assigns, and their memory; BadFrame for malformed bytes.

    `agents` are the runner's own, by group.
    """
    answer = versioned(data, frames.MAX_BYTES)
    assignment, memory = Assignment.from_mapping(answer).with_agents(agents), answer.get("memory")
    if memory is not None and not isinstance(memory, bytes):
        raise BadFrame("malformed", "memory: expected a frame")
    return assignment, None if memory is None else _memory(assignment, memory)


def _memory(assignment: Assignment, data: bytes) -> Memory:
    """The memory of earlier agents, without that which does not fit these agents or is of other robots."""
    frame = frames.decode(data)
    memory: Memory = {}
    for group in assignment.groups:
        with suppress(BadFrame, NoAgent):  # without memory it starts with defaults; a missing agent fails later
            decoded = decode_memory(frame, {group.name: layout_of(load_agent(group.agent))})
            if all(np.isin(of_group.rows, group.rows).all() for of_group in decoded.values()):
                memory |= decoded
    return memory


def answers(assignment: Assignment, memory: Memory | None, inbox: TickInbox) -> Iterator[bytes]:
    """A frame "ready", then an answer to every tick; a failure is the last frame."""
    try:
        executor = AgentExecutor(assignment, memory)
        yield frames.encode("ready", -1, {})
        for inputs in inbox.ticks(assignment, executor.receive):
            if len(inputs) == 2:
                if len(sent := executor.on_receive(*inputs)):
                    missed, inbox.missed = inbox.missed, 0
                    yield encode_sent(inputs[0], sent, missed)
                continue
            tick, readings, received, tx_status = inputs
            actions = executor.act(tick, readings, received, tx_status)
            dropped, inbox.dropped = inbox.dropped, 0
            yield encode_actions(tick, actions, dropped, None if memory is None else executor.memory(readings))
        return
    except AgentFailed as error:
        failure = {"robots": error.robots, "traceback": error.traceback}
    except Exception:  # noqa: BLE001 - whatever it is, the world must learn of it
        failure = {"robots": assignment.robots_text, "traceback": traceback.format_exc()}
    yield frames.encode("failed", -1, {}, failure)
    # The world must read this before the runner's token vanishes, or it would report a lost runner instead.
    for _ in inbox.ticks(assignment):
        continue
