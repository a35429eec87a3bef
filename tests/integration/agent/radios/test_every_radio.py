"""What holds of every radio of an agent on a robot, whatever it speaks with."""

from collections.abc import Generator
from contextlib import contextmanager

import numpy as np
import pytest

from swarmwire.agent.radios.radio import RobotRadio
from swarmwire.agent.radios.tracker import Tracker
from swarmwire.agent.radios.world_radio import WorldRadio
from swarmwire.comms.clock import WallClock
from swarmwire.comms.packets import BROADCAST, Payloads, SentPackets
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import open_swarm
from swarmwire.world.gateways.radio_bridge import BridgedRadio, RadioBridge
from tests.support.swarms import ANY_PORT, KEYS, ROBOTS, peers, radio, words


@contextmanager
def by_zenoh() -> Generator[RobotRadio]:
    with peers(1) as (session,):
        yield radio(session, "flock-1")


@contextmanager
def by_zenoh_and_tracker() -> Generator[RobotRadio]:
    with peers(1) as (session,):
        yield radio(session, "flock-1", tracker=Tracker(session, KEYS, ROBOTS), needs_pose=True)


@contextmanager
def by_air() -> Generator[RobotRadio]:
    bridge = RadioBridge(
        Network(ANY_PORT), KEYS, {"flock-1": 1}, BridgedRadio(ROBOTS, 10, 100, ("rssi_dbm",), ("radio.rssi",))
    )
    session = open_swarm(Network(connect=bridge.open()))
    try:
        made = WorldRadio(session, KEYS, ROBOTS, "flock-1", WallClock())
        made.open()
        yield made
    finally:
        session.close()
        bridge.close()


@pytest.fixture(params=[by_zenoh, by_zenoh_and_tracker, by_air])
def any_radio(request) -> Generator[RobotRadio]:
    with request.param() as made:
        yield made


NEEDS = {"range_m": "radio.range", "bearing_rad": "radio.bearing", "rssi_dbm": "radio.rssi"}


def test_silence_is_a_table_of_nothing_with_the_columns_that_it_gives(any_radio):
    for _ in range(2):
        received, tx_status = any_radio.received(0)
        assert (len(received), len(tx_status)) == (0, 0)
        assert tuple(received.given) == any_radio.measures
    assert any_radio.needs == {NEEDS[column] for column in any_radio.measures}


def test_what_is_sent_is_counted_and_nothing_to_send_is_nothing(any_radio):
    any_radio.send(SentPackets.none())
    assert any_radio.counts() == {}
    any_radio.send(words(1.0, 2.0, row=1))
    assert any_radio.counts() == {"packets_sent": 2}
    assert all(type(count) is int for count in any_radio.counts().values())


def test_what_is_larger_than_the_payload_limit_is_counted_and_raises_nothing(any_radio):
    any_radio.send(SentPackets(np.array([1]), np.array([BROADCAST]), Payloads.of([bytes(101)])))
    assert any_radio.counts() == {"packets_too_large": 1}


def test_it_may_be_closed_twice_and_asked_even_then(any_radio):
    any_radio.close()
    any_radio.close()
    assert len(any_radio.received(0)[0]) == 0
