"""Hidden nodes: two senders that do not hear each other and one that hears both, in ns-3 and in the medium."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.ns3_reference import radio_far_apart, recorded
from swarmwire.comms.arrays import FloatArray, IntArray, KeyArray
from swarmwire.comms.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.draws import derive_key, purpose, uniform
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.packets import BROADCAST, Fate, Payloads, SentPackets
from swarmwire.comms.radio.config.phy import Walls
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.propagation.path_loss import reach_m
from swarmwire.comms.truth import Obstacle

FILE = "ns3_hidden_node.json"
SEEDS, PACKETS = 100, 100  # of the table: 10,000 packets of either sender
LIMIT = 0.03  # of a sender's delivery ratio, absolute
A, B, ROBOTS = 0, 1, 3  # the third one listens
APART_DB = 300.0  # what the obstacle between the senders takes, as in ns-3
PILLAR_M = 0.05
SIZE_M = (80.0, 80.0)
STEPS = 50  # ticks in an interval, one of which is drawn for each packet
WARM_UP = 4  # intervals
LATE_NS = NS_PER_S  # after the last packet its reception ends as well
BEGIN, INSTANT = purpose("hidden node's first interval"), purpose("hidden node's instant")


@dataclass(frozen=True)
class Case:
    """A row of the reference."""

    technology: str
    powers: str
    loss_a_db: float
    loss_b_db: float
    payload_bytes: int
    interval_s: float
    delivery_a: float
    delivery_b: float


def cases() -> list[Case]:
    """All that ns-3 was run for."""
    names = ("technology", "powers", "loss_a_db", "loss_b_db", "payload_bytes", "interval_s")
    names += ("delivery_ratio_a", "delivery_ratio_b")
    return [Case(*(row[name] for name in names)) for row in recorded(FILE)["rows"]]


def delivered(case: Case, seeds: Sequence[int], packets: int) -> tuple[float, float]:
    """The shares of both senders' packets that are received, of so many each for each seed; an arena per seed."""
    radio = replace(radio_far_apart(case.technology), walls=Walls(APART_DB))
    curve, arenas = radio.loss_model.curve(radio.frequency_hz), len(seeds)
    pose, pillar = places(float(reach_m(curve, case.loss_a_db)), float(reach_m(curve, case.loss_b_db)))
    rate_hz = round(STEPS / case.interval_s)
    keys = np.array([derive_key("hidden node", seed) for seed in seeds], np.uint64)
    air = RadioMedium(radio, keys, ROBOTS, SIZE_M, obstacle_arrays(((pillar,),) * arenas), rate_hz)
    poses = np.tile(pose, (arenas, 1))
    last = WARM_UP + packets
    received = np.zeros(2, np.int64)

    def listen(until_ns: int) -> None:
        done = air.step(until_ns, poses).finished
        counts = (done.fate == Fate.RECEIVED) & (done.receiver == ROBOTS - 1)
        counts &= (done.sequence >= WARM_UP) & (done.sequence < last)
        received[:] += np.bincount(done.sender[counts], minlength=2)

    now_ns = 0
    for tick, sender in enumerate(schedule(keys, last + 1)):  # one more: the last that count have company, too
        now_ns = tick_start_ns(tick, rate_hz)
        listen(now_ns)
        if len(sender):
            payloads = Payloads.of([bytes(case.payload_bytes)] * len(sender))
            air.send(now_ns, tick, SentPackets(sender, np.full(len(sender), BROADCAST), payloads))
    listen(now_ns + LATE_NS)
    a, b = received / (arenas * packets)
    return float(a), float(b)


def schedule(keys: KeyArray, packets: int) -> list[IntArray]:
    """Rows of those that hand over a packet, tick by tick, until all have as many.

    Packet k of a sender comes in a random tick of its k-th interval; its first interval begins in a random tick.
    """
    rows = (ROBOTS * np.arange(len(keys))[:, None] + [A, B]).ravel()
    key, sender, k = np.repeat(keys, 2)[:, None], (rows % ROBOTS)[:, None], np.arange(packets)
    begin = np.floor(uniform(key, sender, 0, 0, BEGIN) * STEPS)
    tick = (begin + STEPS * k + np.floor(uniform(key, sender, k, 0, INSTANT) * STEPS)).astype(np.int64)
    by_tick: list[list[int]] = [[] for _ in range(STEPS * (packets + 1))]
    for row, ticks in zip(rows.tolist(), tick.tolist(), strict=True):
        for at in ticks:
            by_tick[at].append(row)
    return [np.array(found, np.int64) for found in by_tick]


def places(a_m: float, b_m: float) -> tuple[FloatArray, Obstacle]:
    """Poses of a, b and the one between, at right angles, and a pillar on the line from a to b."""
    pose = np.array([[0.0, a_m, 0.0], [b_m, 0.0, 0.0], [0.0, 0.0, 0.0]])
    return pose, Obstacle("cylinder", 0.5 * b_m, 0.5 * a_m, radius_m=PILLAR_M)


def agrees(case: Case, ours: tuple[float, float]) -> bool:
    """Whether both senders' figures lie within the limit."""
    return abs(ours[0] - case.delivery_a) <= LIMIT and abs(ours[1] - case.delivery_b) <= LIMIT


def table(seeds: Sequence[int] = range(SEEDS), packets: int = PACKETS) -> Iterator[str]:
    """Lines of the table, each as soon as it is known."""
    columns = ["technology", "powers", "payload, bytes", "interval, s", "ns-3: a", "ours: a", "difference"]
    columns += ["ns-3: b", "ours: b", "difference", "within limits"]
    yield "| " + " | ".join(columns) + " |"
    yield "| --- " * len(columns) + "|"
    for case in cases():
        ours = delivered(case, seeds, packets)
        cells = [case.technology, case.powers, str(case.payload_bytes), f"{case.interval_s:g}"]
        for ns3, own in zip((case.delivery_a, case.delivery_b), ours, strict=True):
            cells += [f"{ns3:.3f}", f"{own:.3f}", f"{own - ns3:+.3f}"]
        yield "| " + " | ".join([*cells, "yes" if agrees(case, ours) else "**no**"]) + " |"
