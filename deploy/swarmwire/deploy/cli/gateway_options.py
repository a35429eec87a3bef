"""Arguments of `swarmwire run` for robots that answer as real ones; they stand together in its help."""

from pathlib import Path
from typing import Annotated

import typer

PANEL = "Robots that answer as real ones"

Gateway = Annotated[
    list[str] | None,
    typer.Option(
        help="All robots, or those of GROUP, answer as real ones: as epuck2 or ros2 (swarmwire list gateways), at "
        "ADDRESS, or where the gateway chooses. Repeatable.",
        metavar="[GROUP=]KIND[@ADDRESS]",
        rich_help_panel=PANEL,
    ),
]
GatewaySet = Annotated[
    list[str] | None,
    typer.Option(
        help="Set an option of the gateways that have it, or of GROUP's; swarmwire describe gateway:KIND names them. "
        "Repeatable.",
        metavar="[GROUP.]OPTION=VALUE",
        rich_help_panel=PANEL,
    ),
]
NetworkEndpoint = Annotated[
    str | None,
    typer.Option(
        "--network",
        help="Where the run tells its robots' agents poses, and lends them its radio. Default: tcp/127.0.0.1:0, a free "
        "port of this machine.",
        metavar="ENDPOINT",
        rich_help_panel=PANEL,
    ),
]
Swarm = Annotated[
    str | None,
    typer.Option(help="Name of the swarm in that network. Default: swarm.", metavar="NAME", rich_help_panel=PANEL),
]
Ca = Annotated[
    Path | None,
    typer.Option(
        help="Who signed the members' certificates, for a network beyond this machine.", rich_help_panel=PANEL
    ),
]
Certificate = Annotated[Path | None, typer.Option(help="The run's own certificate.", rich_help_panel=PANEL)]
Key = Annotated[Path | None, typer.Option(help="Its key, which its owner alone may read.", rich_help_panel=PANEL)]
Revoked = Annotated[
    list[str] | None,
    typer.Option(
        "--revoked",
        help="A robot whose certificate counts no more, beside those that certs.json beside the --ca says. Repeatable.",
        metavar="NAME",
        rich_help_panel=PANEL,
    ),
]
Insecure = Annotated[
    bool,
    typer.Option(
        "--insecure",
        help="Go beyond this machine without certificates: whoever is there can drive the robots.",
        rich_help_panel=PANEL,
    ),
]
