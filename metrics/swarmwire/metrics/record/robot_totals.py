"""The table `radio_robots`: a row per robot, with what became of its packets and of those meant for it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.comms.truth import Static, Truth
from swarmwire.metrics.network.robot_counts import RobotCounts
from swarmwire.metrics.record.totals_recorder import TotalsRecorder

if TYPE_CHECKING:
    import polars as pl

BITS_PER_BYTE = 8
# Decided before any receiver is: by the sender alone, or of receivers that are not listed.
SENDERS_FATES = {
    Fate.OUT_OF_RANGE,
    Fate.QUEUE_FULL,
    Fate.TOO_LARGE,
    Fate.IN_FLIGHT,
    Fate.SENDER_DEAD,
    Fate.CHANNEL_BUSY,
}
RECEIVERS_FATES = tuple(fate for fate in Fate if fate not in SENDERS_FATES)


class RobotTotals(TotalsRecorder):
    """Observer that writes `radio_robots.parquet`. `RunFolder.radio_robots` says what its columns are."""

    name = "radio_robots"

    def start(self, static: Static) -> None:
        """Nothing is counted so far."""
        self._static, self._counts = static, RobotCounts(static)
        self._ticks = np.zeros(static.arenas, np.int64)  # of each arena

    def add(self, truth: Truth) -> None:
        """Add what a tick brought."""
        self._ticks += truth.running
        if truth.departed is not None and truth.finished is not None:
            self._counts.see(truth.departed, truth.finished)

    def frame(self) -> "pl.DataFrame":
        """A row per arena and robot."""
        import polars as pl

        static, counts = self._static, self._counts
        time_s = np.repeat(self._ticks, static.robots) / static.rate_hz
        as_sender = counts.as_sender.copy()
        as_sender[:, Fate.IN_FLIGHT] = counts.in_flight
        columns: dict[str, Any] = {
            "arena": np.repeat(np.arange(static.arenas), static.robots),
            "robot": list(static.robot_names) * static.arenas,
            "packets": counts.packets,
            "packets_on_air": counts.packets_on_air,
            "airtime_s": counts.on_air_ns / NS_PER_S,
            "airtime": counts.on_air_ns / NS_PER_S / time_s,
            "received_bytes": counts.received_bytes,
            "throughput_bps": BITS_PER_BYTE * counts.received_bytes / time_s,
            "intended": counts.intended,
            **{f"as_sender_{FATE_NAMES[fate]}": as_sender[:, fate] for fate in Fate},
            **{f"as_receiver_{FATE_NAMES[fate]}": counts.as_receiver[:, fate] for fate in RECEIVERS_FATES},
        }
        return pl.DataFrame(columns, schema=robot_totals_schema())


def robot_totals_schema() -> "dict[str, Any]":
    """The type of each column."""
    import polars as pl

    return {
        "arena": pl.Int32,
        "robot": pl.String,
        "packets": pl.Int64,
        "packets_on_air": pl.Int64,
        "airtime_s": pl.Float64,
        "airtime": pl.Float64,
        "received_bytes": pl.Int64,
        "throughput_bps": pl.Float64,
        "intended": pl.Int64,
        **{f"as_sender_{FATE_NAMES[fate]}": pl.Int64 for fate in Fate},
        **{f"as_receiver_{FATE_NAMES[fate]}": pl.Int64 for fate in RECEIVERS_FATES},
    }
