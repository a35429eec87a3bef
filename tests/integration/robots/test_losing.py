"""Robots that die, and gateways that go away and come back."""

import pytest

from swarmwire.agent.drivers.driver import Command, DriverLost
from swarmwire.comms.clock import to_s
from tests.support.robots.rig import Rig, opened, readings, sense_until_lost
from tests.support.waiting import until

SLACK_S = 2.0  # of a machine that is busy


def test_nobody_at_the_address_is_told_at_once(rig: Rig) -> None:
    rig.gateway.close()
    rig.connect_s = 0.3
    driver = rig.made_driver(rig.address)
    with pytest.raises(DriverLost):
        driver.open()
    with pytest.raises(DriverLost):
        driver.sense(frozenset())
    with pytest.raises(DriverLost):
        driver.act(Command())


def test_a_robot_that_dies_is_lost_in_time_and_found_again_when_it_lives(connected: Rig) -> None:
    connected.publish(readings(0.0))
    connected.driver.sense(frozenset({"odometry"}))
    connected.publish(readings(0.0), alive=False)
    began_ns = connected.clock.now_ns()
    sense_until_lost(connected)
    took_s = to_s(connected.clock.now_ns() - began_ns)
    assert took_s < connected.silent_s + SLACK_S

    connected.connect_s = 0.3
    assert not opened(connected.made_driver(connected.address))
    connected.publish(readings(0.0))
    until(lambda: opened(connected.driver))
    connected.come_back(readings(0.01))


def test_a_dead_robot_takes_no_command(connected: Rig) -> None:
    connected.publish(readings(0.0), alive=False)
    connected.told()
    connected.driver.act(Command(0.05, 0.0))
    sense_until_lost(connected)
    assert all(linear_mps == 0.0 for linear_mps, _ in connected.told().speeds)


def test_a_robot_that_is_revived_is_at_rest(connected: Rig) -> None:
    connected.driver.act(Command(0.05, 0.0))
    connected.until_told(0.05, 0.0)
    connected.publish(readings(0.0), alive=False)
    connected.publish(readings(0.0))
    connected.until_told(0.0, 0.0)


def test_odometry_goes_on_after_the_gateway_was_closed_and_opened_again(connected: Rig) -> None:
    connected.come_back(readings(0.0))
    far_m = 0.8 * connected.farthest_m
    connected.come_back(readings(far_m))
    connected.gateway.close()
    sense_until_lost(connected)

    connected.reopen()
    connected.publish(readings(far_m + 0.01))  # it rolled on for a moment
    connected.driver.open()
    connected.come_back(readings(far_m + 0.01))
    connected.come_back(readings(2.0 * far_m))


def test_a_driver_that_reconnects_has_its_robot_at_rest_first(connected: Rig) -> None:
    connected.driver.act(Command(0.05, 0.0))
    connected.until_told(0.05, 0.0)
    connected.driver.open()
    connected.until_told(0.0, 0.0)
    connected.driver.act(Command(0.03, 0.0))
    connected.until_told(0.03, 0.0)
