"""Fail: a part of robots no longer works."""

from collections.abc import Mapping
from dataclasses import dataclass

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.bodies.body import MOTORS, WHEELS, Body
from swarmwire.comms.bodies.drives import Holonomic
from swarmwire.comms.clock import to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.conditions import Conditions, alone
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.failing import BATTERY, Failing, Lifetimes
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Groups, Swarm
from swarmwire.comms.parameters import parameter


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
            has = [BATTERY, MOTORS, *(() if isinstance(body.drive, Holonomic) else WHEELS), *body.senses]
            if self.part not in has:
                raise BadInput(
                    "", "part", f"expected one of {', '.join(has)} of the body {body.name}; got {self.part!r}"
                )

    def hold(self, serial: int, swarm: Swarm, conditions: Conditions) -> None:
        """Let the part fail, now or at the rate."""
        chosen = self.robots.rows(serial, swarm, conditions.alive)
        if self.per_hour is None:
            failing = Failing(self.part, chosen)
        else:
            failing = self._lifetimes(serial, swarm).begun(self.part, chosen, to_ns(self.at_s))
        conditions.failures[serial] = failing
        if self.part == BATTERY:
            conditions.kills[serial] = failing.failed.copy()

    def changed(self, serial: int, conditions: Conditions) -> BoolArray:
        """Those of which nothing else holds the part."""
        return alone(serial, conditions.failed_by_event(self.part))

    def go_on(self, serial: int, now_ns: int, swarm: Swarm, conditions: Conditions) -> tuple[BoolArray, BoolArray]:
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
