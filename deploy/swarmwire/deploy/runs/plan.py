"""The plan of a run: its options and scenario, checked, and the values that follow from them.

`make_plan` has no side effects: it finds every fault of the options and the scenario before anything is made.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from swarmwire.agent.isolation import Isolation
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.traces import LinkTraces
from swarmwire.deploy.runs.config import (
    Recording,
    RunConfig,
    checked_scenario,
    checked_subtick,
    choose_seeds,
    parse_factor,
    runner_count,
    tick_count,
)
from swarmwire.deploy.runs.gateways.gateways import as_gateways
from swarmwire.deploy.runs.gateways.serving import RunGateways
from swarmwire.deploy.runs.interfaces import RunInterfaces, run_interfaces
from swarmwire.deploy.runs.record.folder import check_folder
from swarmwire.deploy.runs.record.provenance import RunFacts, cpu, module_digests, versions
from swarmwire.deploy.runs.scenario_parts import (
    agent_specs,
    check_agents,
    new_medium,
    scenario_traces,
    selected_metrics,
    stop_conditions,
)
from swarmwire.metrics.measures.measure import Condition
from swarmwire.metrics.measures.metric import Metric, metric_info
from swarmwire.world.scenario.bodies import bodies_of, custom_code
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.world import World


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A checked run that has not begun."""

    config: RunConfig
    scenario: Scenario  # scenario with the overrides
    static: Static  # constants of the run, such as its seeds and the robots' names
    agents: Mapping[str, str]  # spec of each group's agent
    sensors: Mapping[str, Sequence[str]]  # sensors to compute, by group
    metrics: tuple[Metric, ...]
    stop_conditions: tuple[Condition, ...]
    code: tuple[str, ...]  # specs of all classes of users: agents, custom sensors, actuators and metrics
    traces: LinkTraces | None  # measured links of the scenario
    interfaces: RunInterfaces | None
    gateways: RunGateways | None
    factor: float | None  # simulated s per s of wall time; None: as fast as possible
    subtick_s: float | None  # wall time after which packets cross also between ticks, in real time
    ticks: int
    runners: int  # processes that run the agents, at least; 0: all agents are in this process
    isolation: Isolation  # isolation of the agents' processes
    record: Recording

    @property
    def out(self) -> Path | None:
        """Path of the run folder; None: nothing is written."""
        return None if self.config.out is None else Path(self.config.out)

    @property
    def robots(self) -> int:
        """Number of robots in all arenas."""
        return self.static.arenas * self.static.robots

    @property
    def recorded_subtick_s(self) -> float | None:
        """Interval between ticks at which packets cross; in a repeat it is that of the recorded run."""
        return self.config.replay.subtick_s if self.config.replay else self.subtick_s

    def new_world(self) -> World:
        """Return a world with every arena at its start."""
        return World(self.scenario, self.static.seeds, self.sensors, self.config.threads)

    def new_medium(self, world: World, threads: int = 1) -> RadioMedium | None:
        """Return a new radio medium for this world; None without a radio."""
        return new_medium(self.scenario, world, self.traces, threads)

    def facts(self) -> RunFacts:
        """Return the provenance of the run, without the files of its folder."""
        return RunFacts(
            seeds=self.static.seeds,
            ticks=self.ticks,
            runners=self.runners,
            realtime=self.factor,
            files=(),
            modules=module_digests(self.code),
            cpu=cpu(),
            versions=versions(),
            gateways=self.gateways.kinds if self.gateways else {},
            metrics=tuple(metric_info(metric) for metric in self.metrics),
            subtick_s=self.recorded_subtick_s,
        )


def make_plan(config: RunConfig) -> tuple[Plan, World]:
    """Return the plan of a run and its world at the start; BadInput names the option or the key at fault."""
    if config.threads < 1:
        raise BadInput("threads", "", f"expected at least 1, got {config.threads}")
    scenario = checked_scenario(config.scenario, config.overrides)
    agents, factor = agent_specs(scenario), parse_factor(config.realtime)
    sensors = {name: kind.needs for name, kind in check_agents(scenario, agents).items()}
    gateways = None
    if config.gateways and (chosen := as_gateways(config.gateways)) and chosen.kinds:
        gateways = RunGateways(chosen, scenario)
        if gateways.has_crazyradio:
            scenario = gateways.with_safelink()
        factor = 1.0 if factor is None else factor
        sensors = gateways.sensors(sensors, bodies_of(scenario, scenario.source))
    world = World(scenario, choose_seeds(scenario, config.seed, config.seeds), sensors, config.threads)
    static, replay = world.static, config.replay
    selection = selected_metrics(scenario)
    hidden = (str(Path(config.out).resolve()),) if config.out is not None else ()
    runners = runner_count(config.runners, static.arenas * static.robots)
    plan = Plan(
        config=config,
        scenario=scenario,
        static=static,
        agents=agents,
        sensors=sensors,
        metrics=tuple(selection.metrics),
        stop_conditions=tuple(stop_conditions(scenario)),
        code=tuple(dict.fromkeys([*agents.values(), *custom_code(static), *selection.code])),
        traces=scenario_traces(scenario),
        interfaces=None if replay else run_interfaces(scenario),
        gateways=gateways,
        factor=factor,
        subtick_s=checked_subtick(config.subtick, factor, scenario, gateways is not None and gateways.has_crazyradio),
        ticks=replay.ticks if replay else tick_count(scenario),
        runners=runners if config.listening is None else 1,
        isolation=Isolation(config.agent_network, config.isolate, hidden),
        record=config.record or Recording(),
    )
    _check_combination(plan)
    return plan, world


def _check_combination(plan: Plan) -> None:
    """Raise BadInput for options that exclude one another, or that the scenario does not allow."""
    config, static, listening = plan.config, plan.static, plan.config.listening
    if listening is not None:
        listening.check(plan.scenario, plan.robots)
        if listening.observed and config.out is None:
            raise BadInput("observed", "", "expected a run folder with it: a run without one is not published")
    if config.isolate and not plan.runners:
        raise BadInput("isolate", "", "expected runners with it: agents in this process are not isolated")
    if plan.gateways:
        plan.gateways.check(static.arenas, plan.runners)
    if plan.interfaces:
        plan.interfaces.check(static)
    plan.record.check(static)
    if plan.out is not None:
        check_folder(plan.out)
