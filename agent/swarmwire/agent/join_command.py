"""The command `swarmwire-agent join`: flags, signals, messages and exit codes around `joining.join`."""

import argparse
import signal
import sys
from collections.abc import Generator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from swarmwire.agent.on_robot.settings import ENDED, FAILED, INTERRUPTED, in_flags
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.printable import LINES, printable

if TYPE_CHECKING:
    from swarmwire.agent.joining import JoinSettings
    from swarmwire.agent.runner import Arrivals
    from swarmwire.comms.wire.network import Network

ABOUT = """Run robots' agents for a run that `swarmwire world` serves.

It is the agent that is installed on this machine; its file must be the same as the world's."""


def add_join(command: argparse.ArgumentParser) -> None:
    """Add the arguments of `swarmwire-agent join`."""
    command.add_argument("endpoint", metavar="ENDPOINT", help="endpoint of the world: tls/10.0.0.5:7447")
    selection = command.add_mutually_exclusive_group()
    selection.add_argument(
        "--robots",
        type=int,
        metavar="N",
        help="number of free robots to take; default: all free ones",
    )
    selection.add_argument("--names", metavar="A,B", help="these robots")
    command.add_argument(
        "--agent", action="append", metavar="[GROUP=]AGENT", help="mine.py:Mine; default: the scenario's"
    )
    command.add_argument("--processes", type=int, metavar="N", help="number of processes; default: one per robot")
    command.add_argument("--agent-network", action="store_true", help="let agents use this machine's network")
    command.add_argument(
        "--isolate", action="store_true", help="for agents that you do not trust: read-only files, no other processes"
    )
    command.add_argument("--scenario", type=Path, metavar="FILE", help="join only a run of exactly this scenario")
    command.add_argument("--name", help="the runner's name; default: its certificate's, or a generated one")
    command.add_argument("--run", metavar="ID", help="id of the run, if there are several")
    command.add_argument("--ca", type=Path, metavar="FILE", help="certificate that signed all others")
    command.add_argument("--certificate", type=Path, metavar="FILE", help="the runner's certificate")
    command.add_argument("--key", type=Path, metavar="FILE", help="its private key")
    command.add_argument("--insecure", action="store_true", help="go without certificates beyond this machine")


def join_parsed(parsed: argparse.Namespace) -> int:
    """Run `swarmwire-agent join`; return the exit code."""
    # Late imports, also below: zenoh loads slowly, and the agent of a robot may not use it.
    from swarmwire.agent.joining import JoinSettings
    from swarmwire.comms.wire.network import Network

    network = Network(
        ca=parsed.ca,
        certificate=parsed.certificate,
        key=parsed.key,
        insecure=parsed.insecure,
    )
    _check(network, parsed.endpoint)
    return join_and_report(
        JoinSettings(
            endpoint=parsed.endpoint,
            robots=parsed.robots,
            names=None if parsed.names is None else parse_names(parsed.names),
            agents=tuple(parsed.agent or ()),
            scenario=parsed.scenario,
            name=parsed.name,
            run=parsed.run,
            network=network,
        ),
        parsed.processes,
        agent_network=parsed.agent_network,
        isolate=parsed.isolate,
    )


def _check(network: "Network", endpoint: str) -> None:
    """Raise BadInput, with flags instead of keys of settings, for missing files or an endpoint that is not allowed."""
    try:
        network.check_files("", "network")
        network.check_endpoint(endpoint, "", "ENDPOINT")
    except BadInput as error:
        raise BadInput("", error.key.replace("network.", "--"), in_flags(error.expected)) from None


def parse_names(text: str) -> tuple[str, ...]:
    """Split a list of names such as "flock-0,flock-3"."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def join_and_report(
    settings: "JoinSettings", processes: int | None = None, *, agent_network: bool = False, isolate: bool = False
) -> int:
    """Join, and print messages and the end on standard error; return the exit code. Errors as `join`.

    `agent_network` and `isolate` are the borders of the agents' processes.
    """
    from swarmwire.agent.fork_server import ForkServer
    from swarmwire.agent.isolation import Isolation, keep_from_others

    hidden = tuple(str(path.parent.resolve()) for path in (settings.network.key,) if path) if isolate else ()
    server = ForkServer(Isolation(agent_network, isolate, hidden))  # before any thread of zenoh
    for border in server.missing:
        _report(f"agent processes: not enforced: {border}")
    keep_from_others()
    from swarmwire.agent.joining import join
    from swarmwire.agent.runner import Arrivals, ProcessPool

    network = replace(settings.network, connect=(settings.endpoint,))
    if network.insecure and network.warning is not None:
        _report("warning: insecure: every machine in the network can take over the robots and read their packets")
    arrivals = Arrivals()
    with closing(server), _leaving_by_signals(arrivals):
        ended = join(settings, arrivals, ProcessPool(server, processes, _report))
    _report(_OUTCOME_TEXTS[ended.outcome] + (f": {ended.reason}" if ended.reason else ""))
    return _EXIT_CODES[ended.outcome]


_OUTCOME_TEXTS = {
    "over": "the run is over",
    "left": "left the run",
    "removed": "the world removed the runner",
    "gone": "the world is gone, or out of reach",
}
_EXIT_CODES = {"over": ENDED, "left": INTERRUPTED, "removed": FAILED, "gone": FAILED}


def _report(text: str) -> None:
    sys.stderr.write(f"{printable(text, keep=LINES)}\n")


@contextmanager
def _leaving_by_signals(arrivals: "Arrivals") -> Generator[None]:
    """Within this context, the first Ctrl-C or stop signal leaves the run; a second Ctrl-C ends at once."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = {number: handler for number in numbers if (handler := signal.getsignal(number)) != signal.SIG_IGN}

    def leave(_number: int, _frame: FrameType | None) -> None:
        arrivals.leave()
        if signal.SIGINT in handlers:  # a background job of a shell script ignores it
            signal.signal(signal.SIGINT, handlers[signal.SIGINT])

    for number in handlers:
        signal.signal(number, leave)
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
