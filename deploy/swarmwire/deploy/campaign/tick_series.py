"""Each tick's metrics of all arenas of a world, kept in memory and given back as a Parquet file."""

from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Static, Truth
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.run_folder.writer import PARQUET

Values = NDArray[np.float32]


class TickSeries(Observer):
    """Observer that keeps the metrics' values of each tick, 4 bytes per metric and arena."""

    def __init__(self, metrics: Metrics) -> None:
        """`metrics` must see each tick before."""
        self._metrics = metrics
        self._ticks: list[Values] = []  # each (metrics, arenas)

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._ticks = []

    def see(self, truth: Truth) -> None:
        """Keep this tick."""
        self._ticks.append(self._metrics.values.astype(np.float32))

    def parquet(self, runs: Sequence[int], ticks: Sequence[int]) -> bytes:
        """The file: `run`, `tick`, a float32 column per metric (NaN: no value); of each arena as many ticks as given.

        Rows rise by run and tick, where `runs` do, the number of each arena's.
        """
        import polars as pl

        names = [metric.name for metric in self._metrics.metrics]
        values = np.stack(self._ticks) if self._ticks else np.empty((0, len(names), len(runs)), np.float32)
        columns: dict[str, Any] = {
            "run": np.repeat(np.array(runs, np.int64), ticks),
            "tick": np.concatenate([np.arange(count, dtype=np.int32) for count in ticks]),
        }
        for place, name in enumerate(names):
            of_arenas = [values[:count, place, arena] for arena, count in enumerate(ticks)]
            columns[name] = np.concatenate(of_arenas)
        file = BytesIO()
        pl.DataFrame(columns).write_parquet(file, **PARQUET)
        return file.getvalue()
