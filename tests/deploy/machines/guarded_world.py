"""A world behind mutual TLS with two honest runners, whom a test disturbs in the middle of the run."""

import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import zenoh

from swarmwire.agent import runner
from swarmwire.comms.clock import WallClock
from swarmwire.comms.wire.closing import closed_after
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.run_access import agents_access
from swarmwire.comms.wire.sessions import listens_at, open_runner
from swarmwire.deploy import Simulation
from swarmwire.deploy.certificates.certificate_folder import begin_authority, issue
from swarmwire.deploy.certificates.folder_access import access_in, network_in
from swarmwire.deploy.certificates.wanted import wanted
from swarmwire.deploy.new_air import new_air
from swarmwire.world.crews import split_robots
from swarmwire.world.crews.door import Door
from swarmwire.world.crews.remote_crew import RemoteCrew
from swarmwire.world.loop import Loop
from tests.deploy.commands import LOSSY

SHORT = ["duration_s=2"]
HONEST = ("r0", "r1")
KEYS = Keys("run1")
PURPOSES = {"world": "world", "r0": "runner", "r1": "runner", "mallory": "runner", "robot-1": "robot", "gone": "runner"}


def authority(folder: Path, names: dict[str, str] = PURPOSES) -> Path:
    """A CA with a certificate for each name, good on this machine."""
    begin_authority(folder, WallClock())
    issue(folder, [wanted(name, ("127.0.0.1",), purpose) for name, purpose in names.items()], 1, WallClock())
    return folder


@dataclass
class GuardedWorld:
    """A run under way.

    Attributes:
        endpoint: where it listens.
        hashes, counts: what came of it.
    """

    certs: Path
    crew: RemoteCrew
    loop: Loop
    endpoint: str
    hashes: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)

    @contextmanager
    def session_of(self, name: str) -> Generator[zenoh.Session]:
        """A runner's session with that name's certificate."""
        with closed_after(open_runner(self.endpoint, 10.0, network_in(self.certs, "", name))) as session:
            yield session

    def finish(self, disturb: Callable[[int], object]) -> None:
        """Run to the end; `disturb` is called before each tick."""
        for tick in range(20):
            disturb(tick)
            self.loop.step()
        self.loop.end()
        self.hashes, self.counts = self.loop.hexdigests(), self.loop.counts()


@contextmanager
def guarded_world(certs: Path) -> Generator[GuardedWorld]:
    """A world whose honest runners are there; all of it ends with the context."""
    simulation = Simulation(LOSSY, overrides=SHORT)
    scenario = simulation.scenario
    parts = split_robots.split(split_robots.whole(scenario, simulation.static, dict(simulation.agents)), len(HONEST))
    door = Door(("tls/127.0.0.1:0",), network_in(certs, "world"), agents_access(KEYS, access_in(certs)))
    crew = RemoteCrew(door, "run1", parts, 20.0, WallClock(), start_s=20.0)
    crew.open()
    threads: list[threading.Thread] = []
    try:
        endpoint = listens_at(crew._session)[0]
        for name in HONEST:
            threads.append(threading.Thread(target=_play, args=(endpoint, certs, name)))
            threads[-1].start()
        crew.start()
        air = new_air(scenario, simulation.world, None)
        yield GuardedWorld(certs, crew, Loop(simulation.world, air, crew, [], scenario.events), endpoint)
    finally:
        crew.close()
        for thread in threads:
            thread.join(20.0)


def _play(endpoint: str, certs: Path, name: str) -> None:
    with closed_after(open_runner(endpoint, 10.0, network_in(certs, "", name))) as session:
        runner.play(session, KEYS, name, runner.Inbox(), lambda: runner.PLAIN)
