"""A world with two arenas, whose robots never meet: an honest runner plays the first, an odd one the second."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Truth
from swarmwire.deploy.config import JoinObserver, Listening
from swarmwire.deploy.result import Result
from swarmwire.deploy.simulation import Simulation, finished
from swarmwire.world.backends.registry import RunnerEvent
from tests.integration.examples.test_examples import EXAMPLES
from tests.support.runners.raw_runner import RawRunner, Says, honestly

SCENARIO = EXAMPLES / "protocol" / "flock.toml"
ROBOTS = 3
OVERRIDES = [f"robots.flock.count={ROBOTS}", "time.rate_hz=10", "physics.engine=pymunk"]


@dataclass
class Played(Observer, JoinObserver):
    """An observer of the run, who is told of its runners, too: lets one join after the other, and looks at counts."""

    says: Says = honestly
    ticks: int = 10
    early: Sequence[bytes] = ()  # what the odd one says before it is ready
    runners: dict[str, RawRunner] = field(default_factory=dict[str, RawRunner])
    counted: list[Counter[str]] = field(default_factory=list[Counter[str]])  # at the end of each tick, so far
    refusals: list[str] = field(default_factory=list[str])
    at: tuple[str, str] = ("", "")

    def run(self, *overrides: str, **more: Any) -> Result:
        """The run, to its end; raises what it raises."""
        listening = Listening(("tcp/127.0.0.1:0",), observer=self)
        changes = [*OVERRIDES, f"duration_s={self.ticks / 10}", *overrides]
        self.simulation = Simulation(SCENARIO, seeds=[1, 2], overrides=changes, listening=listening, **more)
        self.simulation.watch(self)
        try:
            return finished(self.simulation)
        finally:
            for runner in self.runners.values():
                runner.close()

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        self.at = endpoints[0], run_id
        self.runners["honest"] = RawRunner(*self.at, "honest", ROBOTS)

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        if change.what == "joined" and change.runner == "honest":
            self.runners["odd"] = RawRunner(*self.at, "odd", ROBOTS, self.says, self.early)

    def refused(self, runner: str, why: str) -> None:
        self.refusals.append(why)

    def see(self, truth: Truth) -> None:
        backend = self.simulation._parts.backend
        assert backend is not None
        self.counted.append(Counter(backend.counts()))
