"""Walking: straight spells with turns on the spot between them, and away from what is in the way."""

from typing import TypeVar

import numpy as np

from swarmwire.agent.behaviours.angles import wrapped
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, State, column
from swarmwire.comms.arrays import BoolArray, FloatArray


class Walk(State):
    """What a walker remembers."""

    left_m: FloatColumn = column(0.0)  # of the present spell
    turn_rad: FloatColumn = column(0.0)  # yet to be made before it goes on, positive to the left


W = TypeVar("W", bound=Walk)


def begin_spells(state: Walk, rows: BoolArray, turn_rad: FloatArray, length_m: FloatArray | float) -> None:
    """The robots of the mask `rows` turn so far, (n,), and then go straight for so long."""
    np.copyto(state.turn_rad, wrapped(turn_rad), where=rows)
    np.copyto(state.left_m, length_m, where=rows)


def ended(state: Walk) -> BoolArray:
    """Who has neither a way nor a turn left, (n,)."""
    return (state.left_m <= 0.0) & (state.turn_rad == 0.0)


def turns_away(robots: Robots, faint: float) -> tuple[BoolArray, FloatArray]:
    """Who has something in the way, and a turn to a heading uniform over the half circle away from it, (n,) each.

    In the way is what rays of the front half answer to by at least `faint`; it is where their vector sum points.
    """
    near, ahead = robots.proximity, np.cos(robots.proximity.angle_rad) > 0.0
    value = np.where(ahead, near.value, 0.0)
    blocked = np.max(value, axis=1) >= faint
    x = np.add.reduce(value * np.cos(near.angle_rad), 1)
    y = np.add.reduce(value * np.sin(near.angle_rad), 1)
    half_circle = robots.draw.uniform("turn away", -0.5 * np.pi, 0.5 * np.pi)
    return blocked, np.arctan2(y, x) + np.pi + half_circle


def walk_on(robots: Robots, state: Walk, speed_mps: float, turn_radps: float, goes: BoolArray | None = None) -> None:
    """Turn on the spot where a turn is left, else straight on; who is not in the mask `goes` stands."""
    period_s, going = robots.period_s, 1.0 if goes is None else goes.astype(np.float64)
    turned = going * np.clip(state.turn_rad, -turn_radps * period_s, turn_radps * period_s)
    linear = going * np.where(state.turn_rad == 0.0, speed_mps, 0.0)
    robots.drive(linear_mps=linear, angular_radps=turned / period_s)
    state.turn_rad -= turned
    state.left_m -= linear * period_s
