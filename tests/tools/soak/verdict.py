"""Whether a soak came out flat: the first stable stretch of its samples against the last."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from tests.tools.soak.samples import Sample, cpu_per_tick_ms

WARM_UP = 1 / 6  # of the time: kernels are loaded, runners have all been there, buffers have had their largest content
STRETCH = 1 / 6  # of the time: how long the first and the last stable stretch are
MAX_GROWTH = 0.05  # of memory, descriptors and threads
MAX_SLOWER = 0.10  # of the processor time of a tick: the machine has other work, too


@dataclass(frozen=True)
class Flat:
    """One quantity of one process."""

    who: str
    what: str
    first: float
    last: float
    most: float  # growth that is allowed

    @property
    def growth(self) -> float:
        """From the first stretch to the last, as a share."""
        return self.last / self.first - 1.0 if self.first else 0.0

    @property
    def holds(self) -> bool:
        """Whether it did not grow."""
        return self.growth <= self.most


def flatness(samples: Mapping[str, Sequence[Sample]], end_s: float) -> list[Flat]:
    """All quantities of all processes."""
    found: list[Flat] = []
    warm_s, stretch_s = WARM_UP * end_s, STRETCH * end_s
    for who, rows in samples.items():
        if who.endswith("viewer"):  # keeps what it was shown, up to the 2 GB that it is given
            continue
        first = [row for row in rows if warm_s <= row.at_s < warm_s + stretch_s]
        last = [row for row in rows if row.at_s >= end_s - stretch_s]
        if not first or not last:
            continue
        for what, name in (("memory, MiB", "rss_mib"), ("descriptors", "descriptors"), ("threads", "threads")):
            ends = [median(float(getattr(row, name)) for row in part) for part in (first, last)]
            found.append(Flat(who, what, *ends, MAX_GROWTH))
        costs = cpu_per_tick_ms(rows)
        thirds = [[ms for at_s, ms in costs if low <= at_s < high] for low, high in _thirds(warm_s, end_s)]
        if who.endswith("world") and all(thirds):
            found.append(Flat(who, "processor time of a tick, ms", median(thirds[0]), median(thirds[-1]), MAX_SLOWER))
            walls = [[row.tick_ms for row in rows if low <= row.at_s < high] for low, high in _thirds(warm_s, end_s)]
            found.append(Flat(who, "wall time of a tick, ms", median(walls[0]), median(walls[-1]), float("inf")))
    return found


def _thirds(warm_s: float, end_s: float) -> list[tuple[float, float]]:
    third_s = (end_s - warm_s) / 3
    return [(warm_s + at * third_s, warm_s + (at + 1) * third_s + 1e-6) for at in range(3)]
