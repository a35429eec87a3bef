"""`swarmwire certs`: a CA of your own, and one certificate for each member of a swarm's network."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import CERTIFICATES
from swarmwire.deploy.cli.options import AsJson, AuthorityFolder
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from swarmwire.deploy.robots.certificates.register import CertificateRequest, Issued


certs_app = typer.Typer(
    help="Certificates of a swarm's network: a CA of your own, and one certificate for each member.",
    no_args_is_help=True,
)


@certs_app.command("init")
def init_command(folder: AuthorityFolder) -> None:
    """Create a CA, valid for ten years, in a new folder that only you can enter.

    Its key, ca.key, signs the swarm's certificates: keep the folder off robots and out of repositories. For example:

      swarmwire certs init lab-ca
    """
    CERTIFICATES.need("certs")
    from swarmwire.deploy.robots.certificates.folder import begin_authority

    begin_authority(folder, WallClock())
    echo(f"written: {folder / 'ca.pem'}, to share, and {folder / 'ca.key'}, to keep secret")


@certs_app.command("issue")
def issue_command(
    folder: AuthorityFolder,
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Names of members: robots, runners, …; tracker, operator, world.", metavar="NAME…"),
    ] = None,
    hosts: Annotated[
        list[str] | None,
        typer.Option(
            "--host", help="IP address or host name at which the members listen. Repeatable.", metavar="ADDRESS"
        ),
    ] = None,
    fleet: Annotated[
        Path | None,
        typer.Option(
            help="Instead of names: all members of this fleet.toml, tracker and operator without a valid one.",
            metavar="FILE",
        ),
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=3650, help="Validity.")] = 365,
    purpose: Annotated[
        str | None,
        typer.Option(
            "--for",
            help="robot, tracker, operator, runner, observer, router or world. Default: as the name's last one, or "
            "the name, if it is in this list, or robot.",
            metavar="PURPOSE",
        ),
    ] = None,
    renew: Annotated[
        bool,
        typer.Option("--renew", help="Also for names with a valid certificate; the old one stays valid."),
    ] = False,
) -> None:
    """Issue certificates: NAME.pem, and NAME.key, which its owner alone may read.

    Each program that connects to an endpoint checks that its address is in the certificate. For example:

      swarmwire certs issue lab-ca flock-0 --host 10.0.0.10

      swarmwire certs issue lab-ca --fleet fleet.toml

      swarmwire certs issue lab-ca laptop-1 laptop-2 --for runner
    """
    CERTIFICATES.need("certs")
    from swarmwire.deploy.robots.certificates.folder import issue
    from swarmwire.deploy.robots.certificates.register import text_of

    if fleet is not None:
        if names or hosts or purpose:
            raise BadInput("--fleet", "", "expected no NAME, --host or --for with it")
        requests, renew = _fleet_requests(folder, fleet), True
    else:
        requests = _requests(names or [], hosts or [], purpose)
    for issued in issue(folder, requests, days, WallClock(), renew=renew):
        echo(f"written: {folder / issued.name}.pem and .key ({issued.purpose}), until {text_of(issued.valid_until)}")
    if not requests:
        echo("every member of the fleet has a valid certificate")


def _requests(names: list[str], hosts: list[str], purpose: str | None) -> "list[CertificateRequest]":
    from swarmwire.deploy.robots.certificates.register import certificate_request

    if not names:
        raise BadInput("NAME", "", "expected at least one name, or --fleet")
    return [certificate_request(name, hosts, purpose) for name in names]


def _fleet_requests(folder: Path, fleet: Path) -> "list[CertificateRequest]":
    from swarmwire.deploy.robots.certificates.register import Register, date_now
    from swarmwire.deploy.robots.fleet_file import read_fleet

    return read_fleet(fleet).lacking_certificates(Register.read(folder), date_now(WallClock()))


@certs_app.command("revoke")
def revoke_command(
    folder: AuthorityFolder, name: Annotated[str, typer.Argument(help="Name of a member.", metavar="NAME")]
) -> None:
    """Revoke a name for good: under this CA it never gets a certificate again.

    Robots read it in their settings (`revoked = ["NAME"]` under network), after a deployment and a restart; a run with
    gateways reads it in its --certs. For example, a stolen robot:

      swarmwire certs revoke lab-ca flock-3
    """
    CERTIFICATES.need("certs")
    from swarmwire.deploy.robots.certificates.folder import revoke
    from swarmwire.deploy.robots.certificates.register import REGISTER, Register

    revoke(folder, name, WallClock())
    names = ", ".join(f'"{revoked}"' for revoked in Register.read(folder).revoked())
    echo(f"written: {folder / REGISTER}; in the robots' settings: revoked = [{names}]")


COLUMNS = ("name", "for", "addresses", "serial", "valid until", "state")
ENDING = ("ends soon", "ended")
SERIAL_DIGITS = 12  # digits in the table; --json prints all, up to 40


@certs_app.command("list")
def list_issued_command(folder: AuthorityFolder, as_json: AsJson = False) -> None:
    """List certificates, and warn of those that end within 30 days.

    For example:

      swarmwire certs list lab-ca
    """
    from swarmwire.deploy.robots.certificates.register import Register, date_now

    states = list(Register.read(folder).states(date_now(WallClock())))
    if as_json:
        from msgspec import to_builtins

        echo(json.dumps([to_builtins(issued) | {"state": state} for issued, state in states], indent=2))
        return
    _print_issued(states)
    ending = [issued.name for issued, state in states if state in ENDING]
    if states[0][1] in ENDING:
        echo("warning: all end with their CA; make one in another folder: swarmwire certs init DIR", err=True)
    elif ending:
        echo(f"warning: to be renewed: swarmwire certs issue {folder} {' '.join(ending)}", err=True)


def _print_issued(states: "Sequence[tuple[Issued, str]]") -> None:
    from swarmwire.deploy.robots.certificates.register import text_of
    from swarmwire.deploy.terminal.console import TerminalConsole, print_rows

    rows = [
        (
            issued.name,
            issued.purpose,
            " ".join(issued.hosts),
            issued.serial[:SERIAL_DIGITS],
            text_of(issued.valid_until),
            state,
        )
        for issued, state in states
    ]
    print_rows(COLUMNS, rows, TerminalConsole())
