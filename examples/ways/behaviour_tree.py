"""A behaviour tree, by py_trees (the extra `trees`): conditions and actions, put together as a tree.

Right for many small behaviours that are combined and reused. A selector ticks its children in turn until one succeeds,
a sequence until one fails; the tree of an agent is ticked once a step.
"""

from collections.abc import Callable

import numpy as np
import py_trees
from py_trees.common import Status

from swarmwire.agent import Agent, Message, Robot, f4, parameter


class Call(Message):
    """I am at the lamp."""

    brightness: f4


class Leaf(py_trees.behaviour.Behaviour):
    """A function of the robot as a leaf: what is not False succeeds."""

    def __init__(self, name: str, does: Callable[[], bool | None]) -> None:
        super().__init__(name)
        self.does = does

    def update(self) -> Status:
        """What py_trees calls in each tick."""
        return Status.FAILURE if self.does() is False else Status.SUCCESS


class Seeker(Agent):
    """Wander until the lamp shines on the robot, then stay and call; come to whoever calls; turn from what is near."""

    needs = ("proximity", "light", "radio.bearing")
    speed_mps: float = 0.1
    turn_radps: float = 2.0
    safe_m: float = parameter(0.03, help="distance to the front below which an object blocks")
    bright: float = parameter(1.2, help="sum over the light sensors at which the robot is at the lamp")
    patience_s: float = parameter(3.0, help="time for which a call is followed")

    def __init__(self) -> None:
        self.robot: Robot  # of this step
        self.side = 0.0  # to which it turns from what is in the way: 1 left, -1 right, 0 it does not
        self.call_rad = 0.0  # where the last call came from
        self.called_until_s = 0.0
        self.tree = first_of(
            all_of("at the lamp", Leaf("is it bright?", self.is_bright), Leaf("calls", self.call)),
            all_of("something is near", Leaf("in the way?", self.is_blocked), Leaf("turns away", self.turn)),
            all_of("a call was received", Leaf("lately?", self.is_called), Leaf("comes", self.come)),
            Leaf("wanders", self.wander),
        )

    def step(self, robot: Robot) -> None:
        """Listen, look, and tick the tree."""
        self.robot = robot
        for packet in robot.radio.received(Call):
            self.call_rad, self.called_until_s = packet.bearing_rad, robot.time_s + self.patience_s
        self.look_ahead()
        self.tree.tick_once()
        doing = self.tree.tip()
        if doing is not None:
            robot.note(doing.name)

    def look_ahead(self) -> None:
        """Choose a side away from what is nearest ahead, and keep it until the way is free."""
        rays = self.robot.proximity
        distance = np.where(np.abs(rays.angle_rad) < 1.0, rays.distance_m, np.inf)
        nearest = int(np.argmin(distance))
        if distance[nearest] > self.safe_m:
            self.side = 0.0
        elif not self.side:
            self.side = -1.0 if rays.angle_rad[nearest] > 0.0 else 1.0

    def is_bright(self) -> bool:
        """Whether the robot is at the lamp."""
        return float(np.sum(self.robot.light.value)) > self.bright

    def is_blocked(self) -> bool:
        """Whether something is in the way."""
        return self.side != 0.0

    def is_called(self) -> bool:
        """Whether a call was received lately."""
        return self.robot.time_s < self.called_until_s

    def call(self) -> None:
        """Stay, and tell the others."""
        self.side = 0.0
        self.robot.drive(0.0, 0.0)
        self.robot.radio.send(Call(brightness=float(np.sum(self.robot.light.value))))

    def turn(self) -> None:
        """On the spot, away from what is in the way."""
        self.robot.drive(0.0, self.side * self.turn_radps)

    def come(self) -> None:
        """To where the last call came from; the robot turns that way meanwhile."""
        self.robot.drive(self.speed_mps, self.call_rad)
        self.call_rad -= self.call_rad * self.robot.period_s

    def wander(self) -> None:
        """Ahead, with turns at random."""
        self.robot.drive(self.speed_mps, self.robot.draw.normal("wander"))


def first_of(*children: py_trees.behaviour.Behaviour) -> py_trees.composites.Selector:
    """Tick children in turn until one succeeds."""
    return py_trees.composites.Selector("first of", memory=False, children=list(children))


def all_of(name: str, *children: py_trees.behaviour.Behaviour) -> py_trees.composites.Sequence:
    """Tick children in turn until one fails."""
    return py_trees.composites.Sequence(name, memory=False, children=list(children))
