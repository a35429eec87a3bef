"""The endpoint of a run for runners, whose answers the test sets."""

# pyright: reportMissingModuleSource=false

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import msgpack
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.agent import agent_sha256, load_agent
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join import GroupInfo, SessionInfo
from swarmwire.comms.wire.keys import Keys, runner_of
from swarmwire.comms.wire.sessions import closed_after, listens_at, open_world
from tests.support.agent.hosts import TIMES, assignment, group, spec

REFUSAL = "refused by the test"
NOTHING = b""  # an answer that is none
ASSIGNED = assignment(group(spec("Counter"), [0, 1]))
OFFERED = GroupInfo("flock", spec("Counter"), agent_sha256(load_agent(spec("Counter"))), 2, ("flock-0", "flock-1"))
OFFER = SessionInfo("run1", "by hand", "", "1.2.3", 10, None, (OFFERED,)).encode()


def assignment_reply(**change: Any) -> bytes:
    """The answer to a runner that joins."""
    return msgpack.packb({"v": frames.VERSION, **ASSIGNED.as_mapping(), "memory": None, **TIMES, **change})


class MadeUpWorld:
    """A world with set answers; None is a refusal. It sends frames to runners that are ready.

    Attributes:
        holds: whether join requests get no answer.
    """

    def __init__(self, session: zenoh.Session, run: str, session_info: bytes | None, join: bytes | None) -> None:
        self.keys, self.endpoint = Keys(run), listens_at(session)[0]
        self.join_requests: list[bytes] = []
        self.answers: list[frames.Frame] = []
        self.to_send: list[bytes] = []
        self.holds, self._held = False, list[zenoh.Query]()
        self._session, self._replies = session, {self.keys.any_session_info: session_info, self.keys.any_join: join}
        self._declared = (
            session.declare_queryable(self.keys.any_session_info, Callback(self._session_info, indirect=False)),
            session.declare_queryable(self.keys.any_join, Callback(self._join, indirect=False)),
            session.declare_subscriber(self.keys.any_answer, Callback(self._answer, indirect=False)),
            session.liveliness().declare_token(self.keys.world),
        )

    def _session_info(self, query: zenoh.Query) -> None:
        self._reply(query, self.keys.any_session_info)

    def _join(self, query: zenoh.Query) -> None:
        assert query.payload is not None
        if self.holds:
            self._held.append(query)
        self.join_requests.append(query.payload.to_bytes())
        if not self.holds:
            self._reply(query, self.keys.any_join)

    def _reply(self, query: zenoh.Query, key: str) -> None:
        answer = self._replies[key]
        with query:
            if answer is None:
                query.reply_err(REFUSAL)
            elif answer != NOTHING:
                query.reply(query.key_expr, answer)

    def _answer(self, sample: zenoh.Sample) -> None:
        frame = frames.decode(sample.payload.to_bytes())
        self.answers.append(frame)
        if self.to_send:
            data = self.to_send.pop(-1 if frame.kind == "lost" else 0)  # after a failure nothing but the end
            self._session.put(self.keys.frame(runner_of(str(sample.key_expr))), data)


@contextmanager
def made_up_world(
    session_info: bytes | None = OFFER, join: bytes | None = assignment_reply(), run: str = "run1"
) -> Generator[MadeUpWorld]:
    """A world at a port that the system chooses."""
    with closed_after(open_world("tcp/127.0.0.1:0", 10.0)) as session:
        yield MadeUpWorld(session, run, session_info, join)
