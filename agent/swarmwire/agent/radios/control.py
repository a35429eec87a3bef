"""Where a robot can be asked for its state, and told to stop: a queryable of its own in the robots' network."""

# zenoh's stubs leave out the return types of reply and undeclare.
# pyright: reportUnknownMemberType=false

import json
import queue
import threading
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Protocol

import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.wire.robot_network import ESTOP, STATUS, STOPPED, SwarmKeys

MAX_WAITING = 32  # questions; one more goes unanswered, and its asker asks again
TIMEOUT_S = 2.0  # for an answer that is under way when it is closed


class Controlled(Protocol):
    """The robot as it can be controlled from elsewhere; called from a thread of its own."""

    def estop(self) -> None:
        """Motors off, and they stay so."""
        ...

    def status(self) -> Mapping[str, Any]:
        """How the robot is, in values that JSON has."""
        ...


class ControlPoint:
    """Answers in the name of the robot `own`, from `open` to `close`, whatever the loop is busy with.

    Attributes:
        refused: questions that were none, or too many at a time, so far.
    """

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, own: str, controlled: Controlled) -> None:
        self._session, self._keys, self._own, self._controlled = session, keys, own, controlled
        self._asked: queue.Queue[zenoh.Query | None] = queue.Queue(MAX_WAITING)
        self._declared: tuple[zenoh.Queryable[None], zenoh.LivelinessToken] | None = None
        self._thread = threading.Thread(target=self._answer_all, name="control", daemon=True)
        self.refused = 0

    def open(self) -> None:
        """Answer from now on, and tell the swarm that this robot's agent is there."""
        self._declared = (
            self._session.declare_queryable(self._keys.control(self._own), Callback(self._ask, indirect=False)),
            self._session.liveliness().declare_token(self._keys.alive(self._own)),
        )
        self._thread.start()

    def close(self) -> None:
        """Answer no more; safe to call more than once."""
        declared, self._declared = self._declared, None
        if declared is None:
            return
        if not self._session.is_closed():
            for one in declared:
                one.undeclare()
        with suppress(queue.Full):  # an answer that does not end holds up nobody
            self._asked.put(None, timeout=TIMEOUT_S)
        self._thread.join(TIMEOUT_S)

    def counts(self) -> dict[str, int]:
        """What was asked in vain, by name."""
        return {"questions_refused": self.refused}

    def _ask(self, query: zenoh.Query) -> None:
        """Called by the network's thread: it must take no time."""
        try:
            self._asked.put_nowait(query)
        except queue.Full:
            self.refused += 1

    def _answer_all(self) -> None:
        while (query := self._asked.get()) is not None:
            try:
                with query:  # one that is kept alive holds its asker
                    self._answer(query)
            except zenoh.ZError:  # the asker is gone
                self.refused += 1
            del query

    def _answer(self, query: zenoh.Query) -> None:
        key = self._keys.control(self._own)
        asked = query.payload.to_bytes() if query.payload else b""
        try:
            if asked == ESTOP.encode():
                self._controlled.estop()
                query.reply(key, STOPPED)
            elif asked == STATUS.encode():
                query.reply(key, json.dumps(self._controlled.status()))
            else:
                self.refused += 1
                query.reply_err(f"expected {ESTOP} or {STATUS}")
        except zenoh.ZError:
            raise
        except Exception as error:  # noqa: BLE001 - whatever it is, the operator must learn that it did not work
            query.reply_err(f"failed: {error}")
