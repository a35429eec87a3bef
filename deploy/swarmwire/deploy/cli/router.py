"""`swarmwire router`."""

from collections import Counter
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.options import (
    Certs,
    Insecure,
    Name,
    Revoked,
    RouterNames,
    RunnerNames,
    WorldNames,
)
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from swarmwire.deploy.robots.certificates.member import MemberCredentials

POLL_S = 0.2  # interval of the checks for a signal and for changed links


def router_command(
    listen: Annotated[
        list[str],
        typer.Option("--listen", help="Endpoint for runners and further routers. Repeatable.", metavar="ENDPOINT"),
    ],
    connect: Annotated[
        list[str],
        typer.Option("--connect", help="The world or the router before this one. Repeatable.", metavar="ENDPOINT"),
    ],
    certs: Certs = None,
    name: Name = None,
    runners: RunnerNames = None,
    routers: RouterNames = None,
    worlds: WorldNames = None,
    revoked: Revoked = None,
    insecure: Insecure = False,
) -> None:
    """Forward messages between runners and a world that cannot reach each other.

    It enforces access rights as a world does, runs until it is interrupted, and retries connections to peers. Routers
    on both sides are named by --router. For example:

      swarmwire router --listen tls/0.0.0.0:7447 --connect tls/10.0.0.5:7447 --certs lab-certs
    """
    from swarmwire.comms.wire.access_control import RunAccess, router_access
    from swarmwire.deploy.robots.certificates.member import member
    from swarmwire.deploy.robots.certificates.register import ROUTER

    rights = RunAccess(runners=tuple(runners or ()), routers=tuple(routers or ()))
    if worlds:
        rights = RunAccess(rights.runners, routers=rights.routers, worlds=tuple(worlds))
    credentials = member(
        ROUTER,
        certs=certs,
        name=name,
        access=rights,
        revoked=revoked or (),
        insecure=insecure,
    )
    credentials.check("--listen", *listen)
    credentials.check("--connect", *connect)
    access = None if credentials.access is None else router_access(credentials.access)
    warning = credentials.warning([*listen, *connect])
    if warning is not None:
        echo(f"warning: {warning}", err=True)
    _route(credentials, listen, connect, access)


def _route(
    credentials: "MemberCredentials", listen: list[str], connect: list[str], access: dict[str, object] | None
) -> None:
    """Forward messages until a signal arrives."""
    import zenoh

    from swarmwire.comms.base.clock import WallClock, to_ns
    from swarmwire.comms.wire.sessions import closed_after, listens_at, open_router
    from swarmwire.deploy.runs.controls import Interrupt

    clock = WallClock()
    with Interrupt() as interrupt:
        try:
            session = open_router(listen, connect, credentials.network, access)
        except zenoh.ZError as error:
            reason = str(error).split(" at ")[0]
            raise BadInput("--listen", ", ".join(listen), f"expected endpoints that are free: {reason}") from error
        with closed_after(session):
            echo(f"router: listens at {', '.join(listens_at(session))}, calls {', '.join(connect)}")
            linked = Counter[str]()
            while not interrupt.requested:
                links = Counter(link.auth_identifier or link.dst for link in session.info.links())
                _print_changes(linked, links)
                linked = links
                clock.sleep_until(clock.now_ns() + to_ns(POLL_S))
    if not interrupt.hung_up:
        echo("router: ended")


def _print_changes(before: "Counter[str]", after: "Counter[str]") -> None:
    """Print new and lost links."""
    for word, changed in (("linked with", after - before), ("lost", before - after)):
        for name in changed.elements():
            echo(f"router: {word} {name}")
