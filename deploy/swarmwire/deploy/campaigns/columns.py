"""The columns of `summary.parquet`: one run as a row, the types of columns, and which of them are responses."""

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
RADIO = "radio."  # how columns of packets begin
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
MACHINE = ("timing_wall_s", "machine_cpu", "machine_host", "machine_worker")
FIXED = {*KEYS, *ENDS, STOP_TIME, STOPPED_BY, *MACHINE}
COUNTS, FATES = "counts.", "radio.fates."
WHOLE = {*KEYS, "ticks", "radio.sent", "radio.intended", "radio.in_range"}
TEXTS = {"ended", "error", "trajectory_sha256", STOPPED_BY, "machine_cpu", "machine_host", "machine_worker"}
Row = dict[str, Any]  # one run, by column


def row_of(arena: ArenaResult, times: Collection[str]) -> Row:
    """The results of one arena, by column; of metrics that are `times` their last value alone."""
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
        row.update(_radio_columns(arena.radio))
    row.update({f"counts.{name}": count for name, count in arena.counts.items()})
    return row


def failed_row(error: str) -> Row:
    """A run that came to nothing: all else in its row is null."""
    return {"ended": FAILED, "error": error}


def _radio_columns(radio: RadioResult) -> dict[str, Any]:
    latencies: dict[str, Any] = {}
    for of in LATENCIES:
        percentiles: Percentiles = getattr(radio, of)
        latencies |= {f"radio.{of}.{percentile}": value for percentile, value in vars(percentiles).items()}
    fates = {f"radio.fates.{name}": count for name, count in radio.fates.items()}
    return {**{f"radio.{name}": getattr(radio, name) for name in RADIO_HELP}, **latencies, **fates}


def responses_of(scenarios: Iterable[Scenario]) -> tuple[Response, ...]:
    """The responses of runs of these scenarios, each once, in the order of the columns; BadInput for a bad metric.

    Times come first, then what the scenarios list, then what is measured in every run, and the fates of packets.
    """
    found: dict[str, Response] = {}
    for scenario in scenarios:
        for response in _responses(scenario):
            before = found.setdefault(response.column, response)
            if before.hold_s < response.hold_s:  # it is varied: what all runs can tell of
                found[response.column] = before = replace(before, hold_s=response.hold_s)
            if before.column == STOP_TIME and before.help != response.help:
                found[STOP_TIME] = replace(before, help=BEGAN_TO_HOLD.format("the stop condition"))
    return tuple(sorted(found.values(), key=_rank))


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
        """In the campaign's order; a time of stopping among the responses brings its cause along."""
        varied = {path: [point[path] for point in campaign.points] for path in campaign.vary}
        responses = [response.column for response in campaign.responses]
        self._varied = {path: _type_of(values) for path, values in varied.items()}
        after = [name for name in responses if name != STOP_TIME]
        stop = [STOP_TIME, STOPPED_BY] if STOP_TIME in responses else []
        self._known = [*KEYS, *varied, *ENDS, *stop, *after]

    def frame(self, rows: Sequence[Row]) -> "pl.DataFrame":
        """Rows as a table: all columns that are known, null where a row lacks them, and the counts of any row."""
        import polars as pl

        counts = sorted({name for row in rows for name in row if name.startswith(COUNTS)})
        names = [*self._known, *counts, *MACHINE]
        types = {"whole": pl.Int64(), "text": pl.String(), "number": pl.Float64(), "truth": pl.Boolean()}
        schema = {name: types[self._type(name)] for name in names}
        return pl.DataFrame([{name: self._cell(name, row.get(name)) for name in names} for row in rows], schema)

    def joined(self, frames: Iterable["pl.DataFrame"]) -> "pl.DataFrame":
        """The tables of several tasks as one, by run, of each run the last row; what was never counted was 0."""
        import polars as pl

        whole = pl.concat(frames, how="diagonal").unique(subset="run", keep="last").sort("run")
        counts = sorted(name for name in whole.columns if name.startswith(COUNTS))
        zero = pl.when(pl.col("ended") != FAILED).then(pl.col(counts).fill_null(0)).otherwise(pl.col(counts))
        return whole.with_columns(zero if counts else []).select(*self._known, *counts, *MACHINE)

    def _type(self, name: str) -> str:
        if name in self._varied:
            return self._varied[name]
        if name in WHOLE or name.startswith((COUNTS, FATES)):
            return "whole"
        return "text" if name in TEXTS else "number"

    def _cell(self, name: str, value: Any) -> Any:
        if value is None or self._type(name) in ("whole", "truth"):
            return value
        if self._type(name) == "number":
            return float(value)
        return value if isinstance(value, str) else json.dumps(value)


def _type_of(values: Sequence[Any]) -> str:
    """Of a varied path's column: texts hold what has no column type, as JSON."""
    kinds: set[type] = {type(value) for value in values}
    if kinds == {bool}:
        return "truth"
    if kinds <= {int, float}:
        return "whole" if kinds == {int} else "number"
    return "text"
