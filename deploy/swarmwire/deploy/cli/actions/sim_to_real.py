"""`swarmwire sim-to-real`: a log of real robots compared with simulated runs, and the settings that differ."""

import hashlib
import inspect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from rich.console import Console
from rich.text import Text

from swarmwire.agent.agent import NoAgent, load_agent
from swarmwire.agent.parameters import parameters_of
from swarmwire.comms.base.atomic import check_output_path
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import file_of, with_file
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.protocols.ros2.bags import is_bag
from swarmwire.comms.protocols.ros2.keys import ros_name
from swarmwire.deploy.campaigns.store import CampaignWriter
from swarmwire.deploy.cli.actions.bag_logs import BagTopics, read_bag_logs
from swarmwire.deploy.runs.scenario_parts import agent_specs, selected_metrics
from swarmwire.deploy.terminal.console import TerminalConsole, print_rows
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.measures.metric import Metric
from swarmwire.metrics.real.real_log.real_logs import RealLogs, read_real_logs
from swarmwire.metrics.real.real_log.robot_log import RealRobotLog
from swarmwire.metrics.real.sim_to_real.comparison import SimToReal, compare_sim_to_real
from swarmwire.metrics.real.sim_to_real.report import (
    COLUMNS,
    RADIO_COLUMNS,
    left_out,
    meanings,
    metric_cells,
    radio_cells,
    verdict,
    write_sim_to_real,
)
from swarmwire.metrics.real.sim_to_real.runs import EmulatedRuns, measured_log, runs_of_campaign, runs_of_folder
from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE, read_campaign
from swarmwire.metrics.records.campaign.folder import select
from swarmwire.metrics.records.run_folder.layout import SCENARIO, STATIC
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario
from swarmwire.world.world import World

MAX_NAMED = 3  # differing parameters in one line


def compare_with_logs(emulated: str, log: Path, files: Sequence[Path], topics: BagTopics) -> None:
    """Compare logs or a bag with a run or a campaign, print the comparison, and write it to files (.html or .csv)."""
    for path in files:
        check_output_path(path, (".html", ".csv"))
    bag = is_bag(log)
    logs = None if bag else read_real_logs(log)
    emulation = read_emulation(emulated)
    logs = logs or _bag_logs(log, topics, emulation.static)
    shortest_s = min(run.duration_s for run in emulation.runs.runs)
    measured = measured_log(logs, emulation.metrics, emulation.static, shortest_s)
    comparison = compare_sim_to_real(emulation.runs, measured, emulation.metrics)
    notes = [*(f"different {line}" for line in differing_settings(emulation, logs)), *measured.notes]
    print_sim_to_real(comparison, notes, TerminalConsole())
    for path in files:
        if path.suffix.lower() == ".csv":
            write_sim_to_real(comparison, path)
        else:
            from swarmwire.metrics.pictures.report.page import write_report  # needs matplotlib
            from swarmwire.metrics.real.sim_to_real.report import sim_to_real_report

            write_report(sim_to_real_report(comparison, f"{emulation.runs.name} and {log.name}", notes), path)
        echo(f"written: {path}")


def _bag_logs(bag: Path, topics: BagTopics, static: Static) -> RealLogs:
    """Read a bag of robots with the bodies and the rate of the emulated ones."""
    bodies = {
        ros_name(static.robot_names[robot]): group.body
        for group in static.groups
        for robot in range(group.start, group.stop)
    }
    return read_bag_logs(bag, topics, bodies, static.rate_hz / static.groups[0].act_every_ticks)


@dataclass(frozen=True)
class Emulation:
    """Simulated runs of one scenario."""

    runs: EmulatedRuns
    scenario: Scenario
    static: Static  # data of the first run, whose arena is that of the robots
    metrics: tuple[Metric, ...]  # measured in the runs, with their parameters


def read_emulation(text: str) -> Emulation:
    """Read a run folder, or a campaign as `FOLDER` or `FOLDER@path=value`; BadInput for any other folder."""
    path = Path(text if Path(text).exists() else text.partition("@")[0])
    if (path / CAMPAIGN_FILE).exists():
        return _read_campaign(text)
    if not (path / STATIC).exists():
        raise BadInput(text, "", f"expected the folder of a run ({STATIC}) or of a campaign ({CAMPAIGN_FILE})")
    scenario = load_scenario(path / SCENARIO)
    metrics = selected_metrics(scenario).metrics
    runs = runs_of_folder(path, tuple(metric.name for metric in metrics))
    return Emulation(runs, scenario, RunFolder(path).static, metrics)


def _read_campaign(text: str) -> Emulation:
    selection = select(text)
    campaign = read_campaign(selection.campaign.path)
    overrides = campaign.point_overrides[selection.points[0]]
    scenario = load_scenario(CampaignWriter(selection.campaign.path, campaign).scenario, overrides)
    metrics = selected_metrics(scenario).metrics
    static = World(scenario, campaign.seeds[:1], {}).static
    names = tuple(metric.name for metric in metrics)
    return Emulation(runs_of_campaign(selection, names, static.rate_hz, static.robots), scenario, static, metrics)


def differing_settings(emulation: Emulation, logs: RealLogs) -> list[str]:
    """Return a line for each difference in robots, rate, agent, its file, its parameters and bodies."""
    static = emulation.static
    lines: list[str] = []
    if static.robots != len(logs.robots):
        lines.append(f"robots: {static.robots} emulated, {len(logs.robots)} in the log")
    rates_hz = sorted({static.rate_hz / group.act_every_ticks for group in static.groups})
    if rates_hz != [logs.rate_hz]:
        text = " and ".join(f"{rate_hz:g} Hz" for rate_hz in rates_hz)
        lines.append(f"steps of the agents: {text} emulated, {logs.rate_hz:g} Hz in the log")
    if not logs.robots[0].about.agent:  # a bag names neither agents nor bodies
        return lines
    return [*lines, *_differing_agents(emulation, logs), *_differing_bodies(static, logs)]


def _differing_agents(emulation: Emulation, logs: RealLogs) -> Iterator[str]:
    groups = list(emulation.scenario.robots.values())
    emulated = {_file_and_class(group.agent) for group in groups}
    logged = {_file_and_class(robot.about.agent) for robot in logs.robots}
    if emulated != logged:
        yield f"agent: {', '.join(sorted(emulated))} emulated, {', '.join(sorted(logged))} in the log"
        return
    try:
        kinds = [load_agent(spec) for spec in agent_specs(emulation.scenario).values()]
    except NoAgent as error:
        yield f"agent: the emulated one cannot be compared any more: {error}"
        return
    digests, logged_digests = {_digest(kind) for kind in kinds}, {robot.about.agent_sha256 for robot in logs.robots}
    if digests != logged_digests:
        yield f"agent's file: sha256 {_shortened(digests)}… emulated, {_shortened(logged_digests)}… in the log"
    if len(groups) == 1:
        yield from _differing_params(kinds[0], groups[0].params, logs.robots)


def _shortened(digests: Iterable[str]) -> str:
    return ", ".join(sorted(digest[:12] for digest in digests))


def _file_and_class(spec: str) -> str:
    """Return an agent's spec without the folder of its file, which differs on the robot."""
    return with_file(spec, Path(file_of(spec)).name)


def _differing_params(kind: type, emulated: Mapping[str, Any], robots: Sequence[RealRobotLog]) -> Iterator[str]:
    differences: list[str] = []
    for name, parameter in parameters_of(kind).items():
        value = emulated.get(name, parameter.default)
        logged = [robot.about.params.get(name, parameter.default) for robot in robots]
        per_robot = cast("list[Any]", value) if isinstance(value, list) else [value] * len(logged)
        if logged != per_robot:
            differences.append(f"{name} {value} emulated, {', '.join(sorted(set(map(str, logged))))} in the log")
    if differences:
        more = f" and {len(differences) - MAX_NAMED} more" if len(differences) > MAX_NAMED else ""
        yield f"params: {'; '.join(differences[:MAX_NAMED])}{more}"


def _differing_bodies(static: Static, logs: RealLogs) -> Iterator[str]:
    emulated = {group.body.name: group.body for group in static.groups}
    logged = {robot.body.name: robot.body for robot in logs.robots if robot.body is not None}
    if emulated.keys() != logged.keys():
        yield f"body: {', '.join(sorted(emulated))} emulated, {', '.join(sorted(logged))} in the log"
    for name in emulated.keys() & logged.keys():
        if emulated[name].agent_view.as_mapping() != logged[name].agent_view.as_mapping():
            yield f"body {name}: its sheet in the log differs from the emulated one"


def _digest(kind: type) -> str:
    """Return the sha256 of the file of a class; "" without a file."""
    file = inspect.getsourcefile(kind)
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else ""


def print_sim_to_real(comparison: SimToReal, notes: Sequence[str], console: Console) -> None:
    """Print the notes, then the comparison."""
    for line in notes:
        console.print(Text(f"note: {line}"), soft_wrap=True)
    if comparison.rows:
        print_rows(COLUMNS, [metric_cells(row) for row in comparison.rows], console, blank_line=True)
    if comparison.radio:
        print_rows(RADIO_COLUMNS, [radio_cells(row) for row in comparison.radio], console, blank_line=True)
    for line in (*left_out(comparison), *meanings(comparison)):
        console.print(Text(line, "dim"), soft_wrap=not console.is_terminal)
    console.print(Text(verdict(comparison), "bold"), soft_wrap=True)
