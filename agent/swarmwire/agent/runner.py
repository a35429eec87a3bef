"""A runner: a process that plays some robots of a world behind zenoh, in lockstep or in real time.

It joins (gets robots), declares its token, builds the agents, says "ready", then answers `tick` frames with one
`actions` frame each until the world says "end" or is gone. In real time `packets` frames may come between ticks: agents
that read between their steps answer with a `sent` frame, for all others they wait for the tick. All that arrives lands
in one queue, put there by the network thread itself: no Python thread per subscription, so a runner stays small.
"""

# zenoh's stubs leave out the return types of put, reply and close.
# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import math
import queue
import traceback
from collections.abc import Callable, Iterator

import msgpack
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.host import Host
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import AgentFailed, BadFrame, RunnerLost
from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import Senses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.closing import closed_after
from swarmwire.comms.wire.in_time_frames import decode_packets, encode_sent
from swarmwire.comms.wire.join_request import JoinRequest
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import open_runner
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions

JOIN_S = 30.0


def run(endpoint: str, run_id: str, runner: str) -> None:
    """Play robots of the run at `endpoint` until it ends; RunnerLost if there is no world or it gives no robots."""
    keys = Keys(run_id)
    with closed_after(open_runner(endpoint)) as session:
        inbox = _Inbox()
        declared = (  # zenoh takes back what nobody holds on to
            session.liveliness().declare_subscriber(
                keys.world, Callback(inbox.put_token, indirect=False), history=True
            ),
            session.declare_subscriber(keys.frame(runner), Callback(inbox.put_frame, indirect=False)),
            session.liveliness().declare_token(keys.alive(runner)),
        )
        assignment = _join(session, keys, runner, inbox)
        answer = session.declare_publisher(
            keys.answer(runner), congestion_control=zenoh.CongestionControl.BLOCK, express=True
        )
        for data in _answers(assignment, inbox):
            answer.put(data)
        del declared


class _Inbox:
    """What arrives from the world, put in by the network thread: frames, and whether the world is there."""

    def __init__(self) -> None:
        self._arrived: queue.SimpleQueue[zenoh.Sample | bool] = queue.SimpleQueue()
        self.put_frame = self._arrived.put
        self.dropped = 0  # frames that were no tick to come, or not acted on since a newer one was there
        self.missed = 0  # frames with packets that never came
        self._next_packets = 0  # the number of the next of these

    def put_token(self, token: zenoh.Sample) -> None:
        """The world's liveliness token appeared or vanished."""
        self._arrived.put(token.kind == zenoh.SampleKind.PUT)

    def wait_for_world(self) -> bool:
        """Whether the world's token appeared in time; it declares it last, when it can answer."""
        try:
            while not isinstance(arrived := self._arrived.get(timeout=JOIN_S), bool):
                self.dropped += 1
        except queue.Empty:
            return False
        return arrived

    def ticks(
        self, assignment: Assignment, receive: Callable[[Heard, Outcomes], None] = lambda _heard, _outcomes: None
    ) -> Iterator[tuple[int, Senses, Heard, Outcomes] | tuple[int, int]]:
        """What the newest tick brings, each time, until the world says "end" or is gone; lockstep has but one.

        What comes between ticks goes to `receive`; where no newer tick is there, its tick and time are given out.
        """
        gives, groups = assignment.gives or (), {group.name for group in assignment.groups}
        every = math.gcd(*(group.act_every_ticks for group in assignment.groups))
        newest: tuple[int, Senses, Heard, Outcomes] | None = None
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
            if isinstance(arrived, bool):
                if not arrived:
                    return
                continue
            try:
                frame = frames.decode(arrived.payload.to_bytes())
                if frame.kind == "end":
                    return
                if frame.kind == "packets":
                    at_ns, number, heard, outcomes = decode_packets(frame, gives)
                    self.missed += max(0, number - self._next_packets)
                    self._next_packets = number + 1
                    receive(heard, outcomes)
                    between = frame.tick, at_ns
                    continue
                if frame.kind != "tick" or frame.tick <= tick or frame.tick % every:
                    raise BadFrame("wrong_tick", f"{frame.kind} {frame.tick}")
                told = decode_tick(frame, gives, groups)
            except BadFrame:
                self.dropped += 1
                continue
            self.dropped += newest is not None
            newest, tick = (frame.tick, *told), frame.tick


def _join(session: zenoh.Session, keys: Keys, runner: str, inbox: _Inbox) -> Assignment:
    if not inbox.wait_for_world():
        raise RunnerLost(runner, "none yet", "there is no world")
    for reply in session.get(keys.join(runner), payload=JoinRequest().encode(), timeout=JOIN_S):
        if reply.ok is None:
            raise RunnerLost(runner, "none yet", reply.err.payload.to_string() if reply.err else "no answer to join")
        return Assignment.from_mapping(msgpack.unpackb(reply.ok.payload.to_bytes()))
    raise RunnerLost(runner, "none yet", "the world did not answer to join")


def _answers(assignment: Assignment, inbox: _Inbox) -> Iterator[bytes]:
    """A frame "ready", then an answer to every tick; a failure, if there is one, is the last."""
    try:
        host = Host(assignment)
        yield frames.encode("ready", -1, {})
        for told in inbox.ticks(assignment, host.receive):
            if len(told) == 2:
                if len(sent := host.hear(*told)):
                    missed, inbox.missed = inbox.missed, 0
                    yield encode_sent(told[0], sent, missed)
                continue
            tick = told[0]
            actions = host.act(*told)
            dropped, inbox.dropped = inbox.dropped, 0
            yield encode_actions(tick, actions, dropped)
        return
    except AgentFailed as error:
        failure = {"robots": error.robots, "traceback": error.traceback}
    except Exception:  # noqa: BLE001 - whatever it is, the world must learn of it
        failure = {"robots": assignment.robots_text, "traceback": traceback.format_exc()}
    yield frames.encode("failed", -1, {}, failure)
    # The world must read this before the runner's token vanishes, or it would report a lost runner instead.
    for _ in inbox.ticks(assignment):
        continue
