"""The command line `swarmwire`: its commands in panels, and errors as one line each with their exit code.

A command's module is imported when the command is called, or its help is shown.
"""

import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from typing import Annotated, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption
from typer.main import get_command, get_group

from swarmwire.comms.base.errors import BadInput, Interrupted, SwarmwireError
from swarmwire.deploy.cli.catalogue.docstrings import flowing
from swarmwire.deploy.cli.options import BAD_INPUT, FAILED, INTERRUPTED
from swarmwire.deploy.machine import refusal
from swarmwire.deploy.terminal.output import echo

ABOUT = "A distributed swarm emulator: one world, an emulated lossy radio, agents in processes of their own."
RUN, VIEW, EXPERIMENTS = "Run", "View", "Experiments"
NETWORK, ROBOTS, INSPECT = "Network", "Robots", "Inspect"
BETWEEN_EXAMPLES = re.compile(r"^(  swarmwire .*)\n\n(?=  swarmwire )", re.MULTILINE)
AnyCommand = TyperCommand | TyperGroup
# Each command's panel in the help, and its module and function.
COMMANDS = {
    "new": (RUN, "inspect:new_command"),
    "run": (RUN, "run:run_command"),
    "repeat": (RUN, "run:repeat_command"),
    "exec": (RUN, "run:exec_command"),
    "view": (VIEW, "view:view_command"),
    "ui": (VIEW, "view:ui_command"),
    "export": (VIEW, "export:export_command"),
    "draw": (VIEW, "export:draw_command"),
    "sweep": (EXPERIMENTS, "sweep:sweep_command"),
    "tune": (EXPERIMENTS, "sweep:tune_command"),
    "compare": (EXPERIMENTS, "compare:compare_command"),
    "report": (EXPERIMENTS, "compare:report_command"),
    "world": (NETWORK, "world:world_command"),
    "join": (NETWORK, "world:join_command"),
    "router": (NETWORK, "router:router_command"),
    "sim-to-real": (ROBOTS, "compare:sim_to_real_command"),
    "check": (INSPECT, "inspect:check_command"),
    "list": (INSPECT, "inspect:list_command"),
    "describe": (INSPECT, "inspect:describe_command"),
    "schema": (INSPECT, "inspect:schema_command"),
    "verify": (INSPECT, "inspect:verify_command"),
    "ctl": (RUN, "ctl_events:ctl_app"),
    "certs": (NETWORK, "certs:certs_app"),
    "robots": (ROBOTS, "robots:robots_app"),
    "radio": (INSPECT, "radio:radio_app"),
}
CONTEXT: dict[str, Any] = {"help_option_names": ["-h", "--help"]}


class Commands(Mapping[str, AnyCommand]):
    """The commands by their names; each is imported when it is looked up."""

    def __getitem__(self, name: str) -> AnyCommand:
        return _command(name)

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


@cache
def _command(name: str) -> AnyCommand:
    panel, place = COMMANDS[name]
    module, _, attribute = place.partition(":")
    loaded = getattr(import_module(f"swarmwire.deploy.cli.{module}"), attribute)
    holder = typer.Typer(pretty_exceptions_enable=False, rich_markup_mode="rich", context_settings=CONTEXT)
    if isinstance(loaded, typer.Typer):
        holder.add_typer(loaded, name=name, rich_help_panel=panel)
    else:
        holder.command(name, rich_help_panel=panel)(loaded)
    let_help_flow(holder)
    group = get_group(holder)
    show_flags_without_type(group)
    return cast("AnyCommand", group.commands[name])


class LazyGroup(TyperGroup):
    """The program's commands, of which a call imports one."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = cast("Any", Commands())

    def get_params(self, ctx: Any) -> list[Any]:
        """The program's own options."""
        return _flags_without_type(super().get_params(ctx))


app = typer.Typer(
    cls=LazyGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings=CONTEXT,
)


def _print_version(asked: bool) -> None:
    if asked:
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
    """In help texts typer would write `--view <bool>`, as if the flag took a value."""
    context = command.context_class(command, parent, **command.context_settings)
    _flags_without_type(command.get_params(context))
    if isinstance(command, TyperGroup):
        for below in command.commands.values():
            show_flags_without_type(cast("AnyCommand", below), context)


def _flags_without_type(params: list[Any]) -> list[Any]:
    for param in params:
        if isinstance(param, TyperOption) and param.is_flag:
            param.metavar = ""
    return params


def main() -> None:
    """Entry point of `swarmwire`: every error of ours is one line; a failed agent's traceback is its own."""
    try:
        get_command(app)(sys.argv[1:])
    except BadInput as error:
        sys.exit(_fail(error, BAD_INPUT))
    except Interrupted as error:
        sys.exit(_fail(error, INTERRUPTED))
    except SwarmwireError as error:
        sys.exit(_fail(error, FAILED))
    except (ImportError, OSError, MemoryError, RuntimeError) as error:
        refused = refusal(error)
        if refused is None:
            raise
        sys.exit(_fail(refused, FAILED))


def _fail(error: SwarmwireError | str, code: int) -> int:
    echo(f"error: {error}".rstrip(), err=True)
    return code
