"""A folder to start from: an agent, a scenario, their test and a README, from the files in `swarm_template/`."""

import re
from importlib.resources import files
from keyword import iskeyword
from pathlib import Path
from string import Template

from swarmwire.comms.errors import BadInput

NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")


def new_swarm(name: str, within: Path) -> list[Path]:
    """Make the folder `name` in `within`; its files. BadInput for a bad name, or where the folder cannot be made."""
    if not NAME.fullmatch(name) or iskeyword(name):
        expected = f"expected at most 40 small letters, digits and _ that start with a letter, got {name!r}"
        raise BadInput("NAME", "", expected)
    folder = within / name
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
