"""`robots estop` where something is wrong: with the fleet's file, with other robots, with names on the command line."""

import json
import socket
import subprocess
import sys

import pytest

from swarmwire.deploy.cli.estop import stop_robots
from swarmwire.deploy.robots import estop as estop_module
from tests.integration.deploy.fleet.test_commands import impatient, on_network

__all__ = ["impatient"]

BY_NETWORK = "flock-0 stopped, confirmed over the network"
HEAVY = ("numba", "scipy", "pymunk", "polars", "numpy", "pydantic", "rich", "typer", "asyncssh", "asyncio")
MAX_MODULES = 40  # of swarmwire
LOADED = """
import json, os, sys
from swarmwire.deploy.cli.program import program
import swarmwire.deploy.robots.estop as estop

def asked(*_):
    print(json.dumps(sorted(sys.modules)), flush=True)
    os._exit(0)

estop.ask_all = asked
sys.argv[0] = "swarmwire"
program()
"""


@pytest.fixture
def on_wire(fleet, impatient):
    """flock-0 in the swarm's network; its host is out of reach."""
    fleet.servers.close(fleet.add("flock-0"))
    with on_network(["flock-0"]) as (port, stopped):
        fleet.change("flock-0", network_port=port)
        yield stopped


@pytest.mark.parametrize(
    ("more", "key"),
    [
        ('[robots.flock-1]\naddress = "127.0.0.1"\ncolour = 3\n', "robots.flock-1.colour"),
        ('[robots.flock-1]\nadress = "127.0.0.1"\n', "robots.flock-1.adress"),
        ("[robots.flock-1]\n", "robots.flock-1.address"),
        ('[robots.flock-1]\naddress = "127.0.0', ""),
        ('[robots.flock-0]\naddress = "127.0.0.1"\nport = 1\n', ""),
        ('[robots.flock-1]\naddress = "127.0.0.1"\nport = 70000\n', "robots.flock-1.port"),
        ('[robots.flock-1]\naddress = "127.0.0.1"\ngroups = ["rad"]\n', "robots.flock-1.groups"),
        (f'[robots.flock-1]\naddress = "{"a" * 300}"\nseed = "x"\n', "robots.flock-1.seed"),
    ],
)
def test_estop_stops_the_others_then_names_the_fault_of_one_robot(fleet, robots, on_wire, more, key):
    fleet.file.write_text(fleet.file.read_text() + more)
    code, lines = robots("estop")
    assert (code, on_wire) == (1, ["flock-0"])
    named_twice = "[robots.flock-0]" in more
    assert any(line.startswith("flock-0 " if named_twice else BY_NETWORK) for line in lines)
    assert any(line.startswith(f"error: {fleet.file}: {key}") for line in lines)


def test_estop_stops_robots_despite_an_unknown_name(robots, on_wire):
    code, lines = robots("estop", "--robots", "flok-0,flock-0")
    assert (code, on_wire) == (1, ["flock-0"])
    assert any(line.startswith("error: --robots: ") for line in lines)
    code, lines = robots("estop", "--robots", "flok-0")
    assert (code, len(lines), on_wire) == (2, 1, ["flock-0"])


def test_estop_asks_the_network_without_the_extra_for_ssh(robots, on_wire, monkeypatch):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda name: None if name == "asyncssh" else name)
    code, (line,) = robots("estop")
    assert code == 0
    assert line.startswith(f"{BY_NETWORK} (by SSH: ")
    assert "swarmwire[fleet]" in line


def test_estop_with_no_swarm_or_certificates_goes_by_ssh(fleet, robots, impatient):
    fleet.add("flock-0")
    robots("deploy")
    robots("start")
    for key, named in (("swarm", "swarm"), ("insecure", "certificates")):
        table = dict(fleet.table)
        del fleet.table[key]
        fleet.write()
        code, lines = robots("estop")
        assert code == 1
        assert any(line.startswith("flock-0 stopped, confirmed by SSH (over the network: ") for line in lines)
        assert any(line.startswith(f"error: {fleet.file}: {named}") for line in lines)
        fleet.table = table


def test_estop_stops_all_others_despite_a_robot_that_hangs(fleet, on_wire, monkeypatch, capsys):
    """A robot whose sockets take connections and never answer, first in the file; SSH never gets to it."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        hanging = {"address": "127.0.0.1", "port": port, "network_port": port}
        fleet.table["robots"] = {"hanging": hanging, **fleet.table["robots"]}
        fleet.write()
        monkeypatch.setattr(estop_module, "CONNECT_TIMEOUT_S", 0.5)
        assert stop_robots(fleet.file, [], []) == 1
    out = capsys.readouterr().out.splitlines()
    assert on_wire == ["flock-0"]
    assert out[0].startswith("hanging  failed: NOT CONFIRMED: ")
    assert out[1].startswith("flock-0  stopped, confirmed over the network")


@pytest.mark.parametrize("options", [(), ("--robots", "flock-0", "--group", "red")])
def test_estop_loads_only_network_modules_before_the_request(fleet, options):
    fleet.add("flock-0", groups=["red"])
    command = [sys.executable, "-c", LOADED, "robots", "estop", str(fleet.file), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    loaded = json.loads(done.stdout)
    assert not set(HEAVY) & set(loaded)
    ours = [name for name in loaded if name.split(".")[0] == "swarmwire"]
    assert len(ours) < MAX_MODULES, ours


def test_estop_as_a_program_stops_and_ends(fleet, on_wire):
    command = [sys.executable, "-m", "swarmwire.deploy", "robots", "estop", str(fleet.file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr, on_wire) == (0, "", ["flock-0"])
    assert done.stdout.startswith("flock-0  stopped, confirmed over the network")
    done = subprocess.run([*command, "--name", "flock-0"], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, on_wire) == (2, ["flock-0"])
