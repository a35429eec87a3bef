"""The program `swarmwire`: its commands in panels, and errors as one line each with their exit code.

`swarmwire --help` imports no command. The module of a command is imported when the command is called or its help is
printed; it declares options and help texts, and in turn imports its action when it runs.
"""

import re
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache, wraps
from importlib import import_module
from typing import Annotated, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption
from typer.main import get_command, get_group

from swarmwire.comms.base.errors import BadInput, Interrupted, SwarmwireError
from swarmwire.deploy.cli.commands import COMMANDS, CommandEntry
from swarmwire.deploy.cli.options import BAD_INPUT, FAILED, INTERRUPTED
from swarmwire.deploy.machine import refusal
from swarmwire.deploy.terminal.output import echo, flowing

ABOUT = "A distributed swarm emulator: one world, an emulated lossy radio, agents in processes of their own."
BETWEEN_EXAMPLES = re.compile(r"^(  swarmwire .*)\n\n(?=  swarmwire )", re.MULTILINE)
GATEWAYS = "gateways."  # prefix of fields of `Gateways`, such as `gateways.swarm`
QUOTED_NAME = re.compile(r"`([a-z_]+)`")
AnyCommand = TyperCommand | TyperGroup
CONTEXT: dict[str, Any] = {"help_option_names": ["-h", "--help"]}


class LoadedCommands(Mapping[str, AnyCommand]):
    """All commands by name; the lookup of a command imports its module."""

    def __getitem__(self, name: str) -> AnyCommand:
        return load_command(name)

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


@cache
def load_command(name: str) -> AnyCommand:
    """Return a command, or a group of commands, whose module is imported; KeyError for an unknown name."""
    entry = COMMANDS[name]
    module, _, attribute = entry.function.partition(":")
    function = getattr(import_module(f"swarmwire.deploy.cli.{module}"), attribute)
    single = typer.Typer(pretty_exceptions_enable=False, rich_markup_mode="rich", context_settings=CONTEXT)
    if isinstance(function, typer.Typer):
        single.add_typer(function, name=name, rich_help_panel=entry.panel)
    else:
        single.command(name, rich_help_panel=entry.panel)(function)
    let_help_flow(single)
    group = get_group(single)
    show_flags_without_type(group)
    name_options_in_errors(group)
    return cast("AnyCommand", group.commands[name])


class ListedCommand(TyperCommand):
    """A command as the list of commands shows it; a call imports its module."""

    def __init__(self, name: str, entry: CommandEntry) -> None:
        super().__init__(name, help=entry.help, rich_help_panel=entry.panel)

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of the loaded command."""
        return load_command(str(self.name)).make_context(info_name, args, parent, **extra)


class LazyGroup(TyperGroup):
    """All commands of the program, of which a call imports one."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = cast("Any", LoadedCommands())

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command without its module; None for an unknown name."""
        entry = COMMANDS.get(cmd_name)
        return None if entry is None else ListedCommand(cmd_name, entry)

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options of the program itself."""
        return _flags_without_type(super().get_params(ctx))


app = typer.Typer(
    cls=LazyGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings=CONTEXT,
)


def _print_version(requested: bool) -> None:
    if requested:
        from importlib.metadata import version

        echo(f"swarmwire {version('swarmwire-deploy')}")
        raise typer.Exit


@app.callback(help=ABOUT)
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and end.")
    ] = False,
) -> None:
    """Options of the program itself, before any command."""


def let_help_flow(app: typer.Typer) -> None:
    """Make the paragraphs of all help texts of an app as wide as the terminal; rich would keep our line breaks."""
    for command in app.registered_commands:
        help_text = flowing(command.help or (command.callback and command.callback.__doc__))
        command.help = BETWEEN_EXAMPLES.sub(r"\1\n", help_text)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            let_help_flow(group.typer_instance)


def show_flags_without_type(command: AnyCommand, parent: Any = None) -> None:
    """Print `--view` in help texts, where typer prints `--view <bool>`."""
    context = command.context_class(command, parent, **command.context_settings)
    _flags_without_type(command.get_params(context))
    if isinstance(command, TyperGroup):
        for subcommand in command.commands.values():
            show_flags_without_type(cast("AnyCommand", subcommand), context)


def _flags_without_type(params: list[Any]) -> list[Any]:
    for param in params:
        if isinstance(param, TyperOption) and param.is_flag:
            param.metavar = ""
            if param.default is None:  # typer's flags of shell completion; it would load pydantic to convert None
                param.default = False
    return params


def name_options_in_errors(command: AnyCommand) -> None:
    """Let BadInput of a command name its options, such as `--threads` where the Python interface names `threads`."""
    if isinstance(command, TyperGroup):
        for subcommand in command.commands.values():
            name_options_in_errors(cast("AnyCommand", subcommand))
    elif command.callback is not None:
        options = {
            str(param.name): param.opts[0] if isinstance(param, TyperOption) else str(param.metavar or param.name)
            for param in command.params
        }
        command.callback = _naming_options(command.callback, options)


def _naming_options(callback: Callable[..., Any], options: Mapping[str, str]) -> Callable[..., Any]:
    @wraps(callback)
    def renamed(*arguments: Any, **values: Any) -> Any:
        try:
            return callback(*arguments, **values)
        except BadInput as error:
            expected = QUOTED_NAME.sub(lambda name: options.get(name[1], name[0]), error.expected)
            where = options.get(error.where.removeprefix(GATEWAYS), error.where)
            raise BadInput(where, error.key, expected) from error

    return renamed


def main() -> None:
    """Run the command line, and print errors of swarmwire as one line; a failed agent's traceback follows its line."""
    try:
        get_command(app)(sys.argv[1:])
    except BadInput as error:
        sys.exit(_fail(error, BAD_INPUT))
    except Interrupted as error:
        sys.exit(_fail(error, INTERRUPTED))
    except SwarmwireError as error:
        sys.exit(_fail(error, FAILED))
    except (ImportError, OSError, MemoryError, RuntimeError) as error:
        reason = refusal(error)
        if reason is None:
            raise
        sys.exit(_fail(reason, FAILED))


def _fail(error: SwarmwireError | str, code: int) -> int:
    echo(f"error: {error}".rstrip(), err=True)
    return code
