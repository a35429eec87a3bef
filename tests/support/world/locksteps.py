"""Runners in lockstep without zenoh and processes: as tests play them, and with every frame encoded."""

from functools import partial
from typing import Any, TypeVar

import msgpack
import numpy as np
import pytest

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.assignment import Assignment, split
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions
from swarmwire.world.backends.join_policy import JoinRefused
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.realtime import RealTime
from tests.support.agent.hosts import MEASURES, assignment, group, readings
from tests.support.agent.runners import EncodedRunner

R = TypeVar("R", Lockstep, RealTime)
GROUPS = {"flock", "scouts", "lone"}
FLOCK, SCOUTS = [0, 1, 4, 5], [2, 6]  # rows of the two groups; robot 3 and 7 are a third


def parts(owners: dict[int, int]) -> list[Assignment]:
    """One assignment for each slot: which slot owns each row."""
    groups = {"flock": FLOCK, "scouts": SCOUTS, "lone": [3, 7]}
    assignments: list[Assignment] = []
    for slot in sorted(set(owners.values())):
        rows = {name: [row for row in all_rows if owners[row] == slot] for name, all_rows in groups.items()}
        assignments.append(assignment(*(group("unused:Agent", owned, name) for name, owned in rows.items() if owned)))
    return assignments


def two_parts() -> list[Assignment]:
    return parts({row: row // 4 for row in range(8)})


def lockstep_of_two() -> Lockstep:
    return Lockstep(two_parts())


def real_time_of_two() -> RealTime:
    return RealTime(two_parts(), watchdog_s=0.5, timeout_s=30.0, on_loss="stop")


def request(version: Any = frames.VERSION, **fields: Any) -> bytes:
    return msgpack.packb({"v": version, **fields})


def joined(roster: R, *names: str) -> R:
    for name in names:
        roster.join(name, request())
    return roster


def ready(roster: R, *names: str) -> R:
    for name in names:
        roster.answer(name, frames.encode("ready", -1, {}))
    return roster


def playing_lockstep() -> Lockstep:
    return ready(joined(lockstep_of_two(), "a", "b"), "a", "b")


def all_readings(tick: int = 0) -> Readings:
    return {"flock": readings(tick, FLOCK), "scouts": readings(tick, SCOUTS), "lone": readings(tick, [3, 7])}


def actions(rows: list[int]) -> Actions:
    row = np.array(rows, np.int64)
    payloads = Payloads.from_rows([bytes([r, r, r]) for r in rows])
    sent = SentPackets(row, np.full(len(rows), BROADCAST), payloads)
    return Actions(row, row % 2 == 0, row * 0.1, row * -0.1, row * 0.2, sent)


def rows_of(frame: bytes) -> list[int]:
    groups, *_ = decode_tick(frames.decode(frame), MEASURES, GROUPS)
    return [row for part in groups.values() for row in part.rows.tolist()]


def state(roster: Lockstep | RealTime) -> Any:
    slots = [
        (slot.runner, slot.state, slot.rows.tolist(), id(getattr(slot, "actions", None)))
        for slot in roster._allocations
    ]
    return slots, sorted(roster._by_runner), roster._tick


def assert_join_refused(roster: Lockstep | RealTime, name: str, payload: bytes, match: str, count: str) -> None:
    """A refused join is counted and changes nothing."""
    before = state(roster)
    with pytest.raises(JoinRefused, match=match):
        roster.join(name, payload)
    assert state(roster) == before
    assert roster.counts() == {count: 1}


def valid_answer(name: str = "a") -> bytes:
    rows = {"a": [0, 1, 2, 3], "b": [4, 5, 6, 7]}[name]
    return encode_actions(4, actions(rows))


class EncodedBackend:
    """An AgentBackend of `runners` runners in this process."""

    def __init__(self, assignment: Assignment, runners: int = 3, *, backwards: bool = False) -> None:
        """`backwards` gives the first runner the last robots."""
        parts = split(assignment, runners)
        self._lockstep = Lockstep(parts[::-1] if backwards else parts)
        self._runners: dict[str, EncodedRunner] = {}
        self._order = np.random.default_rng(1)
        self._parts = len(parts)

    def start(self) -> None:
        """Let each runner join, decode its robots and make its agents."""
        for number in range(self._parts):
            name = f"r{number}"
            runner = self._runners[name] = EncodedRunner(partial(self._lockstep.join, name))
            self._lockstep.answer(name, runner.ready)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """One frame to every runner, one answer from each, in a random order."""
        answered: list[tuple[str, bytes]] = []
        for name, data in self._lockstep.open_tick(tick, readings, received, tx_status):
            answered.append((name, self._runners[name].answer(data)))
        for at in self._order.permutation(len(answered)):
            self._lockstep.answer(*answered[at])
        return self._lockstep.pop_actions()

    def counts(self) -> dict[str, int]:
        """Frames that were refused, by fault."""
        return self._lockstep.counts()

    def close(self) -> None:
        """Forget the agents."""
        self._runners.clear()
