"""The parts that a scenario names, checked and made: agents, metrics, stop conditions, radio medium."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from swarmwire.agent.agent import AgentClass, NoAgent, load_agent
from swarmwire.agent.parameters import BadParameter, checked
from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import resolve
from swarmwire.comms.radio.config.phy import Antennas
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.traces import LinkTraces
from swarmwire.metrics.measure import Condition
from swarmwire.metrics.registry import MetricEntry, MetricSelection, select_metrics
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.tables import MetricTable
from swarmwire.world.world import World


def agent_specs(scenario: Scenario) -> dict[str, str]:
    """By group: the agent's spec, with the path of a file beside the scenario made absolute."""
    beside = Path(scenario.source).parent
    return {name: resolve(group.agent, beside) for name, group in scenario.robots.items()}


def check_agents(scenario: Scenario, specs: Mapping[str, str]) -> dict[str, AgentClass]:
    """By group: the agent's class, fit for its robots; BadInput names the first that is not."""
    return {name: _checked(scenario, name, spec) for name, spec in specs.items()}


def _checked(scenario: Scenario, name: str, spec: str) -> AgentClass:
    group, where = scenario.robots[name], scenario.source
    try:
        kind = load_agent(spec)
        checked(kind, group.params, group.count)
    except NoAgent as error:
        raise BadInput(where, f"robots.{name}.agent", str(error)) from error
    except BadParameter as error:
        raise BadInput(where, f"robots.{name}.params.{error.key}", error.expected) from error
    body = bodies_of(scenario, where)[name]
    of_radio = scenario.radio.tells if scenario.radio else ()
    for need in kind.needs:
        if need.startswith("radio."):
            if need not in of_radio:
                text = f"{kind.__name__} needs {need!r}, which {_untold(need, scenario)}"
                raise BadInput(where, f"robots.{name}.agent", text)
        elif need not in body.sensors:
            text = f"{kind.__name__} needs {need!r}, which the body {body.name} lacks: it has {', '.join(body.sensors)}"
            raise BadInput(where, f"robots.{name}.agent", text)
    return kind


def _untold(need: str, scenario: Scenario) -> str:
    if need == "radio.tx_status":
        return "only a radio that acknowledges tells: expected radio.access.method csma-802154 or dcf, acknowledged"
    if scenario.radio is None:
        return "only a radio tells: there is no [radio]"
    return f"the radio does not measure: [radio.measures] has {', '.join(scenario.radio.measures.needs) or 'nothing'}"


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


def new_medium(scenario: Scenario, world: World, traces: LinkTraces | None) -> RadioMedium | None:
    """A new medium of the scenario's radio, if it has one; `traces` are those of its file."""
    static, radio = world.static, scenario.radio
    if radio is None:
        return None
    return RadioMedium(
        radio,
        world.keys,
        static.robots,
        static.arena_size_m,
        world.obstacles,  # which follow those that are pushed
        static.rate_hz,
        static.act_every_ticks,
        np.concatenate([np.full(group.stop - group.start, group.body.radius_m) for group in static.groups]),
        traces,
        Antennas.of_groups((table.count, table.radio) for table in scenario.robots.values()),
        static.boundary,
    )
