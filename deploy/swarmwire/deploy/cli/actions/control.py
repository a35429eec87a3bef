"""`swarmwire ctl`: requests to a live run."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from typing import Any

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.access_control import OPERATOR
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.cli.options import RunChoice
from swarmwire.deploy.live.remote_control import RemoteControl, controlling, only_run_at
from swarmwire.deploy.robots.certificates.member import member
from swarmwire.deploy.runs.live_address import find_run
from swarmwire.deploy.terminal.output import echo

UNLIMITED = "max"


def operator_network(choice: RunChoice) -> Network | None:
    """Return the settings for an endpoint beyond this machine, None for a run of this machine; BadInput if refused."""
    if choice.endpoint is None:
        if choice.certs or choice.name or choice.insecure:
            raise BadInput("--endpoint", "", "is missing: certificates are for a run on another machine")
        return None
    credentials = member(OPERATOR, certs=choice.certs, name=choice.name, insecure=choice.insecure)
    credentials.check("--endpoint", choice.endpoint)
    if (warning := credentials.warning([choice.endpoint])) is not None:
        echo(f"warning: {warning}", err=True)
    return credentials.network


@contextmanager
def control_of(choice: RunChoice) -> Generator[RemoteControl]:
    """Control the chosen run within the context; BadInput if the choice is ambiguous, RunGone if it does not answer."""
    network = operator_network(choice)
    if choice.endpoint is None:
        live = find_run(choice.run)
        endpoint, run = live.endpoint, live.run
    else:
        endpoint, run = choice.endpoint, choice.run or only_run_at(choice.endpoint, network)
    with controlling(endpoint, run, network) as control:
        yield control


def print_reply(reply: Mapping[str, Any]) -> None:
    """Print what a request changed, and the tick of the run."""
    echo(f"{reply['done']} (at tick {reply['tick']})")


def pause(choice: RunChoice) -> None:
    """Pause the run."""
    with control_of(choice) as control:
        print_reply(control.pause())


def resume(choice: RunChoice) -> None:
    """Resume the run."""
    with control_of(choice) as control:
        print_reply(control.resume())


def step(choice: RunChoice, ticks: int) -> None:
    """Run some ticks, then pause."""
    with control_of(choice) as control:
        print_reply(control.step(ticks))


def set_speed(choice: RunChoice, factor: str) -> None:
    """Set the speed to a factor of real time, or "max"."""
    speed = None if factor == UNLIMITED else _number(factor)
    with control_of(choice) as control:
        print_reply(control.speed(speed))


def stop(choice: RunChoice) -> None:
    """End the run after the current tick."""
    with control_of(choice) as control:
        print_reply(control.stop())


def _number(text: str) -> float:
    try:
        return float(text.removeprefix("x"))
    except ValueError:
        raise BadInput("FACTOR", "", f"expected a number such as 0.5, or max; got {text!r}") from None
