"""Rows of a recording that change from tick to tick, sent to rerun in blocks of many ticks."""

from collections.abc import Callable, Sequence
from itertools import chain
from sys import getsizeof
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray

Values = AnyArray | Sequence[Any]
ROW_BYTES = 300  # approximate size of a row without its fields


class RerunRows:
    """Rows of entities, one per change, sent in blocks: separate calls of rerun would dominate the cost of recording.

    Attributes:
        rec: the recording of the rows; constants are logged there directly.
        buffered_bytes: approximate size of the rows that wait.
    """

    def __init__(self, rec: Any) -> None:
        """Buffer rows of this recording."""
        self.rec, self.buffered_bytes = rec, 0
        self._tick, self._time_ns = 0, 0
        self._buffered: dict[tuple[Any, ...], list[tuple[int, int, tuple[Values, ...]]]] = {}

    def begin_tick(self, tick: int, time_ns: int) -> None:
        """Set the tick of the following rows."""
        self._tick, self._time_ns = tick, time_ns

    def add(self, entity: str, columns: Callable[..., Any], **fields: Values) -> None:
        """Buffer a row of an entity for this tick: n items, as fields (n, …) that the caller no longer changes.

        `columns` makes rerun's columns from the concatenated items of many ticks: an archetype's `columns`, or a
        function that computes them for all ticks together. Other fields of the entity keep their values.
        """
        values = tuple(fields.values())
        self._buffered.setdefault((entity, columns, *fields), []).append((self._tick, self._time_ns, values))
        self.buffered_bytes += ROW_BYTES + sum(map(_bytes, values))

    def send_now(self, entity: str, columns: Any) -> None:
        """Send a row of an entity for this tick, as rerun's columns."""
        self.rec.send_columns(entity, _index((self._tick,), (self._time_ns,)), columns)

    def send(self) -> None:
        """Send the rows. If an entity fails, the others are still sent; then the first error is raised."""
        buffered, self._buffered, self.buffered_bytes = self._buffered, {}, 0
        index: dict[tuple[int, ...], list[Any]] = {}
        failed: list[Exception] = []
        for (entity, columns, *names), rows in buffered.items():
            ticks, times_ns, values = zip(*rows, strict=True)
            if ticks not in index:
                index[ticks] = _index(ticks, times_ns)
            by_name = zip(names, zip(*values, strict=True), strict=True)
            lengths = [len(tick_values[0]) for tick_values in values]
            try:
                fields = {name: _joined(ticks_values) for name, ticks_values in by_name}
                self.rec.send_columns(entity, index[ticks], columns(**fields).partition(lengths))
            except Exception as error:  # noqa: BLE001 - rows of other entities are still sent after any error
                failed.append(error)
        if failed:
            raise failed[0]


def _index(ticks: tuple[int, ...], times_ns: tuple[int, ...]) -> list[Any]:
    import rerun as rr

    times = np.array(times_ns, "timedelta64[ns]")
    return [rr.TimeColumn("tick", sequence=np.array(ticks)), rr.TimeColumn("sim_time", duration=times)]


def _bytes(values: Values) -> int:
    """Return the size of a field in bytes."""
    if isinstance(values, np.ndarray):
        return values.nbytes
    return sum(item.nbytes if isinstance(item, np.ndarray) else getsizeof(item) for item in values)


def _joined(parts: Sequence[Values]) -> Values:
    if all(isinstance(part, np.ndarray) for part in parts):
        return np.concatenate(parts)
    return list(chain.from_iterable(parts))
