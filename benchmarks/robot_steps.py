"""How fast robots are moved: the full loop with hash and all metrics, agents in this process or in runners."""

import statistics
from dataclasses import dataclass
from typing import Any

from benchmarks import scenes
from benchmarks.lines import report, spread
from swarmwire.deploy import run
from swarmwire.world.scenario_file import scenario_from


@dataclass(frozen=True)
class Case:
    """A swarm to run, and the unit of its speed: robot-steps per second, or as a multiple of real time."""

    robots: int
    ticks: int
    density_per_m2: float = 1.0
    steps: int = 5  # of physics in a tick
    neighbours: float = 0.0  # that hear a robot's broadcast in each tick, far from walls; 0: no radio
    body: str = "footbot"
    runners: int | None = None
    arenas: int = 1
    unit: str = "robot-steps/s"

    def scene(self, engine: str | None) -> dict[str, Any]:
        """The scenario as a mapping; without `engine`, the default one moves the bodies."""
        return scenes.diffusion(
            self.robots,
            self.ticks / 10,
            steps=self.steps,
            density_per_m2=self.density_per_m2,
            neighbours=self.neighbours,
            body=self.body,
            engine=engine,
        )


D1, D4 = 9.0, 18.0  # neighbours within reach, about as many as in the peer's benchmark at 1 and 4 per square metre
REAL_TIME = "x real time"
CASES = {
    "inprocess-1000-d1": Case(1000, 200),
    "inprocess-1000-d1-10steps": Case(1000, 200, steps=10),
    "inprocess-1000-d4": Case(1000, 200, density_per_m2=4.0),
    "inprocess-1000-d1-radio": Case(1000, 200, neighbours=D1),
    "inprocess-1000-d4-radio": Case(1000, 200, density_per_m2=4.0, neighbours=D4),
    "inprocess-10000-d1": Case(10_000, 50),
    "inprocess-100000-d1": Case(100_000, 20, unit=REAL_TIME),
    "laser-1000": Case(1000, 100, body="turtlebot3-burger", unit=REAL_TIME),
    "single-10": Case(10, 5000, unit=REAL_TIME),
    "single-10-radio": Case(10, 2000, neighbours=D1, unit=REAL_TIME),
    "replicas-100x10": Case(10, 500, arenas=100),
    "wire-1000x2": Case(1000, 200, neighbours=D1, runners=2),
}


def robot_steps(name: str, engine: str | None, repeats: int) -> None:
    """The speed of a case, the median of some runs after a short one."""
    case = CASES[name]
    scenario = scenario_from(case.scene(engine), name)
    seeds = range(1, case.arenas + 1)
    run(scenario.model_copy(update={"duration_s": 2.0}), runners=case.runners, seeds=seeds)
    results = [run(scenario, runners=case.runners, seeds=seeds) for _ in range(repeats)]
    if case.unit == REAL_TIME:
        values = [result.realtime_factor for result in results]
    else:
        values = [case.robots * case.arenas * result.ticks / result.wall_time_s for result in results]
    config = {
        "physics_steps": case.steps,
        "density_per_m2": case.density_per_m2,
        "speed_mps": scenes.SPEED_MPS,
        "body": case.body,
        "engine": scenario.physics.engine,
    }
    report(name, statistics.median(values), case.unit, results[0], {**config, **spread(values)})


def start(name: str, engine: str | None, repeats: int) -> None:
    """From the call to the first tick of a world with a radio, kernels compiled and read, imports left out."""
    scenario = scenario_from(CASES["inprocess-1000-d1-radio"].scene(engine), name)
    short = scenario.model_copy(update={"duration_s": 0.1})
    run(short)
    results = [run(short) for _ in range(repeats)]
    starts_s = [result.start_time_s for result in results]
    config = {"density_per_m2": 1.0, "body": "footbot", "engine": scenario.physics.engine}
    report(name, statistics.median(starts_s), "s", results[0], {**config, **spread(starts_s)})
