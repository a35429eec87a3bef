"""One emulated Crazyflie: its answers to CRTP packets, its logs and its flight, without I/O and clock."""

from collections import Counter
from collections.abc import Callable
from math import degrees, nan, radians
from struct import calcsize, unpack_from

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.crazyflie import (
    ARMED_BIT,
    CAN_FLY_BIT,
    DIRECTIONS_DEG,
    FLYING_BIT,
    G_MPS2,
    LOW_POWER,
    NO_RANGE_MM,
    SOLID_COLOUR,
    to_mm,
    turned,
    yaw_of,
)
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.world.gateways.crazyflie.crtp import CrtpPacket, Errno, Port, decoded
from swarmwire.world.gateways.crazyflie.flight import OFF, Flight, SupervisorState, setpoint_of
from swarmwire.world.gateways.crazyflie.high_level import HighLevelCommander
from swarmwire.world.gateways.crazyflie.variables import VARIABLES, Logs, Parameters

PROTOCOL_VERSION = 12  # crtp.h
FIRMWARE, DEVICE = b"emulated", b"CF21"
GREETING = b"Bitcraze Crazyflie".ljust(30, b"\0")
FADE = 14  # the LED ring's effect (ledring12.c)
SETTLED = 1e-5  # variance of the estimate, m^2: cflib waits until it no longer changes
LOW_BATTERY_MS = 5000  # pm_stm32f4.c: time below pm.lowVoltage
LINK_MS = 1000  # radiolink.c: time after which a silent client is disconnected (RADIO_ACTIVITY_TIMEOUT_MS)
INFO = CrtpPacket(Port.LINK, 3, b"")  # the null packet


class EmulatedCrazyflie:
    """A Crazyflie that has just been switched on.

    Attributes:
        flight: its position and motion.
    """

    def __init__(self, body: Body, counts: Counter[str]) -> None:
        self.flight, self._logs, self._counts = Flight(), Logs(), counts
        decks = {
            "deck.bcMultiranger": body.scan is not None,
            "deck.bcFlow2": "flow" in body.sensors,
            "deck.bcZRanger2": "flow" in body.sensors,
            "deck.bcLedRing": body.led_count > 0,
            "deck.bcLighthouse4": "positioning" in body.sensors,
        }
        self._parameters = Parameters(decks, self._parameter_written)
        self._high_level = HighLevelCommander(self.flight, self._parameters)
        self._values = dict.fromkeys(VARIABLES, 0.0)
        self._now_ms = self._charged_ms = self._packet_ms = 0
        self._moved_ms: int | None = None
        self._locked_reported = False
        self._answers: dict[int, Callable[[int, bytes], CrtpPacket | None]] = {
            Port.PARAM: lambda channel, data: self._reply(Port.PARAM, channel, self._parameters.answer(channel, data)),
            Port.LOG: lambda channel, data: self._reply(
                Port.LOG, channel, self._logs.answer(channel, data, self._now_ms)
            ),
            Port.LINK: self._link,
            Port.PLATFORM: self._platform,
            Port.MEMORY: lambda channel, data: self._reply(
                Port.MEMORY, channel, self._high_level.memory.answer(channel, data)
            ),
            Port.COMMANDER: self._attitude,
            Port.SETPOINT: self._setpoint,
            Port.HIGH_LEVEL: self._plan,
            Port.LOCALIZATION: self._localization,
            Port.SUPERVISOR: self._supervisor,
        }

    @property
    def colour(self) -> int:
        """Colour of the LED ring, 0xRRGGBB: the solid colour, or the target of a fade; other effects are dark."""
        effect = self._parameters["ring.effect"]
        if effect == FADE:
            return int(self._parameters["ring.fadeColor"]) & 0xFFFFFF
        if effect != SOLID_COLOUR:
            return 0
        red, green, blue = (int(self._parameters[f"ring.solid{name}"]) for name in ("Red", "Green", "Blue"))
        return red << 16 | green << 8 | blue

    def receive(self, datagram: bytes) -> bytes | None:
        """Return the answer to a datagram, or None; unsupported requests are counted."""
        try:
            packet = decoded(datagram)
        except BadFrame as bad:
            self._counts[bad.fault] += 1
            return None
        self._packet_ms = self._now_ms
        answer = self._answers.get(packet.port)
        if answer is None:
            self._counts["unknown_ports"] += 1
            return None
        reply = answer(packet.channel, packet.data)
        return None if reply is None else reply.encoded()

    def sense(self, time_ns: int, row: dict[str, FloatArray]) -> list[bytes]:
        """Update with readings, "sensor.field" -> () or (width,), and return the datagrams that are due."""
        now_ms = time_ns // 1_000_000
        self.flight.estimate.update(row, self.flight.motion, 0.001 * (now_ms - self._now_ms))
        self._now_ms = now_ms
        self._fill(row)
        is_connected = now_ms - self._packet_ms < LINK_MS
        logged = self._logs.due(now_ms, self._values, is_connected=is_connected)
        sent = [CrtpPacket(Port.LOG, Logs.DATA, data) for data in logged]
        if self.flight.state is SupervisorState.LOCKED and not self._locked_reported:
            self._locked_reported = True
            sent.append(CrtpPacket(Port.CONSOLE, 0, b"SUP: Locked, reboot required\n"))
        return [packet.encoded() for packet in sent]

    def fly(self) -> None:
        """Follow the set-points up to the time of the newest readings."""
        elapsed_ms = 0 if self._moved_ms is None else self._now_ms - self._moved_ms
        self._moved_ms = self._now_ms
        self.flight.step(self._now_ms, 0.001 * elapsed_ms)

    def _reply(self, port: int, channel: int, data: bytes | None) -> CrtpPacket | None:
        return None if data is None else CrtpPacket(port, channel, data)

    def _refuse(self, count: str) -> None:
        self._counts[count] += 1

    def _link(self, channel: int, data: bytes) -> CrtpPacket | None:
        """Answer on the channels for echo, source, sink, and the null packet of a scan."""
        return (CrtpPacket(Port.LINK, 0, data), CrtpPacket(Port.LINK, 1, GREETING), None, INFO)[channel]

    def _platform(self, channel: int, data: bytes) -> CrtpPacket | None:
        if channel == 1 and data[:1] in (b"\0", b"\1", b"\2"):
            answer = (PROTOCOL_VERSION.to_bytes(4, "little"), FIRMWARE, DEVICE)[data[0]]
            return CrtpPacket(Port.PLATFORM, 1, data[:1] + answer)
        if channel == 0 and data[:1] in (b"\1", b"\2"):  # arming and recovery requests of older clients
            return self._supervisor(1, data)
        self._refuse("platform_commands_refused")
        return None

    def _attitude(self, channel: int, data: bytes) -> None:
        """Handle roll, pitch, yaw rate and thrust: only 0 thrust, with which cflib also closes its link."""
        if len(data) < calcsize("<fffH") or unpack_from("<fffH", data)[3] > 0:
            self._refuse("attitudes_refused")
            return
        self.flight.set(OFF, self._now_ms)
        self.flight.relax()

    def _setpoint(self, channel: int, data: bytes) -> None:
        if channel == 1:
            self.flight.relax()
            return
        setpoint = setpoint_of(data)
        if setpoint is None:
            self._refuse("setpoints_refused")
        else:
            self.flight.set(setpoint, self._now_ms)

    def _plan(self, channel: int, data: bytes) -> CrtpPacket | None:
        result = self._high_level.command(data, self._now_s)
        if result is not Errno.OK:
            self._refuse("plans_refused")
        return CrtpPacket(Port.HIGH_LEVEL, channel, data[:3].ljust(3, b"\0") + bytes([result]))

    def _localization(self, channel: int, data: bytes) -> None:
        """Handle an external position or pose, used without positioning, and older emergency stops."""
        if channel == 1 and data[:1] in (b"\3", b"\4"):
            self._supervisor(1, data)
        elif channel == 0 and len(data) == calcsize("<fff"):
            self._reset_estimate(*unpack_from("<ff", data), self.flight.estimate.yaw_rad)
        elif channel == 1 and data[:1] == b"\x08" and len(data) == calcsize("<B7f"):
            x, y, _, *attitude = unpack_from("<7f", data, 1)
            self._reset_estimate(x, y, yaw_of((attitude[0], attitude[1], attitude[2], attitude[3])))
        else:
            self._refuse("localization_refused")

    def _reset_estimate(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        if np.isfinite([x_m, y_m, yaw_rad]).all():
            self.flight.estimate.reset(x_m, y_m, yaw_rad)

    def _supervisor(self, channel: int, data: bytes) -> CrtpPacket | None:
        info, command = self.flight.info(self._now_s), data[0] if data else 0
        armed = info >> ARMED_BIT & 1
        if channel == 0 and 1 <= command <= 0x0B:
            return CrtpPacket(Port.SUPERVISOR, 0, bytes([command | 0x80, info >> command - 1 & 1]))
        if channel == 0 and command == 0x0C:
            return CrtpPacket(Port.SUPERVISOR, 0, bytes([command | 0x80]) + info.to_bytes(2, "little"))
        if channel == 1 and command == 3:
            self.flight.emergency_stop()
        elif channel == 1 and command == 4:
            self.flight.feed_watchdog(self._now_ms)
        elif channel == 1 and command == 1:  # the Crazyflie arms itself, and refuses to disarm
            return CrtpPacket(Port.SUPERVISOR, 1, bytes([0x81, int(bool(armed) == (data[1:2] != b"\0")), armed]))
        elif channel == 1 and command == 2:
            return CrtpPacket(Port.SUPERVISOR, 1, bytes([0x82, armed, armed]))
        return None

    def _parameter_written(self, name: str) -> None:
        value = self._parameters[name]
        if name == "kalman.resetEstimation" and value:
            x, y, yaw = (self._parameters[f"kalman.initial{axis}"] for axis in ("X", "Y", "Yaw"))
            self.flight.estimate.reset(x, y, yaw)
        elif name == "stabilizer.stop" and value:
            self.flight.emergency_stop()
        elif name == "ring.effect" and value not in (0, SOLID_COLOUR, FADE):
            self._refuse("ring_effects_not_shown")

    @property
    def _now_s(self) -> float:
        return 0.001 * self._now_ms

    def _fill(self, row: dict[str, FloatArray]) -> None:
        """Update the log variables; a lost reading leaves them unchanged."""
        flight, estimate = self.flight, self.flight.estimate
        vx, vy = turned(*estimate.body_mps, estimate.yaw_rad)
        x, y, z, yaw = estimate.x_m, estimate.y_m, flight.height_m, degrees(estimate.yaw_rad)
        target = flight.setpoint.position_m or (0.0, 0.0)
        info = flight.info(self._now_s)
        logged = {
            **_named("stateEstimate", x=x, y=y, z=z, vx=vx, vy=vy, vz=flight.climb_mps, yaw=yaw),
            **_named("stabilizer", yaw=yaw, thrust=36000.0 if flight.setpoint.flies else 0.0),
            **_named("kalman", stateX=x, stateY=y, stateZ=z, varPX=SETTLED, varPY=SETTLED, varPZ=SETTLED),
            **_named("ctrltarget", x=target[0], y=target[1], z=flight.setpoint.height_m or 0.0),
            **_named("controller", yaw=degrees(flight.setpoint.heading_rad or 0.0)),
            **_named("range", up=NO_RANGE_MM, zrange=1000.0 * z),
            **_named("sys", canfly=info >> CAN_FLY_BIT & 1, isFlying=info >> FLYING_BIT & 1),
            "supervisor.info": info,
            "acc.z": 1.0,
        }
        self._values.update({name: value for name, value in logged.items() if np.isfinite(value)})
        self._fill_sensors(row)

    def _fill_sensors(self, row: dict[str, FloatArray]) -> None:
        if "scan.range_m" in row and not np.isnan(row["scan.range_m"]).any():
            ranges = dict(zip(DIRECTIONS_DEG, to_mm(row["scan.range_m"]), strict=True))
            self._values.update(_named("range", **ranges))
        scaled = {
            "imu.forward_mps2": ("acc.x", 1.0 / G_MPS2),
            "imu.left_mps2": ("acc.y", 1.0 / G_MPS2),
            "imu.turn_radps": ("gyro.z", 1.0 / radians(1.0)),
            "battery.voltage_v": ("pm.vbat", 1.0),
            "battery.charge": ("pm.batteryLevel", 100.0),
        }
        for field, (name, scale) in scaled.items():
            if field in row and np.isfinite(row[field]):
                self._values[name] = scale * float(row[field])
        is_low = float(row.get("battery.voltage_v", nan)) <= self._parameters["pm.lowVoltage"]  # False for nan
        if not is_low:
            self._charged_ms = self._now_ms
        self._values["pm.state"] = LOW_POWER if self._now_ms - self._charged_ms > LOW_BATTERY_MS else 0


def _named(group: str, **values: float) -> dict[str, float]:
    return {f"{group}.{name}": value for name, value in values.items()}
