"""The connection to a Crazyflie by cflib, and the pilot that flies it.

A connection has a URI; it receives log variables, and sends set-points and parameters. A Crazyflie levels out half a
second after the last set-point, and falls after two seconds. Therefore the pilot's thread sends 20 set-points a second,
also while the agent is late.
"""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownLambdaType=false

import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from threading import Event, Lock, Thread
from typing import Any

from swarmwire.agent.drivers.driver import STOP, Command, DriverLost
from swarmwire.comms.base.clock import NS_PER_S, Clock, to_ns, to_s
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.crazyflie import FLYING_BIT, LOW_POWER

RADIO = re.compile(
    r"radio://(?P<radio>\d{1,9}|[0-9A-Fa-f]{10,})/(?P<channel>\d{1,3})"
    r"(/(?P<rate>250K|1M|2M)(/(?P<address>[0-9A-Fa-f]{1,10}))?)?(\?rate_limit=\d+)?"
)
OTHER = re.compile(r"(udp://[^/:]+:\d{1,5}|usb://\d+)")
MAX_CHANNEL = 125
DEFAULT_RATE, DEFAULT_ADDRESS = "2M", "E7E7E7E7E7"  # cflib/crtp/radiodriver.py
LOG_MS = 50
CLOSE_S = 0.5
RATE_HZ = 20
HOVER_S = 2.0  # time from a stop to the landing, unless a command follows
CLEAR_SHARE = 0.8  # share of the cruise height below which the robot only climbs or sinks
LANDED_M = 0.05  # estimated height below which a landing ends with the motors off
MAX_TOUCHDOWN_S = 2.0  # the motors go off this long after the set-point reached the floor, at any estimated height


@dataclass(frozen=True)
class Uri:
    """A robot by the URI of its connection.

    Attributes:
        target: unique text for the robot, the same for each Crazyradio that reaches it: "80/2M/E7E7E7E7E7".
        radio: number or serial number of the Crazyradio; empty: none.
    """

    target: str
    radio: str = ""


def parse_uri(uri: str) -> Uri:
    """Parse a URI; BadInput for one that cflib would refuse or misread.

    >>> parse_uri("radio://1/80/2M/e7e7e7e702")
    Uri(target='80/2M/E7E7E7E702', radio='1')
    >>> parse_uri("udp://127.0.0.1:19850")
    Uri(target='udp://127.0.0.1:19850', radio='')
    """
    radio = RADIO.fullmatch(uri)
    if radio and int(radio["channel"]) <= MAX_CHANNEL:
        address = (radio["address"] or DEFAULT_ADDRESS).upper().rjust(10, "0")
        return Uri(f"{int(radio['channel'])}/{radio['rate'] or DEFAULT_RATE}/{address}", radio["radio"].upper())
    if OTHER.fullmatch(uri):
        return Uri(uri)
    expected = f'expected a URI of cflib, "radio://0/80/2M/E7E7E7E7E7" or "udp://host:port"; got {uri!r}'
    raise BadInput("driver crazyflie", "address", expected)


class CrazyflieLink:
    """One connection; any thread may call it.

    Attributes:
        fault: the reason why the connection ended; empty while it is up.
    """

    def __init__(self, uri: str, blocks: Sequence[Sequence[str]], connect_s: float, clock: Clock) -> None:
        """Connect, and start the log of each block of variables; DriverLost if that takes longer than `connect_s`."""
        import cflib.crtp
        from cflib.crazyflie import Crazyflie

        # Without a cache of tables, whose files agents of several processes would all write. cflib warns of that, and
        # logs a traceback of each failure, which the callbacks below report.
        logging.getLogger("cflib").setLevel(logging.CRITICAL)
        if not cflib.crtp.CLASSES:
            cflib.crtp.init_drivers()
        self.fault = ""
        self._clock, self._lock = clock, Lock()
        self._values: dict[str, float] = {}
        self._received_ns = clock.now_ns()  # time of the newest packet
        ready = Event()
        self._cf: Any = Crazyflie()
        self._cf.packet_received.add_callback(self._on_packet)
        self._cf.fully_connected.add_callback(lambda _: ready.set())
        for connection_end in (self._cf.connection_failed, self._cf.connection_lost):
            connection_end.add_callback(self._on_end)
            connection_end.add_callback(lambda *_: ready.set())
        self._cf.open_link(uri)
        if not ready.wait(connect_s) or self.fault:
            self.close()
            raise DriverLost(f"no Crazyflie answers at {uri}: {self.fault or 'time is over'}")
        self._start_log(blocks)

    @property
    def silent_s(self) -> float:
        """Time since the newest packet; cflib requests ten a second."""
        return to_s(self._clock.now_ns() - self._received_ns)

    def values(self) -> dict[str, float]:
        """Return the newest log variables, by name."""
        with self._lock:
            return dict(self._values)

    def send_setpoint(self, forward_mps: float, left_mps: float, turn_degps: float, height_m: float) -> None:
        """Send a set-point of speeds and height."""
        self._cf.commander.send_hover_setpoint(forward_mps, left_mps, turn_degps, height_m)

    def motors_off(self) -> None:
        """Switch the motors off until the next set-point."""
        self._cf.commander.send_stop_setpoint()
        self._cf.commander.send_notify_setpoint_stop()

    def height_m(self) -> float:
        """Return the newest estimate of the height; 0 before the first."""
        return self.values().get("stateEstimate.z", 0.0)

    def is_set(self, bit: int) -> bool:
        """Return True if the bit of the supervisor's newest state is set."""
        return bool(int(self.values().get("supervisor.info", 0)) >> bit & 1)

    def is_low(self) -> bool:
        """Return True if the firmware reports a low battery: below `pm.lowVoltage` for five seconds."""
        return self.values().get("pm.state") == LOW_POWER

    def emergency_stop(self) -> None:
        """Switch the motors off; in the air, lock the Crazyflie until it is switched off and on."""
        self.motors_off()
        if self.is_set(FLYING_BIT) or "supervisor.info" not in self.values():
            self._cf.supervisor.send_emergency_stop()

    def arm(self) -> None:
        """Let the motors run, on a Crazyflie that does not arm itself."""
        self._cf.supervisor.send_arming_request(True)

    def set(self, name: str, value: float) -> None:
        """Set a parameter."""
        self._cf.param.set_value(name, value)

    def close(self) -> None:
        """End the connection. cflib's threads end up to two seconds later; the radio is free before."""
        closing = Thread(target=self._close, name="crazyflie closes", daemon=True)
        closing.start()
        closing.join(CLOSE_S)

    def _close(self) -> None:
        self._cf.link_statistics.stop()  # before close_link, which would take the link from a ping that is being sent
        self._cf.close_link()

    def _start_log(self, blocks: Sequence[Sequence[str]]) -> None:
        from cflib.crazyflie.log import LogConfig

        for i, names in enumerate(blocks):
            config = LogConfig(f"swarmwire-{i}", LOG_MS)
            for name in names:
                config.add_variable(name)
            config.data_received_cb.add_callback(self._on_log)
            try:
                self._cf.log.add_config(config)
            except KeyError as error:
                self.close()
                raise DriverLost(f"the Crazyflie's firmware does not log {error}") from error
            config.start()

    def _on_log(self, _: int, values: dict[str, float], __: object) -> None:
        with self._lock:
            self._values.update(values)

    def _on_packet(self, _: object) -> None:
        self._received_ns = self._clock.now_ns()

    def _on_end(self, _: str, reason: str) -> None:
        self.fault = str(reason).splitlines()[0] or "the link is lost"


class Pilot:
    """Flies one Crazyflie at one height, from the first command to the landing.

    A low battery lands the robot, and later commands do not take off again.
    """

    def __init__(self, link: CrazyflieLink, height_m: float, climb_mps: float, start_m: float, clock: Clock) -> None:
        """Start at the present height `start_m`; a robot above the floor hovers for `HOVER_S`, then lands."""
        self._link, self._clock = link, clock
        self._cruise_m, self._step_m, self._height_m = height_m, climb_mps / RATE_HZ, start_m
        self._command, self._stopped_ns = STOP, clock.now_ns()  # time of the stop; 0 after a command
        self._airborne, self._landing, self._ended = start_m > 0.0, False, False
        self._floor_steps = 0  # consecutive steps with the set-point on the floor
        self._lock = Lock()
        self._thread = Thread(target=self._fly, name="crazyflie set-points", daemon=True)
        self._thread.start()

    def command(self, command: Command) -> None:
        """Execute this command from now on; take off first."""
        with self._lock:
            if not self._landing:
                self._command, self._stopped_ns, self._airborne = command, 0, True

    def hover(self) -> None:
        """Hover on the spot at once; land unless a command comes within `HOVER_S`."""
        with self._lock:
            self._command, self._stopped_ns = STOP, self._stopped_ns or self._clock.now_ns()
            if self._airborne and not self._ended:
                self._send()

    def emergency_stop(self) -> None:
        """Switch the motors off permanently."""
        with self._lock:
            self._ended = True
            self._link.emergency_stop()

    def end(self, *, lands: bool) -> None:
        """Send no more set-points; with `lands`, land first and return when the motors are off."""
        with self._lock:
            self._landing = True
            self._ended |= not lands
        self._thread.join()

    def _fly(self) -> None:
        next_ns = self._clock.now_ns()
        while True:
            next_ns = max(next_ns + NS_PER_S // RATE_HZ, self._clock.now_ns())
            self._clock.sleep_until(next_ns)
            with self._lock:
                self._landing = self._landing or self._link.is_low()
                if self._ended or (self._landing and not self._airborne):
                    return
                if self._airborne:
                    self._step()

    def _step(self) -> None:
        hover_ended = self._stopped_ns and self._clock.now_ns() - self._stopped_ns > to_ns(HOVER_S)
        target_m = 0.0 if self._landing or hover_ended else self._cruise_m
        change_m = target_m - self._height_m
        self._height_m = max(self._height_m + min(max(change_m, -self._step_m), self._step_m), 0.0)
        self._floor_steps = self._floor_steps + 1 if self._height_m <= 0.0 and target_m == 0.0 else 0
        landed = self._link.height_m() < LANDED_M or self._floor_steps > MAX_TOUCHDOWN_S * RATE_HZ
        if self._floor_steps and landed:
            self._airborne = False
            self._link.motors_off()
        else:
            self._send()

    def _send(self) -> None:
        is_clear = self._link.height_m() >= CLEAR_SHARE * self._cruise_m
        command = self._command if is_clear and not self._landing else STOP
        turn_degps = degrees(command.angular_radps)
        self._link.send_setpoint(command.linear_mps, command.lateral_mps, turn_degps, self._height_m)
