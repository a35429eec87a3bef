"""Beacon avoidance: robots without rays avoid one another by the beacons that they receive."""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.behaviours._common import check_order
from swarmwire.agent.fields import Vectors, along, hysteresis, low_pass, steered
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import BoolColumn, FloatColumn, IntColumn, Memory, VectorAgent, column
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.robot.messages import Message, f4

HEAD_ON_M = 1e-3  # shift of a head-on encounter to the left, by which both robots turn to the right
MIN_DIVISOR = 1e-9
SLOTS = 8  # neighbours in the memory of a robot
NO_SEQUENCE = -1  # sequence of an empty slot


class Beacon(Message):
    """A robot's motion, broadcast in every step."""

    heading_rad: f4  # reading of the compass
    speed_mps: f4


class NeighbourTable(Memory):
    """The neighbours of each robot, (n, SLOTS); vectors are relative to the robot, along the axes of the compass.

    An empty slot has the sender NO_ROBOT, and an infinite age.
    """

    sender: IntColumn = column(NO_ROBOT, width=SLOTS)
    sequence: IntColumn = column(NO_SEQUENCE, width=SLOTS)  # sequence of the newest packet
    x_m: FloatColumn = column(0.0, width=SLOTS)
    y_m: FloatColumn = column(0.0, width=SLOTS)
    x_mps: FloatColumn = column(0.0, width=SLOTS)  # velocity by the newest packet
    y_mps: FloatColumn = column(0.0, width=SLOTS)
    age_s: FloatColumn = column(np.inf, width=SLOTS)  # age of the newest packet


class Traffic(NeighbourTable):
    """The memory of a robot: its neighbours, its course, and its avoidance."""

    course_rad: FloatColumn = column(np.nan)  # first reading of the compass
    speed_mps: FloatColumn = column(0.0)  # commanded speed of the last step
    push_x: FloatColumn = column(0.0)  # low-passed push, along the axes of the compass
    push_y: FloatColumn = column(0.0)
    avoiding: BoolColumn = column(False)


class Sightings(NamedTuple):
    """Neighbours by received beacons, (k,) each; vectors as in `NeighbourTable`."""

    row: IntArray  # row of the receiver
    sender: IntArray
    sequence: IntArray
    position_m: Vectors
    velocity_mps: Vectors
    age_s: FloatArray


class BeaconAvoidance(VectorAgent[Traffic]):
    """Straight motion that avoids neighbours on a collision course, by radio without other sensors of neighbours.

    Each robot broadcasts its heading and speed in every step, and remembers the 8 nearest neighbours of the last
    `memory_s`. Range and bearing give the position of a neighbour when its packet went on air; the time since then, the
    velocity in its beacon and the robot's own motion give its present position.

    The robot keeps the direction of its first heading, at `speed_mps`. On this course, a neighbour at the relative
    position p with the relative velocity w is nearest after t = -p.w / w.w (0 if that is past), at m = p + w t. It
    pushes the robot away from m with

        strength max(1 - |m| / clear_m, 0) max(1 - t / horizon_s, 0)

    and, on any course, away from p with close max(1 - |p| / close_m, 0). The sum of all pushes
    takes effect from a length of `alarm` on, until it has fallen to `relaxed` (hysteresis), and is low-passed
    (`smooth_s`). Robots that meet head on pass on the right. The robot turns towards its course plus the push, and
    drives more slowly the more it has to turn.

    Our own rule, of the kind of Reynolds's unaligned collision avoidance (Steering Behaviors, 1999). Packets do not
    carry their latency: latency that `latency_s` does not account for leaves neighbours at their old positions.
    """

    needs: ClassVar[tuple[str, ...]] = ("compass", "radio.range", "radio.bearing")
    speed_mps: float = parameter(0.1, help="straight ahead", above=0.0)
    clear_m: float = parameter(
        0.4, help="miss distance, centre to centre, from which on a neighbour does not push", above=0.0
    )
    horizon_s: float = parameter(
        6.0, help="time until the encounter from which on a neighbour does not push", above=0.0
    )
    strength: float = parameter(2.0, help="weight of pushes from an encounter, relative to the course")
    close_m: float = parameter(
        0.2, help="present distance, centre to centre, from which on a neighbour does not push", above=0.0
    )
    close: float = parameter(2.0, help="weight of pushes from the present distance")
    alarm: float = parameter(0.2, help="length of the sum of pushes at which avoidance begins")
    relaxed: float = parameter(0.05, help="length of the sum of pushes at which avoidance ends")
    smooth_s: float = parameter(0.2, help="time constant of the pushes' low-pass", at_least=0.0)
    memory_s: float = parameter(2.0, help="age of its newest packet at which a neighbour is forgotten")
    latency_s: float = parameter(0.0, help="known time of packets from the start on air to the reception")
    turn_gain_per_s: float = parameter(2.5, help="turn rate per angle to the desired direction")

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Refuse a hysteresis in the wrong order."""
        check_order(cls, params, "relaxed", "alarm")

    def step(self, robots: Robots, memory: Traffic) -> None:
        """Update the neighbours, steer along course and push, and broadcast heading and speed."""
        heading = robots.compass.heading_rad
        memory.course_rad = np.where(np.isnan(memory.course_rad), heading, memory.course_rad)
        robot_mps = memory.speed_mps * along(heading)
        advance(memory, robot_mps, robots.period_s)
        forget(memory, self.memory_s)
        remember(memory, self._sightings(robots, heading, robot_mps))

        course = along(memory.course_rad)
        self._filter(self._push(memory, self.speed_mps * course), memory, robots.period_s)
        desired = course + Vectors(memory.push_x, memory.push_y)
        memory.speed_mps, turn_radps = steered(desired.turned(-heading), self.speed_mps, self.turn_gain_per_s)
        robots.drive(memory.speed_mps, turn_radps)
        robots.note("on course", ~memory.avoiding)
        robots.note("avoiding", memory.avoiding)
        robots.radio.send(Beacon, heading_rad=heading, speed_mps=memory.speed_mps)

    def _sightings(self, robots: Robots, heading: FloatArray, robot_mps: Vectors) -> Sightings:
        """Return the senders of received beacons, at their present positions."""
        received = robots.radio.received(Beacon)
        row = received.row
        age_s = robots.time_s - 1e-9 * received.received_at_ns.astype(np.float64) + self.latency_s
        velocity_mps = received.message.speed_mps * along(received.message.heading_rad)
        position_m = received.range_m * along(heading[row] + received.bearing_rad)
        position_m += age_s * (velocity_mps - Vectors(robot_mps.x[row], robot_mps.y[row]))
        return Sightings(row, received.sender, received.sequence, position_m, velocity_mps, age_s)

    def _push(self, memory: Traffic, course_mps: Vectors) -> Vectors:
        """Return the sum of all pushes, (n,), along the axes of the compass."""
        x_mps, y_mps = memory.x_mps - course_mps.x[:, None], memory.y_mps - course_mps.y[:, None]
        approach = np.maximum(-(memory.x_m * x_mps + memory.y_m * y_mps), 0.0)
        encounter_s = approach / np.maximum(x_mps**2 + y_mps**2, MIN_DIVISOR)
        shift_m = HEAD_ON_M / self.speed_mps * course_mps
        x_m = memory.x_m + x_mps * encounter_s - shift_m.y[:, None]
        y_m = memory.y_m + y_mps * encounter_s + shift_m.x[:, None]
        miss_m = portable.hypot(x_m, y_m)
        imminence = np.maximum(1.0 - miss_m / self.clear_m, 0.0) * np.maximum(1.0 - encounter_s / self.horizon_s, 0.0)
        encounter_push = self.strength * imminence / np.maximum(miss_m, MIN_DIVISOR)
        distance_m = portable.hypot(memory.x_m, memory.y_m)
        proximity = np.maximum(1.0 - distance_m / self.close_m, 0.0)
        close_push = self.close * proximity / np.maximum(distance_m, MIN_DIVISOR)
        occupied = np.where(memory.sender == NO_ROBOT, 0.0, 1.0)
        x = occupied * (encounter_push * x_m + close_push * memory.x_m)
        y = occupied * (encounter_push * y_m + close_push * memory.y_m)
        return Vectors(-portable.ordered_sum(x), -portable.ordered_sum(y))

    def _filter(self, push: Vectors, memory: Traffic, period_s: float) -> None:
        """Apply hysteresis and low-pass to the push."""
        memory.avoiding = hysteresis(memory.avoiding, push.length, self.alarm, self.relaxed)
        memory.push_x = low_pass(memory.push_x, push.x * memory.avoiding, period_s, self.smooth_s)
        memory.push_y = low_pass(memory.push_y, push.y * memory.avoiding, period_s, self.smooth_s)


def advance(table: NeighbourTable, robot_mps: Vectors, period_s: float) -> None:
    """Move the neighbours for a period, by their velocities and the robot's own (n,)."""
    table.x_m += (table.x_mps - robot_mps.x[:, None]) * period_s
    table.y_m += (table.y_mps - robot_mps.y[:, None]) * period_s
    table.age_s += period_s


def forget(table: NeighbourTable, max_age_s: float) -> None:
    """Empty the slots whose newest packet is older than `max_age_s`."""
    old = table.age_s > max_age_s
    for name, (_, empty, _) in NeighbourTable.columns.items():
        getattr(table, name)[old] = empty


def remember(table: NeighbourTable, sightings: Sightings) -> None:
    """Merge sightings into the table.

    Of each sender the packet with the highest sequence counts, as packets may overtake one another; of all senders the
    SLOTS nearest stay.
    """
    if len(sightings.row) == 0:
        return
    row, sender, sequence, position_m, velocity_mps, age_s = sightings
    new_columns = (sender, sequence, position_m.x, position_m.y, velocity_mps.x, velocity_mps.y, age_s)
    old_row, slot = np.nonzero(table.sender != NO_ROBOT)
    rows = np.concatenate((old_row, row))
    entries: dict[str, Any] = {
        name: np.concatenate((getattr(table, name)[old_row, slot], new))
        for name, new in zip(NeighbourTable.columns, new_columns, strict=True)
    }
    newest = _newest(rows, entries["sender"], entries["sequence"])
    distance_m = cast(FloatArray, portable.hypot(entries["x_m"], entries["y_m"]))
    nearest, slot = _nearest(newest, rows, entries["sender"], distance_m)
    forget(table, -np.inf)
    for name in NeighbourTable.columns:
        getattr(table, name)[rows[nearest], slot] = entries[name][nearest]


def _newest(rows: IntArray, sender: IntArray, sequence: IntArray) -> IntArray:
    """Return the indices of the entries that are the newest of their row and sender."""
    order = np.lexsort((sequence, sender, rows))
    last = (np.diff(rows[order], append=NO_ROBOT) != 0) | (np.diff(sender[order], append=NO_ROBOT) != 0)
    return order[last]


def _nearest(entries: IntArray, rows: IntArray, sender: IntArray, distance_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the indices in `entries` that are among the SLOTS nearest of their row, and their slots, nearest first."""
    order = entries[np.lexsort((sender[entries], distance_m[entries], rows[entries]))]
    slot = np.arange(len(order)) - np.searchsorted(rows[order], rows[order])
    return order[slot < SLOTS], slot[slot < SLOTS]
