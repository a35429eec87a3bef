"""What share of a run the metrics cost: those that are measured in every run, and all that there are."""

import statistics

from benchmarks.lines import print_line, spread
from benchmarks.robot_steps import CASES
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.deploy import run
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.registry import METRICS
from swarmwire.world.scenario_file import scenario_from

SETS = {"": None, "-all": list(METRICS)}  # by how the benchmark's name goes on


class Timed(Observer):
    """Observer that measures with each set of metrics in turn, and notes how long each takes in a tick."""

    def __init__(self) -> None:
        self._clock = WallClock()
        self._metrics = {name: Metrics(chosen) for name, chosen in SETS.items()}
        self.spent_ns: dict[str, list[int]] = {name: [] for name in SETS}
        self.at_ns = list[int]()

    def begin(self, static: Static) -> None:
        """Begin to measure."""
        for metrics in self._metrics.values():
            metrics.begin(static)

    def see(self, truth: Truth) -> None:
        """Measure a tick; who comes first finds what was moved in no cache, so both do in turn."""
        self.at_ns.append(self._clock.now_ns())
        order = list(self._metrics.items())
        for name, metrics in order if truth.tick % 2 else reversed(order):
            start_ns = self._clock.now_ns()
            metrics.see(truth)
            self.spent_ns[name].append(self._clock.now_ns() - start_ns)

    def share_percent(self, name: str) -> float:
        """What a set would have cost of a run with it alone, the first tick left out."""
        spent_ns = {each: sum(values[1:-1]) for each, values in self.spent_ns.items()}
        rest_ns = self.at_ns[-1] - self.at_ns[1] - sum(spent_ns.values())
        return 100.0 * spent_ns[name] / (rest_ns + spent_ns[name])


def metrics_share(name: str, repeats: int, *, case_name: str) -> None:
    """Time spent on metrics over that of the whole run, in percent, for a case of `robot_steps`.

    Both sets are timed within the same runs, so that what else the machine does falls on all. The radio graph, which
    the loop makes for observers, counts as the run's.
    """
    case = CASES[case_name]
    scenario = scenario_from({**case.scene(None), "standard_metrics": False}, name)
    run(scenario.model_copy(update={"duration_s": 2.0}), observers=[Timed()])
    timed = [Timed() for _ in range(repeats)]
    results = [run(scenario, observers=[observer]) for observer in timed]
    if any(result.counts.get("observer_failed_Timed") for result in results):
        raise RuntimeError("a metric failed: its cost says nothing")
    for suffix, chosen in SETS.items():
        shares = [observer.share_percent(suffix) for observer in timed]
        details = {"of": case_name, "robots": case.robots, "ticks": case.ticks, "metrics": len(Metrics(chosen).metrics)}
        print_line(f"{name}{suffix}", statistics.median(shares), "% of the run", {**details, **spread(shares)})
