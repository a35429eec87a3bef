"""The driver against an emulated Crazyflie: take-off, flight, landing, stops."""

import os
from collections.abc import Iterator
from pathlib import Path
from threading import enumerate as enumerate_threads

import numpy as np
import psutil
import pytest
from cflib.crtp.udpdriver import UdpDriver

from swarmwire.agent.drivers.crazyflie import CrazyflieDriver, CrazyflieOptions
from swarmwire.agent.drivers.driver import Command, DriverLost, MotorsOff
from swarmwire.comms.base.config import read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import body_from, load_body
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import ESTOP, ask_all, endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import closed_after
from swarmwire.world.gateways.crazyflie.flight import STANDSTILL, SupervisorState
from tests.integration.robots.crazyflie.test_crazyflie_gateway import Room, room
from tests.support.agent.on_robot.installed import Command as Program
from tests.support.agent.on_robot.scripted import PLAYERS
from tests.support.clocks import until
from tests.support.deploy.runs import ROOT

__all__ = ["room"]
QUICK = CrazyflieOptions(climb_mps=1.0, settle_s=0.0)


@pytest.fixture
def driver(room: Room) -> Iterator[CrazyflieDriver]:
    driver = CrazyflieDriver(room.uri, load_body("crazyflie"), QUICK, room.clock)
    driver.open()
    yield driver
    driver.close()


def test_crazyflie_takes_off_with_the_first_command_and_lands_when_closed(room: Room, driver: CrazyflieDriver) -> None:
    flight = room.gateway._robots[0].flight
    assert flight.height_m == 0.0
    driver.act(Command(0.3, 0.5, 0.1))
    until(lambda: flight.motion.forward_mps == pytest.approx(0.3))
    assert flight.motion.left_mps == pytest.approx(0.1)
    assert flight.motion.turn_radps == pytest.approx(0.5)
    assert flight.height_m > 0.3
    driver.close()
    until(lambda: flight.height_m == 0.0 and not flight.setpoint.flies)
    assert flight.state is not SupervisorState.LOCKED


def test_stop_hovers_until_the_next_command(room: Room, driver: CrazyflieDriver) -> None:
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
    assert flight.state is not SupervisorState.LOCKED


def test_emergency_stop_switches_the_motors_off_in_the_air(room: Room, driver: CrazyflieDriver) -> None:
    flight = room.gateway._robots[0].flight
    driver.act(Command(0.3))
    until(lambda: flight.height_m > 0.4)
    driver.emergency_stop()
    until(lambda: flight.state is SupervisorState.LOCKED)
    with pytest.raises(MotorsOff, match="locked"):
        until(lambda: driver.act(Command(0.3)))
    with pytest.raises(MotorsOff, match="locked"):
        driver.open()


def test_emergency_stop_on_the_floor_does_not_lock(room: Room, driver: CrazyflieDriver) -> None:
    driver.emergency_stop()
    driver.act(Command(0.3))  # no command starts the motors again, but a new connection does
    driver.close()
    assert room.gateway._robots[0].flight.height_m == 0.0
    driver.open()
    driver.act(Command(0.3))
    until(lambda: room.gateway._robots[0].flight.motion.forward_mps == pytest.approx(0.3))


def test_low_battery_lands_the_crazyflie_and_prevents_a_take_off(room: Room, driver: CrazyflieDriver) -> None:
    flight = room.gateway._robots[0].flight
    driver.act(Command(0.3))
    until(lambda: flight.height_m > 0.4)
    room.voltage_v = 3.1
    until(lambda: driver.act(Command(0.3)) or driver.counts().get("low_battery_commands", 0) > 0)
    until(lambda: flight.height_m == 0.0 and not flight.setpoint.flies)
    driver.act(Command(0.3))
    driver.close()
    assert flight.height_m == 0.0
    assert flight.state is not SupervisorState.LOCKED


def test_proximity_is_the_multi_rangers_range_from_the_rim(room: Room) -> None:
    file = ROOT / "scenarios" / "robots" / "crazyflie.toml"
    body = body_from(read_toml(file), str(file))
    driver = CrazyflieDriver(room.uri, body, QUICK, room.clock)
    driver.open()
    sensed = driver.sense(frozenset({"proximity"}))["proximity.value"]
    assert sensed == pytest.approx(np.array([[0.0, 1.0 - (0.4 - body.radius_m), 0.0, 0.0]]))
    driver.close()


def test_killed_agent_leaves_no_crazyflie_in_the_air(room: Room, tmp_path: Path) -> None:
    flight = room.gateway._robots[0].flight
    options = ("--driver", "crazyflie", "--address", room.uri)
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    with Program(environment, "run", f"{PLAYERS}:Driving", *options, "--watchdog-s", "5") as command:
        until(lambda: flight.height_m > 0.4 and flight.motion.forward_mps > 0.0)
        guard = psutil.Process(command.process.pid)
        until(lambda: len(guard.children()) == 2)
        (process,) = (child for child in guard.children() if "--heartbeats" in child.cmdline())
        process.kill()
        code, _, output = command.wait()
    until(lambda: flight.state is SupervisorState.LOCKED and flight.height_m == 0.0 and flight.motion == STANDSTILL)
    assert code == 1
    assert output.endswith("; the motors were stopped\n")
    with Program(environment, "stop-motors", *options) as command:  # of a locked robot they are off
        assert command.wait() == (0, "robot-0: stopped\n", "")


def test_emergency_stop_of_an_operator_is_confirmed_and_the_agent_ends(room: Room, tmp_path: Path) -> None:
    flight = room.gateway._robots[0].flight
    network = Network(listen=("tcp/127.0.0.1:0",))
    options = ("--driver", "crazyflie", "--address", room.uri, "--radio", "zenoh", "--watchdog-s", "5")
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    with closed_after(open_swarm(network)) as session:
        connect = ("--connect", endpoints_of(session, network)[0])
        with Program(environment, "run", f"{PLAYERS}:Driving", *options, *connect) as command:
            until(lambda: flight.height_m > 0.4)
            assert ask_all(session, SwarmKeys("swarm"), ESTOP, ["robot-0"], 30.0) == {"robot-0": "stopped"}
            until(lambda: flight.state is SupervisorState.LOCKED)
            # Again, when its driver has noticed that the robot is locked: its motors are off.
            assert command.process.stderr is not None
            assert any("locked" in line for line in iter(command.process.stderr.readline, ""))
            assert ask_all(session, SwarmKeys("swarm"), ESTOP, ["robot-0"], 30.0) == {"robot-0": "stopped"}
            command.process.terminate()
            assert command.wait()[0] == 0


def test_no_ping_is_sent_while_the_link_closes(driver: CrazyflieDriver, monkeypatch) -> None:
    pings: list[bool] = []
    close = UdpDriver.close

    def close_and_look(link: UdpDriver) -> None:
        pings.append(any(thread.name == "ping_thread" for thread in enumerate_threads()))
        close(link)

    assert any(thread.name == "ping_thread" for thread in enumerate_threads())
    monkeypatch.setattr(UdpDriver, "close", close_and_look)
    driver.close()
    assert pings == [False]


def test_address_without_a_crazyflie_or_a_radio_is_lost_and_not_logged(room: Room, caplog) -> None:
    for address in ("udp://127.0.0.1:9", "radio://9/80/2M/E7E7E7E7E7"):
        away = CrazyflieDriver(address, load_body("crazyflie"), CrazyflieOptions(connect_s=0.5), room.clock)
        with pytest.raises(DriverLost, match=f"no Crazyflie answers at {address}"):
            away.open()
    assert not [record for record in caplog.records if record.name.startswith("cflib")]
    with pytest.raises(BadInput, match="address"):
        CrazyflieDriver("192.168.1.1", load_body("crazyflie"), QUICK, room.clock)
