"""The world: the bodies and sensors of every arena, tick by tick. It knows neither agents nor the radio.

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
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, Readings
from swarmwire.world.actuation.actuators import Actuators
from swarmwire.world.actuation.batteries import Batteries
from swarmwire.world.annotations import LatestValues, States
from swarmwire.world.custom.actuators import CustomActuators
from swarmwire.world.engines.physics import Physics, engines_of
from swarmwire.world.placement.maps import Layout, read_layout
from swarmwire.world.placement.placement import Placement, place_arena
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.sensors.loading import sensor_of
from swarmwire.world.sensors.pipeline import SensorPipeline
from swarmwire.world.sensors.sensor import Scene, led_positions_m

_wrap_angle = njit()(wrap_angle)


@njit()
def snapshot(state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Poses and velocities, (rows, 3) each, of a state (arenas, robots, 6); headings in (-pi, pi]."""
    arenas, robots = state.shape[:2]
    pose, velocity = np.empty((arenas * robots, 3)), np.empty((arenas * robots, 3))
    for arena in range(arenas):
        for i in range(robots):
            row, heading = arena * robots + i, _wrap_angle(state[arena, i, 2])
            pose[row, 0], pose[row, 1], pose[row, 2] = state[arena, i, 0], state[arena, i, 1], heading
            for column in range(3):
                velocity[row, column] = state[arena, i, 3 + column]
    return pose, velocity


class World:
    """Arenas side by side, one per seed; robot row r is robot r % robots of arena r // robots.

    Each tick: `sense`, then `move`. The arrays below but `alive` and `running` are replaced in each tick, never written
    to after. An arena may `leave`: what stays of it counts no more.

    Attributes:
        static: what does not change.
        keys: (arenas,) the key of each arena's draws, which depends on its seed alone.
        pose: (rows, 3) x, y in m, heading in rad in (-pi, pi], arena frame.
        velocity: (rows, 3) m/s, m/s, rad/s, arena frame.
        movable: (arenas, movable obstacles, 3) x, y in m, heading in rad; None: there are none.
        actuators: motors and LEDs: what they were asked for, and what they do.
        alive: (rows,); written in place, by `live`. In an arena that left, no robot is.
        running: (arenas,) those that have not left; written in place, by `leave`.
        rows_running: (rows,) the same for each robot; replaced by `leave`.
        batteries: of all robots; `charge` may be written to.
        scene: what sensors look at, always the present.
        sensors: those that agents need, by group and sense; `SensorPipeline.failed` may be set.
        states: what each robot is at, as its agent named it.
    """

    def __init__(
        self, scenario: Scenario, seeds: Sequence[int], needs: Mapping[str, Sequence[str]], threads: int = 1
    ) -> None:
        """An arena per seed; `needs` names, by group, the sensors to compute (`radio.…` is not the world's affair).

        `threads` change nothing but the speed.

        Raises BadInput if a body lacks a sense, or if something finds no room.
        """
        if not seeds:
            raise BadInput(scenario.source, "seed", "expected at least one seed")
        bodies = bodies_of(scenario, scenario.source)
        groups = _groups(scenario, bodies)
        self.keys: KeyArray = np.array([derive_key("arena", seed) for seed in seeds], np.uint64)
        layout = read_layout(scenario.arena, scenario.source)
        placements = [
            place_arena(scenario, layout, groups, seed, key) for seed, key in zip(seeds, self.keys, strict=True)
        ]
        self.static = _static_of(scenario, groups, seeds, layout, placements)
        self.obstacles = obstacle_arrays(self.static.obstacles)
        engines, pose = engines_of(scenario, bodies), np.stack([placement.pose for placement in placements])
        self._physics = Physics(self.static, self.obstacles, engines, pose, scenario.physics.steps)
        self.actuators = Actuators(groups, self.keys)
        tick_s = 1.0 / scenario.time.rate_hz
        self.batteries = Batteries(groups, self.static.arenas, tick_s)
        self.alive: BoolArray = np.ones(self.static.arenas * self.static.robots, np.bool_)
        self.running: BoolArray = np.ones(self.static.arenas, np.bool_)
        self.rows_running: BoolArray = np.ones_like(self.alive)
        self.scene = self._scene_of(tick_s, Threads(threads))
        self.sensors = _sensors(scenario, self.scene, groups, needs)
        self._own = CustomActuators(groups, self.scene)
        starts = np.arange(self.static.arenas)[:, None] * self.static.robots
        self._rows = {group.name: (starts + np.arange(group.start, group.stop)).ravel() for group in groups}
        self.states = States(self.static.arenas, self.static.robots)
        self.values = LatestValues()
        self._show()

    @property
    def engines(self) -> tuple[str, ...]:
        """The names of the engines that move the robots."""
        return self._physics.names

    def live(self, alive: BoolArray) -> None:
        """These robots (rows,) are alive from now on; the others brake, and resist all pushes."""
        alive = alive & self.rows_running
        revived = alive & ~self.alive  # they start afresh
        self.states.forget(revived)
        self.values.forget(revived)
        self.batteries.renew(revived)
        self.alive[:] = alive
        self.actuators.stop(~alive)
        self._brake()

    def leave(self, over: BoolArray) -> None:
        """No robot in these arenas (arenas,) senses, acts, moves or is alive from now on."""
        self.running &= ~over
        self.rows_running = np.repeat(self.running, self.static.robots)
        self._physics.leave(over)
        self.live(self.alive)

    def fail(self, failed: Mapping[str, BoolArray]) -> None:
        """From now on these parts of robots (rows,) do not work, by name: motors, wheels, sensors; all others do."""
        self.actuators.fail(failed)
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
        self._show()

    def _brake(self) -> None:
        """The motors of robots that are dead, or whose motors failed, do not drive: they only resist."""
        dead = ~self.alive.reshape(self.static.arenas, self.static.robots)
        self._physics.braked[:] = dead | self.actuators.failed.motors

    def sense(self, tick: int) -> Readings:
        """What the robots alive that act in a tick sense, by group: rows rising, and the fields that are needed."""
        readings: Readings = {}
        every_row_alive = bool(self.alive.all())
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
            if not every_row_alive:
                here = self.alive[rows]
                rows, fields = rows[here], {name: values[here] for name, values in fields.items()}
            readings[group.name] = GroupReadings(rows, fields, ages)
        return readings

    def move(self, actions: Actions) -> IntArray:
        """Move by one tick. Robots without a new command keep the last one; one that is not finite is none.

        Returns:
            (arenas, 2) contacts that began: robot with robot, robot with wall or obstacle.
        """
        self.actuators.take(actions, self.alive)
        self.states.take(actions.notes, self.alive)
        self.values.take(actions.values, self.alive)
        if self._own.any:
            self._own.act(actions.actuators, self.alive)
            self.actuators.leds.tell()
        if self.batteries.any:
            self.batteries.drain(self.alive, self.actuators.leds.rgb, self.actuators.target, self.actuators.motors_off)
        onsets = self._physics.tick(self.actuators.target)
        self._show()
        return onsets

    @property
    def command(self) -> FloatArray:
        """Commands within the drives' limits, (rows, 3): forward m/s, left turn rad/s, to the left m/s."""
        return self.actuators.command

    def counts(self) -> dict[str, IntArray]:
        """What actuators could not follow since the start, and states too many: by name, (arenas,) each."""
        own, states = {"actuators_not_there": self._own.not_there}, {"states_over_limit": self.states.dropped}
        return {**self.actuators.counts(), **own, **states}

    def _show(self) -> None:
        self.pose, self.velocity = snapshot(self._physics.state)
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
        groups.append(Group(name, bodies[name], start, start + table.count, table.act_every_ticks))
        start += table.count
    return tuple(groups)


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
    """The sensors of each group that its agents need, by group and sense."""
    made: dict[str, dict[str, SensorPipeline]] = {group.name: {} for group in groups}
    for group in groups:
        for need in needs.get(group.name, ()):
            if need.startswith("radio.") or need in made[group.name]:
                continue
            if need not in group.body.sensors:
                has = ", ".join(group.body.sensors) or "none"
                expected = f"the agent needs the sense {need!r}; the body {group.body.name} has {has}"
                raise BadInput(scenario.source, f"robots.{group.name}.agent", expected)
            spec = group.body.sensors[need]
            truth = sensor_of(need, spec, scene, group)
            made[group.name][need] = SensorPipeline(need, truth, spec, scene.keys, group, scene.tick_s, scene.running)
    return made
