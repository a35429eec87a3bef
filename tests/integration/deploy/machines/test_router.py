"""Routers."""

import shutil
import signal
from contextlib import ExitStack
from pathlib import Path
from threading import Timer
from typing import Any

import pytest

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import RunnerLost
from swarmwire.deploy import repeat, run
from swarmwire.deploy.robots.certificates.folder import revoke
from swarmwire.deploy.robots.certificates.member import MemberCredentials, access_in, network_in
from swarmwire.deploy.runs.config import Listening
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.world.backends.runner_reports import RunnerEvent
from tests.integration.deploy.machines.test_machines import lab
from tests.support.deploy.joiners import LOCALHOST, Joiners, Watcher
from tests.support.deploy.machines import Started, on
from tests.support.deploy.runs import LOSSY, called, refused_command

ADDRESSES = ("127.0.0.1",)
TCP = ("--listen", "tcp/127.0.0.1:0", "--connect", "tcp/127.0.0.1:1")
TLS = ("--listen", "tls/127.0.0.1:0", "--connect", "tls/127.0.0.1:1")
FROZEN_S = 0.5
SHORT = ["duration_s=3", "run.on_runner_loss=wait"]
RUNNERS = {"r1": "8", "r2": "12"}


@pytest.fixture(scope="module")
def certs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = dict.fromkeys(("world", "gate", "gate2"), ADDRESSES)
    folder = lab(tmp_path_factory.mktemp("lab") / "ca", at, "r1", "gone")
    revoke(folder, "gone", WallClock())
    return folder


def test_on_this_machine_it_routes_without_certificates_until_it_is_asked_to_end():
    with on(None, "router", *TCP) as router:
        assert router.next_line("listens at").endswith(", calls tcp/127.0.0.1:1")
        assert router.stop() == 0
    assert router.lines[-1] == "router: ended"
    assert not any("warning" in line for line in router.lines)


def test_beyond_this_machine_it_warns_each_time_that_it_is_insecure():
    with on(None, "router", "--listen", "tcp/0.0.0.0:0", "--connect", "tcp/127.0.0.1:1", "--insecure") as router:
        router.next_line("warning: insecure")
        router.next_line("listens at")
        assert router.stop() == 0


@pytest.mark.parametrize(
    "words",
    [
        ("--listen", "tcp/0.0.0.0:7447", "--connect", "tcp/127.0.0.1:1"),
        (*TLS,),
        ("--listen", "tls/nowhere", "--connect", "tcp/127.0.0.1:1"),
        (*TCP, "--runner", "r1"),
        (*TCP, "--certs", "none"),
        (*TCP, "--name", "gate"),
        ("--listen", "unixsock-stream//nowhere/at/all", "--connect", "tcp/127.0.0.1:1"),
    ],
)
def test_router_options_that_are_invalid_are_refused_in_a_line(words, monkeypatch, capsys):
    refused_command(monkeypatch, capsys, "router", *words)


def test_router_with_several_certificates_needs_a_name(certs, monkeypatch, capsys):
    refused_command(monkeypatch, capsys, "router", *TLS, "--certs", certs, match=".*gate, gate2")


def test_router_admits_members_of_the_register_or_of_the_options(certs, tmp_path, monkeypatch, capsys):
    admitted: list[set[str]] = []

    def noted(_member: MemberCredentials, _listen: list[str], _connect: list[str], access: dict[str, Any]) -> None:
        admitted.append({subject["id"] for subject in access["subjects"]})

    monkeypatch.setattr("swarmwire.deploy.cli.router._route", noted)
    words = "--certs", certs, "--name", "gate2", "--revoked", "nobody"
    assert called(monkeypatch, capsys, "router", *TLS, *words)[0] == 0
    own = tmp_path / "own"
    own.mkdir()
    for name in ("ca.pem", "gate.pem", "gate.key"):
        shutil.copy(certs / name, own / name)
    names = "--runner", "r1", "--router", "gate2", "--world", "lab"
    assert called(monkeypatch, capsys, "router", *TLS, "--certs", own, *names)[0] == 0
    assert admitted == [{"r1", "gate", "gate2", "world"}, {"r1", "gate2", "lab"}]


class BehindRouter(Joiners):
    """A runner with all robots that reaches the world through a router without certificates."""

    def __init__(self, folder, opened: ExitStack) -> None:
        super().__init__(folder)
        self._opened = opened
        self.router: Started | None = None

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        router = on(None, "router", "--listen", LOCALHOST[0], "--connect", endpoints[0])
        self.router = self._opened.enter_context(router)
        self.endpoint = self.router.next_line("listens at").split()[3].strip(",")
        self.start("r1")

    def send_router(self, number: signal.Signals) -> None:
        self.router.process.send_signal(number)

    def freeze_router(self) -> None:
        self.send_router(signal.SIGSTOP)

    def freeze_and_thaw_router(self) -> None:
        self.freeze_router()
        Timer(FROZEN_S, self.send_router, [signal.SIGCONT]).start()


@pytest.fixture
def joiners(tmp_path):
    with ExitStack() as opened:
        network = BehindRouter(tmp_path, opened)
        opened.callback(network.close)
        yield network


def simulation_of(joiners, act, *overrides):
    listening = Listening(LOCALHOST, observer=joiners)
    simulation = Simulation(LOSSY, overrides=[*joiners.overrides, "duration_s=2", *overrides], listening=listening)
    simulation.watch(Watcher((lambda truth: truth.tick == 8, act)))
    return simulation


def test_run_goes_on_after_its_router_was_frozen_and_loses_nothing(joiners):
    result = run_to_end(simulation_of(joiners, joiners.freeze_and_thaw_router))
    assert result.counts.get("runners_lost", 0) == 0
    assert result.trajectory_sha256 == run(LOSSY, overrides=[*joiners.overrides, "duration_s=2"]).trajectory_sha256


def test_behind_a_router_that_stays_frozen_a_runner_is_lost_after_its_time(joiners):
    simulation = simulation_of(joiners, joiners.freeze_router, "run.runner_timeout_s=2")
    with pytest.raises(RunnerLost, match="no answer for 2 s"):
        run_to_end(simulation)
    assert simulation.result.ticks == 9


class BehindGuardedRouter(Joiners):
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
        self._at = self.endpoint = router.next_line("listens at").split()[3].strip(",")
        router.next_line("linked with world")
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
            code, output = self.outcome(name)
            assert (code, output.splitlines()[-1]) == (1, "the world is gone, or out of reach")
        self._route()
        for name, robots in self.lost.items():
            self._join(name, "--names", ",".join(robots))


def test_run_goes_on_after_its_router_was_killed_and_reports_it(tmp_path):
    certs = lab(tmp_path / "ca", {"world": ADDRESSES, "gate": ADDRESSES}, *RUNNERS)
    with ExitStack() as opened:
        joiners = BehindGuardedRouter(tmp_path, certs, opened)
        opened.callback(joiners.close)
        at = ("tls/127.0.0.1:0",)
        listening = Listening(at, network=network_in(certs, "world"), access=access_in(certs), observer=joiners)
        overrides = [*joiners.overrides, *SHORT]
        simulation = Simulation(LOSSY, overrides=overrides, listening=listening, out=tmp_path / "run")
        simulation.watch(Watcher((lambda truth: truth.tick == 8, joiners.kill_router)))
        result = run_to_end(simulation)
    assert sorted(joiners.events[2:4]) == [("lost", "r1"), ("lost", "r2")]
    assert sorted(joiners.events[4:]) == [("returned", "r1"), ("returned", "r2")]
    assert {change.tick for change in result.runner_events[2:]} == {9}
    assert result.counts["runners_lost"] == result.counts["runners_returned"] == 2
    assert result.trajectory_sha256 == run(LOSSY, overrides=overrides).trajectory_sha256
    assert repeat(tmp_path / "run").same
