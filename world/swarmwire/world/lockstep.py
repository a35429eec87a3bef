"""The lockstep hand-shake with runners, without any I/O: bytes and tokens in, bytes and actions out.

    slot      joins         free -> joined        (a runner asks and gets the slot's robots)
              "ready"       joined -> ready       (its agents are built; all ready: the first tick may begin)
    tick      open_tick     ready -> waiting      (one frame is out to each runner of a group that acts)
              "actions"     waiting -> ready      (all ready: the tick is complete)
    any       "failed"      AgentFailed           (ends the run)
              token gone    RunnerLost            (ends the run)

Whatever does not fit is counted by name and dropped; it never changes the state.
"""

import re
from collections import Counter
from dataclasses import dataclass

import msgpack
import numpy as np
from msgpack.exceptions import UnpackException

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import AgentFailed, BadFrame, RunnerLost
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import Actions, GroupSenses, Senses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.tick_frames import decode_actions, encode_tick

NAME = re.compile(r"[\w.-]{1,64}", re.ASCII)  # of a runner: it is part of a key, so no wildcard, slash or hash


class Refused(Exception):
    """A request to join that is not granted; the text goes back to the runner."""


@dataclass
class _Slot:
    """Some robots, and the runner that plays them."""

    assignment: Assignment
    rows: IntArray  # (n,) that act in the tick that is open, in the order of the answer: group after group
    runner: str | None = None
    state: str = "free"
    actions: Actions | None = None


class Lockstep:
    """The runners of a run: who plays which robots, and how far each has come."""

    def __init__(self, assignments: list[Assignment]) -> None:
        self._slots = [_Slot(a, np.concatenate([group.rows for group in a.groups])) for a in assignments]
        self._by_runner: dict[str, _Slot] = {}
        owners = np.concatenate([np.full(len(slot.rows), i) for i, slot in enumerate(self._slots)])
        rows = np.concatenate([slot.rows for slot in self._slots])
        self._owner = np.empty(len(rows), np.int64)  # slot of each robot row
        self._owner[rows] = owners
        self._tick = -1
        self._counts: Counter[str] = Counter()

    @property
    def waiting(self) -> int:
        """How many runners are not ready: 0 before the first tick, once all are there, and when all have answered."""
        return sum(slot.state != "ready" for slot in self._slots)

    @property
    def missing(self) -> tuple[str, str]:
        """The first runner that keeps the others waiting, and its robots; for messages."""
        slot = next(slot for slot in self._slots if slot.state != "ready")
        return slot.runner or "that did not join", slot.assignment.robots_text

    def counts(self) -> dict[str, int]:
        """What was dropped, by name."""
        return dict(self._counts)

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
        free = next((slot for slot in self._slots if slot.state == "free"), None)
        if runner in self._by_runner or free is None:
            self._counts["refused_join"] += 1
            raise Refused("this name is in use" if runner in self._by_runner else "all robots are taken")
        free.runner, free.state = runner, "joined"
        self._by_runner[runner] = free
        return runner, msgpack.packb(free.assignment.as_mapping())

    def gone(self, runner: str, reason: str) -> None:
        """A runner's token vanished: RunnerLost if it plays robots."""
        slot = self._by_runner.get(runner)
        if slot is not None:
            raise RunnerLost(runner, slot.assignment.robots_text, reason)

    def open_tick(self, tick: int, senses: Senses, heard: Heard) -> list[tuple[str, bytes]]:
        """Begin a tick: one frame for each runner of a group that acts; the others stay ready."""
        self._tick = tick
        parts = self._split(senses)
        packets = _split_heard(heard, self._owner, len(self._slots))
        out: list[tuple[str, bytes]] = []
        for slot, part, own in zip(self._slots, parts, packets, strict=True):
            slot.actions = None
            slot.rows = np.concatenate([np.empty(0, np.int64), *(group.rows for group in part.values())])
            if not part:
                continue
            slot.state = "waiting"
            out.append((slot.runner or "", encode_tick(tick, part, own)))
        return out

    def answer(self, runner: str, data: bytes) -> None:
        """A frame from a runner; AgentFailed if it says so."""
        slot = self._by_runner.get(runner)
        try:
            if slot is None:
                raise BadFrame("unknown_runner", runner)
            frame = frames.decode(data)
            if frame.kind == "failed":
                self._failed(slot, frame)
            elif frame.kind == "ready" and slot.state == "joined":
                slot.state = "ready"
            elif frame.kind != "actions":
                raise BadFrame("unexpected_kind", frame.kind)
            elif frame.tick != self._tick or slot.state != "waiting":
                raise BadFrame("wrong_tick", str(frame.tick))
            else:
                slot.actions = decode_actions(frame, slot.rows)
                slot.state = "ready"
                dropped = frame.values.get("dropped", 0)
                if type(dropped) is int and dropped > 0:
                    self._counts["frames_dropped_by_runners"] += dropped
        except BadFrame as fault:
            self._counts[f"{fault.fault}_frames"] += 1

    def take(self) -> Actions:
        """The actions of all robots, once the tick is complete."""
        return Actions.joined([slot.actions for slot in self._slots if slot.actions is not None])

    def _failed(self, slot: _Slot, frame: frames.Frame) -> None:
        match frame.values:
            case {"robots": str(robots), "traceback": str(traceback)}:
                raise AgentFailed(robots, traceback)
            case _:
                raise AgentFailed(slot.assignment.robots_text, "(the runner sent no traceback)")

    def _split(self, senses: Senses) -> list[Senses]:
        parts: list[Senses] = [{} for _ in self._slots]
        for name, group in senses.items():
            owner = self._owner[group.rows]
            order = np.argsort(owner, kind="stable")
            bounds = np.searchsorted(owner[order], np.arange(len(self._slots) + 1))
            rows = group.rows[order]
            fields = {field: column[order] for field, column in group.fields.items()}
            spans = zip(self._slots, parts, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
            for slot, part, first, last in spans:
                # Also a group none of whose robots acts now: their agents must forget, as they do beside others.
                if any(group.name == name for group in slot.assignment.groups):
                    own = {field: column[first:last] for field, column in fields.items()}
                    part[name] = GroupSenses(rows[first:last], own)
        return parts


def _split_heard(heard: Heard, owner: IntArray, slots: int) -> list[Heard]:
    """What the robots of each slot heard, each with the payloads that it needs, once."""
    if not len(heard):
        return [heard] * slots
    by_slot = np.argsort(owner[heard.receiver], kind="stable")
    slot_of = owner[heard.receiver[by_slot]]
    sorted_heard = heard.select(by_slot)
    packets = len(heard.payloads)
    wanted, place = np.unique(slot_of * packets + sorted_heard.payload, return_inverse=True)
    payloads = heard.payloads.rows(wanted % packets)
    first_row = np.searchsorted(slot_of, np.arange(slots + 1)).tolist()
    first_payload = np.searchsorted(wanted // packets, np.arange(slots + 1)).tolist()
    place = place.reshape(-1)
    return [
        Heard(
            sorted_heard.receiver[a:b],
            sorted_heard.sender[a:b],
            sorted_heard.sequence[a:b],
            sorted_heard.heard_at_ns[a:b],
            {name: column[a:b] for name, column in sorted_heard.given.items()},
            place[a:b] - p,
            payloads.span(p, q),
        )
        for a, b, p, q in zip(first_row[:-1], first_row[1:], first_payload[:-1], first_payload[1:], strict=True)
    ]
