"""The world: the bodies and sensors of every arena, tick by tick, without agents and radio.

It does no I/O, except that its constructor reads the images that a scenario names.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.ground import ground_of
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.threads import Threads
from swarmwire.comms.observe.truth import Group, Static
from swarmwire.comms.radio.phy.propagation import range_of
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, Readings, SparseTable
from swarmwire.world.actuation.actuators import Actuators
from swarmwire.world.actuation.batteries import Batteries
from swarmwire.world.annotations import LatestValues, States
from swarmwire.world.custom.actuators import CustomActuators
from swarmwire.world.engines.physics import Physics, engines_of
from swarmwire.world.motion.followed import FollowedRobots
from swarmwire.world.motion.source import lockstep_sources
from swarmwire.world.placement.maps import Layout, read_layout
from swarmwire.world.placement.placement import Placement, place_arena
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.sensors.loading import sensor_of
from swarmwire.world.sensors.pipeline import SensorPipeline
from swarmwire.world.sensors.sensor import Scene, led_positions_m

_wrap_angle = njit()(wrap_angle)


@njit()
def snapshot(state: FloatArray, altitude_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return poses and velocities, (rows, 3) each, of a state (arenas, robots, 6); headings in (-pi, pi].

    The third array, (rows, 4), has the poses and then `altitude_m` (arenas, robots).
    """
    arenas, robots = state.shape[:2]
    pose, velocity = np.empty((arenas * robots, 3)), np.empty((arenas * robots, 3))
    radio_pose = np.empty((arenas * robots, 4))
    for arena in range(arenas):
        for i in range(robots):
            row, heading = arena * robots + i, _wrap_angle(state[arena, i, 2])
            pose[row, 0], pose[row, 1], pose[row, 2] = state[arena, i, 0], state[arena, i, 1], heading
            for column in range(3):
                velocity[row, column] = state[arena, i, 3 + column]
                radio_pose[row, column] = pose[row, column]
            radio_pose[row, 3] = altitude_m[arena, i]
    return pose, velocity, radio_pose


class World:
    """Arenas side by side, one per seed; robot row r is robot r % robots of arena r // robots.

    Each tick: `sense`, then `move`. The arrays below, except `alive`, `altitude_m` and `running`, are replaced in each
    tick and never written to after. The values of an arena that left (`leave`) have no meaning.

    Attributes:
        static: the constants of the run.
        keys: (arenas,) the key of each arena's draws, which depends on its seed alone.
        pose: (rows, 3) x, y in m, heading in rad in (-pi, pi], arena frame.
        velocity: (rows, 3) m/s, m/s, rad/s, arena frame.
        radio_pose: (rows, 4) `pose`, and the height of each robot's lower side and antenna above the floor in m.
        altitude_m: (arenas, robots) these heights, by default of the bodies; may be written to.
        movable: (arenas, movable obstacles, 3) x, y in m, heading in rad; None: there are none.
        actuators: motors and LEDs: commands and targets.
        alive: (rows,) written in place by `set_alive`; False in an arena that left.
        running: (arenas,) False for an arena that left; written in place by `leave`.
        rows_running: (rows,) `running` for each robot; replaced by `leave`.
        batteries: the batteries of all robots; `charge` may be written to.
        scene: the arenas for sensors, always the present.
        sensors: the sensors that agents need, by group and sense; `SensorPipeline.failed` may be set.
        states: the state of each robot that its agent named.
        values: the number of each robot that its agent noted.
    """

    def __init__(
        self, scenario: Scenario, seeds: Sequence[int], needs: Mapping[str, Sequence[str]], threads: int = 1
    ) -> None:
        """Make an arena per seed, with the sensors of each group in `needs` (entries `radio.…` are ignored).

        `threads` changes only the speed. BadInput if a body lacks a sense, or if an entity has no room.
        """
        if not seeds:
            raise BadInput(scenario.source, "seed", "expected at least one seed")
        bodies = bodies_of(scenario, scenario.source)
        groups = _groups(scenario, bodies)
        self.keys: KeyArray = np.array([derive_key("arena", seed) for seed in seeds], np.uint64)
        layout = read_layout(scenario.arena, scenario.source)
        self._followed = _followed_robots(scenario, groups, layout.size_m)
        starts_of = self._followed.start_poses() if self._followed else {}
        placements = [
            place_arena(scenario, layout, groups, seed, key, starts_of)
            for seed, key in zip(seeds, self.keys, strict=True)
        ]
        self.static = _static_of(scenario, groups, seeds, layout, placements)
        self.obstacles = obstacle_arrays(self.static.obstacles)
        engines, pose = engines_of(scenario, bodies), np.stack([placement.pose for placement in placements])
        self._physics = Physics(self.static, self.obstacles, engines, pose, scenario.physics.steps)
        altitudes_m = [np.full(group.stop - group.start, group.body.altitude_m) for group in groups]
        self.altitude_m: FloatArray = np.tile(np.concatenate(altitudes_m), (self.static.arenas, 1))
        self.actuators = Actuators(groups, self.keys)
        tick_s = 1.0 / scenario.time.rate_hz
        self.batteries = Batteries(groups, self.static.arenas, tick_s)
        self.alive: BoolArray = np.ones(self.static.arenas * self.static.robots, np.bool_)
        self.running: BoolArray = np.ones(self.static.arenas, np.bool_)
        self.rows_running: BoolArray = np.ones_like(self.alive)
        self.scene = self._scene_of(tick_s, Threads(threads))
        self.sensors = _sensors(scenario, self.scene, groups, needs)
        self._custom_actuators = CustomActuators(groups, self.scene)
        starts = np.arange(self.static.arenas)[:, None] * self.static.robots
        self._rows = {group.name: (starts + np.arange(group.start, group.stop)).ravel() for group in groups}
        self.states = States(self.static.arenas, self.static.robots)
        self.values = LatestValues()
        self._update_poses()

    @property
    def engines(self) -> tuple[str, ...]:
        """The names of the engines that move the robots."""
        return self._physics.names

    def set_alive(self, alive: BoolArray) -> None:
        """Make these robots (rows,) alive and all others dead: the dead brake, and resist all pushes.

        A revived robot has no annotations, and a full battery if its battery was empty.
        """
        alive = alive & self.rows_running
        revived = alive & ~self.alive
        self.states.clear(revived)
        self.values.clear(revived)
        self.batteries.renew(revived)
        self.alive[:] = alive
        self.actuators.stop(~alive)
        self._brake()

    def leave(self, over: BoolArray) -> None:
        """Stop the arenas `over` (arenas,): no robot in them senses, acts, moves or is alive from now on."""
        self.running &= ~over
        self.rows_running = np.repeat(self.running, self.static.robots)
        self._physics.leave(over)
        self.set_alive(self.alive)

    def set_failed(self, failed: Mapping[str, BoolArray]) -> None:
        """Set the robots (rows,) whose parts do not work, by the part's name (motors, wheels, sensors); others work."""
        self.actuators.set_failed(failed)
        self._brake()
        shape = self.static.arenas, self.static.robots
        for group in self.static.groups:
            for name, sensor in self.sensors[group.name].items():
                mask = failed[name].reshape(shape)[:, group.start : group.stop] if name in failed else None
                sensor.failed = mask if mask is not None and mask.any() else None

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots at once, (rows, 2) in m/s, but not in arenas that left."""
        by_mps = np.where(self.rows_running[:, None], by_mps, 0.0)
        self._physics.apply_impulse(by_mps.reshape(self.static.arenas, self.static.robots, 2))
        self._update_poses()

    def _brake(self) -> None:
        """Brake robots that are dead, or whose motors failed: their motors only resist."""
        dead = ~self.alive.reshape(self.static.arenas, self.static.robots)
        self._physics.braked[:] = dead | self.actuators.failed.motors

    def set_first_poses(self, poses: SparseTable) -> None:
        """Place robots of live sources before the first tick, at their first poses in slots x, y, z, heading."""
        if self._followed and len(poses):
            self._physics.set_states(self._followed.first_states(self._physics.state, poses))
            self._update_poses()

    def sense(self, tick: int) -> Readings:
        """Return the readings of the robots that are alive and act in a tick, by group, with rising rows."""
        readings: Readings = {}
        all_alive = bool(self.alive.all())
        for group in self.static.groups:
            sensors = self.sensors[group.name].values()
            if tick % group.act_every_ticks:
                for sensor in sensors:
                    sensor.follow(tick)
                continue
            rows, fields = self._rows[group.name], dict[str, FloatArray]()
            for sensor in sensors:
                fields.update(sensor.read(tick))
            ages = {sensor.name: age for sensor in sensors if (age := sensor.age(tick)) != 0}
            if not all_alive:
                alive = self.alive[rows]
                rows, fields = rows[alive], {name: values[alive] for name, values in fields.items()}
            readings[group.name] = GroupReadings(rows, fields, ages)
        return readings

    def move(self, actions: Actions) -> IntArray:
        """Move by one tick. Robots without a new command keep the last one; commands that are not finite are ignored.

        Returns:
            (arenas, 2) contacts that began: robot with robot, robot with wall or obstacle.
        """
        self.actuators.apply(actions, self.alive)
        self.states.update(actions.notes, self.alive)
        self.values.update(actions.values, self.alive)
        if self._custom_actuators.any:
            self._custom_actuators.act(actions.actuators, self.alive)
            self.actuators.leds.publish()
        if self.batteries.any:
            self.batteries.drain(self.alive, self.actuators.leds.rgb, self.actuators.target, self.actuators.motors_off)
        if self._followed:
            self._physics.follow(self._followed.end_states(self._physics.state, actions.poses))
        onsets = self._physics.tick(self.actuators.target)
        self._update_poses()
        return onsets

    @property
    def command(self) -> FloatArray:
        """Commands within the drives' limits, (rows, 3): forward m/s, left turn rad/s, to the left m/s."""
        return self.actuators.command

    def counts(self) -> dict[str, IntArray]:
        """Return the number of commands that actuators could not follow, and of states over the limit.

        By name, (arenas,) each.
        """
        return {
            **self.actuators.counts(),
            "actuators_not_there": self._custom_actuators.missing,
            "states_over_limit": self.states.dropped,
        }

    def _update_poses(self) -> None:
        if self._followed:
            index, altitude_m = self._followed.index, self._followed.altitude_m
            self.altitude_m[:, index] = altitude_m
            self.scene.top_m[index] += altitude_m - self.scene.bottom_m[index]
            self.scene.bottom_m[index] = altitude_m
        self.pose, self.velocity, self.radio_pose = snapshot(self._physics.state, self.altitude_m)
        self.movable: FloatArray | None = self._physics.movable.copy() if self.static.movable else None

    def _scene_of(self, tick_s: float, threads: Threads) -> Scene:
        static, physics = self.static, self._physics
        counts = [group.stop - group.start for group in static.groups]
        radius_m = np.repeat([group.body.radius_m for group in static.groups], counts)
        bottom_m = np.repeat([group.body.altitude_m for group in static.groups], counts)
        height_m = np.repeat([group.body.height_m for group in static.groups], counts)
        return Scene(
            keys=self.keys,
            size_m=static.arena_size_m,
            boundary=static.boundary,
            obstacles=self.obstacles,
            obstacles_move=static.movable > 0,
            threads=threads,
            lights=static.lights,
            ground=ground_of(static.floor, static.arena_size_m, static.boundary),
            tick_s=tick_s,
            radius_m=radius_m,
            bottom_m=bottom_m,
            top_m=bottom_m + height_m,
            state=physics.state,
            travel_m=physics.travel_m,
            touched=physics.touched,
            target=self.actuators.target,
            alive=self.alive.reshape(static.arenas, static.robots),  # the same memory
            running=self.running,
            charge=self.batteries.charge,
            leds=self.actuators.leds.rgb,
            led_positions_m=led_positions_m(static.groups, self.actuators.leds.rgb.shape[2]),
        )


def _groups(scenario: Scenario, bodies: Mapping[str, Body]) -> tuple[Group, ...]:
    groups: list[Group] = []
    start = 0
    for name, table in scenario.robots.items():
        followed = table.motion is not None
        groups.append(Group(name, bodies[name], start, start + table.count, table.act_every_ticks, followed))
        start += table.count
    return tuple(groups)


def _followed_robots(
    scenario: Scenario, groups: tuple[Group, ...], size_m: tuple[float, float]
) -> FollowedRobots | None:
    """Return the robots that sources move; None if all robots move by themselves."""
    if not any(group.followed for group in groups):
        return None
    return FollowedRobots(groups, lockstep_sources(scenario, size_m), scenario.time.rate_hz)


def _static_of(
    scenario: Scenario, groups: tuple[Group, ...], seeds: Sequence[int], layout: Layout, placements: Sequence[Placement]
) -> Static:
    return Static(
        name=scenario.name,
        seeds=tuple(seeds),
        rate_hz=scenario.time.rate_hz,
        arena_size_m=layout.size_m,
        boundary=scenario.arena.boundary,
        obstacles=tuple(placement.obstacles for placement in placements),
        groups=groups,
        robot_names=scenario.robot_names(),
        range_m=range_of(scenario.radio) if scenario.radio else None,
        lights=tuple(placement.lights for placement in placements),
        floor=layout.floor,
    )


def _sensors(
    scenario: Scenario, scene: Scene, groups: Sequence[Group], needs: Mapping[str, Sequence[str]]
) -> dict[str, dict[str, SensorPipeline]]:
    """Return the sensors of each group that its agents need, by group and sense."""
    sensors: dict[str, dict[str, SensorPipeline]] = {group.name: {} for group in groups}
    for group in groups:
        for need in needs.get(group.name, ()):
            if need.startswith("radio.") or need in sensors[group.name]:
                continue
            if need not in group.body.sensors:
                existing = ", ".join(group.body.sensors) or "none"
                expected = f"the agent needs the sense {need!r}; the body {group.body.name} has {existing}"
                raise BadInput(scenario.source, f"robots.{group.name}.agent", expected)
            spec = group.body.sensors[need]
            truth = sensor_of(need, spec, scene, group)
            sensors[group.name][need] = SensorPipeline(
                need, truth, spec, scene.keys, group, scene.tick_s, scene.running
            )
    return sensors
