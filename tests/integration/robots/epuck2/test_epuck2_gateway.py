"""The gateway against a program that knows only the fact sheet."""

import asyncio
import socket
from asyncio import Transport
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, suppress
from math import inf, nan, pi

import numpy as np
import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.robots.epuck2.commands import RobotCommand
from swarmwire.world.gateways.epuck2 import Epuck2Gateway
from swarmwire.world.gateways.epuck2.emulated_robot import Connection, EmulatedRobot
from swarmwire.world.gateways.epuck2.gateway import Epuck2GatewayOptions
from tests.support.clocks import until
from tests.support.robots.epuck2 import SENSORS, command, read

BODY = load_body("epuck2")
STEP_M = pi * 0.04 / 1000
ROBOTS = 3
ALIVE = np.ones(ROBOTS, bool)


@pytest.fixture
def gateway() -> Iterator[Epuck2Gateway]:
    made = a_gateway()
    made.addresses = made.open()  # for the programs below
    yield made
    made.close()


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


def three(value: object) -> np.ndarray:
    return np.array([value] * ROBOTS, np.float64)


def test_readings_stand_where_the_fact_sheet_says(gateway: Epuck2Gateway) -> None:
    fields = {
        "proximity.value": three([0.0, 1.0, 0.5, 0, 0, 0, 0, 0.25]),
        "light.value": three([0.0, 1.0, 0.5, 0, 0, 0, 0, 0]),
        "ground.shade": three([0.0, 0.5, 1.0]),
        "scan.range_m": three([0.535]),
        "odometry.left_m": three(40_000 * STEP_M),
        "odometry.right_m": three(-7 * STEP_M),
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
    told = read(SENSORS, answer[1:])
    assert answer[0] == 2
    assert told["proximity"] == (0, 4095, 2048, 0, 0, 0, 0, 1024)
    assert told["ambient"] == (4000, 0, 2000, 4000, 4000, 4000, 4000, 4000)
    assert told["ground"] == (0, 500, 1000)
    assert told["tof"] == 500
    assert told["steps"] == (40_000 - 65_536, -7)
    assert told["acc"] == (-400, 800, 800)
    assert told["acceleration"] == pytest.approx(1200.0)
    assert told["inclination"] == pytest.approx(np.degrees(np.arccos(800 / 1200)), abs=1e-3)
    assert told["orientation"] == pytest.approx(np.degrees(np.arctan2(-400, 800)) + 180.0, abs=1e-3)
    assert told["gyro"] == (0, 0, round(-45 * 32768 / 250))
    assert told["magnetometer"][0] < 0.0
    assert told["magnetometer"][1] == pytest.approx(0.0, abs=1e-5)
    assert told["battery"] == round(4.2 * 4096 * 0.6 / 3.0)
    assert (told["selector"], told["temperature"], told["button"]) == (15, 25, 0)


def test_what_no_sense_tells_is_as_of_a_robot_at_rest(gateway: Epuck2Gateway) -> None:
    gateway.publish(0, {}, ALIVE)
    with program(gateway) as robot:
        told = read(SENSORS, exchanged(robot, command())[1:])
    assert told["ambient"] == (4000,) * 8
    assert told["acc"] == (0, 0, 800)
    assert told["tof"] > 2000


def test_a_reading_that_is_lost_leaves_the_number_before(gateway: Epuck2Gateway) -> None:
    for travel_m, volts, range_m in ((0.5, 4.0, 0.3), (nan, nan, inf)):
        fields = {
            "odometry.left_m": three(travel_m),
            "odometry.right_m": three(travel_m),
            "battery.voltage_v": three(volts),
            "scan.range_m": three([range_m]),
        }
        gateway.publish(0, fields, ALIVE)
    with program(gateway) as robot:
        told = read(SENSORS, exchanged(robot, command())[1:])
    assert told["steps"] == (round(0.5 / STEP_M),) * 2
    assert told["battery"] == round(4.0 * 819.2)
    assert told["tof"] > 2000


def test_each_command_has_the_answer_that_it_asks_for(gateway: Epuck2Gateway) -> None:
    gateway.publish(0, {}, ALIVE)
    with program(gateway) as robot:
        assert exchanged(robot, command(request=0), 1) == b"\x03"
        assert exchanged(robot, command(request=2))[0] == 2
        image = exchanged(robot, command(request=3), 38401 + 105)
    assert (image[0], image[38401]) == (1, 2)
    assert gateway.counts() == {"images_without_camera": 1}


def test_speeds_are_clipped_wheel_by_wheel_as_the_firmware_does(gateway: Epuck2Gateway) -> None:
    with program(gateway, robot=2) as robot:
        exchanged(robot, command(left=-2000, right=550))
    commands = gateway.take()
    assert commands.drive.tolist() == [False, False, True]
    assert commands.linear_mps[2] == pytest.approx((550 - 1100) / 2 * STEP_M)
    assert commands.angular_radps[2] == pytest.approx((550 + 1100) * STEP_M / 0.053)
    assert gateway.counts() == {"speeds_clipped": 1}
    assert not gateway.take().drive.any()


def test_leds_change_where_they_are_told_something_else(gateway: Epuck2Gateway) -> None:
    with program(gateway, robot=1) as robot:
        exchanged(robot, command(leds=0b1000, led2=(100, 0, 50), led8=(255, 255, 255)))
        changes = gateway.take().leds
        exchanged(robot, command(leds=0b0000, led2=(100, 101, 50), led8=(255, 40, 255)))
        later = gateway.take().leds
    assert changes.rows.tolist() == [1, 1]
    assert dict(zip(changes.place.tolist(), changes.value.tolist(), strict=True)) == {6: 0xFF0000, 1: 0xFF0080}
    assert dict(zip(later.place.tolist(), later.value.tolist(), strict=True)) == {6: 0, 7: 0x006600}


def test_step_counters_can_be_set_and_speeds_hold_meanwhile(gateway: Epuck2Gateway) -> None:
    travel = {"odometry.left_m": three(1.0), "odometry.right_m": three(1.0)}
    gateway.publish(0, travel, ALIVE)
    with program(gateway) as robot:
        exchanged(robot, command(settings=4, left=0, right=100))
        assert not gateway.take().drive.any()
        gateway.publish(1, travel, ALIVE)
        assert read(SENSORS, exchanged(robot, command())[1:])["steps"] == (0, 100)


def test_the_robots_own_avoidance_is_refused_and_counted(gateway: Epuck2Gateway) -> None:
    with program(gateway) as robot:
        exchanged(robot, command(settings=2, left=100, right=100))
    assert gateway.take().linear_mps[0] == pytest.approx(100 * STEP_M)
    assert gateway.counts() == {"avoidance_refused": 1}


def test_what_is_no_command_is_counted_and_hung_up_on(gateway: Epuck2Gateway) -> None:
    with program(gateway) as robot:
        robot.sendall(b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n")
        with pytest.raises((EOFError, ConnectionResetError)):
            received(robot, 1)
    assert gateway.counts() == {"malformed_commands": 1}
    with program(gateway) as robot:
        assert exchanged(robot, command())[0] == 2


def test_a_program_that_leaves_within_a_command_is_counted_and_the_part_forgotten(gateway: Epuck2Gateway) -> None:
    with program(gateway) as robot:
        exchanged(robot, command(left=100, right=100))
        robot.sendall(command(left=300, right=300)[:20])
    until(lambda: gateway.counts() == {"half_commands": 1})
    assert gateway.take().linear_mps[0] == pytest.approx(100 * STEP_M)
    with program(gateway) as robot:
        assert exchanged(robot, command())[0] == 2


def test_a_second_program_waits_until_the_first_has_gone(gateway: Epuck2Gateway) -> None:
    with program(gateway) as first, program(gateway) as second:
        second.settimeout(0.1)
        second.sendall(command())
        with pytest.raises(TimeoutError):
            second.recv(1)
        assert exchanged(first, command())[0] == 2
        first.close()
        second.settimeout(10.0)
        assert received(second, 105)[0] == 2


def test_a_program_that_is_kept_waiting_is_counted(gateway: Epuck2Gateway) -> None:
    with program(gateway) as served:
        exchanged(served, command())
        assert gateway.counts() == {}
        with program(gateway):
            until(lambda: gateway.counts() == {"clients_kept_waiting": 1})


def test_programs_that_wait_in_vain_are_dropped(gateway: Epuck2Gateway) -> None:
    with program(gateway) as served:
        exchanged(served, command())
        waiting = [program(gateway) for _ in range(6)]
        until(lambda: gateway.counts().get("connections_dropped") == 2)
        for one in waiting:
            one.__exit__(None, None, None)


def test_a_program_that_reads_no_answers_is_hung_up_on(gateway: Epuck2Gateway) -> None:
    with program(gateway) as robot, suppress(ConnectionError):
        while "unread_answers" not in gateway.counts():
            robot.sendall(100 * command(request=1))


def test_nothing_is_written_to_a_program_that_has_left_and_it_is_counted_once() -> None:
    told, counts, transport = [], Counter[str](), Gone(after=2)
    robot = EmulatedRobot(told.append, lambda: b"answer", counts)
    connection = Connection(robot)
    connection.connection_made(transport)
    connection.data_received(20 * command(left=5, request=2))
    robot.tell_unasked()
    assert transport.written == [b"answer"] * 2
    assert len(told) == 20  # the last one may be to halt
    assert counts == {"left_unanswered": 1}


class NoSocket:
    """Takes any option."""

    def setsockopt(self, *_: int) -> None:
        """As a socket does."""


class Gone(Transport):
    """A transport that is lost after some answers."""

    def __init__(self, after: int) -> None:
        super().__init__({"socket": NoSocket()})
        self._after, self.written = after, list[bytes]()

    def is_closing(self) -> bool:
        return len(self.written) >= self._after

    def write(self, data) -> None:
        self.written.append(bytes(data))

    def get_write_buffer_size(self) -> int:
        return 0

    def resume_reading(self) -> None:
        """It is never read."""


def test_a_robot_that_streams_repeats_its_answer_with_each_new_reading() -> None:
    gateway = a_gateway(stream=True)
    gateway.addresses = gateway.open()
    with closing(gateway), program(gateway) as robot:
        gateway.publish(0, {"scan.range_m": three([0.535])}, ALIVE)
        exchanged(robot, command())
        for i in range(1, 4):
            gateway.publish(i, {"scan.range_m": three([0.535 + 0.1 * i])}, ALIVE)
            assert read(SENSORS, received(robot, 105)[1:])["tof"] == 500 + 100 * i


def test_a_taken_address_is_refused_and_leaves_nothing_open(gateway: Epuck2Gateway) -> None:
    host, _, port = gateway.addresses[1].partition(":")
    other = a_gateway(f"{host}:{int(port) - 1}")
    with pytest.raises(BadInput, match=r"gateway epuck2: address: expected .* to be free"):
        other.open()


@pytest.mark.parametrize("address", [":5", "host:x", "host:65534", "127.*.1.1:5", "127.0.0.*x:5", "*:5"])
def test_an_address_that_cannot_be_one_is_refused(address: str) -> None:
    with pytest.raises(BadInput, match="gateway epuck2: address"):
        a_gateway(address)


def test_hosts_or_ports_count_up() -> None:
    with closing(a_gateway("127.0.1.*:0")) as gateway:
        assert [address.partition(":")[0] for address in gateway.open()] == ["127.0.1.1", "127.0.1.2", "127.0.1.3"]


def test_a_program_that_has_gone_is_written_no_answer_and_its_commands_are_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    told: list[RobotCommand] = []
    robot = EmulatedRobot(told.append, lambda: b"", Counter())
    with socket.create_server(("127.0.0.1", 0)) as server:
        theirs = socket.create_connection(server.getsockname())
        ours, _ = server.accept()

    async def serve() -> None:
        transport, connection = await asyncio.get_running_loop().create_connection(lambda: Connection(robot), sock=ours)
        transport.abort()
        for _ in range(10):  # asyncio complains of the sixth write
            connection.data_received(RobotCommand(7, 7).encoded())

    with theirs:
        asyncio.run(serve())
    assert [command.left for command in told] == [7] * 10
    assert not caplog.records
