"""The command line: `swarmwire run`, `check`, `schema`. Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput, Interrupted, SwarmwireError
from swarmwire.deploy.folder import default_folder, make_folder
from swarmwire.deploy.report import print_result
from swarmwire.deploy.result import Result

FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130
MOST_SEEDS = 10_000

app = typer.Typer(
    help="A distributed swarm emulator: one world, an emulated lossy radio, agents in processes of their own.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
ScenarioFile = Annotated[Path, typer.Argument(help="The scenario, a TOML file.", metavar="SCENARIO")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Set a value by its path, e.g. robots.flock.params.separation_m=0.3. Repeatable.",
        metavar="PATH=VALUE",
    ),
]


@app.command("run")
def run_command(
    scenario: ScenarioFile,
    runners: Annotated[
        str, typer.Option(help='Processes that run the agents: "none" (all in this one), a number, or "per-robot".')
    ] = "none",
    out: Annotated[
        Path | None, typer.Option(help="The run folder, new or empty. Default: runs/<scenario>-s<seed>-<UTC>.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed instead of the scenario's.")] = None,
    seeds: Annotated[str | None, typer.Option(help="One arena per seed, side by side: 1:9 (1 to 8) or 1,5,7.")] = None,
    overrides: Overrides = None,
    socket: Annotated[
        Path | None, typer.Option(help="Unix socket at which runners meet the world. Default: a private temporary one.")
    ] = None,
    realtime: Annotated[
        str | None,
        typer.Option(
            help="Keep to the wall clock, FACTOR (1 if left out) simulated seconds per second; wait for no runner.",
            metavar="[FACTOR]",
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Run a scenario, print what came of it, and write summary.json and run.rrd into the run folder.

    Without --realtime the same scenario and seed give the same run bit for bit, whatever --runners says.
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.progress import ProgressLine
    from swarmwire.deploy.run import Execution, choose_seeds
    from swarmwire.world.scenario_file import load_scenario

    console = Console(quiet=quiet, highlight=False)
    checked = load_scenario(scenario, overrides or [])
    chosen = choose_seeds(checked, seed, None if seeds is None else _seed_list(seeds))
    execution = Execution(checked, chosen, runners, socket=socket, realtime=realtime)
    folder = execution.folder = make_folder(out or default_folder(scenario.stem, chosen))
    result = execution.run([ProgressLine(execution.ticks, WallClock(), console)])
    print_result(result, console)
    _say_where(result, folder, console)
    if result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)


@app.command("check")
def check_command(scenario: ScenarioFile, overrides: Overrides = None) -> None:
    """Check a scenario without running it: keys, values, agents, what they need, and room for everything."""
    from swarmwire.deploy.run import Execution, choose_seeds
    from swarmwire.world.scenario_file import load_scenario

    checked = load_scenario(scenario, overrides or [])
    static = Execution(checked, choose_seeds(checked, None, None)).world.static
    groups = ", ".join(f"{group.stop - group.start} {group.body.name} ({group.name})" for group in static.groups)
    typer.echo(f"{scenario}: good: {groups}, {checked.duration_s:g} s at {static.rate_hz} Hz")


@app.command("screenshot")
def screenshot_command(
    recording: Annotated[Path, typer.Argument(help="A run folder, or its run.rrd.", metavar="RUN")],
    to: Annotated[Path, typer.Option(help="The PNG to write.")],
    tick: Annotated[int | None, typer.Option(help="The tick to show. Default: the last.")] = None,
) -> None:
    """Draw a recording as rerun's viewer shows it, without a screen. Needs a Vulkan driver; Mesa's will do."""
    from swarmwire.metrics.picture import render_png

    render_png(recording / "run.rrd" if recording.is_dir() else recording, to, tick)
    typer.echo(f"written: {to}")


@app.command("schema")
def schema_command() -> None:
    """Print the JSON schema of a scenario, for editors and programs."""
    from swarmwire.world.scenario_file import scenario_schema

    typer.echo(json.dumps(scenario_schema(), indent=2))


def main() -> None:
    """Entry point of `swarmwire`: every error of ours is one line; a failed agent's traceback is its own."""
    try:
        app(_with_factor(sys.argv[1:]))
    except BadInput as error:
        sys.exit(_fail(error, BAD_INPUT))
    except Interrupted as error:
        sys.exit(_fail(error, INTERRUPTED))
    except SwarmwireError as error:
        sys.exit(_fail(error, FAILED))


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


def _fail(error: SwarmwireError, code: int) -> int:
    typer.echo(f"error: {error}".rstrip(), err=True)
    return code


def _seed_list(text: str) -> list[int]:
    first, colon, last = text.partition(":")
    try:
        found = range(int(first), int(last)) if colon else [int(item) for item in text.split(",")]
    except ValueError:
        found = []
    if not 0 < len(found) <= MOST_SEEDS:
        expected = f"expected FIRST:END (END left out) or a list such as 1,5,7, {MOST_SEEDS} at most; got {text!r}"
        raise BadInput("--seeds", "", expected)
    return list(found)


def _say_where(result: Result, folder: Path, console: Console) -> None:
    recorded = f" of seed {result.arenas[0].seed}" if len(result.arenas) > 1 else ""
    console.print(f"written: {folder}/summary.json and the recording{recorded} {folder}/run.rrd", soft_wrap=True)
    viewer = Path(sys.executable).with_name("rerun")
    if viewer.is_relative_to(Path.cwd()):
        viewer = viewer.relative_to(Path.cwd())
    console.print(f"look at it: {viewer} {folder}/run.rrd", soft_wrap=True)
    console.print(f"  without a screen: {viewer} --serve-web --bind 127.0.0.1 {folder}/run.rrd", soft_wrap=True)
