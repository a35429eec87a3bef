"""The connection to a Crazyflie by cflib, and the pilot that flies it.

A connection has a URI; log variables come in, set-points and parameters go out. A Crazyflie levels out when set-points
cease for half a second, and falls after two seconds: so the pilot's thread sends them 20 times a second, also while the
agent is late.
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
HOLD_S = 2.0  # it hovers so long without a command, then lands
CLEAR = 0.8  # of its height: below, it moves neither sideways nor round
TOUCHED_M, MAX_TOUCH_S = 0.05, 2.0  # the motors go off below this height, or so long after the set-point is down


@dataclass(frozen=True)
class Uri:
    """What a URI says.

    Attributes:
        target: the robot, the same for each radio that reaches it: "80/2M/E7E7E7E7E7".
        radio: the Crazyradio, by its number or serial number; empty: none.
    """

    target: str
    radio: str = ""


def parse_uri(uri: str) -> Uri:
    """What the URI says; BadInput for one that cflib would not take, or would take for another.

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
        lost: why the connection ended; empty: it has not.
    """

    def __init__(self, uri: str, blocks: Sequence[Sequence[str]], connect_s: float, clock: Clock) -> None:
        """Connect and have the variables of each block logged; DriverLost if that takes longer."""
        import cflib.crtp
        from cflib.crazyflie import Crazyflie

        # Tables are not cached: agents of several processes would write the same files. cflib warns of that, and logs
        # a traceback of each failure, which the callbacks below report.
        logging.getLogger("cflib").setLevel(logging.CRITICAL)
        if not cflib.crtp.CLASSES:
            cflib.crtp.init_drivers()
        self.lost = ""
        self._clock, self._lock = clock, Lock()
        self._values: dict[str, float] = {}
        self._heard_ns = clock.now_ns()
        ready = Event()
        self._cf: Any = Crazyflie()
        self._cf.packet_received.add_callback(self._heard)
        self._cf.fully_connected.add_callback(lambda _: ready.set())
        for ended in (self._cf.connection_failed, self._cf.connection_lost):
            ended.add_callback(self._ended)
            ended.add_callback(lambda *_: ready.set())
        self._cf.open_link(uri)
        if not ready.wait(connect_s) or self.lost:
            self.close()
            raise DriverLost(f"no Crazyflie answers at {uri}: {self.lost or 'time is over'}")
        self._log(blocks)

    @property
    def silent_s(self) -> float:
        """Time since the newest packet; cflib asks for one ten times a second."""
        return to_s(self._clock.now_ns() - self._heard_ns)

    def values(self) -> dict[str, float]:
        """The newest log variables that have arrived, by name."""
        with self._lock:
            return dict(self._values)

    def hover(self, forward_mps: float, left_mps: float, turn_degps: float, height_m: float) -> None:
        """Send a set-point."""
        self._cf.commander.send_hover_setpoint(forward_mps, left_mps, turn_degps, height_m)

    def off(self) -> None:
        """Motors off, until the next set-point."""
        self._cf.commander.send_stop_setpoint()
        self._cf.commander.send_notify_setpoint_stop()

    def height_m(self) -> float:
        """The newest estimate; 0 before the first."""
        return self.values().get("stateEstimate.z", 0.0)

    def has(self, bit: int) -> bool:
        """Whether a bit of the supervisor's newest state is set."""
        return bool(int(self.values().get("supervisor.info", 0)) >> bit & 1)

    def is_low(self) -> bool:
        """Whether the firmware calls the battery low: for five seconds below `pm.lowVoltage`."""
        return self.values().get("pm.state") == LOW_POWER

    def emergency_stop(self) -> None:
        """Motors off, and, unless it stands on the floor, until the Crazyflie is switched on again."""
        self.off()
        if self.has(FLYING_BIT) or "supervisor.info" not in self.values():
            self._cf.supervisor.send_emergency_stop()

    def arm(self) -> None:
        """Let the motors run, on a Crazyflie that does not arm itself."""
        self._cf.supervisor.send_arming_request(True)

    def set(self, name: str, value: float) -> None:
        """Set a parameter."""
        self._cf.param.set_value(name, value)

    def close(self) -> None:
        """End the connection; cflib's threads end up to two seconds later, when the radio is free already."""
        closing = Thread(target=self._cf.close_link, name="crazyflie closes", daemon=True)
        closing.start()
        closing.join(CLOSE_S)

    def _log(self, blocks: Sequence[Sequence[str]]) -> None:
        from cflib.crazyflie.log import LogConfig

        for i, names in enumerate(blocks):
            config = LogConfig(f"swarmwire-{i}", LOG_MS)
            for name in names:
                config.add_variable(name)
            config.data_received_cb.add_callback(self._logged)
            try:
                self._cf.log.add_config(config)
            except KeyError as error:
                self.close()
                raise DriverLost(f"the Crazyflie's firmware does not log {error}") from error
            config.start()

    def _logged(self, _: int, values: dict[str, float], __: object) -> None:
        with self._lock:
            self._values.update(values)

    def _heard(self, _: object) -> None:
        self._heard_ns = self._clock.now_ns()

    def _ended(self, _: str, why: str) -> None:
        self.lost = str(why).splitlines()[0] or "the link is lost"


class Pilot:
    """Flies one Crazyflie at one height, from its first command to its landing.

    A low battery lands it, and no command takes it off again.
    """

    def __init__(self, link: CrazyflieLink, height_m: float, climb_mps: float, from_m: float, clock: Clock) -> None:
        """`from_m` is the height at which it is now; above the floor it hovers, until `HOLD_S` is over."""
        self._link, self._clock = link, clock
        self._cruise_m, self._step_m, self._height_m = height_m, climb_mps / RATE_HZ, from_m
        self._command, self._held_ns = STOP, clock.now_ns()
        self._up, self._lands, self._ended = from_m > 0.0, False, False
        self._touching = 0  # steps with the set-point on the floor
        self._lock = Lock()
        self._thread = Thread(target=self._fly, name="crazyflie set-points", daemon=True)
        self._thread.start()

    def command(self, command: Command) -> None:
        """Fly like this from now on; take off first."""
        with self._lock:
            if not self._lands:
                self._command, self._held_ns, self._up = command, 0, True

    def hold(self) -> None:
        """Hover on the spot at once; land unless a command comes within `HOLD_S`."""
        with self._lock:
            self._command, self._held_ns = STOP, self._held_ns or self._clock.now_ns()
            if self._up and not self._ended:
                self._send()

    def cut(self) -> None:
        """Motors off for good."""
        with self._lock:
            self._ended = True
            self._link.emergency_stop()

    def end(self, *, lands: bool) -> None:
        """Send no more set-points; if it `lands`, return when the motors are off."""
        with self._lock:
            self._lands = True
            self._ended |= not lands
        self._thread.join()

    def _fly(self) -> None:
        next_ns = self._clock.now_ns()
        while True:
            next_ns = max(next_ns + NS_PER_S // RATE_HZ, self._clock.now_ns())
            self._clock.sleep_until(next_ns)
            with self._lock:
                self._lands = self._lands or self._link.is_low()
                if self._ended or (self._lands and not self._up):
                    return
                if self._up:
                    self._step()

    def _step(self) -> None:
        held = self._held_ns and self._clock.now_ns() - self._held_ns > to_ns(HOLD_S)
        target_m = 0.0 if self._lands or held else self._cruise_m
        change_m = target_m - self._height_m
        self._height_m = max(self._height_m + min(max(change_m, -self._step_m), self._step_m), 0.0)
        self._touching = self._touching + 1 if self._height_m <= 0.0 and target_m == 0.0 else 0
        touched = self._link.height_m() < TOUCHED_M or self._touching > MAX_TOUCH_S * RATE_HZ
        if self._touching and touched:
            self._up = False
            self._link.off()
        else:
            self._send()

    def _send(self) -> None:
        now = self._command if not self._lands and self._link.height_m() >= CLEAR * self._cruise_m else STOP
        self._link.hover(now.linear_mps, now.lateral_mps, degrees(now.angular_radps), self._height_m)
