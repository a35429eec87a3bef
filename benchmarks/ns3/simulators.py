"""One configuration in ns-3 and in the medium: what each node received of each other one."""

# pyright: basic, reportUnknownMemberType=false

import os
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.ns3.configurations import Configuration, radio_like_ns3
from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets

NETWORK = Path(__file__).with_name("network.cc")


@dataclass(frozen=True)
class Received:
    """Counts and sums of delays by seed, sender and receiver, (seeds, nodes, nodes); all of packets that count."""

    packets: IntArray
    delay_ns: IntArray


def ours(configuration: Configuration) -> Received:
    """The medium, with an arena for each seed."""
    nodes, seeds, rate_hz = configuration.nodes, configuration.seeds, configuration.rate_hz
    side_m = 2.0 * max(map(abs, configuration.size_m))
    radio = radio_like_ns3(configuration.standard, configuration.rate_mbps)
    medium = RadioMedium(ChannelContext.open_space(radio, configuration.keys, nodes, (side_m, side_m)), rate_hz)
    pose = np.concatenate([configuration.xy_m(), np.zeros((seeds, nodes, 1))], axis=2).reshape(-1, 3)
    senders = np.arange(configuration.senders)
    rows = (nodes * np.arange(seeds)[:, None] + senders).ravel()
    to = np.tile([configuration.receiver_of(sender) for sender in senders.tolist()], seeds)
    sent = SentPackets(
        rows, np.where(to < 0, BROADCAST, to), Payloads.from_rows([bytes(configuration.payload_bytes)] * len(rows))
    )
    first, last = configuration.counted
    from_ns, until_ns = configuration.counted_ns
    packets, delay_ns = np.zeros(seeds * nodes * nodes, np.int64), np.zeros(seeds * nodes * nodes, np.int64)
    for tick in range(configuration.ticks + 1):
        at_ns = min(tick_start_ns(tick, rate_hz), until_ns) if tick < configuration.ticks else until_ns
        done = medium.step(at_ns, pose).finished
        counts = (done.fate == Fate.RECEIVED) & (done.sequence >= first) & (done.sequence < last)
        counts &= (done.final_at_ns >= from_ns) & (done.final_at_ns < until_ns)
        pair = ((done.arena * nodes + done.sender) * nodes + done.receiver)[counts]
        packets += np.bincount(pair, minlength=len(packets))
        np.add.at(delay_ns, pair, (done.final_at_ns - done.sent_at_ns)[counts])
        if tick < configuration.ticks:
            medium.send(at_ns, tick, sent)
    return Received(packets.reshape(seeds, nodes, nodes), delay_ns.reshape(seeds, nodes, nodes))


def theirs(configuration: Configuration) -> Received:
    """ns-3, a run for each seed; in a process of its own, since ns-3 is one simulator for the whole process."""
    pairs = [
        np.array([int(word) for word in in_wheel(configuration.ns3_input(seed)).split()[1:]], np.int64)
        for seed in range(configuration.seeds)
    ]
    both = np.array(pairs).reshape(configuration.seeds, configuration.nodes, configuration.nodes, 2)
    return Received(both[..., 0], both[..., 1])


def in_wheel(text: str) -> str:
    """What `network.cc` answers inside ns-3's wheel."""
    return str(_wheel().simulate(text))


@cache
def _wheel() -> Any:
    """The functions of `network.cc`; what the wheel's compiler says of itself while it is loaded is left out."""
    with Path(os.devnull).open("w") as nowhere:
        stderr = os.dup(2)
        os.dup2(nowhere.fileno(), 2)
        try:
            ns = import_module("ns").ns
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
    ns.cppyy.cppdef(NETWORK.read_text(encoding="utf-8"))
    return ns.cppyy.gbl.validation
