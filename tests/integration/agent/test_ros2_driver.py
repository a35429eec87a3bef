"""The ROS 2 driver and a base whose messages another library encodes."""

import threading
from dataclasses import replace
from math import inf, nan, pi

import numpy as np
import pytest
import zenoh
from zenoh.ext import Int64, z_deserialize

from swarmwire.agent.drivers.driver import Command, DriverLost
from swarmwire.agent.drivers.ros2 import Ros2Driver, Ros2Options
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.protocols.ros2.links import close, open_client
from swarmwire.comms.robot.bodies.body import load_body
from tests.support.agent.drivers.ros2.bases import HASHES, RosBase, base_and_driver, turtlebot
from tests.support.clocks import until
from tests.support.comms.protocols.ros2 import independent
from tests.support.comms.protocols.ros2.independent import Quaternion, Vector3, odometry
from tests.support.refusals import refused_input

TRANSPORTS = pytest.mark.parametrize("transport", ["bridge", "rmw"])
ALL = frozenset({"scan", "proximity", "odometry", "imu", "compass", "battery", "light"})
ZEROS = [0.0] * 9
EXPECTED = {
    "odometry.left_m": 0.02,
    "odometry.right_m": 0.02,
    "imu.forward_mps2": 1.0,
    "imu.left_mps2": 2.0,
    "imu.turn_radps": 0.3,
    "compass.heading_rad": pi / 2,
    "battery.charge": 0.5,
    "battery.voltage_v": 11.0,
}
QUARTER = Quaternion(z=2**-0.5, w=2**-0.5)


def imu() -> independent.Imu:
    return independent.Imu(independent.header(), QUARTER, ZEROS, Vector3(z=0.3), ZEROS, Vector3(1.0, 2.0, 9.8), ZEROS)


def battery() -> independent.BatteryState:
    return independent.BatteryState(
        independent.header(), 11.0, *[nan] * 5, 0.5, 2, 1, 2, True, [], [], "slot", "number"
    )


def publish_all(base: RosBase) -> None:
    ranges = np.full(360, 2.0)
    ranges[90] = 0.205  # left side, 0.1 m from the rim
    base.publish("scan", independent.laser_scan(ranges))
    base.publish("odom", odometry(0.0, 0.0, Quaternion(), 0))
    base.publish("odom", odometry(0.02, 0.0, Quaternion(), 100_000_000))
    base.publish("imu", imu())
    base.publish("battery_state", battery())
    base.publish("illuminance_0", independent.Illuminance(independent.header(), 250.0, 0.0))
    base.publish("illuminance_1", independent.Illuminance(independent.header(), 5000.0, 0.0))


def received_all(fields) -> bool:
    return (
        np.isfinite(fields["scan.range_m"]).all()
        and fields["odometry.left_m"][0] > 0.0
        and np.isfinite(fields["imu.turn_radps"][0] + fields["battery.charge"][0])
        and fields["light.value"].all()
    )


@TRANSPORTS
def test_driver_reads_topics_in_the_units_and_signs_of_sensors(transport):
    with base_and_driver(transport) as (base, driver):
        assert driver.measures == ALL
        publish_all(base)
        fields = until(lambda: driver.sense(ALL), received_all)
    assert fields["scan.range_m"].shape == (1, 360)
    assert fields["scan.range_m"][0, [0, 90]] == pytest.approx([2.0, 0.205])
    assert fields["proximity.value"] == pytest.approx(np.array([[0.0, 0.8, 0.0, 0.0]]), abs=1e-6)
    assert fields["light.value"] == pytest.approx(np.array([[0.25, 1.0]]))
    assert fields.keys() - EXPECTED.keys() == {"scan.range_m", "proximity.value", "light.value"}
    single = {name: float(value[0]) for name, value in fields.items() if value.shape == (1,)}
    assert single == pytest.approx(EXPECTED)


@pytest.mark.parametrize(("transport", "stamped"), [("bridge", False), ("rmw", True)])
def test_commands_are_repeated_until_a_stop_from_another_thread(transport, stamped):
    with base_and_driver(transport, stamped=stamped) as (base, driver):
        assert base.command() == (0.0, 0.0)
        driver.act(Command(0.1, -0.5))
        until(base.command, lambda command: command == (0.1, -0.5))
        for _ in range(5):
            assert base.command() == (0.1, -0.5)
        thread = threading.Thread(target=driver.stop)
        thread.start()
        thread.join()
        until(base.command, lambda command: command == (0.0, 0.0))
        count = len(base.received)
        driver.close()
        assert all((command.linear.x, command.angular.z) == (0.0, 0.0) for command in base.received[count - 1 :])


def test_messages_to_rmw_have_a_valid_attachment():
    with base_and_driver("rmw") as (base, driver):
        driver.act(Command(0.1))
        for _ in range(4):
            base.command()
        driver.stop()
    read = [z_deserialize(tuple[Int64, Int64, bytes], zenoh.ZBytes(attached)) for attached in base.attached if attached]
    assert [int(sequence) for sequence, _, _ in read] == list(range(1, len(read) + 1))
    assert len({publisher for _, _, publisher in read}) == 1
    assert all(len(publisher) == 16 for _, _, publisher in read)


def test_driver_is_in_the_graph_of_rmw():
    with base_and_driver("rmw") as (base, _):
        tokens = until(
            lambda: [str(reply.ok.key_expr) for reply in base.session.liveliness().get("@ros2_lv/0/**") if reply.ok],
            lambda value: len(value) == 8,
        )
    command = sorted("/".join(token.split("/")[5:]) for token in tokens)
    twist = f"geometry_msgs::msg::dds_::Twist_/{HASHES['geometry_msgs/msg/Twist']}/::,10:,:,:,,"
    assert "NN/%/%flock_1/swarmwire_driver" in command
    assert f"MP/%/%flock_1/swarmwire_driver/%flock_1%cmd_vel/{twist}" in command
    assert sum(token.startswith("MS/") for token in command) == 6


@TRANSPORTS
def test_silent_base_is_lost_and_stopped(transport):
    with base_and_driver(transport, stale_s=0.3) as (base, driver):
        base.publish("odom", odometry(0.0, 0.0, Quaternion(), 0))
        sensors = frozenset({"odometry"})
        until(lambda: driver.sense(sensors), lambda fields: np.isfinite(fields["odometry.left_m"][0]))
        driver.act(Command(0.1))
        until(base.command, lambda command: command[0] == 0.1)
        with pytest.raises(DriverLost, match=r"nothing on the topic odom for 0\.3 s"):
            until(lambda: driver.sense(sensors), lambda _: False)
        until(base.command, lambda command: command[0] == 0.0)


def test_rare_battery_messages_are_no_loss():
    with base_and_driver("bridge", stale_s=0.001) as (_, driver):
        assert np.isnan(driver.sense(frozenset({"battery"}))["battery.charge"]).all()


@TRANSPORTS
def test_base_without_a_first_scan_stays_at_rest(transport):
    with base_and_driver(transport) as (base, driver):
        driver.sense(frozenset({"scan"}))
        driver.act(Command(0.1))
        assert driver.counts()["held_back"] == 1
        base.publish("scan", independent.laser_scan([1.0] * 8))
        until(lambda: driver.sense(frozenset({"scan"})), lambda fields: np.isfinite(fields["scan.range_m"]).all())
        driver.act(Command(0.1))
        until(base.command, lambda command: command[0] == 0.1)
        assert {command.linear.x for command in base.received} == {0.0, 0.1}
        assert driver.counts()["held_back"] == 1


@TRANSPORTS
def test_garbage_is_counted_and_leaves_the_last_reading(transport):
    with base_and_driver(transport) as (base, driver):
        sensors = frozenset({"imu", "scan"})
        base.publish("imu", imu())
        before = until(lambda: driver.sense(sensors), lambda fields: np.isfinite(fields["imu.turn_radps"][0]))
        for count, payload in enumerate((b"", b"\0\1\0\0", b"garbage" * 20, imu().serialize()[:-40]), start=1):
            base.publish("imu", imu(), payload)
            until(lambda: (driver.sense(sensors), driver.counts()["garbage"])[1], lambda value, at=count: value == at)
        base.publish("scan", independent.laser_scan([1.0] * 4, step_rad=inf))
        until(lambda: (driver.sense(sensors), driver.counts()["garbage"])[1], lambda value: value == 5)
        after = driver.sense(sensors)
        assert all(np.array_equal(before[name], after[name], equal_nan=True) for name in before)


def test_messages_that_rmw_would_drop_are_counted():
    with base_and_driver("rmw") as (base, driver):
        for attachment in (None, b"x"):
            base.publish("imu", imu(), attachment=attachment)
        until(lambda: driver.counts()["without_attachment"], lambda count: count == 2)
        assert np.isnan(driver.sense(frozenset({"imu"}))["imu.turn_radps"][0])


@TRANSPORTS
def test_driver_without_a_command_subscriber_is_lost(transport):
    base = RosBase(transport)
    options = Ros2Options(transport=transport, namespace="other" if transport == "bridge" else "", stamped=True)
    driver = Ros2Driver(base.address, turtlebot(), replace(options, connect_s=0.1), WallClock())
    driver.robot = "flock-1"
    name = "other" if transport == "bridge" else "flock_1"
    try:
        with pytest.raises(
            DriverLost, match=f"no subscriber for TwistStamped on /{name}/cmd_vel behind {base.address}"
        ):
            driver.open()
        with pytest.raises(DriverLost, match="not connected"):
            driver.sense(frozenset())
    finally:
        base.close()


def test_command_that_is_not_finite_is_a_stop():
    with base_and_driver("bridge") as (base, driver):
        driver.act(Command(nan, 0.5))
        until(lambda: driver.counts().get("not_finite", 0))
        base.command()
        assert all((command.linear.x, command.angular.z) == (0.0, 0.0) for command in base.received)


def test_topics_and_namespace_are_options():
    base = RosBase("bridge")
    options = Ros2Options(namespace="/", command_topic="base/cmd", imu_topic="/imu/data", north_deg=90.0)
    driver = Ros2Driver(base.address, load_body("turtlebot3-burger"), options, WallClock())
    listener = open_client(base.address, 5.0)
    try:
        subscriber = listener.declare_subscriber("base/cmd")
        driver.open()
        driver.act(Command(0.1))
        until(lambda: subscriber.try_recv() is not None)
        base.session.put("imu/data", imu().serialize())
        compass = frozenset({"compass"})
        value = until(lambda: driver.sense(compass)["compass.heading_rad"][0], lambda value: not np.isnan(value))
        assert value == pytest.approx(pi)
    finally:
        driver.close()
        close(listener)
        base.close()


@pytest.mark.parametrize("address", ["", "robot", "robot:7447", "tcp/robot", "serial/ttyS0:1"])
def test_address_that_is_no_endpoint_is_refused(address):
    with refused_input("driver", "address"):
        Ros2Driver(address, turtlebot(), Ros2Options(), WallClock())


def test_invalid_topic_name_is_refused():
    with refused_input("driver", "scan_topic"):
        Ros2Driver("tcp/robot:7447", turtlebot(), Ros2Options(scan_topic="my scan"), WallClock())


def test_body_without_a_scanner_has_no_scan_sensors():
    driver = Ros2Driver("tcp/robot:7447", load_body("epuck-gps"), Ros2Options(), WallClock())
    assert "scan" not in driver.measures
    assert "positioning" not in driver.measures
