"""The commands of `swarmwire`, from the command line itself."""

from collections.abc import Iterator
from typing import Any

from typer.main import get_command

from reference.markdown import NOTHING, code, sentence, table, toml_code
from swarmwire.deploy.cli.app import app


def command_tables() -> str:
    """Every command: what it does, how it is called, and its options."""
    parts: list[str] = []
    for name, command in _commands(get_command(app)):
        arguments = [_name(of) for of in command.params if of.param_type_name == "argument"]
        options = ["[OPTIONS]"] if len(arguments) < len(command.params) else []
        call = " ".join(["swarmwire", name, *arguments, *options])
        parts.append(f"## {code(name)}\n\n{code(call)}\n\n{command.help}\n")
        rows = [_row(of) for of in command.params]
        parts += [table(("argument or option", "default", "meaning"), rows)] if rows else []
    return "\n".join(parts)


def _commands(group: Any, within: str = "") -> Iterator[tuple[str, Any]]:
    """Every command with its name; those of a group within the group have its name in front."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, f"{within}{name} ")
        else:
            yield f"{within}{name}", command


def _row(of: Any) -> tuple[str, str, str]:
    default = "required" if of.required else NOTHING if of.default in (None, False) else toml_code(of.default)
    return code(_name(of)), default, sentence(of.help or "")


def _name(of: Any) -> str:
    """How it is written on the command line."""
    if of.param_type_name == "argument":
        return of.metavar or of.name.upper()
    value = "" if of.is_flag else f" {of.metavar or of.name.upper()}"
    return ", ".join(of.opts) + value
