"""Memory, descriptors, threads and processor time of the processes of a soak, and their growth."""

from collections.abc import Mapping
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import psutil

MIB = 1024 * 1024
WARM_UP = 1 / 6  # share of the time: kernels, runners and buffers reach their full size
STRETCH = 1 / 6  # share of the time: length of the first and the last stretch
# quantity, its column, and the growth that is allowed: a connection is a thread or two of some thirty, and other work
# of the machine makes ticks longer, too
QUANTITIES = (("memory, MiB", "rss_mib", 0.03), ("descriptors", "descriptors", 0.03), ("threads", "threads", 0.07))
OF_WORLDS = (("processor time of a tick, ms", "tick_cpu_ms", 0.10), ("wall time of a tick, ms", "tick_ms", inf))


def take_samples(path: Path, pids: Mapping[str, int | None], **shared: Any) -> None:
    """Append a row for each process that exists, with these values shared by all: `at_s`, `tick`, …"""
    rows: list[dict[str, Any]] = []
    for name, pid in pids.items():
        with suppress(psutil.Error):
            if pid is not None:
                process = psutil.Process(pid)
                memory, cpu = process.memory_info(), process.cpu_times()
                row = {"rss_mib": memory.rss / MIB, "descriptors": process.num_fds(), "threads": process.num_threads()}
                rows.append({**shared, "process_name": name, **row, "cpu_s": cpu.user + cpu.system})
    with path.open("ab") as file:
        pl.DataFrame(rows).write_csv(file, include_header=bool(rows) and not file.tell(), float_precision=3)


def growths(samples: pl.DataFrame) -> list[dict[str, Any]]:
    """Medians of each quantity of each process in the first and the last stretch, and whether it may grow so."""
    grown: list[dict[str, Any]] = []
    at_s, end_s = pl.col("at_s"), float(samples["at_s"].to_numpy().max())
    first = at_s.is_between(WARM_UP * end_s, (WARM_UP + STRETCH) * end_s, closed="left")
    last = at_s >= (1.0 - STRETCH) * end_s
    tick_cpu_ms = 1000.0 * pl.col("cpu_s").diff() / pl.col("tick").diff()
    for (name,), rows in samples.group_by("process_name", maintain_order=True):
        timed = rows.with_columns(tick_cpu_ms=pl.when(pl.col("tick").diff() > 0).then(tick_cpu_ms))
        for quantity, column, limit in QUANTITIES + OF_WORLDS * str(name).endswith("world"):
            ends = [timed.filter(stretch)[column].drop_nulls().to_numpy() for stretch in (first, last)]
            if all(map(len, ends)):
                before, after = (float(np.median(end)) for end in ends)
                growth = after / before - 1.0 if before else 0.0
                grown.append({"process_name": name, "quantity": quantity, "first": before, "last": after,
                              "growth": growth, "holds": growth <= limit})  # fmt: skip
    return grown
