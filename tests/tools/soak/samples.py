"""Memory, descriptors, threads and processor time of the processes of a soak, and their growth."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import get_type_hints

import psutil

MIB = 1024 * 1024


@dataclass(frozen=True)
class Sample:
    """One sample of one process."""

    at_s: float  # since the soak began
    process_name: str  # world, runner, …
    tick: int  # tick of its world
    rss_mib: float  # memory in use
    unshared_mib: float  # unshared part of it
    descriptors: int
    threads: int
    cpu_s: float  # processor time since it began
    tick_ms: float  # wall time of a tick, smoothed by the world; 0: it does not say
    events: int  # live events so far


class Samples:
    """The file of all samples."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with path.open("w", newline="") as file:
            csv.writer(file).writerow([field.name for field in fields(Sample)])

    def take(self, at_s: float, pids: Mapping[str, int | None], tick: int, tick_ms: float, events: int) -> None:
        """Sample these processes now, without those that are gone."""
        rows = [
            sample
            for name, pid in pids.items()
            if pid is not None and (sample := look(at_s, name, pid, tick, tick_ms, events)) is not None
        ]
        with self._path.open("a", newline="") as file:
            csv.writer(file).writerows(asdict(row).values() for row in rows)


def look(at_s: float, name: str, pid: int, tick: int, tick_ms: float, events: int) -> Sample | None:
    """A sample of a process, or None if it is gone."""
    try:
        process = psutil.Process(pid)
        memory, cpu = process.memory_full_info(), process.cpu_times()
        return Sample(
            round(at_s, 2),
            name,
            tick,
            round(memory.rss / MIB, 3),
            round(memory.uss / MIB, 3),
            process.num_fds(),
            process.num_threads(),
            round(cpu.user + cpu.system, 3),
            round(tick_ms, 3),
            events,
        )
    except psutil.Error:
        return None


def read_samples(path: Path) -> dict[str, list[Sample]]:
    """All samples of a file, by process."""
    kinds: dict[str, type[float | int | str]] = dict(get_type_hints(Sample))
    samples: dict[str, list[Sample]] = {}
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            sample = Sample(**{name: kinds[name](text) for name, text in row.items()})
            samples.setdefault(sample.process_name, []).append(sample)
    return samples


def cpu_per_tick_ms(samples: Iterable[Sample]) -> list[tuple[float, float]]:
    """Time, and processor time per tick since the previous sample."""
    rows = list(samples)
    return [
        (row.at_s, 1000.0 * (row.cpu_s - before.cpu_s) / (row.tick - before.tick))
        for before, row in pairwise(rows)
        if row.tick > before.tick
    ]


WARM_UP = 1 / 6  # share of the time: kernels, runners and buffers reach their full size
STRETCH = 1 / 6  # share of the time: length of the first and the last stretch
MAX_GROWTH = 0.03  # limit for memory, descriptors and threads
MAX_SLOWER = 0.10  # limit for the processor time of a tick: the machine has other work, too


@dataclass(frozen=True)
class Flat:
    """One quantity of one process."""

    process_name: str
    quantity: str
    first: float
    last: float
    most: float  # growth that is allowed

    @property
    def growth(self) -> float:
        """Growth from the first stretch to the last, as a share."""
        return self.last / self.first - 1.0 if self.first else 0.0

    @property
    def holds(self) -> bool:
        """True if the growth is within its limit."""
        return self.growth <= self.most


def flatness(samples: Mapping[str, Sequence[Sample]], end_s: float) -> list[Flat]:
    """All quantities of all processes."""
    quantities: list[Flat] = []
    warm_s, stretch_s = WARM_UP * end_s, STRETCH * end_s
    for name, rows in samples.items():
        if name.endswith("viewer"):  # keeps what it was shown, up to the 2 GB that it is given
            continue
        first = [row for row in rows if warm_s <= row.at_s < warm_s + stretch_s]
        last = [row for row in rows if row.at_s >= end_s - stretch_s]
        if not first or not last:
            continue
        for quantity, field in (("memory, MiB", "rss_mib"), ("descriptors", "descriptors"), ("threads", "threads")):
            ends = [median(float(getattr(row, field)) for row in part) for part in (first, last)]
            quantities.append(Flat(name, quantity, *ends, MAX_GROWTH))
        costs = cpu_per_tick_ms(rows)
        thirds = [[ms for at_s, ms in costs if low <= at_s < high] for low, high in _thirds(warm_s, end_s)]
        if name.endswith("world") and all(thirds):
            quantities.append(
                Flat(name, "processor time of a tick, ms", median(thirds[0]), median(thirds[-1]), MAX_SLOWER)
            )
            walls = [[row.tick_ms for row in rows if low <= row.at_s < high] for low, high in _thirds(warm_s, end_s)]
            quantities.append(Flat(name, "wall time of a tick, ms", median(walls[0]), median(walls[-1]), float("inf")))
    return quantities


def _thirds(warm_s: float, end_s: float) -> list[tuple[float, float]]:
    third_s = (end_s - warm_s) / 3
    return [(warm_s + at * third_s, warm_s + (at + 1) * third_s + 1e-6) for at in range(3)]
