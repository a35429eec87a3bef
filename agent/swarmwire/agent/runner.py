"""A runner: a process that plays some robots of a world behind zenoh, in lockstep or in real time.

It joins (gets robots), declares its token, builds the agents, says "ready", then answers `tick` frames with one
`actions` frame each until the world says "end" or is gone, or until it is asked to leave, which it says. In real time
`packets` frames may come between ticks: agents that read between their steps answer with a `sent` frame, for all others
they wait for the tick. All that arrives lands in one queue, put there by the network thread itself: no Python thread
per subscription, so a runner stays small. Where the world keeps memory, each answer carries what the agents remember.
"""

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

# zenoh's stubs leave out the return types of put, reply and close.


JOIN_S = 60.0  # for each step: as long as a world waits for the next runner to join
POLL_S = 5.0  # for the world, each time
FAREWELL_S = 3.0
NO_ROBOTS = ""
TIMED_OUT = "Timeout"  # what zenoh says for a world that says nothing
NO_ANSWER = f"the world did not answer to join within {JOIN_S:g} s: it stands still, or this machine is too busy"


class Ended(NamedTuple):
    """How a runner's play ended."""

    how: Literal["over", "left", "let go", "gone"]
    why: str = ""  # it was let go


@dataclass(frozen=True)
class Asked:
    """What a runner asks for when it joins, and its own agents."""

    request: JoinRequest = field(default_factory=JoinRequest)
    agents: Mapping[str, str] = field(default_factory=dict[str, str])  # spec by group; else as the world names them


PLAIN = Asked()  # the next part that is free, with the world's own agents


def run(endpoint: str, run_id: str, runner: str, joined: Callable[[Assignment], None] = lambda _: None) -> Ended:
    """Play robots of the run at `endpoint` until it ends; RunnerLost if there is no world or it gives no robots."""
    try:
        session = open_runner(endpoint, JOIN_S)
    except zenoh.ZError as error:
        reason = str(error).split(" at ")[0]
        raise RunnerLost(runner, NO_ROBOTS, f"no connection to its world within {JOIN_S:g} s: {reason}") from error
    with closed_after(session):
        return play(session, Keys(run_id), runner, TickInbox(), lambda: PLAIN, joined)


def play(
    session: zenoh.Session,
    keys: Keys,
    runner: str,
    inbox: "TickInbox",
    asked: Callable[[], Asked],
    joined: Callable[[Assignment], None] = lambda _: None,
) -> Ended:
    """Play robots of a run. `asked` is called once its world is there, `joined` when it gave robots.

    RunnerLost if there is no world or it gives no robots.
    """
    declared = (  # zenoh takes back what nobody holds on to
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
    """What arrives from the world, put in by the network thread: frames, and whether the world is there.

    Attributes:
        dropped: frames that were no tick to come, or not acted on since a newer one was there.
        missed: frames with packets that never came.
        ended: how it ended; meaningless before.
    """

    def __init__(self) -> None:
        self._arrived: queue.SimpleQueue[zenoh.Sample | bool | None] = queue.SimpleQueue()
        self.put_frame = self._arrived.put
        self.dropped = self.missed = 0
        self._next_packets = 0  # the number of the next frame with packets
        self.ended = Ended("gone")

    def leave(self) -> None:
        """End the play before its time; may be called from a signal's handler, and before it began."""
        self._arrived.put(None)

    def put_token(self, token: zenoh.Sample) -> None:
        """The world's liveliness token appeared or vanished."""
        self._arrived.put(token.kind == zenoh.SampleKind.PUT)

    def wait_for_world(self, timeout_s: float) -> bool | None:
        """Whether the world's token appeared or vanished, None: neither; it declares it last, when it can answer."""
        try:
            while not isinstance(arrived := self._arrived.get(timeout=timeout_s), bool):
                if arrived is None:
                    raise KeyboardInterrupt
                self.dropped += 1
        except queue.Empty:
            return None
        return arrived

    def forget_frames(self) -> None:
        """Drop what the world sent before it gave robots: to another runner of this name, which it lost."""
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
        """What the newest tick brings, each time, until the world says "end" or is gone; lockstep has but one.

        What comes between ticks goes to `receive`; where no newer tick is there, its tick and time are given out.
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
                told = decode_tick(frame, measures, rows.keys())
                check_rows(told[0], told[1], rows)
            except BadFrame:
                self.dropped += 1
                continue
            self.dropped += newest is not None
            newest, tick = (frame.tick, *told), frame.tick

    def wait_for_farewell(self) -> None:
        """Until the world says that it has read that the runner left, or is gone; not for long."""
        with suppress(queue.Empty, BadFrame):
            while arrived := self._arrived.get(timeout=FAREWELL_S):
                if not isinstance(arrived, bool) and frames.decode(arrived.payload.to_bytes()).kind == "end":
                    return


def _watched_world(session: zenoh.Session, keys: Keys, inbox: TickInbox) -> "zenoh.Subscriber[None] | None":
    """What tells of the world's token, which is there; None: it did not appear in time.

    Where very many come at once, zenoh now and then tells one of them nothing of a token that is there: it asks again.
    """
    for _ in range(round(JOIN_S / POLL_S)):
        watched = session.liveliness().declare_subscriber(
            keys.world, Callback(inbox.put_token, indirect=False), history=True
        )
        there = inbox.wait_for_world(POLL_S)
        if there is not None:
            return watched if there else None
        watched.undeclare()
    return None


def _end(frame: frames.Frame) -> Ended:
    why = frame.values.get("why")
    return Ended("let go", why) if isinstance(why, str) else Ended("over")


def _join(session: zenoh.Session, keys: Keys, runner: str, asked: Asked) -> tuple[Assignment, Memory | None]:
    """The robots that the world gives, and what is remembered of them; None: nothing is to be kept."""
    for reply in session.get(keys.join(runner), payload=asked.request.encode(), timeout=JOIN_S):
        if reply.ok is None:
            why = reply.err.payload.to_string() if reply.err else TIMED_OUT
            raise RunnerLost(runner, NO_ROBOTS, NO_ANSWER if why == TIMED_OUT else why)
        try:
            assignment, kept = given_robots(reply.ok.payload.to_bytes(), asked.agents)
        except BadFrame as fault:
            raise RunnerLost(runner, NO_ROBOTS, f"the world's answer to join is none: {fault}") from fault
        return assignment, kept
    raise RunnerLost(runner, NO_ROBOTS, "the world did not answer to join")


def given_robots(data: bytes, agents: Mapping[str, str] = PLAIN.agents) -> tuple[Assignment, Memory | None]:
    """The robots that a world gives, and what is remembered of them; BadFrame if these bytes tell none.

    `agents` are the runner's own, by group.
    """
    given = versioned(data, frames.MAX_BYTES)
    assignment, memory = Assignment.from_mapping(given).with_agents(agents), given.get("memory")
    if memory is not None and not isinstance(memory, bytes):
        raise BadFrame("malformed", "memory: expected a frame")
    return assignment, None if memory is None else _memory(assignment, memory)


def _memory(assignment: Assignment, data: bytes) -> Memory:
    """What earlier agents remembered; nothing of those whose memory does not fit these agents, or that is of others."""
    frame = frames.decode(data)
    memory: Memory = {}
    for group in assignment.groups:
        with suppress(BadFrame, NoAgent):  # without memory it starts afresh, and a missing agent is told of later
            found = decode_memory(frame, {group.name: layout_of(load_agent(group.agent))})
            if all(np.isin(of.rows, group.rows).all() for of in found.values()):
                memory |= found
    return memory


def answers(assignment: Assignment, memory: Memory | None, inbox: TickInbox) -> Iterator[bytes]:
    """A frame "ready", then an answer to every tick; a failure, if there is one, is the last."""
    try:
        host = AgentExecutor(assignment, memory)
        yield frames.encode("ready", -1, {})
        for told in inbox.ticks(assignment, host.receive):
            if len(told) == 2:
                if len(sent := host.on_receive(*told)):
                    missed, inbox.missed = inbox.missed, 0
                    yield encode_sent(told[0], sent, missed)
                continue
            tick, readings, received, tx_status = told
            actions = host.act(tick, readings, received, tx_status)
            dropped, inbox.dropped = inbox.dropped, 0
            yield encode_actions(tick, actions, dropped, None if memory is None else host.memory(readings))
        return
    except AgentFailed as error:
        failure = {"robots": error.robots, "traceback": error.traceback}
    except Exception:  # noqa: BLE001 - whatever it is, the world must learn of it
        failure = {"robots": assignment.robots_text, "traceback": traceback.format_exc()}
    yield frames.encode("failed", -1, {}, failure)
    # The world must read this before the runner's token vanishes, or it would report a lost runner instead.
    for _ in inbox.ticks(assignment):
        continue
