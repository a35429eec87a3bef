"""Beacon avoidance: robots without rays keep clear of one another by what they hear over the radio."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.behaviours._common import check_above_zero, check_not_negative, check_order
from swarmwire.agent.fields import Vectors, along, hysteresis, low_pass, steered
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import BoolColumn, FloatColumn, IntColumn, Memory, VectorAgent, column
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.robot.messages import Message, f4

HEAD_ON_M = 1e-3  # so far to the left is who would be met head on: both then turn to the right
NONE = 1e-9  # least length of what is divided by
SLOTS = 8  # neighbours that a robot remembers
NO_ROBOT = -1  # sender in an empty slot


class Beacon(Message):
    """How a robot moves, broadcast in every step."""

    heading_rad: f4  # of its compass
    speed_mps: f4


class Remembered(Memory):
    """A robot's neighbours, (n, SLOTS); vectors lead from the robot along the axes of the compass.

    An empty slot has the sender NO_ROBOT, and is infinitely old.
    """

    sender: IntColumn = column(NO_ROBOT, width=SLOTS)
    sequence: IntColumn = column(NO_ROBOT, width=SLOTS)  # of the newest packet
    x_m: FloatColumn = column(0.0, width=SLOTS)
    y_m: FloatColumn = column(0.0, width=SLOTS)
    x_mps: FloatColumn = column(0.0, width=SLOTS)  # as its newest packet said
    y_mps: FloatColumn = column(0.0, width=SLOTS)
    age_s: FloatColumn = column(np.inf, width=SLOTS)  # of the newest packet


class Traffic(Remembered):
    """What a robot knows of the traffic around it, and where it was going."""

    course_rad: FloatColumn = column(np.nan)  # of its compass, as in its first step
    speed_mps: FloatColumn = column(0.0)  # as commanded in the last step
    push_x: FloatColumn = column(0.0)  # low-passed, along the axes of the compass
    push_y: FloatColumn = column(0.0)
    avoiding: BoolColumn = column(False)


class BeaconAvoidance(VectorAgent[Traffic]):
    """Straight motion that avoids neighbours on a collision course, by the radio alone.

    Each robot broadcasts its heading and speed in every step, and remembers for `memory_s` the 8 nearest neighbours
    that it received. Where one was when its packet went on air follows from range and bearing; where it is now from
    the time since, its beacon's velocity and the own motion.

    The robot keeps the direction of its first heading, at `speed_mps`. If it did, a neighbour at p,
    moving at w against it, would be nearest after t = -p.w / w.w (0 if that is past), at m = p + w t. It pushes away
    from m by

        strength max(1 - |m| / clear_m, 0) max(1 - t / horizon_s, 0)

    and, wherever it is going, away from p by close max(1 - |p| / close_m, 0). Pushes are added up and low-passed
    (`smooth_s`); they count from a sum of `alarm` on until it has fallen to `relaxed` (hysteresis). Who would be met
    head on is passed on the right. The robot turns towards its course plus the push, and drives the slower the more it
    has to turn.

    Our own rule, of the kind of Reynolds's unaligned collision avoidance (Steering Behaviors, 1999). No packet carries
    how long the medium had it: what `latency_s` does not name makes neighbours seem where they were.
    """

    needs: ClassVar[tuple[str, ...]] = ("compass", "radio.range", "radio.bearing")
    speed_mps: float = 0.1  # straight ahead
    clear_m: float = 0.4  # who would pass at this distance between centres, or farther, does not push
    horizon_s: float = 6.0  # who would be nearest only after so long does not push
    strength: float = 2.0  # weight of pushes from a meeting against the course
    close_m: float = 0.2  # who is at this distance between centres now, or farther, does not push for that
    close: float = 2.0  # weight of pushes from who is close now
    alarm: float = 0.2  # sum of pushes from which on the robot avoids
    relaxed: float = 0.05  # sum of pushes at which it takes up its course again
    smooth_s: float = 0.2  # time constant of the pushes' low-pass
    memory_s: float = 2.0  # a neighbour whose newest packet went on air longer ago is forgotten
    latency_s: float = 0.0  # known delay of packets between going on air and being received
    turn_gain_per_s: float = 2.5  # turn rate per angle to the wanted direction

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """What is divided by is above 0, and hysteresis has a gap."""
        check_above_zero(params, "speed_mps", "clear_m", "horizon_s", "close_m")
        check_not_negative(params, "smooth_s")
        check_order(cls, params, "relaxed", "alarm")

    def step(self, robots: Robots, memory: Traffic) -> None:
        """Remember who is where, steer clear, and broadcast heading and speed."""
        heading = robots.compass.heading_rad
        memory.course_rad = np.where(np.isnan(memory.course_rad), heading, memory.course_rad)
        own_mps = memory.speed_mps * along(heading)
        pass_time(memory, own_mps, robots.period_s)
        forget(memory, self.memory_s)
        self._listen(robots, memory, heading, own_mps)

        course = along(memory.course_rad)
        self._feel(self._push(memory, self.speed_mps * course), memory, robots.period_s)
        wanted = course + Vectors(memory.push_x, memory.push_y)
        memory.speed_mps, turn_radps = steered(wanted.turned(-heading), self.speed_mps, self.turn_gain_per_s)
        robots.drive(memory.speed_mps, turn_radps)
        robots.note("on course", ~memory.avoiding)
        robots.note("avoiding", memory.avoiding)
        robots.radio.send(Beacon, heading_rad=heading, speed_mps=memory.speed_mps)

    def _listen(self, robots: Robots, memory: Traffic, heading: FloatArray, own_mps: Vectors) -> None:
        """Take in the beacons, each moved on by its age."""
        received = robots.radio.received(Beacon)
        row = received.row
        age_s = robots.time_s - 1e-9 * received.received_at_ns.astype(np.float64) + self.latency_s
        mps = received.message.speed_mps * along(received.message.heading_rad)
        place = received.range_m * along(heading[row] + received.bearing_rad)
        place += age_s * (mps - Vectors(own_mps.x[row], own_mps.y[row]))
        remember(memory, row, received.sender, received.sequence, place, mps, age_s)

    def _push(self, memory: Traffic, course_mps: Vectors) -> Vectors:
        """The sum of pushes, along the axes of the compass."""
        x_mps, y_mps = memory.x_mps - course_mps.x[:, None], memory.y_mps - course_mps.y[:, None]
        closing = np.maximum(-(memory.x_m * x_mps + memory.y_m * y_mps), 0.0)
        after_s = closing / np.maximum(x_mps**2 + y_mps**2, NONE)
        aside_m = HEAD_ON_M / self.speed_mps * course_mps
        x_m = memory.x_m + x_mps * after_s - aside_m.y[:, None]
        y_m = memory.y_m + y_mps * after_s + aside_m.x[:, None]
        miss_m = np.hypot(x_m, y_m)
        near = np.maximum(1.0 - miss_m / self.clear_m, 0.0) * np.maximum(1.0 - after_s / self.horizon_s, 0.0)
        later = self.strength * near / np.maximum(miss_m, NONE)
        far_m = np.hypot(memory.x_m, memory.y_m)
        now = self.close * np.maximum(1.0 - far_m / self.close_m, 0.0) / np.maximum(far_m, NONE)
        there = known(memory)
        x, y = there * (later * x_m + now * memory.x_m), there * (later * y_m + now * memory.y_m)
        return Vectors(-np.add.reduce(x, 1), -np.add.reduce(y, 1))

    def _feel(self, push: Vectors, memory: Traffic, period_s: float) -> None:
        """The push as it counts, by hysteresis and low-pass."""
        memory.avoiding = hysteresis(memory.avoiding, push.length, self.alarm, self.relaxed)
        memory.push_x = low_pass(memory.push_x, push.x * memory.avoiding, period_s, self.smooth_s)
        memory.push_y = low_pass(memory.push_y, push.y * memory.avoiding, period_s, self.smooth_s)


def known(table: Remembered) -> FloatArray:
    """1 for a slot that is taken, 0 for an empty one, (n, SLOTS)."""
    return np.where(table.sender == NO_ROBOT, 0.0, 1.0)


def pass_time(table: Remembered, own_mps: Vectors, period_s: float) -> None:
    """A period later every neighbour is where its velocity and the robot's own (n,) have brought it."""
    table.x_m += (table.x_mps - own_mps.x[:, None]) * period_s
    table.y_m += (table.y_mps - own_mps.y[:, None]) * period_s
    table.age_s += period_s


def forget(table: Remembered, after_s: float) -> None:
    """Empty the slots whose newest packet is older than `after_s`."""
    old = table.age_s > after_s
    for name, (_, empty, _) in Remembered.columns.items():
        getattr(table, name)[old] = empty


def remember(
    table: Remembered,
    row: IntArray,
    sender: IntArray,
    sequence: IntArray,
    place_m: Vectors,
    velocity_mps: Vectors,
    age_s: FloatArray,
) -> None:
    """Take in what the packets said that the robots `row` received, (k,) each, vectors along the axes of the compass.

    Of each sender the newest packet counts, by its sequence, as one may overtake another; of all senders the SLOTS
    nearest are kept.
    """
    if len(row) == 0:
        return
    new_columns = (sender, sequence, place_m.x, place_m.y, velocity_mps.x, velocity_mps.y, age_s)
    held, slot = np.nonzero(table.sender != NO_ROBOT)
    rows = np.concatenate((held, row))
    both: dict[str, Any] = {
        name: np.concatenate((getattr(table, name)[held, slot], new))
        for name, new in zip(Remembered.columns, new_columns, strict=True)
    }
    kept = _newest(rows, both["sender"], both["sequence"])
    kept, place = _nearest(kept, rows, both["sender"], np.hypot(both["x_m"], both["y_m"]))
    forget(table, -np.inf)
    for name in Remembered.columns:
        getattr(table, name)[rows[kept], place] = both[name][kept]


def _newest(rows: IntArray, sender: IntArray, sequence: IntArray) -> IntArray:
    """Which of all entries is the newest of its row and sender."""
    order = np.lexsort((sequence, sender, rows))
    last = (np.diff(rows[order], append=NO_ROBOT) != 0) | (np.diff(sender[order], append=NO_ROBOT) != 0)
    return order[last]


def _nearest(entries: IntArray, rows: IntArray, sender: IntArray, far_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Which of `entries` are among the SLOTS nearest of their row, and at which place, the nearest at 0."""
    order = entries[np.lexsort((sender[entries], far_m[entries], rows[entries]))]
    place = np.arange(len(order)) - np.searchsorted(rows[order], rows[order])
    return order[place < SLOTS], place[place < SLOTS]
