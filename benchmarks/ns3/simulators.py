"""One configuration in ns-3 and in the medium: what each node received of each other one."""

# pyright: basic, reportUnknownMemberType=false

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.ns3.configurations import Configuration
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets

NETWORK = Path(__file__).with_name("network.cc")


@dataclass(frozen=True)
class Received:
    """Counts and sums of delays by seed, sender and receiver, (seeds, nodes, nodes); all of packets that count."""

    packets: IntArray
    delay_ns: IntArray


class Receptions(NamedTuple):
    """Packets at receivers that have them, (k,) each; seeds are counted from 0."""

    seed: IntArray
    sender: IntArray
    receiver: IntArray
    sequence: IntArray
    delay_ns: IntArray


def ours(configuration: Configuration) -> Received:
    """The medium, with an arena for each seed."""
    nodes, seeds = configuration.nodes, configuration.seeds
    xy_m = configuration.xy_m().reshape(-1, 2)
    packets, delay_ns = np.zeros(seeds * nodes * nodes, np.int64), np.zeros(seeds * nodes * nodes, np.int64)
    for done in received(configuration, configuration.radio, repeat(xy_m, configuration.ticks + 1)):
        pair = (done.seed * nodes + done.sender) * nodes + done.receiver
        packets += np.bincount(pair, minlength=len(packets))
        np.add.at(delay_ns, pair, done.delay_ns)
    return Received(packets.reshape(seeds, nodes, nodes), delay_ns.reshape(seeds, nodes, nodes))


def received(configuration: Configuration, radio: Radio, walk_m: Iterable[FloatArray]) -> Iterator[Receptions]:
    """What is received of the packets that count, by tick; `walk_m`: places (seeds x nodes, 2) at each tick's start."""
    nodes, seeds, rate_hz = configuration.nodes, configuration.seeds, configuration.rate_hz
    side_m = 2.0 * max(map(abs, configuration.size_m))
    medium = RadioMedium(ChannelContext.open_space(radio, configuration.keys, nodes, (side_m, side_m)), rate_hz)
    senders = np.arange(configuration.senders)
    rows = (nodes * np.arange(seeds)[:, None] + senders).ravel()
    to = np.tile([configuration.receiver_of(sender) for sender in senders.tolist()], seeds)
    sent = SentPackets(
        rows, np.where(to < 0, BROADCAST, to), Payloads.from_rows([bytes(configuration.payload_bytes)] * len(rows))
    )
    first, last = configuration.counted
    from_ns, until_ns = configuration.counted_ns
    for tick, xy_m in enumerate(walk_m):
        at_ns = min(tick_start_ns(tick, rate_hz), until_ns)
        done = medium.step(at_ns, np.column_stack([xy_m, np.zeros(len(xy_m))])).finished
        counts = (done.fate == Fate.RECEIVED) & (done.sequence >= first) & (done.sequence < last)
        counts &= (done.final_at_ns >= from_ns) & (done.final_at_ns < until_ns)
        columns = done.arena, done.sender, done.receiver, done.sequence, done.final_at_ns - done.sent_at_ns
        yield Receptions(*(column[counts] for column in columns))
        if tick < configuration.ticks:
            medium.send(at_ns, tick, sent)


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
