"""The pymunk engine, the reference: rigid bodies of any shape, one space per arena, all of them stepped together.

`set_forces` (compiled) sets the force of the motors on each robot. `ArenaSpace` wraps the pymunk space of one arena.

Drives act by bounded force. Velocities are never written: a motor pushes until its robot has the target speed or its
force is spent, so contacts have the last word. Along and across the body the wheels share one grip (a friction circle
of `max_force_n`, as ARGoS bounds the length of its pivot's impulse), and turning has its own bound, `max_torque_nm`. A
holonomic drive differs only in that its target may have a speed across the body.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import pymunk
from pymunk.batch import ArbiterFields, BodyFields, Buffer, get_space_arbiters, get_space_bodies, set_space_bodies
from pymunk.constraints import PivotJoint

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.world.engines.contacts import count_began, mark, pairs_of
from swarmwire.world.engines.engine import EngineConfig, EngineMotors
from swarmwire.world.engines.movable import FLOOR_FRICTION, GRAVITY_MPS2, Load, Movables

# Parameters of a space:
#
# - `SLOP_M`: bodies at rest overlap by this much, so that contacts persist. Pymunk's default of 0.1 length units is
#   more than an e-puck's radius.
# - `ITERATIONS` of the contact solver are those of ARGoS, whose engine is the same library. Where the heaviest body is
#   more than 10 times heavier than the lightest, their number is that ratio, up to `MAX_ITERATIONS`: an iteration
#   removes about 1 / ratio of the speed of a heavy body that presses a light body against a wall.
# - `FRICTION` 0.7 on everything (the coefficient of a contact is the product of both sides'), no bounce.
# - Walls are as thick as two of the widest robots, so that no crowd is pushed through them.
# - The spatial hash has cells of the widest robot's size: half the time of the default tree for 10,000 robots.
SLOP_M = 1e-4
ITERATIONS, MAX_ITERATIONS = 10, 200
FRICTION = 0.7

READ = BodyFields.POSITION | BodyFields.ANGLE | BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
WRITE = BodyFields.FORCE | BodyFields.TORQUE
CONTACT = ArbiterFields.BODY_A_ID | ArbiterFields.BODY_B_ID


@njit()
def set_forces(
    motors: EngineMotors,
    target: FloatArray,
    state: FloatArray,
    dt_s: float,
    running: BoolArray,
    force: FloatArray,
    travel_m: FloatArray,
    unhindered: FloatArray,
) -> None:
    """Set the force on every robot for the next physics step, and add the travel of its wheels in that step.

    Pymunk moves a body by the velocity that it has before the step and then applies the force, so a force set now shows
    in the motion of the step after. There the body turns while it moves straight: the target velocity lies along the
    heading in the middle of that step, which makes the path a chord of the arc.

    This step compensates the change of the turn rate by contacts in the last step: a robot that is pushed off its
    centre keeps its heading as long as its torque lasts, while the motors alone would answer each push a step too late.
    The force has no such compensation: at the end of a contact it would throw the robot forward for a step.

    Args:
        motors: the motors of each robot index.
        target: (arenas, robots, 3) forward m/s, left turn rad/s, to the left m/s.
        state: (arenas, robots, 6) x, y in m, heading in rad, velocity in m/s, m/s, rad/s, arena frame.
        dt_s: length of a physics step.
        running: (arenas,) arenas to compute; the rows of others do not change.
        force: (arenas, robots or more, 3) set: N, N, N m, arena frame; rows beyond the robots do not change.
        travel_m: (arenas, robots, 2) left and right wheel, added to.
        unhindered: (arenas, robots) turn rate that the last torque would have given without contacts, set.
    """
    arenas, robots = state.shape[:2]
    for arena in range(arenas):
        if not running[arena]:
            continue
        for i in range(robots):
            heading, vx, vy, turn = state[arena, i, 2], state[arena, i, 3], state[arena, i, 4], state[arena, i, 5]
            middle = heading + 0.5 * dt_s * turn
            rolled = dt_s * (vx * math_compiled.cos(middle) + vy * math_compiled.sin(middle))
            turned = 0.5 * dt_s * turn * motors.wheel_base_m[i]
            travel_m[arena, i, 0] += rolled - turned
            travel_m[arena, i, 1] += rolled + turned

            bound = motors.max_torque_nm[i]
            inertia = motors.inertia_kgm2[i]
            lost_turn = unhindered[arena, i] - turn
            torque = min(max((target[arena, i, 1] - turn + lost_turn) * inertia / dt_s, -bound), bound)
            unhindered[arena, i] = turn + torque * dt_s / inertia
            next_heading = heading + dt_s * (turn + 0.5 * unhindered[arena, i])
            cos, sin, mass_per_step = (
                math_compiled.cos(next_heading),
                math_compiled.sin(next_heading),
                motors.mass_kg[i] / dt_s,
            )
            forward, left = target[arena, i, 0], target[arena, i, 2]
            fx, fy = (
                (forward * cos - left * sin - vx) * mass_per_step,
                (forward * sin + left * cos - vy) * mass_per_step,
            )
            size = np.sqrt(fx * fx + fy * fy)
            fraction = motors.max_force_n[i] / size if size > motors.max_force_n[i] else 1.0
            force[arena, i, 0], force[arena, i, 1], force[arena, i, 2] = fx * fraction, fy * fraction, torque


def _walls(size_m: tuple[float, float], widest_m: float) -> tuple[Obstacle, ...]:
    """Return four boxes around an arena; those at its left and right cover the corners."""
    (width, height), thick = size_m, 4.0 * widest_m
    x, y = 0.5 * (width + thick), 0.5 * (height + thick)
    left_right = [Obstacle("box", x_m, 0.0, size_m=(thick, height + 2.0 * thick)) for x_m in (-x, x)]
    return (*left_right, *(Obstacle("box", 0.0, y_m, size_m=(width, thick)) for y_m in (-y, y)))


class ArenaSpace:
    """The pymunk space of one arena, and the buffers through which all its bodies are read and written at once.

    A space has its own coordinates, so an arena moves bit for bit alike alone and beside others.

    Robots start at `pose` (n, 3). Every step reads `force`, in N, N, N m, from the array itself: a row per robot, a
    row per load, and a row for the static body.
    """

    def __init__(
        self,
        config: EngineConfig,
        obstacles: tuple[Obstacle, ...],
        loads: Sequence[Load],
        pose: FloatArray,
        force: FloatArray,
    ) -> None:
        self._space = pymunk.Space()
        self._space.collision_slop = SLOP_M
        masses_kg = [*config.motors.mass_kg[~config.followed].tolist(), *(load.mass_kg for load in loads)] or [1.0]
        self._space.iterations = min(max(ITERATIONS, round(max(masses_kg) / min(masses_kg))), MAX_ITERATIONS)
        self._space.collision_persistence = config.steps  # pymunk lists a pair for that many steps: a tick
        widest_m = float(config.radius_m.max())
        self._space.use_spatial_hash(2.0 * widest_m, 2 * len(pose))
        columns = config.motors.mass_kg, config.radius_m, pose, config.followed
        robots = [self._add_robot(*robot) for robot in zip(*columns, strict=True)]
        walls = _walls(config.size_m, widest_m) if config.boundary == "walls" else ()
        for obstacle in (*walls, *obstacles):
            if not obstacle.movable:
                self._add_obstacle(obstacle)
        ids = [*(body.id for body in (*robots, *map(self._add_load, loads))), self._space.static_body.id]
        self._bodies, self._contacts, self._forces = Buffer(), Buffer(), Buffer()
        # Only a buffer that pymunk reads may use numpy's memory: pymunk reallocates the buffers that it fills.
        self._forces.set_float_buf(force)
        self._check_order(ids)
        self._robots, self._robot_bodies = len(robots), robots
        order = np.argsort(np.array(ids, np.uintp))
        self._ids = np.array(ids, np.uintp)[order]
        self._index = np.minimum(order, self._robots)  # all obstacles and walls count as one body
        self._moves = np.concatenate((~config.followed, np.ones(len(loads), np.bool_), [False]))[order]
        self._touching = np.empty(0, np.int64)

    def _add_robot(self, mass_kg: float, radius_m: float, pose: FloatArray, followed: bool) -> pymunk.Body:
        mass, radius = float(mass_kg), float(radius_m)
        kind = pymunk.Body.KINEMATIC if followed else pymunk.Body.DYNAMIC  # nothing pushes a kinematic body
        body = pymunk.Body(mass, 0.5 * mass * radius**2, kind)
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
        """Add a movable obstacle on four feet, held on the floor by joints of bounded force: friction in the solver.

        All feet are at the mean distance of the area from its centre, so that sliding and turning meet the right
        friction, alone and together.
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
            joint = PivotJoint(self._space.static_body, body, (0.0, 0.0), foot)
            joint.max_bias = 0.0  # friction does not pull back
            joint.max_force = 0.25 * FLOOR_FRICTION * load.mass_kg * GRAVITY_MPS2
            self._space.add(joint)
        return body

    def _check_order(self, ids: list[int]) -> None:
        """Check the order of rows: robots, movable obstacles, both in the order of their addition, static body."""
        get_space_bodies(self._space, BodyFields.BODY_ID, self._bodies)
        assert _ids_in(self._bodies).tolist() == ids, "pymunk lists bodies in another order"

    def read(self, state: FloatArray, loads: FloatArray) -> None:
        """Copy the READ fields of all robots and movable obstacles into (robots, 6) and (obstacles, 6)."""
        self._bodies.clear()
        get_space_bodies(self._space, READ, self._bodies)
        rows = _numbers_in(self._bodies).reshape(-1, 6)
        state[:] = rows[: self._robots]
        if len(loads):
            loads[:] = rows[self._robots : -1]

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots, (robots, 2) in m/s."""
        for row in np.flatnonzero(by_mps.any(axis=1)).tolist():
            body, (x_mps, y_mps) = self._robot_bodies[row], by_mps[row].tolist()
            body.velocity = body.velocity.x + x_mps, body.velocity.y + y_mps

    def set_velocities(self, robots: IntArray, velocities: FloatArray) -> None:
        """Set the velocities of followed robots by index, (k, 3) in m/s, m/s, rad/s."""
        for robot, (x_mps, y_mps, turn_radps) in zip(robots.tolist(), velocities.tolist(), strict=True):
            body = self._robot_bodies[robot]
            body.velocity, body.angular_velocity = (x_mps, y_mps), turn_radps

    def set_poses(self, robots: IntArray, poses: FloatArray) -> None:
        """Set the poses of followed robots by index, (k, 3)."""
        for robot, (x_m, y_m, heading_rad) in zip(robots.tolist(), poses.tolist(), strict=True):
            body = self._robot_bodies[robot]
            body.position, body.angle = (x_m, y_m), heading_rad
            self._space.reindex_shapes_for_body(body)

    def step(self, step_s: float) -> None:
        """Write the forces and move by one physics step."""
        set_space_bodies(self._space, WRITE, self._forces)
        self._space.step(step_s)

    def count_onsets(self, onsets: IntArray, touched: FloatArray) -> None:
        """Add the contacts that began in this tick to `onsets` (1, 2): robot with robot, robot with something fixed.

        Sets `touched` (1, robots): 1 for robots that touched anything in this tick, else 0.
        """
        self._contacts.clear()
        get_space_arbiters(self._space, CONTACT, self._contacts)
        contacts = _ids_in(self._contacts).reshape(-1, 2)
        contacts = contacts[self._moves[np.searchsorted(self._ids, contacts)].any(axis=1)]
        before, self._touching = self._touching, pairs_of(contacts, self._ids, self._index)
        count_began(self._touching, before, self._robots + 1, onsets)
        mark(self._touching, touched)


def _numbers_in(buffer: Any) -> FloatArray:
    """Return the numbers in a buffer that pymunk filled, valid until its next use."""
    return np.frombuffer(buffer.float_buf())


def _ids_in(buffer: Any) -> AnyArray:
    """Return the ids in a buffer that pymunk filled, valid until its next use."""
    return np.frombuffer(buffer.int_buf(), np.uintp)


class PymunkEngine:
    """The bodies of all arenas in pymunk; see `Engine`."""

    name: ClassVar[str] = "pymunk"

    def __init__(self, config: EngineConfig, pose: FloatArray) -> None:
        """Make bodies at rest at `pose` (arenas, n, 3)."""
        arenas, robots = pose.shape[:2]
        self._motors, self._steps, self._step_s = config.motors, config.steps, config.tick_s / config.steps
        self.state = np.zeros((arenas, robots, 6))
        self.travel_m = np.zeros((arenas, robots, 2))
        self.touched = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._unhindered = np.zeros((arenas, robots))
        self._movables = Movables(config.initial_obstacles, config.obstacles)
        self.movable = self._movables.pose  # (arenas, movable obstacles, 3) for `Truth.movable`, written in place
        loads = self.movable.shape[1]
        self._load_state = np.zeros((arenas, loads, 6))
        self._force = np.zeros((arenas, robots + loads + 1, 3))
        self._spaces = [
            ArenaSpace(
                config, config.initial_obstacles[arena], self._movables.loads[arena], pose[arena], self._force[arena]
            )
            for arena in range(arenas)
        ]
        self._running: BoolArray = np.ones(arenas, np.bool_)
        self._moving = list(range(arenas))  # indices of the running arenas
        self._followed: IntArray = np.flatnonzero(config.followed)
        self._end: FloatArray | None = None  # states of the followed robots at the end of the tick
        self._read()

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, n, 3), and count the contacts that began, (arenas, 2)."""
        if self._end is not None:
            for arena in self._moving:
                self.state[arena, self._followed, 3:] = self._end[arena, :, 3:]
                self._spaces[arena].set_velocities(self._followed, self._end[arena, :, 3:])
        for _ in range(self._steps):
            # A turn of a braked robot by contacts is slowed down, but not compensated.
            np.copyto(self._unhindered, self.state[:, :, 5], where=self.braked)
            state, force, travel_m, unhindered = self.state, self._force, self.travel_m, self._unhindered
            set_forces(self._motors, target, state, self._step_s, self._running, force, travel_m, unhindered)
            for arena in self._moving:
                self._spaces[arena].step(self._step_s)
            self._read()
        if self._end is not None:
            for arena in self._moving:
                self._spaces[arena].set_poses(self._followed, self._end[arena, :, :3])
            self._read()
        if self.movable.size:
            self._movables.move(self._load_state)
        onsets = np.zeros((len(self._spaces), 2), np.int64)
        for arena in self._moving:
            self._spaces[arena].count_onsets(onsets[arena : arena + 1], self.touched[arena : arena + 1])
        return onsets

    def follow(self, end: FloatArray) -> None:
        """Set the states of the followed robots at the end of the next tick, (arenas, k, 6)."""
        self._end = end

    def set_states(self, states: FloatArray) -> None:
        """Set the states of the followed robots at once, (arenas, k, 6)."""
        for space, poses in zip(self._spaces, states[:, :, :3], strict=True):
            space.set_poses(self._followed, poses)
        self._read()

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots at once, (arenas, robots, 2) in m/s."""
        for arena in self._moving:
            self._spaces[arena].apply_impulse(by_mps[arena])
        self._read()

    def leave(self, over: BoolArray) -> None:
        """Stop the arenas `over` (arenas,): their spaces are not stepped any more."""
        self._running &= ~over
        self._moving = np.flatnonzero(self._running).tolist()

    def _read(self) -> None:
        for arena in self._moving:
            self._spaces[arena].read(self.state[arena], self._load_state[arena])
