"""The group of commands `swarmwire radio`."""

import typer

from swarmwire.deploy.cli.radio.fit import fit_command
from swarmwire.deploy.cli.radio.probe import probe_command

HELP = "Radios by themselves: what an emulated one does, and what logs of real ones say."

radio_app = typer.Typer(help=HELP, no_args_is_help=True)


@radio_app.callback(help=HELP)
def _radio() -> None: ...


radio_app.command("fit")(fit_command)
radio_app.command("probe")(probe_command)
