"""All bodies of all arenas, and the choice of an engine for each group.

One engine moves each group; a world may have several engines. Robots that a source moves (`world.motion`) are in an
engine too, which moves them as the source says. Robots of different engines do not touch one another:
robots on the floor and flying robots pass. The engine of the floor moves bodies with contacts; the kinematic engine
moves bodies without contacts and flying bodies.
"""

from collections.abc import Callable, Mapping

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.obstacles import Obstacles
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.world.engines.discs.engine import DiscsEngine
from swarmwire.world.engines.engine import Engine, EngineConfig, engine_config_of
from swarmwire.world.engines.kinematic import KinematicEngine
from swarmwire.world.engines.pymunk_engine import PymunkEngine
from swarmwire.world.scenario.scenario import EngineName, Scenario

# Engines by their names in scenarios.
ENGINES: dict[EngineName, Callable[[EngineConfig, FloatArray], Engine]] = {
    "discs": DiscsEngine,
    "pymunk": PymunkEngine,
    "kinematic": KinematicEngine,
}


class Physics:
    """The engines of a world, and the state of all robots in the arrays of `Engine`.

    With one engine the arrays are that engine's own.

    Attributes:
        names: names of the engines, that of the floor first.
        state, travel_m, touched: the arrays of `Engine` for all robots.
        movable: (arenas, movable obstacles, 3) x, y in m, heading in rad (not wrapped), always the present.
        braked: (arenas, robots) motors that only resist, if their commands are 0; written in place from outside.
    """

    def __init__(
        self,
        static: Static,
        obstacles: Obstacles,
        engines: Mapping[str, EngineName],
        pose: FloatArray,
        steps: int,
    ) -> None:
        """Make bodies at rest at `pose` (arenas, robots, 3), moved by the engine of their group in `engines`."""
        self._followed: list[IntArray] = []  # of each engine, its rows among all followed robots
        number = (
            np.cumsum(np.repeat([g.followed for g in static.groups], [g.stop - g.start for g in static.groups])) - 1
        )
        self.names: tuple[EngineName, ...] = tuple(name for name in ENGINES if name in engines.values())
        self._engines: list[Engine] = []
        self._robots: list[IntArray] = []  # the robot index of each row of each engine
        for name in self.names:
            engine_groups = [group for group in static.groups if engines[group.name] == name]
            index = np.concatenate([np.arange(group.start, group.stop) for group in engine_groups])
            config = engine_config_of(static, obstacles, engine_groups, steps)
            self._engines.append(ENGINES[name](config, np.ascontiguousarray(pose[:, index])))
            self._robots.append(index)
            self._followed.append(number[index[config.followed]])
        pymunk_engines = [engine for engine in self._engines if isinstance(engine, PymunkEngine)]
        self.movable = pymunk_engines[0].movable if pymunk_engines else np.zeros((len(pose), 0, 3))
        if len(self._engines) == 1:
            first = self._engines[0]
            self.state, self.travel_m, self.touched, self.braked = (
                first.state,
                first.travel_m,
                first.touched,
                first.braked,
            )
            return
        arenas, robots = pose.shape[:2]
        self.state, self.travel_m = np.zeros((arenas, robots, 6)), np.zeros((arenas, robots, 2))
        self.touched = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._gather()

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, robots, 3), and count the contacts that began, (arenas, 2)."""
        if len(self._engines) == 1:
            return self._engines[0].tick(target)
        onsets = np.zeros((len(target), 2), np.int64)
        for engine, index in zip(self._engines, self._robots, strict=True):
            engine.braked[:] = self.braked[:, index]
            onsets += engine.tick(np.ascontiguousarray(target[:, index]))
        self._gather()
        return onsets

    def follow(self, end: FloatArray) -> None:
        """Set the states of all followed robots at the end of the next tick, (arenas, k, 6); see `Engine.follow`."""
        for engine, rows in zip(self._engines, self._followed, strict=True):
            if len(rows):
                engine.follow(np.ascontiguousarray(end[:, rows]))

    def set_states(self, states: FloatArray) -> None:
        """Set the states of all followed robots at once, (arenas, k, 6); see `Engine.set_states`."""
        for engine, rows in zip(self._engines, self._followed, strict=True):
            if len(rows):
                engine.set_states(states[:, rows])
        if len(self._engines) > 1:
            self._gather()

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots at once, (arenas, robots, 2) in m/s; TypeError for the kinematic engine."""
        for engine, index in zip(self._engines, self._robots, strict=True):
            if (group_mps := by_mps[:, index]).any():
                engine.apply_impulse(group_mps)
        if len(self._engines) > 1:
            self._gather()

    def leave(self, over: BoolArray) -> None:
        """Stop the arenas `over` (arenas,): nothing in them moves."""
        for engine in self._engines:
            engine.leave(over)

    def _gather(self) -> None:
        for engine, index in zip(self._engines, self._robots, strict=True):
            self.state[:, index] = engine.state
            self.travel_m[:, index] = engine.travel_m
            self.touched[:, index] = engine.touched


def engines_of(scenario: Scenario, bodies: Mapping[str, Body]) -> dict[str, EngineName]:
    """Return the engine of each group, by the group's name."""
    requested = scenario.physics.engine
    floor: EngineName = requested if requested != "auto" else "pymunk" if movable_in(scenario) else "discs"
    on_floor = [name for name, body in bodies.items() if body.contacts and body.altitude_m == 0.0]
    # Followed robots need an engine with contacts only where others may run into them.
    if all(scenario.robots[name].motion for name in on_floor):
        on_floor = []
    return {name: floor if name in on_floor else "kinematic" for name in bodies}


def movable_in(scenario: Scenario) -> list[int]:
    """Return the indices of the movable obstacles among the scenario's."""
    return [i for i, table in enumerate(scenario.arena.obstacles) if table.movable]


def check_engines(scenario: Scenario, bodies: Mapping[str, Body], where: str) -> None:
    """Raise BadInput if the arena needs a feature that its engine lacks."""
    engines = engines_of(scenario, bodies)
    movable = movable_in(scenario)
    if movable and scenario.physics.engine == "discs":
        expected = f"expected auto or pymunk: discs moves no obstacles, and arena.obstacles.{movable[0]} is movable"
        raise BadInput(where, "physics.engine", expected)
    if movable and "pymunk" not in engines.values():
        expected = "expected a robot with contacts that could push it: all robots are moved without contacts"
        raise BadInput(where, f"arena.obstacles.{movable[0]}.movable", expected)
    requested = scenario.physics.engine
    if requested != "auto" and requested not in engines.values():
        reasons = ", ".join(f"{name} {_kinematic_reason(scenario, name, bodies[name])}" for name in engines)
        raise BadInput(
            where, "physics.engine", f"expected auto or kinematic: no robot could be moved by {requested}: {reasons}"
        )
    grounded = [group for group, engine in engines.items() if engine != "kinematic"]
    if scenario.arena.boundary == "torus" and grounded:
        body = bodies[grounded[0]].name
        expected = f"expected walls or open: on a torus no robot has contacts, and {body} (robots.{grounded[0]}) does"
        raise BadInput(
            where, "arena.boundary", f'{expected}; physics.engine = "kinematic" takes them all off the floor'
        )


def _kinematic_reason(scenario: Scenario, name: str, body: Body) -> str:
    """Return the reason why only the kinematic engine can move the robots of a group."""
    if scenario.robots[name].motion:
        return "follows a source"
    return "flies" if body.altitude_m > 0.0 else "has no contacts"
