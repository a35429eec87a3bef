"""What recording for the viewer adds to a run."""

import statistics
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks import scenes
from benchmarks.lines import report, spread
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.deploy import run
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.pictures.viewer.recording import RerunRecording
from swarmwire.world.scenario_file import scenario_from


class Timed(Observer):
    """Observer that records for the viewer, and notes how long that takes in each tick."""

    def __init__(self, rrd: Path) -> None:
        self._clock, self._metrics = WallClock(), Metrics()  # of its own, as observers do not get the run's
        self._recording = RerunRecording(rrd, self._metrics, self._clock)
        self.at_ns, self.spent_ns, self.own_ns = list[int](), list[int](), list[int]()
        self.end_ns = 0

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

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Close the recording."""
        start_ns = self._clock.now_ns()
        summary_part = self._recording.end(last)
        self.end_ns = self._clock.now_ns() - start_ns
        return summary_part

    def cost_percent(self) -> float:
        """The recording's share of the rest of the run, its end included: it sends in blocks, the last one there."""
        in_ticks_ns = sum(self.spent_ns[:-1])
        rest_ns = self.at_ns[-1] - self.at_ns[0] - sum(self.own_ns[:-1]) - in_ticks_ns
        return 100.0 * (in_ticks_ns + self.end_ns) / rest_ns


def view_cost(name: str, repeats: int, *, robots: int, ticks: int, neighbours: float) -> None:
    """What recording for the viewer adds to a run, in percent, and the size of the recording.

    Both parts are timed in the same runs, so that what else the machine does falls on both; rerun's own threads, which
    compress and write, are not in it while there is a core for them.
    """
    scenario = scenario_from(scenes.diffusion(robots, ticks / 10, neighbours=neighbours), name)
    run(scenario.model_copy(update={"duration_s": 2.0}))
    with TemporaryDirectory() as folder:
        rrd = Path(folder, "run.rrd")
        timed = [Timed(rrd) for _ in range(repeats)]
        results = [run(scenario, observers=[observer]) for observer in timed]
        size_mb = rrd.stat().st_size / 1e6
    if any(result.counts.get("observer_failed_Timed") for result in results):
        raise RuntimeError("the recording failed: its cost says nothing")
    costs = [observer.cost_percent() for observer in timed]
    config = {"body": "footbot", "rays": 24, "physics_steps": 5, "density_per_m2": 1.0}
    report(name, statistics.median(costs), "% of the run without", results[0], {**config, **spread(costs)})
    report(f"{name}-size", size_mb, "MB", results[0], config)
