"""`swarmwire-agent join`: plays robots of a run elsewhere, with the agent that is installed here."""

import argparse
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from swarmwire.agent.on_robot.exit_codes import ENDED, FAILED, INTERRUPTED

if TYPE_CHECKING:
    from swarmwire.agent.joining import Joining
    from swarmwire.agent.runner import Inbox

ABOUT = """Play robots of a run that a world elsewhere has opened with `swarmwire world`.

The agent is the one that is installed here; its file must be the same as the world's."""


def add_join(command: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
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
    """Play, and tell how it ended; the exit code."""
    # Imported here, as below: zenoh takes a moment, which the agent of a robot should not.
    from swarmwire.agent.joining import Joining
    from swarmwire.comms.wire.network import Network

    network = Network(
        ca=parsed.ca,
        certificate=parsed.certificate,
        key=parsed.key,
        insecure=parsed.insecure,
    )
    return play_told(
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


def play_told(joining: "Joining") -> int:
    """Play, tell on standard error what people should know, and how it ended; the exit code. Errors as `join`."""
    from swarmwire.agent.joining import join
    from swarmwire.agent.runner import Inbox

    if replace(joining.network, connect=(joining.endpoint,)).warning is not None:
        _say("warning: insecure: whoever is in the network can take the robots over, and overhear them")
    inbox = Inbox()
    with _leaving_by_signals(inbox):
        ended = join(joining, inbox, _say)
    _say(_TOLD[ended.how] + (f": {ended.why}" if ended.why else ""))
    return _CODES[ended.how]


_TOLD = {
    "over": "the run is over",
    "left": "left the run",
    "let go": "the world let it go",
    "gone": "the world is gone, or out of reach",
}
_CODES = {"over": ENDED, "left": INTERRUPTED, "let go": FAILED, "gone": FAILED}


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")


@contextmanager
def _leaving_by_signals(inbox: "Inbox") -> Generator[None]:
    """While it holds, the first Ctrl-C, or a signal to end, leaves the run; a second Ctrl-C ends at once."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: now for number in numbers if (now := signal.getsignal(number)) != signal.SIG_IGN}

    def leave(_number: int, _frame: FrameType | None) -> None:
        inbox.leave()
        if signal.SIGINT in before:  # a shell's script has what it starts in the background ignore it
            signal.signal(signal.SIGINT, before[signal.SIGINT])

    for number in before:
        signal.signal(number, leave)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
