"""The commands `new`, `test`, `import`, `check`, `list`, `describe`, `schema` and `verify`."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.options import Overrides, ScenarioFile


def check_command(scenario: ScenarioFile, overrides: Overrides = None) -> None:
    """Check a scenario without running it: keys, values, agents and their needs, and room for robots and obstacles."""
    from swarmwire.deploy.cli.actions.check import check_scenario

    check_scenario(scenario, overrides or [])


def list_command(
    kind: Annotated[
        str | None,
        typer.Argument(help="bodies, sensors, behaviours, events, metrics, …; all kinds if left out.", metavar="KIND"),
    ] = None,
) -> None:
    """List the names that a scenario or an agent can use: the kinds, or all names of one kind.

    For example all events, and then one of them:

      swarmwire list events

      swarmwire describe kill
    """
    from swarmwire.deploy.cli.catalogue.kinds import kind_named, print_kinds, print_list
    from swarmwire.deploy.terminal.console import TerminalConsole

    console = TerminalConsole()
    if kind:
        print_list(kind_named(kind), console)
    else:
        print_kinds(console)


def describe_command(
    name: Annotated[
        str,
        typer.Argument(
            help="A name that `swarmwire list` prints, an agent's or metric's class, or a body's sheet, of your own.",
            metavar="NAME",
        ),
    ],
) -> None:
    """Describe one name: its purpose, its parameters with unit, default and bounds, and the source of its numbers.

    For example a body, a key of a scenario, one of two things of the same name; an agent, a metric and a body of yours:

      swarmwire describe epuck

      swarmwire describe radio.loss

      swarmwire describe event:blackout

      swarmwire describe my_agent.py:Mine

      swarmwire describe spread.py:Spread

      swarmwire describe mine.toml
    """
    from swarmwire.deploy.cli.catalogue.kinds import find, print_entry
    from swarmwire.deploy.terminal.console import TerminalConsole

    print_entry(find(name), TerminalConsole())


def schema_command() -> None:
    """Print the JSON schema of a scenario, for editors and programs."""
    from swarmwire.deploy.cli.actions.check import print_schema

    print_schema()


def new_command(
    folder: Annotated[
        Path,
        typer.Argument(
            help="The new folder, such as my_swarm or ../my_swarm; its name is small letters, digits and _.",
            metavar="FOLDER",
        ),
    ],
) -> None:
    """Create a swarm's folder: an agent, a scenario with a lossy radio, a passing test, and a README.

    For example, followed by a first run:

      swarmwire new my_swarm

      swarmwire run my_swarm

      swarmwire test my_swarm
    """
    from swarmwire.deploy.cli.actions.new import create_swarm

    create_swarm(folder)


def run_tests_command(
    folder: Annotated[Path, typer.Argument(help="A folder with tests, or a file.", metavar="FOLDER")] = Path(),
    words: Annotated[list[str] | None, typer.Argument(help="Arguments of pytest.", metavar="-- [WORDS]...")] = None,
) -> None:
    """Run the tests of a swarm by pytest, in swarmwire's own environment.

    For example:

      swarmwire test my_swarm

      swarmwire test my_swarm -- -x -k received
    """
    from swarmwire.deploy.cli.actions.new import run_tests

    run_tests(folder, words or [])


def import_command(
    experiment: Annotated[Path, typer.Argument(help="An experiment of ARGoS 3, a .argos file.", metavar="FILE")],
    folder: Annotated[
        Path, typer.Option("--out", help="Existing folder for the scenario and the agents' file.", metavar="FOLDER")
    ] = Path(),
) -> None:
    """Make a scenario, and the skeleton of its agents, from an ARGoS experiment; list what has no counterpart.

    For example:

      swarmwire import experiments/foraging.argos

      swarmwire run foraging.toml
    """
    from swarmwire.deploy.cli.actions.import_argos import import_argos

    import_argos(experiment, folder)


def verify_command(
    folder: Annotated[Path, typer.Argument(help="A run folder.", metavar="RUN")],
) -> None:
    """Check a run folder: read all files, compare them with the summary, and list missing or damaged ones.

    Exit code 0: intact; 1: incomplete or damaged (the tables of a killed run stay readable); 2: no run folder.
    """
    from swarmwire.deploy.cli.actions.verify import verify_folder

    verify_folder(folder)
