"""What runners send to a world: a roster takes it or counts it by name; what is refused changes nothing."""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.errors import AgentFailed, BadFrame, Interrupted
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.in_time_frames import encode_sent
from swarmwire.comms.wire.tick_frames import decode_actions
from swarmwire.world.crews.lockstep import Lockstep
from swarmwire.world.crews.realtime import RealTime
from swarmwire.world.crews.roster import Roster
from swarmwire.world.crews.terms import Terms
from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.miniature import RUNNERS, begun, playing
from tests.tools.fuzz.target import FrameTarget

TICK = 11  # that is open: the last of the miniature
STAGES = ("lockstep", "lockstep", "real time", "real time", "building")
IN_THE_WORLD = 0.02  # of the answers that are taken, as many are carried out: a tick takes a hundred times as long


class Case(NamedTuple):
    """A frame, and where it comes in."""

    stage: str
    runner: str
    data: bytes
    carried_out: bool


class WorldFrames(FrameTarget):
    """Frames of runners: actions, sent, ready, failed, leave."""

    name = "frames"
    quick = 1500
    refusals = (
        BadFrame,
        AgentFailed,
        Interrupted,
    )  # the last two: a runner said so

    def make_samples(self) -> list[bytes]:
        """Real answers, and what else a runner says."""
        self.miniature = begun()
        self.sound = {name: answers[-1] for name, answers in self.miniature.answers.items()}
        self.rosters: dict[str, Roster[Any]] = {}
        answer = frames.decode(self.sound["one"])
        sent = decode_actions(answer, np.sort(np.concatenate([of.rows for of in self.miniature.parts[0].groups]))).sent
        return [
            *(answers[at] for answers in self.miniature.answers.values() for at in (-1, -2)),
            encode_sent(TICK, sent, missed=1),
            frames.encode("ready", -1, {}),
            frames.encode("failed", -1, {}, {"robots": "flock-0", "traceback": "ValueError\n"}),
            frames.encode("leave", -1, {}),
        ]

    def case(self, dice: Dice) -> Any:
        """A changed frame, mostly from who really sent it."""
        runner = dice.pick((*RUNNERS, *RUNNERS, "nobody"))
        return Case(dice.pick(STAGES), runner, super().case(dice), dice.chance(IN_THE_WORLD))

    def door(self, case: Any) -> str | None:
        """The roster at that stage: it must be as before unless it took the frame, and must have counted it."""
        stage, runner, data, carried_out = case if isinstance(case, Case) else Case("lockstep", "one", case, True)
        roster = self._roster(stage)
        before, counted = _state(roster), sum(roster.counts().values())
        try:
            roster.answer(runner, data)
        except (AgentFailed, Interrupted):
            del self.rosters[stage]
            raise
        faults = {name for name in roster.counts() if name.endswith("_frames") and name != "frames_dropped_by_runners"}
        if _state(roster) == before:
            if sum(roster.counts().values()) == counted:
                raise AssertionError("a frame that was neither taken nor counted")
            roster._counts.clear()
            return " ".join(sorted(faults))
        if faults & {"malformed_frames", "oversized_frames", "wrong_tick_frames", "unknown_runner_frames"}:
            raise AssertionError(f"a frame that was refused, and changed the state: {roster.counts()}")
        if stage == "building":
            del self.rosters[stage]
            return "ready"
        self._take(stage, roster, runner, carried_out)
        return None

    def _take(self, stage: str, roster: Any, runner: str, carried_out: bool) -> None:
        """Close the tick, so that all come together, and open it again."""
        other = RUNNERS[1 - RUNNERS.index(runner)]
        roster.answer(other, self.sound[other])
        if roster.waiting:  # in real time also packets between ticks are taken
            roster.answer(runner, self.sound[runner])
        actions = roster.take()
        if carried_out:
            self.miniature.do(actions)
        roster._counts.clear()
        self._open(roster)

    def _roster(self, stage: str) -> Any:
        if stage not in self.rosters:
            parts, terms = list(self.miniature.parts), Terms(memory=self.miniature.layouts)
            made: Any = RealTime(parts, 0.5, 30.0, "stop", terms, quantum=True) if stage == "real time" else None
            roster = playing(made or Lockstep(parts, terms=terms), ready=stage != "building")
            if stage != "building":
                self._open(roster)
            self.rosters[stage] = roster
        return self.rosters[stage]

    def _open(self, roster: Any) -> None:
        of = self.miniature
        if isinstance(roster, RealTime):
            roster.open_tick(TICK, 0, of.senses, of.heard, of.outcomes)
        else:
            roster.open_tick(TICK, of.senses, of.heard, of.outcomes)


def _state(roster: Any) -> Any:
    """All that a frame might change."""
    slots = [
        (slot.runner, slot.state, id(getattr(slot, "actions", None)), id(slot.memory), len(getattr(slot, "asked", ())))
        for slot in roster._slots
    ]
    if isinstance(roster, RealTime):
        arrays = (roster._asked_ns, roster._stopped, roster._drive, roster._command, roster.late)
        kept = (roster._sent, roster._notes, roster._leds, roster._own, roster._values)
        return slots, [array.tobytes() for array in arrays], [len(one) for one in kept], dict(roster._numbers)
    return slots, sorted(roster._by_runner), roster._tick
