"""The lockstep hand-shake with runners, without any I/O: bytes and tokens in, bytes and actions out.

A tick opens with one frame to each runner of a group that acts, and is complete once all of them have answered. Where
the run waits for lost runners, who takes over within a tick gets a frame of it; what the lost one answered in that tick
counts no more, and its agents' memory is that from before. Where the run goes on, its robots stand or coast from that
tick on until the first tick that opens with an agent. States and moves stand in `slot`; how runners join and are lost,
and what becomes of frames that do not fit, in `roster`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import NO_OUTCOMES, Heard, Outcomes
from swarmwire.comms.tick_io import Actions, Senses
from swarmwire.comms.wire.agent_memory import GroupMemory
from swarmwire.comms.wire.frames import Frame
from swarmwire.comms.wire.tick_frames import decode_actions, encode_tick
from swarmwire.world.crews.change import What
from swarmwire.world.crews.roster import GOES_ON, OnLoss, Roster
from swarmwire.world.crews.slot import Slot, rows_of
from swarmwire.world.crews.slots import NOBODY
from swarmwire.world.crews.split_tick import acting, split_heard, split_outcomes, split_senses
from swarmwire.world.crews.terms import USUAL, Terms


@dataclass(eq=False)
class _Slot(Slot):
    actions: Actions | None = None  # in the open tick
    idle: bool = False  # whether its robots have no agent in the open tick
    before: dict[str, list[GroupMemory]] = field(default_factory=dict[str, list[GroupMemory]])  # memory, at its start


class _Open(NamedTuple):
    """What the tick that is open brings to all robots."""

    tick: int
    senses: Senses
    heard: Heard
    outcomes: Outcomes


class Lockstep(Roster[_Slot]):
    """The runners of a run: who plays which robots, and how far each has come."""

    def __init__(self, parts: list[Assignment], on_loss: OnLoss = "stop", terms: Terms = USUAL) -> None:
        super().__init__(parts, on_loss, terms)
        self._open: _Open | None = None

    def open_tick(
        self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes = NO_OUTCOMES
    ) -> list[tuple[str, bytes]]:
        """Begin a tick: one frame for each runner of a group that acts; the others stay ready."""
        self._tick, self._open = tick, _Open(tick, senses, heard, outcomes)
        parts = split_senses(senses, self._slots.owner, self._slots.assignments)
        packets = split_heard(heard, self._slots.owner, len(self._slots))
        told = split_outcomes(outcomes, self._slots.owner, len(self._slots))
        out: list[tuple[str, bytes]] = []
        for slot, part, own, its in zip(self._slots, parts, packets, told, strict=True):
            slot.rows, slot.actions, slot.idle = acting(part), None, not slot.may("is asked")
            if slot.state == "dead" or not part:
                continue
            if slot.idle:
                if self._on_loss in GOES_ON:  # else whoever is waited for gets it all
                    self._to_nobody(own, its)
                continue
            slot.move("is asked")
            out.append((slot.runner or "", encode_tick(tick, part, own, its)))
        return out

    def take(self) -> Actions:
        """The actions of all robots, once the tick is complete; without an agent they stand still, or coast."""
        self._open = None
        still = [standing(slot) for slot in self._slots if slot.idle and self._on_loss != "coast"]
        return Actions.joined([slot.actions for slot in self._slots if slot.actions is not None] + still)

    def _slot(self, assignment: Assignment) -> _Slot:
        return _Slot(assignment, rows_of(assignment), idle=True)

    def _acted(self, slot: _Slot, frame: Frame) -> None:
        if frame.tick != self._tick or not slot.may("answers"):
            raise BadFrame("wrong_tick", str(frame.tick))
        actions, memory = decode_actions(frame, slot.rows), self._memory(slot, frame)
        slot.actions, slot.before, slot.memory = actions, slot.memory, memory
        slot.move("answers")

    def _catch_up(self, slot: _Slot) -> Sequence[bytes]:
        if self._open is None or self._on_loss in GOES_ON:
            return ()
        tick, senses, heard, outcomes = self._open
        own = np.full(len(self._slots.owner), NOBODY)
        own[slot.all_rows] = 0
        (part,) = split_senses(senses, own, [slot.assignment])
        slot.rows, slot.idle = acting(part), False
        if not part:
            return ()
        slot.move("is asked")
        return (encode_tick(tick, part, split_heard(heard, own, 1)[0], split_outcomes(outcomes, own, 1)[0]),)

    def _free(self, slot: _Slot, runner: str, what: What, reason: str) -> None:
        super()._free(slot, runner, what, reason)
        if self._open is not None and slot.actions is not None:
            slot.memory = slot.before
        slot.actions, slot.idle = None, True

    def _to_nobody(self, heard: Heard, outcomes: Outcomes) -> None:
        for name, some in (("packets_without_agent", heard), ("outcomes_without_agent", outcomes)):
            if len(some):
                self._counts[name] += len(some)


def standing(slot: Slot) -> Actions:
    """Command 0 for every robot of a slot."""
    rows = slot.all_rows
    still = np.zeros(len(rows))
    return Actions(rows, np.ones(len(rows), np.bool_), still, still, still)
