"""A world that listens: where runners from elsewhere meet it, who may come, and who is told of them."""

from dataclasses import dataclass, field
from typing import Protocol

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import RunAccess, agents_access, observers_access
from swarmwire.comms.wire.join import LIMITS, JoinLimits
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.network import Network
from swarmwire.world.backends.join_policy import ListenSettings
from swarmwire.world.backends.registry import NON_BLOCKING, RunnerEvent
from swarmwire.world.scenario.scenario import Scenario


class Onlooker(Protocol):
    """Whoever is told of runners that come and go."""

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        """The world listens, at these endpoints."""
        ...

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        """A runner came or went; these robots nobody plays now."""
        ...

    def refused(self, runner: str, why: str) -> None:
        """A runner was not let in."""
        ...


@dataclass(frozen=True)
class Listening:
    """Where a world listens for runners that others start."""

    endpoints: tuple[str, ...]  # such as "tls/0.0.0.0:7447"
    observed: tuple[str, ...] = ()  # where observers and operators from elsewhere meet it
    network: Network = field(default_factory=Network)  # the world's certificates
    access: RunAccess | None = None  # who may do what; None: whoever reaches an endpoint may play
    start_with: int | None = None  # robots with an agent that are enough for the first tick; None: all
    limits: JoinLimits = LIMITS  # what is taken from runners at most
    told: Onlooker | None = None  # of runners that come and go

    def check(self, scenario: Scenario, robots: int) -> None:
        """BadInput for endpoints that will not do, or a start that the scenario does not allow; `robots` in all."""
        for endpoint in self.endpoints:
            self.network.check_endpoint(endpoint, "", "--listen")
        for endpoint in self.observed:
            self.network.check_endpoint(endpoint, "", "--observe")
        if self.start_with is None:
            return
        if not 0 <= self.start_with <= robots:
            raise BadInput("--start-with", "", f"expected 0 to {robots} (the robots), got {self.start_with}")
        if self.start_with < robots and scenario.run.on_runner_loss not in NON_BLOCKING:
            expected = "expected stand or coast with --start-with: what robots do that have no agent yet"
            raise BadInput(scenario.source, "run.on_runner_loss", expected)

    def door(self, run_id: str) -> ListenSettings:
        """Where runners meet the world."""
        access = None if self.access is None else agents_access(Keys(run_id), self.access)
        return ListenSettings(self.endpoints, self.network, access)

    def observers_door(self, run_id: str) -> ListenSettings:
        """Where observers meet the world."""
        access = None if self.access is None else observers_access(ObserverKeys(run_id), self.access)
        return ListenSettings(self.observed, self.network, access)
