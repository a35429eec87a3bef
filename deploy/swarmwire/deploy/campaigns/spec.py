"""Specification of a campaign, from options or a TOML file, and the check of all its design points before any run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.config import check_format, converted, did_you_mean, folder_of, read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.columns import FIXED, responses_of
from swarmwire.deploy.campaigns.design import (
    GRID,
    ParameterRange,
    Point,
    Vary,
    points_of,
    toml_value,
    vary_from,
    whole_numbers,
)
from swarmwire.deploy.runs.config import SEEDS, parse_factor, seed_list
from swarmwire.deploy.runs.scenario_parts import agent_specs, check_agents, scenario_traces, selected_metrics
from swarmwire.metrics.records.campaign.campaign_json import Response
from swarmwire.world.scenario.bodies import bodies_of, custom_code_of
from swarmwire.world.scenario.scenario import Scenario, mapping_of
from swarmwire.world.scenario_file import load_scenario, scenario_from

MAX_RUNS = 10_000_000
FORMAT = 1
MAX_LATE = 0.01  # share of late frames or ticks in real time
SCENARIO_KEYS = ("arena", "robots", "duration_s")  # keys of scenarios that a campaign's file never has


@dataclass(frozen=True)
class SweepSpec:
    """Specification of a campaign."""

    scenario: Scenario | Path | str
    seeds: tuple[int, ...]
    varied: tuple[Vary, ...] = ()
    design: str = GRID
    points: int | None = None  # number of points that a design draws
    design_seed: int = 1
    overrides: tuple[str, ...] = ()
    name: str | None = None  # None: the scenario's name
    batch: int | None = None
    series: bool = True
    record_seeds: tuple[int, ...] = ()
    realtime: float | None = None  # simulated s per s of wall time; None: as fast as the machine allows
    max_late: float = MAX_LATE


@dataclass(frozen=True)
class CampaignPlan:
    """A checked specification, with its scenario, points and responses."""

    spec: SweepSpec
    scenario: Scenario  # the scenario with the overrides of all points
    points: tuple[Point, ...]
    responses: tuple[Response, ...]
    code: tuple[str, ...]  # specs of users' classes, at all points
    robots: int  # robots of an arena, at the point with the most

    def scenario_at(self, point: Point) -> Scenario:
        """Return the scenario at a point."""
        return scenario_from(mapping_of(self.scenario), self.scenario.source, overrides_of(point))

    def vary(self) -> Mapping[str, Any]:
        """Return the values of each path in order, or the ends of the range from which they were drawn."""
        return {
            vary.path: {"from": float(vary.values.first), "to": float(vary.values.last)}
            if isinstance(vary.values, ParameterRange) and vary.values.count is None
            else list({toml_value(point[vary.path]): point[vary.path] for point in self.points}.values())
            for vary in self.spec.varied
        }


def plan_of(spec: SweepSpec) -> CampaignPlan:
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
    if parse_factor(spec.realtime) is not None and (spec.batch or 1) > 1:
        raise BadInput("batch", "", f"expected 1 in real time, where each run has a world of its own, got {spec.batch}")
    if not 0.0 <= spec.max_late <= 1.0:
        raise BadInput("max_late", "", f"expected a share from 0 to 1, got {spec.max_late:g}")
    mapping = mapping_of(scenario)
    scenarios, code = list[Scenario](), dict[str, None]()
    for point in points:
        try:
            scenarios.append(scenario_from(mapping, scenario.source, overrides_of(point)))
            code.update(dict.fromkeys(_code(scenarios[-1])))
        except BadInput as error:
            _refuse_alone(scenario, error)
            raise _blamed(error, spec.varied, point) from None
    robots = max(len(scenario.robot_names()) for scenario in scenarios)
    return CampaignPlan(spec, scenario, tuple(points), responses_of(scenarios), tuple(code), robots)


def _scenario_of(spec: SweepSpec) -> Scenario:
    """Load and check the scenario with the overrides of all points."""
    scenario = spec.scenario
    if isinstance(scenario, Scenario):
        return scenario_from(mapping_of(scenario), scenario.source, spec.overrides)
    return load_scenario(scenario, spec.overrides)


def _refuse_overrides_of(vary: Vary, overrides: Sequence[str]) -> None:
    """Raise BadInput for an override of all points that the values of each point would replace."""
    for override in overrides:
        path = override.partition("=")[0].strip()
        if f"{path}.".startswith(f"{vary.path}."):
            expected = f"expected a path that does not vary: {vary.where} replaces this value at every point"
            raise BadInput(f"--set {override}", path, expected)


def overrides_of(point: Point) -> list[str]:
    """Return the values of a point in the form of `--set`."""
    return [f"{path}={toml_value(value)}" for path, value in point.items()]


def _code(scenario: Scenario) -> list[str]:
    """Return the specs of users' classes that a scenario names; BadInput if a class does not fit it."""
    agents = agent_specs(scenario)
    check_agents(scenario, agents)
    scenario_traces(scenario)
    bodies = bodies_of(scenario, scenario.source)
    return [*agents.values(), *custom_code_of(bodies.values()), *selected_metrics(scenario).code]


def _refuse_alone(scenario: Scenario, fault: BadInput) -> None:
    """Raise BadInput if the scenario has the same fault without varied values."""
    try:
        _code(scenario)
    except BadInput as error:
        if error.key == fault.key:
            raise error from None


def _blamed(error: BadInput, varied: Sequence[Vary], point: Point) -> BadInput:
    """Return the error of a point with its cause: the varied path of the key, or all values of the point."""
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
    realtime: float | None = None
    max_late: float = MAX_LATE


def campaign_file(path: Path) -> CampaignFile | None:
    """Read a campaign's file; return None if the file describes a scenario instead.

    BadInput if it cannot be read, or has a key that is unknown, missing or of another type.
    """
    table = read_toml(path)
    if "scenario" not in table and any(key in table for key in SCENARIO_KEYS):
        return None
    check_format(table, FORMAT, str(path))
    keys = [field.name for field in fields(CampaignFile)]
    for key in table:
        if key not in keys:
            raise BadInput(str(path), key, f"unknown key; expected {did_you_mean(keys, key)}")
    return converted(CampaignFile, table, str(path))


def spec_in(path: Path, file: CampaignFile, seeds: str | None = None) -> SweepSpec:
    """Return the specification in a file, with `seeds` in place of its own; the scenario's path is relative to it.

    BadInput names the key.
    """
    where, seeds_option = str(path), file.seeds if seeds is None else seeds
    if seeds_option is None:
        raise BadInput(where, "seeds", f"is missing: expected {SEEDS}")
    return SweepSpec(
        scenario=folder_of(path) / file.scenario,
        seeds=seed_list(seeds_option, f"{where}: seeds"),
        varied=tuple(vary_from(key, values, f"{where}: vary.{key}") for key, values in _flat(file.vary).items()),
        design=file.design,
        points=file.points,
        design_seed=file.design_seed,
        overrides=tuple(file.overrides),
        name=file.name,
        batch=file.batch,
        series=file.series,
        record_seeds=seed_list(file.record_seeds, f"{where}: record_seeds") if file.record_seeds else (),
        realtime=file.realtime,
        max_late=file.max_late,
    )


def _flat(vary: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return values by path; TOML reads a key without quotes, such as radio.loss, as a nested table."""
    flat: dict[str, Any] = {}
    for key, value in vary.items():
        if isinstance(value, dict) and not {"from", "to"} & set(cast("dict[str, Any]", value)):
            flat.update(_flat(cast("dict[str, Any]", value), f"{prefix}{key}."))
        else:
            flat[f"{prefix}{key}"] = value
    return flat
