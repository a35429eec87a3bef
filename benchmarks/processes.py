"""A process per robot: how fast the swarm runs, starts, and what each process costs."""

import statistics
from pathlib import Path

import psutil

from benchmarks import scenes
from benchmarks.lines import report, spread
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy import run
from swarmwire.deploy.runs.runners import AGENT_HOST
from swarmwire.world.scenario_file import scenario_from

BOID = "benchmarks.agents:Boid"


class Consumption(Observer):
    """Observer that reads what the processes of a run take, at two of its ticks; as root, which may read their memory.

    Attributes:
        uss_mb: memory that belongs to each runner alone.
        all_gb: memory of world, agent host and runners together, as the sum of their PSS.
        runner_us: processor time of a runner in a tick.
        world_ms: processor time of the world in a tick.
        host_ms: processor time of the agent host in a tick.
    """

    def __init__(self, first: int, last: int) -> None:
        self.first, self.last = first, last
        self.uss_mb, self.all_gb, self.runner_us, self.world_ms, self.host_ms = list[float](), 0.0, 0.0, 0.0, 0.0
        self._begun_s = (0.0, 0.0, 0.0)

    def see(self, truth: Truth) -> None:
        """Read at two ticks; the memory at the first."""
        if truth.tick not in (self.first, self.last):
            return
        world = psutil.Process()
        agent_host = [child for child in world.children() if AGENT_HOST in child.cmdline()]
        runners = [runner for process in agent_host for server in process.children() for runner in server.children()]
        if truth.tick == self.first:
            memory = [runner.memory_full_info() for runner in runners]
            self.uss_mb = [usage.uss / 1e6 for usage in memory]
            # PSS: what some processes share counts for each by its part, so that the sum is what they take together.
            self.all_gb = (
                sum(usage.pss for usage in [*memory, *(process.memory_full_info() for process in [world, *agent_host])])
                / 1e9
            )
        world_s, theirs_s, hosts_s = (sum(map(_processor_s, processes)) for processes in ([world], runners, agent_host))
        ticks = self.last - self.first
        self.world_ms = (world_s - self._begun_s[0]) / ticks * 1e3
        self.runner_us = (theirs_s - self._begun_s[1]) / ticks / len(runners) * 1e6
        self.host_ms = (hosts_s - self._begun_s[2]) / ticks * 1e3
        self._begun_s = world_s, theirs_s, hosts_s


def _processor_s(process: psutil.Process) -> float:
    """Time on a processor, of all threads; `cpu_times` counts in steps of 10 ms, far above a step."""
    tasks = Path(f"/proc/{process.pid}/task").glob("*/schedstat")
    return sum(int(task.read_text().split()[0]) for task in tasks) * 1e-9


def processes(name: str, repeats: int, *, robots: int, ticks: int, agent: str) -> None:
    """Real-time factor of a flock with a process per robot; its start, and what each process costs."""
    scenario = scenario_from(scenes.flocking(robots, ticks / 10, agent), name)
    run(scenario.model_copy(update={"duration_s": 1.0}))
    results = [run(scenario, runners="per-robot") for _ in range(repeats)]
    consumption = Consumption(ticks // 3, ticks - 1)  # in a run of its own: to read a process's memory takes 1 ms
    run(scenario, runners="per-robot", observers=[consumption])
    factors = [result.realtime_factor for result in results]
    config = {
        "agent": agent,
        "body": "epuck",
        "physics_steps": 5,
        "density_per_m2": 20 / 64,
        "speed_mps": 0.1,
        "rays": 8,
        "radio": "disk, 2 m, loss 0.3, latency 0.1 s",
        "runner_us_per_tick": round(consumption.runner_us),
        "world_ms_per_tick": round(consumption.world_ms, 1),
        "host_ms_per_tick": round(consumption.host_ms, 1),
    }
    report(name, statistics.median(factors), "x real time", results[0], {**config, **spread(factors)})
    starts = [result.start_time_s for result in results]
    report(f"{name}-start", statistics.median(starts), "s", results[0], {**config, **spread(starts)})
    report(
        f"{name}-uss", statistics.median(consumption.uss_mb), "MB", results[0], {**config, **spread(consumption.uss_mb)}
    )
    report(f"{name}-memory", consumption.all_gb, "GB", results[0], config)
