"""Sim-to-real comparison: a folder's emulated runs, settings that differ from the robots' logs, and what is printed."""

import hashlib
import inspect
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from rich.console import Console
from rich.text import Text

from swarmwire.agent.agent import NoAgent, load_agent
from swarmwire.agent.parameters import parameters_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import file_of, with_file
from swarmwire.comms.observe.truth import Static
from swarmwire.deploy.campaigns.store import CampaignWriter
from swarmwire.deploy.runs.scenario_parts import agent_specs, selected_metrics
from swarmwire.deploy.terminal.tables import print_rows
from swarmwire.metrics.measures.metric import Metric
from swarmwire.metrics.real.real_log.real_logs import RealLogs
from swarmwire.metrics.real.real_log.robot_log import RealRobotLog
from swarmwire.metrics.real.sim_to_real.comparison import SimToReal
from swarmwire.metrics.real.sim_to_real.report import (
    COLUMNS,
    RADIO_COLUMNS,
    left_out,
    meanings,
    metric_cells,
    radio_cells,
    verdict,
)
from swarmwire.metrics.real.sim_to_real.runs import EmulatedRuns, runs_of_campaign, runs_of_folder
from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE, read_campaign
from swarmwire.metrics.records.campaign.folder import select
from swarmwire.metrics.records.run_folder.layout import SCENARIO, STATIC
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario
from swarmwire.world.world import World

NAMED = 3  # differing keys that are told in one line, at most


@dataclass(frozen=True)
class Emulation:
    """Runs of one scenario, and what is known of it."""

    runs: EmulatedRuns
    scenario: Scenario
    static: Static  # of the first of them, in whose arena the robots are taken to have been
    metrics: tuple[Metric, ...]  # that were measured, with their parameters


def read_emulation(text: str) -> Emulation:
    """Of a run folder, or of a campaign's, as `FOLDER` or `FOLDER@path=value`; BadInput where it is neither."""
    path = Path(text if Path(text).exists() else text.partition("@")[0])
    if (path / CAMPAIGN_FILE).exists():
        return _of_campaign(text)
    if not (path / STATIC).exists():
        raise BadInput(text, "", f"expected the folder of a run ({STATIC}) or of a campaign ({CAMPAIGN_FILE})")
    scenario = load_scenario(path / SCENARIO)
    metrics = selected_metrics(scenario).metrics
    runs = runs_of_folder(path, tuple(metric.name for metric in metrics))
    return Emulation(runs, scenario, RunFolder(path).static, metrics)


def _of_campaign(text: str) -> Emulation:
    selection = select(text)
    campaign = read_campaign(selection.campaign.path)
    overrides = campaign.point_overrides[selection.points[0]]
    scenario = load_scenario(CampaignWriter(selection.campaign.path, campaign).scenario, overrides)
    metrics = selected_metrics(scenario).metrics
    static = World(scenario, campaign.seeds[:1], {}).static
    names = tuple(metric.name for metric in metrics)
    return Emulation(runs_of_campaign(selection, names, static.rate_hz, static.robots), scenario, static, metrics)


def differing_settings(emulation: Emulation, logs: RealLogs) -> list[str]:
    """A line for each: robots, rate, agent, its file, its parameters, body."""
    static = emulation.static
    lines: list[str] = []
    if static.robots != len(logs.robots):
        lines.append(f"robots: {static.robots} emulated, {len(logs.robots)} in the log")
    rates = sorted({static.rate_hz / group.act_every_ticks for group in static.groups})
    if rates != [logs.rate_hz]:
        told = " and ".join(f"{rate_hz:g} Hz" for rate_hz in rates)
        lines.append(f"steps of the agents: {told} emulated, {logs.rate_hz:g} Hz in the log")
    return [*lines, *_agents(emulation, logs), *_bodies(static, logs)]


def _agents(emulation: Emulation, logs: RealLogs) -> Iterator[str]:
    groups = list(emulation.scenario.robots.values())
    specs = {_class_of(group.agent) for group in groups}
    real = {_class_of(robot.about.agent) for robot in logs.robots}
    if specs != real:
        yield f"agent: {', '.join(sorted(specs))} emulated, {', '.join(sorted(real))} in the log"
        return
    try:
        kinds = [load_agent(spec) for spec in agent_specs(emulation.scenario).values()]
    except NoAgent as error:
        yield f"agent: the emulated one cannot be compared any more: {error}"
        return
    digests, logged = {_digest(kind) for kind in kinds}, {robot.about.agent_sha256 for robot in logs.robots}
    if digests != logged:
        shown = [", ".join(sorted(digest[:12] for digest in some)) for some in (digests, logged)]
        yield f"agent's file: sha256 {shown[0]}… emulated, {shown[1]}… in the log"
    if len(groups) == 1:
        yield from _params(kinds[0], groups[0].params, logs.robots)


def _class_of(spec: str) -> str:
    """The last part of a spec's place and its class: the file lies elsewhere on the robot."""
    return with_file(spec, Path(file_of(spec)).name)


def _params(kind: type, emulated: Mapping[str, Any], robots: Sequence[RealRobotLog]) -> Iterator[str]:
    told: list[str] = []
    for name, parameter in parameters_of(kind).items():
        mine = emulated.get(name, parameter.default)
        real = [robot.about.params.get(name, parameter.default) for robot in robots]
        each = cast("list[Any]", mine) if isinstance(mine, list) else [mine] * len(real)  # a value for each robot
        if real != each:
            told.append(f"{name} {mine} emulated, {', '.join(sorted({str(value) for value in real}))} in the log")
    if told:
        more = f" and {len(told) - NAMED} more" if len(told) > NAMED else ""
        yield f"params: {'; '.join(told[:NAMED])}{more}"


def _bodies(static: Static, logs: RealLogs) -> Iterator[str]:
    emulated = {group.body.name: group.body for group in static.groups}
    real = {robot.body.name: robot.body for robot in logs.robots}
    if emulated.keys() != real.keys():
        yield f"body: {', '.join(sorted(emulated))} emulated, {', '.join(sorted(real))} in the log"
    for name in emulated.keys() & real.keys():
        if emulated[name].agent_view.as_mapping() != real[name].agent_view.as_mapping():
            yield f"body {name}: its sheet in the log differs from the emulated one"


def _digest(kind: type) -> str:
    """Of the file that the class stands in, as robots have it."""
    file = inspect.getsourcefile(kind)
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else ""


def print_sim_to_real(of: SimToReal, notes: Sequence[str], console: Console) -> None:
    """Print the comparison, after `notes` of differing settings and of faults in the logs, a line each."""
    for line in notes:
        console.print(Text(f"note: {line}"), soft_wrap=True)
    if of.rows:
        print_rows(COLUMNS, [metric_cells(row) for row in of.rows], console, gap=True)
    if of.radio:
        print_rows(RADIO_COLUMNS, [radio_cells(row) for row in of.radio], console, gap=True)
    for line in (*left_out(of), *meanings(of)):
        console.print(Text(line, "dim"), soft_wrap=not console.is_terminal)
    console.print(Text(verdict(of), "bold"), soft_wrap=True)
