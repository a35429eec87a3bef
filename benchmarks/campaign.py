"""How long a campaign takes: many runs of a small swarm, seeds packed as arenas of one world, or each on its own."""

from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.lines import report, spread
from benchmarks.scenes import flocking
from swarmwire.comms.base.clock import WallClock, to_s
from swarmwire.deploy import run, sweep
from swarmwire.deploy.campaigns.local import usable_cores
from swarmwire.world.scenario_file import scenario_from

ROBOTS, TICKS = 10, 600
SEEDS = 250
LOSSES = [0.0, 0.2, 0.4, 0.6]  # the points: 1,000 runs
SAMPLE = 25  # seeds at each point on their own: 100 runs


def campaign(name: str, repeats: int) -> None:
    """From the call of `sweep` to the table of all runs, with series, on all cores; and a sample unpacked."""
    scene = flocking(ROBOTS, TICKS / 10)
    scenario = scenario_from(scene, name)
    first = run(scenario)
    packed_s = [_wall_s(scene, name, SEEDS, None) for _ in range(repeats)]
    runs, sample = SEEDS * len(LOSSES), SAMPLE * len(LOSSES)
    unpacked_s = _wall_s(scene, name, SAMPLE, 1)
    config: dict[str, Any] = {
        "runs": runs,
        "ticks_each": TICKS,
        "points": len(LOSSES),
        "cores": usable_cores(),
        "scene": "flocking, disk radio, all standard metrics, series kept",
        "runs_per_s": runs / median(packed_s),
        "unpacked_runs": sample,
        "unpacked_s": unpacked_s,
        "unpacked_runs_per_s": sample / unpacked_s,
    }
    report(name, median(packed_s), "s", first, {**config, **spread(packed_s)})


def _wall_s(scene: dict[str, Any], name: str, seeds: int, batch: int | None) -> float:
    clock = WallClock()
    with TemporaryDirectory() as folder:
        began_ns = clock.now_ns()
        done = sweep(
            scenario_from(scene, name),
            seeds=seeds,
            vary={"radio.loss": LOSSES},
            batch=batch,
            out=Path(folder) / "campaign",
        )
        wall_s = to_s(clock.now_ns() - began_ns)
    if done.failed or not done.is_over:
        raise RuntimeError(f"{done.done} of {done.runs} runs are done, {done.failed} of these failed")
    return wall_s
