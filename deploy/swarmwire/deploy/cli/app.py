"""The command line `swarmwire`: its commands in panels, and errors as one line each with their exit code."""

import io
import re
import sys
from typing import Annotated, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption
from typer.main import get_command

from swarmwire.comms.errors import BadInput, Interrupted, SwarmwireError
from swarmwire.comms.wire.ending import end_now
from swarmwire.deploy.catalogue.docstrings import flowing
from swarmwire.deploy.cli.certs import certs_app
from swarmwire.deploy.cli.compare import compare_command, report_command, sim_to_real_command
from swarmwire.deploy.cli.ctl import ctl_app
from swarmwire.deploy.cli.ctl_events import events_app
from swarmwire.deploy.cli.export import draw_command, export_command
from swarmwire.deploy.cli.inspect import (
    check_command,
    describe_command,
    list_command,
    new_command,
    schema_command,
    verify_command,
)
from swarmwire.deploy.cli.options import BAD_INPUT, FAILED, INTERRUPTED
from swarmwire.deploy.cli.radio import radio_app
from swarmwire.deploy.cli.robots import robots_app
from swarmwire.deploy.cli.router import router_command
from swarmwire.deploy.cli.run import exec_command, repeat_command, run_command
from swarmwire.deploy.cli.sweep import sweep_command, tune_command
from swarmwire.deploy.cli.view import ui_command, view_command
from swarmwire.deploy.cli.world import join_command, world_command
from swarmwire.deploy.host import refusal, share_heaps

ABOUT = "A distributed swarm emulator: one world, an emulated lossy radio, agents in processes of their own."
RUN, VIEW, EXPERIMENTS = "Run", "View", "Experiments"
NETWORK, ROBOTS, INSPECT = "Network", "Robots", "Inspect"
BETWEEN_EXAMPLES = re.compile(r"^(  swarmwire .*)\n\n(?=  swarmwire )", re.MULTILINE)

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"swarmwire {version('swarmwire-deploy')}")
        raise typer.Exit


@app.callback(help=ABOUT)
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and end.")
    ] = False,
) -> None:
    """Options of the program itself, before any command."""


app.command("new", rich_help_panel=RUN)(new_command)
app.command("run", rich_help_panel=RUN)(run_command)
app.command("repeat", rich_help_panel=RUN)(repeat_command)
app.command("exec", rich_help_panel=RUN)(exec_command)
ctl_app.add_typer(events_app)
app.add_typer(ctl_app, name="ctl", rich_help_panel=RUN)
app.command("view", rich_help_panel=VIEW)(view_command)
app.command("ui", rich_help_panel=VIEW)(ui_command)
app.command("export", rich_help_panel=VIEW)(export_command)
app.command("draw", rich_help_panel=VIEW)(draw_command)
app.command("sweep", rich_help_panel=EXPERIMENTS)(sweep_command)
app.command("tune", rich_help_panel=EXPERIMENTS)(tune_command)
app.command("compare", rich_help_panel=EXPERIMENTS)(compare_command)
app.command("report", rich_help_panel=EXPERIMENTS)(report_command)
app.command("world", rich_help_panel=NETWORK)(world_command)
app.command("join", rich_help_panel=NETWORK)(join_command)
app.command("router", rich_help_panel=NETWORK)(router_command)
app.add_typer(certs_app, name="certs", rich_help_panel=NETWORK)
app.add_typer(robots_app, name="robots", rich_help_panel=ROBOTS)
app.command("sim-to-real", rich_help_panel=ROBOTS)(sim_to_real_command)
app.add_typer(radio_app, name="radio", rich_help_panel=INSPECT)
app.command("check", rich_help_panel=INSPECT)(check_command)
app.command("list", rich_help_panel=INSPECT)(list_command)
app.command("describe", rich_help_panel=INSPECT)(describe_command)
app.command("schema", rich_help_panel=INSPECT)(schema_command)
app.command("verify", rich_help_panel=INSPECT)(verify_command)


def let_help_flow(app: typer.Typer) -> None:
    """Make the paragraphs of all help texts of an app as wide as the terminal; rich would keep our line breaks."""
    for command in app.registered_commands:
        help_text = flowing(command.help or (command.callback and command.callback.__doc__))
        command.help = BETWEEN_EXAMPLES.sub(r"\1\n", help_text)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            let_help_flow(group.typer_instance)


def show_flags_without_type(command: TyperCommand | TyperGroup, parent: Any = None) -> None:
    """In help texts typer would write `--view <bool>`, as if the flag took a value."""
    context = command.context_class(command, parent, **command.context_settings)
    for param in command.get_params(context):
        if isinstance(param, TyperOption) and param.is_flag:
            param.metavar = ""
    if isinstance(command, TyperGroup):
        for below in command.commands.values():
            show_flags_without_type(cast("TyperCommand | TyperGroup", below), context)


let_help_flow(app)


def main() -> None:
    """Entry point of `swarmwire`: every error of ours is one line; a failed agent's traceback is its own."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a letter that a terminal lacks must not end a run
            stream.reconfigure(errors="replace")
    try:
        command = cast("TyperCommand | TyperGroup", get_command(app))
        show_flags_without_type(command)
        command(sys.argv[1:])
    except BadInput as error:
        sys.exit(_fail(error, BAD_INPUT))
    except Interrupted as error:
        sys.exit(_fail(error, INTERRUPTED))
    except SwarmwireError as error:
        sys.exit(_fail(error, FAILED))
    except (OSError, MemoryError, RuntimeError) as error:
        refused = refusal(error)
        if refused is None:
            raise
        sys.exit(_fail(refused, FAILED))


def program() -> None:
    """The process `swarmwire`."""
    share_heaps()  # before any library starts threads
    try:
        main()
    except SystemExit as ended:
        end_now(ended.code if isinstance(ended.code, int) else 0 if ended.code is None else FAILED)
        raise


def _fail(error: SwarmwireError | str, code: int) -> int:
    typer.echo(f"error: {error}".rstrip(), err=True)
    return code
