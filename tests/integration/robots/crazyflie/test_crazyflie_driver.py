"""The driver against an emulated Crazyflie: take-off, flight, landing, stops."""

from collections.abc import Iterator

import pytest

from swarmwire.agent.drivers.crazyflie import CrazyflieDriver, CrazyflieOptions
from swarmwire.agent.drivers.driver import Command, DriverLost
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput
from swarmwire.world.gateways.crazyflie.flight import State
from tests.integration.robots.crazyflie.test_crazyflie_gateway import Room, room
from tests.support.clocks import until

__all__ = ["room"]
QUICK = CrazyflieOptions(climb_mps=1.0, settle_s=0.0)


@pytest.fixture
def driver(room: Room) -> Iterator[CrazyflieDriver]:
    made = CrazyflieDriver(room.uri, load_body("crazyflie"), QUICK, room.clock)
    made.open()
    yield made
    made.close()


def test_it_takes_off_with_the_first_command_and_lands_when_closed(room: Room, driver: CrazyflieDriver) -> None:
    flight = room.gateway._robots[0].flight
    assert flight.height_m == 0.0
    driver.act(Command(0.3, 0.5, 0.1))
    until(lambda: flight.motion.forward_mps == pytest.approx(0.3))
    assert flight.motion.left_mps == pytest.approx(0.1)
    assert flight.motion.turn_radps == pytest.approx(0.5)
    assert flight.height_m > 0.3
    driver.close()
    until(lambda: flight.height_m == 0.0 and not flight.setpoint.flies)
    assert flight.state is not State.LOCKED


def test_it_reads_ranges_flow_and_battery(room: Room, driver: CrazyflieDriver) -> None:
    driver.act(Command(0.3))
    until(lambda: driver.sense(driver.measures)["flow.forward_mps"][0] == pytest.approx(0.3, abs=1e-3))
    fields = driver.sense(driver.measures)
    assert {name.partition(".")[0] for name in fields} == {"scan", "flow", "imu", "battery"}
    assert fields["scan.range_m"].tolist() == [[1.5, 0.4, float("inf"), 2.0]]
    assert fields["battery.charge"][0] == pytest.approx(0.75)


def test_a_stop_hovers_and_a_command_flies_on(room: Room, driver: CrazyflieDriver) -> None:
    flight = room.gateway._robots[0].flight
    driver.act(Command(0.3))
    until(lambda: flight.motion.forward_mps == pytest.approx(0.3))
    driver.stop()
    until(lambda: flight.motion.forward_mps == 0.0)
    assert flight.height_m > 0.3
    driver.act(Command(0.2))
    until(lambda: flight.motion.forward_mps == pytest.approx(0.2))
    driver.stop()
    until(lambda: flight.height_m == 0.0)  # nothing comes, so it lands
    assert flight.state is not State.LOCKED


def test_an_emergency_stop_switches_the_motors_off_in_the_air(room: Room, driver: CrazyflieDriver) -> None:
    flight = room.gateway._robots[0].flight
    driver.act(Command(0.3))
    until(lambda: flight.height_m > 0.4)
    driver.emergency_stop()
    until(lambda: flight.state is State.LOCKED)
    with pytest.raises(DriverLost, match="locked"):
        until(lambda: driver.act(Command(0.3)))
    with pytest.raises(DriverLost, match="locked"):
        driver.open()


def test_nobody_at_the_address_is_told(room: Room) -> None:
    driver = CrazyflieDriver("udp://127.0.0.1:9", load_body("crazyflie"), CrazyflieOptions(connect_s=0.5), room.clock)
    with pytest.raises(DriverLost):
        driver.open()
    with pytest.raises(BadInput, match="address"):
        CrazyflieDriver("192.168.1.1", load_body("crazyflie"), QUICK, room.clock)
