"""How commands' docstrings become help: rich keeps their line breaks, which fit no terminal but our editors."""

import inspect

import typer


def let_help_flow(app: typer.Typer) -> None:
    """Give all commands of an app and of its groups a help text whose paragraphs are as wide as the terminal."""
    for command in app.registered_commands:
        command.help = flowing(command.help or inspect.getdoc(command.callback) or "")
    for group in app.registered_groups:
        if group.typer_instance is not None:
            let_help_flow(group.typer_instance)


def flowing(text: str) -> str:
    r"""The text with a line for each paragraph; those that are indented, and lists, stay as they are.

    >>> flowing("One\nline.\n\n  as it\n  stands")
    'One line.\n\n  as it\n  stands'
    """
    return "\n\n".join(map(_paragraph, inspect.cleandoc(text).split("\n\n")))


def _paragraph(text: str) -> str:
    lines = text.split("\n")
    kept = any(line.startswith((" ", "- ", "* ", "\b")) for line in lines)
    return text if kept else " ".join(lines)
