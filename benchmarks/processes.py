"""A process per robot: how fast the swarm runs, starts, and what each process costs."""

import statistics
from typing import Any

import psutil

from benchmarks import scenes
from benchmarks.lines import report, spread
from swarmwire.comms.truth import Static, Tally, Truth
from swarmwire.deploy import run
from swarmwire.world.scenario.scenario_file import scenario_from


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


def processes(name: str, repeats: int, *, robots: int, ticks: int) -> None:
    """Real-time factor of a flock with a process per robot; its start, and what each process costs."""
    scenario = scenario_from(scenes.flocking(robots, ticks / 10), name)
    run(scenario.model_copy(update={"duration_s": 1.0}))
    memory = OwnMemory(ticks // 2)
    results = [run(scenario, runners="per-robot", observers=[memory]) for _ in range(repeats)]
    factors = [result.realtime_factor for result in results]
    config = {"body": "epuck", "physics_steps": 5, "density_per_m2": 20 / 64, "speed_mps": 0.1}
    report(name, statistics.median(factors), "x real time", results[0], {**config, **spread(factors)})
    starts = [result.start_time_s for result in results]
    report(f"{name}-start", statistics.median(starts), "s", results[0], {**config, **spread(starts)})
    report(f"{name}-uss", statistics.median(memory.uss_mb), "MB", results[0], {**config, **spread(memory.uss_mb)})
