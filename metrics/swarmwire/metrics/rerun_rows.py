"""What changes in a recording from tick to tick: kept, and sent to rerun for many ticks at once."""

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np

from swarmwire.comms.arrays import AnyArray

MOST_KEPT_BYTES = 4_000_000


class RerunRows:
    """Rows of entities: what each shows from a tick on. A call per entity and tick would cost ten times as much.

    Attributes:
        rec: the recording that the rows go to; what does not change is logged there at once.
        full: whether so much is kept that it should be sent now.
    """

    def __init__(self, rec: Any) -> None:
        """Keep rows of this recording."""
        self.rec = rec
        self._tick, self._time_ns, self._bytes = 0, 0, 0
        self._kept: dict[tuple[Any, ...], list[tuple[int, int, tuple[AnyArray | Sequence[Any], ...]]]] = {}

    @property
    def full(self) -> bool:
        """Whether so much is kept that it should be sent now."""
        return self._bytes >= MOST_KEPT_BYTES

    def begin_tick(self, tick: int, time_ns: int) -> None:
        """What is added from now on belongs to this tick."""
        self._tick, self._time_ns = tick, time_ns

    def add(self, entity: str, archetype: Any, **fields: AnyArray | Sequence[Any]) -> None:
        """Keep what an entity shows in this tick: fields of an archetype, (n, …) each; fields not named stay."""
        values = tuple(fields.values())
        self._kept.setdefault((entity, archetype, *fields), []).append((self._tick, self._time_ns, values))
        self._bytes += sum(one.nbytes for one in values if isinstance(one, np.ndarray))

    def send(self) -> None:
        """Send what was kept."""
        import rerun as rr

        kept, self._kept, self._bytes = self._kept, {}, 0
        for (entity, archetype, *names), rows in kept.items():
            ticks, times_ns, values = zip(*rows, strict=True)
            elapsed = np.array(times_ns, "timedelta64[ns]")
            index = [rr.TimeColumn("tick", sequence=ticks), rr.TimeColumn("sim_time", duration=elapsed)]
            columns = {name: _joined(of_ticks) for name, of_ticks in zip(names, zip(*values, strict=True), strict=True)}
            lengths = [len(of_tick[0]) for of_tick in values]
            self.rec.send_columns(entity, index, archetype.columns(**columns).partition(lengths))


def _joined(of_ticks: Sequence[AnyArray | Sequence[Any]]) -> AnyArray | list[Any]:
    if all(isinstance(one, np.ndarray) for one in of_ticks):
        return np.concatenate(of_ticks)
    return list(chain.from_iterable(of_ticks))
