"""Run benchmarks and print one JSON object a line: name, value, unit, and the whole configuration.

`python -m benchmarks [--engine ENGINE] [NAME …]`. Every run is what a user's run is: the full loop with trajectory hash
and all metrics, without a run folder. The value is the median of a few runs; the machine's noise shows in their spread,
printed with it.
"""

import statistics
from argparse import ArgumentParser
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil

from benchmarks import air, scenes
from benchmarks.agent_overhead import overhead
from benchmarks.lines import print_line, report, spread
from benchmarks.record_cost import compared
from benchmarks.robot_steps import CASES, D1, robot_steps, start
from swarmwire.comms.clock import WallClock
from swarmwire.comms.truth import Static, Tally, Truth
from swarmwire.deploy import run
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.viewer.recording import RerunRecording
from swarmwire.world.scenario.scenario_file import scenario_from

REPEATS = 3
PACKETS = 10  # that a robot reads in a step


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
    scenario = scenario_from(scenes.diffusion(robots, ticks / 10), name)
    compared(scenario.model_copy(update={"duration_s": 2.0}), 1)
    without, recorded, sizes_mb, result = compared(scenario, REPEATS)
    ratios = [with_s / plain_s for plain_s, with_s in zip(without, recorded, strict=True)]
    config = {"body": "footbot", "physics_steps": 5, "density_per_m2": 1.0}
    report(name, statistics.median(ratios), "x the run without", result, {**config, **spread(ratios)})
    report(f"{name}-size", sum(sizes_mb.values()), "MB", result, {**config, "tables_mb": sizes_mb})


class Timed:
    """Observer that records for the viewer, and notes how long that takes in each tick."""

    def __init__(self, rrd: Path) -> None:
        self._clock, self._metrics = WallClock(), Metrics()  # of its own, as observers are not told the run's
        self._recording = RerunRecording(rrd, self._metrics, self._clock)
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


def view_cost(name: str, *, robots: int, ticks: int, neighbours: float) -> None:
    """What recording for the viewer adds to a run, in percent, and the size of the recording.

    Both parts are timed in the same runs, second by second, so that what else the machine does falls on both; rerun's
    own threads, which compress and write, are not in it while there is a core for them.
    """
    scenario = scenario_from(scenes.diffusion(robots, ticks / 10, neighbours=neighbours), name)
    run(scenario.model_copy(update={"duration_s": 2.0}))
    with TemporaryDirectory() as folder:
        rrd = Path(folder, "run.rrd")
        timed = [Timed(rrd) for _ in range(REPEATS)]
        results = [run(scenario, observers=[observer]) for observer in timed]
        size_mb = rrd.stat().st_size / 1e6
    if any(result.counts.get("observer_failed_Timed") for result in results):
        raise RuntimeError("the recording failed: its cost says nothing")
    costs = [statistics.median(observer.costs_percent()) for observer in timed]
    config = {"body": "footbot", "rays": 24, "physics_steps": 5, "density_per_m2": 1.0}
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


def agent_overhead(name: str) -> None:
    """What the framework costs a robot's step, where one robot is all and where there are many, and a packet read."""
    told = {"body": "footbot", "rays": 24, "packets_per_step": PACKETS}
    for robots, ticks in ((1, 5000), (100, 100)):
        overhead(WallClock(), robots, PACKETS, ticks // 10)
        found = [overhead(WallClock(), robots, PACKETS, ticks) for _ in range(REPEATS)]
        for part, values in (("step", [one.step_us for one in found]), ("packet", [one.packet_us for one in found])):
            line = {"robots": robots, **told, **spread(values)}
            print_line(f"{name}-{part}", statistics.median(values), f"µs per {part}", line)


OTHERS: dict[str, Callable[[str], None]] = {
    "agent-overhead": agent_overhead,
    "record-cost": lambda name: record_cost(name, robots=1000, ticks=600),
    "view-cost": lambda name: view_cost(name, robots=1000, ticks=600, neighbours=0.0),
    "view-cost-radio": lambda name: view_cost(name, robots=1000, ticks=600, neighbours=D1),
    **dict.fromkeys(air.CASES, air_cost),
    "air-scaling": air_scaling,
    "processes-100": lambda name: processes(name, robots=100, ticks=300),
}


def main() -> None:
    """Run the named benchmarks, or all."""
    parser = ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("names", nargs="*", metavar="NAME", help="all if left out")
    parser.add_argument("--engine", help="[physics] engine of inprocess, single, replicas, laser, wire and start")
    given = parser.parse_args()
    of_engine = {**dict.fromkeys(CASES, robot_steps), "start-1000": start}
    chosen = {name: partial(measure, engine=given.engine, repeats=REPEATS) for name, measure in of_engine.items()}
    runs: dict[str, Callable[[str], None]] = {**chosen, **OTHERS}
    for name in given.names:
        if name not in runs:
            parser.error(f"no benchmark {name!r}; there are {', '.join(runs)}")
    for name in given.names or runs:
        runs[name](name)


if __name__ == "__main__":
    main()
