"""`swarmwire new`: the folder of a new swarm."""

import re
import sys
from importlib.resources import files
from keyword import iskeyword
from pathlib import Path
from string import Template

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.machine import command_path
from swarmwire.deploy.terminal.output import echo

SWARM_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
TEMPLATES = ("agent.py", "scenario.toml", "test_swarm.py", "README.md")


def create_swarm(name: str) -> None:
    """Create the folder, and print the next commands."""
    created = new_swarm(name)
    folder = created[0].parent
    echo(f"made {folder}: {', '.join(path.name for path in created)}")
    echo(f"run it:    {command_path()} run {folder}")
    echo(f"check it:  {command_path()} check {folder}")
    echo(f"test it:   {sys.executable} -m pytest {folder}")


def new_swarm(name: str) -> list[Path]:
    """Create the folder `name` in the current one, and return its files; BadInput if that fails."""
    if not SWARM_NAME.fullmatch(name) or iskeyword(name):
        expected = f"expected at most 40 small letters, digits and _ that start with a letter, got {name!r}"
        raise BadInput("NAME", "", expected)
    folder = Path(name)
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


def _text(template: str, name: str) -> str:
    path = files("swarmwire.deploy").joinpath("swarm_template", template)
    return Template(path.read_text(encoding="utf-8")).substitute(name=name)
