"""The trajectory hash: equal exactly where two runs of an arena moved and heard the same, bit for bit."""

import hashlib

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.packets import Heard


class TrajectoryHash:
    """SHA-256 per arena over, tick by tick, unrounded: poses, velocities, applied commands, and all that was heard."""

    def __init__(self, arenas: int, robots: int) -> None:
        self._robots = robots
        self._hashes = [hashlib.sha256() for _ in range(arenas)]

    def add(self, pose: FloatArray, velocity: FloatArray, command: FloatArray, heard: Heard) -> None:
        """One tick; tables have a row per robot of all arenas, `heard` is sorted by receiver."""
        state = np.concatenate([pose, velocity, command], axis=1)
        index = heard.receiver % self._robots
        packets = np.stack([index, heard.sender, heard.sequence, heard.heard_at_ns], axis=1)
        first_row = np.arange(len(self._hashes) + 1) * self._robots
        first_packet = np.searchsorted(heard.receiver, first_row)
        for arena, digest in enumerate(self._hashes):
            digest.update(state[first_row[arena] : first_row[arena + 1]].data)
            digest.update(packets[first_packet[arena] : first_packet[arena + 1]].data)

    def hexdigests(self) -> list[str]:
        """The hash of each arena so far."""
        return [digest.hexdigest() for digest in self._hashes]
