"""The trajectory hash: equal exactly if motion and received packets of two runs of an arena agree bit for bit."""

# pyright: basic, reportUnknownMemberType=false

import hashlib

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.robot.packets import ReceivedPackets

WAITING_BYTES = 2**20  # hashed together at most, over all arenas


class TrajectoryHash:
    """SHA-256 per arena over, tick by tick, unrounded: poses, velocities, applied commands, packets received."""

    def __init__(self, arenas: int, robots: int) -> None:
        self._robots = robots
        self._hashes = [hashlib.sha256() for _ in range(arenas)]
        self._open = list(range(arenas))
        self._waiting: list[
            AnyArray
        ] = []  # of the ticks since anything was received, a row per robot of the open arenas

    def add(self, pose: FloatArray, velocity: FloatArray, command: FloatArray, received: ReceivedPackets) -> None:
        """One tick; tables are (rows, 3), a row per robot of all arenas, `received` is sorted by receiver."""
        if not self._open:
            return
        moved = np.concatenate((pose, velocity, command), axis=1)
        if len(self._open) < len(self._hashes):
            moved = moved.reshape(len(self._hashes), -1)[self._open]
        self._waiting.append(moved)
        if len(received) or len(self._waiting) * moved.nbytes >= WAITING_BYTES:
            self._hash_waiting()
        if len(received):
            columns = received.receiver, received.sender_index, received.sequence, received.received_at_ns
            packets, first = _packets(*columns, self._robots, len(self._hashes))
            self._add(packets, [*first[self._open].tolist(), len(packets)])

    def close(self, arenas: BoolArray) -> None:
        """Nothing more goes into the hashes of these arenas (arenas,): nothing is received there from now on."""
        self._hash_waiting()
        self._open = [arena for arena in self._open if not arenas[arena]]

    def _hash_waiting(self) -> None:
        """Hash the ticks that wait, all of an arena at once: a call for each would cost more than the hashing."""
        if self._waiting:
            arenas = len(self._open)
            parts = [moved.reshape(arenas, -1) for moved in self._waiting]
            self._waiting.clear()
            self._add(parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1), list(range(arenas + 1)))

    def _add(self, table: AnyArray, first: list[int]) -> None:
        """The rows first[k] to first[k + 1] - 1 of a table go into the hash of the k-th open arena."""
        row_bytes, view = table.shape[1] * table.itemsize, table.data.cast("B")
        for arena, start, stop in zip(self._open, first[:-1], first[1:], strict=True):
            self._hashes[arena].update(view[start * row_bytes : stop * row_bytes])

    def hexdigests(self) -> list[str]:
        """The hash of each arena so far."""
        self._hash_waiting()
        return [digest.hexdigest() for digest in self._hashes]


@njit()
def _packets(receiver, sender, sequence, received_at_ns, robots, arenas):
    """What was received, (k, 4), receivers as indices in their arenas; and the first row of each arena, (arenas,)."""
    table, first = np.empty((len(receiver), 4), np.int64), np.zeros(arenas + 1, np.int64)
    for k in range(len(receiver)):
        arena = receiver[k] // robots
        first[arena + 1] = k + 1
        table[k, 0], table[k, 1] = receiver[k] - arena * robots, sender[k]
        table[k, 2], table[k, 3] = sequence[k], received_at_ns[k]
    for arena in range(arenas):  # those that received nothing
        first[arena + 1] = max(first[arena + 1], first[arena])
    return table, first[:-1]
