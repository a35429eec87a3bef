"""The trajectory hash: equal if and only if motion and received packets of two runs of an arena agree bit for bit."""

import hashlib

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.robot.packets import ReceivedPackets

MAX_PENDING_BYTES = 2**20  # hashed together at most, over all arenas


class TrajectoryHash:
    """SHA-256 per arena over, tick by tick, unrounded: poses, velocities, applied commands, packets received."""

    def __init__(self, arenas: int, robots: int) -> None:
        self._robots = robots
        self._hashes = [hashlib.sha256() for _ in range(arenas)]
        self._open = list(range(arenas))
        # Ticks that are not hashed yet, all since the last reception; a row per robot of the open arenas.
        self._pending: list[AnyArray] = []

    def add(self, pose: FloatArray, velocity: FloatArray, command: FloatArray, received: ReceivedPackets) -> None:
        """Add one tick: tables are (rows, 3), a row per robot of all arenas; `received` is sorted by receiver.

        Where a source moves robots, `pose` is (rows, 4), with heights.
        """
        if not self._open:
            return
        motion = np.concatenate((pose, velocity, command), axis=1)
        if len(self._open) < len(self._hashes):
            motion = motion.reshape(len(self._hashes), -1)[self._open]
        self._pending.append(motion)
        if len(received) or len(self._pending) * motion.nbytes >= MAX_PENDING_BYTES:
            self._hash_pending()
        if len(received):
            columns = received.receiver, received.sender_index, received.sequence, received.received_at_ns
            packets, first = _packets(*columns, self._robots, len(self._hashes))
            self._add(packets, [*first[self._open].tolist(), len(packets)])

    def close(self, arenas: BoolArray) -> None:
        """Add nothing more to the hashes of these arenas (arenas,), in which nothing is received from now on."""
        self._hash_pending()
        self._open = [arena for arena in self._open if not arenas[arena]]

    def _hash_pending(self) -> None:
        """Hash the pending ticks of an arena in one call: a call for each tick would cost more than the hashing."""
        if self._pending:
            arenas = len(self._open)
            parts = [motion.reshape(arenas, -1) for motion in self._pending]
            self._pending.clear()
            self._add(parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1), list(range(arenas + 1)))

    def _add(self, table: AnyArray, first: list[int]) -> None:
        """Add the rows first[k] to first[k + 1] - 1 of a table to the hash of the k-th open arena."""
        row_bytes, view = table.shape[1] * table.itemsize, table.data.cast("B")
        for arena, start, stop in zip(self._open, first[:-1], first[1:], strict=True):
            self._hashes[arena].update(view[start * row_bytes : stop * row_bytes])

    def hexdigests(self) -> list[str]:
        """Return the hash of each arena so far."""
        self._hash_pending()
        return [digest.hexdigest() for digest in self._hashes]


@njit()
def _packets(
    receiver: AnyArray, sender: AnyArray, sequence: AnyArray, received_at_ns: AnyArray, robots: int, arenas: int
):
    """Return the receptions, (k, 4), with receivers' indices in their arenas, and each arena's first row (arenas,)."""
    table, first = np.empty((len(receiver), 4), np.int64), np.zeros(arenas + 1, np.int64)
    for k in range(len(receiver)):
        arena = receiver[k] // robots
        first[arena + 1] = k + 1
        table[k, 0], table[k, 1] = receiver[k] - arena * robots, sender[k]
        table[k, 2], table[k, 3] = sequence[k], received_at_ns[k]
    for arena in range(arenas):  # arenas without receptions begin at the end of the arena before
        first[arena + 1] = max(first[arena + 1], first[arena])
    return table, first[:-1]
