"""Modules that commands for robots and certificates load: no simulator, and no library for numbers or tables."""

import json
import subprocess
import sys

HEAVY = {
    "llvmlite", "matplotlib", "numba", "numpy", "polars", "pymunk", "scipy", "zenoh",
    "swarmwire.comms.radio", "swarmwire.deploy.campaigns", "swarmwire.deploy.runs", "swarmwire.metrics",
    "swarmwire.world",
}  # fmt: skip
LOADED = """
import json, sys
from swarmwire.deploy.cli.app import main

results = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["swarmwire", *arguments]
    try:
        main()
        code = 0
    except SystemExit as end:
        code = end.code
    results.append([arguments[:2], code or 0, sorted(sys.modules)])
sys.__stdout__.write("\\n" + json.dumps(results))
"""


def loaded_modules(*commands: list[object]) -> list[tuple[list[str], int, set[str]]]:
    """Run commands in one process; return for each its name, its exit code and all modules loaded so far."""
    texts = json.dumps([[str(argument) for argument in command] for command in commands])
    command = [sys.executable, "-c", LOADED, texts]
    process = subprocess.run(command, capture_output=True, text=True, check=True, timeout=100)
    results = json.loads(process.stdout.rpartition("\n")[2])
    return [(name, code, set(modules)) for name, code, modules in results]


def test_commands_for_certificates_load_no_simulator(fleet, tmp_path):
    fleet.add("flock-0")
    folder = tmp_path / "ca"
    commands = [
        ["certs", "init", folder],
        ["certs", "issue", folder, "--fleet", fleet.file],
        ["certs", "list", folder],
        ["certs", "revoke", folder, "flock-0"],
    ]
    for command, code, modules in loaded_modules(*commands):
        assert (command, code, modules & HEAVY) == (command, 0, set())
        assert "asyncssh" not in modules


def test_commands_for_units_of_robots_load_no_simulator(fleet):
    fleet.servers.close(fleet.add("flock-0"))
    commands = [["robots", name, fleet.file] for name in ("status", "start", "stop", "rollback", "logs")]
    for command, code, modules in loaded_modules(*commands):
        assert (command, code, modules & HEAVY) == (command, 1, set())
