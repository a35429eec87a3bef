"""The trajectory hash is that of what each arena moved and received, tick by tick, however it is gathered."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.packets import ReceivedPackets
from swarmwire.world import trajectory_hash
from swarmwire.world.trajectory_hash import TrajectoryHash

ARENAS, ROBOTS, TICKS = 3, 2, 9
ROWS = ARENAS * ROBOTS


def moved(tick: int) -> list[np.ndarray]:
    return [np.arange(ROWS * 3.0).reshape(ROWS, 3) + 100.0 * tick + kind for kind in (0.1, 0.2, 0.3)]


def received(tick: int, open_arenas: list[int]) -> ReceivedPackets:
    """In every third tick a robot of each open arena hears one packet."""
    if tick % 3:
        return ReceivedPackets.none()
    receiver = np.array([arena * ROBOTS + 1 for arena in open_arenas], np.int64)
    zeros = np.zeros(len(receiver), np.int64)
    return replace(
        ReceivedPackets.none(),
        receiver=receiver,
        sender=zeros,
        sequence=zeros + tick,
        received_at_ns=zeros + 7,
        payload=zeros,
    )


def expected(closed_after: dict[int, int]) -> list[str]:
    digests = [hashlib.sha256() for _ in range(ARENAS)]
    for tick in range(TICKS):
        for arena in range(ARENAS):
            if tick > closed_after.get(arena, TICKS):
                continue
            rows = slice(arena * ROBOTS, (arena + 1) * ROBOTS)
            digests[arena].update(np.concatenate(moved(tick), axis=1)[rows].tobytes())
            if tick % 3 == 0:
                digests[arena].update(np.array([1, 0, tick, 7], np.int64).tobytes())
    return [digest.hexdigest() for digest in digests]


@pytest.mark.parametrize("waiting_bytes", [1, 1000, 2**20])
@pytest.mark.parametrize("closed_after", [{}, {1: 3}, {0: 0, 2: 4}, {0: 2, 1: 2, 2: 7}])
def test_it_does_not_depend_on_how_many_ticks_are_hashed_at_once(waiting_bytes, closed_after, monkeypatch):
    monkeypatch.setattr(trajectory_hash, "WAITING_BYTES", waiting_bytes)
    of, running = TrajectoryHash(ARENAS, ROBOTS), list(range(ARENAS))
    for tick in range(TICKS):
        of.add(*moved(tick), received(tick, running))
        over = [arena for arena in running if closed_after.get(arena, TICKS) == tick]
        if over:
            of.close(np.isin(np.arange(ARENAS), over))
            running = [arena for arena in running if arena not in over]
    assert of.hexdigests() == expected(closed_after)


def test_asking_for_it_changes_nothing():
    asked, left = TrajectoryHash(ARENAS, ROBOTS), TrajectoryHash(ARENAS, ROBOTS)
    for tick in range(TICKS):
        for of in (asked, left):
            of.add(*moved(tick), received(tick, list(range(ARENAS))))
        asked.hexdigests()
    assert asked.hexdigests() == left.hexdigests() == expected({})
