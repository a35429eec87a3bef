"""What people ask of a campaign, checked at the door: every design point, before anything runs or is written."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.agents import agent_specs, check_agents
from swarmwire.deploy.campaign.columns import FIXED
from swarmwire.deploy.campaign.design import GRID, Point, points_of
from swarmwire.deploy.campaign.responses import responses_of
from swarmwire.deploy.campaign.toml_value import toml_value
from swarmwire.deploy.campaign.vary import Range, Vary
from swarmwire.deploy.campaign.whole_numbers import whole_numbers
from swarmwire.deploy.measuring import measuring
from swarmwire.deploy.radio.link_trace_file import scenario_traces
from swarmwire.metrics.campaign.response import Response
from swarmwire.world.scenario.bodies import bodies_of, custom_code_of
from swarmwire.world.scenario.scenario import Scenario, mapping_of
from swarmwire.world.scenario_file import load_scenario, scenario_from

MAX_RUNS = 10_000_000


@dataclass(frozen=True)
class Asked:
    """A campaign as people ask for it."""

    scenario: Scenario | Path | str
    seeds: tuple[int, ...]
    varied: tuple[Vary, ...] = ()
    design: str = GRID
    points: int | None = None  # that a design draws
    design_seed: int = 1
    overrides: tuple[str, ...] = ()
    name: str | None = None  # None: the scenario's
    batch: int | None = None
    series: bool = True
    record_seeds: tuple[int, ...] = ()


@dataclass(frozen=True)
class Plan:
    """A campaign that can be run: `asked`, and what it comes to."""

    asked: Asked
    scenario: Scenario  # with the overrides of all points
    points: tuple[Point, ...]
    responses: tuple[Response, ...]
    code: tuple[str, ...]  # the specs of users' classes, of all points
    robots: int  # in an arena, at the point that has most

    def at(self, point: Point) -> Scenario:
        """The scenario at a point."""
        return scenario_from(mapping_of(self.scenario), self.scenario.source, overrides_of(point))

    def vary(self) -> Mapping[str, Any]:
        """By path: the values in order, or between which numbers they were drawn."""
        return {
            vary.path: {"from": float(vary.values.first), "to": float(vary.values.last)}
            if isinstance(vary.values, Range) and vary.values.count is None
            else list({toml_value(point[vary.path]): point[vary.path] for point in self.points}.values())
            for vary in self.asked.varied
        }


def planned(asked: Asked) -> Plan:
    """The plan of what was asked; BadInput for the first point that cannot be run, and all that is no good."""
    scenario = _scenario_of(asked)
    for vary in asked.varied:
        if vary.path in FIXED or vary.path == "format":
            raise vary.refused(f"expected another path: {vary.path} cannot vary")
    points = points_of(asked.design, asked.varied, asked.points, asked.design_seed, whole_numbers(scenario))
    if len(points) * len(asked.seeds) > MAX_RUNS:
        raise BadInput("--seeds", "", f"expected at most {MAX_RUNS} runs, got {len(points) * len(asked.seeds)}")
    strange = [seed for seed in asked.record_seeds if seed not in asked.seeds]
    if strange:
        raise BadInput("--record-seeds", "", f"expected seeds of the campaign, got {strange[0]}")
    if asked.batch is not None and asked.batch < 1:
        raise BadInput("--batch", "", f"expected at least 1, got {asked.batch}")
    mapping = mapping_of(scenario)
    scenarios, code = list[Scenario](), dict[str, None]()
    for point in points:
        try:
            scenarios.append(scenario_from(mapping, scenario.source, overrides_of(point)))
            code.update(dict.fromkeys(_code(scenarios[-1])))
        except BadInput as error:
            _refuse_alone(scenario, error)
            raise _blamed(error, asked.varied, point) from None
    robots = max(len(at.robot_names()) for at in scenarios)
    return Plan(asked, scenario, tuple(points), responses_of(scenarios), tuple(code), robots)


def _scenario_of(asked: Asked) -> Scenario:
    """The scenario with the overrides of all points, as checked."""
    given = asked.scenario
    if isinstance(given, Scenario):
        return scenario_from(mapping_of(given), given.source, asked.overrides)
    return load_scenario(given, asked.overrides)


def overrides_of(point: Point) -> list[str]:
    """The values of a point as for `--set`."""
    return [f"{path}={toml_value(value)}" for path, value in point.items()]


def _code(scenario: Scenario) -> list[str]:
    """The specs of users' classes that a scenario names; BadInput unless all of them are fit for it."""
    agents = agent_specs(scenario)
    check_agents(scenario, agents)
    scenario_traces(scenario)
    bodies = bodies_of(scenario, scenario.source)
    return [*agents.values(), *custom_code_of(bodies.values()), *measuring(scenario).code]


def _refuse_alone(scenario: Scenario, fault: BadInput) -> None:
    """BadInput if the scenario has the same fault where nothing is varied."""
    try:
        _code(scenario)
    except BadInput as error:
        if error.key == fault.key:
            raise error from None


def _blamed(error: BadInput, varied: Sequence[Vary], point: Point) -> BadInput:
    """The fault of a point, told by what varies: of a value that is wrong by itself, or of all that meet there."""
    for vary in varied:
        if f"{error.key}.".startswith(f"{vary.path}.") or error.where.startswith(f"--set {vary.path}="):
            return BadInput(vary.said, error.key, error.expected)
    if not point:
        return error
    return BadInput(" ".join(f"--vary {text}" for text in overrides_of(point)), error.key, error.expected)
