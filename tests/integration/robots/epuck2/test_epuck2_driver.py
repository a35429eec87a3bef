"""The driver against bytes that are written down here."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from math import inf, nan, pi, radians

import numpy as np
import pytest

from swarmwire.agent.drivers.driver import Command
from swarmwire.agent.drivers.epuck2 import Epuck2Driver
from swarmwire.agent.drivers.epuck2.driver import Epuck2Options
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.robot.bodies.body import load_body
from tests.support.refusals import refused_input
from tests.support.robots.epuck2 import COMMAND, ScriptedRobot, command, read, sensors

BODY = load_body("epuck2")
STEP_M = pi * 0.04 / 1000
Answer = Callable[[bytes], bytes]


@contextmanager
def driving(answer: Answer, **options: object) -> Generator[tuple[Epuck2Driver, ScriptedRobot]]:
    with ScriptedRobot(answer) as robot:
        driver = Epuck2Driver(robot.address, BODY, Epuck2Options(connect_s=1.0, **options), WallClock())
        driver.open()
        yield driver, robot
        driver.close()


def telling(**values: object) -> Answer:
    return lambda packet: b"\x02" + sensors(**values) if packet[1] & 2 else b"\x03"


@pytest.mark.parametrize(
    ("values", "field", "expected"),
    [
        ({"proximity": (0, 819, 4095, 5000, 0, 0, 0, 273)}, "proximity.value", [0, 0.2, 1, 1, 0, 0, 0, 1 / 15]),
        ({"ambient": (4000, 3000, 0, 4095, 4000, 4000, 4000, 4000)}, "light.value", [0, 0.25, 1, 0, 0, 0, 0, 0]),
        ({"ground": (0, 500, 1100)}, "ground.shade", [0, 0.5, 1]),
        ({"tof": 300}, "scan.range_m", [0.3 + 0.035]),
        ({"tof": 1990}, "scan.range_m", [inf]),  # from the body's centre that is more than the sheet's 2 m
        ({"tof": 8190}, "scan.range_m", [inf]),
        ({"acc": (0, 400, 800)}, "imu.forward_mps2", [9.80665 / 2]),
        ({"acc": (400, 0, 800)}, "imu.left_mps2", [9.80665 / 2]),
        ({"gyro": (11, 12, 16384)}, "imu.turn_radps", [radians(125)]),
        ({"battery": 3277}, "battery.voltage_v", [3277 * 3 / 0.6 / 4096]),
        ({"battery": 3440}, "battery.charge", [(3440 * 3 / 0.6 / 4096 - 3.4) / 0.8]),
        ({"battery": 2600}, "battery.charge", [0]),
        ({"magnetometer": (-20.0, 0.0, 40.0)}, "compass.heading_rad", [0.0]),  # the field points ahead
        ({"magnetometer": (0.0, -20.0, 40.0)}, "compass.heading_rad", [pi / 2]),  # north is to the right
    ],
)  # fmt: skip
def test_readings_have_the_meaning_of_the_fact_sheet(
    values: dict[str, object], field: str, expected: list[float]
) -> None:
    with driving(telling(**values), north_deg=0.0) as (driver, _):
        sensed = driver.sense(frozenset({field.partition(".")[0]}))[field]
    np.testing.assert_allclose(sensed.ravel(), expected, atol=1e-7)


def test_magnetometers_have_their_axes_and_offsets() -> None:
    ahead = {"magnetometer": (5.0, 20.0 - 3.0, 40.0)}
    with driving(telling(**ahead), north_deg=90.0, magnetometer="icm20948", offset_x_ut=5.0, offset_y_ut=-3.0) as (
        driver,
        _,
    ):
        heading = driver.sense(frozenset({"compass"}))["compass.heading_rad"]
    assert heading[0] == pytest.approx(pi / 2)


def test_compass_needs_a_known_north() -> None:
    driver = Epuck2Driver("127.0.0.1", BODY, Epuck2Options(), WallClock())
    assert driver.measures == {"proximity", "light", "ground", "scan", "odometry", "imu", "battery"}


def test_odometry_has_no_jump_after_a_restart_of_the_robot() -> None:
    steps = [0]
    with driving(lambda _: b"\x02" + sensors(steps=(steps[0], steps[0]))) as (driver, _):
        steps[0] = 9000
        before = driver.sense(frozenset({"odometry"}))["odometry.left_m"]
        steps[0] = 10
        driver.open()
        after = driver.sense(frozenset({"odometry"}))["odometry.left_m"]
        assert driver.counts()["odometry_began_anew"] == 1
    assert after == before == pytest.approx(9000 * STEP_M)


def test_command_has_the_bytes_of_the_fact_sheet() -> None:
    leds = {0: 0xFF0000, 1: 0xFF8000, 2: 0x0000FF, 4: 0xFFFFFF, 7: 0x003366}
    with driving(telling()) as (driver, robot):
        driver.act(Command(0.05, 1.0, leds=leds))
        driver.sense(frozenset())
        fields = read(COMMAND, robot.commands[-2])
    left, right = (round((0.05 + side * 0.053 / 2) / STEP_M) for side in (-1, 1))
    assert fields == {
        "id": 0x80, "request": 0, "settings": 0, "left": left, "right": right,
        "leds": 0b0101, "led2": (100, 50, 0), "led4": (0, 0, 0), "led6": (0, 0, 0), "led8": (0, 20, 40), "sound": 0,
    }  # fmt: skip


def test_request_for_readings_repeats_the_last_command() -> None:
    with driving(telling()) as (driver, robot):
        driver.act(Command(-0.02, leds={0: 0xFF0000}))
        driver.sense(frozenset())
        back = round(-0.02 / STEP_M)
        assert robot.commands[-1] == command(left=back, right=back, leds=1)


def test_speeds_that_are_not_finite_stop_the_wheels() -> None:
    with driving(telling()) as (driver, robot):
        driver.act(Command(nan, 1.0))
        driver.sense(frozenset())
        fields = read(COMMAND, robot.commands[-1])
        assert driver.counts()["not_finite"] == 1
    assert (fields["left"], fields["right"]) == (0, 0)


def test_driver_skips_images() -> None:
    image = b"\x01" + bytes(38400)
    with driving(lambda _: image + b"\x02" + sensors(tof=500)) as (driver, _):
        sensed = driver.sense(frozenset({"scan"}))
        assert driver.counts()["images_skipped"] == 2
    assert sensed["scan.range_m"][0, 0] == pytest.approx(0.535)


def test_driver_waits_for_a_reading_after_empty_answers() -> None:
    distances = iter([100, 200, 300, 400])

    def answer(packet: bytes) -> bytes:
        return 3 * b"\x03" + b"\x02" + sensors(tof=next(distances)) if packet[1] & 2 else b""

    with driving(answer, answer_s=5.0) as (driver, _):
        driver.act(Command(0.01))
        for expected in (0.2, 0.3):
            sensed = driver.sense(frozenset({"scan"}))["scan.range_m"][0, 0]
            assert sensed == pytest.approx(expected + 0.035)
        driver.open()  # it answers more than it owes: `close` has nothing to wait for


def test_gyro_offset_at_rest_is_corrected() -> None:
    with driving(telling(gyro=(0, 0, 131)), turn_offset_radps=radians(131 * 250 / 32768)) as (driver, _):
        assert driver.sense(frozenset({"imu"}))["imu.turn_radps"] == pytest.approx(0.0)


def test_proximity_is_calibrated_once_on_request() -> None:
    with driving(telling(), calibrate=True) as (driver, robot):
        driver.open()
        driver.sense(frozenset())
        settings = [read(COMMAND, packet)["settings"] for packet in robot.commands]
    assert settings[0] == 1
    assert set(settings[1:]) == {0}


@pytest.mark.parametrize(
    "address",
    ["", ":1000", "host:", "host:0", "host:70000", "tcp/host:1", "a b", "1.2.3.4:x", "a..b", "..", "x" * 70, "a\0b"],
)
def test_invalid_address_is_refused(address: str) -> None:
    with refused_input("driver epuck2", "address"):
        Epuck2Driver(address, BODY, Epuck2Options(), WallClock())


def test_ground_sensors_with_equal_black_and_white_are_refused() -> None:
    with refused_input("driver epuck2", "ground_white"):
        Epuck2Driver("host", BODY, Epuck2Options(ground_black=500, ground_white=500), WallClock())


@pytest.mark.parametrize(("body", "key"), [("footbot", "proximity"), ("turtlebot3-burger", "drive")])
def test_body_of_another_robot_is_refused(body: str, key: str) -> None:
    with refused_input(match=key):
        Epuck2Driver("host", load_body(body), Epuck2Options(), WallClock())
