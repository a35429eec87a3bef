"""The loop of an agent on a robot: sense, hear, decide, act, send, at the pace of the clock."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from math import ceil
from typing import Any, Protocol

from swarmwire.agent.drivers.driver import STOP, Driver, DriverLost
from swarmwire.agent.on_robot.control import STOPPED
from swarmwire.agent.on_robot.end import End
from swarmwire.agent.on_robot.mind import Decision, Mind
from swarmwire.agent.on_robot.motors import Motors
from swarmwire.agent.on_robot.pacer import Pacer
from swarmwire.agent.on_robot.reconnection import reconnect
from swarmwire.agent.on_robot.robot_log import TickRow
from swarmwire.agent.on_robot.senses import SensesOnRobot
from swarmwire.agent.on_robot.watchdog import Watchdog
from swarmwire.agent.radios.radio import RobotRadio
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.packets import Sent

RUNNING, LOST = "running", "driver lost"
DURATION = "duration"  # why it ended
BLIND_S = 3.0  # an agent begins after so long, even if one of its senses has never been read
NOTHING = Decision(STOP, drive=False, sent=Sent.none())


@dataclass(frozen=True)
class RobotParts:
    """What a robot is made of, as the loop needs it."""

    driver: Driver
    radio: RobotRadio
    mind: Mind
    senses: SensesOnRobot
    motors: Motors
    watchdog: Watchdog
    clock: DatedClock


class Onlooker(Protocol):
    """Whoever keeps, shows and reports what the robot does; it cannot stop it."""

    def step(self, row: TickRow) -> None:
        """A step is done."""
        ...

    def wait(self) -> None:
        """No step is due, or can be: called several times a second."""
        ...

    def say(self, line: str) -> None:
        """Something that the user should know."""
        ...


class RobotLoop:
    """One robot, from its first step to whatever ends it.

    Attributes:
        counts: what went wrong in the loop so far, by name.
    """

    def __init__(
        self,
        parts: RobotParts,
        rate_hz: int,
        end: End,
        onlooker: Onlooker,
        more_counts: Callable[[], dict[str, int]] = dict,
    ) -> None:
        """`more_counts` tells what went wrong in what belongs neither to driver nor radio."""
        self._parts, self._rate_hz, self._end, self._onlooker = parts, rate_hz, end, onlooker
        self._more_counts = more_counts
        self._pacer = Pacer(parts.clock, rate_hz)
        self._tick = -1
        self._forgot_leds = False  # a robot that was lost may have been switched off
        self._begun = False
        self.counts = Counter[str]()

    def run(self, duration_s: float | None = None) -> None:
        """Step until the end is asked for, or for so long; AgentFailed if the agent raises."""
        parts, last = self._parts, None if duration_s is None else ceil(duration_s * self._rate_hz)
        self._pacer = Pacer(parts.clock, self._rate_hz)
        while not self._end:
            tick, late = self._pacer.wait()
            if last is not None and tick >= last:
                self._end.ask(DURATION)
                break
            parts.watchdog.feed()
            try:
                row = self._step(tick, late)
            except DriverLost as error:
                self._find(error)
                continue
            parts.watchdog.feed()
            self._onlooker.step(row)

    def status(self) -> dict[str, Any]:
        """How the robot is, in plain values."""
        parts = self._parts
        state = STOPPED if parts.motors.control.stopped else RUNNING if parts.motors.reachable else LOST
        return {
            "state": state,
            "tick": self._tick,
            "late_ticks": self._pacer.late,
            "watchdog_stops": parts.watchdog.stops,
            "charge": parts.senses.charge,
            "agent_state": parts.mind.state,
            "counts": self._all_counts(),
        }

    def _all_counts(self) -> dict[str, int]:
        """What went wrong anywhere, by name, where anything did."""
        parts = self._parts
        own = {
            "skipped_ticks": self._pacer.skipped,
            "clipped_commands": parts.mind.clipped,
            "nan_commands": parts.mind.nan,
            "actuations_without_driver": parts.mind.actuations,
        }
        counts = self.counts + Counter(own)
        for told in (parts.driver.counts(), parts.radio.counts(), self._more_counts()):
            counts += Counter(told)
        return dict(sorted(counts.items()))

    def _step(self, tick: int, late: bool) -> TickRow:
        parts = self._parts
        fields = parts.senses.read()
        heard, outcomes = parts.radio.heard(self._pacer.since_start_ns())
        self._tick = tick
        decision = NOTHING
        if parts.motors.control.stopped:
            parts.motors.stop()
        elif self._begins(tick):
            decision = parts.mind.step(tick, fields, heard, outcomes)
            self._do(decision)
        utc_ns, told = parts.clock.utc_ns(), (parts.mind.state, parts.mind.value, parts.senses.charge)
        return TickRow(tick, utc_ns, late, parts.senses.pose, decision.drive, decision.command, *told)

    def _begins(self, tick: int) -> bool:
        """Whether the agent is stepped: in emulation none begins before each of its senses was read."""
        self._begun = self._begun or self._parts.senses.complete or tick > BLIND_S * self._rate_hz
        return self._begun

    def _do(self, decision: Decision) -> None:
        parts = self._parts
        try:
            parts.motors.act(parts.mind.all_leds() if self._forgot_leds else decision.command)
            self._forgot_leds = False
        finally:  # a robot that cannot drive can still talk
            if len(decision.sent):
                parts.radio.send(decision.sent)

    def _find(self, error: DriverLost) -> None:
        """Wait for the robot to answer again; the agent stands still, as the robot's own time does."""
        parts = self._parts
        parts.watchdog.rest()
        self._forgot_leds, parts.motors.reachable = True, False
        self.counts["driver_lost"] += 1
        self._onlooker.say(f"the robot is lost, and tried again: {error}")
        if reconnect(parts.driver, parts.clock, self._end, self._wait):
            parts.motors.reachable = True
            self._onlooker.say("the robot answers again")
        self.counts["ticks_without_driver"] += self._pacer.resume()

    def _wait(self) -> None:
        """Packets for an agent that stands still are of no use once it goes on."""
        heard, _ = self._parts.radio.heard(self._pacer.since_start_ns())
        self.counts["packets_without_driver"] += len(heard)
        self._onlooker.wait()
