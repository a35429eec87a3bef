"""The scenario: all tables of a run's file, frozen. Unknown keys are refused."""

from copy import deepcopy
from dataclasses import fields, is_dataclass
from itertools import accumulate
from typing import Annotated, Any, Literal, cast

from pydantic import BaseModel, Field, PrivateAttr, StringConstraints, field_validator, model_validator
from pydantic_core import PydanticCustomError

from swarmwire.comms.radio.config.antennas import RobotAntenna
from swarmwire.comms.radio.config.presets import with_preset
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.world.events import ACTIONS
from swarmwire.world.events.event import Event
from swarmwire.world.events.selection import Groups
from swarmwire.world.scenario.arena import ArenaTable
from swarmwire.world.scenario.motion import LiveMotion, MotionTable
from swarmwire.world.scenario.ros2 import Ros2Table
from swarmwire.world.scenario.schema import AsTable, OneOf
from swarmwire.world.scenario.tables import (
    AtPoses,
    InArena,
    MetricItem,
    PlacementTable,
    ScenarioTable,
    StopTable,
    StopTables,
)

GroupName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=40)]

EngineName = Literal["discs", "pymunk", "kinematic"]


class TimeTable(ScenarioTable):
    """[time]: the base period of the run."""

    rate_hz: int = Field(default=10, ge=1, le=1000, json_schema_extra={"unit": "Hz"})
    """Ticks per second."""


class PhysicsTable(ScenarioTable):
    """[physics]: motion and contacts of bodies."""

    engine: Literal["auto", EngineName] = "auto"
    """Engine of bodies that have contacts: discs, or pymunk, which also moves obstacles; "auto" is discs unless an
    obstacle is movable. Bodies that fly or have no contacts are always kinematic; "kinematic" makes all bodies so."""
    steps: int = Field(default=5, ge=1, le=1000)
    """Physics steps per tick; refused if a robot with contacts at full speed would move over a quarter of its radius in
    a step."""


class RobotsTable(ScenarioTable):
    """[robots.<group>]: robots of one kind that run the same agent."""

    body: str = Field(min_length=1)
    """Name of the body."""
    body_overrides: dict[str, Any] = Field(default_factory=dict)
    """Changes of the body's data sheet for this group, such as sensors.proximity.drop_out."""
    count: int = Field(ge=1, le=1_000_000)
    """Number of robots."""
    agent: str = Field(min_length=1)
    """The agent's class, as module:Class or file.py:Class, or a trained policy, as file.onnx; a file's path is relative
    to the scenario."""
    program: tuple[str, ...] = Field(default=(), strict=False)
    """A program that runs on each robot, and its arguments; a path is relative to the scenario. Needs
    radio.interface."""
    act_every_ticks: int = Field(default=1, ge=1, le=1_000_000, json_schema_extra={"unit": "ticks"})
    """The robots act when the tick modulo this is 0, and then receive all packets since they last acted."""
    params: dict[str, Any] = Field(default_factory=dict)
    """The agent's parameters."""
    radio: Annotated[RobotAntenna, AsTable()] | None = None
    """Antenna and spreading factor of the group's radios; only for a radio with a PHY."""
    place: PlacementTable = InArena(how="arena")
    """Poses of the robots at the start."""
    motion: MotionTable | None = None
    """Source of the robots' poses, if others move them; default: the robots move by their own drives."""

    @model_validator(mode="after")
    def _check_poses(self) -> "RobotsTable":
        if isinstance(self.place, AtPoses) and len(self.place.poses) != self.count:
            text = "expected a pose for each of the {count} robots, got {poses} poses"
            raise PydanticCustomError("poses", text, {"count": self.count, "poses": len(self.place.poses)})
        return self


class RunTable(ScenarioTable):
    """[run]: how the loop handles runners."""

    on_runner_loss: Literal["stop", "dead", "wait", "stand", "coast"] = "stop"
    """Effect of a lost runner: the run ends (stop), its robots stand still to the end (dead), the run waits until
    another runner takes over (wait), or until then the run continues and they stand still (stand) or keep their last
    command (coast)."""
    runner_timeout_s: float = Field(default=30.0, gt=0, le=86_400, json_schema_extra={"unit": "s"})
    """A runner that does not answer for this time is lost."""
    watchdog_s: float = Field(default=0.5, gt=0, le=86_400, json_schema_extra={"unit": "s"})
    """In real time: a robot without new commands for this simulated time stops."""


class Scenario(ScenarioTable):
    """One run: its arena, robots, radio and length."""

    format: Literal[1]
    """Version of this format."""
    name: str = Field(min_length=1, max_length=200)
    """Description of the run."""
    seed: int = Field(default=1, ge=0, le=2**63 - 1)
    """The seed of every draw of the run's arena."""
    duration_s: float = Field(gt=0, le=1e9, json_schema_extra={"unit": "s"})
    """Length of the run."""
    time: TimeTable = TimeTable()
    """The base period."""
    physics: PhysicsTable = PhysicsTable()
    """Motion of bodies."""
    arena: ArenaTable
    """The plane."""
    robots: dict[GroupName, RobotsTable] = Field(min_length=1)
    """The groups of robots, by name."""
    radio: Annotated[Radio, AsTable()] | None = None
    """The radio; default: none."""
    events: tuple[Annotated[Event, OneOf("do", ACTIONS)], ...] = Field(default=(), strict=False)
    """Scheduled changes of robots and radios."""
    standard_metrics: bool = True
    """Measure the standard metrics; false: only those in `metrics` and `stop`."""
    metrics: tuple[MetricItem, ...] = Field(default=(), strict=False)
    """More metrics: names, custom classes as module:Class or file.py:Class, or tables with parameters."""
    stop: StopTables = ()
    """Stop conditions: the first that holds ends an arena before `duration_s`."""
    run: RunTable = RunTable()
    """Runners."""
    ros2: Ros2Table = Ros2Table()
    """Topics of ROS 2 that cross the radio."""

    @field_validator("radio", mode="before")
    @classmethod
    def _with_preset(cls, radio: Any) -> Any:
        return with_preset(cast("dict[str, Any]", radio)) if isinstance(radio, dict) else radio

    _source: str = PrivateAttr("")
    _file_mapping: dict[str, Any] | None = PrivateAttr(None)

    @property
    def source(self) -> str:
        """The file or other source of the scenario, for messages."""
        return self._source

    @property
    def file_mapping(self) -> dict[str, Any] | None:
        """The mapping from which it was read, with overrides; None for a scenario made in Python."""
        return self._file_mapping

    def with_source(self, source: str, file_mapping: dict[str, Any] | None = None) -> "Scenario":
        """Set the source for messages and the mapping from which this scenario was read; return the scenario."""
        self._source, self._file_mapping = source, file_mapping
        return self

    def stops(self) -> dict[str, StopTable]:
        """Return the stop conditions by the path of their table: "stop", or "stop.0" and so on."""
        if isinstance(self.stop, StopTable):
            return {"stop": self.stop}
        return {f"stop.{index}": table for index, table in enumerate(self.stop)}

    def live_motions(self) -> dict[str, LiveMotion]:
        """Return the live source of poses of each group that has one, by the group's name."""
        motions = {name: table.motion for name, table in self.robots.items()}
        return {name: motion for name, motion in motions.items() if isinstance(motion, LiveMotion)}

    def groups(self) -> Groups:
        """Return the indices within an arena of each group's robots."""
        stops = accumulate(table.count for table in self.robots.values())
        return {
            name: range(stop - self.robots[name].count, stop) for name, stop in zip(self.robots, stops, strict=True)
        }

    def stations(self) -> tuple[int, ...]:
        """Return the indices within an arena of the robots that poll all others, under the access method esb."""
        name = self.radio.access_or_default.station if self.radio else None
        if name is None:
            return (0,)
        return tuple(self.groups().get(name) or (self.robot_names().index(name),))

    def robot_names(self) -> tuple[str, ...]:
        """Return `group-i` for each robot index of an arena."""
        return tuple(f"{group}-{i}" for group, table in self.robots.items() for i in range(table.count))


def mapping_of(scenario: Scenario) -> dict[str, Any]:
    """Return a new mapping of a scenario, the inverse of `scenario_from`: texts, numbers, lists and tables only.

    It equals the mapping from which the scenario was read, as long as that describes the scenario. The mapping of a
    scenario that was made or changed in Python also has the defaults of radio and events.
    """
    file_mapping = scenario.file_mapping
    if file_mapping is not None and same_content(Scenario.model_validate(file_mapping), scenario):
        return deepcopy(file_mapping)
    return cast("dict[str, Any]", _plain(scenario))


def same_content(first: Scenario, second: Scenario) -> bool:
    """Return True if two scenarios are equal except for their sources."""
    return all(getattr(first, name) == getattr(second, name) for name in Scenario.model_fields)


def _plain(value: object) -> object:
    if isinstance(value, BaseModel):
        names = [name for name in type(value).model_fields if name in value.model_fields_set]
        return _table({**{name: getattr(value, name) for name in names}, **(value.model_extra or {})})
    if is_dataclass(value) and not isinstance(value, type):
        return _table({field.name: getattr(value, field.name) for field in fields(value)})
    if isinstance(value, dict):
        return _table(cast("dict[str, object]", value))
    if isinstance(value, list | tuple):
        return [_plain(item) for item in cast("list[object]", value)]
    return value


def _table(items: dict[str, object]) -> dict[str, object]:
    """Convert a table; keys that are None are omitted, since TOML has no null."""
    return {name: _plain(item) for name, item in items.items() if item is not None}
