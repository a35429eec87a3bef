"""The interface of physics engines, and their configuration: motors, arenas and robots as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import Obstacles
from swarmwire.comms.base.geometry.shapes import Boundary, Obstacle
from swarmwire.comms.observe.truth import Group, Static
from swarmwire.comms.robot.bodies.drives import wheel_base_of


class EngineMotors(NamedTuple):
    """The motors of each robot index of an arena, (robots,) each."""

    wheel_base_m: FloatArray  # 0: no wheels
    max_force_n: FloatArray
    max_torque_nm: FloatArray
    mass_kg: FloatArray
    inertia_kgm2: FloatArray


def motors_of(groups: Sequence[Group]) -> EngineMotors:
    """Return the motors of each robot of the groups in order; a body's mass is spread evenly over its disc."""
    drives = [
        (wheel_base_of(d), d.max_force_n, d.max_torque_nm, b.mass_kg, 0.5 * b.mass_kg * b.radius_m**2)
        for b, d in ((group.body, group.body.drive) for group in groups)
    ]
    columns = np.repeat(np.array(drives), [group.stop - group.start for group in groups], axis=0).T
    return EngineMotors(*(np.ascontiguousarray(column) for column in columns))


@dataclass(frozen=True, slots=True)
class EngineConfig:
    """The arenas and the n robots of each that one engine moves, in the order of its rows."""

    size_m: tuple[float, float]  # full extents of an arena; the origin is its centre
    boundary: Boundary
    initial_obstacles: tuple[tuple[Obstacle, ...], ...]  # the obstacles of each arena at the start
    obstacles: Obstacles  # the same as arrays; the engine updates movable ones in place
    radius_m: FloatArray  # (n,)
    bottom_m: FloatArray  # (n,) height of the lower side of a robot; it passes over obstacles up to this height
    top_m: FloatArray  # (n,) height of its upper side
    motors: EngineMotors  # (n,) each
    tick_s: float
    steps: int  # physics steps in a tick
    followed: BoolArray  # (n,) True: a source moves the robot, see `Engine.follow`


def engine_config_of(static: Static, obstacles: Obstacles, groups: Sequence[Group], steps: int) -> EngineConfig:
    """Return the configuration of an engine that moves these groups of an arena, in this order."""
    count = [group.stop - group.start for group in groups]
    radius_m, bottom_m, height_m = (
        np.repeat(column, count)
        for column in zip(*((g.body.radius_m, g.body.altitude_m, g.body.height_m) for g in groups), strict=True)
    )
    return EngineConfig(
        size_m=static.arena_size_m,
        boundary=static.boundary,
        initial_obstacles=static.obstacles,
        obstacles=obstacles,
        radius_m=radius_m,
        bottom_m=bottom_m,
        top_m=bottom_m + height_m,
        motors=motors_of(groups),
        tick_s=1.0 / static.rate_hz,
        steps=steps,
        followed=np.repeat([group.followed for group in groups], count),
    )


class Engine(Protocol):
    """Moves robots in all arenas. An arena moves bit for bit alike alone and beside others.

    `Engine(config, pose)` makes an engine with all robots at rest at `pose` (arenas, n, 3). It owns the arrays, writes
    to them in place in `tick`, and they always show the present.
    """

    name: ClassVar[str]
    state: FloatArray  # (arenas, n, 6) x, y in m, heading in rad (not wrapped), m/s, m/s, rad/s; arena frame
    travel_m: FloatArray  # (arenas, n, 2) distance that the left and right wheel have rolled since the start
    touched: FloatArray  # (arenas, n) 1 for a robot that touched anything in the last tick, else 0
    braked: BoolArray  # (arenas, n) motors that only resist, if their commands are 0; set from outside, in place

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, n, 3): forward m/s, left turn rad/s, to the left m/s.

        Returns:
            (arenas, 2) contacts that began: robot with robot, robot with wall or obstacle. A contact begins if a pair
            touches in this tick and did not in the last; all walls and obstacles count as one body.
        """
        ...

    def follow(self, end: FloatArray) -> None:
        """Set the states of the k followed robots at the end of the next tick, (arenas, k, 6).

        Within the tick they move by the velocities in it, and nothing pushes them away. Contacts of followed robots
        with one another, with walls and with obstacles do not count.
        """
        ...

    def set_states(self, states: FloatArray) -> None:
        """Set the states of the k followed robots at once, (arenas, k, 6), before the first tick."""
        ...

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots at once, (arenas, n, 2) in m/s; TypeError if the engine has no forces."""
        ...

    def leave(self, over: BoolArray) -> None:
        """Stop the arenas `over` (arenas,): nothing in them moves or touches, `state` and `travel_m` stay."""
        ...
