"""What became of runners while a run went on: who joined, left, was lost and returned."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, Literal

import msgpack

from swarmwire.comms.assignment import Assignment, robots_text
from swarmwire.comms.errors import AgentFailed, BadFrame, Interrupted, RunnerLost
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemory, decode_memory, encode_memory
from swarmwire.comms.wire.join import JoinLimits, SessionInfo
from swarmwire.world.backends.allocation import Allocations, S
from swarmwire.world.backends.join_policy import (
    MAX_SAID,
    USUAL,
    JoinPolicy,
    JoinRefused,
    accepted,
    check_version,
    printable,
    read_request,
)

What = Literal["joined", "left", "lost", "returned"]


@dataclass(frozen=True)
class RunnerEvent:
    """One runner that came or went."""

    what: What
    runner: str
    robots: tuple[str, ...]  # names
    tick: int  # that was open; -1: before the first
    reason: str = ""  # why it was lost

    def __str__(self) -> str:
        when = "before the first tick" if self.tick < 0 else f"in tick {self.tick}"
        told = f"{self.runner} {_SAID[self.what]} {robots_text(list(self.robots))} {when}"
        return told + (f": {self.reason}" if self.reason else "")


_SAID: dict[What, str] = {
    "joined": "joined with",
    "left": "left",
    "lost": "was lost with",
    "returned": "returned to",
}


# --- How the runners of a run are doing, for whoever looks on.


@dataclass(frozen=True)
class RunnerHealth:
    """Counts since the start, but `ready`: now."""

    ready: int  # runners that play their robots
    lost: int  # runners
    late_answers: int = 0  # after their own tick, one per robot; in real time
    frames_dropped: int = 0  # to runners, never acted on
    watchdog_stops: int = 0  # of robots; in real time
    left: int = 0  # runners that said so
    robots_free: int = 0  # that no agent plays now
    foreign: int = 0  # of those that are ready: with code of their own, of which they told nothing
    waits_s: float = 0.0  # how long the run has been waiting for runners by now
    waits_for: str = ""  # the first that it waits for, and its robots


# --- Who plays which robots, without any I/O: slots, the runners that join them, and what follows when one is lost.
#
# The states of a slot and the moves between them stand in `slot`. A slot that is free holds robots that nobody plays; a
# runner that asks for some of them gets a slot of its own, cut from those that are free. Beside them,
#
#     a frame "failed"        AgentFailed               (ends the run)
#     a loss    stop          RunnerLost                (ends the run; so does any loss before the first tick)
#               dead          the slot is given up      (its robots stand still to the end)
#               wait          the slot is free again    (the run waits until somebody plays its robots)
#               stand, coast  the slot is free again    (the run goes on: its robots stand, or do what they did last)
#     a frame "leave"         as a loss, but that stop raises Interrupted: nobody failed
#
# An open run, whose runners come from elsewhere, bears losses before the first tick, too. Whatever else does not fit is
# counted by name and dropped; it never changes the state.


MAX_TRACEBACK = 100_000  # letters: what a runner says of itself goes to people's terminals
OnLoss = Literal["stop", "dead", "wait", "stand", "coast"]
GOES_ON = ("stand", "coast")  # where the run waits for nobody once it began


@dataclass(frozen=True)
class Loss:
    """A runner that was lost while the run went on."""

    runner: str
    robots: str
    reason: str

    def __str__(self) -> str:
        return f"{self.runner}, which played {self.robots}: {self.reason}"


class RunnerRegistry(ABC, Generic[S]):
    """The runners of a run: what lockstep and real time share.

    Attributes:
        losses: runners that were lost while the run went on.
        changes: runners that came and went; those that a run starts itself are told of only once it began.
    """

    def __init__(self, parts: list[Assignment], on_loss: OnLoss, terms: JoinPolicy = USUAL) -> None:
        """`parts` of the robots are free: a runner that asks for nothing in particular gets the next one."""
        self._slots, self._on_loss, self._terms = Allocations(parts, self._slot), on_loss, terms
        self._by_runner: dict[str, S] = {}
        self._parts = len(parts)  # as many runners as the run itself started are welcome, whatever the limits say
        self._gone: set[str] = set()  # runners that left or were lost
        self._tick = -1
        self._counts: Counter[str] = Counter()
        self.losses: list[Loss] = []
        self.changes: list[RunnerEvent] = []

    @property
    def is_open(self) -> bool:
        """Whether runners come from elsewhere, when they like."""
        return self._terms.open

    @property
    def limits(self) -> JoinLimits:
        """What is taken from runners at most."""
        return self._terms.limits

    @property
    def waiting(self) -> int:
        """How many runners are not ready: 0 once the first tick may begin, and when all have answered."""
        if self._tick < 0 and self._terms.start_with is not None:
            return int(self.robots_played < self._terms.start_with)
        return sum(self._holds_up(slot) for slot in self._slots)

    @property
    def robots_played(self) -> int:
        """Robots whose agents are ready."""
        return sum(len(slot.all_rows) for slot in self._slots if slot.state in ("ready", "waiting"))

    @property
    def robots_free(self) -> int:
        """Robots that nobody plays, and whose agents are still to be built."""
        return sum(len(slot.all_rows) for slot in self._slots if slot.state in ("free", "joined"))

    @property
    def missing_robots(self) -> tuple[str, ...]:
        """Names of the robots that nobody plays, in the order of the robots."""
        free = [name for slot in self._slots.free for name in slot.assignment.robot_names]
        return tuple(sorted(free, key=self._slots.row_of.__getitem__))

    @property
    def bears_losses(self) -> bool:
        """Whether the run goes on without a runner that is lost now."""
        return self._terms.open if self._tick < 0 else self._on_loss != "stop"

    @property
    def missing(self) -> tuple[str, str]:
        """The first runner that keeps the others waiting, and its robots; for messages."""
        slot = next(slot for slot in self._slots if slot.state not in ("ready", "dead"))
        return slot.runner or "that did not join", slot.assignment.robots_text

    @property
    def waits_for(self) -> str:
        """The first runner that the loop waits for, and its robots; "" if there is none. Safe from any thread."""
        for slot in tuple(self._slots):
            if self._holds_up(slot):
                robots = slot.assignment.robots_text
                return f"{slot.runner}, which plays {robots}" if slot.runner else f"whoever plays {robots}"
        return ""

    def counts(self) -> dict[str, int]:
        """What was dropped or lost, by name."""
        return dict(self._counts)

    def health(self) -> RunnerHealth:
        """How the runners are doing."""
        playing = [slot for slot in self._slots if slot.state in ("ready", "waiting")]
        return RunnerHealth(
            len(playing),
            len(self.losses),
            frames_dropped=self._counts["frames_dropped_by_runners"],
            left=self._counts["runners_left"],
            robots_free=self.robots_free,
            foreign=sum(slot.foreign for slot in playing),
        )

    def is_building(self, runner: str) -> bool:
        """Whether a runner has robots whose agents are not ready yet."""
        slot = self._by_runner.get(runner)
        return slot is not None and slot.state == "joined"

    def offer(self, request: bytes = b"") -> SessionInfo | None:
        """What there is to play at present; None: nothing is told. Refused if it is asked for in another version."""
        if request:
            with self._refusals_counted():
                check_version(request)
        if self._terms.offer is None:
            return None
        free: dict[str, list[str]] = {}
        for slot in self._slots.free:
            for group in slot.assignment.groups:
                free.setdefault(group.name, []).extend(group.robot_names)
        return self._terms.offer.with_free(free)

    def join(self, runner: str, request: bytes) -> bytes:
        """Give a runner the free robots that it asks for: the reply; Refused with a reason for the runner."""
        with self._refusals_counted():
            asked = read_request(runner, request)
            self._check_room(runner)
            slot = self._slots.cut(accepted(asked, self._slots, self._terms))
        slot.move("joins")
        slot.runner = runner
        slot.foreign = self._terms.open and asked.agents is None  # a run's own runners tell nothing, either
        self._by_runner[runner] = slot
        memory = None
        if self._terms.memory is not None:
            memory = encode_memory({name: GroupMemory.joined(parts) for name, parts in slot.memory.items()})
        return msgpack.packb({**slot.assignment.as_mapping(), "v": frames.VERSION, "memory": memory})

    def gone(self, runner: str, reason: str) -> None:
        """A runner's token vanished: it is lost if it plays robots."""
        slot = self._by_runner.get(runner)
        if slot is not None:
            self._lose(slot, reason)

    def lose_silent(self, reason: str) -> None:
        """Whoever keeps the others waiting is lost; robots that a run already waits for go on waiting."""
        for slot in list(self._slots):
            if self._holds_up(slot) and (slot.state != "free" or not self.bears_losses):
                self._lose(slot, reason)

    def answer(self, runner: str, data: bytes) -> list[tuple[str, bytes]]:
        """A frame from a runner; AgentFailed if it says so. Returns frames to send, by runner."""
        slot = self._by_runner.get(runner)
        try:
            if slot is None:
                raise BadFrame("unknown_runner", runner)
            frame = frames.decode(data)
            if frame.kind == "actions":
                self._acted(slot, frame)
                dropped = frame.values.get("dropped", 0)
                if type(dropped) is int and dropped > 0:
                    self._counts["frames_dropped_by_runners"] += dropped
            elif frame.kind == "sent":
                self._sent_between(slot, frame)
            elif frame.kind == "failed":
                self._failed(slot, frame)
            elif frame.kind == "leave":
                self._leave(slot)
            elif frame.kind == "ready" and slot.may("is ready"):
                slot.move("is ready")
                self._came(slot)
                return [(runner, missed) for missed in self._catch_up(slot)]
            else:
                raise BadFrame("unexpected_kind", frame.kind)
        except BadFrame as fault:
            self._counts[f"{fault.fault}_frames"] += 1
        return []

    @contextmanager
    def _refusals_counted(self) -> Generator[None]:
        try:
            yield
        except JoinRefused as refusal:
            self._counts[refusal.count] += 1
            raise

    def _check_room(self, runner: str) -> None:
        if runner in self._by_runner:
            raise JoinRefused(f"the name {runner} is in use: another runner of this name plays")
        if len(self._by_runner) >= max(self._terms.limits.runners, self._parts):
            raise JoinRefused(f"there are {len(self._by_runner)} runners already, the most that this run takes")

    @abstractmethod
    def _slot(self, assignment: Assignment) -> S:
        """A slot of these robots, free."""

    @abstractmethod
    def _catch_up(self, slot: S) -> Sequence[bytes]:
        """Frames for a runner that became ready in the middle of a run."""

    @abstractmethod
    def _acted(self, slot: S, frame: frames.Frame) -> None:
        """Take an "actions" frame; BadFrame, and nothing changed, if it does not fit."""

    def _sent_between(self, slot: S, frame: frames.Frame) -> None:
        """Take a "sent" frame, which only real time with a subtick knows; BadFrame, and nothing changed, elsewhere."""
        raise BadFrame("unexpected_kind", frame.kind)

    def _memory(self, slot: S, frame: frames.Frame) -> dict[str, list[GroupMemory]]:
        """What is remembered of a slot's robots once this answer counts; BadFrame if it is not as it should be."""
        if self._terms.memory is None:
            return slot.memory
        rows = {group.name: group.rows for group in slot.assignment.groups}
        return slot.memory | {name: [of] for name, of in decode_memory(frame, self._terms.memory, rows).items()}

    def _holds_up(self, slot: S) -> bool:
        """Whether the loop cannot go on before this slot's runner did something."""
        if self._tick >= 0 and self._on_loss in GOES_ON:
            return slot.state == "waiting"
        return slot.state not in ("ready", "dead")

    def _lose(self, slot: S, reason: str) -> None:
        runner, robots = slot.runner or "that did not join", slot.assignment.robots_text
        if not self.bears_losses:
            raise RunnerLost(runner, robots, reason)
        self._free(slot, runner, "lost", reason)
        self.losses.append(Loss(runner, robots, reason))

    def _leave(self, slot: S) -> None:
        runner = slot.runner or ""
        if not self.bears_losses:
            raise Interrupted(f"runner {runner} left, which played {slot.assignment.robots_text}")
        self._free(slot, runner, "left", "")

    def _free(self, slot: S, runner: str, what: What, reason: str) -> None:
        """A slot's runner is gone: its robots are free again, or given up."""
        slot.move("is given up" if self._tick >= 0 and self._on_loss == "dead" else "is lost")
        del self._by_runner[runner]
        slot.runner = None
        self._gone.add(runner)
        self._counts[f"runners_{what}"] += 1
        self._changed(what, runner, slot, reason)

    def _came(self, slot: S) -> None:
        """A slot's agents are ready."""
        runner = slot.runner or ""
        back = runner in self._gone
        if back or self._tick >= 0:
            self._counts["runners_returned" if back else "runners_joined_late"] += 1
        if self._terms.open or self._tick >= 0:
            self._changed("returned" if back else "joined", runner, slot)

    def _changed(self, what: What, runner: str, slot: S, reason: str = "") -> None:
        self.changes.append(RunnerEvent(what, runner, slot.assignment.robot_names, self._tick, reason))

    def _failed(self, slot: S, frame: frames.Frame) -> None:
        match frame.values:
            case {"robots": str(robots), "traceback": str(traceback)}:
                raise AgentFailed(printable(robots, MAX_SAID), printable(traceback, MAX_TRACEBACK, keep="\n\t"))
            case _:
                raise AgentFailed(slot.assignment.robots_text, "(the runner sent no traceback)")
