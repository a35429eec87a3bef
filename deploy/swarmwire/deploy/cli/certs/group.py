"""The group of commands `swarmwire certs`."""

import typer

from swarmwire.deploy.cli.certs.init import init_command
from swarmwire.deploy.cli.certs.issue import issue_command
from swarmwire.deploy.cli.certs.list_issued import list_issued_command
from swarmwire.deploy.cli.certs.revoke import revoke_command

HELP = "Certificates of a swarm's network: a CA of your own, and one certificate for each robot and its company."

certs_app = typer.Typer(help=HELP, no_args_is_help=True)


@certs_app.callback(help=HELP)
def _certs() -> None: ...


certs_app.command("init")(init_command)
certs_app.command("issue")(issue_command)
certs_app.command("revoke")(revoke_command)
certs_app.command("list")(list_issued_command)
