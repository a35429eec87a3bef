"""Rigid bodies of any shape: one pymunk space per arena, all of them stepped together. The reference.

A space has its own coordinates, so an arena moves bit for bit alike alone and beside others. What is chosen here:

- `SLOP_M`: bodies at rest overlap by this much, so that contacts persist. Pymunk's default of 0.1 length units is more
  than an e-puck's radius.
- `ITERATIONS` of the contact solver as in ARGoS, whose engine is the same library.
- `FRICTION` 0.7 on everything (the coefficient of a contact is the product of both sides'), no bounce.
- Walls are as thick as two of the widest robots, so that no crowd is pushed through them.
- The spatial hash has cells of the widest robot's size: half the time of the default tree for 10,000 robots.
"""

from typing import Any, ClassVar

import numpy as np
import pymunk
from pymunk.batch import ArbiterFields, BodyFields, Buffer, get_space_arbiters, get_space_bodies, set_space_bodies

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.truth import Obstacle
from swarmwire.world.contacts import count_began, mark, pairs_of
from swarmwire.world.drive import push
from swarmwire.world.engines.engine import Setting

SLOP_M = 1e-4
ITERATIONS = 10
FRICTION = 0.7

READ = BodyFields.POSITION | BodyFields.ANGLE | BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
WRITE = BodyFields.FORCE | BodyFields.TORQUE
CONTACT = ArbiterFields.BODY_A_ID | ArbiterFields.BODY_B_ID


class PymunkEngine:
    """The bodies of all arenas as pymunk's; see `Engine`."""

    name: ClassVar[str] = "pymunk"

    def __init__(self, setting: Setting, pose: FloatArray) -> None:
        """Bodies at rest at `pose` (arenas, n, 3)."""
        arenas, robots = pose.shape[:2]
        self._motors, self._steps, self._step_s = setting.motors, setting.steps, setting.tick_s / setting.steps
        self.state = np.zeros((arenas, robots, 6))
        self.travel_m = np.zeros((arenas, robots, 2))
        self.touched = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._unhindered = np.zeros((arenas, robots))
        self._force = np.zeros((arenas, robots + 1, 3))
        self._spaces = [_ArenaSpace(setting, arena, pose[arena], self._force[arena]) for arena in range(arenas)]
        self._read()

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, n, 3), and count the contacts that began, (arenas, 2)."""
        for _ in range(self._steps):
            # A turn that contacts gave to a robot that is braked is slowed down, but not made up for.
            np.copyto(self._unhindered, self.state[:, :, 5], where=self.braked)
            push(self._motors, target, self.state, self._step_s, self._force, self.travel_m, self._unhindered)
            for space in self._spaces:
                space.step(self._step_s)
            self._read()
        onsets = np.zeros((len(self._spaces), 2), np.int64)
        for arena, space in enumerate(self._spaces):
            space.count_onsets(onsets[arena : arena + 1], self.touched[arena : arena + 1])
        return onsets

    def _read(self) -> None:
        for space, state in zip(self._spaces, self.state, strict=True):
            space.read(state)


def _walls(size_m: tuple[float, float], widest_m: float) -> tuple[Obstacle, ...]:
    """Four boxes around an arena; the ones across x cover the corners."""
    (width, height), thick = size_m, 4.0 * widest_m
    x, y = 0.5 * (width + thick), 0.5 * (height + thick)
    across = [Obstacle("box", at, 0.0, size_m=(thick, height + 2.0 * thick)) for at in (-x, x)]
    return (*across, *(Obstacle("box", 0.0, at, size_m=(width, thick)) for at in (-y, y)))


class _ArenaSpace:
    """The pymunk space of one arena and the buffers through which all its bodies are read and written at once."""

    def __init__(self, setting: Setting, arena: int, pose: FloatArray, force: FloatArray) -> None:
        self._space = pymunk.Space()
        self._space.collision_slop = SLOP_M
        self._space.iterations = ITERATIONS
        self._space.collision_persistence = setting.steps  # pymunk lists a pair that long: all that touched in the tick
        widest_m = float(setting.radius_m.max())
        self._space.use_spatial_hash(2.0 * widest_m, 2 * len(pose))
        robots = [self._add_robot(*of) for of in zip(setting.motors.mass_kg, setting.radius_m, pose, strict=True)]
        walls = _walls(setting.size_m, widest_m) if setting.boundary == "walls" else ()
        for obstacle in (*walls, *setting.standing[arena]):
            self._add_obstacle(obstacle)
        ids = [*(robot.id for robot in robots), self._space.static_body.id]
        self._bodies, self._contacts, self._forces = Buffer(), Buffer(), Buffer()
        # Only a buffer that is written from may lie in numpy's memory: pymunk reallocates one that it fills.
        self._forces.set_float_buf(force)
        self._check_order(ids)
        self._index = np.argsort(np.array(ids, np.uintp))
        self._ids = np.array(ids, np.uintp)[self._index]
        self._touching = np.empty(0, np.int64)

    def _add_robot(self, mass_kg: float, radius_m: float, pose: FloatArray) -> pymunk.Body:
        mass, radius = float(mass_kg), float(radius_m)
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
        """Add the contacts that began in the tick that ends to (1, 2): robot with robot, robot with something fixed.

        Sets `touched` (1, robots): 1 for those that touched anything in that tick, else 0.
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
