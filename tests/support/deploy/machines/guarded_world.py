"""A world behind mutual TLS with two honest runners, whom a test disturbs in the middle of the run."""

import socket
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import zenoh

from swarmwire.agent import runner
from swarmwire.agent.runner_protocol import JoinOptions
from swarmwire.comms.clock import WallClock
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Truth
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.sessions import closed_after, open_runner
from swarmwire.deploy import Recording, Result, Simulation
from swarmwire.deploy.certificates.folder import begin_authority, issue
from swarmwire.deploy.certificates.member import access_in, network_in
from swarmwire.deploy.certificates.register import certificate_request
from swarmwire.deploy.config import JoinObserver, Listening
from swarmwire.deploy.simulation import finished
from tests.support.deploy.commands import LOSSY

SHORT = ["duration_s=2"]
HONEST = ("r0", "r1")
AT_TICK = 3  # when it is disturbed
PURPOSES = {"world": "world", "r0": "runner", "r1": "runner", "mallory": "runner", "robot-1": "robot", "gone": "runner"}


def authority(folder: Path) -> Path:
    """A CA with a certificate for each name, good on this machine."""
    begin_authority(folder, WallClock())
    issue(
        folder,
        [certificate_request(name, ("127.0.0.1",), purpose) for name, purpose in PURPOSES.items()],
        1,
        WallClock(),
    )
    return folder


class GuardedWorld(Observer, JoinObserver):
    """Told where the world listens, it brings the honest runners; an observer, it disturbs the run once.

    Attributes:
        endpoint, observed: where runners and observers call.
        keys, seen: the run's.
    """

    def __init__(self, certs: Path, disturb: Callable[["GuardedWorld"], object]) -> None:
        self._certs, self._disturb = certs, disturb
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.observed = f"tls/127.0.0.1:{free.getsockname()[1]}"
        self._threads: list[threading.Thread] = []
        self._fault: BaseException | None = None

    def run(self, out: Path) -> Result:
        """The run, to its end; what went wrong while it was disturbed is raised here."""
        listening = Listening(
            ("tls/127.0.0.1:0",),
            (self.observed,),
            network_in(self._certs, "world"),
            access_in(self._certs),
            observer=self,
        )
        record = Recording(tables=False, rrd=False)
        simulation = Simulation(LOSSY, overrides=SHORT, listening=listening, out=out, record=record)
        simulation.watch(self)
        try:
            result = finished(simulation)
        finally:
            for thread in self._threads:
                thread.join(20.0)
        if self._fault is not None:
            raise self._fault
        return result

    @contextmanager
    def session_of(self, name: str, *, observing: bool = False) -> Generator[zenoh.Session]:
        """A session with that name's certificate, at the agents' endpoint or at the observers'."""
        at = self.observed if observing else self.endpoint
        with closed_after(open_runner(at, 10.0, network_in(self._certs, "", name))) as session:
            yield session

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        self.endpoint, self.keys, self.seen = endpoints[0], Keys(run_id), ObserverKeys(run_id)
        for place, name in enumerate(HONEST):
            robots = tuple(f"flock-{i}" for i in range(10 * place, 10 * place + 10))
            self._threads.append(threading.Thread(target=self._play, args=(name, robots)))
            self._threads[-1].start()

    def see(self, truth: Truth) -> None:
        if truth.tick != AT_TICK - 1:
            return
        try:
            self._disturb(self)
        except BaseException as error:  # noqa: BLE001 - an observer that fails is left out, but this one is the test
            self._fault = error

    def _play(self, name: str, robots: tuple[str, ...]) -> None:
        options = JoinOptions(JoinRequest(names=robots))
        with self.session_of(name) as session:
            runner.play(session, self.keys, name, runner.Arrivals(), lambda: options)
