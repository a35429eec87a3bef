"""Rows of a recording that change from tick to tick, sent to rerun in blocks of many ticks."""

from collections.abc import Callable, Sequence
from itertools import chain
from sys import getsizeof
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray

Values = AnyArray | Sequence[Any]
ROW_BYTES = 300  # that a row takes beside its fields, about


class RerunRows:
    """Rows of entities, one per change. A call to rerun for each would be most of the cost of recording.

    Attributes:
        rec: the recording of the rows; constants are logged there directly.
        kept_bytes: the approximate size of the rows that wait.
    """

    def __init__(self, rec: Any) -> None:
        """Keep rows of this recording."""
        self.rec, self.kept_bytes = rec, 0
        self._tick, self._time_ns = 0, 0
        self._kept: dict[tuple[Any, ...], list[tuple[int, int, tuple[Values, ...]]]] = {}

    def begin_tick(self, tick: int, time_ns: int) -> None:
        """Set the tick of the following rows."""
        self._tick, self._time_ns = tick, time_ns

    def add(self, entity: str, columns: Callable[..., Any], **fields: Values) -> None:
        """Keep a row of an entity for this tick: n items, as fields (n, …) that the caller no longer changes.

        `columns` makes rerun's columns of the items of many ticks, one after another: an archetype's, of its fields, or
        a function that works them out for all ticks together. Fields of the entity that it does not make stay.
        """
        values = tuple(fields.values())
        self._kept.setdefault((entity, columns, *fields), []).append((self._tick, self._time_ns, values))
        self.kept_bytes += ROW_BYTES + sum(map(_bytes, values))

    def send_now(self, entity: str, columns: Any) -> None:
        """Send a row of an entity for this tick, as rerun's columns."""
        self.rec.send_columns(entity, _index((self._tick,), (self._time_ns,)), columns)

    def send(self) -> None:
        """Send the rows. If an entity fails, the others are still sent, and the first error is raised at the end."""
        kept, self._kept, self.kept_bytes = self._kept, {}, 0
        index: dict[tuple[int, ...], list[Any]] = {}
        failed: list[Exception] = []
        for (entity, columns, *names), rows in kept.items():
            ticks, times_ns, values = zip(*rows, strict=True)
            if ticks not in index:
                index[ticks] = _index(ticks, times_ns)
            by_name = zip(names, zip(*values, strict=True), strict=True)
            lengths = [len(of_tick[0]) for of_tick in values]
            try:
                fields = {name: _joined(of_ticks) for name, of_ticks in by_name}
                self.rec.send_columns(entity, index[ticks], columns(**fields).partition(lengths))
            except Exception as error:  # noqa: BLE001 - any error: the others' rows are still sent
                failed.append(error)
        if failed:
            raise failed[0]


def _index(ticks: tuple[int, ...], times_ns: tuple[int, ...]) -> list[Any]:
    import rerun as rr

    times = np.array(times_ns, "timedelta64[ns]")
    return [rr.TimeColumn("tick", sequence=np.array(ticks)), rr.TimeColumn("sim_time", duration=times)]


def _bytes(values: Values) -> int:
    """The size of a field in bytes."""
    if isinstance(values, np.ndarray):
        return values.nbytes
    return sum(item.nbytes if isinstance(item, np.ndarray) else getsizeof(item) for item in values)


def _joined(of_ticks: Sequence[Values]) -> Values:
    if all(isinstance(one, np.ndarray) for one in of_ticks):
        return np.concatenate(of_ticks)
    return list(chain.from_iterable(of_ticks))
