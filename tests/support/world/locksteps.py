"""Two runners and eight robots in lockstep, as tests play it; their hand-shake in real time, too."""

from typing import Any, TypeVar

import msgpack
import numpy as np

from swarmwire.comms.assignment import Assignment
from swarmwire.comms.packets import BROADCAST, Payloads, SentPackets
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.realtime import RealTime
from tests.support.agent.hosts import MEASURES, assignment, group, readings

R = TypeVar("R", Lockstep, RealTime)
GROUPS = {"flock", "scouts", "lone"}
FLOCK, SCOUTS = [0, 1, 4, 5], [2, 6]  # rows of the two groups; robot 3 and 7 are a third


def parts(owners: dict[int, int]) -> list[Assignment]:
    """One assignment for each slot: which slot owns each row."""
    groups = {"flock": FLOCK, "scouts": SCOUTS, "lone": [3, 7]}
    own: list[Assignment] = []
    for slot in sorted(set(owners.values())):
        rows = {name: [row for row in all_rows if owners[row] == slot] for name, all_rows in groups.items()}
        own.append(assignment(*(group("unused:Agent", mine, name) for name, mine in rows.items() if mine)))
    return own


def two_parts() -> list[Assignment]:
    return parts({row: row // 4 for row in range(8)})


def two() -> Lockstep:
    return Lockstep(two_parts())


def two_in_real_time() -> RealTime:
    return RealTime(two_parts(), watchdog_s=0.5, timeout_s=30.0, on_loss="stop")


def request(version: Any = frames.VERSION, **asked: Any) -> bytes:
    return msgpack.packb({"v": version, **asked})


def joined(roster: R, *names: str) -> R:
    for name in names:
        roster.join(name, request())
    return roster


def ready(roster: R, *names: str) -> R:
    for name in names:
        roster.answer(name, frames.encode("ready", -1, {}))
    return roster


def playing() -> Lockstep:
    return ready(joined(two(), "a", "b"), "a", "b")


def all_readings(tick: int = 0) -> Readings:
    return {"flock": readings(tick, FLOCK), "scouts": readings(tick, SCOUTS), "lone": readings(tick, [3, 7])}


def actions(rows: list[int]) -> Actions:
    row = np.array(rows, np.int64)
    payloads = Payloads.of([bytes([r, r, r]) for r in rows])
    sent = SentPackets(row, np.full(len(rows), BROADCAST), payloads)
    return Actions(row, row % 2 == 0, row * 0.1, row * -0.1, row * 0.2, sent)


def rows_of(frame: bytes) -> list[int]:
    found, *_ = decode_tick(frames.decode(frame), MEASURES, GROUPS)
    return [row for part in found.values() for row in part.rows.tolist()]


def state(roster: Lockstep | RealTime) -> Any:
    slots = [
        (slot.runner, slot.state, slot.rows.tolist(), id(getattr(slot, "actions", None)))
        for slot in roster._allocations
    ]
    return slots, sorted(roster._by_runner), roster._tick


def sound(name: str = "a") -> bytes:
    rows = {"a": [0, 1, 2, 3], "b": [4, 5, 6, 7]}[name]
    return encode_actions(4, actions(rows))
