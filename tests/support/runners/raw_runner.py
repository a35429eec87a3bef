"""A runner of tests that speaks the protocol itself, and beside or in place of what is right says whatever it likes."""

# zenoh's stubs leave out some types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

import queue
import threading
from collections.abc import Callable, Sequence
from typing import Any

import msgpack
import zenoh

from examples.protocol.runner import VERSION, acted, frame
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import close_session, open_runner

JOIN_S = 30.0
Arrays = dict[str, Any]


class Turn:
    """A tick as the runner sees it: what an honest runner would answer, and with what else it could be confused."""

    def __init__(self, runner: "RawRunner", tick: int, arrays: Arrays) -> None:
        self.runner, self.tick, self.arrays = runner, tick, arrays
        self.honest = frame("actions", tick, arrays, {})

    def other(self, tick: int | None = None, values: Arrays | None = None, **arrays: Any) -> bytes:
        """The honest answer but for its tick, its values, or some arrays ("__" for "/")."""
        changed = {name.replace("__", "/"): array for name, array in arrays.items()}
        return frame("actions", self.tick if tick is None else tick, self.arrays | changed, values or {})


Says = Callable[[Turn], Sequence[bytes]]  # all that is sent in a tick, in order


def honestly(turn: Turn) -> Sequence[bytes]:
    """One answer, the right one."""
    return [turn.honest]


class RawRunner:
    """Plays so many robots of a run in a thread of this process, until the run ends or it is closed."""

    def __init__(
        self,
        endpoint: str,
        run_id: str,
        name: str,
        robots: int,
        says: Says = honestly,
        early: Sequence[bytes] = (),
    ) -> None:
        """`early` is what it says before it is ready."""
        self.keys, self.name, self._robots, self._says, self._early = Keys(run_id), name, robots, says, early
        self.session = open_runner(endpoint, JOIN_S)
        self.frames: list[bytes] = []  # that it answered honestly, or would have
        self.fault: Exception | None = None
        self._arrived: queue.SimpleQueue[zenoh.Sample | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave; whatever went wrong in the thread is raised here."""
        self._arrived.put(None)
        self._thread.join(JOIN_S)
        close_session(self.session)
        if self.fault is not None:
            raise self.fault

    def ask(self, name: str, payload: bytes) -> str:
        """What the world says to a request to join under that name: the refusal, "" if there is none."""
        for reply in self.session.get(self.keys.join(name), payload=payload, timeout=JOIN_S):
            return reply.err.payload.to_string() if reply.err else ""
        return ""

    def put(self, key: str, payload: bytes) -> None:
        """Say something at another key than its own."""
        self.session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK, express=True)

    def _run(self) -> None:
        try:
            self._play()
        except Exception as fault:  # noqa: BLE001 - raised by close, in the test's thread
            self.fault = fault

    def _play(self) -> None:
        into, block = (self._arrived.put, self._arrived), zenoh.CongestionControl.BLOCK
        declared = (
            self.session.declare_subscriber(self.keys.frame(self.name), into),
            self.session.liveliness().declare_token(self.keys.alive(self.name)),
        )
        answers = self.session.declare_publisher(self.keys.answer(self.name), congestion_control=block, express=True)
        request = msgpack.packb({"v": VERSION, "robots": self._robots, "names": None, "agents": None})
        reply = next(iter(self.session.get(self.keys.join(self.name), payload=request, timeout=JOIN_S)))
        assert reply.ok is not None, reply.err and reply.err.payload.to_string()
        assignment = msgpack.unpackb(reply.ok.payload.to_bytes())
        for payload in (*self._early, frame("ready", -1, {}, {})):
            answers.put(payload)
        while (sample := self._arrived.get()) is not None:
            told = msgpack.unpackb(sample.payload.to_bytes())
            if told["kind"] == "end":
                break
            turn = Turn(self, told["tick"], acted(told["arrays"], assignment))
            for payload in self._says(turn):
                answers.put(payload)
            self.frames.append(turn.honest)
        del declared
