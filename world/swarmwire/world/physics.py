"""Rigid bodies in the plane: one pymunk space per arena, all of them stepped together.

A space has its own coordinates, so an arena moves bit for bit alike alone and beside others. What is chosen here:

- `SLOP_M`: bodies at rest overlap by this much, so that contacts persist. Pymunk's default of 0.1 length units is more
  than an e-puck's radius.
- `ITERATIONS` of the contact solver as in ARGoS, whose engine is the same library.
- `FRICTION` 0.7 on everything (the coefficient of a contact is the product of both sides'), no bounce.
- Walls are as thick as two of the widest robots, so that no crowd is pushed through them.
- The spatial hash has cells of the widest robot's size: half the time of the default tree for 10,000 robots.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pymunk
from pymunk.batch import ArbiterFields, BodyFields, Buffer, get_space_arbiters, get_space_bodies, set_space_bodies

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.drives import Drive, Holonomic
from swarmwire.comms.truth import Group, Obstacle
from swarmwire.world.contacts import count_began, mark, pairs_of
from swarmwire.world.drive import Motors, push

SLOP_M = 1e-4
ITERATIONS = 10
FRICTION = 0.7

READ = BodyFields.POSITION | BodyFields.ANGLE | BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
WRITE = BodyFields.FORCE | BodyFields.TORQUE
CONTACT = ArbiterFields.BODY_A_ID | ArbiterFields.BODY_B_ID


class Physics:
    """The bodies of all arenas.

    `state` is (arenas, robots, 6): x, y in m, heading in rad (not wrapped), velocity in m/s, m/s, rad/s, arena frame.
    `travel_m` is (arenas, robots, 2): how far the left and right wheel have rolled since the start.
    `touched` is (arenas, robots): 1 for a robot that touched anything in the last tick, else 0.
    `braked` is (arenas, robots): motors that only resist, if their commands are 0; set from outside.
    """

    def __init__(
        self,
        size_m: tuple[float, float],
        walled: bool,
        obstacles: Sequence[tuple[Obstacle, ...]],
        groups: Sequence[Group],
        pose: FloatArray,
        tick_s: float,
        steps: int,
    ) -> None:
        """Bodies at rest at `pose` (arenas, robots, 3), to be moved by `steps` steps in each tick of `tick_s`."""
        arenas, robots = pose.shape[:2]
        self.motors = motors_of(groups)
        self._steps, self._step_s = steps, tick_s / steps
        self.state = np.zeros((arenas, robots, 6))
        self.travel_m = np.zeros((arenas, robots, 2))
        self.touched = np.zeros((arenas, robots))
        self._unhindered = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._force = np.zeros((arenas, robots + 1, 3))
        walls = _walls(size_m, groups) if walled else ()
        self._spaces = [
            _ArenaSpace(groups, (*walls, *obstacles[arena]), pose[arena], self._force[arena], steps)
            for arena in range(arenas)
        ]
        self._read()

    def tick(self, command: FloatArray) -> IntArray:
        """Move by one tick under commands (arenas, robots, 3): forward m/s, left turn rad/s, to the left m/s.

        Returns:
            (arenas, 2) contacts that began: robot with robot, robot with wall or obstacle. A contact begins if a pair
            touches in this tick and did not in the one before; all that is fixed counts as one thing.
        """
        for _ in range(self._steps):
            # A turn that contacts gave to a robot that is braked is slowed down, but not made up for.
            np.copyto(self._unhindered, self.state[:, :, 5], where=self.braked)
            push(self.motors, command, self.state, self._step_s, self._force, self.travel_m, self._unhindered)
            for space in self._spaces:
                space.step(self._step_s)
            self._read()
        onsets = np.zeros((len(self._spaces), 2), np.int64)
        for arena, space in enumerate(self._spaces):
            space.count_onsets(onsets[arena], self.touched[arena])
        return onsets

    def _read(self) -> None:
        for space, state in zip(self._spaces, self.state, strict=True):
            space.read(state)


def motors_of(groups: Sequence[Group]) -> Motors:
    """The motors of each robot index of an arena; a body's mass is spread evenly over its disc."""
    drives = [
        (base_m(d), d.max_force_n, d.max_torque_nm, b.mass_kg, 0.5 * b.mass_kg * b.radius_m**2)
        for b, d in ((group.body, group.body.drive) for group in groups)
    ]
    columns = np.repeat(np.array(drives), [group.stop - group.start for group in groups], axis=0).T
    return Motors(*(np.ascontiguousarray(column) for column in columns))


def base_m(drive: Drive) -> float:
    """The distance between the wheels; 0 without any."""
    return 0.0 if isinstance(drive, Holonomic) else drive.wheel_base_m


def _walls(size_m: tuple[float, float], groups: Sequence[Group]) -> tuple[Obstacle, ...]:
    """Four boxes around an arena; the ones across x cover the corners."""
    (width, height), thick = size_m, 4.0 * max(group.body.radius_m for group in groups)
    x, y = 0.5 * (width + thick), 0.5 * (height + thick)
    across = [Obstacle("box", at, 0.0, size_m=(thick, height + 2.0 * thick)) for at in (-x, x)]
    return (*across, *(Obstacle("box", 0.0, at, size_m=(width, thick)) for at in (-y, y)))


class _ArenaSpace:
    """The pymunk space of one arena and the buffers through which all its bodies are read and written at once."""

    def __init__(
        self,
        groups: Sequence[Group],
        obstacles: tuple[Obstacle, ...],
        pose: FloatArray,
        force: FloatArray,
        steps: int,
    ) -> None:
        self._space = pymunk.Space()
        self._space.collision_slop = SLOP_M
        self._space.iterations = ITERATIONS
        self._space.collision_persistence = steps  # pymunk lists a pair that long: all that touched within the tick
        self._space.use_spatial_hash(2.0 * max(group.body.radius_m for group in groups), 2 * len(pose))
        robots = [self._add_robot(group, pose[i]) for group in groups for i in range(group.start, group.stop)]
        for obstacle in obstacles:
            self._add_obstacle(obstacle)
        ids = [*(robot.id for robot in robots), self._space.static_body.id]
        self._bodies, self._contacts, self._forces = Buffer(), Buffer(), Buffer()
        # Only a buffer that is written from may lie in numpy's memory: pymunk reallocates one that it fills.
        self._forces.set_float_buf(force)
        self._check_order(ids)
        self._index = np.argsort(np.array(ids, np.uintp))
        self._ids = np.array(ids, np.uintp)[self._index]
        self._touching = np.empty(0, np.int64)

    def _add_robot(self, group: Group, pose: FloatArray) -> pymunk.Body:
        mass, radius = group.body.mass_kg, group.body.radius_m
        body = pymunk.Body(mass, 0.5 * mass * radius**2)
        body.position, body.angle = (float(pose[0]), float(pose[1])), float(pose[2])
        disc = pymunk.Circle(body, radius)
        disc.friction = FRICTION
        self._space.add(body, disc)
        return body

    def _add_obstacle(self, obstacle: Obstacle) -> None:
        static = self._space.static_body
        shape: pymunk.Shape
        if obstacle.shape == "cylinder":
            shape = pymunk.Circle(static, obstacle.radius_m, (obstacle.x_m, obstacle.y_m))
        else:
            shape = pymunk.Poly(static, [(x, y) for x, y in obstacle.corners_m.tolist()])
        shape.friction = FRICTION
        self._space.add(shape)

    def _check_order(self, ids: list[int]) -> None:
        """Rows are the robots in the order in which they were added, and the static body last."""
        get_space_bodies(self._space, BodyFields.BODY_ID, self._bodies)
        assert _ids_in(self._bodies).tolist() == ids, "pymunk lists bodies in another order"

    def read(self, state: FloatArray) -> None:
        """Copy what READ names of all robots into (robots, 6)."""
        self._bodies.clear()
        get_space_bodies(self._space, READ, self._bodies)
        state[:] = _numbers_in(self._bodies).reshape(-1, 6)[:-1]

    def step(self, step_s: float) -> None:
        """Hand over the forces and move by one physics step."""
        set_space_bodies(self._space, WRITE, self._forces)
        self._space.step(step_s)

    def count_onsets(self, onsets: IntArray, touched: FloatArray) -> None:
        """Add the contacts that began in the tick that ends to (2,): robot with robot, robot with something fixed.

        Sets `touched` (robots,): 1 for those that touched anything in that tick, else 0.
        """
        self._contacts.clear()
        get_space_arbiters(self._space, CONTACT, self._contacts)
        contacts = _ids_in(self._contacts).reshape(-1, 2)
        before, self._touching = self._touching, pairs_of(contacts, self._ids, self._index)
        count_began(self._touching, before, len(self._ids), onsets)
        mark(self._touching, touched)


def _numbers_in(buffer: Any) -> FloatArray:
    """The numbers that pymunk put into a buffer, until it is used again."""
    return np.frombuffer(buffer.float_buf())


def _ids_in(buffer: Any) -> AnyArray:
    """The ids that pymunk put into a buffer, until it is used again."""
    return np.frombuffer(buffer.int_buf(), np.uintp)
