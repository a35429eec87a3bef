"""Messages of ROS 2 topics over a radio that loses packets: what arrives, against closed forms."""

from hashlib import blake2b
from itertools import count
from math import comb, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.protocols.ros2.relay import MAX_MESSAGE_BYTES, WINDOW, RelayedTopic, RobotRelay
from swarmwire.comms.robot.messages import CRTP_TAG, RELAY_TAG, Message

HEADER_BYTES = 2 + 1 + 4 + 2 + 2  # of a part, by the page on the relay
RETRY_NS, RETRIES = 300, 3
BEST_EFFORT, RELIABLE = RelayedTopic((BROADCAST,), False), RelayedTopic((BROADCAST,), True)


def relay(topic: RelayedTopic = BEST_EFFORT, max_payload_bytes: int = 111) -> RobotRelay:
    return RobotRelay([topic], max_payload_bytes, RETRY_NS, RETRIES)


class Link:
    """Two robots, 0 and 1, and a medium between them that loses packets independently."""

    def __init__(self, topic: RelayedTopic, loss: float = 0.0, seed: int = 1) -> None:
        self.robots, self._loss = (relay(topic), relay(topic)), loss
        self._random = np.random.default_rng(seed)
        self.now_ns, self.received = 0, list[bytes]()

    def exchange(self) -> None:
        """Let the packets of both robots cross, and time pass until requests are due."""
        self.now_ns += RETRY_NS
        self.received += [message.data for message in self.robots[1].follow(self.now_ns)]
        for sender, receiver in ((1, 0), (0, 1)):  # requests, then parts on request
            for packet in self.robots[sender].pop_packets():
                if self._random.random() >= self._loss:
                    complete = self.robots[receiver].receive(sender, packet.payload, self.now_ns)
                    self.received += [message.data for message in complete]


def message(number: int) -> bytes:
    return number.to_bytes(4, "little") * 63  # 252 bytes: three parts


@pytest.mark.parametrize("size", [0, 1, 99, 100, 101, 250, 65_536])
def test_relay_cuts_a_message_into_packets_of_the_radio_and_puts_it_together(size):
    sender, receiver, data = relay(), relay(), np.random.default_rng(size).bytes(size)
    assert sender.send(0, data)
    packets = [packet.payload for packet in sender.pop_packets()]
    assert len(packets) == max(1, -(-size // 100))
    assert sum(map(len, packets)) == size + HEADER_BYTES * len(packets)
    assert all(len(packet) <= 111 and packet[:2] == RELAY_TAG.to_bytes(2, "little") for packet in packets)
    order = np.random.default_rng(1).permutation(len(packets))
    complete = [receiver.receive(4, packets[part], 0) for part in order]
    assert [[(item.topic, item.sender, item.data) for item in some] for some in complete] == [
        *([[]] * (len(packets) - 1)),
        [(0, 4, data)],
    ]


def test_relay_refuses_what_is_larger_than_it_carries():
    sender = relay()
    assert not sender.send(0, bytes(MAX_MESSAGE_BYTES + 1))
    assert not RobotRelay([BEST_EFFORT], HEADER_BYTES + 1, 1, 1).send(0, bytes(65_536))
    assert sender.pop_packets() == []


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.3])
def test_relay_at_best_effort_delivers_by_the_loss_to_the_power_of_the_parts(loss):
    link, sent = Link(BEST_EFFORT, loss), 3000
    for number in range(sent):
        link.robots[0].send(0, message(number))
        link.exchange()
    expected = (1.0 - loss) ** 3
    assert len(link.received) / sent == pytest.approx(expected, abs=4 * sqrt(expected * (1 - expected) / sent) + 1e-9)
    assert link.robots[1].counts["requests", 0] == 0


def share_complete(loss: float, parts: int, requests: int) -> float:
    """The chance that a message is complete: a request that arrives repairs each missing part by itself."""
    missing = [comb(parts, k) * loss**k * (1 - loss) ** (parts - k) for k in range(parts + 1)]
    for _ in range(requests):
        after = [0.0] * (parts + 1)
        for k, chance in enumerate(missing):
            after[k] += loss * chance
            for repaired in range(k + 1):
                after[k - repaired] += (
                    (1 - loss) * chance * comb(k, repaired) * (1 - loss) ** repaired * loss ** (k - repaired)
                )
        missing = after
    return missing[0]


@pytest.mark.parametrize("loss", [0.1, 0.3, 0.5])
def test_relay_of_a_reliable_topic_delivers_by_the_chance_of_its_requests_in_order(loss):
    link, sent = Link(RELIABLE, loss), 1000
    for number in range(sent):
        link.robots[0].send(0, message(number))
        for _ in range(RETRIES + 2):  # until it is complete or given up
            link.exchange()
    numbers = [int.from_bytes(data[:4], "little") for data in link.received]
    assert numbers == sorted(set(numbers))
    assert [message(number) for number in numbers] == link.received
    expected = share_complete(loss, 3, RETRIES)
    # A message without any part waits for the next one to be missed, when fewer requests may be left for it in time.
    assert len(numbers) / sent == pytest.approx(expected, abs=4 * sqrt(expected * (1 - expected) / sent) + loss**3 / 10)


def test_relay_asks_for_a_message_of_which_no_part_arrived_once_a_later_one_is_heard():
    sender, receiver = relay(RELIABLE), relay(RELIABLE)
    sender.send(0, message(0))
    lost = sender.pop_packets()
    sender.send(0, message(1))
    later = [item for packet in sender.pop_packets() for item in receiver.receive(0, packet.payload, 0)]
    assert later == []  # waits for its predecessor
    assert receiver.follow(RETRY_NS - 1) == []
    assert receiver.pop_packets() == []
    receiver.follow(RETRY_NS)
    (request,) = receiver.pop_packets()
    assert (request.to, len(request.payload)) == (0, 9)
    sender.receive(7, request.payload, RETRY_NS)
    repeated = sender.pop_packets()
    assert [(packet.to, packet.payload) for packet in repeated] == [(7, packet.payload) for packet in lost]
    data = [item.data for packet in repeated for item in receiver.receive(0, packet.payload, RETRY_NS)]
    assert data == [message(0), message(1)]


def test_relay_gives_a_message_up_after_its_requests_and_delivers_later_ones():
    sender, receiver = relay(RELIABLE), relay(RELIABLE)
    sender.send(0, message(0))
    receiver.receive(0, sender.pop_packets()[1].payload, 0)
    sender.send(0, message(1))
    for packet in sender.pop_packets():
        receiver.receive(0, packet.payload, 0)
    requests = list[bytes]()
    for look in range(1, RETRIES + 1):
        assert receiver.follow(look * RETRY_NS) == []
        requests += [packet.payload for packet in receiver.pop_packets()]
    assert [request[-1] for request in requests] == [0b101] * RETRIES  # parts 0 and 2 from part 0 on
    assert [item.data for item in receiver.follow((RETRIES + 1) * RETRY_NS)] == [message(1)]


def test_relay_puts_together_a_bounded_number_of_messages_and_asks_for_no_older_ones():
    sender, receiver = relay(RELIABLE), relay(RELIABLE)
    complete = list[bytes]()
    for number in range(20):  # the middle part of each is lost
        sender.send(0, message(number))
        first, _, last = sender.pop_packets()
        for packet in (first, last):
            complete += [item.data for item in receiver.receive(0, packet.payload, 0)]
    receiver.follow(RETRY_NS)
    requests = receiver.pop_packets()
    assert complete == []
    assert len(requests) == WINDOW
    for request in requests:
        sender.receive(1, request.payload, RETRY_NS)
    for packet in sender.pop_packets():
        complete += [item.data for item in receiver.receive(0, packet.payload, RETRY_NS)]
    assert complete == [message(number) for number in range(20 - WINDOW, 20)]


def test_relay_to_named_robots_sends_each_its_own_packets():
    sender = RobotRelay([RelayedTopic((3, 5), False)], 111, RETRY_NS, RETRIES)
    sender.send(0, message(0))
    assert [packet.to for packet in sender.pop_packets()] == [3, 3, 3, 5, 5, 5]


@given(st.binary(max_size=40), st.booleans())
def test_relay_survives_any_bytes(data, tagged):
    receiver = relay(RELIABLE)
    payload = RELAY_TAG.to_bytes(2, "little") + data if tagged else data
    for _ in range(2):
        receiver.receive(0, payload, 0)
    receiver.follow(RETRY_NS)
    assert all(len(packet.payload) <= 111 for packet in receiver.pop_packets())


def test_tags_of_messages_are_none_of_frames_the_relay_and_crtp():
    def plain_tag(name: str) -> int:
        return 1 + int.from_bytes(blake2b(f"{name}()".encode(), digest_size=2).digest(), "little") % 0xFFFF

    frame, tags = 0x5302, (0x5302, RELAY_TAG, CRTP_TAG)
    names = [next(name for name in map("Try{}".format, count()) if plain_tag(name) == tag) for tag in tags]
    assert [type(name, (Message,), {}).tag for name in names] == [frame + len(tags)] * 3
