"""Joining a run from another machine, and the command `swarmwire-agent join`.

`join` opens a session, chooses the run at the endpoint, asks the world for its session info, loads this machine's
agents, and runs the robots that the world assigns. The command adds flags, messages and exit codes.
"""

# zenoh's stubs leave out the types of the answers of a session.
# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import argparse
import hashlib
import os
import queue
import signal
import socket
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from secrets import token_hex
from types import FrameType
from typing import TYPE_CHECKING

import msgpack
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.agent import NoAgent, agent_sha256, load_agent
from swarmwire.agent.on_robot.settings import ENDED, FAILED, INTERRUPTED
from swarmwire.agent.runner import NO_ROBOTS, Asked, Ended, TickInbox, play
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import BadFrame, BadInput, RunnerLost
from swarmwire.comms.plugins import resolve
from swarmwire.comms.wire.frames import VERSION
from swarmwire.comms.wire.join import JoinRequest, SessionInfo
from swarmwire.comms.wire.keys import EVERY_WORLD, Keys, fault_of_name, run_of
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import closed_after, open_runner

if TYPE_CHECKING:
    from swarmwire.agent.runner import TickInbox

POLL_S = 5.0  # for worlds at an endpoint: a router may have to find them first
FURTHER_POLL_S = 0.3  # for further worlds after the first
SESSION_INFO_TIMEOUT_S = 10.0
ALL_GROUPS = ""  # in place of a group's name


@dataclass(frozen=True)
class Joining:
    """The settings of a runner that joins a run.

    Attributes:
        endpoint: the endpoint of the world, or of a router in front of it.
        robots: number of robots; None, without names: all free robots, or the next part.
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
        """BadInput for settings that no run can satisfy."""
        self.network.check_endpoint(self.endpoint, "", "ENDPOINT")
        if self.robots is not None and self.names is not None:
            raise BadInput("--robots", "", "expected only one of --robots and --names")
        if self.robots is not None and self.robots < 1:
            raise BadInput("--robots", "", f"expected at least 1, got {self.robots}")
        if self.name is not None and (fault := fault_of_name(self.name)) is not None:
            raise BadInput("--name", "", fault)
        if self.scenario is not None and not self.scenario.is_file():
            raise BadInput("--scenario", str(self.scenario), "expected a file, it is none")

    @property
    def runner(self) -> str:
        """The runner's name; with certificates it must be the name on its own."""
        if self.name is not None:
            return self.name
        if self.network.certificate is not None:
            return self.network.certificate.stem
        host = "".join(letter for letter in socket.gethostname().partition(".")[0] if letter.isalnum() or letter == "-")
        return f"{host or 'runner'}-{os.getpid()}-{token_hex(2)}"


def join(joining: Joining, inbox: TickInbox, say: Callable[[str], None]) -> Ended:
    """Run robots of a run to its end, or until `inbox.leave()`; `say` gets messages for the user.

    BadInput for wrong settings, RunnerLost if the world is not there or refuses the runner.
    """
    joining.check()
    runner = joining.runner
    try:
        session = open_runner(joining.endpoint, joining.connect_s, joining.network)
    except zenoh.ZError as error:
        reason = str(error).split(" at ")[0]
        why = "" if "Timeout" in reason else f": {reason}"
        raise RunnerLost(
            runner, NO_ROBOTS, f"nobody answers at {joining.endpoint}{_certificate_hint(joining)}{why}"
        ) from error
    with closed_after(session):
        run_id = _chosen_run(session, runner, joining)
        keys = Keys(run_id)

        def asked() -> Asked:
            info = _session_info(session, keys, runner)
            agents, hashes = _own_agents(info, joining, say)
            return Asked(JoinRequest(joining.robots, joining.names, hashes, _sha256(joining.scenario)), agents)

        def joined(assignment: Assignment) -> None:
            say(f"{runner}: joined run {run_id} with {assignment.robots_text}")

        return play(session, keys, runner, inbox, asked, joined)


def _certificate_hint(joining: Joining) -> str:
    return ", or one certificate or the other is not accepted" if joining.network.proves else ""


def _chosen_run(session: zenoh.Session, runner: str, joining: Joining) -> str:
    """The id of the chosen run, or of the only one at the endpoint."""
    endpoint = joining.endpoint
    replies = session.liveliness().get(EVERY_WORLD, timeout=POLL_S)
    present = {run_of(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None}
    runs = sorted(present or _awaited_runs(session))
    if joining.run in runs:
        return joining.run
    if len(runs) == 1 and joining.run is None:
        return runs[0]
    if runs:
        got = "" if joining.run is None else f", got {joining.run}"
        raise BadInput("--run", "", f"expected one of the runs at {endpoint}: {', '.join(runs)}{got}")
    raise RunnerLost(runner, NO_ROBOTS, f"there is no run at {endpoint}, or it does not let {runner} in")


def _awaited_runs(session: zenoh.Session) -> set[str]:
    """The runs that appear within a few seconds.

    By a subscription alone: beside one to the same keys, zenoh answers a `get` only sometimes.
    """
    arrived: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    subscriber = session.liveliness().declare_subscriber(
        EVERY_WORLD, Callback(arrived.put, indirect=False), history=True
    )
    runs, timeout_s = set[str](), POLL_S
    with suppress(queue.Empty):
        while True:
            runs.add(run_of(str(arrived.get(timeout=timeout_s).key_expr)))
            timeout_s = FURTHER_POLL_S
    subscriber.undeclare()
    return runs


def _session_info(session: zenoh.Session, keys: Keys, runner: str) -> SessionInfo:
    for reply in session.get(keys.offer(runner), payload=msgpack.packb({"v": VERSION}), timeout=SESSION_INFO_TIMEOUT_S):
        if reply.err is not None:
            raise RunnerLost(runner, NO_ROBOTS, reply.err.payload.to_string())
        if reply.ok is not None:
            try:
                return SessionInfo.decode(reply.ok.payload.to_bytes())
            except BadFrame as fault:
                raise RunnerLost(runner, NO_ROBOTS, f"another version of swarmwire: {fault}") from fault
    raise RunnerLost(runner, NO_ROBOTS, f"the world told nothing of its run: it may not let {runner} in")


def _own_agents(
    info: SessionInfo, joining: Joining, say: Callable[[str], None]
) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """The spec and the sha256 of this machine's own agent, by group; a missing agent is reported and left out."""
    by_group = _agents_by_group(joining.agents, [group.name for group in info.groups])
    specs: dict[str, str] = {}
    hashes: dict[str, str] = {}
    for group in info.groups:
        if joining.names is not None and not set(group.free) & set(joining.names):
            continue
        own = by_group.get(group.name, by_group.get(ALL_GROUPS))
        folder = Path.cwd() if own or joining.scenario is None else joining.scenario.parent
        spec = resolve(own or group.agent, folder)
        try:
            hashes[group.name] = agent_sha256(load_agent(spec))
            specs[group.name] = spec
        except NoAgent as error:
            say(f"no agent for {group.name}: {error}; --agent names another")
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


ABOUT = """Play robots of a run that a world elsewhere has opened with `swarmwire world`.

The agent is the one that is installed here; its file must be the same as the world's."""


def add_join(command: argparse.ArgumentParser) -> None:
    """Add the arguments of `swarmwire-agent join`."""
    command.add_argument("endpoint", metavar="ENDPOINT", help="where the world listens: tls/10.0.0.5:7447")
    which = command.add_mutually_exclusive_group()
    which.add_argument("--robots", type=int, metavar="N", help="so many; else all that are free, or the next part")
    which.add_argument("--names", metavar="A,B", help="these robots")
    command.add_argument(
        "--agent", action="append", metavar="[GROUP=]AGENT", help="mine.py:Mine; else as the scenario names it"
    )
    command.add_argument("--scenario", type=Path, metavar="FILE", help="join only a run of exactly this scenario")
    command.add_argument("--name", help="the runner's; else its certificate's, or one made up")
    command.add_argument("--run", metavar="ID", help="which run, if there are several")
    command.add_argument("--ca", type=Path, metavar="FILE", help="certificate that signed all others")
    command.add_argument("--certificate", type=Path, metavar="FILE", help="the runner's certificate")
    command.add_argument("--key", type=Path, metavar="FILE", help="its private key")
    command.add_argument("--insecure", action="store_true", help="go without certificates beyond this machine")


def join_parsed(parsed: argparse.Namespace) -> int:
    """Run `swarmwire-agent join`; returns the exit code."""
    # Imported here, as below: zenoh loads slowly, and the agent of a robot may not use it.
    from swarmwire.comms.wire.network import Network

    network = Network(
        ca=parsed.ca,
        certificate=parsed.certificate,
        key=parsed.key,
        insecure=parsed.insecure,
    )
    return join_and_report(
        Joining(
            endpoint=parsed.endpoint,
            robots=parsed.robots,
            names=None if parsed.names is None else names_in(parsed.names),
            agents=tuple(parsed.agent or ()),
            scenario=parsed.scenario,
            name=parsed.name,
            run=parsed.run,
            network=network,
        )
    )


def names_in(text: str) -> tuple[str, ...]:
    """The names of a list such as "flock-0,flock-3"."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def join_and_report(joining: "Joining") -> int:
    """Join, and print messages and the end on standard error; returns the exit code. Errors as `join`."""
    from swarmwire.agent.runner import TickInbox

    if replace(joining.network, connect=(joining.endpoint,)).warning is not None:
        _say("warning: insecure: whoever is in the network can take the robots over, and overhear them")
    inbox = TickInbox()
    with _leaving_by_signals(inbox):
        ended = join(joining, inbox, _say)
    _say(_END_TEXTS[ended.how] + (f": {ended.why}" if ended.why else ""))
    return _EXIT_CODES[ended.how]


_END_TEXTS = {
    "over": "the run is over",
    "left": "left the run",
    "let go": "the world let it go",
    "gone": "the world is gone, or out of reach",
}
_EXIT_CODES = {"over": ENDED, "left": INTERRUPTED, "let go": FAILED, "gone": FAILED}


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")


@contextmanager
def _leaving_by_signals(inbox: "TickInbox") -> Generator[None]:
    """Within this context, the first Ctrl-C or stop signal leaves the run; a second Ctrl-C ends at once."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: now for number in numbers if (now := signal.getsignal(number)) != signal.SIG_IGN}

    def leave(_number: int, _frame: FrameType | None) -> None:
        inbox.leave()
        if signal.SIGINT in before:  # a background job of a shell script ignores it
            signal.signal(signal.SIGINT, before[signal.SIGINT])

    for number in before:
        signal.signal(number, leave)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
