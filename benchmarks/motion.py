"""Robots that others move: what a trace costs, and what poses by UDP cost."""

import os
import socket
import statistics
import subprocess
import sys
import time
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import polars as pl

from benchmarks import scenes
from benchmarks.lines import print_line, report, spread
from benchmarks.robot_steps import D1
from swarmwire.comms.base.clock import WallClock, to_s
from swarmwire.deploy import Result, run
from swarmwire.world.motion.traces.reading import read_trace
from swarmwire.world.motion.traces.trace import TracePoses
from swarmwire.world.motion.udp import UdpSource
from swarmwire.world.scenario.motion import UdpMotion
from swarmwire.world.scenario_file import scenario_from

RATE_HZ = 10
SUBTICK_S = 0.001
RANGE_M = 5.5  # of robots 1 m apart
SIDE_M = 500.0
# The program of another process that sends, like a simulator, at a steady rate of the wall clock.
SENDER = """
import json, socket, sys, time
out, start_s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), time.monotonic()
for k in range({updates}):
    time.sleep(max(0.0, start_s + k / {rate_hz} - time.monotonic()))
    for i in range({robots}):
        pose = {{"robot": f"r-{{i}}", "x_m": i + 0.01 * k, "y_m": 0.0, "z_m": 1.0, "heading_rad": 0.1}}
        out.sendto(json.dumps(pose).encode(), ("127.0.0.1", {port}))
"""


def trace(name: str, repeats: int, *, robots: int, seconds: int) -> None:
    """Time to read a trace with a sample of each robot per tick, and what its poses cost of a tick with a unit disk."""
    clock, samples = WallClock(), seconds * RATE_HZ
    with TemporaryDirectory() as folder:
        file = Path(folder, "walk.parquet")
        _write_walk(file, robots, samples)
        loads, shares = list[float](), list[float]()
        for _ in range(repeats):
            start_ns = clock.now_ns()
            poses = TracePoses(read_trace(file), range(robots), 0.0)
            loads.append(to_s(clock.now_ns() - start_ns))
            start_ns = clock.now_ns()
            for tick in range(600):
                poses.at(tick / RATE_HZ)
            at_s = to_s(clock.now_ns() - start_ns) / 600
            shares.append(100.0 * at_s / _tick_s(file, robots))
    config = {"robots": robots, "samples": robots * samples, "rate_hz": RATE_HZ}
    print_line(name, statistics.median(loads), "s", {**config, **spread(loads)})
    print_line(f"{name}-share", statistics.median(shares), "% of the tick", {**config, **spread(shares)})


def udp(name: str, repeats: int, *, robots: int, rate_hz: int, seconds: int) -> None:
    """Processor time of the world's thread that receives poses, in % of a core."""
    names, shares, received = [f"r-{i}" for i in range(robots)], list[float](), 0
    for _ in range(repeats):
        motion = UdpMotion(source="udp", listen="127.0.0.1:0")
        source, clock = UdpSource(motion, names, range(robots), (inf, inf), WallClock()), WallClock()
        source.open()
        text = SENDER.format(
            updates=rate_hz * seconds, rate_hz=rate_hz, robots=robots, port=source.address.rpartition(":")[2]
        )
        start_s, start_ns = time.process_time(), clock.now_ns()
        sender = subprocess.Popen([sys.executable, "-c", text])
        while sender.poll() is None:
            clock.sleep_until(clock.now_ns() + 100_000_000)
            source.pop_new(clock.now_ns())
        shares.append(100.0 * (time.process_time() - start_s) / to_s(clock.now_ns() - start_ns))
        source.close()
        received = source.report().received
    config = {"robots": robots, "rate_hz": rate_hz, "received": received, "sent": robots * rate_hz * seconds}
    print_line(name, statistics.median(shares), "% of a core", {**config, **spread(shares)})


def udp_use(name: str, repeats: int, *, robots: int, rate_hz: int, duration_s: float) -> None:
    """Wall time from the arrival of a pose by UDP to the start of the sub-tick whose radio uses it; p99 in ms.

    The loop may compute this sub-tick later, by `tick_jitter_ms` at the start of a tick.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    group = {"body": "turtlebot4", "count": robots, "agent": "swarmwire.agent.behaviours:Consensus"}
    mapping = {
        "format": 1,
        "name": name,
        "duration_s": duration_s,
        "arena": {"size_m": [SIDE_M, SIDE_M], "boundary": "open"},
        "robots": {"r": {**group, "motion": {"source": "udp", "listen": f"127.0.0.1:{port}"}}},
        "radio": {"range_m": RANGE_M},
    }
    scenario, results = scenario_from(mapping, name), list[Result]()
    updates = int(rate_hz * (duration_s + 60.0))  # until the run ends
    text = SENDER.format(updates=updates, rate_hz=rate_hz, robots=robots, port=port)
    for _ in range(repeats):
        sender = subprocess.Popen([sys.executable, "-c", text])
        try:
            results.append(run(scenario, realtime=1.0, subtick=SUBTICK_S))
        finally:
            sender.kill()
            sender.wait()
    values = [1000.0 * use.p99_s for result in results if (use := result.poses[0].use)]
    use, real = results[-1].poses[0].use, results[-1].realtime
    config = {
        "subtick_s": SUBTICK_S,
        "p50_ms": round(1000.0 * use.p50_s, 3) if use else None,
        "worst_ms": round(1000.0 * use.worst_s, 3) if use else None,
        "counted": use.count if use else 0,
        "tick_jitter_ms": round(1000.0 * real.tick_jitter.p99_s, 3) if real and real.tick_jitter else None,
        "load_average": round(os.getloadavg()[0], 1),  # a p99 of a millisecond is one of a quiet machine
        **spread(values),
    }
    report(name, statistics.median(values), "ms", results[-1], config)


def _write_walk(file: Path, robots: int, samples: int) -> None:
    """Write robots that move a decimetre per sample in random directions."""
    rng = np.random.default_rng(1)
    start_m = rng.uniform(-0.4 * SIDE_M, 0.4 * SIDE_M, (2, robots, 1))
    x_m, y_m = start_m + np.cumsum(rng.normal(0.0, 0.1, (2, robots, samples)), axis=2)
    names = np.repeat([f"r-{i}" for i in range(robots)], samples)
    t_s = np.tile(np.arange(samples) / RATE_HZ, robots)
    pl.DataFrame({"t_s": t_s, "robot": names, "x_m": x_m.ravel(), "y_m": y_m.ravel()}).write_parquet(file)


def _tick_s(file: Path, robots: int) -> float:
    """Return the mean time of a tick of these robots with a broadcast each, about nine in range, and all metrics."""
    mapping = scenes.diffusion(robots, 20.0, neighbours=D1)
    mapping["arena"] = {"size_m": [SIDE_M, SIDE_M], "boundary": "open"}
    mapping["radio"]["range_m"] = float(np.sqrt(D1 / np.pi * (0.8 * SIDE_M) ** 2 / robots))
    mapping["robots"]["bots"]["motion"] = {"source": "trace", "file": str(file)}
    scenario = scenario_from(mapping, "motion")
    run(scenario.model_copy(update={"duration_s": 1.0}))
    result = run(scenario)
    return result.wall_time_s / result.ticks
