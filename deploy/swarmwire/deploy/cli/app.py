"""The command line `swarmwire`: its commands, and errors as one line each with their exit code."""

import io
import sys
from importlib.metadata import version
from typing import Annotated

import typer

from swarmwire.comms.errors import BadInput, Interrupted, SwarmwireError
from swarmwire.comms.wire.ending import end_now
from swarmwire.deploy.cli.certs.group import certs_app
from swarmwire.deploy.cli.check import check_command
from swarmwire.deploy.cli.compare import compare_command
from swarmwire.deploy.cli.ctl.group import ctl_app
from swarmwire.deploy.cli.describe import describe_command
from swarmwire.deploy.cli.draw import draw_command
from swarmwire.deploy.cli.exit_codes import BAD_INPUT, FAILED, INTERRUPTED
from swarmwire.deploy.cli.export import export_command
from swarmwire.deploy.cli.help_text import let_help_flow
from swarmwire.deploy.cli.join import join_command
from swarmwire.deploy.cli.list_kinds import list_command
from swarmwire.deploy.cli.new import new_command
from swarmwire.deploy.cli.radio.group import radio_app
from swarmwire.deploy.cli.repeat import repeat_command
from swarmwire.deploy.cli.report import report_command
from swarmwire.deploy.cli.robots.group import robots_app
from swarmwire.deploy.cli.router import router_command
from swarmwire.deploy.cli.run import run_command
from swarmwire.deploy.cli.schema import schema_command
from swarmwire.deploy.cli.sim_to_real import sim_to_real_command
from swarmwire.deploy.cli.sweep import sweep_command
from swarmwire.deploy.cli.tune import tune_command
from swarmwire.deploy.cli.ui import ui_command
from swarmwire.deploy.cli.verify import verify_command
from swarmwire.deploy.cli.view import view_command
from swarmwire.deploy.cli.world import world_command
from swarmwire.deploy.kept_memory import share_heaps
from swarmwire.deploy.refusals import refusal

ABOUT = "A distributed swarm emulator: one world, an emulated lossy radio, agents in processes of their own."

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def _tell_version(asked: bool) -> None:
    if asked:
        typer.echo(f"swarmwire {version('swarmwire-deploy')}")
        raise typer.Exit


@app.callback(help=ABOUT)
def options(
    told: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Say which version this is.")
    ] = False,
) -> None:
    """What the program itself takes, before any command."""


app.command("run")(run_command)
app.command("world")(world_command)
app.command("join")(join_command)
app.command("sweep")(sweep_command)
app.command("tune")(tune_command)
app.command("repeat")(repeat_command)
app.command("check")(check_command)
app.command("draw")(draw_command)
app.command("export")(export_command)
app.command("view")(view_command)
app.command("ui")(ui_command)
app.command("schema")(schema_command)
app.command("list")(list_command)
app.command("describe")(describe_command)
app.command("new")(new_command)
app.command("verify")(verify_command)
app.command("compare")(compare_command)
app.command("report")(report_command)
app.command("sim-to-real")(sim_to_real_command)
app.command("router")(router_command)
app.add_typer(radio_app, name="radio")
app.add_typer(ctl_app, name="ctl")
app.add_typer(robots_app, name="robots")
app.add_typer(certs_app, name="certs")
let_help_flow(app)


def main() -> None:
    """Entry point of `swarmwire`: every error of ours is one line; a failed agent's traceback is its own."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a letter that a terminal lacks must not end a run
            stream.reconfigure(errors="replace")
    try:
        app(_with_factor(sys.argv[1:]))
    except BadInput as error:
        sys.exit(_fail(error, BAD_INPUT))
    except Interrupted as error:
        sys.exit(_fail(error, INTERRUPTED))
    except SwarmwireError as error:
        sys.exit(_fail(error, FAILED))
    except (OSError, MemoryError, RuntimeError) as error:
        told = refusal(error)
        if told is None:
            raise
        sys.exit(_fail(told, FAILED))


def program() -> None:
    """The process `swarmwire`."""
    share_heaps()  # before any library starts threads
    try:
        main()
    except SystemExit as ended:
        end_now(ended.code if isinstance(ended.code, int) else 0 if ended.code is None else FAILED)
        raise


def _with_factor(arguments: list[str]) -> list[str]:
    """The arguments, where a bare `--realtime` means 1: typer knows no option whose value may be left out."""
    whole: list[str] = []
    for argument in arguments:
        if whole and whole[-1] == "--realtime":
            factor = argument if _is_number(argument) else None
            whole[-1] += f"={factor or 1}"
            if factor:
                continue
        whole.append(argument)
    return [*whole[:-1], "--realtime=1"] if whole and whole[-1] == "--realtime" else whole


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _fail(error: SwarmwireError | str, code: int) -> int:
    typer.echo(f"error: {error}".rstrip(), err=True)
    return code
