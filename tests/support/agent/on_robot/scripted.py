"""A robot without hardware: scripted driver, radio and onlooker that record their calls."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.drivers.driver import Command, Driver, DriverLost
from swarmwire.agent.on_robot.controller import Controller, RobotSensors, group_of
from swarmwire.agent.on_robot.log import TickRow
from swarmwire.agent.on_robot.loop import RobotLoop, RobotParts
from swarmwire.agent.on_robot.plan import SpeedLimits, limits_for
from swarmwire.agent.on_robot.safety import Motors, StopFlag, Watchdog
from swarmwire.agent.radios.radio import RobotRadio
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.comms.wire.radio_bridge import Pose
from tests.support.clocks import FakeClock

UTC_NS = 1_795_000_000 * NS_PER_S  # start of fake clocks
PLAYERS = Path(__file__).with_name("robot_players.py")
RATE_HZ = 10
PERIOD_NS = NS_PER_S // RATE_HZ


class DatedFakeClock(FakeClock):
    """A clock that moves only when it is slept on or told to, and knows the date."""

    set_by_ns = 0  # how far the date was moved

    def utc_ns(self) -> int:
        return UTC_NS + self.time_ns + self.set_by_ns


@dataclass(frozen=True)
class ScriptedOptions:
    gain: float = parameter(1.0, help="of nothing", at_least=0, at_most=2)


class ScriptedDriver(Driver):
    """A scripted robot; `deeds` are its calls, in order.

    `faults` has functions by the name of a call, each called once, in order, before a call; None is no fault.
    """

    options: ClassVar[type] = ScriptedOptions
    body_name: ClassVar[str] = "epuck2"

    def __init__(self, clock: DatedFakeClock, measures: tuple[str, ...] = ("proximity",), body: str = "epuck2") -> None:
        super().__init__("nowhere", load_body(body), ScriptedOptions(), clock)
        self._gives = frozenset(measures)
        self.deeds: list[Any] = []
        self.faults: dict[str, list[Callable[[], object] | None]] = {}
        self.charge = 0.75
        self.requested: frozenset[str] = frozenset()

    @property
    def measures(self) -> frozenset[str]:
        return self._gives

    def open(self) -> None:
        self._do("open", "open")

    def sense(self, sensors: frozenset[str]) -> dict[str, FloatArray]:
        self.requested = sensors
        self._do("sense", None)
        fields = {
            "proximity.value": np.zeros((1, 8)),
            "battery.charge": np.array([self.charge]),
            "battery.voltage_v": np.array([4.0]),
        }
        return {name: column for name, column in fields.items() if name.partition(".")[0] in sensors}

    def act(self, command: Command) -> None:
        self._do("act", command)

    def stop(self) -> None:
        self._do("stop", "stop")

    def counts(self) -> dict[str, int]:
        return {"driver_garbage": 2}

    def close(self) -> None:
        self._do("close", "close")

    def _do(self, call: str, deed: Any) -> None:
        faults = self.faults.get(call)
        if faults and (fault := faults.pop(0)) is not None:
            fault()
        if deed is not None:
            self.deeds.append(deed)

    @property
    def commands(self) -> list[Command]:
        return [deed for deed in self.deeds if isinstance(deed, Command)]


def lost() -> None:
    raise DriverLost("no answer")


class ScriptedRadio:
    """A radio that brings what stands in `brings`, a list of (sender, sequence, payload) a tick."""

    needs: frozenset[str] = frozenset()
    measures: tuple[str, ...] = ()

    def __init__(self, row: int = 0) -> None:
        self._row = row
        self.brings: list[list[tuple[int, int, bytes]]] = []
        self.requested_ns: list[int] = []
        self.sent: list[SentPackets] = []

    def open(self) -> None:
        pass

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        self.requested_ns.append(now_ns)
        packets = self.brings.pop(0) if self.brings else []
        n = len(packets)
        column = [np.array([packet[i] for packet in packets], np.int64) for i in (0, 1)]
        payloads = Payloads.from_rows([packet[2] for packet in packets])
        row, at = np.full(n, self._row), np.full(n, now_ns)
        return ReceivedPackets(row, *column, at, {}, np.arange(n), payloads), NO_TX_STATUSES

    def send(self, sent: SentPackets) -> None:
        self.sent.append(sent)

    def note(self, states: SparseTable, values: SparseTable) -> None:
        """There is no world."""

    def counts(self) -> dict[str, int]:
        return {"packets_sent": len(self.sent)}

    def close(self) -> None:
        pass


class Onlooking:
    """Keeps the rows and lines of the loop; after `ends_after` steps it requests the end."""

    def __init__(self, end: StopFlag) -> None:
        self._end = end
        self.rows: list[TickRow] = []
        self.lines: list[str] = []
        self.waits = 0
        self.ends_after = 0
        self.after_step: Callable[[TickRow], object] = lambda _: None

    def step(self, row: TickRow) -> None:
        self.rows.append(row)
        self.after_step(row)
        if len(self.rows) == self.ends_after:
            self._end.request("enough")

    def wait(self) -> None:
        self.waits += 1

    def report(self, line: str) -> None:
        self.lines.append(line)


class Rig:
    """A robot of scripted parts, and the loop that runs it; `run` ends after so many steps."""

    def __init__(
        self,
        agent: str,
        measures: tuple[str, ...] = ("proximity",),
        params: dict[str, Any] | None = None,
        body: str = "epuck2",
        limits: SpeedLimits | None = None,
        radio: RobotRadio | None = None,
        tracked: tuple[str, ...] = (),
        needs: tuple[str, ...] = (),
        watchdog_s: float = 0.5,
    ) -> None:
        self.clock, self.end = DatedFakeClock(), StopFlag()
        self.driver = ScriptedDriver(self.clock, measures, body)
        self.radio = radio or ScriptedRadio()
        self.pose: Pose | None = None
        group = group_of("robot-0", 0, f"{PLAYERS}:{agent}", params or {}, self.driver.body, seed=5)
        mind = Controller(group, RATE_HZ, (), limits or limits_for(self.driver.body, None, None, ""))
        readings = RobotSensors(self.driver, frozenset(needs), frozenset(tracked), lambda: self.pose)
        self.motors = Motors(self.driver)
        self.watchdog = Watchdog(watchdog_s, self.motors.stop, self.clock)
        self.onlooker = Onlooking(self.end)
        parts = RobotParts(self.driver, self.radio, mind, readings, self.motors, self.watchdog, self.clock)
        self.loop = RobotLoop(parts, RATE_HZ, self.end, self.onlooker)

    def run(self, steps: int, duration_s: float | None = None) -> list[TickRow]:
        self.onlooker.ends_after = len(self.onlooker.rows) + steps
        self.end.reason = None
        self.loop.run(duration_s)
        return self.onlooker.rows

    def takes(self, ns: int) -> Callable[[], None]:
        """A fault that only takes time."""

        def pass_time() -> None:
            self.clock.time_ns += ns

        return pass_time
