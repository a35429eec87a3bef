"""Remote status and emergency stop of a robot: a queryable in the robots' network.

The network's thread queues the requests, and a separate thread answers them, so that a loop that hangs cannot delay an
emergency stop. `on_robot/safety.py` describes all paths of the stop.
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

MAX_WAITING = 32  # queued requests; further ones are refused, and their senders repeat them
TIMEOUT_S = 2.0  # wait for an answer in progress, at close


class Controlled(Protocol):
    """The robot as remote control calls it, from the control thread."""

    def estop(self) -> None:
        """Switch the motors off permanently."""
        ...

    def status(self) -> Mapping[str, Any]:
        """Return the status of the robot, in values of JSON."""
        ...


class ControlPoint:
    """Answers requests to one robot, from `open` to `close`, also while the loop is busy.

    Attributes:
        refused: malformed requests, and requests above the queue's limit, so far.
    """

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, robot: str, controlled: Controlled) -> None:
        self._session, self._keys, self._robot, self._controlled = session, keys, robot, controlled
        self._requests: queue.Queue[zenoh.Query | None] = queue.Queue(MAX_WAITING)
        self._declared: tuple[zenoh.Queryable[None], zenoh.LivelinessToken] | None = None
        self._thread = threading.Thread(target=self._answer_all, name="control", daemon=True)
        self.refused = 0

    def open(self) -> None:
        """Start to answer, and declare the liveliness token of this robot's agent."""
        self._declared = (
            self._session.declare_queryable(self._keys.control(self._robot), Callback(self._enqueue, indirect=False)),
            self._session.liveliness().declare_token(self._keys.alive(self._robot)),
        )
        self._thread.start()

    def close(self) -> None:
        """Stop answering; safe to call more than once."""
        declared, self._declared = self._declared, None
        if declared is None:
            return
        if not self._session.is_closed():
            for declaration in declared:
                declaration.undeclare()
        with suppress(queue.Full):  # an answer that does not end must not delay the close
            self._requests.put(None, timeout=TIMEOUT_S)
        self._thread.join(TIMEOUT_S)

    def counts(self) -> dict[str, int]:
        """Return the number of refused requests, by name."""
        return {"questions_refused": self.refused}

    def _enqueue(self, query: zenoh.Query) -> None:
        """Queue a request, without delay for the network's thread, which calls this."""
        try:
            self._requests.put_nowait(query)
        except queue.Full:
            self.refused += 1

    def _answer_all(self) -> None:
        while (query := self._requests.get()) is not None:
            try:
                with query:  # the sender waits until the query is dropped
                    self._answer(query)
            except zenoh.ZError:  # the sender is gone
                self.refused += 1
            del query

    def _answer(self, query: zenoh.Query) -> None:
        key = self._keys.control(self._robot)
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
        except Exception as error:  # noqa: BLE001 - any error: the operator must learn of the failure
            query.reply_err(f"failed: {error}")
