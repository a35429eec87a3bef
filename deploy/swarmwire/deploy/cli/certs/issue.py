"""`swarmwire certs issue`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.extras import CERTIFICATES
from swarmwire.deploy.certificates.register import PURPOSES
from swarmwire.deploy.cli.certs.options import AuthorityFolder

if TYPE_CHECKING:
    from swarmwire.deploy.certificates.register import CertificateRequest


def issue_command(
    folder: AuthorityFolder,
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Whose: names of robots, runners, …; tracker, operator, world.", metavar="NAME…"),
    ] = None,
    hosts: Annotated[
        list[str] | None,
        typer.Option("--host", help="An IP address or host name at which they listen. Repeatable.", metavar="ADDRESS"),
    ] = None,
    fleet: Annotated[
        Path | None,
        typer.Option(
            help="Instead of names: all of this fleet.toml, tracker and operator who lack a good one.", metavar="FILE"
        ),
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=3650, help="How long they hold.")] = 365,
    purpose: Annotated[
        str | None,
        typer.Option(
            "--for",
            help=f"{', '.join(PURPOSES)}. Default: what the name's last one is for, or the name, if it is in this "
            "list, or robot.",
            metavar="PURPOSE",
        ),
    ] = None,
    renew: Annotated[
        bool, typer.Option("--renew", help="Also for names whose certificate is good; the old one holds to its end.")
    ] = False,
) -> None:
    """Issue certificates: NAME.pem, and NAME.key, which its owner alone may read.

    Whoever connects to an endpoint checks that its address is in the certificate. For example:

      swarmwire certs issue lab-ca flock-0 --host 10.0.0.10

      swarmwire certs issue lab-ca --fleet fleet.toml

      swarmwire certs issue lab-ca laptop-1 laptop-2 --for runner
    """
    CERTIFICATES.need("certs")
    from swarmwire.deploy.certificates.folder import issue
    from swarmwire.deploy.certificates.register import text_of

    if fleet is not None:
        if names or hosts or purpose:
            raise BadInput("--fleet", "", "expected no NAME, --host or --for with it")
        requests, renew = _lacking(folder, fleet), True
    else:
        requests = _named(names or [], hosts or [], purpose)
    for issued in issue(folder, requests, days, WallClock(), renew=renew):
        typer.echo(
            f"written: {folder / issued.name}.pem and .key ({issued.purpose}), until {text_of(issued.valid_until)}"
        )
    if not requests:
        typer.echo("every member of the fleet has a good certificate")


def _named(names: list[str], hosts: list[str], purpose: str | None) -> "list[CertificateRequest]":
    from swarmwire.deploy.certificates.register import certificate_request

    if not names:
        raise BadInput("NAME", "", "expected at least one name, or --fleet")
    return [certificate_request(name, hosts, purpose) for name in names]


def _lacking(folder: Path, fleet: Path) -> "list[CertificateRequest]":
    from swarmwire.deploy.certificates.register import Register, date_now
    from swarmwire.deploy.fleet.fleet_file import read_fleet

    return read_fleet(fleet).lacking_certificates(Register.read(folder), date_now(WallClock()))
