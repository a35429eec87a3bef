"""The pymunk space of one arena.

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
from pymunk.constraints import PivotJoint

from swarmwire.comms.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.truth import Obstacle
from swarmwire.world.engines.contacts import count_began, mark, pairs_of
from swarmwire.world.engines.engine import Setting
from swarmwire.world.engines.movable import FLOOR_FRICTION, GRAVITY_MPS2, Load

SLOP_M = 1e-4
ITERATIONS = 10
FRICTION = 0.7

READ = BodyFields.POSITION | BodyFields.ANGLE | BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
WRITE = BodyFields.FORCE | BodyFields.TORQUE
CONTACT = ArbiterFields.BODY_A_ID | ArbiterFields.BODY_B_ID


def _walls(size_m: tuple[float, float], widest_m: float) -> tuple[Obstacle, ...]:
    """Four boxes around an arena; the ones across x cover the corners."""
    (width, height), thick = size_m, 4.0 * widest_m
    x, y = 0.5 * (width + thick), 0.5 * (height + thick)
    across = [Obstacle("box", at, 0.0, size_m=(thick, height + 2.0 * thick)) for at in (-x, x)]
    return (*across, *(Obstacle("box", 0.0, at, size_m=(width, thick)) for at in (-y, y)))


class ArenaSpace:
    """The pymunk space of one arena and the buffers through which all its bodies are read and written at once.

    Robots start at `pose` (n, 3). `force`, in N, N, N m, is read in every step from where it lies: a row per robot,
    then per load, and one for all that stands still.
    """

    def __init__(
        self,
        setting: Setting,
        obstacles: tuple[Obstacle, ...],
        loads: Sequence[Load],
        pose: FloatArray,
        force: FloatArray,
    ) -> None:
        self._space = pymunk.Space()
        self._space.collision_slop = SLOP_M
        self._space.iterations = ITERATIONS
        self._space.collision_persistence = setting.steps  # pymunk lists a pair that long: all that touched in the tick
        widest_m = float(setting.radius_m.max())
        self._space.use_spatial_hash(2.0 * widest_m, 2 * len(pose))
        robots = [self._add_robot(*of) for of in zip(setting.motors.mass_kg, setting.radius_m, pose, strict=True)]
        walls = _walls(setting.size_m, widest_m) if setting.boundary == "walls" else ()
        for obstacle in (*walls, *obstacles):
            if not obstacle.movable:
                self._add_obstacle(obstacle)
        ids = [*(body.id for body in (*robots, *map(self._add_load, loads))), self._space.static_body.id]
        self._bodies, self._contacts, self._forces = Buffer(), Buffer(), Buffer()
        # Only a buffer that is written from may lie in numpy's memory: pymunk reallocates one that it fills.
        self._forces.set_float_buf(force)
        self._check_order(ids)
        self._robots, self._pushed = len(robots), robots
        order = np.argsort(np.array(ids, np.uintp))
        self._ids = np.array(ids, np.uintp)[order]
        self._index = np.minimum(order, self._robots)  # all obstacles and walls count as one body
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

    def _add_load(self, load: Load) -> pymunk.Body:
        """A movable obstacle on four feet, which joints of bounded strength hold on the floor: friction in the solver.

        With all of them at the mean distance of its area, sliding, turning and both together cost what they should.
        """
        corners = [(x, y) for x, y in load.corners_m.tolist()]
        if load.radius_m:
            body = pymunk.Body(load.mass_kg, pymunk.moment_for_circle(load.mass_kg, 0.0, load.radius_m))
            shape: pymunk.Shape = pymunk.Circle(body, load.radius_m)
        else:
            body = pymunk.Body(load.mass_kg, pymunk.moment_for_poly(load.mass_kg, corners))
            shape = pymunk.Poly(body, corners)
        body.position, body.angle = (load.x_m, load.y_m), load.heading_rad
        shape.friction = FRICTION
        self._space.add(body, shape)
        reach_m = load.reach_m
        for foot in ((reach_m, 0.0), (0.0, reach_m), (-reach_m, 0.0), (0.0, -reach_m)):
            grip = PivotJoint(self._space.static_body, body, (0.0, 0.0), foot)
            grip.max_bias = 0.0  # it holds on to no place
            grip.max_force = 0.25 * FLOOR_FRICTION * load.mass_kg * GRAVITY_MPS2
            self._space.add(grip)
        return body

    def _check_order(self, ids: list[int]) -> None:
        """Rows are robots, then movable obstacles, in the order in which they were added, and the static body last."""
        get_space_bodies(self._space, BodyFields.BODY_ID, self._bodies)
        assert _ids_in(self._bodies).tolist() == ids, "pymunk lists bodies in another order"

    def read(self, state: FloatArray, loads: FloatArray) -> None:
        """Copy what READ names of all robots and movable obstacles into (robots, 6) and (obstacles, 6)."""
        self._bodies.clear()
        get_space_bodies(self._space, READ, self._bodies)
        rows = _numbers_in(self._bodies).reshape(-1, 6)
        state[:] = rows[: self._robots]
        if len(loads):
            loads[:] = rows[self._robots : -1]

    def push(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots, (robots, 2) in m/s."""
        for row in np.flatnonzero(by_mps.any(axis=1)).tolist():
            body, (x_mps, y_mps) = self._pushed[row], by_mps[row].tolist()
            body.velocity = body.velocity.x + x_mps, body.velocity.y + y_mps

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
        count_began(self._touching, before, self._robots + 1, onsets)
        mark(self._touching, touched)


def _numbers_in(buffer: Any) -> FloatArray:
    """The numbers that pymunk put into a buffer, until it is used again."""
    return np.frombuffer(buffer.float_buf())


def _ids_in(buffer: Any) -> AnyArray:
    """The ids that pymunk put into a buffer, until it is used again."""
    return np.frombuffer(buffer.int_buf(), np.uintp)
