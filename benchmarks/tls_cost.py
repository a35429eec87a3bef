"""What mutual TLS with access control costs of a lockstep tick: beside it, the tick over plain TCP and unix sockets.

Three sets of runners play the same robots, a process each; in every tick all three are asked in turn, with the same
senses and packets. So the machine's moods fall on all of them alike, and their answers are the same.
"""

import os
import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from benchmarks import scenes
from benchmarks.lines import print_line
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire.access_control import RunAccess, agents_access
from swarmwire.comms.wire.assignment import split
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import unix_endpoint
from swarmwire.deploy import Simulation
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.member import network_in
from swarmwire.deploy.robots.certificates.register import certificate_request
from swarmwire.deploy.runs.scenario_parts import new_medium
from swarmwire.world.backends import allocation
from swarmwire.world.backends.join_policy import JoinPolicy, ListenSettings
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.zenoh_backend import BackendHooks, LockstepBackend
from swarmwire.world.loop import Loop
from swarmwire.world.scenario_file import scenario_from

KINDS = ("unix", "tcp", "tls")
WARM_UP = 20
START_S = 60.0


class InTurn:
    """A backend that asks several, each in turn first, and keeps what each took."""

    def __init__(self, backends: dict[str, LockstepBackend]) -> None:
        self._backends, self._clock = backends, WallClock()
        self.took_ns: list[dict[str, int]] = []

    def start(self) -> None:
        """All of them have been started."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """What the last one says; the others say the same."""
        first = tick % len(KINDS)
        took, actions = dict[str, int](), None
        for kind in (*KINDS[first:], *KINDS[:first]):
            before_ns = self._clock.now_ns()
            actions = self._backends[kind].act(tick, readings, received, tx_status)
            took[kind] = self._clock.now_ns() - before_ns
        self.took_ns.append(took)
        assert actions is not None
        return actions

    def close(self) -> None:
        """They are closed by the code that opened them."""

    def counts(self) -> dict[str, int]:
        """Nothing of its own."""
        return {}


def tls_cost(name: str, repeats: int, *, robots: int, ticks: int) -> None:
    """A tick over TLS in times one over plain TCP, whole ticks of world, radio and runners; the median of all pairs."""
    ratios: list[float] = []
    details: dict[str, object] = {}
    for _ in range(repeats):
        rest_ms, took_ms = _measured(robots, ticks)
        tick_ms = {kind: rest_ms + took_ms[kind] for kind in KINDS}
        ratios.append(float(np.median(tick_ms["tls"] / tick_ms["tcp"])))
        details = {f"tick_ms_{kind}": round(statistics.median(tick_ms[kind].tolist()), 3) for kind in KINDS}
        details["over_unix"] = round(float(np.median(tick_ms["tls"] / tick_ms["unix"])), 3)
        details["runners_alone"] = round(float(np.median(took_ms["tls"] / took_ms["tcp"])), 3)
    config = {
        "robots": robots,
        "runners": robots,
        "ticks": ticks,
        "repeats": repeats,
        "lowest": round(min(ratios), 3),
        "highest": round(max(ratios), 3),
        "rate_hz": 10,
        "body": "epuck",
        "agent": "swarmwire.agent.behaviours:Flocking",
        "physics_steps": 5,
        "certificates": "EC P-256, mutual TLS 1.3 of zenoh, access control for each runner by its common name",
        "beside": "plain TCP on loopback, the same ticks in turn",
        **details,
    }
    print_line(name, statistics.median(ratios), "times the plain tick", config)


def _measured(robots: int, ticks: int) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Of each tick, in ms: what world and radio took, and what each set of runners did."""
    scenario = scenario_from(scenes.flocking(robots, ticks / 10), "tls-cost")
    simulation = Simulation(scenario)
    parts = split(allocation.full_assignment(scenario, simulation.plan.static, dict(simulation.plan.agents)), robots)
    agent, clock = next(iter(simulation.plan.agents.values())), WallClock()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="sw-", dir="/tmp")))
        names = tuple(f"r{i}" for i in range(robots))
        certs = _certificates(folder / "certs", names)
        backends: dict[str, LockstepBackend] = {}
        for kind in KINDS:
            at: list[str] = []
            hooks = BackendHooks(opened=at.extend)
            backend = LockstepBackend(
                _door(kind, folder, certs, names),
                kind,
                Lockstep(parts, policy=JoinPolicy(open=True)),
                START_S,
                clock,
                hooks,
            )
            stack.callback(backend.close)
            backend.open()
            words = [at[0], kind, agent, str(certs) if kind == "tls" else "", *names]
            runners = subprocess.Popen(
                [sys.executable, "-m", "benchmarks.tls_runners", *words],
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )
            backend.start()
            stack.callback(runners.wait, 10.0)
            stack.callback(backend.close)
            backends[kind] = backend
        in_turn = InTurn(backends)
        simulation.metrics.begin(simulation.plan.static)
        loop = Loop(simulation.world, new_medium(scenario, simulation.world, None), in_turn, [simulation.metrics])
        steps_ns = list[int]()
        for _ in range(ticks):
            before_ns = clock.now_ns()
            loop.step()
            steps_ns.append(clock.now_ns() - before_ns)
    took_ms = {kind: np.array([took[kind] for took in in_turn.took_ns])[WARM_UP:] / 1e6 for kind in KINDS}
    rest_ms = np.array(steps_ns)[WARM_UP:] / 1e6 - sum(took_ms.values())
    return rest_ms, took_ms


def _certificates(folder: Path, names: tuple[str, ...]) -> Path:
    begin_authority(folder, WallClock())
    addresses = ("127.0.0.1",)
    issue(
        folder,
        [certificate_request("world", addresses), *(certificate_request(name, addresses, "runner") for name in names)],
        1,
        WallClock(),
    )
    return folder


def _door(kind: str, folder: Path, certs: Path, names: tuple[str, ...]) -> ListenSettings:
    if kind == "unix":
        return ListenSettings((unix_endpoint(f"{folder}/world"),))
    if kind == "tcp":
        return ListenSettings(("tcp/127.0.0.1:0",))
    return ListenSettings(("tls/127.0.0.1:0",), network_in(certs, "world"), agents_access(Keys(kind), RunAccess(names)))
