"""`swarmwire new` and `test`: the folder of a new swarm, and its tests."""

import re
import subprocess
import sys
from collections.abc import Sequence
from importlib.resources import files
from keyword import iskeyword
from pathlib import Path
from string import Template

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import TEST
from swarmwire.deploy.machine import command_path
from swarmwire.deploy.terminal.output import echo

SWARM_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
TEMPLATES = ("agent.py", "scenario.toml", "test_swarm.py", "README.md")


def create_swarm(folder: Path) -> None:
    """Create the folder, and print the next commands."""
    created = new_swarm(folder)
    echo(f"made {folder}: {', '.join(path.name for path in created)}")
    echo(f"run it:    {command_path()} run {folder}")
    echo(f"check it:  {command_path()} check {folder}")
    echo(f"test it:   {command_path()} test {folder}")


def new_swarm(folder: Path) -> list[Path]:
    """Create the folder, whose name is that of the swarm, and return its files; BadInput if that fails."""
    name = folder.name
    if not SWARM_NAME.fullmatch(name) or iskeyword(name):
        expected = f"expected at most 40 small letters, digits and _ that start with a letter, got {name!r}"
        raise BadInput("FOLDER", "", expected)
    texts = {template.replace("swarm", name): _text(template, name) for template in TEMPLATES}
    try:
        folder.mkdir()
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8")
    except FileExistsError:
        raise BadInput(str(folder), "", "expected a name that is free: something is there already") from None
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder that can be made: {error.strerror}") from error
    return [folder / file for file in texts]


def run_tests(folder: Path, words: Sequence[str]) -> None:
    """Run pytest with these arguments in a process of its own, and end with its exit code; BadInput without pytest."""
    TEST.need("test")
    command = [sys.executable, "-m", "pytest", str(folder), *words]
    raise typer.Exit(subprocess.run(command, check=False).returncode)


def _text(template: str, name: str) -> str:
    path = files("swarmwire.deploy").joinpath("swarm_template", template)
    return Template(path.read_text(encoding="utf-8")).substitute(name=name)
