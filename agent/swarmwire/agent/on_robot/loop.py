"""The loop of an agent on a robot: read the sensors, receive, step the agent, act and send, at the clock's pace.

`Pacer` schedules the steps; missed ticks are skipped, never repeated in a burst. `reconnect` reopens a lost driver.
`RobotLoop` pauses the agent while the robot does not answer: no step runs, and packets that arrive meanwhile are
dropped and counted.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from math import ceil
from typing import Any, Protocol

from swarmwire.agent.drivers.driver import STOP, Driver, DriverLost, MotorsOff
from swarmwire.agent.on_robot.controller import Controller, Decision, RobotSensors
from swarmwire.agent.on_robot.log import TickRow
from swarmwire.agent.on_robot.safety import Motors, StopFlag, Watchdog
from swarmwire.agent.on_robot.states import LOST, RUNNING, STOP_REQUESTED
from swarmwire.agent.radios.radio import RobotRadio
from swarmwire.comms.base.clock import NS_PER_S, Clock, DatedClock, tick_start_ns, to_ns
from swarmwire.comms.base.sentinels import NO_TICK
from swarmwire.comms.robot.packets import SentPackets

DURATION = "duration"  # reason for the end of the loop
FIRST_PAUSE_NS, MAX_PAUSE_NS = to_ns(0.2), to_ns(2.0)  # pauses between two attempts to reconnect
SENSOR_TIMEOUT_S = 3.0  # wait for a reading of every sensor, after which the agent starts without
NO_DECISION = Decision(STOP, drive=False, sent=SentPackets.none())


class Pacer:
    """Counts ticks of `rate_hz` from its start.

    A tick that begins later than a period after its time is late. The ticks that passed meanwhile are skipped, so a
    tick's number always determines its time. Two steps begin at least half a period apart; otherwise the second is
    skipped as well.

    Attributes:
        late: late ticks so far.
        skipped: ticks so far without a step, because an earlier step took too long.
    """

    def __init__(self, clock: Clock, rate_hz: int) -> None:
        self._clock, self._rate_hz = clock, rate_hz
        self._started_ns = clock.now_ns()
        self._next = 0
        self.late = self.skipped = 0

    def since_start_ns(self) -> int:
        """Return the time since the first tick."""
        return self._clock.now_ns() - self._started_ns

    def wait(self) -> tuple[int, bool]:
        """Sleep until the next tick; return its number, and True if it is late."""
        self._clock.sleep_until(self._started_ns + tick_start_ns(self._next, self._rate_hz))
        tick = max(self._next, self._newest())
        missed = tick - self._next
        self.late += missed > 0
        self.skipped += missed
        self._next = tick + 1
        if self._remaining_ns() * 2 < NS_PER_S // self._rate_hz:
            self._next += 1
            self.skipped += 1
        return tick, missed > 0

    def resume(self) -> int:
        """Continue after an intended pause; return its ticks, which count neither as late nor as skipped."""
        paused = max(0, self._newest() + 1 - self._next)
        self._next += paused
        return paused

    def _remaining_ns(self) -> int:
        """Return the time until the next tick."""
        return tick_start_ns(self._next, self._rate_hz) - self.since_start_ns()

    def _newest(self) -> int:
        """Return the newest tick that is due."""
        newest = self.since_start_ns() * self._rate_hz // NS_PER_S
        # The start of a tick is rounded down, so the tick may be due a ns earlier than the division says.
        return newest + (tick_start_ns(newest + 1, self._rate_hz) <= self.since_start_ns())


def reconnect(driver: Driver, clock: Clock, end: StopFlag, meanwhile: Callable[[], None]) -> bool:
    """Reopen a lost driver, with the motors off; return False if the end was requested before the robot answered.

    The pauses between attempts double from 0.2 s to 2 s. `meanwhile` is called several times during each.
    """
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
    """Wait for a pause; return True if it passed before the end was requested."""
    deadline_ns = clock.now_ns() + pause_ns
    while not end and (remaining_ns := deadline_ns - clock.now_ns()) > 0:
        meanwhile()
        clock.sleep_until(clock.now_ns() + min(remaining_ns, FIRST_PAUSE_NS))
    return not end


@dataclass(frozen=True)
class RobotParts:
    """The parts of a robot that the loop uses."""

    driver: Driver
    radio: RobotRadio
    controller: Controller
    sensors: RobotSensors
    motors: Motors
    watchdog: Watchdog
    clock: DatedClock


class RobotObserver(Protocol):
    """An observer of a robot's steps, whose faults do not stop the robot."""

    def step(self, row: TickRow) -> None:
        """Record a completed step."""
        ...

    def wait(self) -> None:
        """Do periodic work while no step is due or possible; called several times a second."""
        ...

    def report(self, line: str) -> None:
        """Print a message for the user."""
        ...


class RobotLoop:
    """One robot from its first step to its end.

    Attributes:
        counts: faults in the loop so far, by name.
    """

    def __init__(
        self,
        parts: RobotParts,
        rate_hz: int,
        end: StopFlag,
        observer: RobotObserver,
        extra_counts: Callable[[], dict[str, int]] = dict,
    ) -> None:
        """Keep the parts; `extra_counts` returns faults of the parts other than driver and radio."""
        self._parts, self._rate_hz, self._end, self._observer = parts, rate_hz, end, observer
        self._extra_counts = extra_counts
        self._pacer = Pacer(parts.clock, rate_hz)
        self._tick = NO_TICK
        self._leds_unknown = False  # a lost robot may have been switched off meanwhile
        self._started = self._lost = False
        self.counts = Counter[str]()

    def run(self, duration_s: float | None = None) -> None:
        """Step until the end is requested, or for `duration_s`; AgentFailed if the agent raises."""
        parts, last = self._parts, None if duration_s is None else ceil(duration_s * self._rate_hz)
        self._pacer = Pacer(parts.clock, self._rate_hz)
        while not self._end:
            tick, late = self._pacer.wait()
            if last is not None and tick >= last:
                self._end.request(DURATION)
                break
            parts.watchdog.feed()
            try:
                row = self._step(tick, late)
            except DriverLost as error:
                self._reconnect(error)
                continue
            parts.watchdog.feed()
            self._observer.step(row)

    def status(self) -> dict[str, Any]:
        """Return the state of the robot, in plain values."""
        parts = self._parts
        state = STOP_REQUESTED if parts.motors.control.stopped else LOST if self._lost else RUNNING
        return {
            "state": state,
            "tick": self._tick,
            "late_ticks": self._pacer.late,
            "watchdog_stops": parts.watchdog.stops,
            "charge": parts.sensors.charge,
            "agent_state": parts.controller.state,
            "counts": self._all_counts(),
        }

    def _all_counts(self) -> dict[str, int]:
        """Return the numbers of faults of all parts, by name, without zeros."""
        parts = self._parts
        loop_counts = {
            "skipped_ticks": self._pacer.skipped,
            "clipped_commands": parts.controller.clipped,
            "nan_commands": parts.controller.nan,
            "actuations_without_driver": parts.controller.actuations,
        }
        counts = self.counts + Counter(loop_counts)
        for part_counts in (parts.driver.counts(), parts.radio.counts(), self._extra_counts()):
            counts += Counter(part_counts)
        return dict(sorted(counts.items()))

    def _step(self, tick: int, late: bool) -> TickRow:
        parts = self._parts
        fields = parts.sensors.read()
        received, tx_status = parts.radio.received(self._pacer.since_start_ns())
        self._tick = tick
        decision = NO_DECISION
        if parts.motors.control.stopped:
            parts.motors.stop()
        elif self._may_start(tick):
            decision = parts.controller.step(tick, fields, received, tx_status)
            self._execute(decision)
        return TickRow(
            tick=tick,
            utc_ns=parts.clock.utc_ns(),
            late=late,
            pose=parts.sensors.pose,
            drive=decision.drive,
            command=decision.command,
            state=parts.controller.state,
            value=parts.controller.value,
            charge=parts.sensors.charge,
        )

    def _may_start(self, tick: int) -> bool:
        """Return True once each sensor delivered a reading, as in emulation, or the wait for them timed out."""
        self._started = self._started or self._parts.sensors.complete or tick > SENSOR_TIMEOUT_S * self._rate_hz
        return self._started

    def _execute(self, decision: Decision) -> None:
        parts = self._parts
        try:
            parts.motors.act(parts.controller.all_leds() if self._leds_unknown else decision.command)
            self._leds_unknown = False
        finally:  # a robot without motors can still send
            if len(decision.sent):
                parts.radio.send(decision.sent)
            if len(decision.states) or len(decision.values):
                parts.radio.note(decision.states, decision.values)

    def _reconnect(self, error: DriverLost) -> None:
        """Wait until the robot answers again; meanwhile the agent is paused, and its time stands still."""
        parts = self._parts
        parts.watchdog.suspend()
        self._leds_unknown = self._lost = True
        parts.motors.reachable = isinstance(error, MotorsOff)
        self.counts["driver_lost"] += 1
        self._observer.report(f"the robot is lost, and tried again: {error}")
        if reconnect(parts.driver, parts.clock, self._end, self._wait):
            parts.motors.reachable, self._lost = True, False
            self._observer.report("the robot answers again")
        self.counts["ticks_without_driver"] += self._pacer.resume()

    def _wait(self) -> None:
        """Drop the packets that arrive while the agent is paused: they would be stale afterwards."""
        received, _ = self._parts.radio.received(self._pacer.since_start_ns())
        self.counts["packets_without_driver"] += len(received)
        self._observer.wait()
