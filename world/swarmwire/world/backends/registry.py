"""The runner registry, without any I/O: the allocation of each runner, and the rules for joins and losses.

`RunnerRegistry` is the base of `Lockstep` and `RealTime`. It answers join requests, decodes frames of runners, and
applies the run's `on_runner_loss` policy. `RunnerEvent`, `RunnerHealth` and `Loss` report on the runners.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, Literal

import msgpack
import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.errors import AgentFailed, BadFrame, Interrupted, RunnerLost
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemory, decode_memory, encode_memory
from swarmwire.comms.wire.assignment import Assignment, part_of, robots_text
from swarmwire.comms.wire.join import SessionInfo
from swarmwire.comms.wire.limits import MAX_RESTARTS, JoinLimits
from swarmwire.world.backends.allocation import Allocation, Allocations, AllocationT
from swarmwire.world.backends.join_policy import (
    DEFAULT_JOIN_POLICY,
    MAX_REASON_LETTERS,
    JoinPolicy,
    JoinRefused,
    accepted,
    check_version,
    read_request,
)

What = Literal["joined", "left", "lost", "returned", "restarted"]


NOT_READY = "its agents were not ready yet"  # so that its arrival is no event


@dataclass(frozen=True)
class RunnerEvent:
    """The arrival or departure of one runner."""

    what: What
    runner: str
    robots: tuple[str, ...]  # names
    tick: int  # the open tick; -1: before the first
    reason: str = ""  # of a loss or restart, or NOT_READY

    def __str__(self) -> str:
        when = "before the first tick" if self.tick < 0 else f"in tick {self.tick}"
        text = f"{self.runner} {_VERBS[self.what]} {robots_text(self.robots)} {when}"
        return text + (f": {self.reason}" if self.reason else "")


_VERBS: dict[What, str] = {
    "joined": "joined with",
    "left": "left",
    "lost": "was lost with",
    "returned": "returned to",
    "restarted": "was restarted with",
}


@dataclass(frozen=True)
class RunnerHealth:
    """The state of the runners for observers: counts since the start, except those marked as present."""

    ready: int  # runners that play their robots at present
    lost: int  # runners
    late_answers: int = 0  # after their own tick, one per robot; in real time
    frames_dropped: int = 0  # to runners, never acted on
    watchdog_stops: int = 0  # of robots; in real time
    left: int = 0  # runners that left on their own
    robots_free: int = 0  # robots without a runner at present
    foreign: int = 0  # ready runners that sent no hashes of their agents
    waits_s: float = 0.0  # how long the run has been waiting for runners at present
    waits_for: str = ""  # the first runner that it waits for, and its robots


MAX_PROCESS_LETTERS = 40  # of the name that a host gives to one of its processes
MAX_TRACEBACK = 100_000  # characters of a runner's traceback, which is shown on terminals
OnLoss = Literal["stop", "dead", "wait", "stand", "coast"]
NON_BLOCKING = ("stand", "coast")  # policies under which a run that has begun waits for no runner


@dataclass(frozen=True)
class Loss:
    """A runner, or a process of an agent host, that was lost in a run that continues."""

    runner: str
    robots: str
    reason: str
    traceback: str = ""  # of its agent, if that failed

    def __str__(self) -> str:
        return f"{self.runner}, which played {self.robots}: {self.reason}"


class RunnerRegistry(ABC, Generic[AllocationT]):
    """The runners of a run: the rules that lockstep and real time share.

    A free allocation holds robots without a runner. A runner that joins gets an allocation of its robots, cut from the
    free ones; `allocation.MOVES` holds the states. The loss of a runner has these effects, by `on_loss`:

        a loss    stop          RunnerLost                      (ends the run; so does any loss before the first tick)
                  dead          the allocation is given up      (its robots stand still until the end)
                  wait          the allocation is free again    (the run waits until a runner plays its robots)
                  stand, coast  the allocation is free again    (the run continues: its robots stand, or repeat their
                                                                last command)
        a frame "failed"        as a loss, but `stop` raises AgentFailed
        a frame "leave"         as a loss, but `stop` raises Interrupted: nothing failed
        a frame "restarted"     none: an event (a host has restarted a lost process, and its robots stay its own)

    An open run, whose runners come from elsewhere, tolerates losses before the first tick, too. Any other frame that
    does not fit is counted by name and dropped; it never changes the state.

    Attributes:
        losses: runners that were lost during the run.
        events: arrivals and departures of runners; those of the run's own runners only after the first tick.
    """

    def __init__(self, parts: list[Assignment], on_loss: OnLoss, policy: JoinPolicy = DEFAULT_JOIN_POLICY) -> None:
        """All `parts` are free at first.

        A runner that asks for no particular robots gets all free ones if there is one part, else the next part.
        """
        self._allocations, self._on_loss, self._policy = Allocations(parts, self._new_allocation), on_loss, policy
        self._by_runner: dict[str, AllocationT] = {}
        self._parts = len(parts)  # the run's own runners are accepted beyond the limits
        self._gone: set[str] = set()  # runners that left or were lost
        self._tick = -1
        self._counts: Counter[str] = Counter()
        self.losses: list[Loss] = []
        self.events: list[RunnerEvent] = []

    @property
    def is_open(self) -> bool:
        """Whether runners from elsewhere may join at any time."""
        return self._policy.open

    @property
    def limits(self) -> JoinLimits:
        """The limits on runners and their frames."""
        return self._policy.limits

    @property
    def waiting(self) -> int:
        """The number of runners that block the run: 0 once the first tick may begin, and once all have answered."""
        if self._tick < 0 and self._policy.start_with is not None:
            return int(self.robots_played < self._policy.start_with)
        return sum(self._holds_up(allocation) for allocation in self._allocations)

    @property
    def robots_played(self) -> int:
        """Robots whose agents are ready."""
        return sum(
            len(allocation.all_rows) for allocation in self._allocations if allocation.state in ("ready", "waiting")
        )

    @property
    def robots_free(self) -> int:
        """Robots without a runner, or whose agents are not built yet."""
        return sum(
            len(allocation.all_rows) for allocation in self._allocations if allocation.state in ("free", "joined")
        )

    @property
    def missing_robots(self) -> tuple[str, ...]:
        """Names of the robots without a runner, in the order of the robots."""
        free = [name for allocation in self._allocations.free for name in allocation.assignment.robot_names]
        return tuple(sorted(free, key=self._allocations.row_of.__getitem__))

    @property
    def has_begun(self) -> bool:
        """Whether the first tick has been opened."""
        return self._tick >= 0

    @property
    def bears_losses(self) -> bool:
        """Whether the run would survive the loss of a runner now."""
        return self._policy.open if self._tick < 0 else self._on_loss != "stop"

    @property
    def missing(self) -> tuple[str, str]:
        """The first runner that is not ready, and its robots; for messages."""
        allocation = next(allocation for allocation in self._allocations if allocation.state not in ("ready", "dead"))
        return allocation.runner or "that did not join", allocation.assignment.robots_text

    @property
    def waits_for(self) -> str:
        """The first runner that blocks the loop, and its robots; "" if there is none. Safe from any thread."""
        for allocation in tuple(self._allocations):
            if self._holds_up(allocation):
                robots = allocation.assignment.robots_text
                return (
                    f"{allocation.runner}, which plays {robots}"
                    if allocation.runner
                    else f"the runner that plays {robots}"
                )
        return ""

    def counts(self) -> dict[str, int]:
        """Dropped frames and lost runners, by name."""
        return dict(self._counts)

    def health(self) -> RunnerHealth:
        """The health of the runners."""
        playing = [allocation for allocation in self._allocations if allocation.state in ("ready", "waiting")]
        return RunnerHealth(
            sum(allocation.processes for allocation in playing),
            len(self.losses),
            frames_dropped=self._counts["frames_dropped_by_runners"],
            left=self._counts["runners_left"],
            robots_free=self.robots_free,
            foreign=sum(allocation.foreign for allocation in playing),
        )

    def is_building(self, runner: str) -> bool:
        """Whether a runner has robots whose agents are not ready yet."""
        allocation = self._by_runner.get(runner)
        return allocation is not None and allocation.state == "joined"

    def session_info(self, request: bytes = b"") -> SessionInfo | None:
        """The session info with the free robots; None if the policy has none. JoinRefused for another version."""
        if request:
            with self._refusals_counted():
                check_version(request)
        if self._policy.session_info is None:
            return None
        free: dict[str, list[str]] = {}
        for allocation in self._allocations.free:
            for group in allocation.assignment.groups:
                free.setdefault(group.name, []).extend(group.robot_names)
        return self._policy.session_info.with_free(free)

    def join(self, runner: str, request: bytes) -> bytes:
        """Allocate the requested robots to a runner, and return the reply; JoinRefused with a reason for the runner."""
        with self._refusals_counted():
            join_request = read_request(runner, request)
            self._check_room(runner)
            allocation = self._allocations.cut(accepted(join_request, self._allocations, self._policy))
        allocation.move("joins")
        allocation.runner = runner
        allocation.foreign = (
            self._policy.open and join_request.agents is None
        )  # the run's own runners send no hashes, either
        self._by_runner[runner] = allocation
        memory = columns = None
        if self._policy.memory is not None:
            memory = encode_memory({name: GroupMemory.joined(parts) for name, parts in allocation.memory.items()})
            columns = {group.name: self._policy.memory[group.name] for group in allocation.assignment.groups}
        answer = {"timeout_s": self._policy.timeout_s, "answer_within_s": self._policy.answer_within_s}
        memories = {"memory": memory, "memory_columns": columns}
        return msgpack.packb({**allocation.assignment.as_mapping(), "v": frames.VERSION, **memories, **answer})

    def gone(self, runner: str, reason: str) -> None:
        """A runner's liveliness token vanished: it is lost if it plays robots."""
        allocation = self._by_runner.get(runner)
        if allocation is not None:
            self._lose(allocation, reason)

    def lose_silent(self, reason: str) -> None:
        """Drop every runner that blocks the tick, unless the run already waits for a runner for its robots."""
        for allocation in list(self._allocations):
            if self._holds_up(allocation) and (allocation.state != "free" or not self.bears_losses):
                self._lose(allocation, reason)

    def answer(self, runner: str, data: bytes) -> list[tuple[str, bytes]]:
        """Take a frame from a runner, and return frames to send, by runner; errors as the table above."""
        allocation = self._by_runner.get(runner)
        try:
            if allocation is None:
                raise BadFrame("unknown_runner", runner)
            frame = frames.decode(data)
            if frame.kind == "actions":
                self._acted(allocation, frame)
                dropped = frame.values.get("dropped", 0)
                if type(dropped) is int and dropped > 0:
                    self._counts["frames_dropped_by_runners"] += dropped
            elif frame.kind == "sent":
                self._sent_between(allocation, frame)
            elif frame.kind == "lost":
                self._process_lost(allocation, frame)
            elif frame.kind == "restarted":
                self._process_restarted(allocation, frame)
            elif frame.kind == "failed":
                self._lose(allocation, "its agent failed", _failure(allocation, frame))
            elif frame.kind == "leave":
                self._leave(allocation)
            elif frame.kind == "ready" and allocation.may("is ready"):
                allocation.move("is ready")
                allocation.processes = _processes(frame, allocation)
                self._ready(allocation)
                return [(runner, missed) for missed in self._catch_up(allocation)]
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
            robots = self._by_runner[runner].assignment.robots_text
            raise JoinRefused(f"the name {runner} is in use, by the runner of {robots}: join under another name")
        if len(self._by_runner) >= max(self._policy.limits.runners, self._parts):
            raise JoinRefused(f"there are {len(self._by_runner)} runners already, the most that this run takes")

    @abstractmethod
    def _new_allocation(self, assignment: Assignment) -> AllocationT:
        """A free allocation of these robots."""

    @abstractmethod
    def _catch_up(self, allocation: AllocationT) -> Sequence[bytes]:
        """Frames for a runner that became ready within a tick."""

    @abstractmethod
    def _acted(self, allocation: AllocationT, frame: frames.Frame) -> None:
        """Take an "actions" frame; raise BadFrame and change nothing if it does not fit."""

    def _sent_between(self, allocation: AllocationT, frame: frames.Frame) -> None:
        """Take a "sent" frame, which only real time with sub-ticks accepts; elsewhere raise BadFrame."""
        raise BadFrame("unexpected_kind", frame.kind)

    def _memory(self, allocation: AllocationT, frame: frames.Frame) -> dict[str, list[GroupMemory]]:
        """The memory of an allocation after this answer; BadFrame if the frame's memory is malformed."""
        if self._policy.memory is None:
            return allocation.memory
        memory = dict(allocation.memory)
        rows = {group.name: group.rows for group in allocation.assignment.groups}
        for name, newest in decode_memory(frame, self._policy.memory, rows).items():
            others = rows[name][~np.isin(rows[name], newest.rows)]  # of processes that are late
            memory[name] = [*(old for part in memory.get(name, []) if len((old := part.for_rows(others)).rows)), newest]
        return memory

    def _holds_up(self, allocation: AllocationT) -> bool:
        """Whether the loop must wait for the runner of this allocation."""
        if self._tick >= 0 and self._on_loss in NON_BLOCKING:
            return allocation.state == "waiting"
        return allocation.state not in ("ready", "dead")

    def _lose(self, allocation: AllocationT, reason: str, failure: AgentFailed | None = None) -> None:
        runner, robots = allocation.runner or "that did not join", allocation.assignment.robots_text
        if not self.bears_losses:
            raise failure or RunnerLost(runner, robots, reason)
        self._free(allocation, runner, "lost", reason)
        self.losses.append(Loss(runner, robots, reason, failure.traceback if failure else ""))

    def _process_lost(self, allocation: AllocationT, frame: frames.Frame) -> None:
        """A process of a host is gone: its robots are lost as those of a runner of its own; BadFrame if none are."""
        rows, name, why = _process(frame, allocation)
        failure = _failure(allocation, frame) if "traceback" in frame.values else None
        if len(rows) == len(allocation.all_rows):
            self._lose(allocation, why, failure)
            return
        part = self._split_off(allocation, rows)
        part.runner = name
        self._by_runner[name] = part
        self._lose(part, why, failure)

    def _process_restarted(self, allocation: AllocationT, frame: frames.Frame) -> None:
        """A process of a host was gone, and is restarted with its robots; BadFrame if that is too often."""
        rows, name, why = _process(frame, allocation)
        if self._policy.memory is None or max(allocation.restarts[row] for row in rows.tolist()) >= MAX_RESTARTS:
            raise BadFrame("unexpected_kind", frame.kind)
        allocation.restarts.update(rows.tolist())
        self._counts["processes_restarted"] += 1
        robots = part_of(allocation.assignment, rows).robot_names
        self.events.append(RunnerEvent("restarted", name, robots, self._tick, why))

    def _split_off(self, allocation: AllocationT, rows: IntArray) -> AllocationT:
        """Split some robots of a runner off, which are about to be lost."""
        part = self._allocations.split_off(allocation, rows)
        allocation.processes = max(allocation.processes - 1, 1)
        return part

    def _leave(self, allocation: AllocationT) -> None:
        runner = allocation.runner or ""
        if not self.bears_losses:
            raise Interrupted(f"runner {runner} left, which played {allocation.assignment.robots_text}")
        self._free(allocation, runner, "left", NOT_READY if self.is_building(runner) else "")

    def _free(self, allocation: AllocationT, runner: str, what: What, reason: str) -> None:
        """Remove the runner of an allocation: its robots are free again, or given up."""
        allocation.move("is given up" if self._tick >= 0 and self._on_loss == "dead" else "is lost")
        del self._by_runner[runner]
        allocation.runner = None
        allocation.restarts.clear()
        self._gone.add(runner)
        self._counts[f"runners_{what}"] += 1
        self._record(what, runner, allocation, reason)

    def _ready(self, allocation: AllocationT) -> None:
        """Count and report a runner whose agents are ready."""
        runner = allocation.runner or ""
        returned = runner in self._gone
        if returned or self._tick >= 0:
            self._counts["runners_returned" if returned else "runners_joined_late"] += 1
        if self._policy.open or self._tick >= 0:
            self._record("returned" if returned else "joined", runner, allocation)

    def _record(self, what: What, runner: str, allocation: AllocationT, reason: str = "") -> None:
        self.events.append(RunnerEvent(what, runner, allocation.assignment.robot_names, self._tick, reason))


def _failure(allocation: Allocation, frame: frames.Frame) -> AgentFailed:
    """The failure of an agent in a frame "failed" or "lost"."""
    match frame.values:
        case {"robots": str(robots), "traceback": str(traceback)}:
            shown = printable(traceback, MAX_TRACEBACK, keep=LINES)
            return AgentFailed(printable(robots, MAX_REASON_LETTERS), shown)
        case _:
            return AgentFailed(allocation.assignment.robots_text, "(the runner sent no traceback)")


def _process(frame: frames.Frame, allocation: Allocation) -> tuple[IntArray, str, str]:
    """The robot rows and name of the process in a frame "lost" or "restarted", and the reason; BadFrame for others."""
    rows = np.unique(frames.checked_array(frame, "rows", "<i8", (None,)))
    process, reason = frame.values.get("process"), frame.values.get("reason")
    if type(process) is not str or type(reason) is not str or not len(rows):
        raise BadFrame("malformed", "expected rows, process and reason")
    if not np.isin(rows, allocation.all_rows).all():
        raise BadFrame("malformed", "rows: expected the runner's own robots")
    name = f"{allocation.runner}/{printable(process, MAX_PROCESS_LETTERS)}"
    return rows, name, printable(reason, MAX_REASON_LETTERS)


def _processes(frame: frames.Frame, allocation: Allocation) -> int:
    """The number of a runner's processes in its frame "ready"; BadFrame for one that cannot be."""
    processes = frame.values.get("processes", 1)
    if type(processes) is not int or not 1 <= processes <= len(allocation.all_rows):
        raise BadFrame("malformed", "processes: expected at least one, and at most one for each robot")
    return processes
