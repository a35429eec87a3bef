"""The interface of sources in lockstep, whose poses depend on time alone, and the sources of a scenario."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import did_you_mean, folder_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import custom_class, resolve
from swarmwire.world.motion.traces.reading import read_trace
from swarmwire.world.motion.traces.trace import MotionTrace, TracePoses
from swarmwire.world.scenario.motion import CustomMotion, TraceMotion
from swarmwire.world.scenario.scenario import RobotsTable, Scenario


class PoseSource(ABC):
    """Poses of a group's robots for every time of a run.

    A user's own source is a dataclass below this class; the scenario's `params` are its fields, and it also gets the
    number of robots as `count` if it has such a field. Equal times must give equal poses, or runs do not repeat.
    """

    @abstractmethod
    def at(self, time_s: float) -> FloatArray:
        """Return the poses of all robots at a time of the run, (count, 4): x, y, z in m, heading in rad.

        z is the height of the robot's lower side above the floor. The frame is that of the arena.
        """


LockstepSource = PoseSource | TracePoses


@dataclass
class CheckedSource(PoseSource):
    """A user's source, whose poses are checked."""

    source: PoseSource
    count: int
    where: str
    key: str

    def at(self, time_s: float) -> FloatArray:
        """Return the poses at a time of the run; BadInput unless they have the right shape and are finite."""
        pose = np.asarray(self.source.at(time_s), np.float64)
        if pose.shape != (self.count, 4) or not np.isfinite(pose).all():
            got = f"got an array of {pose.shape}" if pose.shape != (self.count, 4) else "got NaN or infinite numbers"
            name = type(self.source).__name__
            expected = f"expected finite poses ({self.count}, 4) of {name}.at({time_s:g}), {got}"
            raise BadInput(self.where, self.key, expected)
        return pose


def lockstep_sources(scenario: Scenario, size_m: tuple[float, float]) -> dict[str, LockstepSource]:
    """Return the source of each group that has one in lockstep, by the group's name.

    BadInput names the scenario or the trace's file, the key and what was expected.
    """
    sources: dict[str, LockstepSource] = {}
    for name, table in scenario.robots.items():
        if isinstance(table.motion, TraceMotion):
            sources[name] = _trace_source(scenario, name, table, table.motion, size_m)
        elif isinstance(table.motion, CustomMotion):
            sources[name] = _custom_source(scenario, name, table, table.motion)
    return sources


def motion_files(scenario: Scenario) -> dict[str, Path]:
    """Return the path of each group's trace, a file or a folder, by the group's name."""
    folder = folder_of(scenario.source)
    return {
        name: (folder / table.motion.file).resolve()
        for name, table in scenario.robots.items()
        if isinstance(table.motion, TraceMotion)
    }


def _trace_source(
    scenario: Scenario, name: str, table: RobotsTable, motion: TraceMotion, size_m: tuple[float, float]
) -> TracePoses:
    key, path = f"robots.{name}.motion", motion_files(scenario)[name]
    if not path.exists():
        raise BadInput(scenario.source, f"{key}.file", f"expected a path from the scenario's folder: no {path}")
    trace = read_trace(path, origin=motion.origin).shifted(*motion.offset_m)
    order = _order(trace, motion.robots, table.count, scenario.source, key)
    if scenario.arena.boundary == "walls":
        _check_within(trace, order, size_m, str(path), motion.offset_m)
    return TracePoses(trace, order, motion.start_s)


def _order(trace: MotionTrace, robots: Sequence[str], count: int, where: str, key: str) -> list[int]:
    """Return the robot of the trace for each robot of the group."""
    names = robots or trace.names
    for robot in robots:
        if robot not in trace.names:
            raise BadInput(where, f"{key}.robots", f"expected robots of the file: {did_you_mean(trace.names, robot)}")
    if len(names) != count:
        shown = f"{', '.join(trace.names[:3])}{', …' if len(trace.names) > 3 else ''}"
        in_robots = f"name those of this group in `robots`, out of {shown}"
        hint = in_robots if len(names) > count else f"lower robots.{key.split('.')[1]}.count"
        raise BadInput(where, key, f"expected a trace of {count} robots, got one of {len(names)}: {hint}")
    return [trace.names.index(robot) for robot in names]


def _check_within(
    trace: MotionTrace, order: Sequence[int], size_m: tuple[float, float], file: str, offset_m: tuple[float, float]
) -> None:
    half_x_m, half_y_m = 0.5 * size_m[0], 0.5 * size_m[1]
    outside = (np.abs(trace.x_m) > half_x_m) | (np.abs(trace.y_m) > half_y_m)
    if not outside.any():
        return
    for robot in order:
        samples = slice(int(trace.first[robot]), int(trace.first[robot + 1]))
        rows = np.flatnonzero(outside[samples]) + samples.start
        if len(rows):
            k = int(rows[0])
            got = f"robot {trace.names[robot]} is at ({trace.x_m[k]:g}, {trace.y_m[k]:g}) at {trace.t_s[k]:g} s"
            size = f"expected positions in the arena of {size_m[0]:g} x {size_m[1]:g} m, whose origin is its centre"
            raise BadInput(file, f"robot {trace.names[robot]}", f"{size}: {got}, with offset_m = {list(offset_m)}")


def _custom_source(scenario: Scenario, name: str, table: RobotsTable, motion: CustomMotion) -> PoseSource:
    key = f"robots.{name}.motion"
    kind = custom_class(PoseSource, resolve(motion.kind, folder_of(scenario.source)), scenario.source, f"{key}.kind")
    params = dict(motion.params)
    if "count" in getattr(kind, "__dataclass_fields__", {}):
        params["count"] = table.count
    create = cast("Callable[..., PoseSource]", kind)
    try:
        source = create(**params)
    except (TypeError, ValueError) as error:
        raise BadInput(scenario.source, f"{key}.params", f"{kind.__name__} refuses them: {error}") from error
    return CheckedSource(source, table.count, scenario.source, key)
