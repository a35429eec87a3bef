"""The links of a recording that carry frames of robots' interfaces, with their bytes per second."""

from collections import deque
from typing import Any

import numpy as np
import rerun as rr

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.ethernet import FRAME_TAG
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import ReceptionRecords, Static
from swarmwire.metrics.torus import link_lines
from swarmwire.metrics.viewer.rows import RerunRows

_COLOR = (235, 235, 240)
_ORDER = 1.7  # above the links and the lost packets, below the robots
_THIN, _PER_DECADE = 0.7, 0.6  # radius of 100 bytes per second in ui points, and what ten times as many add
_THIN_BYTES_S = 100.0


class RerunTraffic:
    """Lines between the robots of one arena that received frames from one another in the last second."""

    def __init__(self, static: Static, arena: int) -> None:
        """Draw this arena of the run."""
        self._static, self._arena = static, arena
        self._second: deque[tuple[IntArray, IntArray]] = deque(maxlen=static.rate_hz)  # per tick: links, bytes
        self._drawn = False

    def begin(self, rec: Any) -> None:
        """Log the constants."""
        rec.log("world/traffic", rr.LineStrips2D.from_fields(colors=_COLOR, draw_order=_ORDER), static=True)

    def see(self, finished: ReceptionRecords) -> None:
        """Count the frames received since the last tick."""
        frames = (finished.arena == self._arena) & (finished.fate == Fate.RECEIVED) & (finished.tag == FRAME_TAG)
        sender, receiver = finished.sender[frames], finished.receiver[frames]
        link = np.minimum(sender, receiver) * self._static.robots + np.maximum(sender, receiver)
        self._second.append((link, finished.size_bytes[frames]))

    def add(self, rows: RerunRows, position_m: FloatArray) -> None:
        """Add a tick's lines between the robots at position_m (robots, 2), if there are any, or were."""
        links, bytes_s = self._rates()
        if not (len(links) or self._drawn):
            return
        self._drawn = bool(len(links))
        lines = link_lines(position_m, np.stack(np.divmod(links, self._static.robots), axis=1), self._static)
        labels = [_words(rate) for rate in bytes_s.tolist()]
        labels += [""] * (len(lines) - len(links))  # on a torus the second halves come last
        radii = _THIN + _PER_DECADE * np.log10(np.maximum(bytes_s / _THIN_BYTES_S, 1.0))
        radii = np.concatenate([radii, np.full(len(lines) - len(links), _THIN)])
        rows.add("world/traffic", _strips, strips=lines.astype(np.float32), points=radii, labels=labels)

    def _rates(self) -> tuple[IntArray, FloatArray]:
        """The links with frames in the last second, as lesser index x robots + greater index, and bytes per second."""
        if not self._second:
            return np.empty(0, np.int64), np.empty(0)
        link, size_bytes = (np.concatenate(column) for column in zip(*self._second, strict=True))
        links, place = np.unique(link, return_inverse=True)
        return links, np.bincount(place, size_bytes, len(links)) * self._static.rate_hz / len(self._second)


def _strips(strips: Any, points: FloatArray, labels: list[str]) -> Any:
    return rr.LineStrips2D.columns(strips=strips, radii=-points, labels=labels)  # rerun's ui points are negative radii


def _words(bytes_s: float) -> str:
    if bytes_s < 1e3:
        return f"{bytes_s:.0f} B/s"
    return f"{bytes_s / 1e3:.1f} kB/s" if bytes_s < 1e6 else f"{bytes_s / 1e6:.1f} MB/s"
