"""Packets come to one robot as `Packet`, to n robots as `Packets` with `Columns`, and say the same."""

from swarmwire.agent import Agent, Packet, VectorAgent
from swarmwire.agent.packet import Columns, Packets
from tests.agent.hosts import heard_from
from tests.agent.players import Word
from tests.agent.test_host import host_of, step, words

told = {}


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
