"""Jamming: the power of jammers at each robot, and its changes over time.

The power of a jammer is added to the robot's noise and to the power that its radio senses. Powers are those at the
current poses; within a tick jammers only switch on and off.
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.line_of_sight import is_blocked
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndex
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import Jammers
from swarmwire.comms.radio.phy import dcf
from swarmwire.comms.radio.phy.propagation import PropagationParams
from swarmwire.comms.radio.phy.reception import end_chunk
from swarmwire.comms.radio.phy.state import JammerSchedule
from swarmwire.comms.radio.propagation.antennas import losses_towards
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.propagation.path_loss import MeanLoss, loss_between_db


class JammerTable:
    """The power of each jammer at each robot under the current poses."""

    def __init__(self, context: ChannelContext) -> None:
        self._context, self._jammers = context, Jammers.none()
        self._power_mw = np.empty((0, context.robots))
        empty, is_on = np.empty(0, np.int64), np.empty(0, np.bool_)
        self._none = JammerSchedule(empty, self._power_mw, is_on, empty, empty, np.zeros(1, np.int64))

    @property
    def anything(self) -> bool:
        """True if there are jammers."""
        return len(self._jammers.arena) > 0

    def move(self, pose: FloatArray, propagation: PropagationParams, despreading: FloatArray) -> None:
        """Recompute the powers for robots at `pose` (rows, 4) and the jammers of the active disruption.

        The detectors divide each by `despreading` (robots,).
        """
        self._jammers = self._context.disruption.jammers
        if not self.anything:
            self._power_mw = np.empty((0, self._context.robots))
            return
        power_mw = powers_of(self._jammers, pose, self._context.robots, self._context.obstacles.now(), propagation)
        self._power_mw = power_mw / despreading

    def between(self, from_ns: int, until_ns: int) -> JammerSchedule:
        """Return the state of jammers before `from_ns`, and their switching times in [`from_ns`, `until_ns`)."""
        if not self.anything:
            return self._none
        at_ns, jammer = self._jammers.toggles(from_ns, until_ns)
        is_on = self._jammers.is_on(from_ns - 1)
        return JammerSchedule(self._jammers.arena, self._power_mw, is_on, at_ns, jammer, np.zeros(1, np.int64))

    def by_robot(self, min_mw: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return power in mW of continuous jammers, of all jammers, and the share of clear time, by robot (rows,).

        Time is clear while no pulsed jammer of at least `min_mw` is on.
        """
        shape = len(self._context.keys), self._context.robots
        steady_mw, all_mw, clear = np.zeros(shape), np.zeros(shape), np.ones(shape)
        for jammer, arena in enumerate(self._jammers.arena.tolist()):
            power_mw, duty = self._power_mw[jammer], self._jammers.duty[jammer]
            all_mw[arena] += power_mw
            if duty == 1.0:
                steady_mw[arena] += power_mw
            else:
                clear[arena, power_mw >= min_mw] *= 1.0 - duty
        return steady_mw.ravel(), all_mw.ravel(), clear.ravel()


def powers_of(
    jammers: Jammers, pose: FloatArray, robots: int, obstacles: ObstacleIndex, propagation: PropagationParams
) -> FloatArray:
    """Return the power of each jammer at each robot of its arena in mW, robots at `pose` (rows, 4); (k, robots)."""
    x, y, z = (np.ascontiguousarray(pose[:, column]) for column in (0, 1, 3))
    position = jammers.positions(pose)
    power_mw = _powers(jammers, position, x, y, z, robots, obstacles, propagation)
    if propagation.directs:
        heading = np.ascontiguousarray(pose[:, 2])
        loss_db = losses_towards(propagation.patterns, x, y, z, heading, robots, jammers.arena, position)
        power_mw *= portable.power(10.0, -0.1 * loss_db)
    return power_mw


@njit()
def _powers(jammers, position, x, y, z, robots, obstacles, propagation):
    power_mw, entered = np.zeros((len(position), robots)), np.empty((len(obstacles.shape), 2))
    amplitude_db = propagation.amplitude_db if propagation.shadows else 0.0
    crossing_db = propagation.crossing_db if propagation.walls else 0.0
    inside_db_per_m = propagation.inside_db_per_m if propagation.walls else 0.0
    mean_loss = MeanLoss(propagation.curve, amplitude_db, crossing_db, inside_db_per_m)
    for j in range(len(position)):
        arena, jx, jy, jz = jammers.arena[j], position[j, 0], position[j, 1], position[j, 2]
        waves = propagation.field[arena]
        for i in range(robots):
            r = arena * robots + i
            if r == jammers.carrier[j]:
                continue
            if propagation.line_of_sight and is_blocked(obstacles, arena, jx, jy, jz, x[r], y[r], z[r], 0.0, 0.0):
                continue
            over_floor_m, dz = math_compiled.hypot(x[r] - jx, y[r] - jy), z[r] - jz
            distance_m = math.sqrt(over_floor_m * over_floor_m + dz * dz)
            loss = loss_between_db(
                mean_loss, waves, obstacles, entered, arena, distance_m, jx, jy, jz, x[r], y[r], z[r]
            )
            power_mw[j, i] = from_db(jammers.power_dbm[j] + propagation.receive_dbi[r] - loss)
    return power_mw


@kernel(from_python=True)
def refresh(params, state, events, now_ns):
    """Recompute the noise of all robots after a change of jammers, their power or the PHY parameters."""
    for arena in range(len(state.keys)):
        _refresh_arena(params, state, events, arena, now_ns)


@kernel()
def toggle(params, state, events):
    """Switch the next jammer of the schedule on or off."""
    jam = state.jam
    i = jam.next[0]
    jam.next[0] += 1
    jammer = jam.jammer[i]
    jam.is_on[jammer] = not jam.is_on[jammer]
    _refresh_arena(params, state, events, jam.arena[jammer], jam.at_ns[i])


@kernel()
def _refresh_arena(params, state, events, arena, now_ns):
    """Recompute the noise of an arena's robots."""
    jam = state.jam
    for i in range(params.robots):
        r = arena * params.robots + i
        jam_mw = 0.0  # summed again each time: rounding errors do not accumulate
        for j in range(len(jam.arena)):
            if jam.arena[j] == arena and jam.is_on[j]:
                jam_mw += jam.power_mw[j, i]
        for row in range(r, len(state.reception), len(state.robot)):  # on each channel
            rx = state.reception[row]
            end_chunk(state.ht, params, state.robot, rx, r, now_ns)
            rx.jam_mw = jam_mw
        dcf.sense(params, state, events, r, now_ns)
