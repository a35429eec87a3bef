"""The group of commands `swarmwire radio`."""

import typer

from swarmwire.deploy.commands.radio.fit import fit_command

radio_app = typer.Typer(help="Radios: what logs of real ones say.", no_args_is_help=True)


@radio_app.callback()
def radio() -> None:
    """Radios: what logs of real ones say."""


radio_app.command("fit")(fit_command)
