"""Modules that commands load: help needs no library of the simulator, and a request to a run needs no compiler."""

import json
import subprocess
import sys

import pytest

from swarmwire.deploy.cli.app import load_command
from swarmwire.deploy.cli.commands import COMMANDS

SIMULATOR = ("matplotlib", "numba", "numpy", "polars", "pymunk", "rerun", "scipy", "zenoh")
CALL = """
import json, sys
from typer.main import get_command
from swarmwire.deploy.cli.app import app, main

def call(*arguments):
    sys.argv[1:] = arguments
    try:
        main()
    except SystemExit:
        pass

def loaded():
    print(json.dumps(sorted(sys.modules)), file=sys.stderr)

{calls}
loaded()
"""
HELP_OF_ALL = """
for name, command in get_command(app).commands.items():
    call(name, "--help")
    for subcommand in getattr(command, "commands", ()):
        call(name, subcommand, "--help")
"""


def loaded_by(calls: str) -> set[str]:
    """The modules that a process has loaded after these calls."""
    command = [sys.executable, "-c", CALL.format(calls=calls)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    return set(json.loads(done.stderr.splitlines()[-1]))


def test_help_of_the_program_loads_no_command():
    modules = loaded_by('call("--help")')
    commands = {name for name in modules if name.startswith("swarmwire.deploy.cli.")}
    assert commands == {f"swarmwire.deploy.cli.{name}" for name in ("app", "commands", "options", "program")}
    assert not modules & {*SIMULATOR, "msgspec", "pydantic"}


def test_help_of_every_command_loads_no_action_and_no_library_of_the_simulator():
    modules = loaded_by(HELP_OF_ALL)
    assert {"swarmwire.deploy.cli.run", "swarmwire.deploy.cli.ctl", "swarmwire.deploy.cli.robots"} <= modules
    assert not [name for name in modules if name.startswith("swarmwire.deploy.cli.actions")]
    assert not modules & {*SIMULATOR, "msgspec"}  # typer converts options of groups with pydantic


@pytest.mark.parametrize("arguments", [("ctl", "--run", "nowhere", "pause"), ("ctl", "--run", "nowhere", "status")])
def test_request_to_a_run_loads_no_simulator(arguments):
    modules = loaded_by(f"call(*{arguments!r})")
    assert "swarmwire.deploy.cli.actions.control" in modules
    assert not modules & (set(SIMULATOR) - {"numpy", "zenoh"})
    assert "swarmwire.deploy.runs.simulation" not in modules


def test_view_of_a_recording_loads_no_simulator(tmp_path):
    recording = tmp_path / "cut.rrd"
    recording.write_bytes(b"RRF2" + bytes(9))
    modules = loaded_by(f'call("view", "{recording}", "--web")')
    assert "swarmwire.deploy.live.viewer" in modules
    assert not modules & (set(SIMULATOR) - {"numpy", "zenoh"})
    assert not modules & {"swarmwire.deploy.runs.simulation", "swarmwire.world.world"}


@pytest.mark.parametrize("name", COMMANDS)
def test_list_of_commands_has_the_first_paragraph_of_each_help(name):
    help_text = load_command(name).help
    assert COMMANDS[name].help == help_text.partition("\n\n")[0]
