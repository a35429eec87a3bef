"""Kill: robots stop where they stand, and are obstacles from then on."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin

import numpy as np

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.bodies.body import MOTORS, WHEELS, Body
from swarmwire.comms.bodies.drives import Holonomic
from swarmwire.comms.clock import to_ns
from swarmwire.comms.config import parameter
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.effects import BATTERY, ActiveEffects, Failures, Lifetimes, alone
from swarmwire.comms.events.event import Event, LastingEvent
from swarmwire.comms.events.selection import Groups, Selection, Swarm


@dataclass(frozen=True, kw_only=True)
class Kill(LastingEvent):
    """A killed robot brakes, no longer acts, and its radio forgets its queue; undone, it is revived."""

    do: str = parameter("kill", help="robots stop where they stand", choices=("kill",))
    robots: Selection = parameter(help="which robots; share and count choose among those alive")

    def hold(self, serial: int, swarm: Swarm, conditions: ActiveEffects) -> None:
        """Hold the robots dead."""
        conditions.kills[serial] = self.robots.rows(serial, swarm, conditions.alive)

    def changed(self, serial: int, conditions: ActiveEffects) -> BoolArray:
        """Those that nothing else holds dead."""
        return alone(serial, conditions.kills)


# --- Revive: robots that were killed act again, with a fresh memory.


@dataclass(frozen=True, kw_only=True)
class Revive(Event):
    """Whatever killed them, the robots are alive again; those that are so already do not notice.

    One whose battery was empty gets a full one.
    """

    do: str = parameter("revive", help="robots that were killed act again", choices=("revive",))
    robots: Selection = parameter(help="which robots; share and count choose among those dead")

    def begin(self, serial: int, swarm: Swarm, conditions: ActiveEffects) -> BoolArray:
        """Free the robots of every kill; changed are those that were dead."""
        dead = ~conditions.alive
        chosen = self.robots.rows(serial, swarm, dead)
        for held in conditions.kills.values():
            held[chosen] = False
        for failing in conditions.failures.values():
            if failing.part == BATTERY:
                failing.renew(chosen, to_ns(self.at_s))
        return chosen & dead


# --- Fail: a part of robots no longer works.


@dataclass(frozen=True, kw_only=True)
class Fail(LastingEvent):
    """The robots' agents go on and do not know it, but for a dead battery, which leaves no agent and no radio.

    Motors that failed brake, and a wheel that failed stands still; a sense that failed reads as if every reading were
    lost. With `per_hour` each robot fails when its own draw says so, from `at_s` on, and again after it was mended.
    """

    do: str = parameter("fail", help="a part of robots no longer works", choices=("fail",))
    part: str = parameter(help="motors, left_wheel, right_wheel, battery, or a sense of the body such as proximity")
    robots: Selection = parameter(help="whose part; share and count choose among robots alive")
    per_hour: float | None = parameter(
        None, help="each of them fails at this rate instead of at once", unit="1/h", above=0, at_most=1e6
    )

    @property
    def lasts_s(self) -> float | None:
        """`for_s`, unless each robot's failure has its own time."""
        return self.for_s if self.per_hour is None else None

    @property
    def evolves(self) -> bool:
        """Whether robots fail after the event has begun."""
        return self.per_hour is not None

    @property
    def failing_part(self) -> str:
        """`part`."""
        return self.part

    def check_bodies(self, groups: Groups, bodies: Mapping[str, Body]) -> None:
        """Raise BadInput for a part that a body of these robots does not have."""
        for group in self.robots.groups(groups):
            body = bodies[group]
            has = [BATTERY, MOTORS, *(() if isinstance(body.drive, Holonomic) else WHEELS), *body.sensors]
            if self.part not in has:
                raise BadInput(
                    "", "part", f"expected one of {', '.join(has)} of the body {body.name}; got {self.part!r}"
                )

    def hold(self, serial: int, swarm: Swarm, conditions: ActiveEffects) -> None:
        """Let the part fail, now or at the rate."""
        chosen = self.robots.rows(serial, swarm, conditions.alive)
        if self.per_hour is None:
            failing = Failures(self.part, chosen)
        else:
            failing = self._lifetimes(serial, swarm).begun(self.part, chosen, to_ns(self.at_s))
        conditions.failures[serial] = failing
        if self.part == BATTERY:
            conditions.kills[serial] = failing.failed.copy()

    def changed(self, serial: int, conditions: ActiveEffects) -> BoolArray:
        """Those of which nothing else holds the part."""
        return alone(serial, conditions.failed_by_event(self.part))

    def go_on(self, serial: int, now_ns: int, swarm: Swarm, conditions: ActiveEffects) -> tuple[BoolArray, BoolArray]:
        """Let fail and be mended what is due by now; returns whose part failed, and whose works again, (rows,) each."""
        before = conditions.failed(self.part)
        self._lifetimes(serial, swarm).go_on(conditions.failures[serial], now_ns)
        after = conditions.failed(self.part)
        fell, mended = after & ~before, before & ~after
        if self.part == BATTERY:
            conditions.kills[serial] = conditions.kills[serial] & ~mended | fell
        return fell, mended

    def _lifetimes(self, serial: int, swarm: Swarm) -> Lifetimes:
        assert self.per_hour is not None, "it fails at once"
        return Lifetimes(self.per_hour, None if self.for_s is None else to_ns(self.for_s), swarm.keys, serial)


# --- Impulse: robots get another velocity at once, as by a blow.


@dataclass(frozen=True, kw_only=True)
class Impulse(Event):
    """The robots' velocity changes by so much in a direction; what follows is up to their motors, and to what they hit.

    A robot on wheels is brought back to its command's speed as fast as its motors' force allows, which may be within a
    tick; a dead one only brakes. How many newton seconds that takes is its mass times the speed. Bodies without
    contacts, which go where they are told, take no impulse.
    """

    do: str = parameter("impulse", help="robots get another velocity at once", choices=("impulse",))
    robots: Selection = parameter(help="which robots; share and count choose among those alive")
    speed_mps: float = parameter(help="how much is added to their velocity", unit="m/s", above=0, at_most=1000)
    direction_rad: float = parameter(
        0.0,
        help="where to, in the arena's frame: 0 along x, to the left of it above 0",
        unit="rad",
        at_least=-7,
        at_most=7,
    )

    def begin(self, serial: int, swarm: Swarm, conditions: ActiveEffects) -> BoolArray:
        """Apply it; changed are all that were chosen, dead ones too."""
        chosen = self.robots.rows(serial, swarm, conditions.alive)
        by_mps = self.speed_mps * np.array([cos(self.direction_rad), sin(self.direction_rad)])
        conditions.impulses_mps[serial] = np.where(chosen[:, None], by_mps, 0.0)
        return chosen
