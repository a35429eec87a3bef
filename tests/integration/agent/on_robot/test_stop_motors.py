"""`swarmwire-agent stop-motors` as a program, where something that a stop does not need is wrong."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.agent.on_robot.installed import Command, deeds, install, robot_flags

HEAVY = ("numba", "scipy", "pymunk", "polars", "pydantic", "zenoh", "asyncio")
MAX_MODULES = 50  # modules of swarmwire: drivers, the reader of robot.toml, and elementary functions
LOADED = """
import json, sys
from swarmwire.agent.cli import main

assert main(sys.argv[1:]) == 0
print(json.dumps(sorted(sys.modules)))
"""


@pytest.fixture
def environment(tmp_path) -> dict[str, str]:
    return install(tmp_path / "installed")


def settings(folder: Path, file: Path, more: str = "", driver: str = "") -> Path:
    """A robot's file, with further lines, and further keys of its driver."""
    path = folder / "robot.toml"
    path.write_text(
        f'format = 1\nname = "flock-0"\nagent = "gone.py:Gone"\n'
        f'driver = {{ name = "written", address = "{file}"{driver} }}\n{more}'
    )
    return path


@pytest.mark.parametrize(
    ("more", "driver", "key"),
    [
        ("rate_hs = 10", "", "rate_hs"),
        ("watchdog_s = 0.5\nmax_linear_mps = ", "", ""),
        ('[network]\nlisten = ["tls/0.0.0.0:7557"]\nca = "none.pem"', "", "network.ca"),
        ('body = "none.toml"', "", "body"),
        ("", ", gome = true", "driver.gome"),
        ("", ", gone = 3", "driver.gone"),
    ],
)
def test_stop_motors_stops_then_names_a_fault_that_it_does_not_need(tmp_path, environment, more, driver, key):
    file, path = tmp_path / "deeds", settings(tmp_path, tmp_path / "deeds", more, driver)
    with Command(environment, "stop-motors", "--config", str(path)) as stopping:
        code, out, err = stopping.wait()
    assert (code, out) == (1, "flock-0: stopped\n"), err
    assert [deed for _, deed in deeds(file)] == ["open", "stop", "close"]
    assert err.startswith(f"{path}: {key}")
    assert err.count("\n") == 1


def test_stop_motors_by_flags_needs_no_file_that_can_be_read(tmp_path, environment):
    file = tmp_path / "deeds"
    with Command(environment, "stop-motors", *robot_flags(file), "--config", str(tmp_path / "none.toml")) as stopping:
        code, out, err = stopping.wait()
    assert (code, out) == (1, "robot-0: stopped\n")
    assert str(tmp_path / "none.toml") in err
    assert [deed for _, deed in deeds(file)] == ["open", "stop", "close"]


@pytest.mark.parametrize("wrong", ["driver = 3", 'driver = { name = "none", address = "/x" }', "driver = {"])
def test_stop_motors_without_a_driver_is_refused(tmp_path, environment, wrong):
    path = tmp_path / "robot.toml"
    path.write_text(f"format = 1\n{wrong}\n")
    with Command(environment, "stop-motors", "--config", str(path)) as stopping:
        code, out, err = stopping.wait()
    assert (code, out, err.count("\n")) == (2, "", 1)


def test_stop_motors_with_no_lock_folder_stops_and_says_so(tmp_path, environment):
    file, temporary = tmp_path / "deeds", tmp_path / "temporary"
    temporary.mkdir()
    (temporary / f"swarmwire-{os.getuid()}").touch()  # foreign file
    environment |= {"XDG_RUNTIME_DIR": str(file / "none"), "TMPDIR": str(temporary)}
    del environment["HOME"]
    with Command(environment, "stop-motors", *robot_flags(file)) as stopping:
        code, out, err = stopping.wait()
    if Path(f"/run/user/{os.getuid()}").is_dir():  # the user has another one
        assert (code, err) == (0, "")
    else:
        assert (code, err.partition(":")[0]) == (1, "locks of robots")
    assert out == "robot-0: stopped\n"
    assert [deed for _, deed in deeds(file)] == ["open", "stop", "close"]


def test_stop_motors_loads_what_it_needs_alone(tmp_path, environment):
    command = [sys.executable, "-c", LOADED, "stop-motors", *robot_flags(tmp_path / "deeds")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60)
    loaded = json.loads(done.stdout.splitlines()[-1])
    assert not set(HEAVY) & set(loaded)
    ours = [name for name in loaded if name.split(".")[0] == "swarmwire"]
    assert len(ours) < MAX_MODULES, ours
