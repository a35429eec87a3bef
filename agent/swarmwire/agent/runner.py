"""A runner: a process that plays some robots of a world behind zenoh, in lockstep.

It joins (gets robots), declares its token, builds the agents, says "ready", then answers every `tick` frame with one
`actions` frame until the world says "end" or is gone. All that arrives lands in one queue, put there by the network
thread itself: no Python thread per subscription, so a runner stays small.
"""

import queue
import traceback
from collections.abc import Callable
from typing import cast

import msgpack
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.host import Host
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import AgentFailed, RunnerLost
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import open_runner
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions

JOIN_S = 30.0


def run(endpoint: str, run_id: str, runner: str) -> None:
    """Play robots of the run at `endpoint` until it ends; RunnerLost if there is no world or it gives no robots."""
    keys = Keys(run_id)
    with open_runner(endpoint) as session:
        inbox: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
        arrived = Callback(inbox.put, indirect=False)
        declared = (  # zenoh takes back what nobody holds on to
            session.liveliness().declare_subscriber(keys.world, arrived, history=True),
            session.declare_subscriber(keys.frame(runner), arrived),
            session.liveliness().declare_token(keys.alive(runner)),
        )
        assignment = _join(session, keys, runner, inbox)
        answer = session.declare_publisher(
            keys.answer(runner), congestion_control=zenoh.CongestionControl.BLOCK, express=True
        )
        _serve(assignment, inbox, lambda data: cast(None, answer.put(data)))
        del declared


def _join(session: zenoh.Session, keys: Keys, runner: str, inbox: "queue.SimpleQueue[zenoh.Sample]") -> Assignment:
    try:
        inbox.get(
            timeout=JOIN_S
        )  # the world's token, declared last: one that has only just begun to listen cannot answer
    except queue.Empty:
        raise RunnerLost(runner, "none yet", "there is no world") from None
    request = msgpack.packb({"v": frames.VERSION, "runner": runner})
    for reply in session.get(keys.join, payload=request, timeout=JOIN_S):
        if reply.ok is None:
            raise RunnerLost(runner, "none yet", reply.err.payload.to_string() if reply.err else "no answer to join")
        return Assignment.from_mapping(msgpack.unpackb(reply.ok.payload.to_bytes()))
    raise RunnerLost(runner, "none yet", "the world did not answer to join")


def _serve(assignment: Assignment, inbox: "queue.SimpleQueue[zenoh.Sample]", answer: Callable[[bytes], None]) -> None:
    gives = assignment.gives or ()
    tick = -1
    try:
        host = Host(assignment)
        answer(frames.encode("ready", tick, {}))
        while True:
            sample = inbox.get()
            if sample.kind == zenoh.SampleKind.DELETE:  # the world's token: the world is gone
                return
            payload = sample.payload.to_bytes()
            if not payload:  # the token's own announcement
                continue
            frame = frames.decode(payload)
            if frame.kind == "end":
                return
            tick = frame.tick
            answer(encode_actions(tick, host.act(tick, *decode_tick(frame, gives))))
    except AgentFailed as error:
        answer(frames.encode("failed", tick, {}, {"robots": error.robots, "traceback": error.traceback}))
        _wait_for_end(inbox)
    except Exception:
        answer(
            frames.encode("failed", tick, {}, {"robots": assignment.robots_text, "traceback": traceback.format_exc()})
        )
        _wait_for_end(inbox)


def _wait_for_end(inbox: "queue.SimpleQueue[zenoh.Sample]") -> None:
    # The world must read the failure before this runner's token vanishes, or it would report a lost runner instead.
    while True:
        sample = inbox.get()
        if sample.kind == zenoh.SampleKind.DELETE:
            return
        payload = sample.payload.to_bytes()
        if payload and frames.decode(payload).kind == "end":
            return
