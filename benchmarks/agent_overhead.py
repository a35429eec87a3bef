"""What the framework costs a single-robot `Agent` in process: per step, and per packet that it reads."""

import statistics
from dataclasses import dataclass

import numpy as np

from benchmarks.agents import Ping
from benchmarks.lines import print_line, spread
from swarmwire.agent.local_backend import LocalBackend
from swarmwire.comms.base.clock import Clock, WallClock
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.messages import encode_rows
from swarmwire.comms.robot.packets import ReceivedPackets
from swarmwire.comms.robot.tick_io import GroupReadings
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment

RAYS, PACKETS = 24, 10  # packets that a robot reads in a step


@dataclass(frozen=True)
class Overhead:
    """Times of one robot's step, in µs."""

    step_us: float  # with nothing received
    packet_us: float  # more, for each packet that it reads


def overhead(clock: Clock, robots: int, packets: int, ticks: int) -> Overhead:
    """The overhead for so many robots in a process, each of which reads so many packets a step, or none."""
    backend = LocalBackend(_assignment(robots))
    backend.start()
    nothing, all_received = ReceivedPackets.none(("range_m",)), _received(robots, packets)
    silent_us = _step_us(clock, backend, robots, nothing, ticks)
    return Overhead(silent_us, (_step_us(clock, backend, robots, all_received, ticks) - silent_us) / packets)


def _step_us(clock: Clock, backend: LocalBackend, robots: int, received: ReceivedPackets, ticks: int) -> float:
    readings = {"bots": GroupReadings(np.arange(robots), {"proximity.value": np.zeros((robots, RAYS))})}
    start_ns = clock.now_ns()
    for tick in range(ticks):
        backend.act(tick, readings, received)
    return (clock.now_ns() - start_ns) / 1e3 / ticks / robots


def _assignment(robots: int) -> Assignment:
    names, keys = tuple(f"bots-{row}" for row in range(robots)), np.arange(robots, dtype=np.uint64)
    body, rows = load_body("footbot"), np.arange(robots)
    return Assignment(
        (GroupAssignment("bots", "benchmarks.agents:Listener", {}, body, rows, names, keys),), 10, ("range_m",)
    )


def _received(robots: int, packets: int) -> ReceivedPackets:
    """As many packets for each robot, each from another sender."""
    receiver, payload = np.repeat(np.arange(robots), packets), np.arange(robots * packets)
    sent = encode_rows(Ping, len(payload), {"number": 0.5})
    zero, range_m = np.zeros(len(payload), np.int64), np.ones(len(payload))
    return ReceivedPackets(
        receiver, np.tile(np.arange(packets), robots), zero, zero, {"range_m": range_m}, payload, sent
    )


def agent_overhead(name: str, repeats: int) -> None:
    """What the framework costs a robot's step, where one robot is all and where there are many, and a packet read."""
    details = {"body": "footbot", "rays": 24, "packets_per_step": PACKETS}
    for robots, ticks, at in ((1, 5000, ""), (100, 100, "-of-100")):
        overhead(WallClock(), robots, PACKETS, ticks // 10)
        overheads = [overhead(WallClock(), robots, PACKETS, ticks) for _ in range(repeats)]
        for part, values in (
            ("step", [cost.step_us for cost in overheads]),
            ("packet", [cost.packet_us for cost in overheads]),
        ):
            line = {"robots": robots, **details, **spread(values)}
            print_line(f"{name}-{part}{at}", statistics.median(values), f"µs per {part}", line)
