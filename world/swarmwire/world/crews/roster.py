"""Who plays which robots, without any I/O: slots, the runners that join them, and what follows when one is lost.

The states of a slot and the moves between them stand in `slot`. Beside them,

    a frame "failed"        AgentFailed               (ends the run)
    a loss    stop          RunnerLost                (ends the run; so does any loss before the first tick)
              dead          the slot is given up      (its robots stand still to the end)
              wait          the slot is free again    (whoever joins next takes over, with fresh agents)

Whatever else does not fit is counted by name and dropped; it never changes the state.
"""

import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import msgpack
import numpy as np
from msgpack.exceptions import UnpackException

from swarmwire.comms.errors import AgentFailed, BadFrame, RunnerLost
from swarmwire.comms.wire import frames
from swarmwire.world.crews.runner_health import RunnerHealth
from swarmwire.world.crews.slot import Slot

NAME = re.compile(r"[\w.-]{1,64}", re.ASCII)  # of a runner: it is part of a key, so no wildcard, slash or hash
OnLoss = Literal["stop", "dead", "wait"]


class Refused(Exception):
    """A request to join that is not granted; the text goes back to the runner."""


@dataclass(frozen=True)
class Loss:
    """A runner that was lost while the run went on."""

    runner: str
    robots: str
    reason: str

    def __str__(self) -> str:
        return f"{self.runner}, which played {self.robots}: {self.reason}"


S = TypeVar("S", bound=Slot)


class Roster(ABC, Generic[S]):
    """The runners of a run: what lockstep and real time share."""

    def __init__(self, slots: list[S], on_loss: OnLoss) -> None:
        self._slots, self._on_loss = slots, on_loss
        self._by_runner: dict[str, S] = {}
        rows = np.concatenate([slot.rows for slot in slots])
        self._owner = np.empty(len(rows), np.int64)  # slot of each robot row
        self._owner[rows] = np.concatenate([np.full(len(slot.rows), i) for i, slot in enumerate(slots)])
        self._tick = -1
        self._counts: Counter[str] = Counter()
        self.losses: list[Loss] = []

    @property
    def waiting(self) -> int:
        """How many runners are not ready: 0 before the first tick, once all are there, and when all have answered."""
        return sum(slot.state not in ("ready", "dead") for slot in self._slots)

    @property
    def bears_losses(self) -> bool:
        """Whether the run goes on without a runner that is lost now."""
        return self._on_loss != "stop" and self._tick >= 0

    @property
    def missing(self) -> tuple[str, str]:
        """The first runner that keeps the others waiting, and its robots; for messages."""
        slot = next(slot for slot in self._slots if slot.state not in ("ready", "dead"))
        return slot.runner or "that did not join", slot.assignment.robots_text

    def counts(self) -> dict[str, int]:
        """What was dropped or lost, by name."""
        return dict(self._counts)

    def health(self) -> RunnerHealth:
        """How the runners are doing."""
        playing = sum(slot.state in ("ready", "waiting") for slot in self._slots)
        return RunnerHealth(playing, len(self.losses), frames_dropped=self._counts["frames_dropped_by_runners"])

    def join(self, request: bytes) -> tuple[str, bytes]:
        """Give the next free robots to a runner: its name and the reply; Refused with a reason for the runner."""
        try:
            asked: object = msgpack.unpackb(request)
        except (ValueError, UnpackException):
            asked = None
        match asked:
            case {"v": frames.VERSION, "runner": str(runner)} if NAME.fullmatch(runner):
                pass
            case _:
                self._counts["bad_join"] += 1
                raise Refused(f"expected a request of version {frames.VERSION} with a runner's name")
        free = next((slot for slot in self._slots if slot.may("joins")), None)
        if runner in self._by_runner or free is None:
            self._counts["refused_join"] += 1
            raise Refused("this name is in use" if runner in self._by_runner else "all robots are taken")
        free.move("joins")
        free.runner = runner
        self._by_runner[runner] = free
        return runner, msgpack.packb(free.assignment.as_mapping())

    def gone(self, runner: str, reason: str) -> None:
        """A runner's token vanished: it is lost if it plays robots."""
        slot = self._by_runner.get(runner)
        if slot is not None:
            self._lose(slot, reason)

    def lose_silent(self, reason: str) -> None:
        """Whoever keeps the others waiting is lost; robots that a run already waits for go on waiting."""
        for slot in self._slots:
            if slot.state not in ("ready", "dead") and (slot.state != "free" or not self.bears_losses):
                self._lose(slot, reason)

    def answer(self, runner: str, data: bytes) -> list[tuple[str, bytes]]:
        """A frame from a runner; AgentFailed if it says so. Returns frames to send, by runner."""
        slot = self._by_runner.get(runner)
        try:
            if slot is None:
                raise BadFrame("unknown_runner", runner)
            frame = frames.decode(data)
            if frame.kind == "failed":
                self._failed(slot, frame)
            elif frame.kind == "ready" and slot.may("is ready"):
                slot.move("is ready")
                return [(runner, missed) for missed in self._catch_up(slot)]
            elif frame.kind != "actions":
                raise BadFrame("unexpected_kind", frame.kind)
            else:
                self._acted(slot, frame)
                dropped = frame.values.get("dropped", 0)
                if type(dropped) is int and dropped > 0:
                    self._counts["frames_dropped_by_runners"] += dropped
        except BadFrame as fault:
            self._counts[f"{fault.fault}_frames"] += 1
        return []

    @abstractmethod
    def _catch_up(self, slot: S) -> Sequence[bytes]:
        """Frames for a runner that became ready in the middle of a run."""

    @abstractmethod
    def _acted(self, slot: S, frame: frames.Frame) -> None:
        """Take an "actions" frame; BadFrame, and nothing changed, if it does not fit."""

    def _lose(self, slot: S, reason: str) -> None:
        loss = Loss(slot.runner or "that did not join", slot.assignment.robots_text, reason)
        if not self.bears_losses:
            raise RunnerLost(loss.runner, loss.robots, reason)
        slot.move("is given up" if self._on_loss == "dead" else "is lost")
        del self._by_runner[loss.runner]
        slot.runner = None
        self._counts["runners_lost"] += 1
        self.losses.append(loss)

    def _failed(self, slot: S, frame: frames.Frame) -> None:
        match frame.values:
            case {"robots": str(robots), "traceback": str(traceback)}:
                raise AgentFailed(robots, traceback)
            case _:
                raise AgentFailed(slot.assignment.robots_text, "(the runner sent no traceback)")
