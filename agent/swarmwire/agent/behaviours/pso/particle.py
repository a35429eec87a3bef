"""Particle: what a robot of a particle swarm remembers, and how what it senses and hears changes that."""

from typing import NamedTuple

import numpy as np

from swarmwire.agent.fields import Vectors
from swarmwire.agent.vector_agent import FloatColumn, IntColumn, State, column
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray

DARK = -1.0  # below any light: nothing seen, or heard of, yet


class Particle(State):
    """What a particle remembers; vectors lead from the robot, in m, along the axes of the compass."""

    steps: IntColumn = column(0)
    own_brightness: FloatColumn = column(DARK)
    own_readings: IntColumn = column(0)  # of which the own brightness is the mean
    own_x: FloatColumn = column(0.0)
    own_y: FloatColumn = column(0.0)
    best_brightness: FloatColumn = column(DARK)  # of the neighbours, as heard
    best_x: FloatColumn = column(0.0)
    best_y: FloatColumn = column(0.0)
    velocity_x: FloatColumn = column(0.0)  # m per update
    velocity_y: FloatColumn = column(0.0)
    target_x: FloatColumn = column(0.0)
    target_y: FloatColumn = column(0.0)


class Bests(NamedTuple):
    """Bests that were heard, (k,) each."""

    row: IntArray  # of the robot that heard it
    sender: IntArray  # index in the arena
    brightness: FloatArray
    x: FloatArray  # from the robot that heard it, in m, along the axes of the compass
    y: FloatArray

    def of(self, which: BoolArray) -> "Bests":
        """Those of the mask (k,)."""
        return Bests(self.row[which], self.sender[which], self.brightness[which], self.x[which], self.y[which])


def shift(state: Particle, by_m: Vectors) -> None:
    """The robots moved by so much (n,), along the axes of the compass: places they remember are elsewhere from them."""
    state.own_x -= by_m.x
    state.own_y -= by_m.y
    state.best_x -= by_m.x
    state.best_y -= by_m.y
    state.target_x -= by_m.x
    state.target_y -= by_m.y


def look(state: Particle, brightness: FloatArray, again_m: float) -> None:
    """Where it is brighter (n,) than at the own best, here is the own best.

    Nearer than `again_m` to the own best it is one more reading of it: their mean counts, and the place stays.
    """
    again = (state.own_readings > 0) & (np.hypot(state.own_x, state.own_y) < again_m)
    state.own_readings[again] += 1
    surprise = brightness - state.own_brightness
    state.own_brightness[again] += (surprise / np.maximum(state.own_readings, 1))[again]
    brighter = ~again & (surprise > 0.0)
    state.own_brightness[brighter] = brightness[brighter]
    state.own_readings[brighter] = 1
    state.own_x[brighter] = 0.0
    state.own_y[brighter] = 0.0


def listen(state: Particle, bests: Bests) -> None:
    """Of all that was heard, keep the brightest of each row; as bright as the one known, it is fresher."""
    order = np.lexsort((bests.brightness, bests.row))
    last = order[np.flatnonzero(np.diff(bests.row[order], append=-1))]  # of each row
    last = last[bests.brightness[last] >= state.best_brightness[bests.row[last]]]
    row = bests.row[last]
    state.best_brightness[row] = bests.brightness[last]
    state.best_x[row] = bests.x[last]
    state.best_y[row] = bests.y[last]
