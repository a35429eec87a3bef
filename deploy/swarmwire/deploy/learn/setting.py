"""Settings: a scenario with the values that an episode drew, checked once, and what all its worlds have in common."""

from collections.abc import Mapping
from copy import deepcopy
from functools import cached_property
from pathlib import Path
from typing import Any

from swarmwire.agent.policy_io import MEASURED, PolicyIO, PolicyLayout
from swarmwire.comms.base.config import read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.design import toml_value
from swarmwire.deploy.learn.options import EnvOptions
from swarmwire.deploy.machine import keep_memory
from swarmwire.deploy.runs.config import tick_count
from swarmwire.deploy.runs.scenario_parts import (
    agent_specs,
    check_agents,
    scenario_traces,
    selected_metrics,
    stop_conditions,
)
from swarmwire.metrics.measures.measure import Condition
from swarmwire.metrics.measures.metric import Metric
from swarmwire.metrics.measures.registry import MetricEntry, select_metrics
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import scenario_from

KEPT = 256  # settings that are kept for episodes to come


class Setting:
    """A scenario as its policies see it.

    Attributes:
        scenario: as checked.
        agents: the spec of each group's agent; those of groups that the policy controls never act.
        layouts: by group that the policy controls.
        needs: the sensors to compute, by group.
        metrics: those that reward and conditions name.
        conditions: that end an episode.
        ticks: of an episode.
        traces: of the scenario's radio, if it has a file of them.
        hashes: whether trajectories are hashed.
    """

    def __init__(self, scenario: Scenario, options: EnvOptions) -> None:
        """BadInput names what is wrong with the scenario, or does not fit it."""
        keep_memory()  # here, since a copy in another process makes its settings anew
        self.scenario, self._options = scenario, options
        self.agents = agent_specs(scenario)
        kinds = check_agents(scenario, self.agents)
        bodies = bodies_of(scenario, scenario.source)
        controlled = tuple(scenario.robots) if options.groups is None else tuple(options.groups)
        if not controlled:
            raise BadInput("groups", "", f"expected one or more of {', '.join(scenario.robots)}")
        for name in controlled:
            if name not in scenario.robots:
                raise BadInput("groups", "", f"expected some of {', '.join(scenario.robots)}; got {name!r}")
        self.layouts = {
            name: PolicyLayout(
                _policy_io(scenario, kinds[name].needs, tuple(bodies[name].sensors), options), bodies[name]
            )
            for name in scenario.robots
            if name in controlled
        }
        self.needs = {
            name: self.layouts[name].io.needs if name in self.layouts else kinds[name].needs for name in kinds
        }
        own = [options.terminated] if isinstance(options.terminated, Condition) else []
        self.conditions = [*stop_conditions(scenario), *own]
        self.metrics = _metrics(scenario, options, own)
        self.ticks = tick_count(scenario)
        self.traces = scenario_traces(scenario)
        self.hashes = options.hashes

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is made anew: agents and messages are classes that cannot be pickled."""
        return Setting, (self.scenario, self._options)

    @property
    def period(self) -> int:
        """Ticks from one action of the policy to the next: the smallest of its groups'."""
        return min(self.scenario.robots[name].act_every_ticks for name in self.layouts)

    @cached_property
    def shape(self) -> tuple[object, ...]:
        """What must be equal in all settings of an environment: robots, spaces and time of a step."""
        layouts = [(name, layout.observation, layout.action) for name, layout in self.layouts.items()]
        return self.scenario.robot_names(), tuple(layouts), self.period, self.scenario.time.rate_hz


class Settings:
    """The settings of an environment by their overrides, each made once."""

    def __init__(self, scenario: Path | str | Mapping[str, Any], options: EnvOptions) -> None:
        """`scenario` is a file, or what a file would hold; BadInput for anything wrong with it or the options."""
        self._where = str(scenario) if isinstance(scenario, Path | str) else "scenario"
        self._mapping = read_toml(Path(scenario)) if isinstance(scenario, Path | str) else deepcopy(dict(scenario))
        self._options = options
        self._known: dict[tuple[str, ...], Setting] = {}
        self.first = self._made(())

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_known": {}}  # a copy makes them as its episodes need them

    def with_values(self, values: Mapping[str, object]) -> Setting:
        """The setting with these values, by path; BadInput if they change what an environment cannot change."""
        overrides = tuple(f"{path}={toml_value(value)}" for path, value in values.items())
        if overrides not in self._known:
            if len(self._known) == KEPT:
                del self._known[next(iter(self._known))]
            made = self._made(overrides)
            if made.shape != self.first.shape:
                expected = "expected keys that keep robots, sensors, measures and times of steps as they are"
                raise BadInput("randomise", ", ".join(values), expected)
            self._known[overrides] = made
        return self._known[overrides]

    def _made(self, overrides: tuple[str, ...]) -> Setting:
        scenario = scenario_from(self._mapping, self._where, [*self._options.overrides, *overrides])
        return Setting(scenario, self._options)


def _policy_io(scenario: Scenario, needs: tuple[str, ...], sensors: tuple[str, ...], options: EnvOptions) -> PolicyIO:
    """What a policy sees and sets in place of an agent with these needs, on a body with these sensors."""
    if options.sensors is not None:
        read = tuple(options.sensors)
    else:
        read = tuple(need for need in needs if not need.startswith("radio.")) or sensors
    of_radio = scenario.radio.needs if scenario.radio else ()
    measures = tuple(name for name in MEASURED if name in of_radio)
    shared = tuple(options.shared) if options.shared is not None else tuple(name for name in read if name == "compass")
    has_radio = scenario.radio is not None
    return PolicyIO(
        sensors=read,
        measures=measures,
        neighbours=options.neighbours if has_radio else 0,
        order=options.order or ("nearest" if "radio.range" in measures else "newest"),
        message=options.message if has_radio else 0,
        shared=shared if has_radio else (),
        speed_mps=options.speed_mps,
        turn_radps=options.turn_radps,
    )


def _metrics(scenario: Scenario, options: EnvOptions, own: list[Condition]) -> tuple[Metric, ...]:
    """The metrics that an episode needs, each once."""
    names = [table.metric for table in scenario.stops().values()] + [condition.metric for condition in own]
    wanted = dict.fromkeys([*names, *options.weights])
    found = {
        metric.name: metric for metric in selected_metrics(scenario).metrics
    }  # with the parameters that it gives them
    entries = [MetricEntry(name, name, None) for name in wanted if name not in found]
    found |= {metric.name: metric for metric in select_metrics(entries, "reward", with_standard=False).metrics}
    return tuple(found[name] for name in wanted)
