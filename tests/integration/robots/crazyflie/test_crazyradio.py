"""Unmodified cflib against Crazyflies of a run whose packets cross the Crazyradio, in real time."""

from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread
from typing import Any

import cflib.crtp
import pytest
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncLogger import SyncLogger
from cflib.crtp.crtpstack import CRTPPacket
from cflib.crtp.udpdriver import UdpDriver

from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.deploy import Recording, Simulation
from swarmwire.deploy.runs.config import RunConfig
from swarmwire.deploy.runs.plan import make_plan
from swarmwire.world.scenario.scenario import Scenario
from tests.integration.robots.crazyflie.test_crazyflie_gateway import connected_client
from tests.support.clocks import until
from tests.support.refusals import refused_input

HOST_DELAY_S = 0.009
# Of the drone in range one poll takes HOST_DELAY_S and at least 260 us of turnarounds and two null packets of 40.5 us;
# of the drone out of range also 130 us and four times ARD, 500 us, with a null packet.
PERIOD_S = 2 * HOST_DELAY_S + 260e-6 + 2 * 40.5e-6 + 130e-6 + 4 * (500e-6 + 40.5e-6)
LOGS = 30


def scenario_with(**radio: Any) -> Scenario:
    """A station, a drone beside it, and one a kilometre away, beyond the range of 114 m."""
    behaviours = "swarmwire.agent.behaviours"
    mapping: dict[str, Any] = {
        "format": 1,
        "name": "a client's radio",
        "duration_s": 300.0,
        "time": {"rate_hz": 100},
        "arena": {"size_m": [2000.0, 20.0]},
        "robots": {
            "ground": {
                "body": "epuck",
                "agent": f"{behaviours}:Diffusion",
                "count": 1,
                "place": {"how": "poses", "poses": [[-500.0, 0.0, 0.0]]},
            },
            "drones": {
                "body": "crazyflie",
                "agent": f"{behaviours}:Consensus",
                "count": 2,
                "place": {"how": "poses", "poses": [[-499.0, 0.0, 0.0], [500.0, 0.0, 0.0]]},
            },
        },
        "radio": {
            "preset": "crazyradio-2M",
            "loss": 0.2,
            "access": {"station": "ground", "host_delay_s": HOST_DELAY_S, **radio},
        },
    }
    return Scenario.model_validate(mapping)


class Flight:
    """A run in a thread, with the URIs of its two drones."""

    def __init__(self) -> None:
        self.simulation = Simulation(scenario_with(), gateways={"drones": "crazyflie"}, record=Recording(tables=False))
        self.uris: list[str] = []
        self._opened = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()
        assert self._opened.wait(600.0)  # kernels may have to be compiled

    def end(self) -> dict[str, int]:
        """End the run; return its counts."""
        self.simulation.controls.quit()
        self._thread.join()
        return self.simulation.result.counts

    def _run(self) -> None:
        with self.simulation as simulation:
            simulation.step()  # the kernels are loaded
            assert simulation.served
            self.uris += [robot.address for robot in simulation.served.robots]
            self._opened.set()
            simulation.run()


@pytest.fixture
def flight() -> Iterator[Flight]:
    cflib.crtp.CLASSES.clear()
    cflib.crtp.CLASSES.append(UdpDriver)  # the others look for USB devices
    flight = Flight()
    yield flight
    flight.end()


def test_crazyradio_carries_a_clients_packets_as_fast_as_it_polls(flight: Flight, tmp_path: Path) -> None:
    """Logs are due every 10 ms, and the drone is polled every 21 ms or less often: none is lost of the first."""
    clock, times_ns, stamps_ms = WallClock(), list[int](), list[int]()
    log = LogConfig(name="battery", period_in_ms=10)
    log.add_variable("pm.vbat", "float")
    with connected_client(flight.uris[0], tmp_path) as scf, SyncLogger(scf, log) as logger:
        for stamp_ms, values, _ in logger:
            times_ns.append(clock.now_ns())
            stamps_ms.append(stamp_ms)
            assert 3.0 < values["pm.vbat"] < 4.3
            if len(stamps_ms) > LOGS:
                break
    assert stamps_ms == list(range(stamps_ms[0], stamps_ms[0] + 10 * LOGS + 1, 10))
    assert (times_ns[-1] - times_ns[0]) / NS_PER_S > (LOGS - 2) * PERIOD_S
    counts = flight.end()
    assert not [name for name in counts if name.startswith(("crazyradio_down", "crazyflie"))]


def test_crazyradio_loses_the_link_to_a_drone_out_of_range(flight: Flight) -> None:
    """The client gets an error of its link, as from cflib's driver of a Crazyradio."""
    errors: list[str] = []
    driver = UdpDriver()
    driver.connect(flight.uris[1], None, errors.append)

    def send() -> list[str]:
        driver.send_packet(CRTPPacket(0xF0, [1, 2, 3]))
        assert driver.receive_packet(0.02) is None
        return errors

    until(send)
    driver.close()
    counts = flight.end()
    assert counts["crazyflie_links_lost"] >= 1
    assert counts["crazyradio_down_no_acknowledgement"] >= 1


def test_station_among_the_gateways_robots_is_refused() -> None:
    with refused_input(key="radio.access.station"):
        make_plan(RunConfig(scenario_with(station="drones-1"), gateways={"drones": "crazyflie"}))
