"""The connection to a Crazyflie by cflib: its URI, log variables in, set-points and parameters out."""

# pyright: basic, reportUnknownMemberType=false, reportUnknownVariableType=false

import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Event, Lock, Thread
from typing import Any

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.comms.clock import Clock, to_s
from swarmwire.comms.errors import BadInput
from swarmwire.comms.robots.crazyflie import FLYING_BIT, LOW_POWER

RADIO = re.compile(
    r"radio://(?P<radio>\d{1,9}|[0-9A-Fa-f]{10,})/(?P<channel>\d{1,3})"
    r"(/(?P<rate>250K|1M|2M)(/(?P<address>[0-9A-Fa-f]{1,10}))?)?(\?rate_limit=\d+)?"
)
OTHER = re.compile(r"(udp://[^/:]+:\d{1,5}|usb://\d+)")
MAX_CHANNEL = 125
DEFAULT_RATE, DEFAULT_ADDRESS = "2M", "E7E7E7E7E7"  # cflib/crtp/radiodriver.py
LOG_MS = 50
CLOSE_S = 0.5


@dataclass(frozen=True)
class Uri:
    """What a URI says.

    Attributes:
        target: the robot, the same for each radio that reaches it: "80/2M/E7E7E7E7E7".
        radio: the Crazyradio, by its number or serial number; empty: none.
    """

    target: str
    radio: str = ""


def parsed(uri: str) -> Uri:
    """What the URI says; BadInput for one that cflib would not take, or would take for another.

    >>> parsed("radio://1/80/2M/e7e7e7e702")
    Uri(target='80/2M/E7E7E7E702', radio='1')
    >>> parsed("udp://127.0.0.1:19850")
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
