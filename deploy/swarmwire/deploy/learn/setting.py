"""Settings: a scenario with the random values of an episode, checked once, and the common data of its worlds."""

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

MAX_SETTINGS = 256  # cached settings


class Setting:
    """A scenario with its policies.

    Attributes:
        scenario: the checked scenario.
        agents: the spec of each group's agent; agents of controlled groups never act.
        layouts: the layout of observations and actions, by controlled group.
        needs: the sensors to compute, by group.
        metrics: the metrics of reward and conditions.
        conditions: the conditions that end an episode.
        ticks: duration of an episode.
        traces: the traces of the scenario's radio, if any.
        hashes: True to compute trajectory hashes.
    """

    def __init__(self, scenario: Scenario, options: EnvOptions) -> None:
        """Check scenario and options; BadInput for invalid ones."""
        keep_memory()  # not at import, since a copy in another process creates its settings again
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
        terminated = [options.terminated] if isinstance(options.terminated, Condition) else []
        self.conditions = [*stop_conditions(scenario), *terminated]
        self.metrics = _metrics(scenario, options, terminated)
        self.ticks = tick_count(scenario)
        self.traces = scenario_traces(scenario)
        self.hashes = options.hashes

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy by creating the setting again: classes of agents and messages cannot be pickled."""
        return Setting, (self.scenario, self._options)

    @property
    def period(self) -> int:
        """Ticks from one action of the policy to the next: the least period of its groups."""
        return min(self.scenario.robots[name].act_every_ticks for name in self.layouts)

    @cached_property
    def shape(self) -> tuple[object, ...]:
        """The common properties of all settings of an environment: robots, spaces and time of a step."""
        layouts = [(name, layout.observation, layout.action) for name, layout in self.layouts.items()]
        return self.scenario.robot_names(), tuple(layouts), self.period, self.scenario.time.rate_hz


class Settings:
    """The settings of an environment, cached by their overrides."""

    def __init__(self, scenario: Path | str | Mapping[str, Any], options: EnvOptions) -> None:
        """`scenario` is a file, or its content as a mapping; BadInput for an invalid scenario or option."""
        self._where = str(scenario) if isinstance(scenario, Path | str) else "scenario"
        self._mapping = read_toml(Path(scenario)) if isinstance(scenario, Path | str) else deepcopy(dict(scenario))
        self._options = options
        self._cache: dict[tuple[str, ...], Setting] = {}
        self.first = self._new_setting(())

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_cache": {}}  # a copy makes them as its episodes need them

    def with_values(self, values: Mapping[str, object]) -> Setting:
        """Return the setting with these values, by path; BadInput if its shape differs from the first setting's."""
        overrides = tuple(f"{path}={toml_value(value)}" for path, value in values.items())
        if overrides not in self._cache:
            if len(self._cache) == MAX_SETTINGS:
                del self._cache[next(iter(self._cache))]
            setting = self._new_setting(overrides)
            if setting.shape != self.first.shape:
                expected = "expected keys that keep robots, sensors, measures and times of steps as they are"
                raise BadInput("randomise", ", ".join(values), expected)
            self._cache[overrides] = setting
        return self._cache[overrides]

    def _new_setting(self, overrides: tuple[str, ...]) -> Setting:
        scenario = scenario_from(self._mapping, self._where, [*self._options.overrides, *overrides])
        return Setting(scenario, self._options)


def _policy_io(scenario: Scenario, needs: tuple[str, ...], sensors: tuple[str, ...], options: EnvOptions) -> PolicyIO:
    """Return inputs and outputs of a policy in place of an agent with these needs, on a body with these sensors."""
    if options.sensors is not None:
        read = tuple(options.sensors)
    else:
        read = tuple(need for need in needs if not need.startswith("radio.")) or sensors
    radio_needs = scenario.radio.needs if scenario.radio else ()
    measures = tuple(name for name in MEASURED if name in radio_needs)
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


def _metrics(scenario: Scenario, options: EnvOptions, terminated: list[Condition]) -> tuple[Metric, ...]:
    """Return the metrics that an episode needs, each once."""
    stop_metrics = [table.metric for table in scenario.stops().values()]
    names = dict.fromkeys([*stop_metrics, *(condition.metric for condition in terminated), *options.weights])
    metrics = {metric.name: metric for metric in selected_metrics(scenario).metrics}  # have the scenario's parameters
    entries = [MetricEntry(name, name, None) for name in names if name not in metrics]
    metrics |= {metric.name: metric for metric in select_metrics(entries, "reward", with_standard=False).metrics}
    return tuple(metrics[name] for name in names)
