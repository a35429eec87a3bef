"""What recording costs: the same run with and without it, in turns, and how large its tables are."""

import statistics
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks import scenes
from benchmarks.lines import report, spread
from swarmwire.comms.base.clock import WallClock, to_s
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy import Result, run
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.table import RecordOptions
from swarmwire.metrics.records.run_folder.tables import recorders
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import scenario_from


def one_run(scenario: Scenario, folder: Path | None) -> tuple[float, Result]:
    """Seconds from the first tick until everything is on disk and joined, and what came of the run."""
    clock, metrics = WallClock(), Metrics()  # measured a second time in both runs: the recorder reads these
    observers: list[Observer] = [metrics, *(recorders(RecordOptions(folder, metrics, clock)) if folder else [])]
    called_ns = clock.now_ns()
    result = run(scenario, observers=observers)
    return to_s(clock.now_ns() - called_ns) - result.start_time_s, result


def compared(scenario: Scenario, repeats: int) -> tuple[list[float], list[float], dict[str, float], Result]:
    """Seconds of each run without and with recording, sizes of the tables in MB, and the first result."""
    without: list[tuple[float, Result]] = []
    recorded: list[tuple[float, Result]] = []
    sizes_mb: dict[str, float] = {}
    for _ in range(repeats):
        without.append(one_run(scenario, None))
        with TemporaryDirectory() as folder:
            recorded.append(one_run(scenario, Path(folder)))
            sizes_mb = {file.stem: round(file.stat().st_size / 1e6, 3) for file in Path(folder).glob("*.parquet")}
    return [spent_s for spent_s, _ in without], [spent_s for spent_s, _ in recorded], sizes_mb, without[0][1]


def record_cost(name: str, repeats: int, *, robots: int, ticks: int) -> None:
    """Time of a run that is recorded over that of one that is not, its tables joined; and their size."""
    scenario = scenario_from(scenes.diffusion(robots, ticks / 10), name)
    compared(scenario.model_copy(update={"duration_s": 2.0}), 1)
    without, recorded, sizes_mb, result = compared(scenario, repeats)
    ratios = [with_s / plain_s for plain_s, with_s in zip(without, recorded, strict=True)]
    config = {"body": "footbot", "physics_steps": 5, "density_per_m2": 1.0}
    report(name, statistics.median(ratios), "x the run without", result, {**config, **spread(ratios)})
    report(f"{name}-size", sum(sizes_mb.values()), "MB", result, {**config, "tables_mb": sizes_mb})
