"""What a scenario has measured: the metrics that it lists and those that end its arenas, made ready."""

from pathlib import Path

from swarmwire.comms.plugins import resolve
from swarmwire.metrics.registry import MetricEntry, MetricSelection, select_metrics
from swarmwire.metrics.stop import Condition
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.tables import MetricTable


def measuring(scenario: Scenario) -> MetricSelection:
    """The metrics of a run of this scenario; BadInput for what is no metric, or does not take its parameters."""
    beside = Path(scenario.source).parent
    items = [_item(place, item, beside) for place, item in enumerate(scenario.metrics)]
    stops = [MetricEntry(f"{key}.metric", table.metric, None) for key, table in scenario.stops().items()]
    return select_metrics([*items, *stops], scenario.source, with_standard=scenario.standard_metrics)


def conditions(scenario: Scenario) -> list[Condition]:
    """What ends an arena before its time, in the scenario's order."""
    return [Condition(table.metric, *table.comparison, table.hold_s) for table in scenario.stops().values()]


def _item(place: int, item: str | MetricTable, beside: Path) -> MetricEntry:
    if isinstance(item, MetricTable):
        return MetricEntry(f"metrics.{place}.metric", resolve(item.metric, beside), item.params)
    return MetricEntry(f"metrics.{place}", resolve(item, beside), {})
