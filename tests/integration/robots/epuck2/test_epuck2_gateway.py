"""The gateway against a program that knows only the fact sheet."""

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from math import inf, nan, pi
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.agent.drivers.epuck2.driver import Epuck2Driver, Epuck2Options
from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.gateways.epuck2 import Epuck2Gateway
from swarmwire.world.gateways.epuck2.gateway import Epuck2GatewayOptions
from tests.support.clocks import until
from tests.support.refusals import refused_input
from tests.support.robots.epuck2 import SENSORS, command, read
from tests.support.world.scenes import scene

CLIENT = Path(__file__).parents[4] / "examples" / "epuck2_client.py"
BODY = load_body("epuck2")
STEP_M = pi * 0.04 / 1000
ROBOTS = 3
ALIVE = np.ones(ROBOTS, bool)


@pytest.fixture
def gateway() -> Iterator[Epuck2Gateway]:
    gateway = a_gateway()
    gateway.addresses = gateway.open()  # for the programs below
    yield gateway
    gateway.close()


def a_gateway(address: str = "", **options: object) -> Epuck2Gateway:
    names = [f"a-{i}" for i in range(ROBOTS)]
    return Epuck2Gateway(names, BODY, address, Epuck2GatewayOptions(**options), WallClock())


def program(gateway: Epuck2Gateway, robot: int = 0) -> "closing[socket.socket]":
    host, _, port = gateway.addresses[robot].partition(":")
    return closing(socket.create_connection((host, int(port)), timeout=10.0))


def exchanged(robot: socket.socket, packet: bytes, size: int = 105) -> bytes:
    robot.sendall(packet)
    return received(robot, size)


def received(robot: socket.socket, size: int) -> bytes:
    answer = b""
    while len(answer) < size:
        more = robot.recv(size - len(answer))
        if not more:
            raise EOFError(f"{len(answer)} of {size} bytes")
        answer += more
    return answer


def faults(gateway: Epuck2Gateway) -> dict[str, int]:
    """The counts but for that of constant readings, which each request for the sensors has."""
    return {name: count for name, count in gateway.counts().items() if name != "constant_readings"}


def three(value: object) -> np.ndarray:
    return np.array([value] * ROBOTS, np.float64)


def test_readings_have_the_offsets_of_the_fact_sheet(gateway: Epuck2Gateway) -> None:
    fields = {
        "proximity.value": three([0.0, 1.0, 0.5, 0, 0, 0, 0, 0.25]),
        "light.value": three([0.0, 1.0, 0.5, 0, 0, 0, 0, 0]),
        "ground.shade": three([0.0, 0.5, 1.0]),
        "scan.range_m": three([0.535]),
        "imu.forward_mps2": three(9.80665),
        "imu.left_mps2": three(-9.80665 / 2),
        "imu.turn_radps": three(-pi / 4),
        "compass.heading_rad": three(0.0),
        "battery.charge": three(1.0),
        "battery.voltage_v": three(4.2),
    }
    gateway.publish(0, fields, ALIVE)
    with program(gateway, robot=1) as robot:
        answer = exchanged(robot, command())
    readings = read(SENSORS, answer[1:])
    assert answer[0] == 2
    assert readings["proximity"] == (0, 4095, 2048, 0, 0, 0, 0, 1024)
    assert readings["ambient"] == (4000, 0, 2000, 4000, 4000, 4000, 4000, 4000)
    assert readings["ground"] == (0, 500, 1000)
    assert readings["tof"] == 500
    assert readings["acc"] == (-400, 800, 800)
    assert readings["acceleration"] == pytest.approx(1200.0)
    assert readings["inclination"] == pytest.approx(np.degrees(np.arccos(800 / 1200)), abs=1e-3)
    assert readings["orientation"] == pytest.approx(np.degrees(np.arctan2(-400, 800)) + 180.0, abs=1e-3)
    assert readings["gyro"] == (0, 0, round(-45 * 32768 / 250))
    assert readings["magnetometer"][0] < 0.0
    assert readings["magnetometer"][1] == pytest.approx(0.0, abs=1e-5)
    assert readings["battery"] == round(4.2 * 4096 * 0.6 / 3.0)
    assert (readings["selector"], readings["temperature"], readings["button"]) == (15, 25, 0)
    assert readings["microphones"] == (30,) * 4


def test_readings_without_a_sensor_are_those_of_a_robot_at_rest(gateway: Epuck2Gateway) -> None:
    gateway.publish(0, {}, ALIVE)
    with program(gateway) as robot:
        readings = read(SENSORS, exchanged(robot, command())[1:])
    assert readings["ambient"] == (4000,) * 8
    assert readings["acc"] == (0, 0, 800)
    assert readings["tof"] > 2000


def test_lost_reading_leaves_the_previous_number(gateway: Epuck2Gateway) -> None:
    for turn_radps, volts, range_m in ((0.5, 4.0, 0.3), (nan, nan, inf)):
        fields = {
            "imu.forward_mps2": three(0.0),
            "imu.left_mps2": three(0.0),
            "imu.turn_radps": three(turn_radps),
            "battery.voltage_v": three(volts),
            "scan.range_m": three([range_m]),
        }
        gateway.publish(0, fields, ALIVE)
    with program(gateway) as robot:
        readings = read(SENSORS, exchanged(robot, command())[1:])
    assert readings["gyro"][2] == round(np.degrees(0.5) * 32768 / 250)
    assert readings["battery"] == round(4.0 * 819.2)
    assert readings["tof"] > 2000


def test_speeds_are_clipped_per_wheel_as_in_the_firmware(gateway: Epuck2Gateway) -> None:
    with program(gateway, robot=2) as robot:
        exchanged(robot, command(left=-2000, right=550))
    commands = gateway.pop_commands()
    assert commands.drive.tolist() == [False, False, True]
    assert commands.linear_mps[2] == pytest.approx((550 - 1100) / 2 * STEP_M)
    assert commands.angular_radps[2] == pytest.approx((550 + 1100) * STEP_M / 0.053)
    assert faults(gateway) == {"speeds_clipped": 1}
    assert not gateway.pop_commands().drive.any()


def test_leds_change_only_with_new_values(gateway: Epuck2Gateway) -> None:
    with program(gateway, robot=1) as robot:
        exchanged(robot, command(leds=0b1000, led2=(100, 0, 50), led8=(255, 255, 255)))
        changes = gateway.pop_commands().leds
        exchanged(robot, command(leds=0b0000, led2=(100, 101, 50), led8=(255, 40, 255)))
        later = gateway.pop_commands().leds
    assert changes.rows.tolist() == [1, 1]
    assert dict(zip(changes.slot.tolist(), changes.value.tolist(), strict=True)) == {6: 0xFF0000, 1: 0xFF0080}
    assert dict(zip(later.slot.tolist(), later.value.tolist(), strict=True)) == {6: 0, 7: 0x006600}


def test_image_shows_the_view_ahead(gateway: Epuck2Gateway) -> None:
    looked_at = scene([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 1.0, pi]], BODY)
    looked_at.leds[0, 1, 9] = 0x00FF00  # the body LED of the robot ahead of the first
    gateway.enter(looked_at, 0)
    gateway.publish(0, {}, ALIVE)
    with program(gateway, robot=0) as near, program(gateway, robot=2) as turned_away:
        for robot in (near, turned_away):
            assert exchanged(robot, command(request=1), 38401)[0] == 1
        gateway.publish(1, {}, ALIVE)

        def greens() -> list[bool]:
            return [
                is_green(middle_pixel(exchanged(robot, command(request=1), 38401))) for robot in (near, turned_away)
            ]

        until(lambda: greens() == [True, False])


def middle_pixel(image: bytes) -> int:
    """The RGB565 pixel in the middle of an image, behind its first byte."""
    return int.from_bytes(image[1 + 2 * (60 * 160 + 80) :][:2], "big")


def is_green(pixel: int) -> bool:
    return (pixel >> 5 & 63) > 2 * (pixel & 31) + 8


def test_step_counters_follow_commands_at_a_wall_and_wrap(gateway: Epuck2Gateway) -> None:
    at_a_wall = {"odometry.left_m": three(0.0), "odometry.right_m": three(0.0)}
    with program(gateway) as robot:
        exchanged(robot, command(left=1000, right=-2000))
        gateway.publish(0, at_a_wall, ALIVE)
        gateway.pop_commands()
        gateway.publish(20 * NS_PER_S, at_a_wall, ALIVE)
        until(lambda: steps(robot) == (20_000, -22_000))  # the firmware's limit is 1100 steps/s
        gateway.publish(40 * NS_PER_S, at_a_wall, ALIVE)
        until(lambda: steps(robot) == (40_000 - 65_536, -44_000 + 65_536))


def test_step_counters_can_be_set_without_a_change_of_speeds(gateway: Epuck2Gateway) -> None:
    with program(gateway) as robot:
        exchanged(robot, command(settings=4, left=0, right=100))
        assert not gateway.pop_commands().drive.any()
        gateway.publish(1, {}, ALIVE)
        until(lambda: steps(robot) == (0, 100))


def test_step_counters_begin_at_0(gateway: Epuck2Gateway) -> None:
    with program(gateway) as robot:
        exchanged(robot, command(left=100, right=100))
    gateway.pop_commands()
    gateway.publish(NS_PER_S, {}, np.array([False, True, True]))
    gateway.publish(2 * NS_PER_S, {}, ALIVE)
    with program(gateway) as robot:
        assert read(SENSORS, exchanged(robot, command())[1:])["steps"] == (0, 0)


def steps(robot: socket.socket) -> tuple[int, int]:
    """The counters in the next answer."""
    return read(SENSORS, exchanged(robot, command(left=1000, right=-2000))[1:])["steps"]


@pytest.mark.parametrize(
    ("fields", "count"),
    [({"settings": 1}, "calibration_refused"), ({"settings": 2}, "avoidance_refused"), ({"sound": 4}, "sound_refused")],
)
def test_unsupported_parts_of_a_command_are_counted_once_and_others_apply(
    gateway: Epuck2Gateway, fields: dict[str, int], count: str
) -> None:
    for which in (0, 1):
        with program(gateway, which) as robot:
            for _ in range(3):
                exchanged(robot, command(left=100, right=100, **fields))
    assert gateway.pop_commands().linear_mps[:2] == pytest.approx([100 * STEP_M] * 2)
    assert faults(gateway) == {count: 2}
    assert gateway.counts()["constant_readings"] == 2


def test_malformed_command_is_counted_and_closes_the_connection(gateway: Epuck2Gateway) -> None:
    with program(gateway) as robot:
        robot.sendall(b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n")
        with pytest.raises((EOFError, ConnectionResetError)):
            received(robot, 1)
    assert faults(gateway) == {"malformed_commands": 1}
    with program(gateway) as robot:
        assert exchanged(robot, command())[0] == 2


def test_waiting_program_is_counted(gateway: Epuck2Gateway) -> None:
    with program(gateway) as served:
        exchanged(served, command())
        assert faults(gateway) == {}
        with program(gateway):
            until(lambda: faults(gateway) == {"clients_kept_waiting": 1})


def test_driver_names_another_program_that_blocks_a_stop(gateway: Epuck2Gateway) -> None:
    with program(gateway) as other:
        exchanged(other, command(left=100, right=100))
        driver = Epuck2Driver(gateway.addresses[0], BODY, Epuck2Options(connect_s=0.2), WallClock())
        with pytest.raises(DriverLost, match="obeys one program at a time, so end any other one, or switch"):
            driver.open()
        assert gateway.pop_commands().linear_mps[0] == pytest.approx(100 * STEP_M)


def test_programs_that_wait_too_long_are_dropped(gateway: Epuck2Gateway) -> None:
    with program(gateway) as served:
        exchanged(served, command())
        waiting = [program(gateway) for _ in range(6)]
        until(lambda: gateway.counts().get("connections_dropped") == 2)
        for waiting_program in waiting:
            waiting_program.__exit__(None, None, None)


def test_address_in_use_is_refused_and_leaves_nothing_open(gateway: Epuck2Gateway) -> None:
    host, _, port = gateway.addresses[1].partition(":")
    other = a_gateway(f"{host}:{int(port) - 1}")
    with refused_input("gateway epuck2", "address"):
        other.open()


@pytest.mark.parametrize("address", [":5", "host:x", "host:65534", "127.*.1.1:5", "127.0.0.*x:5", "*:5"])
def test_invalid_address_is_refused(address: str) -> None:
    with refused_input("gateway epuck2", "address"):
        a_gateway(address)


def test_hosts_or_ports_count_up() -> None:
    with closing(a_gateway("127.0.1.*:0")) as gateway:
        assert [address.partition(":")[0] for address in gateway.open()] == ["127.0.1.1", "127.0.1.2", "127.0.1.3"]


def test_example_client_drives_reads_and_stops_a_robot(gateway: Epuck2Gateway, tmp_path: Path) -> None:
    gateway.enter(scene([[0.0, 0.0, 0.0]] * ROBOTS, BODY), 0)
    gateway.publish(0, {"scan.range_m": three([0.535])}, ALIVE)
    program = [sys.executable, CLIENT, *gateway.addresses[0].split(":")]
    with subprocess.Popen(program, stdout=subprocess.PIPE, cwd=tmp_path, text=True) as client:
        driving = until(gateway.pop_commands, lambda commands: commands.drive[0])
        gateway.publish(1, {}, ALIVE)  # with a picture
        output, _ = client.communicate(timeout=60)
    assert driving.linear_mps[0] == pytest.approx(275 * STEP_M)
    assert dict(zip(driving.leds.slot.tolist(), driving.leds.value.tolist(), strict=True)) == {8: 0xFF0000}
    assert gateway.pop_commands().linear_mps[0] == 0.0
    assert output.splitlines()[-1] == "distance ahead: 500 mm"
    assert faults(gateway) == {}
    with Image.open(tmp_path / "image.ppm") as image:
        assert image.size == (160, 120)
        assert image.getpixel((80, 110)) != (0, 0, 0)  # the floor
