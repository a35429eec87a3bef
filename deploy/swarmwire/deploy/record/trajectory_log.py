"""How a run went, tick by tick, in 8 bytes each: `trajectory.digests`, by which two runs are told apart at the tick.

Each is the start of a SHA-256 over the trajectory hashes of all arenas so far. A run that is killed leaves them for all
ticks that it did.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

from swarmwire.comms.errors import BadInput
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.metrics.run_folder.layout import DIGEST_BYTES, DIGESTS

Hashes = Callable[[], list[str]]  # the trajectory hash of each arena so far


class TrajectoryLog(Observer):
    """Observer that writes the digest of each tick into the run folder, at once."""

    def __init__(self, folder: Path, hashes: Hashes) -> None:
        self._path, self._hashes = folder / DIGESTS, hashes
        self._file: BinaryIO | None = None

    def begin(self, static: Static) -> None:
        """Open the file."""
        self._file = self._path.open("wb", buffering=0)

    def see(self, truth: Truth) -> None:
        """Write the digest of this tick."""
        if self._file is not None:
            self._file.write(_digest(self._hashes))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Close the file."""
        if self._file is not None:
            self._file.close()
        return {}


class TrajectoryCheck(Observer):
    """Observer that compares each tick with that of another run, as far as that logged it.

    Attributes:
        compared: ticks that were compared.
        first_difference: the first tick that came out differently; None: so far none.
    """

    def __init__(self, folder: Path, hashes: Hashes) -> None:
        self._expected, self._hashes = _logged(folder), hashes
        self.compared = 0
        self.first_difference: int | None = None

    def see(self, truth: Truth) -> None:
        """Compare this tick."""
        start = truth.tick * DIGEST_BYTES
        expected = self._expected[start : start + DIGEST_BYTES]
        if len(expected) < DIGEST_BYTES:
            return
        self.compared += 1
        if self.first_difference is None and _digest(self._hashes) != expected:
            self.first_difference = truth.tick


def _digest(hashes: Hashes) -> bytes:
    return hashlib.sha256("".join(hashes()).encode()).digest()[:DIGEST_BYTES]


def ticks_logged(folder: Path) -> int:
    """How many ticks the run of this folder logged."""
    return len(_logged(folder)) // DIGEST_BYTES


def _logged(folder: Path) -> bytes:
    try:
        return (folder / DIGESTS).read_bytes()
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise BadInput(str(folder / DIGESTS), "", f"expected a readable file: {error.strerror}") from None
