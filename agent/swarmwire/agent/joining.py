"""Joining a run from another machine.

`join` opens a session, chooses the run at the endpoint, asks the world for its session info, loads this machine's
agents, and runs the robots that the world assigns. `join_command` adds flags, messages and exit codes.
"""

# zenoh's stubs lack the types of the answers of a session.
# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import hashlib
import os
import queue
import socket
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from secrets import token_hex

import msgpack
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.agent import NoAgent, agent_sha256, load_agent
from swarmwire.agent.runner import UNASSIGNED, Arrivals, ProcessPool, run_in_session
from swarmwire.agent.runner_protocol import Ended, JoinOptions
from swarmwire.comms.base.errors import BadFrame, BadInput, RunnerLost
from swarmwire.comms.base.plugins import resolve
from swarmwire.comms.wire.frames import VERSION
from swarmwire.comms.wire.join import JoinRequest, SessionInfo
from swarmwire.comms.wire.keys import EVERY_WORLD, Keys, fault_of_name, run_of
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import closed_after, open_runner

POLL_S = 5.0  # until the first world appears: a router may have to find it
FURTHER_POLL_S = 0.3  # until a further world appears
SESSION_INFO_TIMEOUT_S = 10.0
ALL_GROUPS = ""  # name for all groups


@dataclass(frozen=True)
class JoinSettings:
    """The settings of a runner that joins a run.

    Attributes:
        endpoint: the endpoint of the world, or of a router in front of it.
        robots: number of robots; None, without names: all free robots.
        names: names of the robots.
        agents: "mine.py:Mine" for all groups, or "flock=mine.py:Mine"; otherwise the scenario's, relative to the folder
            of `scenario` or else to the working directory.
        scenario: a file that must be that of the run; None: any.
        name: name of the runner; None: that of its certificate, or a generated one.
        run: id of the run; None: the only one at the endpoint.
        network: the certificates.
        connect_s: timeout of the connection to the endpoint.
    """

    endpoint: str
    robots: int | None = None
    names: tuple[str, ...] | None = None
    agents: tuple[str, ...] = ()
    scenario: Path | None = None
    name: str | None = None
    run: str | None = None
    network: Network = field(default_factory=Network)
    connect_s: float = 10.0

    def check(self) -> None:
        """Raise BadInput for settings that no run can satisfy."""
        self.network.check_endpoint(self.endpoint, "", "ENDPOINT")
        if self.robots is not None and self.names is not None:
            raise BadInput("--robots", "", "expected only one of --robots and --names")
        if self.robots is not None and self.robots < 1:
            raise BadInput("--robots", "", f"expected at least 1, got {self.robots}")
        if self.name is not None and (fault := fault_of_name(self.name)) is not None:
            raise BadInput("--name", "", fault)
        if self.scenario is not None and not self.scenario.is_file():
            raise BadInput("--scenario", str(self.scenario), "expected a file")

    @property
    def runner(self) -> str:
        """The runner's name; with certificates it must be the name in the runner's certificate."""
        if self.name is not None:
            return self.name
        if self.network.certificate is not None:
            return self.network.certificate.stem
        hostname = socket.gethostname().partition(".")[0]
        machine = "".join(letter for letter in hostname if letter.isalnum() or letter == "-")
        return f"{machine or 'runner'}-{os.getpid()}-{token_hex(2)}"


def join(settings: JoinSettings, arrivals: Arrivals, pool: ProcessPool) -> Ended:
    """Run agents for a run to its end, or until `arrivals.leave()`.

    BadInput for wrong settings, RunnerLost if there is no world or it refuses the runner.
    """
    settings.check()
    if pool.processes is not None and pool.processes < 1:
        raise BadInput("--processes", "", f"expected at least 1, got {pool.processes}")
    runner = settings.runner
    try:
        session = open_runner(settings.endpoint, settings.connect_s, settings.network)
    except zenoh.ZError as error:
        reason = str(error).split(" at ")[0]
        detail = "" if "Timeout" in reason else f": {reason}"
        raise RunnerLost(
            runner, UNASSIGNED, f"no world answers at {settings.endpoint}{_certificate_hint(settings)}{detail}"
        ) from error
    with closed_after(session):
        run_id = _chosen_run(session, runner, settings)
        keys = Keys(run_id)

        def options() -> JoinOptions:
            info = _session_info(session, keys, runner)
            agents, hashes = _local_agents(info, settings, pool.report)
            return JoinOptions(JoinRequest(settings.robots, settings.names, hashes, _sha256(settings.scenario)), agents)

        return run_in_session(session, keys, runner, arrivals, options, pool)


def _certificate_hint(settings: JoinSettings) -> str:
    return ", or one of the two certificates is not accepted" if settings.network.proves else ""


def _chosen_run(session: zenoh.Session, runner: str, settings: JoinSettings) -> str:
    """Return the id of the chosen run, or of the only run at the endpoint."""
    endpoint = settings.endpoint
    replies = session.liveliness().get(EVERY_WORLD, timeout=POLL_S)
    present = {run_of(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None}
    runs = sorted(present or _awaited_runs(session))
    if settings.run in runs:
        return settings.run
    if len(runs) == 1 and settings.run is None:
        return runs[0]
    if runs:
        got = "" if settings.run is None else f", got {settings.run}"
        raise BadInput("--run", "", f"expected one of the runs at {endpoint}: {', '.join(runs)}{got}")
    raise RunnerLost(runner, UNASSIGNED, f"there is no run at {endpoint}, or it does not let {runner} in")


def _awaited_runs(session: zenoh.Session) -> set[str]:
    """Wait a few seconds for runs, and return them.

    This uses a subscription alone: with a subscription to the same keys, zenoh answers a `get` only sometimes.
    """
    arrivals: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    subscriber = session.liveliness().declare_subscriber(
        EVERY_WORLD, Callback(arrivals.put, indirect=False), history=True
    )
    runs, timeout_s = set[str](), POLL_S
    with suppress(queue.Empty):
        while True:
            runs.add(run_of(str(arrivals.get(timeout=timeout_s).key_expr)))
            timeout_s = FURTHER_POLL_S
    subscriber.undeclare()
    return runs


def _session_info(session: zenoh.Session, keys: Keys, runner: str) -> SessionInfo:
    for reply in session.get(
        keys.session_info(runner), payload=msgpack.packb({"v": VERSION}), timeout=SESSION_INFO_TIMEOUT_S
    ):
        if reply.err is not None:
            raise RunnerLost(runner, UNASSIGNED, reply.err.payload.to_string())
        if reply.ok is not None:
            try:
                return SessionInfo.decode(reply.ok.payload.to_bytes())
            except BadFrame as fault:
                raise RunnerLost(runner, UNASSIGNED, f"another version of swarmwire: {fault}") from fault
    reason = f"the world sent no session information: its access rules may exclude {runner}"
    raise RunnerLost(runner, UNASSIGNED, reason)


def _local_agents(
    info: SessionInfo, settings: JoinSettings, report: Callable[[str], None]
) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Return spec and sha256 of this machine's agents, by group; a missing agent is reported and omitted."""
    by_group = _agents_by_group(settings.agents, [group.name for group in info.groups])
    specs: dict[str, str] = {}
    hashes: dict[str, str] = {}
    for group in info.groups:
        if settings.names is not None and not set(group.free) & set(settings.names):
            continue
        chosen = by_group.get(group.name, by_group.get(ALL_GROUPS))
        folder = Path.cwd() if chosen or settings.scenario is None else settings.scenario.parent
        spec = resolve(chosen or group.agent, folder)
        try:
            hashes[group.name] = agent_sha256(load_agent(spec))
            specs[group.name] = spec
        except NoAgent as error:
            report(f"no agent for {group.name}: {error}; --agent names another")
    return specs, hashes


def _agents_by_group(texts: Sequence[str], groups: Sequence[str]) -> dict[str, str]:
    specs: dict[str, str] = {}
    for text in texts:
        group, equals, spec = text.partition("=")
        if equals and group not in groups:
            raise BadInput("--agent", text, f"expected a group of the run: {', '.join(groups)}")
        specs[group if equals else ALL_GROUPS] = spec if equals else text
    return specs


def _sha256(path: Path | None) -> str | None:
    return None if path is None else hashlib.sha256(path.read_bytes()).hexdigest()
