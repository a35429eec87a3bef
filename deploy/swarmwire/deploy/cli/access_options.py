"""Arguments of commands that go beyond this machine: certificates, and who may take part; together in their help."""

from pathlib import Path
from typing import Annotated

import typer

PANEL = "Beyond this machine"


def _names(option: str, who: str) -> typer.models.OptionInfo:
    return typer.Option(
        option,
        help=f"A name on a certificate: {who}. With --certs the register says it. Repeatable.",
        metavar="NAME",
        rich_help_panel=PANEL,
    )


Certs = Annotated[
    Path | None,
    typer.Option(
        "--certs",
        help="A folder with ca.pem, a certificate with its key, and the register of swarmwire certs, which says who "
        "may take part and who is revoked.",
        metavar="DIR",
        rich_help_panel=PANEL,
    ),
]
Name = Annotated[
    str | None,
    typer.Option("--name", help="Whose certificate, if the folder has several.", metavar="NAME", rich_help_panel=PANEL),
]
Ca = Annotated[
    Path | None,
    typer.Option(
        help="Instead of --certs: who signed the certificates; with --certificate and --key.", rich_help_panel=PANEL
    ),
]
Certificate = Annotated[Path | None, typer.Option(help="The own certificate.", rich_help_panel=PANEL)]
Key = Annotated[Path | None, typer.Option(help="Its key, which its owner alone may read.", rich_help_panel=PANEL)]
RunnerNames = Annotated[list[str] | None, _names("--runner", "who may play robots")]
ObserverNames = Annotated[list[str] | None, _names("--observer", "who may look on")]
OperatorNames = Annotated[list[str] | None, _names("--operator", "who may look on and control")]
RouterNames = Annotated[list[str] | None, _names("--router", "who passes on what others may")]
WorldNames = Annotated[list[str] | None, _names("--world", "who is taken for the world")]
Revoked = Annotated[
    list[str] | None,
    typer.Option(
        "--revoked",
        help="A name whose certificate counts no more, beside those that the register names. Repeatable.",
        metavar="NAME",
        rich_help_panel=PANEL,
    ),
]
Insecure = Annotated[
    bool,
    typer.Option(
        "--insecure",
        help="Go beyond this machine without certificates: whoever is there can take part and overhear.",
        rich_help_panel=PANEL,
    ),
]
