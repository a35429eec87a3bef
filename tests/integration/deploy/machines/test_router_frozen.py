"""A router that freezes: what waits in it goes on when it does, and a run waits no longer than for its runners."""

import signal
from contextlib import ExitStack
from threading import Timer

import pytest

from swarmwire.comms.errors import RunnerLost
from swarmwire.deploy import run
from swarmwire.deploy.config import Listening
from swarmwire.deploy.simulation import Simulation, finished
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.joiners import HERE, Joiners, Watcher
from tests.support.deploy.machines.on_machines import Started, on

FROZEN_S = 0.5


class BehindRouter(Joiners):
    """A runner with all robots that reaches the world through a router without certificates."""

    def __init__(self, folder, opened: ExitStack) -> None:
        super().__init__(folder)
        self._opened = opened
        self.router: Started | None = None

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        router = on(None, "router", "--listen", HERE[0], "--connect", endpoints[0])
        self.router = self._opened.enter_context(router)
        self.endpoint = self.router.said("listens at").split()[3].strip(",")
        self.start("r1")

    def send_router(self, number: signal.Signals) -> None:
        assert self.router is not None
        self.router.process.send_signal(number)

    def freeze_router(self) -> None:
        self.send_router(signal.SIGSTOP)

    def freeze_and_thaw_router(self) -> None:
        self.freeze_router()
        Timer(FROZEN_S, self.send_router, [signal.SIGCONT]).start()


@pytest.fixture
def joiners(tmp_path):
    with ExitStack() as opened:
        found = BehindRouter(tmp_path, opened)
        opened.callback(found.close)
        yield found


def simulation_of(joiners, act, *overrides):
    simulation = Simulation(
        LOSSY, overrides=[*joiners.overrides, "duration_s=2", *overrides], listening=Listening(HERE, observer=joiners)
    )
    simulation.watch(Watcher((lambda truth: truth.tick == 8, act)))
    return simulation


def test_a_run_goes_on_when_its_router_does_and_nothing_is_lost(joiners):
    result = finished(simulation_of(joiners, joiners.freeze_and_thaw_router))
    assert result.counts.get("runners_lost", 0) == 0
    assert result.trajectory_sha256 == run(LOSSY, overrides=[*joiners.overrides, "duration_s=2"]).trajectory_sha256


def test_behind_a_router_that_stays_frozen_a_runner_is_lost_after_its_time(joiners):
    simulation = simulation_of(joiners, joiners.freeze_router, "run.runner_timeout_s=2")
    with pytest.raises(RunnerLost, match="no answer for 2 s"):
        finished(simulation)
    assert simulation.result.ticks == 9
