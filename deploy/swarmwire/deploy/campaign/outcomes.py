"""What can be asked of a campaign's runs: columns of `summary.parquet` that hold a number, or a time."""

from collections.abc import Iterable, Iterator

from swarmwire.comms.fates import FATE_NAMES
from swarmwire.deploy.campaign.row import LATENCIES, STATISTICS, TOTALS
from swarmwire.deploy.measuring import measuring
from swarmwire.metrics.campaign.outcome import Outcome
from swarmwire.world.scenario.scenario import Scenario

STOP_TIME = "stop_time_s"
OF_RADIO = {
    "sent": ("", "packets sent"),
    "intended": ("", "receivers that packets were meant for"),
    "in_range": ("", "of these, receivers in range"),
    "pdr": ("", "heard / in range"),
}
PERCENTILES = ("p50", "p90", "p99")
LATENCY_HELP = {
    "latency_air_s": "from sending to hearing",
    "latency_agent_s": "from sending to the tick at which the receiver could act",
}


def outcomes_of(scenarios: Iterable[Scenario]) -> tuple[Outcome, ...]:
    """The outcomes of runs of these scenarios, each once, in the order of the columns; BadInput for a bad metric."""
    found: dict[str, Outcome] = {}
    for scenario in scenarios:
        for outcome in _outcomes(scenario):
            found.setdefault(outcome.column, outcome)
    metrics = [outcome for outcome in found.values() if not outcome.column.startswith("radio.")]
    return (*metrics, *(outcome for outcome in found.values() if outcome.column.startswith("radio.")))


def _outcomes(scenario: Scenario) -> Iterator[Outcome]:
    if scenario.stops():
        yield Outcome(STOP_TIME, "s", "time", "since when what ended the run had held")
    for metric in measuring(scenario).metrics:
        if metric.kind == "time":
            yield Outcome(metric.name, metric.unit, "time", metric.help)
            continue
        for statistic in STATISTICS:
            yield Outcome(f"{metric.name}.{statistic}", metric.unit, "number", metric.help)
    if scenario.radio is not None:
        yield from _radio()


def _radio() -> Iterator[Outcome]:
    for name in TOTALS:
        unit, text = OF_RADIO[name]
        yield Outcome(f"radio.{name}", unit, "number", text)
    for name in LATENCIES:
        for percentile in PERCENTILES:
            yield Outcome(f"radio.{name}.{percentile}", "s", "number", LATENCY_HELP[name])
    for fate in FATE_NAMES:
        yield Outcome(f"radio.fates.{fate}", "", "number", f"receivers whose packet's fate was {fate}")
