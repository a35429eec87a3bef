"""Remote status and emergency stop of a robot: a queryable in the robots' network.

The network's thread queues the requests, and a thread of its own answers them, so that a loop that hangs cannot delay
an emergency stop. `on_robot/safety.py` describes all paths of the stop.
"""

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

from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.robot_network import ESTOP, STATUS, STOPPED

MAX_WAITING = 32  # requests; one more is refused, and its sender repeats it
TIMEOUT_S = 2.0  # at close, for an answer in progress


class Controlled(Protocol):
    """The robot's side of remote control; called from the control thread."""

    def estop(self) -> None:
        """Motors off for good."""
        ...

    def status(self) -> Mapping[str, Any]:
        """The status of the robot, in values of JSON."""
        ...


class ControlPoint:
    """Answers requests to the robot `own`, from `open` to `close`, also while the loop is busy.

    Attributes:
        refused: requests so far that were malformed, or above the queue's limit.
    """

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, own: str, controlled: Controlled) -> None:
        self._session, self._keys, self._own, self._controlled = session, keys, own, controlled
        self._requests: queue.Queue[zenoh.Query | None] = queue.Queue(MAX_WAITING)
        self._declared: tuple[zenoh.Queryable[None], zenoh.LivelinessToken] | None = None
        self._thread = threading.Thread(target=self._answer_all, name="control", daemon=True)
        self.refused = 0

    def open(self) -> None:
        """Answer from now on, and declare the liveliness token of this robot's agent."""
        self._declared = (
            self._session.declare_queryable(self._keys.control(self._own), Callback(self._enqueue, indirect=False)),
            self._session.liveliness().declare_token(self._keys.alive(self._own)),
        )
        self._thread.start()

    def close(self) -> None:
        """Stop answering; safe to call more than once."""
        declared, self._declared = self._declared, None
        if declared is None:
            return
        if not self._session.is_closed():
            for one in declared:
                one.undeclare()
        with suppress(queue.Full):  # an answer that does not end must not delay the close
            self._requests.put(None, timeout=TIMEOUT_S)
        self._thread.join(TIMEOUT_S)

    def counts(self) -> dict[str, int]:
        """Refused requests, by name."""
        return {"questions_refused": self.refused}

    def _enqueue(self, query: zenoh.Query) -> None:
        """Called by the network's thread, which it must not delay."""
        try:
            self._requests.put_nowait(query)
        except queue.Full:
            self.refused += 1

    def _answer_all(self) -> None:
        while (query := self._requests.get()) is not None:
            try:
                with query:  # its sender waits as long as the query exists
                    self._answer(query)
            except zenoh.ZError:  # the sender is gone
                self.refused += 1
            del query

    def _answer(self, query: zenoh.Query) -> None:
        key = self._keys.control(self._own)
        request = query.payload.to_bytes() if query.payload else b""
        try:
            if request == ESTOP.encode():
                self._controlled.estop()
                query.reply(key, STOPPED)
            elif request == STATUS.encode():
                query.reply(key, json.dumps(self._controlled.status()))
            else:
                self.refused += 1
                query.reply_err(f"expected {ESTOP} or {STATUS}")
        except zenoh.ZError:
            raise
        except Exception as error:  # noqa: BLE001 - any error: the operator must learn that it did not work
            query.reply_err(f"failed: {error}")
