"""Events that act on robots: kill, revive, fail (a part stops working), impulse (a sudden change of velocity)."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin

import numpy as np

from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import MOTORS, WHEELS, Body
from swarmwire.comms.robot.bodies.drives import Holonomic
from swarmwire.world.events.effects import BATTERY, ActiveEffects, Failures, Lifetimes, exclusive
from swarmwire.world.events.event import Event, LastingEvent
from swarmwire.world.events.selection import Groups, Selection, Swarm


@dataclass(frozen=True, kw_only=True)
class Kill(LastingEvent):
    """A killed robot brakes, stops acting, loses its radio's queue, and is an obstacle; undone, it is revived."""

    do: str = parameter("kill", help="robots stop where they stand", choices=("kill",))
    robots: Selection = parameter(help="which robots; share and count choose among robots alive")

    def apply(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> None:
        """Kill the robots."""
        effects.kills[serial] = self.robots.rows(serial, swarm, effects.alive)

    def changed(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """True for robots that no other kill applies to."""
        return exclusive(serial, effects.kills)


@dataclass(frozen=True, kw_only=True)
class Revive(Event):
    """Robots are alive again after any cause of death, with a new memory; robots that are alive do not change.

    A robot whose battery was empty gets a full one.
    """

    do: str = parameter("revive", help="robots that were killed act again", choices=("revive",))
    robots: Selection = parameter(help="which robots; share and count choose among dead robots")

    def begin(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> BoolArray:
        """Remove the robots from every kill; return the robots that were dead, (rows,)."""
        dead = ~effects.alive
        chosen = self.robots.rows(serial, swarm, dead)
        for killed in effects.kills.values():
            killed[chosen] = False
        for failures in effects.failures.values():
            if failures.part == BATTERY:
                failures.renew(chosen, to_ns(self.at_s))
        return chosen & dead


@dataclass(frozen=True, kw_only=True)
class Fail(LastingEvent):
    """A part of robots fails; their agents continue without a notice, except that a dead battery stops the robot.

    Failed motors brake, and a failed wheel stands still; a failed sensor reads as if every reading were lost. With
    `per_hour` each robot fails at a separately drawn time after `at_s`, and again after it has recovered.
    """

    do: str = parameter("fail", help="a part of robots no longer works", choices=("fail",))
    part: str = parameter(help="motors, left_wheel, right_wheel, battery, or a sensor of the body such as proximity")
    robots: Selection = parameter(help="robots whose part fails; share and count choose among robots alive")
    per_hour: float | None = parameter(
        None, help="each robot fails at this rate instead of at once", unit="1/h", above=0, at_most=1e6
    )

    @property
    def duration_s(self) -> float | None:
        """`for_s`; None if each robot's failure has a separate duration."""
        return self.for_s if self.per_hour is None else None

    @property
    def evolves(self) -> bool:
        """True if robots fail after the start of the event."""
        return self.per_hour is not None

    @property
    def failing_part(self) -> str:
        """`part`."""
        return self.part

    def check_bodies(self, groups: Groups, bodies: Mapping[str, Body]) -> None:
        """Raise BadInput for a part that a body of these robots does not have."""
        for group in self.robots.groups(groups):
            body = bodies[group]
            parts = [BATTERY, MOTORS, *(() if isinstance(body.drive, Holonomic) else WHEELS), *body.sensors]
            if self.part not in parts:
                raise BadInput(
                    "", "part", f"expected one of {', '.join(parts)} of the body {body.name}; got {self.part!r}"
                )

    def apply(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> None:
        """Make the part fail, now or at the rate."""
        chosen = self.robots.rows(serial, swarm, effects.alive)
        if self.per_hour is None:
            failures = Failures(self.part, chosen)
        else:
            failures = self._lifetimes(serial, swarm).start(self.part, chosen, to_ns(self.at_s))
        effects.failures[serial] = failures
        if self.part == BATTERY:
            effects.kills[serial] = failures.failed.copy()

    def changed(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """True for robots whose part failed by no other event."""
        return exclusive(serial, effects.failed_by_event(self.part))

    def advance(self, serial: int, now_ns: int, swarm: Swarm, effects: ActiveEffects) -> tuple[BoolArray, BoolArray]:
        """Apply the failures and recoveries that are due; return the failed and the recovered robots, (rows,) each."""
        before = effects.failed(self.part)
        self._lifetimes(serial, swarm).advance(effects.failures[serial], now_ns)
        after = effects.failed(self.part)
        failed, recovered = after & ~before, before & ~after
        if self.part == BATTERY:
            # Of this event alone, whatever other events do to the same batteries: each kill ends with its failure.
            effects.kills[serial] = effects.failures[serial].failed.copy()
        return failed, recovered

    def _lifetimes(self, serial: int, swarm: Swarm) -> Lifetimes:
        assert self.per_hour is not None, "without a rate the part fails at once"
        return Lifetimes(self.per_hour, None if self.for_s is None else to_ns(self.for_s), swarm.keys, serial)


@dataclass(frozen=True, kw_only=True)
class Impulse(Event):
    """The robots' velocity changes at once, as after a blow; motors and contacts determine the motion after it.

    The motors of a robot on wheels bring it back to its commanded speed as fast as their force allows, which may be
    within a tick; a dead robot only brakes. The impulse in newton seconds is the robot's mass times the speed. Bodies
    without contacts, which follow their commands exactly, ignore impulses.
    """

    do: str = parameter("impulse", help="robots get another velocity at once", choices=("impulse",))
    robots: Selection = parameter(help="which robots; share and count choose among robots alive")
    speed_mps: float = parameter(help="added to their velocity", unit="m/s", above=0, at_most=1000)
    direction_rad: float = parameter(
        0.0,
        help="direction in the arena's frame: 0 along x, counter-clockwise above 0",
        unit="rad",
        at_least=-7,
        at_most=7,
    )

    def begin(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> BoolArray:
        """Apply the impulse; return all chosen robots, also dead ones, (rows,)."""
        chosen = self.robots.rows(serial, swarm, effects.alive)
        change_mps = self.speed_mps * np.array([cos(self.direction_rad), sin(self.direction_rad)])
        effects.impulses_mps[serial] = np.where(chosen[:, None], change_mps, 0.0)
        return chosen
