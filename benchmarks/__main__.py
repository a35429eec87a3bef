"""Run benchmarks and print one JSON object a line: name, value, unit, and the whole configuration.

`python -m benchmarks [NAME …]`. Every run is what a user's run is: the full loop with trajectory hash and all metrics,
without a run folder. The value is the median of a few runs; the machine's noise shows in their spread, printed with it.
"""

import json
import statistics
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil

from benchmarks import air, scenes
from benchmarks.record_cost import compared
from swarmwire.comms.clock import WallClock
from swarmwire.comms.truth import Static, Tally, Truth
from swarmwire.deploy import Result, run
from swarmwire.deploy.machine import cpu
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.rerun_recording import RerunRecording
from swarmwire.world.scenario_file import scenario_from

REPEATS = 3


class OwnMemory:
    """Observer that reads, once, the memory that belongs to each runner alone (USS)."""

    def __init__(self, at_tick: int) -> None:
        self.at_tick, self.uss_mb = at_tick, list[float]()

    def begin(self, static: Static) -> None:
        """Nothing to do."""

    def see(self, truth: Truth) -> None:
        """Read at one tick."""
        if truth.tick == self.at_tick:
            nursery = [child for child in psutil.Process().children() if "swarmwire.agent.nursery" in child.cmdline()]
            runners = [runner for process in nursery for runner in process.children()]
            self.uss_mb = [runner.memory_full_info().uss / 1e6 for runner in runners]

    def end(self, last: Tally | None) -> dict[str, Any]:
        """No part of the summary."""
        return {}


def in_process(name: str, *, robots: int, steps: int, ticks: int, radio: bool, runners: int | None = None) -> None:
    """Robot-steps per second of diffusing foot-bots."""
    scenario = scenario_from(scenes.diffusion(robots, steps, ticks / 10, radio=radio), name)
    warm_up = scenario.model_copy(update={"duration_s": 2.0})
    run(warm_up, runners=runners)
    results = [run(scenario, runners=runners) for _ in range(REPEATS)]
    speeds = [robots * result.ticks / result.wall_time_s for result in results]
    config = {
        "physics_steps": steps,
        "density_per_m2": scenes.DENSITY_PER_M2,
        "speed_mps": scenes.SPEED_MPS,
        "body": "footbot",
        "rays": 24,
    }
    report(name, statistics.median(speeds), "robot-steps/s", results[0], {**config, **spread(speeds)})


def processes(name: str, *, robots: int, ticks: int) -> None:
    """Real-time factor of a flock with a process per robot; its start, and what each process costs."""
    scenario = scenario_from(scenes.flocking(robots, ticks / 10), name)
    run(scenario.model_copy(update={"duration_s": 1.0}))
    memory = OwnMemory(ticks // 2)
    results = [run(scenario, runners="per-robot", observers=[memory]) for _ in range(REPEATS)]
    factors = [result.realtime_factor for result in results]
    config = {"body": "epuck", "physics_steps": 5, "density_per_m2": 20 / 64, "speed_mps": 0.1}
    report(name, statistics.median(factors), "x real time", results[0], {**config, **spread(factors)})
    starts = [result.start_time_s for result in results]
    report(f"{name}-start", statistics.median(starts), "s", results[0], {**config, **spread(starts)})
    report(f"{name}-uss", statistics.median(memory.uss_mb), "MB", results[0], {**config, **spread(memory.uss_mb)})


def record_cost(name: str, *, robots: int, ticks: int) -> None:
    """Time of a run that is recorded over that of one that is not, its tables joined; and their size."""
    scenario = scenario_from(scenes.diffusion(robots, 5, ticks / 10, radio=False), name)
    compared(scenario.model_copy(update={"duration_s": 2.0}), 1)
    without, recorded, sizes_mb, result = compared(scenario, REPEATS)
    ratios = [with_s / plain_s for plain_s, with_s in zip(without, recorded, strict=True)]
    config = {"body": "footbot", "physics_steps": 5, "density_per_m2": scenes.DENSITY_PER_M2}
    report(name, statistics.median(ratios), "x the run without", result, {**config, **spread(ratios)})
    report(f"{name}-size", sum(sizes_mb.values()), "MB", result, {**config, "tables_mb": sizes_mb})


class Timed:
    """Observer that records for the viewer, and notes how long that takes in each tick."""

    def __init__(self, rrd: Path) -> None:
        self._clock, self._metrics = WallClock(), Metrics()  # of its own, as observers are not told the run's
        self._recording = RerunRecording(rrd, self._metrics)
        self.at_ns, self.spent_ns, self.own_ns = list[int](), list[int](), list[int]()

    def begin(self, static: Static) -> None:
        """Open the recording."""
        self._metrics.begin(static)
        self._recording.begin(static)

    def see(self, truth: Truth) -> None:
        """Record a tick."""
        start_ns = self._clock.now_ns()
        self._metrics.see(truth)
        measured_ns = self._clock.now_ns()
        self._recording.see(truth)
        self.at_ns.append(start_ns)
        self.own_ns.append(measured_ns - start_ns)
        self.spent_ns.append(self._clock.now_ns() - measured_ns)

    def end(self, last: Tally | None) -> dict[str, Any]:
        """Close the recording."""
        return self._recording.end(last)

    def costs_percent(self) -> list[float]:
        """The recording's share of the rest of the run, for each second of it but the first."""
        seconds = range(10, len(self.at_ns) - 10, 10)
        spent_ns = [sum(self.spent_ns[at : at + 10]) for at in seconds]
        own_ns = [sum(self.own_ns[at : at + 10]) for at in seconds]
        whole_ns = [self.at_ns[at + 10] - self.at_ns[at] for at in seconds]
        return [100.0 * s / (w - o - s) for s, o, w in zip(spent_ns, own_ns, whole_ns, strict=True)]


def view_cost(name: str, *, robots: int, ticks: int, radio: bool) -> None:
    """What recording for the viewer adds to a run, in percent, and the size of the recording.

    Both parts are timed in the same runs, second by second, so that what else the machine does falls on both; rerun's
    own threads, which compress and write, are not in it while there is a core for them.
    """
    scenario = scenario_from(scenes.diffusion(robots, 5, ticks / 10, radio=radio), name)
    run(scenario.model_copy(update={"duration_s": 2.0}))
    with TemporaryDirectory() as folder:
        rrd = Path(folder, "run.rrd")
        timed = [Timed(rrd) for _ in range(REPEATS)]
        results = [run(scenario, observers=[observer]) for observer in timed]
        size_mb = rrd.stat().st_size / 1e6
    if any(result.counts.get("observer_failed_Timed") for result in results):
        raise RuntimeError("the recording failed: its cost says nothing")
    costs = [statistics.median(observer.costs_percent()) for observer in timed]
    config = {"body": "footbot", "rays": 24, "physics_steps": 5, "density_per_m2": scenes.DENSITY_PER_M2}
    report(name, statistics.median(costs), "% of the run without", results[0], {**config, **spread(costs)})
    report(f"{name}-size", size_mb, "MB", results[0], config)


def air_cost(name: str) -> None:
    """Real-time factor of the air alone, without robots to act."""
    costs = [air.cost(air.CASES[name]) for _ in range(REPEATS)]
    factors = [each.realtime_factor for each in costs]
    print_line(name, statistics.median(factors), "x real time", {**costs[0].told, **spread(factors)})


def air_scaling(name: str) -> None:
    """How much dearer a link is in one swarm than in another of the same density."""
    ratio, told = air.scaling()
    print_line(name, ratio, "dearest over cheapest", told)


def report(name: str, value: float, unit: str, result: Result, config: dict[str, Any]) -> None:
    """Print one line."""
    radio = result.radio
    told = {
        "robots": result.robots,
        "runners": result.runners,
        "ticks": result.ticks,
        "rate_hz": 10,
        **config,
        "packets_heard_per_robot_tick": round(radio.fates["heard"] / result.robots / result.ticks, 2) if radio else 0,
        "collisions": result.metrics["collisions"].final,
    }
    print_line(name, value, unit, told)


def print_line(name: str, value: float, unit: str, told: dict[str, Any]) -> None:
    """Print a value with all that it was measured under."""
    line = {"name": name, "value": round(value, 3), "unit": unit, **told, "cpu": cpu()}
    print(json.dumps(line), flush=True)


def spread(values: list[float]) -> dict[str, float]:
    """Lowest and highest of the repeats."""
    return {"lowest": round(min(values), 3), "highest": round(max(values), 3)}


BENCHMARKS: dict[str, Callable[[str], None]] = {
    "inprocess-1000-d1": lambda name: in_process(name, robots=1000, steps=5, ticks=200, radio=False),
    "inprocess-1000-d1-10steps": lambda name: in_process(name, robots=1000, steps=10, ticks=200, radio=False),
    "inprocess-1000-d1-radio": lambda name: in_process(name, robots=1000, steps=5, ticks=200, radio=True),
    "wire-1000x2": lambda name: in_process(name, robots=1000, steps=5, ticks=200, radio=True, runners=2),
    "record-cost": lambda name: record_cost(name, robots=1000, ticks=600),
    "view-cost": lambda name: view_cost(name, robots=1000, ticks=600, radio=False),
    "view-cost-radio": lambda name: view_cost(name, robots=1000, ticks=600, radio=True),
    **dict.fromkeys(air.CASES, air_cost),
    "air-scaling": air_scaling,
    "processes-100": lambda name: processes(name, robots=100, ticks=300),
}


def main(names: list[str]) -> int:
    """Run the named benchmarks, or all."""
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        print(f"no benchmark {unknown[0]!r}; there are {', '.join(BENCHMARKS)}", file=sys.stderr)
        return 2
    for name in names or BENCHMARKS:
        BENCHMARKS[name](name)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
