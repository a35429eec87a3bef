"""One run as a row of `summary.parquet`: what was measured of it, or why it failed."""

from collections.abc import Collection
from typing import Any

from swarmwire.deploy.campaign.task import Row
from swarmwire.deploy.result import ArenaResult, Percentiles, RadioResult
from swarmwire.metrics.campaign.formats import FAILED

STATISTICS = ("final", "mean", "min", "max")
LATENCIES = ("latency_air_s", "latency_agent_s")
TOTALS = ("sent", "intended", "in_range", "pdr", "link_pdr")


def row_of(arena: ArenaResult, times: Collection[str]) -> Row:
    """What came of one arena, by column; of metrics that are `times` their last value alone."""
    row: Row = {
        "ended": arena.ended,
        "error": None,
        "ticks": arena.ticks,
        "sim_time_s": arena.sim_time_s,
        "trajectory_sha256": arena.trajectory_sha256,
        "stop_time_s": arena.stop_time_s,
        "stopped_by": arena.stopped_by,
    }
    for name, value in arena.metrics.items():
        if name in times:
            row[name] = value.final
        else:
            row.update({f"{name}.{statistic}": of for statistic, of in vars(value).items()})
    if arena.radio is not None:
        row.update(_radio(arena.radio))
    row.update({f"counts.{name}": count for name, count in arena.counts.items()})
    return row


def failed_row(error: str) -> Row:
    """A run that came to nothing: all else in its row is null."""
    return {"ended": FAILED, "error": error}


def _radio(radio: RadioResult) -> dict[str, Any]:
    latencies: dict[str, Any] = {}
    for of in LATENCIES:
        percentiles: Percentiles = getattr(radio, of)
        latencies |= {f"radio.{of}.{percentile}": value for percentile, value in vars(percentiles).items()}
    fates = {f"radio.fates.{name}": count for name, count in radio.fates.items()}
    return {**{f"radio.{name}": getattr(radio, name) for name in TOTALS}, **latencies, **fates}
