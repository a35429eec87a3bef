"""Packets come to one robot as `Packet`, to n robots as `Packets` with `Columns`, and say the same."""

import numpy as np

from swarmwire.agent import Agent, Packet, VectorAgent
from swarmwire.agent.packet import Columns, Packets
from swarmwire.comms.messages import DICT_TAG, encode_dict
from swarmwire.comms.packets import BROADCAST, Payloads, Sent
from tests.support.agent.hosts import heard_from
from tests.support.agent.players import Word
from tests.unit.agent.test_host import host_of, step, words

told = {}
DICTS = (b"", b"\xc1", b"\x81", b"\x01", b"\x93\x01\x02\x03", b"\x81\x91\x01\x01", b"\x80\x00", b"\x91" * 600)


class Alone(Agent):
    needs = ("radio.range", "radio.bearing")

    def step(self, robot):
        packets: list[Packet[Word]] = robot.radio.heard(Word)
        assert all(isinstance(packet, Packet) for packet in packets)
        told["alone"] = [(packet.sender, packet.range_m, packet.message.number) for packet in packets]


class Rows(VectorAgent):
    needs = ("radio.range", "radio.bearing")

    def step(self, robots, state):
        packets: Packets[Word] = robots.radio.heard(Word)
        assert isinstance(packets.message, Columns)
        columns = (packets.sender, packets.range_m, packets.message.number)
        told["rows"] = list(zip(*(column.tolist() for column in columns), strict=True))


def test_one_robot_hears_in_packets_what_n_robots_hear_in_columns():
    for kind in (Alone, Rows):
        step(host_of(kind, [5]), 0, [5], heard_from(words(0, 2), [5]))
    assert told["alone"] == told["rows"]
    assert [sender for sender, _, _ in told["alone"]] == [0, 2]


def test_what_bears_the_tag_of_a_dict_and_is_none_is_not_heard():
    """A runner of others may send any bytes: they must not end the run in whoever hears them."""

    class Hears(Agent):
        def step(self, robot):
            told["dicts"] = [packet.message for packet in robot.radio.heard(dict)]

    tag = DICT_TAG.to_bytes(2, "little")
    payloads = Payloads.of([*(tag + data for data in DICTS), encode_dict({"x": 1})])
    sender = np.zeros(len(payloads), np.int64)
    step(host_of(Hears, [5]), 0, [5], heard_from(Sent(sender, sender + BROADCAST, payloads), [5]))
    assert told["dicts"] == [{"x": 1}]
