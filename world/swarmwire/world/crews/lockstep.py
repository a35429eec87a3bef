"""The lockstep hand-shake with runners, without any I/O: bytes and tokens in, bytes and actions out.

A tick opens with one frame to each runner of a group that acts, and is complete once all of them have answered. Who
takes over within a tick gets its frame, if nobody has answered that. States and moves stand in `slot`; how runners join
and are lost, and what becomes of frames that do not fit, in `roster`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import Actions, Senses
from swarmwire.comms.wire.frames import Frame
from swarmwire.comms.wire.tick_frames import decode_actions, encode_tick
from swarmwire.world.crews.roster import OnLoss, Refused, Roster
from swarmwire.world.crews.slot import Slot, rows_of
from swarmwire.world.crews.split_tick import acting, split_heard, split_outcomes, split_senses

__all__ = ["Lockstep", "Refused", "standing"]


@dataclass
class _Slot(Slot):
    frame: bytes | None = None  # of the open tick, while there is no answer to it
    actions: Actions | None = None


class Lockstep(Roster[_Slot]):
    """The runners of a run: who plays which robots, and how far each has come."""

    def __init__(self, assignments: list[Assignment], on_loss: OnLoss = "stop") -> None:
        super().__init__([_Slot(assignment, rows_of(assignment)) for assignment in assignments], on_loss)

    def open_tick(
        self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes = NO_OUTCOMES
    ) -> list[tuple[str, bytes]]:
        """Begin a tick: one frame for each runner of a group that acts; the others stay ready."""
        self._tick = tick
        parts = split_senses(senses, self._owner, [slot.assignment for slot in self._slots])
        packets = split_heard(heard, self._owner, len(self._slots))
        told = split_outcomes(outcomes, self._owner, len(self._slots))
        out: list[tuple[str, bytes]] = []
        for slot, part, own, its in zip(self._slots, parts, packets, told, strict=True):
            slot.rows, slot.actions, slot.frame = acting(part), None, None
            if slot.state == "dead" or not part:
                continue
            slot.frame = encode_tick(tick, part, own, its)
            if slot.may("is asked"):
                slot.move("is asked")
                out.append((slot.runner or "", slot.frame))
        return out

    def take(self) -> Actions:
        """The actions of all robots, once the tick is complete; those of dead runners stand still."""
        dead = [standing(slot) for slot in self._slots if slot.state == "dead"]
        return Actions.joined([slot.actions for slot in self._slots if slot.actions is not None] + dead)

    def _acted(self, slot: _Slot, frame: Frame) -> None:
        if frame.tick != self._tick or not slot.may("answers"):
            raise BadFrame("wrong_tick", str(frame.tick))
        slot.actions = decode_actions(frame, slot.rows)
        slot.move("answers")
        slot.frame = None

    def _catch_up(self, slot: _Slot) -> Sequence[bytes]:
        if slot.frame is None:
            return ()
        slot.move("is asked")
        return (slot.frame,)

    def _lose(self, slot: _Slot, reason: str) -> None:
        super()._lose(slot, reason)
        if slot.state == "dead":
            slot.actions = slot.frame = None


def standing(slot: Slot) -> Actions:
    """Command 0 for every robot of a slot."""
    rows = slot.all_rows
    still = np.zeros(len(rows))
    return Actions(rows, np.ones(len(rows), np.bool_), still, still, still)
