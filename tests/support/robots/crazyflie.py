"""The Crazyflie's rig: cflib over UDP, in a world that ticks on while a test waits."""

from collections.abc import Generator
from contextlib import contextmanager
from threading import Event, Lock, Thread
from typing import ClassVar

import cflib.crtp
import numpy as np

from swarmwire.agent.drivers.crazyflie import CrazyflieDriver, CrazyflieOptions
from swarmwire.agent.drivers.driver import Driver
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.robot.bodies.body import Body, body_from
from swarmwire.world.gateways.crazyflie import CrazyflieGateway
from swarmwire.world.gateways.gateway import Gateway
from tests.support.robots.rig import Commands, Fields, Rig

TICK_NS = NS_PER_S // 50
ROUNDED_MM = 0.5e-3 + 1e-6
SINGLE = 1e-5  # float32 of degrees, of g and of m, whatever the sensor's range
QUICK_MPS = 1.0  # of take-off and landing


@contextmanager
def only_udp() -> Generator[None]:
    """Within this context cflib looks for no USB device."""
    before = list(cflib.crtp.CLASSES)
    cflib.crtp.CLASSES[:] = [cflib.crtp.UdpDriver]
    try:
        yield
    finally:
        cflib.crtp.CLASSES[:] = before


class CrazyflieRig(Rig):
    """With a positioning system and an LED ring. A thread ticks: a Crazyflie takes off first, and logs at each tick."""

    resolution: ClassVar[dict[str, float]] = {
        "scan.range_m": ROUNDED_MM,
        "flow.forward_mps": SINGLE,
        "flow.left_mps": SINGLE,
        "imu.forward_mps2": SINGLE,
        "imu.left_mps2": SINGLE,
        "imu.turn_radps": SINGLE,
        "positioning.x_m": SINGLE,
        "positioning.y_m": SINGLE,
        "compass.heading_rad": SINGLE,
        "battery.charge": SINGLE,
        "battery.voltage_v": SINGLE,
    }
    speed_resolution: ClassVar[tuple[float, float]] = (SINGLE, SINGLE)
    stands_until_commanded: ClassVar[bool] = True

    def __init__(self) -> None:
        self._udp = only_udp()
        self._udp.__enter__()
        super().__init__()
        self._ticking, self._ended = Lock(), Event()
        self._readings, self._alive = Fields(), True
        self._commands = Commands()
        self._thread = Thread(target=self._tick_on, name="world", daemon=True)
        self._thread.start()

    def made_body(self) -> Body:
        ring = {"angles_deg": [0], "height_m": 0.0}
        more = {"positioning": {"noise_m": 0.0}, "compass": {"noise_rad": 0.0}}
        return body_from({"like": "crazyflie", "leds": ring, "sensors": more}, "crazyflie.toml")

    def made_gateway(self, address: str) -> Gateway:
        return CrazyflieGateway(["a-0", "a-1"], self.body, address.removeprefix("udp://"), None, self.clock)

    def made_driver(self, address: str) -> Driver:
        options = CrazyflieOptions(
            positioned=True, climb_mps=QUICK_MPS, settle_s=0.0, connect_s=self.connect_s, silent_s=self.silent_s
        )
        return CrazyflieDriver(address, self.body, options, self.clock)

    def publish(self, fields: Fields, *, alive: bool = True) -> None:
        """As `Rig.publish`, from now on in each tick."""
        with self._ticking:
            self._readings, self._alive = self._readings | fields, alive
            self._tick()

    def pop_commands(self) -> Commands:
        """As `Rig.pop_commands`, with the newest speeds of all ticks since the last call."""
        with self._ticking:
            self._tick()
            commands, self._commands = self._commands, Commands()
        return commands

    def close(self) -> None:
        """As `Rig.close`; the drivers land first, so the world ends last."""
        super().close()
        self._ended.set()
        self._thread.join()
        self._udp.__exit__(None, None, None)

    def _tick(self) -> None:
        self.tick += 1
        both = {name: np.concatenate([value, -value]) for name, value in self._readings.items()}
        self.gateway.publish(self.tick * TICK_NS, both, np.array([self._alive, True]))
        commands = super().pop_commands()
        self._commands = Commands(commands.speeds or self._commands.speeds, self._commands.leds | commands.leds)

    def _tick_on(self) -> None:
        while not self._ended.is_set():
            self.clock.sleep_until(self.clock.now_ns() + TICK_NS)
            with self._ticking:
                self._tick()
