"""How commands' docstrings become help: rich keeps their line breaks, which fit no terminal but our editors."""

import typer

from swarmwire.deploy.catalogue.docstrings import flowing


def let_help_flow(app: typer.Typer) -> None:
    """Give all commands of an app and of its groups a help text whose paragraphs are as wide as the terminal."""
    for command in app.registered_commands:
        command.help = flowing(command.help or command.callback.__doc__)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            let_help_flow(group.typer_instance)
