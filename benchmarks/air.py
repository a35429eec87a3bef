"""What the air costs per tick: everybody broadcasts 10 bytes, 1 robot per square metre, about 9 neighbours."""

import sys

import numpy as np

from swarmwire.comms.air.air import Air
from swarmwire.comms.air.radio import BearingGiven, Gives, Radio, RangeGiven
from swarmwire.comms.clock import WallClock, tick_start_ns
from swarmwire.comms.geometry import obstacle_arrays
from swarmwire.comms.packets import BROADCAST, Payloads, Sent
from swarmwire.comms.truth import Obstacle

RATE_HZ, TICKS, WARM_UP = 10, 200, 20
CASES = {
    "disk": Radio(1.7),
    "disk, loss, latency, jitter": Radio(1.7, loss=0.3, latency_s=0.1, jitter_s=0.02),
    "the same with range and bearing, noisy": Radio(
        1.7, loss=0.3, latency_s=0.1, jitter_s=0.02, gives=Gives(RangeGiven(0.02), BearingGiven(0.05))
    ),
}


def cost_ms(radio: Radio, arenas: int, robots: int, obstacles: int) -> tuple[float, float, float, float]:
    """Median milliseconds per tick of send, advance and edges, and packets heard per robot and tick."""
    clock = WallClock()
    rng = np.random.default_rng(1)
    side = robots**0.5
    rows = arenas * robots
    placed = tuple(
        tuple(Obstacle("cylinder", *rng.uniform(-side / 2, side / 2, 2), radius_m=0.1) for _ in range(obstacles))
        for _ in range(arenas)
    )
    air = Air(radio, np.arange(arenas, dtype=np.uint64), robots, (side, side), obstacle_arrays(placed), RATE_HZ)
    pose = np.column_stack([rng.uniform(-side / 2, side / 2, (rows, 2)), rng.uniform(-3, 3, rows)])
    alive = np.ones(rows, np.bool_)
    sent = Sent(np.arange(rows), np.full(rows, BROADCAST), Payloads.of([b"0123456789"] * rows))
    spent = np.zeros((TICKS, 3))
    heard = 0
    for tick in range(TICKS):
        at_ns = tick_start_ns(tick, RATE_HZ)
        t0 = clock.now_ns()
        news = air.advance(at_ns)
        t1 = clock.now_ns()
        air.edges(pose, alive)
        t2 = clock.now_ns()
        air.hold(pose, alive)
        air.send(at_ns, tick, sent)
        spent[tick] = clock.now_ns() - t2, t1 - t0, t2 - t1
        heard += len(news.heard)
        pose[:, :2] += rng.normal(0.0, 0.01, (rows, 2))
    return *(1e-6 * np.median(spent[WARM_UP:], axis=0)), heard / (TICKS * rows)


def main() -> None:
    """Print a table; the argument `profile` profiles the largest case instead."""
    if "profile" in sys.argv:
        import cProfile

        cost_ms(CASES["disk"], 1, 1000, 0)
        cProfile.runctx("[cost_ms(radio, 1, 1000, 0) for radio in CASES.values()]", globals(), {}, sort="tottime")
        return
    for arenas, robots, obstacles in ((1, 1000, 0), (1, 1000, 10), (8, 20, 0), (8, 20, 10), (1, 10000, 0)):
        for name, radio in CASES.items():
            send, advance, edges, heard = cost_ms(radio, arenas, robots, obstacles)
            print(
                f"{arenas} x {robots:5} robots, {obstacles:2} obstacles: send {send:6.3f}  advance {advance:6.3f}  "
                f"edges {edges:6.3f}  sum {send + advance + edges:6.3f} ms, {heard:.1f} heard   {name}"
            )


if __name__ == "__main__":
    main()
