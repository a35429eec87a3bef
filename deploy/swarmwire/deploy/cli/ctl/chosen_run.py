"""Which run the commands of `swarmwire ctl` mean, and control over it."""

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.access_options import PANEL

if TYPE_CHECKING:
    from swarmwire.comms.wire.network import Network
    from swarmwire.deploy.control.remote_control import RemoteControl
    from swarmwire.deploy.control.run_finder import FoundRun

Endpoint = Annotated[
    str | None,
    typer.Option(
        help="Of a run on another machine: where it takes observers.", metavar="ENDPOINT", rich_help_panel=PANEL
    ),
]


@dataclass
class Chosen:
    """What is said of the run before the command."""

    run: str | None = None  # its id, or its folder; None: the only one
    endpoint: str | None = None  # on another machine; None: a run of this one
    certs: Path | None = None
    name: str | None = None
    files: tuple[Path | None, Path | None, Path | None] = (None, None, None)  # ca, certificate, key
    insecure: bool = False

    def network(self) -> "Network | None":
        """The settings for an endpoint beyond this machine; None for a run of this one. BadInput if they won't do."""
        if self.endpoint is None:
            if self.certs or self.name or any(self.files) or self.insecure:
                raise BadInput("--endpoint", "", "is missing: certificates are for a run on another machine")
            return None
        from swarmwire.comms.wire.access_control import OPERATOR
        from swarmwire.deploy.certificates.member import member

        of = member(OPERATOR, certs=self.certs, name=self.name, files=self.files, insecure=self.insecure)
        if (warning := of.warning([self.endpoint])) is not None:
            typer.echo(f"warning: {warning}", err=True)
        return of.network


@contextmanager
def control_of(chosen: Chosen) -> "Generator[RemoteControl]":
    """Control over the run that is meant; BadInput if it is not clear which, RunGone if it does not answer."""
    from swarmwire.deploy.control.remote_control import controlling, only_run_at
    from swarmwire.deploy.control.run_finder import find_run

    network = chosen.network()
    if chosen.endpoint is not None:
        run = chosen.run or only_run_at(chosen.endpoint, network)
        with controlling(chosen.endpoint, run, network) as control:
            yield control
        return
    found = find_run(chosen.run)
    with controlling(found.endpoint, found.run) as control:
        yield control


def runs_of_this_machine(chosen: Chosen) -> "list[FoundRun]":
    """The runs that are meant, if they are this machine's: all, unless one is named."""
    from swarmwire.deploy.control.run_finder import find_run, found_runs

    return found_runs() if chosen.run is None else [find_run(chosen.run)]
