"""A router that is killed and started again: its runners are lost, return, and go on where they were."""

import signal
from contextlib import ExitStack
from pathlib import Path

from swarmwire.deploy import repeat, run
from swarmwire.deploy.certificates.member import access_in, network_in
from swarmwire.deploy.config import Listening
from swarmwire.deploy.simulation import Simulation, finished
from swarmwire.world.backends.registry import RunnerEvent
from tests.integration.deploy.machines.test_three_machines import lab
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.joiners import Joiners, Watcher
from tests.support.deploy.machines.on_machines import Started, on

SHORT = ["duration_s=3", "run.on_runner_loss=wait"]
HERE = ("127.0.0.1",)
RUNNERS = {"r1": "8", "r2": "12"}


class BehindRouter(Joiners):
    """Runners that reach the world through a router, which is started first."""

    def __init__(self, folder: Path, certs: Path, opened: ExitStack) -> None:
        super().__init__(folder)
        self._certs, self._opened = certs, opened
        self._world, self._at = "", "tls/127.0.0.1:0"
        self.routers: list[Started] = []
        self.lost: dict[str, tuple[str, ...]] = {}

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        self._world = endpoints[0]
        self._route()
        for name, robots in RUNNERS.items():
            self._join(name, "--robots", robots)

    def _route(self) -> None:
        words = "router", "--listen", self._at, "--connect", self._world, "--certs", self._certs
        router = self._opened.enter_context(on(None, *words))
        self._at = self.endpoint = router.said("listens at").split()[3].strip(",")
        router.said("linked with world")
        self.routers.append(router)

    def _join(self, name: str, *arguments: str) -> None:
        own = [f"{self._certs / name}.{ending}" for ending in ("pem", "key")]
        self.start(name, *arguments, "--ca", self._certs / "ca.pem", "--certificate", own[0], "--key", own[1])

    def kill_router(self) -> None:
        self.routers[-1].process.send_signal(signal.SIGKILL)

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        """Once all are lost, the router is started again, and they after it."""
        super().changed(change, free)
        if change.what != "lost":
            return
        self.lost[change.runner] = change.robots
        if len(self.lost) < len(RUNNERS):
            return
        for name in RUNNERS:
            code, said = self.said(name)
            assert (code, said.splitlines()[-1]) == (1, "the world is gone, or out of reach")
        self._route()
        for name, robots in self.lost.items():
            self._join(name, "--names", ",".join(robots))


def test_the_run_goes_on_where_it_was_and_says_what_happened(tmp_path):
    certs = lab(tmp_path / "ca", {"world": HERE, "gate": HERE}, *RUNNERS)
    with ExitStack() as opened:
        joiners = BehindRouter(tmp_path, certs, opened)
        opened.callback(joiners.close)
        at = ("tls/127.0.0.1:0",)
        listening = Listening(at, network=network_in(certs, "world"), access=access_in(certs), observer=joiners)
        overrides = [*joiners.overrides, *SHORT]
        simulation = Simulation(LOSSY, overrides=overrides, listening=listening, out=tmp_path / "run")
        simulation.watch(Watcher((lambda truth: truth.tick == 8, joiners.kill_router)))
        result = finished(simulation)
    assert sorted(joiners.told[2:4]) == [("lost", "r1"), ("lost", "r2")]
    assert sorted(joiners.told[4:]) == [("returned", "r1"), ("returned", "r2")]
    assert {change.tick for change in result.runner_events[2:]} == {9}
    assert result.counts["runners_lost"] == result.counts["runners_returned"] == 2
    assert result.trajectory_sha256 == run(LOSSY, overrides=overrides).trajectory_sha256
    assert repeat(tmp_path / "run").same
