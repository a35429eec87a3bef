"""When the steps of an agent on a robot begin: by the clock, and never in a burst to catch up."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from math import ceil
from typing import Any, Protocol

from swarmwire.agent.drivers.driver import STOP, Driver, DriverLost
from swarmwire.agent.on_robot.controller import Controller, Decision, RobotSensors
from swarmwire.agent.on_robot.log import TickRow
from swarmwire.agent.on_robot.safety import STOP_REQUESTED, Motors, StopFlag, Watchdog
from swarmwire.agent.radios.radio import RobotRadio
from swarmwire.comms.clock import NS_PER_S, Clock, DatedClock, tick_start_ns, to_ns
from swarmwire.comms.packets import SentPackets


class Pacer:
    """Counts ticks of `rate_hz` from its start.

    A tick that begins later than a period after its time is late; those that went by meanwhile are skipped, so the
    number of the tick always tells the time. Two steps begin at least half a period apart: one that would not is
    skipped, too.

    Attributes:
        late: late ticks so far.
        skipped: ticks that went by without a step, since one took too long.
    """

    def __init__(self, clock: Clock, rate_hz: int) -> None:
        self._clock, self._rate_hz = clock, rate_hz
        self._started_ns = clock.now_ns()
        self._next = 0
        self.late = self.skipped = 0

    def since_start_ns(self) -> int:
        """Time since the first tick."""
        return self._clock.now_ns() - self._started_ns

    def wait(self) -> tuple[int, bool]:
        """Sleep until the next tick; its number, and whether it is late."""
        self._clock.sleep_until(self._started_ns + tick_start_ns(self._next, self._rate_hz))
        tick = max(self._next, self._newest())
        gone = tick - self._next
        self.late += gone > 0
        self.skipped += gone
        self._next = tick + 1
        if self._left_ns() * 2 < NS_PER_S // self._rate_hz:
            self._next += 1
            self.skipped += 1
        return tick, gone > 0

    def resume(self) -> int:
        """Go on after a pause that was meant: how many ticks it took, which are neither late nor skipped."""
        gone = max(0, self._newest() + 1 - self._next)
        self._next += gone
        return gone

    def _left_ns(self) -> int:
        """Time until the next tick."""
        return tick_start_ns(self._next, self._rate_hz) - self.since_start_ns()

    def _newest(self) -> int:
        """The newest tick whose time has come."""
        newest = self.since_start_ns() * self._rate_hz // NS_PER_S
        # The start of a tick is rounded down, so that it may be due a ns before the division says so.
        return newest + (tick_start_ns(newest + 1, self._rate_hz) <= self.since_start_ns())


# --- How a robot that was lost is found again: tried with pauses that grow, until it answers or nobody wants it.


FIRST_PAUSE_NS, MAX_PAUSE_NS = to_ns(0.2), to_ns(2.0)


def reconnect(driver: Driver, clock: Clock, end: StopFlag, meanwhile: Callable[[], None]) -> bool:
    """Open the driver, motors off first of all; False if the end came before. `meanwhile` is called several times."""
    pause_ns = FIRST_PAUSE_NS
    while _paused(pause_ns, clock, end, meanwhile):
        try:
            driver.open()
            driver.stop()
        except DriverLost:
            pause_ns = min(2 * pause_ns, MAX_PAUSE_NS)
        else:
            return True
    return False


def _paused(pause_ns: int, clock: Clock, end: StopFlag, meanwhile: Callable[[], None]) -> bool:
    """Whether the pause is over, rather than the end there."""
    until_ns = clock.now_ns() + pause_ns
    while not end and (left_ns := until_ns - clock.now_ns()) > 0:
        meanwhile()
        clock.sleep_until(clock.now_ns() + min(left_ns, FIRST_PAUSE_NS))
    return not end


# --- The loop of an agent on a robot: sense, hear, decide, act, send, at the pace of the clock.


RUNNING, LOST = "running", "driver lost"
DURATION = "duration"  # why it ended
BLIND_S = 3.0  # an agent begins after so long, even if one of its senses has never been read
NOTHING = Decision(STOP, drive=False, sent=SentPackets.none())


@dataclass(frozen=True)
class RobotParts:
    """What a robot is made of, as the loop needs it."""

    driver: Driver
    radio: RobotRadio
    mind: Controller
    readings: RobotSensors
    motors: Motors
    watchdog: Watchdog
    clock: DatedClock


class RobotObserver(Protocol):
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
        end: StopFlag,
        onlooker: RobotObserver,
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
        state = STOP_REQUESTED if parts.motors.control.stopped else RUNNING if parts.motors.reachable else LOST
        return {
            "state": state,
            "tick": self._tick,
            "late_ticks": self._pacer.late,
            "watchdog_stops": parts.watchdog.stops,
            "charge": parts.readings.charge,
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
        fields = parts.readings.read()
        received, tx_status = parts.radio.received(self._pacer.since_start_ns())
        self._tick = tick
        decision = NOTHING
        if parts.motors.control.stopped:
            parts.motors.stop()
        elif self._begins(tick):
            decision = parts.mind.step(tick, fields, received, tx_status)
            self._do(decision)
        utc_ns, told = parts.clock.utc_ns(), (parts.mind.state, parts.mind.value, parts.readings.charge)
        return TickRow(tick, utc_ns, late, parts.readings.pose, decision.drive, decision.command, *told)

    def _begins(self, tick: int) -> bool:
        """Whether the agent is stepped: in emulation none begins before each of its senses was read."""
        self._begun = self._begun or self._parts.readings.complete or tick > BLIND_S * self._rate_hz
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
        received, _ = self._parts.radio.received(self._pacer.since_start_ns())
        self.counts["packets_without_driver"] += len(received)
        self._onlooker.wait()
