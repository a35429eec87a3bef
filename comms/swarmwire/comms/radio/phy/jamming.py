"""The jammers under the poses held."""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry.obstacles import Obstacles, is_blocked
from swarmwire.comms.kernels import kernel
from swarmwire.comms.radio.disruption import Jammers
from swarmwire.comms.radio.phy import dcf
from swarmwire.comms.radio.phy.propagation import PropagationParams
from swarmwire.comms.radio.phy.reception import count_chunk
from swarmwire.comms.radio.phy.state import Jam
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.propagation.path_loss import loss_between_db
from swarmwire.comms.radio.stages.stage import ChannelContext


class JammerTable:
    """What jammers do to robots, and when."""

    def __init__(self, context: ChannelContext) -> None:
        self._context, self._jammers = context, Jammers.none()
        self._power_mw = np.empty((0, context.robots))

    @property
    def anything(self) -> bool:
        """Whether there are jammers."""
        return len(self._jammers.arena) > 0

    def move(self, pose: FloatArray, around: PropagationParams) -> None:
        """Robots stand at `pose` (rows, 3) from now on, and jammers are those of the disruption that holds."""
        self._jammers = self._context.disruption.jammers
        if not self.anything:
            self._power_mw = np.empty((0, self._context.robots))
            return
        self._power_mw = powers_of(self._jammers, pose, self._context.robots, self._context.obstacles, around)

    def between(self, from_ns: int, until_ns: int) -> Jam:
        """The jammers as they are just before `from_ns`, and when they go on or off from then to before `until_ns`."""
        at_ns, which = self._jammers.toggles(from_ns, until_ns)
        is_on = self._jammers.is_on(from_ns - 1)
        return Jam(self._jammers.arena, self._power_mw, is_on, at_ns, which, np.zeros(1, np.int64))

    def by_robot(self, least_mw: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """By robot row (rows,): the power in mW of jammers that never pause, that of all, and the clear share of time.

        Clear is when none of the others is on; less than `least_mw` of one does not count.
        """
        shape = len(self._context.keys), self._context.robots
        steady_mw, all_mw, clear = np.zeros(shape), np.zeros(shape), np.ones(shape)
        for jammer, arena in enumerate(self._jammers.arena.tolist()):
            power_mw, duty = self._power_mw[jammer], self._jammers.duty[jammer]
            all_mw[arena] += power_mw
            if duty == 1.0:
                steady_mw[arena] += power_mw
            else:
                clear[arena, power_mw >= least_mw] *= 1.0 - duty
        return steady_mw.ravel(), all_mw.ravel(), clear.ravel()


# --- Jamming: the power of jammers at each robot, and how it comes and goes.
#
# It adds to the robot's noise, and to what its radio senses. Powers are those under the poses held; within a tick only
# whether a jammer is on changes.


def powers_of(
    jammers: Jammers, pose: FloatArray, robots: int, obstacles: Obstacles, around: PropagationParams
) -> FloatArray:
    """The power of each jammer at each robot of its arena in mW, robots at `pose` (rows, 3); (k, robots)."""
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    return _powers(jammers, jammers.places(pose), x, y, robots, obstacles, around)


@njit(cache=True)
def _powers(jammers, place, x, y, robots, obstacles, around):
    power_mw = np.zeros((len(place), robots))
    amplitude_db = around.amplitude_db if around.shadows else 0.0
    crossing_db, inside_db_per_m = (around.crossing_db, around.inside_db_per_m) if around.walls else (0.0, 0.0)
    for j in range(len(place)):
        arena, jx, jy = jammers.arena[j], place[j, 0], place[j, 1]
        curve, waves = around.curve, around.field[arena]
        for i in range(robots):
            r = arena * robots + i
            if r == jammers.carrier[j]:
                continue
            if around.line_of_sight and is_blocked(obstacles, arena, jx, jy, x[r], y[r]):
                continue
            rx, ry = x[r], y[r]
            apart_m = math.hypot(rx - jx, ry - jy)
            loss = loss_between_db(
                curve, waves, amplitude_db, obstacles, arena, crossing_db, inside_db_per_m, apart_m, jx, jy, rx, ry
            )
            power_mw[j, i] = from_db(jammers.power_dbm[j] + around.receive_dbi[r] - loss)
    return power_mw


@kernel(from_python=True)
def refresh(rules, state, queue, now_ns):
    """Jammers, what they do, or the radio's rules have changed: every robot's noise is what it should be."""
    for arena in range(len(state.keys)):
        _refresh_arena(rules, state, queue, arena, now_ns)


@kernel()
def toggle(rules, state, queue):
    """The next jammer that goes on or off does."""
    jam = state.jam
    at = jam.next[0]
    jam.next[0] += 1
    which = jam.which[at]
    jam.is_on[which] = not jam.is_on[which]
    _refresh_arena(rules, state, queue, jam.arena[which], jam.at_ns[at])


@kernel()
def _refresh_arena(rules, state, queue, arena, now_ns):
    jam = state.jam
    for i in range(rules.robots):
        r = arena * rules.robots + i
        jam_mw = 0.0  # added up anew each time, so that no rounding piles up
        for j in range(len(jam.arena)):
            if jam.arena[j] == arena and jam.is_on[j]:
                jam_mw += jam.power_mw[j, i]
        it = state.reception[r]
        count_chunk(rules, state.robot, it, now_ns)
        it.jam_mw = jam_mw
        dcf.sense(rules, state, queue, r, now_ns)
