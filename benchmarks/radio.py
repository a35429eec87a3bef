"""The medium alone, in times real time: every robot broadcasts in each tick of 0.1 s, moves a little, and receives.

What is timed is all that a run asks of the medium in a tick: time passes, poses are held, packets are sent, and the
radio graph is drawn.
"""

import statistics
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.lines import print_line, spread
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import WallClock, tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.base.threads import Threads
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.phy.propagation import range_of
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets
from swarmwire.deploy.machine import keep_memory
from swarmwire.deploy.runs.scenario_parts import radio_of

RATE_HZ, TICKS, WARM_UP = 10, 60, 10
BOX_M = (0.2, 0.1)
STEP_M = 0.05  # deviation of each robot's move in a tick, along each axis
PLACES_KEY = 1
SHADOWED = (
    "radio.shadowing.deviation_db=4",
    "radio.shadowing.correlation_m=5",
    "radio.fading.distribution=rayleigh",
    "radio.cut_off_db=10",
)


@dataclass(frozen=True)
class Case:
    """A swarm, spread at random over a square, and its radio."""

    preset: str
    robots: int
    in_range: float  # other robots within the nominal reach of one far from the border
    payload_bytes: int
    keys: tuple[str, ...] = ()
    moves: bool = True
    threads: int = 1
    boxes: int = 0  # of BOX_M, at random places and turned at random

    @property
    def radio(self) -> Radio:
        """The preset with the keys."""
        return radio_of(self.preset, list(self.keys))


CASES = {
    # Shadowing brings more into range than path loss alone would: 25 by path loss are 30 on average, border included.
    "radio-802154-1000": Case(
        "ieee802154", 1000, 25, 20, ("radio.antenna.power_dbm=-20", "radio.cut_off_db=10", *SHADOWED)
    ),
    "radio-802154-1000-threads": Case(
        "ieee802154", 1000, 25, 20, ("radio.antenna.power_dbm=-20", "radio.cut_off_db=10", *SHADOWED), threads=2
    ),
    "radio-disk-1000": Case("unit-disk", 1000, 9.5, 20, ("radio.range_m=1.7",)),
    "radio-wifi-80": Case("wifi-a-6M", 80, 600, 128),
    "radio-wifi-80-standing": Case("wifi-a-6M", 80, 600, 128, moves=False),
}
LINE_OF_SIGHT = Case("unit-disk", 1000, 7.8, 20, ("radio.range_m=5.0", "radio.line_of_sight=true"), boxes=9500)
SCALING = CASES["radio-802154-1000"]
SIZES = (100, 1000, 10_000)


@dataclass(frozen=True)
class Cost:
    """What a tick takes, and what happened in it."""

    tick_s: float
    details: dict[str, Any]

    @property
    def realtime_factor(self) -> float:
        """Simulated over elapsed time."""
        return 1.0 / RATE_HZ / self.tick_s


def cost(case: Case, ticks: int = TICKS) -> Cost:
    """The mean over ticks."""
    keep_memory()  # as a run does
    clock, rng, radio, robots = WallClock(), np.random.default_rng(PLACES_KEY), case.radio, case.robots
    reach_m = range_of(radio)
    assert reach_m is not None
    side_m = float(np.sqrt(robots * np.pi * reach_m**2 / case.in_range))
    keys = np.array([derive_key("arena", 1)], np.uint64)
    obstacles = obstacle_arrays((boxes(case.boxes, side_m),))
    context = ChannelContext.open_space(radio, keys, robots, (side_m, side_m), obstacles)
    air = RadioMedium(replace(context, threads=Threads(case.threads)), RATE_HZ)
    pose: FloatArray = np.column_stack(
        [rng.uniform(-side_m / 2, side_m / 2, (robots, 2)), rng.uniform(-3, 3, (robots, 1))]
    )
    sent = SentPackets(
        np.arange(robots), np.full(robots, BROADCAST), Payloads.from_rows([bytes(case.payload_bytes)] * robots)
    )
    spent_ns, in_range, fates = 0, 0, np.zeros(len(Fate), np.int64)
    for tick in range(WARM_UP + ticks):
        at_ns = tick_start_ns(tick, RATE_HZ)
        start_ns = clock.now_ns()
        news = air.step(at_ns, pose)
        air.send(at_ns, tick, sent)
        if tick >= WARM_UP:
            spent_ns += clock.now_ns() - start_ns
            in_range += int(news.tally.in_range.sum())
            fates += news.tally.fates.sum(axis=0)
        if case.moves:
            pose = pose.copy()  # the medium keeps the one that it was given
            pose[:, :2] += rng.normal(0.0, STEP_M, (robots, 2))
    packets = ticks * robots
    details = {
        "robots": robots,
        "rate_hz": RATE_HZ,
        "payload_bytes": case.payload_bytes,
        "preset": case.preset,
        "keys": list(case.keys),
        "moves": case.moves,
        "threads": case.threads,
        "side_m": round(side_m, 1),
        "boxes": case.boxes,
        "in_range": round(in_range / packets, 1),
        "received": round(float(fates[Fate.RECEIVED]) / packets, 1),
        "collided": round(float(fates[Fate.COLLIDED]) / packets, 1),
        "ticks": ticks,
    }
    return Cost(spent_ns * 1e-9 / ticks, details)


def boxes(count: int, side_m: float) -> tuple[Obstacle, ...]:
    """So many boxes over a square with this side."""
    rng = np.random.default_rng(PLACES_KEY)
    rows = rng.uniform([-0.5 * side_m, -0.5 * side_m, -np.pi], [0.5 * side_m, 0.5 * side_m, np.pi], (count, 3))
    return tuple(Obstacle("box", *row, size_m=BOX_M) for row in rows.tolist())


def scaling() -> tuple[float, dict[str, Any]]:
    """The cost of a link among the most robots over that among the fewest, whichever is dearer on top."""
    costs = [cost(replace(SCALING, robots=robots), ticks=max(10, 20_000 // robots)) for robots in SIZES]
    links_us = [1e6 * each.tick_s / each.details["robots"] / each.details["in_range"] for each in costs]
    details = {f"us_per_link_{robots}": round(us, 3) for robots, us in zip(SIZES, links_us, strict=True)}
    return max(links_us) / min(links_us), {**costs[-1].details, **details}


def air_cost(name: str, repeats: int) -> None:
    """Real-time factor of the medium alone, without robots to act."""
    costs = [cost(CASES[name]) for _ in range(repeats)]
    factors = [each.realtime_factor for each in costs]
    print_line(name, statistics.median(factors), "x real time", {**costs[0].details, **spread(factors)})


def line_of_sight(name: str, repeats: int) -> None:
    """A tick of the medium on a map of many boxes, each of which may block a link."""
    costs = [cost(LINE_OF_SIGHT) for _ in range(repeats)]
    ticks_ms = [1e3 * each.tick_s for each in costs]
    print_line(name, statistics.median(ticks_ms), "ms per tick", {**costs[0].details, **spread(ticks_ms)})


def air_scaling(name: str, repeats: int) -> None:
    """How much dearer a link is in one swarm than in another of the same density."""
    measured = [scaling() for _ in range(repeats)]
    ratios = [ratio for ratio, _ in measured]
    print_line(name, statistics.median(ratios), "dearest over cheapest", {**measured[0][1], **spread(ratios)})
