"""The columns of `summary.parquet`: rows of runs, the types of columns, and the responses among them."""

import json
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from swarmwire.comms.robot.packets import FATE_NAMES
from swarmwire.deploy.runs.result import ArenaResult, Percentiles, RadioResult
from swarmwire.deploy.runs.scenario_parts import selected_metrics, stop_conditions
from swarmwire.metrics.records.campaign.campaign_json import FAILED, STOP_TIME, Campaign, Response
from swarmwire.world.scenario.scenario import Scenario

if TYPE_CHECKING:
    import polars as pl

BEGAN_TO_HOLD = "when this began to hold: {}"
RADIO = "radio."  # prefix of the columns of packets
RADIO_HELP = {
    "sent": ("", "packets sent"),
    "intended": ("", "receivers that packets were meant for"),
    "in_range": ("", "of these, receivers in range"),
    "pdr": ("", "packet delivery ratio: received / intended"),
    "link_pdr": ("", "PDR of links: received / in range"),
}
PERCENTILES = ("p50", "p90", "p99")
LATENCY_HELP = {
    "latency_air_s": "from sending to hearing",
    "latency_agent_s": "from sending to the tick at which the receiver could act",
}
STATISTICS = ("final", "mean", "min", "max")
LATENCIES = ("latency_air_s", "latency_agent_s")
KEYS = ("run", "point", "seed")
ENDS = ("ended", "error", "ticks", "sim_time_s", "trajectory_sha256")
STOPPED_BY = "stopped_by"
LATE = "timing_late"  # share of late frames or ticks, in real time
MACHINE = ("timing_wall_s", "machine_cpu", "machine_host", "machine_worker")
FIXED = {*KEYS, *ENDS, STOP_TIME, STOPPED_BY, LATE, *MACHINE}
COUNTS, FATES = "counts.", "radio.fates."
INTEGERS = {*KEYS, "ticks", "radio.sent", "radio.intended", "radio.in_range"}
TEXTS = {"ended", "error", "trajectory_sha256", STOPPED_BY, "machine_cpu", "machine_host", "machine_worker"}
Row = dict[str, Any]  # values of a run by column


def row_of(arena: ArenaResult, times: Collection[str]) -> Row:
    """Return the results of one arena, by column; metrics in `times` have only their last value."""
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
            row.update({f"{name}.{statistic}": number for statistic, number in vars(value).items()})
    if arena.radio is not None:
        row.update(_radio_columns(arena.radio))
    row.update({f"counts.{name}": count for name, count in arena.counts.items()})
    return row


def failed_row(error: str) -> Row:
    """Return the row of a failed run; its other columns are null."""
    return {"ended": FAILED, "error": error}


def failure_line(error: str) -> str:
    """Return the line of a run's error that names the cause: of a traceback the one after the last call."""
    lines = error.strip().splitlines()
    calls = [index for index, line in enumerate(lines[:-1]) if line.startswith(" ")]
    return lines[calls[-1] + 1] if calls else lines[-1]


def _radio_columns(radio: RadioResult) -> dict[str, Any]:
    latencies: dict[str, Any] = {}
    for latency in LATENCIES:
        percentiles: Percentiles = getattr(radio, latency)
        latencies |= {f"radio.{latency}.{percentile}": value for percentile, value in vars(percentiles).items()}
    fates = {f"radio.fates.{name}": count for name, count in radio.fates.items()}
    return {**{f"radio.{name}": getattr(radio, name) for name in RADIO_HELP}, **latencies, **fates}


def responses_of(scenarios: Iterable[Scenario]) -> tuple[Response, ...]:
    """Return the responses of runs of these scenarios, each once, in column order; BadInput for a bad metric.

    Times come first, then metrics that the scenarios list, then standard metrics, and the fates of packets.
    """
    by_column: dict[str, Response] = {}
    for scenario in scenarios:
        for response in _responses(scenario):
            before = by_column.setdefault(response.column, response)
            if before.hold_s < response.hold_s:  # the hold time varies: the longest applies to all runs
                by_column[response.column] = before = replace(before, hold_s=response.hold_s)
            if before.column == STOP_TIME and before.help != response.help:
                by_column[STOP_TIME] = replace(before, help=BEGAN_TO_HOLD.format("the stop condition"))
    return tuple(sorted(by_column.values(), key=_rank))


def _rank(response: Response) -> tuple[bool, bool, bool]:
    return response.kind != "time", response.column.startswith(RADIO), not response.listed


def _responses(scenario: Scenario) -> Iterator[Response]:
    if stops := stop_conditions(scenario):
        hold_s = max(stop.hold_s for stop in stops)
        yield Response(STOP_TIME, "s", "time", BEGAN_TO_HOLD.format(" or ".join(map(str, stops))), hold_s=hold_s)
    for metric in selected_metrics(scenario).metrics:
        if metric.kind == "time":
            hold_s = float(getattr(metric, "hold_s", 0.0))
            yield Response(metric.name, metric.unit, "time", metric.help, not metric.standard, hold_s)
            continue
        for statistic in STATISTICS:
            yield Response(f"{metric.name}.{statistic}", metric.unit, "number", metric.help, not metric.standard)
    if scenario.radio is not None:
        yield from _radio_responses()


def _radio_responses() -> Iterator[Response]:
    for name, (unit, text) in RADIO_HELP.items():
        yield Response(f"{RADIO}{name}", unit, "number", text)
    for name in LATENCIES:
        for percentile in PERCENTILES:
            yield Response(f"{RADIO}{name}.{percentile}", "s", "number", LATENCY_HELP[name])
    for fate in FATE_NAMES:
        yield Response(f"{RADIO}fates.{fate}", "", "number", f"receivers whose packet's fate was {fate}")


class ResultColumns:
    """The columns of one campaign's rows."""

    def __init__(self, campaign: Campaign) -> None:
        """Order the columns as in the campaign; the stop time, if it is a response, is followed by its condition."""
        varied = {path: [point[path] for point in campaign.points] for path in campaign.vary}
        responses = [response.column for response in campaign.responses]
        self._varied = {path: _type_of(values) for path, values in varied.items()}
        after = [name for name in responses if name != STOP_TIME]
        stop = [STOP_TIME, STOPPED_BY] if STOP_TIME in responses else []
        self._fixed = [*KEYS, *varied, *ENDS, *stop, *after]
        self._machine = [LATE, *MACHINE] if campaign.realtime else MACHINE

    def frame(self, rows: Sequence[Row]) -> "pl.DataFrame":
        """Return rows as a table: all fixed columns, null if a row lacks them, and the counts of any row."""
        import polars as pl

        counts = sorted({name for row in rows for name in row if name.startswith(COUNTS)})
        names = [*self._fixed, *counts, *self._machine]
        types = {"integer": pl.Int64(), "text": pl.String(), "number": pl.Float64(), "boolean": pl.Boolean()}
        schema = {name: types[self._type(name)] for name in names}
        return pl.DataFrame([{name: self._cell(name, row.get(name)) for name in names} for row in rows], schema)

    def joined(self, frames: Iterable["pl.DataFrame"]) -> "pl.DataFrame":
        """Join the tables of several tasks, sorted by run, with the last row of each run; missing counts are 0."""
        import polars as pl

        table = pl.concat(frames, how="diagonal").unique(subset="run", keep="last").sort("run")
        counts = sorted(name for name in table.columns if name.startswith(COUNTS))
        zero = pl.when(pl.col("ended") != FAILED).then(pl.col(counts).fill_null(0)).otherwise(pl.col(counts))
        return table.with_columns(zero if counts else []).select(*self._fixed, *counts, *self._machine)

    def _type(self, name: str) -> str:
        if name in self._varied:
            return self._varied[name]
        if name in INTEGERS or name.startswith((COUNTS, FATES)):
            return "integer"
        return "text" if name in TEXTS else "number"

    def _cell(self, name: str, value: Any) -> Any:
        if value is None or self._type(name) in ("integer", "boolean"):
            return value
        if self._type(name) == "number":
            return float(value)
        return value if isinstance(value, str) else json.dumps(value)


def _type_of(values: Sequence[Any]) -> str:
    """Return the type of a varied path's column; values without a column type become texts, as JSON."""
    kinds: set[type] = {type(value) for value in values}
    if kinds == {bool}:
        return "boolean"
    if kinds <= {int, float}:
        return "integer" if kinds == {int} else "number"
    return "text"
