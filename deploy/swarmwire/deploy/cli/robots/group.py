"""The group of commands `swarmwire robots`."""

import typer

from swarmwire.deploy.cli.robots.check import check_command
from swarmwire.deploy.cli.robots.deploy import deploy_command
from swarmwire.deploy.cli.robots.estop import estop_command
from swarmwire.deploy.cli.robots.logs import logs_command
from swarmwire.deploy.cli.robots.rollback import rollback_command
from swarmwire.deploy.cli.robots.start import start_command
from swarmwire.deploy.cli.robots.status import status_command
from swarmwire.deploy.cli.robots.stop import stop_command

HELP = "A fleet of real robots, as a fleet.toml tells it: what runs on them, over SSH, all at the same time."

robots_app = typer.Typer(help=HELP, no_args_is_help=True)


@robots_app.callback(help=HELP)
def _robots() -> None: ...


robots_app.command("check")(check_command)
robots_app.command("deploy")(deploy_command)
robots_app.command("start")(start_command)
robots_app.command("stop")(stop_command)
robots_app.command("status")(status_command)
robots_app.command("logs")(logs_command)
robots_app.command("rollback")(rollback_command)
robots_app.command("estop")(estop_command)
