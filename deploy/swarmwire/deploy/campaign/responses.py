"""What can be asked of a campaign's runs: columns of `summary.parquet` that hold a number, or a time."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from swarmwire.comms.packets import FATE_NAMES
from swarmwire.deploy.campaign.row import LATENCIES, STATISTICS, TOTALS
from swarmwire.deploy.measuring import conditions, measuring
from swarmwire.metrics.campaign.response import Response
from swarmwire.world.scenario.scenario import Scenario

STOP_TIME = "stop_time_s"
STOPPED = "when this began to hold: {}"
OF_PACKETS = "radio."  # how such columns begin
OF_RADIO = {
    "sent": ("", "packets sent"),
    "intended": ("", "receivers that packets were meant for"),
    "in_range": ("", "of these, receivers in range"),
    "pdr": ("", "packet delivery ratio: received / intended"),
    "link_pdr": ("", "delivery ratio of links: received / in range"),
}
PERCENTILES = ("p50", "p90", "p99")
LATENCY_HELP = {
    "latency_air_s": "from sending to hearing",
    "latency_agent_s": "from sending to the tick at which the receiver could act",
}


def responses_of(scenarios: Iterable[Scenario]) -> tuple[Response, ...]:
    """The responses of runs of these scenarios, each once, in the order of the columns; BadInput for a bad metric.

    Times come first, then what the scenarios list, then what is measured in every run, and what became of packets.
    """
    found: dict[str, Response] = {}
    for scenario in scenarios:
        for response in _responses(scenario):
            before = found.setdefault(response.column, response)
            if before.hold_s < response.hold_s:  # it is varied: what all runs can tell of
                found[response.column] = before = replace(before, hold_s=response.hold_s)
            if before.column == STOP_TIME and before.help != response.help:
                found[STOP_TIME] = replace(before, help=STOPPED.format("what is to stop the run"))
    return tuple(sorted(found.values(), key=_rank))


def _rank(response: Response) -> tuple[bool, bool, bool]:
    return response.kind != "time", response.column.startswith(OF_PACKETS), not response.listed


def _responses(scenario: Scenario) -> Iterator[Response]:
    if stops := conditions(scenario):
        hold_s = max(stop.hold_s for stop in stops)
        yield Response(STOP_TIME, "s", "time", STOPPED.format(" or ".join(map(str, stops))), hold_s=hold_s)
    for metric in measuring(scenario).metrics:
        if metric.kind == "time":
            hold_s = float(getattr(metric, "hold_s", 0.0))
            yield Response(metric.name, metric.unit, "time", metric.help, not metric.standard, hold_s)
            continue
        for statistic in STATISTICS:
            yield Response(f"{metric.name}.{statistic}", metric.unit, "number", metric.help, not metric.standard)
    if scenario.radio is not None:
        yield from _radio()


def _radio() -> Iterator[Response]:
    for name in TOTALS:
        unit, text = OF_RADIO[name]
        yield Response(f"{OF_PACKETS}{name}", unit, "number", text)
    for name in LATENCIES:
        for percentile in PERCENTILES:
            yield Response(f"{OF_PACKETS}{name}.{percentile}", "s", "number", LATENCY_HELP[name])
    for fate in FATE_NAMES:
        yield Response(f"{OF_PACKETS}fates.{fate}", "", "number", f"receivers whose packet's fate was {fate}")
