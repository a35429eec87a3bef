"""What a link may do to the bytes of a protocol that is this project's own to read."""

from collections.abc import Iterator

import numpy as np
import pytest

from swarmwire.agent.drivers.driver import Command
from tests.support.robots.faulty_link import Before, ByteByByte, CutAfter, FaultyLink, Late, Nothing
from tests.support.robots.rig import OwnWireRig, opened, readings, sense_until_lost
from tests.support.robots.rigs import RIGS
from tests.support.waiting import until

OWN = [name for name, kind in RIGS.items() if issubclass(kind, OwnWireRig)]
pytestmark = pytest.mark.parametrize("rig", OWN, indirect=True)


@pytest.fixture
def link(rig: OwnWireRig) -> Iterator[FaultyLink]:
    """A link that passes everything on, with the rig's driver open at its end."""
    with FaultyLink(rig.address_of_link()) as made:
        rig.connect(made.address)
        rig.told()
        yield made
        rig.driver.close()


def test_answers_that_come_byte_by_byte_are_read(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers = ByteByByte()
    for travel_m in (0.1, 0.2, 0.3):
        rig.come_back(readings(travel_m))


def test_commands_that_come_byte_by_byte_are_read(rig: OwnWireRig, link: FaultyLink) -> None:
    link.commands = ByteByByte()
    for linear_mps in (0.05, -0.02):
        rig.driver.act(Command(linear_mps, 1.0))
        rig.until_told(linear_mps, 1.0)


def test_garbage_ends_the_connection_and_a_new_one_reads_on(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers = Before(b"\x77")
    sense_until_lost(rig)
    assert rig.driver.counts()["garbage"] == 1
    until(lambda: opened(rig.driver))
    rig.come_back(readings(0.1))


@pytest.mark.parametrize("size", [0, 1, 60])
def test_a_robot_that_falls_silent_within_an_answer_is_lost(rig: OwnWireRig, link: FaultyLink, size: int) -> None:
    link.answers = CutAfter(size)
    sense_until_lost(rig)
    assert rig.driver.counts()["silences"] == 1
    link.answers = Nothing()
    until(lambda: opened(rig.driver))
    rig.come_back(readings(0.1))


@pytest.mark.parametrize("size", [0, 1, 60])
def test_a_robot_that_hangs_up_within_an_answer_is_lost(rig: OwnWireRig, link: FaultyLink, size: int) -> None:
    link.answers = CutAfter(size, hang_up=True)
    sense_until_lost(rig)
    assert rig.driver.counts()["hung_up"] == 1
    link.answers = Nothing()
    until(lambda: opened(rig.driver))
    rig.come_back(readings(0.1))


def test_an_answer_that_is_late_leaves_the_reading_before_and_is_read_when_it_comes(
    rig: OwnWireRig, link: FaultyLink
) -> None:
    rig.come_back(readings(0.1))
    link.answers = late = Late()
    rig.publish(readings(0.2))
    before = rig.driver.sense(frozenset({"odometry"}))
    assert before["odometry.left_m"] == pytest.approx(0.1, abs=1e-3)
    assert rig.driver.counts()["late_answers"] >= 1
    late.let_go.set()
    rig.come_back(readings(0.2))
    assert "hung_up" not in rig.driver.counts()


def test_a_robot_that_cannot_be_reached_is_not_waited_for_by_who_stops_it(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers, link.commands = CutAfter(0), CutAfter(0)
    began_ns = rig.clock.now_ns()
    for _ in range(100):
        rig.driver.stop()
    assert rig.clock.now_ns() - began_ns < 1_000_000_000
    sense_until_lost(rig)


def test_a_robot_goes_on_as_it_was_told_when_its_link_is_lost(rig: OwnWireRig, link: FaultyLink) -> None:
    rig.driver.act(Command(0.05, 0.0))
    rig.until_told(0.05, 0.0)
    link.answers = CutAfter(0, hang_up=True)
    sense_until_lost(rig)
    told = rig.told().speeds
    assert all(np.isclose(linear_mps, 0.05, atol=1e-3) for linear_mps, _ in told)
