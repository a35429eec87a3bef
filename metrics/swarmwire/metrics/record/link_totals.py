"""The table `radio_links`: a row per link and fate that occurred on it."""

from typing import TYPE_CHECKING, Any

from swarmwire.comms.packets import FATE_NAMES
from swarmwire.comms.truth import Static, Truth
from swarmwire.metrics.network.link_counts import LinkCounts
from swarmwire.metrics.record.totals_recorder import TotalsRecorder

if TYPE_CHECKING:
    import polars as pl


class LinkTotals(TotalsRecorder):
    """Observer that writes `radio_links.parquet`. `RunFolder.radio_links` says what its columns are."""

    name = "radio_links"

    def start(self, static: Static) -> None:
        """Nothing is counted so far."""
        self._counts = LinkCounts(static)

    def add(self, truth: Truth) -> None:
        """Add what a tick brought."""
        if truth.finished is not None:
            self._counts.see(truth.finished)

    def frame(self) -> "pl.DataFrame":
        """A row per arena, sender, receiver and fate."""
        import polars as pl

        columns: dict[str, Any] = dict(self._counts.columns())
        columns["fate"] = pl.Series(FATE_NAMES).gather(columns["fate"])
        return pl.DataFrame(columns, schema_overrides=link_totals_schema())


def link_totals_schema() -> "dict[str, Any]":
    """The type of each column."""
    import polars as pl

    return {
        "arena": pl.Int32,
        "sender": pl.Int32,
        "receiver": pl.Int32,
        "fate": pl.Enum(FATE_NAMES),
        "packets": pl.Int64,
    }
