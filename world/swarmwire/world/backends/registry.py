"""The runner registry, without any I/O: the allocation of each runner, and the rules for joins and losses.

`RunnerRegistry` is the base of `Lockstep` and `RealTime`. It answers join requests, decodes frames of runners, and
applies the run's `on_runner_loss` policy.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Generic, Literal

import msgpack
import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.errors import AgentFailed, BadFrame, Interrupted, RunnerLost
from swarmwire.comms.base.sentinels import NO_TICK
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemory, decode_memory, encode_memory
from swarmwire.comms.wire.assignment import Assignment, part_of
from swarmwire.comms.wire.join import SessionInfo
from swarmwire.comms.wire.limits import MAX_RESTARTS, JoinLimits
from swarmwire.world.backends.allocation import Allocations, AllocationT
from swarmwire.world.backends.join_policy import (
    DEFAULT_JOIN_POLICY,
    JoinPolicy,
    JoinRefused,
    check_version,
    read_request,
    requested_rows,
)
from swarmwire.world.backends.runner_frames import agent_failure, host_process, process_count
from swarmwire.world.backends.runner_reports import NOT_READY, Loss, RunnerEvent, RunnerEventKind, RunnerHealth

OnLoss = Literal["stop", "dead", "wait", "stand", "coast"]
NON_BLOCKING = ("stand", "coast")  # policies of a run that does not wait for runners after its start


class RunnerRegistry(ABC, Generic[AllocationT]):
    """The runners of a run: the rules that lockstep and real time share.

    A free allocation has robots without a runner. A runner that joins gets an allocation of its robots, cut from the
    free ones; `allocation.MOVES` lists the states. The loss of a runner has these effects, by `on_loss`:

        a loss    stop          RunnerLost                      (ends the run; so does any loss before the first tick)
                  dead          the allocation is given up      (its robots stand still until the end)
                  wait          the allocation is free again    (the run waits until a runner plays its robots)
                  stand, coast  the allocation is free again    (the run continues: its robots stand, or repeat their
                                                                last command)
        a frame "failed"        as a loss, but `stop` raises AgentFailed
        a frame "leave"         as a loss, but `stop` raises Interrupted: nothing failed
        a frame "restarted"     none: an event (a host has restarted a lost process and keeps its robots)

    An open run, whose runners are external, tolerates losses before the first tick, too. Any other frame that
    does not fit is counted by name and dropped; it never changes the state.

    Attributes:
        losses: runners that were lost during the run.
        events: arrivals and departures of runners; for the run's local runners, only after the first tick.
    """

    def __init__(self, parts: list[Assignment], on_loss: OnLoss, policy: JoinPolicy = DEFAULT_JOIN_POLICY) -> None:
        """All `parts` are free at first.

        A runner that requests no particular robots gets all free robots if there is one part, else the next part.
        """
        self._allocations, self._on_loss, self._policy = Allocations(parts, self._new_allocation), on_loss, policy
        self._by_runner: dict[str, AllocationT] = {}
        self._parts = len(parts)  # the limits do not apply to the run's local runners
        self._departed: set[str] = set()  # runners that left or were lost
        self._tick = NO_TICK
        self._counts: Counter[str] = Counter()
        self.losses: list[Loss] = []
        self.events: list[RunnerEvent] = []

    @property
    def is_open(self) -> bool:
        """True if external runners may join at any time."""
        return self._policy.open

    @property
    def row_of(self) -> dict[str, int]:
        """Row of each robot, by name."""
        return self._allocations.row_of

    @property
    def limits(self) -> JoinLimits:
        """The limits on runners and their frames."""
        return self._policy.limits

    @property
    def waiting(self) -> int:
        """The number of runners that block the run: 0 once the first tick may begin, and once all have answered."""
        if self._tick == NO_TICK and self._policy.start_with is not None:
            return int(self.robots_played < self._policy.start_with)
        return sum(self._blocks(allocation) for allocation in self._allocations)

    @property
    def robots_played(self) -> int:
        """Number of robots whose agents are ready."""
        return sum(
            len(allocation.all_rows) for allocation in self._allocations if allocation.state in ("ready", "waiting")
        )

    @property
    def robots_free(self) -> int:
        """Number of robots without a runner, or whose agents are not built yet."""
        return sum(
            len(allocation.all_rows) for allocation in self._allocations if allocation.state in ("free", "joined")
        )

    @property
    def missing_robots(self) -> tuple[str, ...]:
        """Names of the robots without a runner, by row."""
        free = [name for allocation in self._allocations.free for name in allocation.assignment.robot_names]
        return tuple(sorted(free, key=self._allocations.row_of.__getitem__))

    @property
    def awaited_robots(self) -> tuple[str, ...]:
        """Names of the robots without a runner for which the loop waits, by row."""
        return () if self._tick >= 0 and self._on_loss in NON_BLOCKING else self.missing_robots

    @property
    def has_begun(self) -> bool:
        """True once the first tick was opened."""
        return self._tick >= 0

    @property
    def survives_losses(self) -> bool:
        """True if the run would survive the loss of a runner now."""
        return self._policy.open if self._tick == NO_TICK else self._on_loss != "stop"

    @property
    def missing(self) -> tuple[str, str]:
        """The first runner that is not ready, and its robots; for messages."""
        allocation = next(allocation for allocation in self._allocations if allocation.state not in ("ready", "dead"))
        return allocation.runner or "that did not join", allocation.assignment.robots_text

    @property
    def waits_for(self) -> str:
        """The first runner that blocks the loop, and its robots; "" for none. Safe from any thread."""
        for allocation in tuple(self._allocations):
            if self._blocks(allocation):
                robots = allocation.assignment.robots_text
                return (
                    f"{allocation.runner}, which plays {robots}"
                    if allocation.runner
                    else f"the runner that plays {robots}"
                )
        return ""

    def counts(self) -> dict[str, int]:
        """Return the numbers of dropped frames and lost runners, by name."""
        return dict(self._counts)

    def health(self) -> RunnerHealth:
        """Return the health of the runners."""
        playing = [allocation for allocation in self._allocations if allocation.state in ("ready", "waiting")]
        return RunnerHealth(
            ready=sum(allocation.processes for allocation in playing),
            lost=len(self.losses),
            frames_dropped=self._counts["frames_dropped_by_runners"],
            left=self._counts["runners_left"],
            robots_free=self.robots_free,
            foreign=sum(allocation.foreign for allocation in playing),
        )

    def is_building(self, runner: str) -> bool:
        """Return True if a runner has robots whose agents are not ready yet."""
        allocation = self._by_runner.get(runner)
        return allocation is not None and allocation.state == "joined"

    def session_info(self, request: bytes = b"") -> SessionInfo | None:
        """Return the session info with the free robots, or None by the policy; JoinRefused for another version."""
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
            allocation = self._allocations.cut(requested_rows(join_request, self._allocations, self._policy))
        allocation.move("joins")
        allocation.runner = runner
        # A closed run's local runners send no hashes, either.
        allocation.foreign = self._policy.open and join_request.agents is None
        self._by_runner[runner] = allocation
        memory = columns = None
        if self._policy.memory is not None:
            memory = encode_memory({name: GroupMemory.joined(parts) for name, parts in allocation.memory.items()})
            columns = {group.name: self._policy.memory[group.name] for group in allocation.assignment.groups}
        reply = {
            **allocation.assignment.as_mapping(),
            "v": frames.VERSION,
            "memory": memory,
            "memory_columns": columns,
            "timeout_s": self._policy.timeout_s,
            "answer_within_s": self._policy.answer_within_s,
        }
        return msgpack.packb(reply)

    def lose(self, runner: str, reason: str) -> None:
        """Handle the loss of a runner; a runner without robots is ignored."""
        allocation = self._by_runner.get(runner)
        if allocation is not None:
            self._lose(allocation, reason)

    def lose_blocking(self, reason: str) -> None:
        """Handle every runner that blocks the tick as lost, unless the run already waits for its replacement."""
        for allocation in list(self._allocations):
            if self._blocks(allocation) and (allocation.state != "free" or not self.survives_losses):
                self._lose(allocation, reason)

    def answer(self, runner: str, data: bytes) -> list[tuple[str, bytes]]:
        """Handle a frame of a runner, and return frames to send, by runner; errors as listed above."""
        allocation = self._by_runner.get(runner)
        try:
            if allocation is None:
                raise BadFrame("unknown_runner", runner)
            frame = frames.decode(data)
            if frame.kind == "actions":
                self._accept_actions(allocation, frame)
                dropped = frame.values.get("dropped", 0)
                if type(dropped) is int and dropped > 0:
                    self._counts["frames_dropped_by_runners"] += dropped
            elif frame.kind == "sent":
                self._accept_sent(allocation, frame)
            elif frame.kind == "lost":
                self._process_lost(allocation, frame)
            elif frame.kind == "restarted":
                self._process_restarted(allocation, frame)
            elif frame.kind == "failed":
                self._lose(allocation, "its agent failed", agent_failure(frame, allocation))
            elif frame.kind == "leave":
                self._leave(allocation)
            elif frame.kind == "ready" and allocation.allows("is ready"):
                allocation.move("is ready")
                allocation.processes = process_count(frame, allocation)
                self._report_ready(allocation)
                return [(runner, missed_frame) for missed_frame in self._catch_up(allocation)]
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
            raise JoinRefused(f"there are {len(self._by_runner)} runners already, the most that this run accepts")

    @abstractmethod
    def _new_allocation(self, assignment: Assignment) -> AllocationT:
        """Return a free allocation of these robots."""

    @abstractmethod
    def _catch_up(self, allocation: AllocationT) -> Sequence[bytes]:
        """Return the frames for a runner that became ready within a tick."""

    @abstractmethod
    def _accept_actions(self, allocation: AllocationT, frame: frames.Frame) -> None:
        """Accept an "actions" frame; raise BadFrame and change nothing if it does not fit."""

    def _accept_sent(self, allocation: AllocationT, frame: frames.Frame) -> None:
        """Accept a "sent" frame in real time with sub-ticks; otherwise raise BadFrame."""
        raise BadFrame("unexpected_kind", frame.kind)

    def _memory(self, allocation: AllocationT, frame: frames.Frame) -> dict[str, list[GroupMemory]]:
        """Return the memory of an allocation after this answer; BadFrame if the frame's memory is malformed."""
        if self._policy.memory is None:
            return allocation.memory
        memory = dict(allocation.memory)
        rows = {group.name: group.rows for group in allocation.assignment.groups}
        for name, newest in decode_memory(frame, self._policy.memory, rows).items():
            others = rows[name][~np.isin(rows[name], newest.rows)]  # robots of late processes
            memory[name] = [*(old for part in memory.get(name, []) if len((old := part.for_rows(others)).rows)), newest]
        return memory

    def _blocks(self, allocation: AllocationT) -> bool:
        """Return True if the loop must wait for the runner of this allocation."""
        if self._tick >= 0 and self._on_loss in NON_BLOCKING:
            return allocation.state == "waiting"
        return allocation.state not in ("ready", "dead")

    def _lose(self, allocation: AllocationT, reason: str, failure: AgentFailed | None = None) -> None:
        runner, robots = allocation.runner or "that did not join", allocation.assignment.robots_text
        if not self.survives_losses:
            raise failure or RunnerLost(runner, robots, reason)
        self._free(allocation, runner, "lost", reason)
        self.losses.append(Loss(runner, robots, reason, failure.traceback if failure else ""))

    def _process_lost(self, allocation: AllocationT, frame: frames.Frame) -> None:
        """Handle a lost process of a host as the loss of a runner with its robots; BadFrame for a malformed frame."""
        process = host_process(frame, allocation)
        failure = agent_failure(frame, allocation) if "traceback" in frame.values else None
        if len(process.rows) == len(allocation.all_rows):
            self._lose(allocation, process.reason, failure)
            return
        part = self._split_off(allocation, process.rows)
        part.runner = process.name
        self._by_runner[process.name] = part
        self._lose(part, process.reason, failure)

    def _process_restarted(self, allocation: AllocationT, frame: frames.Frame) -> None:
        """Report a lost process that its host restarted with its robots; BadFrame after too many restarts."""
        process = host_process(frame, allocation)
        rows = process.rows.tolist()
        if self._policy.memory is None or max(allocation.restarts[row] for row in rows) >= MAX_RESTARTS:
            raise BadFrame("unexpected_kind", frame.kind)
        allocation.restarts.update(rows)
        self._counts["processes_restarted"] += 1
        robots = part_of(allocation.assignment, process.rows).robot_names
        self.events.append(RunnerEvent("restarted", process.name, robots, self._tick, process.reason))

    def _split_off(self, allocation: AllocationT, rows: IntArray) -> AllocationT:
        """Split off a runner's robots that are about to be lost."""
        part = self._allocations.split_off(allocation, rows)
        allocation.processes = max(allocation.processes - 1, 1)
        return part

    def _leave(self, allocation: AllocationT) -> None:
        runner = allocation.runner or ""
        if not self.survives_losses:
            raise Interrupted(f"runner {runner} left, which played {allocation.assignment.robots_text}")
        self._free(allocation, runner, "left", NOT_READY if self.is_building(runner) else "")

    def _free(self, allocation: AllocationT, runner: str, event: RunnerEventKind, reason: str) -> None:
        """Remove the runner of an allocation: its robots are free again, or given up."""
        allocation.move("is given up" if self._tick >= 0 and self._on_loss == "dead" else "is lost")
        del self._by_runner[runner]
        allocation.runner = None
        allocation.restarts.clear()
        self._departed.add(runner)
        self._counts[f"runners_{event}"] += 1
        self._report_event(event, runner, allocation, reason)

    def _report_ready(self, allocation: AllocationT) -> None:
        """Count and report a runner whose agents are ready."""
        runner = allocation.runner or ""
        returned = runner in self._departed
        if returned or self._tick >= 0:
            self._counts["runners_returned" if returned else "runners_joined_late"] += 1
        if self._policy.open or self._tick >= 0:
            self._report_event("returned" if returned else "joined", runner, allocation)

    def _report_event(self, event: RunnerEventKind, runner: str, allocation: AllocationT, reason: str = "") -> None:
        self.events.append(RunnerEvent(event, runner, allocation.assignment.robot_names, self._tick, reason))
