"""The parts of a scenario, checked and made: agents, metrics, stop conditions, radio, measured links."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.agent.agent import AgentClass, NoAgent, load_agent
from swarmwire.agent.parameters import BadParameter, checked_parameters
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.config import did_you_mean, folder_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import resolve
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.base.threads import Threads
from swarmwire.comms.radio.config.antennas import Antennas
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.traces import POSSIBLE, LinkTrace, LinkTraces, Quantity, RefusedRow, link_trace
from swarmwire.metrics.measures.measure import Condition
from swarmwire.metrics.measures.registry import MetricEntry, MetricSelection, select_metrics
from swarmwire.metrics.records.table_file import MeasuredTable
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.tables import MetricTable
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World


def agent_specs(scenario: Scenario) -> dict[str, str]:
    """Return the agent's spec of each group, with an absolute path of its file."""
    folder = folder_of(scenario.source)
    return {name: resolve(group.agent, folder) for name, group in scenario.robots.items()}


def check_agents(scenario: Scenario, specs: Mapping[str, str]) -> dict[str, AgentClass]:
    """Return the agent's class of each group; BadInput names the first that does not suit its robots."""
    return {name: _checked_agent(scenario, name, spec) for name, spec in specs.items()}


def _checked_agent(scenario: Scenario, name: str, spec: str) -> AgentClass:
    group, source = scenario.robots[name], scenario.source
    try:
        kind = load_agent(spec)
        checked_parameters(kind, group.params, group.count)
    except NoAgent as error:
        raise BadInput(source, f"robots.{name}.agent", str(error)) from error
    except BadParameter as error:
        raise BadInput(source, f"robots.{name}.params.{error.key}", error.expected) from error
    body = bodies_of(scenario, source)[name]
    radio_needs = scenario.radio.needs if scenario.radio else ()
    for need in kind.needs:
        if need.startswith("radio."):
            if need not in radio_needs:
                text = f"{kind.__name__} needs {need!r}, which {_unmet_need(need, scenario)}"
                raise BadInput(source, f"robots.{name}.agent", text)
        elif need not in body.sensors:
            text = f"{kind.__name__} needs {need!r}, which the body {body.name} lacks: it has {', '.join(body.sensors)}"
            raise BadInput(source, f"robots.{name}.agent", text)
    if issubclass(kind, VectorAgent):
        try:
            kind.check_body(body)
        except ValueError as error:
            raise BadInput(source, f"robots.{name}.agent", str(error)) from error
    return kind


def _unmet_need(need: str, scenario: Scenario) -> str:
    if need == "radio.tx_status":
        return "needs a radio with acknowledgements: expected radio.access.method csma-802154, dcf or esb, acknowledged"
    if scenario.radio is None:
        return "needs a radio: there is no [radio]"
    return f"the radio does not measure: [radio.measures] has {', '.join(scenario.radio.measures.needs) or 'nothing'}"


def selected_metrics(scenario: Scenario) -> MetricSelection:
    """Return the metrics of the scenario; BadInput for an unknown metric or an invalid parameter."""
    folder = folder_of(scenario.source)
    items = [_metric_entry(index, item, folder) for index, item in enumerate(scenario.metrics)]
    stops = [MetricEntry(f"{key}.metric", table.metric, None) for key, table in scenario.stops().items()]
    return select_metrics([*items, *stops], scenario.source, with_standard=scenario.standard_metrics)


def stop_conditions(scenario: Scenario) -> list[Condition]:
    """Return the stop conditions in the scenario's order."""
    return [
        Condition(table.metric, *table.comparison, table.hold_s, table.keep_running)
        for table in scenario.stops().values()
    ]


def _metric_entry(index: int, item: str | MetricTable, folder: Path) -> MetricEntry:
    if isinstance(item, MetricTable):
        return MetricEntry(f"metrics.{index}.metric", resolve(item.metric, folder), item.params)
    return MetricEntry(f"metrics.{index}", resolve(item, folder), {})


def new_medium(
    scenario: Scenario, world: World, traces: LinkTraces | None, threads: int = 1, *, graph: bool = True
) -> RadioMedium | None:
    """Return a new medium of the scenario's radio, None without a radio.

    `traces` are the measured links of its file; `graph` is passed to the medium.
    """
    static, radio = world.static, scenario.radio
    if radio is None:
        return None
    size_m, obstacles_move = static.arena_size_m, static.movable > 0
    context = ChannelContext.open_space(
        radio, world.keys, static.robots, size_m, world.obstacles, obstacles_move=obstacles_move
    )
    counts = [group.stop - group.start for group in static.groups]
    radius_m = np.repeat([group.body.radius_m for group in static.groups], counts)
    height_m = np.repeat([group.body.height_m for group in static.groups], counts)
    context = replace(
        context,
        radius_m=np.tile(radius_m, len(world.keys)),
        height_m=np.tile(height_m, len(world.keys)),
        antennas=Antennas.of_groups((table.count, table.radio) for table in scenario.robots.values()),
        stations=scenario.stations(),
        traces=traces,
        is_torus=static.boundary == "torus",
        threads=Threads(threads),
    )
    return RadioMedium(context, static.rate_hz, static.act_every_ticks, graph=graph)


MAX_TRACE_S = 1e9  # its nanoseconds fit an integer
TRACE_COLUMNS = {"time": "t_s", "sender": "tx", "receiver": "rx"}


def scenario_traces(scenario: Scenario) -> LinkTraces | None:
    """Read the file of the scenario's `[radio.trace]`; None without one. BadInput if it cannot be replayed."""
    path = trace_path(scenario)
    if path is None:
        return None
    if not path.is_file():
        raise BadInput(scenario.source, "radio.trace.file", f"expected a file beside the scenario: there is no {path}")
    traces = read_link_traces(path, scenario.robot_names())
    if traces.rssi_dbm is not None and scenario.radio is not None and not scenario.radio.is_phy:
        raise BadInput(str(path), "rssi_dbm", "expected a radio with a PHY: a unit disk has no signal strength")
    return traces


def trace_path(scenario: Scenario) -> Path | None:
    """Return the path of the file of the scenario's `[radio.trace]`; None without one."""
    trace = scenario.radio.trace if scenario.radio else None
    return (folder_of(scenario.source) / trace.file).resolve() if trace else None


def read_link_traces(path: Path, robots: Sequence[str]) -> LinkTraces:
    """Read the link traces of a file; `robots` are the names in the order of their index in the arena.

    Columns: t_s, since the start of the run; tx and rx, names of robots; and at least one of delivery_ratio, rssi_dbm,
    delay_s, of which each row has one or more. BadInput for unknown robots, times that do not rise on a link, and
    invalid values.
    """
    table = MeasuredTable(path)
    table.need(tuple(TRACE_COLUMNS.values()))
    measured: list[Quantity] = [name for name in POSSIBLE if name in table.columns]
    if not measured:
        raise table.refused("", f"expected at least one of the columns {', '.join(POSSIBLE)}, got none")
    time_s = table.numbers("t_s")
    table.refuse_where(~(np.abs(time_s) < MAX_TRACE_S), "t_s", "expected a time in s")
    time_ns = np.round(time_s * NS_PER_S).astype(np.int64)
    sender, receiver = (_robot_index(table, column, robots) for column in ("tx", "rx"))
    values: dict[Quantity, FloatArray] = {quantity: table.numbers(quantity) for quantity in measured}
    is_empty = np.all([np.isnan(value) for value in values.values()], axis=0)
    table.refuse_where(is_empty, " or ".join(measured), "expected a value")
    return LinkTraces(
        **{
            quantity: _link_trace(table, quantity, len(robots), time_ns, sender, receiver, value)
            for quantity, value in values.items()
            if not np.isnan(value).all()
        }
    )


def _link_trace(
    table: MeasuredTable,
    quantity: Quantity,
    robots: int,
    time_ns: IntArray,
    sender: IntArray,
    receiver: IntArray,
    value: FloatArray,
) -> LinkTrace:
    """Return the trace of the rows that have a value of this quantity."""
    rows = np.flatnonzero(~np.isnan(value))
    try:
        return link_trace(quantity, robots, time_ns[rows], sender[rows], receiver[rows], value[rows])
    except RefusedRow as refused:
        column = TRACE_COLUMNS.get(refused.column, quantity)
        raise table.refused(f"row {rows[refused.row] + 1}, {column}", refused.expected) from None


def _robot_index(table: MeasuredTable, column: str, robots: Sequence[str]) -> IntArray:
    index_of_name = {name: i for i, name in enumerate(robots)}
    names = table.texts(column)
    index = np.array([index_of_name.get(name, NO_ROBOT) for name in names], np.int64)
    if (index == NO_ROBOT).any():
        unknown = names[int(np.argmax(index == NO_ROBOT))]
        first, last = (robots[0], robots[-1]) if robots else ("", "")
        table.refuse_where(
            index == NO_ROBOT, column, f"expected a robot of the scenario, {first} … {last}, got {unknown}"
        )
    return index


def radio_of(preset: str, settings: Sequence[str]) -> Radio:
    """Return the radio of a preset after settings such as "radio.loss=0.1"; BadInput for unknown names and values."""
    if preset not in PRESETS:
        raise BadInput("radio", "", f"expected {did_you_mean(PRESETS, preset)}; got {preset!r}")
    radio = checked_radio({"preset": preset}, "radio", settings)
    if radio.trace is not None:
        raise BadInput("radio", "radio.trace", "expected none: links are measured between robots of a scenario")
    return radio


def checked_radio(table: Mapping[str, Any], source: str, overrides: Sequence[str] = ()) -> Radio:
    """Return the radio of a table after overrides such as "radio.loss=0.1"; BadInput as for a scenario."""
    scenario = {
        "format": 1,
        "name": "a radio",
        "duration_s": 1.0,
        "arena": {"size_m": [2.0, 2.0]},
        "robots": {"nodes": {"body": "epuck", "count": 1, "agent": "none:None"}},
    }
    radio = scenario_from({**scenario, "radio": table}, source, overrides).radio
    assert radio is not None
    return radio
