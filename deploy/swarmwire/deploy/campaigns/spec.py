"""A campaign as people ask for it, by options or in a TOML file, and checked: every design point, before any run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.config import check_format, converted, did_you_mean, folder_of, read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.columns import FIXED, responses_of
from swarmwire.deploy.campaigns.design import GRID, Point, Range, Vary, points_of, toml_value, vary_from, whole_numbers
from swarmwire.deploy.runs.config import SEEDS, seed_list
from swarmwire.deploy.runs.scenario_parts import agent_specs, check_agents, scenario_traces, selected_metrics
from swarmwire.metrics.records.campaign.campaign_json import Response
from swarmwire.world.scenario.bodies import bodies_of, custom_code_of
from swarmwire.world.scenario.scenario import Scenario, mapping_of
from swarmwire.world.scenario_file import load_scenario, scenario_from

MAX_RUNS = 10_000_000
FORMAT = 1
SCENARIO_KEYS = ("arena", "robots", "duration_s")  # that a campaign's file never has


@dataclass(frozen=True)
class SweepSpec:
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
    """A campaign that can be run: `spec`, and what it comes to."""

    spec: SweepSpec
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
            for vary in self.spec.varied
        }


def plan_of(spec: SweepSpec) -> Plan:
    """Check a campaign; BadInput for the first point that cannot be run, and for anything else that is invalid."""
    scenario = _scenario_of(spec)
    for vary in spec.varied:
        if vary.path in FIXED or vary.path == "format":
            raise vary.refused(f"expected another path: {vary.path} cannot vary")
        _refuse_overrides_of(vary, spec.overrides)
    points = points_of(spec.design, spec.varied, spec.points, spec.design_seed, whole_numbers(scenario))
    if len(points) * len(spec.seeds) > MAX_RUNS:
        raise BadInput("seeds", "", f"expected at most {MAX_RUNS} runs, got {len(points) * len(spec.seeds)}")
    strange = [seed for seed in spec.record_seeds if seed not in spec.seeds]
    if strange:
        raise BadInput("record_seeds", "", f"expected seeds of the campaign, got {strange[0]}")
    if spec.batch is not None and spec.batch < 1:
        raise BadInput("batch", "", f"expected at least 1, got {spec.batch}")
    mapping = mapping_of(scenario)
    scenarios, code = list[Scenario](), dict[str, None]()
    for point in points:
        try:
            scenarios.append(scenario_from(mapping, scenario.source, overrides_of(point)))
            code.update(dict.fromkeys(_code(scenarios[-1])))
        except BadInput as error:
            _refuse_alone(scenario, error)
            raise _blamed(error, spec.varied, point) from None
    robots = max(len(at.robot_names()) for at in scenarios)
    return Plan(spec, scenario, tuple(points), responses_of(scenarios), tuple(code), robots)


def _scenario_of(spec: SweepSpec) -> Scenario:
    """The scenario with the overrides of all points, as checked."""
    given = spec.scenario
    if isinstance(given, Scenario):
        return scenario_from(mapping_of(given), given.source, spec.overrides)
    return load_scenario(given, spec.overrides)


def _refuse_overrides_of(vary: Vary, overrides: Sequence[str]) -> None:
    """BadInput for an override of all points that the values of each point would replace."""
    for override in overrides:
        path = override.partition("=")[0].strip()
        if f"{path}.".startswith(f"{vary.path}."):
            expected = f"expected a path that does not vary: {vary.where} replaces this value at every point"
            raise BadInput(f"--set {override}", path, expected)


def overrides_of(point: Point) -> list[str]:
    """The values of a point as for `--set`."""
    return [f"{path}={toml_value(value)}" for path, value in point.items()]


def _code(scenario: Scenario) -> list[str]:
    """The specs of users' classes that a scenario names; BadInput unless all of them are fit for it."""
    agents = agent_specs(scenario)
    check_agents(scenario, agents)
    scenario_traces(scenario)
    bodies = bodies_of(scenario, scenario.source)
    return [*agents.values(), *custom_code_of(bodies.values()), *selected_metrics(scenario).code]


def _refuse_alone(scenario: Scenario, fault: BadInput) -> None:
    """BadInput if the scenario has the same fault where nothing is varied."""
    try:
        _code(scenario)
    except BadInput as error:
        if error.key == fault.key:
            raise error from None


def _blamed(error: BadInput, varied: Sequence[Vary], point: Point) -> BadInput:
    """The error of a point, by what varies: one value that is wrong by itself, or all that meet there."""
    for vary in varied:
        if f"{error.key}.".startswith(f"{vary.path}.") or error.where.startswith(f"--set {vary.path}="):
            return BadInput(vary.where, error.key, error.expected)
    if not point:
        return error
    return BadInput(" ".join(f"--vary {text}" for text in overrides_of(point)), error.key, error.expected)


@dataclass(frozen=True)
class CampaignFile:
    """The keys of a campaign's TOML file."""

    scenario: str
    format: int
    name: str | None = None
    seeds: int | str | list[int] | None = None
    design: str = GRID
    points: int | None = None
    design_seed: int = 1
    vary: dict[str, Any] = field(default_factory=dict[str, Any])
    overrides: list[str] = field(default_factory=list[str])
    batch: int | None = None
    series: bool = True
    record_seeds: int | str | list[int] = field(default_factory=list[int])


def campaign_file(path: Path) -> CampaignFile | None:
    """The content of a campaign's file; None if the file describes a scenario instead.

    BadInput if it cannot be read, or has a key that is unknown, missing or of another type.
    """
    table = read_toml(path)
    if "scenario" not in table and any(key in table for key in SCENARIO_KEYS):
        return None
    check_format(table, FORMAT, str(path))
    known = [of.name for of in fields(CampaignFile)]
    for key in table:
        if key not in known:
            raise BadInput(str(path), key, f"unknown key; expected {did_you_mean(known, key)}")
    return converted(CampaignFile, table, str(path))


def spec_in(path: Path, file: CampaignFile, seeds: str | None = None) -> SweepSpec:
    """The campaign of a file, with other seeds if they are given; a scenario's path is as seen from the file.

    BadInput names the key.
    """
    where, given = str(path), file.seeds if seeds is None else seeds
    if given is None:
        raise BadInput(where, "seeds", f"is missing: expected {SEEDS}")
    return SweepSpec(
        scenario=folder_of(path) / file.scenario,
        seeds=seed_list(given, f"{where}: seeds"),
        varied=tuple(vary_from(key, of, f"{where}: vary.{key}") for key, of in _flat(file.vary).items()),
        design=file.design,
        points=file.points,
        design_seed=file.design_seed,
        overrides=tuple(file.overrides),
        name=file.name,
        batch=file.batch,
        series=file.series,
        record_seeds=seed_list(file.record_seeds, f"{where}: record_seeds") if file.record_seeds else (),
    )


def _flat(vary: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """By path: a key without quotes, such as radio.loss, is a table within a table to TOML."""
    flat: dict[str, Any] = {}
    for key, value in vary.items():
        if isinstance(value, dict) and not {"from", "to"} & set(cast("dict[str, Any]", value)):
            flat.update(_flat(cast("dict[str, Any]", value), f"{above}{key}."))
        else:
            flat[f"{above}{key}"] = value
    return flat
