"""`swarmwire check`, `list`, `describe`, `schema`, `new` and `verify`: what there is, and whether it is in order."""

import json
import re
import sys
from importlib.resources import files
from keyword import iskeyword
from pathlib import Path
from string import Template
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.printable import printable
from swarmwire.deploy.cli.options import FAILED, Overrides, ScenarioFile
from swarmwire.deploy.machine import program
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.deploy.terminal.output import echo


def check_command(scenario: ScenarioFile, overrides: Overrides = None) -> None:
    """Check a scenario without running it: keys, values, agents and their needs, and room for robots and obstacles."""
    from swarmwire.deploy.runs.config import RunConfig
    from swarmwire.deploy.runs.plan import make_plan
    from swarmwire.world.placement.maps import map_hint
    from swarmwire.world.scenario_file import load_scenario

    checked = load_scenario(scenario, overrides or [])
    plan, world = make_plan(RunConfig(checked))
    static, engines = plan.static, " and ".join(world.engines)
    groups = ", ".join(f"{group.stop - group.start} x {group.body.name} ({group.name})" for group in static.groups)
    last_s = (plan.ticks - 1) / static.rate_hz  # start of the last tick
    late = [f"events.{place}" for place, event in enumerate(checked.events) if event.at_s > last_s]
    too_late = f"; too late to happen: {', '.join(late)}" if late else ""
    length = f"{checked.duration_s:g} s at {static.rate_hz} Hz"
    echo(f"OK {scenario}: {groups}, {length}, engine {engines}{too_late}")
    if hint := map_hint(checked.arena, checked.source):
        echo(f"hint: {hint}")


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
    # Imported here: pydantic, numba and scipy take a second, which --help should not.
    from swarmwire.deploy.cli.catalogue.kinds import kind_named, print_kinds, print_list

    console = TerminalConsole()
    found = None if kind is None else kind_named(kind)
    if found:
        print_list(found, console)
    else:
        print_kinds(console)


def describe_command(
    name: Annotated[
        str,
        typer.Argument(
            help="A name that `swarmwire list` prints, an agent class or a body's sheet of your own.", metavar="NAME"
        ),
    ],
) -> None:
    """Describe one name: its purpose, its parameters with unit, default and bounds, and the source of its numbers.

    For example a body, a key of a scenario, one of two things of the same name, an agent and a body of your own:

      swarmwire describe epuck

      swarmwire describe radio.loss

      swarmwire describe event:blackout

      swarmwire describe my_agent.py:Mine

      swarmwire describe mine.toml
    """
    # Imported here: pydantic, numba and scipy take a second, which --help should not.
    from swarmwire.deploy.cli.catalogue.kinds import find, print_entry

    print_entry(find(name), TerminalConsole())


def schema_command() -> None:
    """Print the JSON schema of a scenario, for editors and programs."""
    from swarmwire.world.scenario_file import scenario_schema

    echo(json.dumps(scenario_schema(), indent=2))


def new_command(
    name: Annotated[
        str,
        typer.Argument(
            help="The new folder, in the current one: small letters, digits and _, such as my_swarm.", metavar="NAME"
        ),
    ],
) -> None:
    """Create a swarm's folder: an agent, a scenario with a lossy radio, a passing test, and a README.

    For example, followed by a first run:

      swarmwire new my_swarm

      swarmwire run my_swarm
    """
    made = new_swarm(name)
    folder = made[0].parent
    echo(f"made {folder}: {', '.join(path.name for path in made)}")
    echo(f"run it:    {program()} run {folder}")
    echo(f"check it:  {program()} check {folder}")
    echo(f"test it:   {sys.executable} -m pytest {folder}")


STYLES = {"intact": "green", "not recorded": "dim", "partial": "yellow"}  # red for the others


def verify_command(
    folder: Annotated[Path, typer.Argument(help="A run folder.", metavar="RUN")],
) -> None:
    """Check a run folder: read all files, compare them with the summary, and list missing or damaged ones.

    Exit code 0: intact; 1: incomplete or damaged (the tables of a killed run stay readable); 2: no run folder.
    """
    from swarmwire.metrics.records.run_folder.verify import verify

    findings = verify(folder)
    console = TerminalConsole()
    table = Table(title=Text(str(folder)), title_justify="left", title_style="bold")
    for column in ("part", "state", ""):
        table.add_column(column, overflow="fold")
    for finding in findings:
        style = STYLES.get(finding.state, "red")
        table.add_row(Text(printable(finding.part)), Text(finding.state, style=style), Text(printable(finding.text)))
    console.print(table)
    bad = [finding for finding in findings if not finding.good]
    if bad:
        console.print("not intact: " + ", ".join(f"{finding.part} {finding.state}" for finding in bad), soft_wrap=True)
        raise typer.Exit(FAILED)
    console.print("intact: everything is there, readable, and as the summary says")


NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")


def new_swarm(name: str) -> list[Path]:
    """Make the folder `name` in the current one; its files. BadInput for a bad name, or if it cannot be made."""
    if not NAME.fullmatch(name) or iskeyword(name):
        expected = f"expected at most 40 small letters, digits and _ that start with a letter, got {name!r}"
        raise BadInput("NAME", "", expected)
    folder = Path(name)
    texts = {file: _text(template, name) for template, file in _files(name).items()}
    try:
        folder.mkdir()
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8")
    except FileExistsError:
        raise BadInput(str(folder), "", "expected a name that is free: something is there already") from None
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder that can be made: {error.strerror}") from error
    return [folder / file for file in texts]


def _files(name: str) -> dict[str, str]:
    """By file of the template: its name in the new folder."""
    return {
        "agent.py": "agent.py",
        "scenario.toml": "scenario.toml",
        "test_swarm.py": f"test_{name}.py",
        "README.md": "README.md",
    }


def _text(template: str, name: str) -> str:
    path = files("swarmwire.deploy").joinpath("swarm_template", template)
    return Template(path.read_text(encoding="utf-8")).substitute(name=name)
