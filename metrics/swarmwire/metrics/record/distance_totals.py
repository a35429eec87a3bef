"""The table `radio_distances`: the delivery ratio over distance, a row per bin."""

from typing import TYPE_CHECKING, Any

import numpy as np

from swarmwire.comms.truth import Static, Truth
from swarmwire.metrics.network.distance_counts import DistanceCounts
from swarmwire.metrics.record.totals_recorder import TotalsRecorder

if TYPE_CHECKING:
    import polars as pl


class DistanceTotals(TotalsRecorder):
    """Observer that writes `radio_distances.parquet`. `RunFolder.radio_distances` says what its columns are.

    The summary says besides: `every` (one of so many packets was counted) and `unknown` (receivers that
    received, at a distance that was not known any more).
    """

    name = "radio_distances"

    def start(self, static: Static) -> None:
        """Nothing is counted so far."""
        self._counts = DistanceCounts(static)

    def add(self, truth: Truth) -> None:
        """Add what a tick brought."""
        self._counts.see(truth)

    def frame(self) -> "pl.DataFrame":
        """A row per arena and bin, up to the last that any receiver was in."""
        import polars as pl

        counts = self._counts
        bins = int(np.flatnonzero(counts.intended.any(axis=0)).max(initial=-1)) + 1
        arenas, intended, received = (
            len(counts.intended),
            counts.intended[:, :bins].ravel(),
            counts.received[:, :bins].ravel(),
        )
        edges_m = counts.width_m * np.arange(bins + 1)
        known = (intended > 0) & (counts.unknown == 0)
        columns: dict[str, Any] = {
            "arena": np.repeat(np.arange(arenas), bins),
            "from_m": np.tile(edges_m[:-1], arenas),
            "to_m": np.tile(edges_m[1:], arenas),
            "intended": intended,
            "received": received,
            "pdr": pl.Series(np.divide(received, intended, out=np.full(len(received), np.nan), where=known)).fill_nan(
                None
            ),
        }
        return pl.DataFrame(columns, schema_overrides=distance_totals_schema())

    def about(self) -> dict[str, Any]:
        """How many packets were left out."""
        return {"every": self._counts.every, "unknown": self._counts.unknown}


def distance_totals_schema() -> "dict[str, Any]":
    """The type of each column."""
    import polars as pl

    return {
        "arena": pl.Int32,
        "from_m": pl.Float64,
        "to_m": pl.Float64,
        "intended": pl.Int64,
        "received": pl.Int64,
        "pdr": pl.Float64,
    }
